//! What the machine does to a robot: a full disk, a small /dev/shm, a closed output; and how late the machine itself
//! is.

use crate::support::Lab;
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
