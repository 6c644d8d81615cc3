//! The ports of the page and the live view: taken, or who has them.

use crate::config::System;
use hilare_operator::address::parse;
use std::fs;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::Path;

/// A listening socket, in the state column of /proc/net/tcp.
const LISTENING: &str = "0A";
/// Sockets there are; a sandbox may hide all of /proc but what is of a process.
pub(super) const TABLES: [&str; 2] = ["/proc/self/net/tcp", "/proc/self/net/tcp6"];

/// The key of the page's address.
pub const LISTEN: &str = "operator.listen";
/// The key of the live view's address.
pub const FOXGLOVE: &str = "operator.foxglove";

/// Binds the address in a key, or says why not and who has it.
pub fn bind(key: &str, listen: &str) -> Result<TcpListener, String> {
    let address = parse(listen)?;
    TcpListener::bind(address).map_err(|error| {
        let place = format!("{key} {address}");
        match error.kind() {
            io::ErrorKind::AddrInUse => match holder(address) {
                Some(holder) => format!("{place}: {holder} has this port; end it, or choose another port"),
                None => format!(
                    "{place}: another program has this port; choose another (ss -ltnp tells whose it is)"
                ),
            },
            io::ErrorKind::PermissionDenied => {
                format!("{place}: {error}; ports below 1024 are the superuser's")
            }
            _ => format!("{place}: {error}; choose another address"),
        }
    })
}

/// Says why one could not listen there. What only the process that does can find out, it finds out.
pub fn check(key: &str, listen: &str) -> Result<(), String> {
    if listen.is_empty() {
        return Ok(());
    }
    bind(key, listen).map(drop)
}

/// The same of all that a system wants.
pub fn check_all(system: &System) -> Result<(), String> {
    check(LISTEN, &system.listen).and_then(|()| check(FOXGLOVE, &system.foxglove))
}

/// The process that listens where `address` would, as far as it can be seen by this user.
fn holder(address: SocketAddr) -> Option<String> {
    let tables = TABLES.map(|table| fs::read_to_string(table).unwrap_or_default());
    let inodes: Vec<u64> = tables.iter().flat_map(|table| listeners(table, address.port())).collect();
    let wanted: Vec<String> = inodes.iter().map(|inode| format!("socket:[{inode}]")).collect();
    let pids =
        fs::read_dir("/proc").ok()?.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    pids.into_iter().find_map(|pid: u32| {
        let files = fs::read_dir(format!("/proc/{pid}/fd")).ok()?;
        let is_wanted =
            |target: std::path::PathBuf| wanted.iter().any(|socket| target.as_os_str() == &**socket);
        let holds = files.flatten().filter_map(|file| fs::read_link(file.path()).ok()).any(is_wanted);
        holds.then(|| format!("{} (pid {pid})", command(pid)))
    })
}

/// Inodes of the sockets that listen on a port, from the text of /proc/net/tcp or tcp6. On which of its addresses
/// does not matter: that it could not be bound is known.
fn listeners(table: &str, port: u16) -> Vec<u64> {
    let listener = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (_, of) = fields.get(1)?.rsplit_once(':')?;
        let listens = u16::from_str_radix(of, 16) == Ok(port) && fields.get(3) == Some(&LISTENING);
        listens.then(|| fields.get(9)?.parse().ok()).flatten()
    };
    table.lines().skip(1).filter_map(listener).collect()
}

/// Whose page it is, or name and first arguments of a process, in a line.
fn command(pid: u32) -> String {
    let bytes = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let words: Vec<&str> = text.split('\0').collect();
    if let Some(robot) = robot_of(&words) {
        return format!("the page of robot {:?}", crate::logging::plain(robot));
    }
    let line = crate::logging::plain(words.join(" ").trim());
    if line.is_empty() { "a program".to_owned() } else { line.chars().take(80).collect() }
}

/// The robot whose operator was started with these words.
fn robot_of<'w>(words: &[&'w str]) -> Option<&'w str> {
    let [_, "service", "operator", arguments @ ..] = words else { return None };
    let dir = *arguments.iter().skip_while(|word| **word != "--runtime-dir").nth(1)?;
    Path::new(dir).file_name()?.to_str()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_that_is_taken_is_told_with_its_holder() {
        let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = taken.local_addr().expect("its address");
        let why = check(FOXGLOVE, &address.to_string()).expect_err("it is taken");
        let us = format!("(pid {}) has this port", std::process::id());
        assert!(why.contains(&us) && why.starts_with(&format!("operator.foxglove {address}: ")), "{why}");
        drop(taken);
        assert_eq!(check(LISTEN, &address.to_string()), Ok(()));
        assert_eq!(check(LISTEN, ""), Ok(()));
    }

    #[test]
    fn another_robots_page_is_called_by_the_robots_name() {
        let words =
            ["/opt/hilare", "service", "operator", "--runtime-dir", "/run/hilare/mule", "--slot", "7"];
        assert_eq!(robot_of(&words), Some("mule"));
        assert_eq!(robot_of(&["python3", "service", "relay", "--runtime-dir", "/run/hilare/mule"]), None);
        assert_eq!(robot_of(&["/opt/hilare", "service", "operator"]), None);
    }

    #[test]
    fn listeners_are_found_among_other_sockets() {
        let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n\
            \x20  0: 0100007F:1B9E 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1000        0 41 1 f 100\n\
            \x20  1: 0100007F:1B9E 0100007F:C000 01 00000000:00000000 00:00000000 00000000  1000        0 42 1 f 100\n\
            \x20  2: 00000000000000000000000001000000:1B9F 00000000000000000000000000000000:0000 0A 0:0 00:0 0 0 0 43 1\n\
            nonsense\n";
        assert_eq!((listeners(table, 7070), listeners(table, 7071)), (vec![41], vec![43]));
        assert_eq!(listeners("", 7070), [0_u64; 0]);
    }
}
