//! What a robot's processes need not be able to do.
//!
//! A robot needs shared memory in /dev/shm, sockets in its runtime directory, real-time scheduling and locked
//! memory, and nothing else of the machine: no network, no device, no other file system, no privilege.

use super::unit::Unit;
use crate::config::System;
use hilare_operator::address::{is_open, parse};
use std::path::Path;

/// Directories that `ProtectHome=` hides.
const HOMES: [&str; 3] = ["/home", "/root", "/run/user"];
/// Directories that `PrivateTmp=` hides.
const TEMPORARY: [&str; 2] = ["/tmp", "/var/tmp"];

/// What works without privilege, in units of a user as well: filters of system calls.
const FILTERS: [(&str, &str); 8] = [
    ("NoNewPrivileges", "yes"),
    ("RestrictNamespaces", "yes"),
    ("RestrictSUIDSGID", "yes"),
    ("LockPersonality", "yes"),
    ("MemoryDenyWriteExecute", "yes"),
    ("SystemCallArchitectures", "native"),
    ("SystemCallFilter", "@system-service"),
    ("UMask", "0077"),
];

/// What only the system's service manager can do: name spaces, capabilities, device rules.
const WALLS: [(&str, &str); 12] = [
    ("CapabilityBoundingSet", ""),
    ("ProtectSystem", "strict"),
    ("PrivateDevices", "yes"),
    ("ProtectProc", "invisible"),
    ("ProcSubset", "pid"),
    ("ProtectClock", "yes"),
    ("ProtectControlGroups", "yes"),
    ("ProtectHostname", "yes"),
    ("ProtectKernelLogs", "yes"),
    ("ProtectKernelModules", "yes"),
    ("ProtectKernelTunables", "yes"),
    ("SystemCallFilter", "~@privileged @keyring"),
];

/// What of the network there is within.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Network {
    /// Nothing.
    None,
    /// This machine's own addresses, where the page listens.
    Loopback,
    /// All of it: the page listens for other machines.
    Open,
}

impl Network {
    /// What the page and the live view of a system need.
    pub(super) fn of(system: &System) -> Self {
        match parse(&system.listen) {
            Ok(address) if is_open(address) => Self::Open,
            Ok(_) => Self::Loopback,
            // The live view listens nowhere else.
            Err(_) if !system.foxglove.is_empty() => Self::Loopback,
            Err(_) => Self::None,
        }
    }

    const fn families(self) -> &'static str {
        match self {
            Self::None => "AF_UNIX",
            Self::Loopback | Self::Open => "AF_UNIX AF_INET AF_INET6",
        }
    }
}

/// Writes the sandbox of a unit. `files` are those it must be able to read: program, system file, map,
/// controllers that are programs of their own.
pub(super) fn write(unit: &mut Unit, user_unit: bool, network: Network, files: &[&Path]) {
    unit.why("The sandbox. Real-time scheduling and shared memory of the same user must stay possible.");
    unit.set("RestrictRealtime", "no");
    unit.set("RemoveIPC", "no");
    unit.set("RestrictAddressFamilies", network.families());
    for (key, value) in FILTERS {
        unit.set(key, value);
    }
    if user_unit {
        return;
    }
    unit.set("IPAddressDeny", "any");
    match network {
        Network::None => unit.set("PrivateNetwork", "yes"),
        Network::Loopback => unit.set("IPAddressAllow", "localhost"),
        Network::Open => unit.set("IPAddressAllow", "any"),
    }
    for (key, value) in WALLS {
        unit.set(key, value);
    }
    let below = |dirs: &[&str]| files.iter().any(|file| dirs.iter().any(|dir| file.starts_with(dir)));
    // A home that holds the program or the system file stays in sight, to be read.
    unit.set("ProtectHome", if below(&HOMES) { "read-only" } else { "yes" });
    unit.set("PrivateTmp", if below(&TEMPORARY) { "no" } else { "yes" });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_robot_reads_stays_in_sight() {
        let written = |user_unit, file: &str| {
            let mut unit = Unit::new("x.service".to_owned());
            write(&mut unit, user_unit, Network::None, &[Path::new("/usr/bin/hilare"), Path::new(file)]);
            unit.text
        };
        for (file, home, temporary) in [
            ("epuck", "yes", "yes"),
            ("/home", "read-only", "yes"),
            ("/var/tmp/mule.toml", "yes", "no"),
            ("/homes/mule.toml", "yes", "yes"),
        ] {
            let text = written(false, file);
            assert!(text.contains(&format!("\nProtectHome={home}\n")), "{file}: {text}");
            assert!(text.contains(&format!("\nPrivateTmp={temporary}\n")), "{file}: {text}");
        }
        let text = written(true, "epuck");
        assert!(text.contains("NoNewPrivileges=yes") && !text.contains("ProtectSystem"), "{text}");
    }

    #[test]
    fn a_page_has_the_loopback_and_nothing_else_has_any_network() {
        let written = |network| {
            let mut unit = Unit::new("x.service".to_owned());
            write(&mut unit, false, network, &[]);
            unit.text
        };
        let (none, loopback) = (written(Network::None), written(Network::Loopback));
        assert!(
            none.contains("\nPrivateNetwork=yes\n") && none.contains("\nRestrictAddressFamilies=AF_UNIX\n")
        );
        assert!(none.contains("\nIPAddressDeny=any\n") && loopback.contains("\nIPAddressDeny=any\n"));
        assert!(loopback.contains("\nIPAddressAllow=localhost\n") && !loopback.contains("PrivateNetwork"));
        assert!(loopback.contains("=AF_UNIX AF_INET AF_INET6\n") && !none.contains("AF_INET"));
        assert!(written(Network::Open).contains("\nIPAddressAllow=any\n"));
        let of = |(listen, foxglove): (&str, &str)| {
            let mut system = System::default();
            (system.listen, system.foxglove) = (listen.to_owned(), foxglove.to_owned());
            Network::of(&system)
        };
        let view = "127.0.0.1:8765";
        let kinds =
            [("", ""), ("127.0.0.1:7070", ""), ("[::1]:7070", view), ("", view), ("0.0.0.0:7070", view)]
                .map(of);
        let expected =
            [Network::None, Network::Loopback, Network::Loopback, Network::Loopback, Network::Open];
        assert_eq!(kinds, expected);
    }
}
