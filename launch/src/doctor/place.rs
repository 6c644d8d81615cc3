//! Where a robot's files lie, and how many of them it may open.

use super::Finding;
use crate::manager::robot_dir::{SOCKET_PATH_MAX, base_dir, socket_path};
use crate::private::private_dir;
use rustix::fs::{statfs, statvfs};
use rustix::process::{Resource, getrlimit};
use std::fs;
use std::os::unix::net::UnixListener;
use std::path::Path;

/// Files a process of a robot may have to open: launch holds every wire, and talks to everybody.
const FILES_NEEDED: u64 = 512;
/// Room for reports and recordings below which it is told.
const DISK_NEEDED: u64 = 1 << 30;

pub(super) fn runtime_dir() -> Finding {
    const CHECK: &str = "runtime dir";
    let base = base_dir();
    let probe = base.join(".doctor");
    let writable =
        private_dir(&base).and_then(|()| fs::write(&probe, b"")).and_then(|()| fs::remove_file(&probe));
    match writable {
        Ok(()) if on_disk(&base) => Finding::warning(
            CHECK,
            format!(
                "{} lies on a disk, whose work delays the tick whenever a process comes or goes",
                base.display()
            ),
            "point HILARE_RUNTIME_DIR to a directory of your own on a tmpfs, such as /dev/shm",
        ),
        Ok(()) => Finding::good(CHECK, base.display().to_string()),
        Err(error) => Finding::bad(
            CHECK,
            format!("{}: {error}", base.display()),
            "set HILARE_RUNTIME_DIR to a directory of your own",
        ),
    }
}

/// True unless a directory's files are in memory alone.
fn on_disk(dir: &Path) -> bool {
    // linux/magic.h
    const TMPFS: i64 = 0x0102_1994;
    const RAMFS: i64 = 0x8584_58f6;
    statfs(dir).is_ok_and(|found| ![TMPFS, RAMFS].contains(&found.f_type))
}

/// Where reports and recordings go unless another directory is named: the current one.
pub(super) fn disk() -> Finding {
    match statvfs(".") {
        Ok(stat) => judge_disk(stat.f_bavail * stat.f_frsize),
        Err(error) => Finding::unknown(DISK, error.to_string()),
    }
}

const DISK: &str = "disk";

fn judge_disk(free: u64) -> Finding {
    if free >= DISK_NEEDED {
        return Finding::good(DISK, format!("{} GB free here for reports and recordings", free >> 30));
    }
    let found = format!("{} MB free here for reports and recordings", free >> 20);
    Finding::warning(DISK, found, "free some, or name a directory elsewhere with --out")
}

pub(super) fn open_files() -> Finding {
    judge_open_files(getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX))
}

fn judge_open_files(limit: u64) -> Finding {
    const CHECK: &str = "open files";
    if limit >= FILES_NEEDED {
        return Finding::good(
            CHECK,
            if limit == u64::MAX { "any number".to_owned() } else { limit.to_string() },
        );
    }
    let found =
        format!("{limit}: a robot with a standby and some observers needs up to {FILES_NEEDED} a process");
    Finding::warning(
        CHECK,
        found,
        "ulimit -n 1024 (LimitNOFILE=1024 in a unit; docker: --ulimit nofile=1024)",
    )
}

/// The control socket's path must fit into a socket address, and binding must work.
pub(super) fn ports() -> Finding {
    const CHECK: &str = "ports";
    // The longest name a robot can have.
    let longest = socket_path(&"r".repeat(32));
    let length = longest.as_os_str().len();
    let cure = "set HILARE_RUNTIME_DIR to a shorter path on a local file system";
    if length > SOCKET_PATH_MAX {
        let found =
            format!("control sockets need paths of up to {length} bytes, {SOCKET_PATH_MAX} are possible");
        return Finding::bad(CHECK, found, cure);
    }
    let probe = base_dir().join(format!(".doctor-{}.sock", std::process::id()));
    let bound = UnixListener::bind(&probe);
    let _ = fs::remove_file(&probe);
    match bound {
        Ok(_) => Finding::good(
            CHECK,
            "control sockets can be bound; no network port is used but what [operator] listen names",
        ),
        Err(error) => Finding::bad(CHECK, format!("{}: {error}", probe.display()), cure),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Verdict::{Good, Warning};
    use super::*;

    #[test]
    fn room_and_limits_are_judged() {
        assert_eq!((judge_disk(DISK_NEEDED).verdict, judge_disk(DISK_NEEDED - 1).verdict), (Good, Warning));
        assert_eq!((judge_open_files(1024).verdict, judge_open_files(256).verdict), (Good, Warning));
        assert_eq!(judge_open_files(u64::MAX).found, "any number");
    }

    #[test]
    fn a_disk_is_told_from_memory() {
        assert!(!on_disk(Path::new("/dev/shm")) && on_disk(Path::new("/proc")));
    }
}
