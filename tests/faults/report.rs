//! The fault table with what was measured: `docs/faults.md`.
//!
//! With `HILARE_FAULTS_REPORT=FILE` every row that is run writes its figures into that file; rows that are not
//! run keep what they had.

use rustix::fs::{FlockOperation, flock};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::{Read, Seek, Write};

/// A row of the table, and what the design promises for it.
pub struct Row {
    /// The fault; the name by which tests call the row.
    pub fault: &'static str,
    /// What must happen.
    pub must: &'static str,
    /// Within what bound.
    pub bound: &'static str,
}

const fn row(fault: &'static str, must: &'static str, bound: &'static str) -> Row {
    Row { fault, must, bound }
}

/// All rows.
pub const ROWS: &[Row] = &[
    row(
        "active controller killed, stopped, late, silent, not a number; standby of the same law",
        "the standby's command of the same cycle is used",
        "0 cycles lost, same bits",
    ),
    row(
        "controllers of a law with memory killed or stopped in turn",
        "successors go on with what the other one remembers",
        "0 cycles lost, same bits",
    ),
    row(
        "active controller killed or stopped; standby of another law",
        "the standby's command of the same cycle is used, without a jump",
        "0 cycles lost, acceleration within the limits",
    ),
    row(
        "active controller killed or stopped; standby is the predictive law",
        "the standby's command of the same cycle is used, without a jump",
        "0 cycles lost, acceleration within the limits",
    ),
    row(
        "active controller killed or stopped; no standby",
        "hold, then ramp; respawn; drive on",
        "ramp starts ≤ 15 ticks after the first pose left unanswered",
    ),
    row("lower epoch, wrong source, old or repeated seq", "ignored, counted", "same tick, same bits"),
    row("stopped controller, woken when another is in charge", "ignored, counted", "same tick, same bits"),
    row("flood of commands of a stranger", "every other command is heard", "0 cycles lost, same bits"),
    row("command NaN, infinite", "rejected, counted, does not refresh its age", "same tick"),
    row("command over the limits", "scaled to the constraint set, curvature kept", "same tick"),
    row("QP at its iteration cap, hostile path", "feasible fallback, health degraded", "same cycle"),
    row(
        "pose estimator killed, stopped or frozen",
        "stop; continues from cumulative counts",
        "stop ≤ 50 ticks, 0 steps lost",
    ),
    row(
        "waypoint selector killed or stopped",
        "stop; resumes at the same waypoint, never beyond its path",
        "stop ≤ 50 ticks",
    ),
    row(
        "planner killed or stopped",
        "the path is driven to its end; goals are whole or not at all",
        "same bits",
    ),
    row("step generator killed", "outputs cease; still until armed again", "same tick, 0 steps lost"),
    row("recorder or relay killed or stopped", "no effect on the tick", "0 ticks"),
    row("any box killed in virtual time", "time waits for its successor", "same bits"),
    row(
        "several boxes killed at once in virtual time",
        "time waits for their successors, never for ever",
        "arrives; cycles lost are counted",
    ),
    row("launch killed, stopped or not heard", "the lease runs out, the robot stops", "stop ≤ 100 ticks"),
    row("e-stop, then any process killed", "latched through every restart until reset", "1 tick"),
    row("host takes the cores away", "pause, no burst, same bits; a long pause stops", "0 ticks hurried"),
    row(
        "both cores loaded",
        "jitter stays that of a bare timer loop in the same run",
        "no pause longer than the bare loop's and a tick, same bits",
    ),
    row(
        "everything at once",
        "limits kept at every tick, every cycle accounted for; arrives when it is over",
        "whole run",
    ),
    row("disk full", "no effect on the tick; the report is refused", "0 ticks, same bits"),
    row("terminal stopped", "no effect on the tick", "0 ticks, same bits"),
    row("stdout closed", "no effect on the tick", "0 ticks, same bits"),
    row("wall clock put back and forth by hours", "no effect", "0 ticks, same bits"),
    row(
        "second launch of the same robot, version mismatch",
        "refused, with the cure",
        "before motion; same bits beside them",
    ),
    row("/dev/shm too small", "refused at start, with the cure", "before motion"),
    row("FIFO denied", "loud best effort, with the cure", "before motion"),
    row("launch or a worker killed 0.5–30 ms after exec", "the next start works unattended", "every time"),
    row(
        "killed at start while making shared memory",
        "nobody waits for it; the next start works",
        "every time",
    ),
    row("successor killed while making shared memory", "nobody waits for it", "0 cycles lost, same bits"),
    row("lies on every wire", "limits kept at every tick, every cycle accounted for", "whole run"),
];

/// How a row was run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// In virtual time, in one thread.
    Virtual,
    /// With real processes.
    Real,
}

const INTRO: &str = "# Faults

What goes wrong, what must happen, within what bound, and what was measured. Written by the tests:

    HILARE_FAULTS_REPORT=$PWD/docs/faults.md HILARE_FAULT_SEEDS=1000 cargo test --release --test faults_virtual
    HILARE_FAULTS_REPORT=$PWD/docs/faults.md cargo test --release --test faults_real    # HILARE_FAULT_SEEDS=10: at night

\"Virtual time\": every box as a process of its own in one thread, faults drawn from a seed
([tests/faults](../tests/faults/mod.rs)). At every tick of every run: wheel speeds and twist within the limits, their
change within the accelerations, no two steps in a tick, every control cycle accounted for.
Ticks are ticks executed, 1 ms each.

| fault | must happen | bound | virtual time | real processes |
|---|---|---|---|---|
";

/// Writes a row's figures, if a report is asked for.
pub fn record(fault: &str, layer: Layer, measured: &str) {
    assert!(ROWS.iter().any(|row| row.fault == fault), "{fault:?} is no row of the table");
    assert!(!measured.contains('|'), "{measured:?} would break the table");
    let Ok(path) = std::env::var("HILARE_FAULTS_REPORT") else { return };
    let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
    let mut file = open.unwrap_or_else(|error| panic!("HILARE_FAULTS_REPORT={path}: {error}"));
    // Rows are run side by side.
    flock(&file, FlockOperation::LockExclusive).expect("a lock on the report");
    let mut text = String::new();
    file.read_to_string(&mut text).expect("a report that is text");
    let mut cells = cells(&text);
    let place = cells.entry(fault.to_owned()).or_default();
    place[usize::from(layer == Layer::Real)] = measured.to_owned();
    file.set_len(0).expect("an empty report");
    file.rewind().expect("its beginning");
    file.write_all(table(&cells).as_bytes()).expect("the report");
}

/// What a report says was measured, a row.
fn cells(text: &str) -> HashMap<String, [String; 2]> {
    let rows = text.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| fault |"));
    let cell = |cells: &[&str], n: usize| cells.get(n).map_or("", |cell| cell.trim()).to_owned();
    rows.map(|line| line.split('|').collect::<Vec<_>>())
        .map(|cells| (cell(&cells, 1), [cell(&cells, 4), cell(&cells, 5)]))
        .collect()
}

fn table(cells: &HashMap<String, [String; 2]>) -> String {
    let mut text = INTRO.to_owned();
    for Row { fault, must, bound } in ROWS {
        let [simulated, real] = cells.get(*fault).cloned().unwrap_or_default();
        let _ = writeln!(text, "| {fault} | {must} | {bound} | {simulated} | {real} |");
    }
    text
}

/// The rows of a report, in its order.
pub fn faults_of(text: &str) -> Vec<String> {
    let rows = text.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| fault |"));
    rows.filter_map(|line| Some(line.split('|').nth(1)?.trim().to_owned())).collect()
}
