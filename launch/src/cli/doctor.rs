//! `hilare doctor`: what this machine allows, each finding with its cure.

use super::{VerbResult, print};
use crate::manager::robot_dir::{SHM_NEEDED, SOCKET_PATH_MAX, base_dir, living_robots, socket_path};
use crate::private::{foreign, private_dir, shm_names};
use crate::shell::realtime::FifoRefusal;
use crate::shell::transport::shm_prefix;
use clap::Args;
use rustix::fs::statfs;
use rustix::process::{Resource, getrlimit};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::ExitCode;

/// Options of `hilare doctor`.
#[derive(Args)]
pub struct DoctorArgs {
    /// Answer in JSON
    #[arg(long)]
    json: bool,
}

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Verdict {
    Good,
    Warning,
    Bad,
}

/// One check.
#[derive(Debug, Serialize)]
struct Finding {
    check: &'static str,
    verdict: Verdict,
    found: String,
    cure: String,
}

fn finding(
    check: &'static str,
    verdict: Verdict,
    found: impl Into<String>,
    cure: impl Into<String>,
) -> Finding {
    let cure = if verdict == Verdict::Good { String::new() } else { cure.into() };
    Finding { check, verdict, found: found.into(), cure }
}

/// Runs every check.
pub fn doctor(args: &DoctorArgs) -> VerbResult {
    let findings = [
        realtime_priority(),
        memory_lock(),
        throttling(),
        shared_memory(),
        cores(),
        runtime_dir(),
        ports(),
        leftovers(),
        robots(),
    ];
    if args.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&findings).unwrap_or_default()));
    } else {
        for finding in &findings {
            let mark = match finding.verdict {
                Verdict::Good => "ok  ",
                Verdict::Warning => "warn",
                Verdict::Bad => "BAD ",
            };
            print(&format!("{mark}  {:<14} {}\n", finding.check, finding.found));
            if !finding.cure.is_empty() {
                print(&format!("      {:<14} cure: {}\n", "", finding.cure));
            }
        }
    }
    let bad = findings.iter().any(|finding| finding.verdict == Verdict::Bad);
    Ok(if bad { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// Tries SCHED_FIFO in a thread of its own, because limits alone do not tell (control groups).
fn realtime_priority() -> Finding {
    let tried = std::thread::spawn(|| crate::shell::realtime::set_fifo(80, true)).join();
    match tried {
        Ok(Ok(())) => finding("rtprio", Verdict::Good, "SCHED_FIFO 80 is granted", ""),
        Ok(Err(_)) => {
            let why = FifoRefusal::find(80);
            let found = format!("SCHED_FIFO 80 is refused ({why}): the real clock runs best effort");
            finding("rtprio", Verdict::Warning, found, why.cure())
        }
        Err(_) => finding("rtprio", Verdict::Bad, "the check itself failed", "report it"),
    }
}

fn memory_lock() -> Finding {
    let limit = getrlimit(Resource::Memlock).current.unwrap_or(u64::MAX);
    if crate::shell::realtime::may_lock_everything() {
        return finding("memlock", Verdict::Good, "all memory can be locked", "");
    }
    if limit >= 64 << 20 {
        return finding("memlock", Verdict::Good, format!("{} MB", limit >> 20), "");
    }
    finding(
        "memlock",
        Verdict::Warning,
        format!("{} kB: pages of the control path may be swapped or faulted in late", limit >> 10),
        "ulimit -l unlimited (LimitMEMLOCK=infinity, memlock unlimited in /etc/security/limits.conf; \
         docker: --ulimit memlock=-1)",
    )
}

fn throttling() -> Finding {
    let runtime = fs::read_to_string("/proc/sys/kernel/sched_rt_runtime_us").unwrap_or_default();
    match runtime.trim().parse::<i64>() {
        Ok(0) => finding(
            "rt throttling",
            Verdict::Bad,
            "sched_rt_runtime_us is 0: real-time threads do not run at all",
            "sysctl kernel.sched_rt_runtime_us=950000",
        ),
        Ok(us) => finding("rt throttling", Verdict::Good, format!("{us} us a second for real-time work"), ""),
        Err(_) => finding(
            "rt throttling",
            Verdict::Warning,
            "unknown: /proc/sys/kernel is not readable",
            "mount /proc",
        ),
    }
}

fn shared_memory() -> Finding {
    match rustix::fs::statvfs("/dev/shm") {
        Ok(stat) => {
            let free = stat.f_bavail * stat.f_frsize;
            let verdict = if free < SHM_NEEDED { Verdict::Bad } else { Verdict::Good };
            let cure = "mount -o remount,size=64M /dev/shm, or free some (docker: --shm-size=64m)";
            finding(
                "/dev/shm",
                verdict,
                format!("{} MB free, a robot needs {}", free >> 20, SHM_NEEDED >> 20),
                cure,
            )
        }
        Err(error) => finding("/dev/shm", Verdict::Bad, error.to_string(), "mount -t tmpfs tmpfs /dev/shm"),
    }
}

fn cores() -> Finding {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let verdict = if cores < 2 { Verdict::Warning } else { Verdict::Good };
    finding(
        "cores",
        verdict,
        format!("{cores} usable"),
        "give the robot two: one for the control path, one for the rest (docker: --cpuset-cpus=2,3)",
    )
}

fn runtime_dir() -> Finding {
    let base = base_dir();
    let probe = base.join(".doctor");
    let writable =
        private_dir(&base).and_then(|()| fs::write(&probe, b"")).and_then(|()| fs::remove_file(&probe));
    match writable {
        Ok(()) if on_disk(&base) => finding(
            "runtime dir",
            Verdict::Warning,
            format!(
                "{} lies on a disk, whose work delays the tick whenever a process comes or goes",
                base.display()
            ),
            "point HILARE_RUNTIME_DIR to a directory of your own on a tmpfs, such as /dev/shm",
        ),
        Ok(()) => finding("runtime dir", Verdict::Good, base.display().to_string(), ""),
        Err(error) => finding(
            "runtime dir",
            Verdict::Bad,
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

/// The control socket's path must fit into a socket address, and binding must work.
fn ports() -> Finding {
    // The longest name a robot can have.
    let longest = socket_path(&"r".repeat(32));
    let length = longest.as_os_str().len();
    let cure = "set HILARE_RUNTIME_DIR to a shorter path on a local file system";
    if length > SOCKET_PATH_MAX {
        let found =
            format!("control sockets need paths of up to {length} bytes, {SOCKET_PATH_MAX} are possible");
        return finding("ports", Verdict::Bad, found, cure);
    }
    let probe = base_dir().join(format!(".doctor-{}.sock", std::process::id()));
    let bound = UnixListener::bind(&probe);
    let _ = fs::remove_file(&probe);
    match bound {
        Ok(_) => finding("ports", Verdict::Good, "control sockets can be bound; no network port is used", ""),
        Err(error) => finding("ports", Verdict::Bad, format!("{}: {error}", probe.display()), cure),
    }
}

/// Files of this user in /dev/shm whose robot is not alive.
fn leftovers() -> Finding {
    let living = living_robots();
    let all = shm_prefix("");
    let ours = all.trim_end_matches('.');
    let mut dead: BTreeMap<String, usize> = BTreeMap::new();
    for path in shm_names(ours) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some((robot, _)) =
            name.strip_prefix(ours).and_then(|rest| rest.strip_prefix('.')?.split_once('.'))
        else {
            continue;
        };
        // No launch removes what is another user's.
        if let Some(why) = foreign(&path) {
            let found = format!("{}: {why}", path.display());
            let cure = format!("have it removed; robot {robot} cannot come up before that");
            return finding("leftovers", Verdict::Warning, found, cure);
        }
        if !living.iter().any(|living| living.robot == robot) {
            *dead.entry(robot.to_owned()).or_default() += 1;
        }
    }
    if dead.is_empty() {
        return finding("leftovers", Verdict::Good, "none", "");
    }
    let found: Vec<String> = dead.iter().map(|(robot, files)| format!("{files} files of {robot}")).collect();
    let cure: Vec<String> = dead.keys().map(|robot| format!("rm /dev/shm/{}*", shm_prefix(robot))).collect();
    let cure = format!("the next launch of that robot removes them; or {}", cure.join("; "));
    finding("leftovers", Verdict::Warning, format!("{}, which is not up", found.join(", ")), cure)
}

fn robots() -> Finding {
    let names: Vec<String> =
        living_robots().iter().map(|living| format!("{} (pid {})", living.robot, living.pid)).collect();
    let found = if names.is_empty() { "none up".to_owned() } else { names.join(", ") };
    finding("robots", Verdict::Good, found, "")
}
