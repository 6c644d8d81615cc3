//! What the machine does to a robot: a full disk, a small /dev/shm, a closed output, a wall clock that jumps; and
//! how late the machine itself is.

use crate::support::{Lab, Running};
use hilare::shell::realtime::set_fifo;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A shell line that ends in `hilare ARGS`, which it knows as `"$@"`.
pub fn shell(lab: &Lab, line: &str, args: &[&str]) -> Command {
    let mut command = lab.command_of("sh");
    command.args(["-c", line, "sh", env!("CARGO_BIN_EXE_hilare")]).args(args);
    command
}

/// The same in a mount namespace of its own.
pub fn own_mounts(lab: &Lab, line: &str, args: &[&str]) -> Command {
    let mut command = lab.command_of("unshare");
    command.args(["-m", "sh", "-c", line, "sh", env!("CARGO_BIN_EXE_hilare")]).args(args);
    command
}

/// True if this user may mount in a namespace of its own.
pub fn may_mount(lab: &Lab) -> bool {
    let mut probe = lab.command_of("unshare");
    probe.args(["-m", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]).stderr(Stdio::null());
    probe.status().is_ok_and(|status| status.success())
}

/// True if a program can be started.
pub fn has(program: &str) -> bool {
    Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

/// True if a directory of another process lies on a disk of its own.
pub fn own_disk(pid: i32, dir: &Path) -> bool {
    let mounts = fs::read_to_string(format!("/proc/{pid}/mounts")).unwrap_or_default();
    mounts.lines().any(|line| line.split(' ').nth(1) == dir.to_str())
}

/// Fills the disk a file of another process's mount namespace lies on; how many bytes went into it.
pub fn fill_disk(pid: i32, file: &Path) -> u64 {
    let path = PathBuf::from(format!("/proc/{pid}/root{}", file.display()));
    let _ = fs::write(&path, vec![0u8; 64 << 20]);
    fs::metadata(&path).map_or(0, |metadata| metadata.len())
}

/// The wall clock as seen through the C library: seven hours ahead, seven hours behind, turn by turn. Its
/// file in `HILARE_TEST_CLOCK_DIR` shows which processes have seen it.
const CLOCK_SHIM: &str = r#"
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static long shift(void) {
    struct timespec now;
    syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
    long turn = now.tv_sec * 4 + now.tv_nsec / 250000000;
    return (turn % 2 ? 7 : -7) * 3600;
}

__attribute__((constructor)) static void seen(void) {
    const char *dir = getenv("HILARE_TEST_CLOCK_DIR");
    char path[512];
    if (dir && snprintf(path, sizeof path, "%s/%d", dir, (int)getpid()) < (int)sizeof path)
        close(open(path, O_CREAT | O_WRONLY, 0600));
}

int clock_gettime(clockid_t clock, struct timespec *time) {
    long result = syscall(SYS_clock_gettime, clock, time);
    if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) time->tv_sec += shift();
    return (int)result;
}

int gettimeofday(struct timeval *restrict time, void *restrict zone) {
    long result = syscall(SYS_gettimeofday, time, zone);
    if (result == 0 && time) time->tv_sec += shift();
    return (int)result;
}

time_t time(time_t *out) {
    struct timespec now;
    syscall(SYS_clock_gettime, CLOCK_REALTIME, &now);
    if (out) *out = now.tv_sec + shift();
    return now.tv_sec + shift();
}
"#;

/// A wall clock that jumps for every process started with it.
pub struct JumpingClock {
    library: PathBuf,
    dir: PathBuf,
}

impl JumpingClock {
    /// Compiles it; `None` without a C compiler.
    pub fn new(lab: &Lab) -> Option<Self> {
        let source = lab.file("clock.c", CLOCK_SHIM);
        let (library, dir) = (lab.dir().join("clock.so"), lab.dir().join("clock"));
        fs::create_dir(&dir).expect("a directory for the clock");
        let mut compile = lab.command_of("cc");
        compile.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(&source);
        if !has("cc") {
            return None;
        }
        Running::start(compile).wait(crate::support::PATIENCE).expect_code(0);
        Some(Self { library, dir })
    }

    /// Lets a command and all it starts see it.
    pub fn show(&self, command: &mut Command) {
        command.env("LD_PRELOAD", &self.library).env("HILARE_TEST_CLOCK_DIR", &self.dir);
    }

    /// Processes that have seen it.
    pub fn seen_by(&self) -> usize {
        fs::read_dir(&self.dir).map_or(0, |entries| entries.flatten().count())
    }
}

/// Bare timer loops beside a test, one a processor, above all of the robot where that is allowed: how late the
/// machine itself is with anything that sleeps.
pub struct HostWatch {
    stop: Arc<AtomicBool>,
    worst_us: Arc<AtomicU64>,
    threads: Vec<JoinHandle<()>>,
}

/// Above the control path.
const WATCH_PRIORITY: u64 = 90;

impl HostWatch {
    /// Begins to watch.
    pub fn start() -> Self {
        let (stop, worst_us) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let allowed = sched_getaffinity(None).expect("processors");
        let cpus = (0..CpuSet::MAX_CPU).filter(|cpu| allowed.is_set(*cpu));
        let watch = |cpu: usize| {
            let (stops, worst) = (Arc::clone(&stop), Arc::clone(&worst_us));
            std::thread::spawn(move || {
                let mut one = CpuSet::new();
                one.set(cpu);
                let _ = (sched_setaffinity(None, &one), set_fifo(WATCH_PRIORITY, false));
                let pause = Duration::from_millis(1);
                while !stops.load(Ordering::Relaxed) {
                    let start = Instant::now();
                    std::thread::sleep(pause);
                    let late = start.elapsed().saturating_sub(pause).as_micros() as u64;
                    worst.fetch_max(late, Ordering::Relaxed);
                }
            })
        };
        let threads = cpus.map(watch).collect();
        Self { stop, worst_us, threads }
    }

    /// The worst so far, ms; and begins anew.
    pub fn worst_ms(&self) -> f64 {
        self.worst_us.swap(0, Ordering::Relaxed) as f64 * 1e-3
    }
}

impl Drop for HostWatch {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}
