//! What the machine does to a robot: a full disk, a small /dev/shm, a closed output, a wall clock that jumps; and
//! how late the machine itself is.

use crate::support::{Lab, Running};
use hilare::config::System;
use hilare::shell::page::monotonic_ns;
use hilare::shell::realtime::{self, CpuChoice, Request};
use hilare_interfaces::wires::Role;
use rustix::thread::{ClockId, CpuSet, clock_nanosleep_absolute, sched_getaffinity};
use rustix::time::Timespec;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

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

/// A tick of the robot.
const TICK_NS: u64 = 1_000_000;

/// A wake-up of a bare loop.
#[derive(Clone, Copy, Debug)]
struct Wake {
    /// When it should have been, ns on CLOCK_MONOTONIC.
    due_ns: u64,
    /// How much later it was, ns.
    late_ns: u64,
}

/// Bare timer loops beside a test, a wake-up a tick: how late the machine itself is with anything that sleeps.
pub struct HostWatch {
    stop: Arc<AtomicBool>,
    wakes: Arc<Mutex<Vec<Wake>>>,
    threads: Vec<JoinHandle<()>>,
}

/// Above all of the robot, where that is allowed: no box, healthy or not, keeps such a loop waiting.
const WATCH_PRIORITY: u64 = 90;

impl HostWatch {
    /// Begins to watch every processor, above all of the robot.
    pub fn start() -> Self {
        let allowed = sched_getaffinity(None).expect("processors");
        let cpus = (0..CpuSet::MAX_CPU).filter(|cpu| allowed.is_set(*cpu));
        Self::start_on(cpus.map(CpuChoice::Number), WATCH_PRIORITY)
    }

    /// Begins to watch processors with a priority of SCHED_FIFO, as far as the kernel grants them.
    pub fn start_on(cpus: impl IntoIterator<Item = CpuChoice>, priority: u64) -> Self {
        let (stop, wakes) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
        let watch = |cpu: CpuChoice| {
            let (stops, all) = (Arc::clone(&stop), Arc::clone(&wakes));
            std::thread::spawn(move || {
                realtime::apply(Request { priority, cpu, lock_memory: false });
                let mut due_ns = monotonic_ns();
                while !stops.load(Ordering::Relaxed) {
                    due_ns += TICK_NS;
                    let (tv_sec, tv_nsec) = (due_ns / 1_000_000_000, due_ns % 1_000_000_000);
                    let deadline = Timespec { tv_sec: tv_sec as i64, tv_nsec: tv_nsec as i64 };
                    while clock_nanosleep_absolute(ClockId::Monotonic, &deadline).is_err() {}
                    let late_ns = monotonic_ns().saturating_sub(due_ns);
                    all.lock().unwrap_or_else(PoisonError::into_inner).push(Wake { due_ns, late_ns });
                    due_ns += late_ns / TICK_NS * TICK_NS;
                }
            })
        };
        let threads = cpus.into_iter().map(watch).collect();
        Self { stop, wakes, threads }
    }

    fn take(&self) -> Vec<Wake> {
        std::mem::take(&mut *self.wakes.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// How late every wake-up was so far, ns, the least late first; and begins anew.
    pub fn lateness_ns(&self) -> Vec<u64> {
        let mut late: Vec<u64> = self.take().iter().map(|wake| wake.late_ns).collect();
        late.sort_unstable();
        late
    }

    /// The worst so far, ms; and begins anew.
    pub fn worst_ms(&self) -> f64 {
        self.lateness_ns().last().copied().unwrap_or(0) as f64 * 1e-6
    }
}

impl Drop for HostWatch {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}

/// Bare loops beside a drive: what the host did to everybody cannot be the doing of a fault, and only what it did
/// to them excuses the robot.
pub struct Bystanders {
    /// Where the boxes of the tick run.
    boxes: HostWatch,
    everywhere: HostWatch,
}

/// When the host has kept the bystanders of a drive waiting for a tick or more: from, until, ns.
#[derive(Clone, Debug)]
pub struct Stalls {
    boxes: Vec<(u64, u64)>,
    everywhere: Vec<(u64, u64)>,
}

impl Bystanders {
    /// Begins to watch.
    pub fn start() -> Self {
        let clock = System::load("epuck").expect("built in").realtime(Role::StepGenerator);
        let boxes = HostWatch::start_on([CpuChoice::from_key(clock.cpu)], WATCH_PRIORITY);
        Self { boxes, everywhere: HostWatch::start() }
    }

    /// What the host did to them.
    pub fn end(self) -> Stalls {
        let stalls = |watch: HostWatch| {
            let late = watch.take().into_iter().filter(|wake| wake.late_ns >= TICK_NS);
            late.map(|wake| (wake.due_ns, wake.due_ns + wake.late_ns)).collect()
        };
        Stalls { boxes: stalls(self.boxes), everywhere: stalls(self.everywhere) }
    }
}

impl Stalls {
    /// True if the host stalled the boxes within the last moments before `ns`.
    pub fn boxes_before(&self, ns: u64) -> bool {
        // A command is late some cycles after the stall, and whoever says when may have been kept waiting, too.
        const MOMENTS_NS: u64 = 50 * TICK_NS;
        self.boxes.iter().any(|(from, until)| *from <= ns && ns <= until + MOMENTS_NS)
    }

    /// True if the host stalled the boxes at any time.
    pub fn boxes_ever(&self) -> bool {
        !self.boxes.is_empty()
    }

    /// True if launch, which runs anywhere, may have been kept from renewing its lease when it was due.
    pub fn lease(&self) -> bool {
        const RENEWAL_NS: u64 = 20 * TICK_NS;
        self.everywhere.iter().any(|(from, until)| until - from >= RENEWAL_NS)
    }
}
