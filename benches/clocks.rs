//! `cargo bench --bench clocks`: how fast virtual time goes.
//!
//! In-process: ticks a second of the whole loop (selector, controller, step generator, estimator,
//! plant) on one core, bare and with every tick recorded; beside it, as a yardstick of the machine in
//! the same run, a loop of dependent additions. Lockstep: ticks a second of the eight processes, taken
//! from ticks and whole-process time with the start-up measured apart.
#![allow(missing_docs)]

use hilare::config::{Scenario, Task};
use hilare::shell::in_process::InProcess;
use std::hint::black_box;
use std::process::Command;
use std::time::{Duration, Instant};

const ROUNDS: usize = 9;

fn main() {
    println!("machine: {}", machine());
    let scenario = Scenario::load("so").expect("built in");
    let Task::Follow(waypoints) = &scenario.task else { panic!("so is a path") };
    let mut bare = Vec::new();
    let mut recorded = Vec::new();
    let mut additions = Vec::new();
    for _ in 0..ROUNDS {
        bare.push(rate(|| {
            let mut system = InProcess::new(&scenario.system, waypoints).expect("valid");
            let mut ticks = 0u64;
            while system.tick() {
                ticks += 1;
            }
            ticks
        }));
        recorded.push(rate(|| {
            let mut system = InProcess::new(&scenario.system, waypoints).expect("valid");
            system.run(u64::MAX).statistics.ticks()
        }));
        additions.push(rate(dependent_additions));
    }
    let (bare, recorded, additions) = (median(bare), median(recorded), median(additions));
    println!("in-process, bare:      {:>6.2} million ticks/s on one core", bare / 1e6);
    println!("in-process, recorded:  {:>6.2} million ticks/s on one core", recorded / 1e6);
    println!("one tick is {:.0} dependent floating-point additions of this machine", additions / bare);
    lockstep();
}

/// Events a second of CPU time.
fn rate(mut work: impl FnMut() -> u64) -> f64 {
    let start = cpu_time();
    let mut events = 0;
    while cpu_time() - start < Duration::from_millis(300) {
        events += work();
    }
    events as f64 / (cpu_time() - start).as_secs_f64()
}

fn dependent_additions() -> u64 {
    let mut sum = black_box(0.5f64);
    for _ in 0..1_000_000 {
        sum = black_box(sum) + 1.0;
    }
    black_box(sum);
    1_000_000
}

fn cpu_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Two runs of different length: their difference in time is that of their difference in ticks.
fn lockstep() {
    let mut rates = Vec::new();
    for _ in 0..ROUNDS {
        let (short_ticks, short) = run_lockstep("rectangle-open");
        let (long_ticks, long) = run_lockstep("so");
        if long > short {
            rates.push((long_ticks - short_ticks) as f64 / (long - short).as_secs_f64());
        }
    }
    rates.sort_by(f64::total_cmp);
    let (low, high) = (rates.first().copied().unwrap_or(0.0), rates.last().copied().unwrap_or(0.0));
    println!(
        "lockstep, 8 processes: {:>6.0} thousand ticks/s (lowest {:.0}, highest {:.0})",
        rates.get(rates.len() / 2).copied().unwrap_or(0.0) / 1e3,
        low / 1e3,
        high / 1e3
    );
}

fn run_lockstep(scenario: &str) -> (u64, Duration) {
    let out = tempfile::tempdir().expect("a directory for the report");
    let start = Instant::now();
    let output = Command::new(env!("CARGO_BIN_EXE_hilare"))
        .args(["run", scenario, "--clock", "lockstep", "--json", "--robot"])
        .arg(format!("bench-{}", std::process::id()))
        .arg("--out")
        .arg(out.path().join("report"))
        .output()
        .expect("hilare runs");
    let time = start.elapsed();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a summary");
    (summary["ticks"].as_u64().expect("ticks"), time)
}

fn machine() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info
        .lines()
        .find_map(|line| line.strip_prefix("model name"))
        .unwrap_or("")
        .trim_start_matches([' ', '\t', ':']);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{name}, {cores} cores usable")
}
