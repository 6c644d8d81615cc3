//! `cargo bench --bench footprint`: what a robot costs in `real`: processor time, memory, shared memory.
//!
//! Everything is read from the kernel's own accounting of the launched processes over 20 s of driving.
#![allow(missing_docs)]

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const SECONDS: u64 = 20;

fn main() {
    let robot = format!("bench-{}", std::process::id());
    let out = tempfile::tempdir().expect("a directory for the report");
    let mut launch = Command::new(env!("CARGO_BIN_EXE_hilare"))
        .args(["run", "so", "--json", "--robot", &robot, "--out"])
        .arg(out.path().join("report"))
        .stdout(Stdio::null())
        .spawn()
        .expect("hilare runs");
    sleep(Duration::from_secs(2));
    let pids = family(launch.id());
    let (before, start) = (cpu_ticks(&pids), Instant::now());
    sleep(Duration::from_secs(SECONDS));
    let (after, seconds) = (cpu_ticks(&pids), start.elapsed().as_secs_f64());
    let hertz = rustix::param::clock_ticks_per_second() as f64;
    println!("{:<18} {:>7} {:>9} {:>9} {:>9}", "process", "cpu %", "rss MB", "pss MB", "locked MB");
    let mut total = [0.0; 4];
    for (i, pid) in pids.iter().enumerate() {
        let row = [
            (after[i] - before[i]) as f64 / hertz / seconds * 100.0,
            kilobytes(*pid, "smaps_rollup", "Rss:") / 1024.0,
            kilobytes(*pid, "smaps_rollup", "Pss:") / 1024.0,
            kilobytes(*pid, "status", "VmLck:") / 1024.0,
        ];
        print_row(&name(*pid), row);
        total.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
    print_row("together", total);
    let prefix = hilare::shell::transport::shm_prefix(&robot);
    let (mut files, mut apparent, mut used) = (0, 0, 0);
    for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        let Ok(meta) = entry.metadata() else { continue };
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            files += 1;
            apparent += meta.len();
            used += meta.blocks() * 512;
        }
    }
    let mega = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!("/dev/shm: {files} files, {:.1} MB used, {:.1} MB reserved", mega(used), mega(apparent));
    let size = fs::metadata(env!("CARGO_BIN_EXE_hilare")).map_or(0, |meta| meta.len());
    println!("binary: {:.1} MB", mega(size));
    rustix::process::kill_process(rustix::process::Pid::from_child(&launch), rustix::process::Signal::INT)
        .expect("launch lives");
    let _ = launch.wait();
}

fn print_row(name: &str, [cpu, rss, pss, locked]: [f64; 4]) {
    println!("{name:<18} {cpu:>7.2} {rss:>9.1} {pss:>9.1} {locked:>9.1}");
}

/// Launch and its children.
fn family(launch: u32) -> Vec<u32> {
    let children = fs::read_to_string(format!("/proc/{launch}/task/{launch}/children")).unwrap_or_default();
    std::iter::once(launch).chain(children.split_whitespace().filter_map(|pid| pid.parse().ok())).collect()
}

fn name(pid: u32) -> String {
    let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let mut words = line.split(|byte| *byte == 0).map(String::from_utf8_lossy);
    match words.nth(1).as_deref() {
        Some("service") => words.next().map_or_else(String::new, |word| word.into_owned()),
        _ => "launch".to_owned(),
    }
}

fn cpu_ticks(pids: &[u32]) -> Vec<u64> {
    let ticks = |pid: &u32| {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        let after_name = stat.rsplit(')').next().unwrap_or("").to_owned();
        // utime and stime are fields 14 and 15 of the whole line.
        after_name.split_whitespace().skip(11).take(2).filter_map(|n| n.parse::<u64>().ok()).sum()
    };
    pids.iter().map(ticks).collect()
}

fn kilobytes(pid: u32, file: &str, key: &str) -> f64 {
    let text = fs::read_to_string(format!("/proc/{pid}/{file}")).unwrap_or_default();
    let value = text.lines().find_map(|line| line.strip_prefix(key)).unwrap_or("");
    value.trim().trim_end_matches("kB").trim().parse().unwrap_or(0.0)
}
