//! A machine within the machine: systemd as process 1 of its own name spaces, on a root directory made for
//! the test, with this machine's /usr. What it starts cannot be told from what starts at boot.

use super::{Ended, Lab, PATIENCE, Running, comes_true, skip};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// The account robots run as on it.
pub const ACCOUNT: &str = "hilare";
/// Number of the account; of a system account, as the units' next steps make it.
const UID: &str = "990";
/// Where `hilare` is on it.
pub const PROGRAM: &str = "/opt/hilare";

/// A machine that has booted; ended when dropped.
pub struct Machine<'l> {
    lab: &'l Lab,
    /// Process 1 of the machine, as seen from here.
    leader: i32,
    _nspawn: Running,
}

impl<'l> Machine<'l> {
    /// Boots one with the units that `install` writes; none, and a word why, where that cannot be done.
    pub fn boot(lab: &'l Lab, test: &str, install: impl FnOnce(&Path)) -> Option<Self> {
        let found = |program: &str| Command::new(program).arg("--version").output().is_ok();
        if !rustix::process::geteuid().is_root() || !found("systemd-nspawn") || !found("unshare") {
            skip(test, "booting systemd needs root and systemd-nspawn (Debian: systemd-container)");
            return None;
        }
        let root = make_root(lab);
        install(&root.join("etc/systemd/system"));
        // A /run of its own: nothing of the machine is to be found afterwards.
        let run = "mount -t tmpfs tmpfs /run && exec \"$@\"";
        let mut command = lab.command_of("unshare");
        command.args([
            "--mount",
            "sh",
            "-c",
            run,
            "sh",
            "systemd-nspawn",
            "--quiet",
            "--boot",
            "--directory",
        ]);
        command.arg(&root).args([
            "--register=no",
            "--keep-unit",
            "--bind-ro=/usr",
            "--capability=CAP_IPC_LOCK",
        ]);
        command.arg(format!("--bind-ro={}:{PROGRAM}", env!("CARGO_BIN_EXE_hilare")));
        command.arg(format!("--machine={}", lab.robot())).env("SYSTEMD_NSPAWN_UNIFIED_HIERARCHY", "1");
        let mut nspawn = Running::start(command);
        let mut machine = None;
        let up = comes_true(Duration::from_secs(30), || {
            machine = leader_of(nspawn.pid());
            let state = machine.map(|leader| inside(lab, leader, &["systemctl", "is-system-running"]));
            state.is_some_and(|ended| ["running", "degraded"].contains(&ended.stdout.trim()))
                || !nspawn.lives()
        });
        match machine.filter(|_| up && nspawn.lives()) {
            Some(leader) => Some(Self { lab, leader, _nspawn: nspawn }),
            None => {
                skip(test, "systemd does not boot in name spaces here");
                None
            }
        }
    }

    /// Runs a command on it as root.
    pub fn run(&self, words: &[&str]) -> Ended {
        inside(self.lab, self.leader, words)
    }

    /// Runs `hilare ARGS` on it, as the account robots run as.
    pub fn hilare(&self, args: &[&str]) -> Ended {
        let (user, group) = (format!("--reuid={UID}"), format!("--regid={UID}"));
        self.run(&[&["setpriv", &user, &group, "--clear-groups", PROGRAM], args].concat())
    }

    /// A property of a unit.
    pub fn property(&self, unit: &str, name: &str) -> String {
        self.run(&["systemctl", "show", "--value", "--property", name, unit]).stdout.trim().to_owned()
    }
}

impl Drop for Machine<'_> {
    fn drop(&mut self) {
        // All its processes end with its first.
        super::process::signal(self.leader, rustix::process::Signal::KILL);
    }
}

fn inside(lab: &Lab, leader: i32, words: &[&str]) -> Ended {
    let mut command = lab.command_of("nsenter");
    command.args(["--all", "--target", &leader.to_string(), "--"]).args(words);
    // Found by their accounts on the machine, not by those of the laboratory.
    command.env_remove("HILARE_RUNTIME_DIR").env_remove("XDG_RUNTIME_DIR").current_dir("/");
    Running::start(command).wait(PATIENCE)
}

/// A root directory with an empty configuration and one account.
fn make_root(lab: &Lab) -> PathBuf {
    let root = lab.dir().join("machine");
    let dirs = "usr etc/systemd/system var tmp run dev proc sys opt root home";
    for dir in dirs.split(' ') {
        fs::create_dir_all(root.join(dir)).expect("a directory of the machine");
    }
    for link in ["bin", "sbin", "lib", "lib64"] {
        symlink(format!("usr/{link}"), root.join(link)).expect("a link of the machine");
    }
    let etc = |name: &str, text: String| {
        fs::write(root.join("etc").join(name), text).expect("a file of the machine");
    };
    let nobody = "nobody:x:65534:65534::/nonexistent:/usr/sbin/nologin";
    etc(
        "passwd",
        format!(
            "root:x:0:0::/root:/bin/sh\n{ACCOUNT}:x:{UID}:{UID}::/nonexistent:/usr/sbin/nologin\n{nobody}\n"
        ),
    );
    etc("group", format!("root:x:0:\n{ACCOUNT}:x:{UID}:\nnogroup:x:65534:\n"));
    etc("os-release", "ID=test\n".to_owned());
    etc("machine-id", String::new());
    etc("hostname", "robot\n".to_owned());
    // Nothing but what every start needs; the tests start the rest.
    etc(
        "systemd/system/default.target",
        "[Unit]\nRequires=sysinit.target\nAfter=sysinit.target\n".to_owned(),
    );
    root
}

/// Process 1 of the machine that a systemd-nspawn runs.
fn leader_of(nspawn: i32) -> Option<i32> {
    let children = fs::read_to_string(format!("/proc/{nspawn}/task/{nspawn}/children")).ok()?;
    children.split_whitespace().filter_map(|pid| pid.parse().ok()).find(|pid: &i32| {
        let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
        let numbers = status.lines().find_map(|line| line.strip_prefix("NSpid:"));
        numbers.is_some_and(|numbers| numbers.split_whitespace().nth(1) == Some("1"))
    })
}
