//! What is asked of the kernel for every process of every peer, and what it granted.

#![allow(unsafe_code)]

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, clock_nanosleep_absolute, sched_getaffinity, sched_setaffinity};
use rustix::time::{ClockId, Timespec, clock_gettime};
use std::fs;

/// Binds the calling thread to a processor, puts it under SCHED_FIFO and locks the process's memory. Threads
/// it starts from now on inherit all of it. What was refused is seen in [`granted`].
pub fn apply(priority: i32, cpu: usize) {
    // Future mappings too: the peers' libraries make buffers as they go.
    let _ = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
    place(priority, cpu);
}

/// As [`apply`], without locked memory.
pub fn place(priority: i32, cpu: usize) {
    let mut set = CpuSet::new();
    set.set(cpu);
    let _ = sched_setaffinity(None, &set);
    schedule(0, libc::SCHED_FIFO, priority);
}

/// Takes real time from every thread of a process.
pub fn release(pid: u32) {
    for task in fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten() {
        if let Ok(thread) = task.file_name().to_string_lossy().parse() {
            schedule(thread, libc::SCHED_OTHER, 0);
        }
    }
}

fn schedule(thread: libc::pid_t, policy: libc::c_int, priority: i32) {
    let parameters = libc::sched_param { sched_priority: priority };
    // SAFETY: sets a thread's policy from a valid struct, 0 the calling one's; no library wraps this call.
    unsafe { libc::sched_setscheduler(thread, policy, &parameters) };
}

/// The processors this process may use, ascending.
pub fn processors() -> Vec<usize> {
    let allowed = sched_getaffinity(None);
    (0..CpuSet::MAX_CPU).filter(|cpu| allowed.as_ref().is_ok_and(|set| set.is_set(*cpu))).collect()
}

/// Keeps the calling process, and what it starts, off a processor, where there is another.
pub fn keep_off(cpu: usize) {
    let mut set = CpuSet::new();
    processors().into_iter().filter(|other| *other != cpu).for_each(|other| set.set(other));
    if set.count() > 0 {
        let _ = sched_setaffinity(None, &set);
    }
}

/// What the kernel says a process has, in words: its threads by policy and priority, its processors, its
/// locked memory.
pub fn granted(pid: u32) -> String {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let field = |name: &str| {
        let value = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
        value.unwrap_or("?").trim().to_owned()
    };
    let mut policies: Vec<(String, usize)> = Vec::new();
    for task in fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten() {
        let stat = fs::read_to_string(task.path().join("stat")).unwrap_or_default();
        let policy = policy_of(&stat);
        match policies.iter_mut().find(|(known, _)| *known == policy) {
            Some((_, count)) => *count += 1,
            None => policies.push((policy, 1)),
        }
    }
    let threads: Vec<String> = policies.iter().map(|(policy, count)| format!("{count} × {policy}")).collect();
    let (cpus, locked) = (field("Cpus_allowed_list"), field("VmLck"));
    format!("threads {}; CPU {cpus}; locked {locked}", threads.join(", "))
}

/// Policy and priority out of a line of /proc/PID/task/TID/stat; proc(5), fields 40 and 41.
fn policy_of(stat: &str) -> String {
    // The name, field 2, may hold anything, but nothing behind its last bracket.
    let rest: Vec<&str> =
        stat.rsplit_once(')').map_or(Vec::new(), |(_, rest)| rest.split_whitespace().collect());
    match (rest.get(37), rest.get(38)) {
        (Some(priority), Some(&"1")) => format!("FIFO {priority}"),
        (Some(priority), Some(&"2")) => format!("RR {priority}"),
        (Some(_), Some(_)) => "not real-time".to_owned(),
        _ => "gone".to_owned(),
    }
}

/// Now, ns on CLOCK_MONOTONIC: one clock for all processes.
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Sleeps until an instant on CLOCK_MONOTONIC, ns.
pub fn sleep_until(instant_ns: u64) {
    let instant = Timespec {
        tv_sec: (instant_ns / 1_000_000_000) as i64,
        tv_nsec: (instant_ns % 1_000_000_000) as i64,
    };
    // A signal before the time: sleep on.
    while clock_nanosleep_absolute(ClockId::Monotonic, &instant) == Err(rustix::io::Errno::INTR) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn policies_are_read_from_the_kernels_line() {
        let line = |priority: u32, policy: u32| {
            format!("12 (a b) c) S {} {priority} {policy} 0 0", vec!["0"; 36].join(" "))
        };
        assert_eq!(policy_of(&line(65, 1)), "FIFO 65");
        assert_eq!(policy_of(&line(0, 0)), "not real-time");
        assert_eq!(policy_of(""), "gone");
    }

    #[test]
    fn this_process_has_threads_and_processors() {
        assert!(!processors().is_empty());
        assert!(granted(std::process::id()).contains(" × "));
    }
}
