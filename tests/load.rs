//! A minute in real time beside a load on every core: pauses are counted, no step is lost, none is hurried.

mod support;

use serde_json::Value;
use std::hint::black_box;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;
use support::{Lab, number, quick};

/// Ticks between two rows of the trace.
const STRIDE: u64 = 5;
/// The e-puck: rim travel of a step, distance of the wheels.
const STEP_M: f64 = 0.000_13;
const TRACK_M: f64 = 0.054;
/// Fastest wheel, 3.25 rad/s of 0.0065 rad a step.
const STEPS_A_TICK: f64 = 0.5;

/// Two threads a core: one computes, one goes through memory.
fn load(stop: &AtomicBool, memory: bool) {
    let mut words = vec![1u64; if memory { 4 << 20 } else { 16 }];
    let mut carry = 1u64;
    while !stop.load(Ordering::Relaxed) {
        for word in &mut words {
            carry = carry.rotate_left(7) ^ *word;
            *word = carry;
        }
        black_box(&mut words);
    }
}

/// Signed steps of each wheel since the start, every [`STRIDE`] ticks, right first, from the trace's pose:
/// a tick moves the robot by (T1 + T2)/2 steps and turns it by (T1 − T2) steps over the track.
fn steps_of(trace: &Path) -> Vec<(u64, [f64; 2])> {
    let text = std::fs::read_to_string(trace).expect("trace.csv");
    let header = text.lines().next().expect("a header");
    assert!(header.starts_with("tick,pose_x_m,pose_y_m,pose_theta_rad,"), "{header}");
    let (mut last, mut moved, mut rows) = ([0.2, 0.2, 0.0], 0.0, Vec::new());
    for line in text.lines().skip(1) {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
        let (x, y, heading) = (numbers[1], numbers[2], numbers[3]);
        moved += ((x - last[0]).hypot(y - last[1]) / STEP_M * 2.0).round();
        let turned = (heading * TRACK_M / STEP_M).round();
        rows.push((numbers[0] as u64, [(moved + turned) / 2.0, (moved - turned) / 2.0]));
        last = [x, y, heading];
    }
    rows
}

/// In any window of n ticks a wheel makes at most n/2 + 1 steps, pauses or not.
fn no_burst(rows: &[(u64, [f64; 2])]) {
    for window in [1, 2, 4, 20, 200] {
        for pair in rows.windows(window + 1) {
            let (from, to) = (pair[0], pair[window]);
            assert_eq!(to.0 - from.0, STRIDE * window as u64, "a row is missing at tick {}", from.0);
            for wheel in 0..2 {
                let steps = to.1[wheel] - from.1[wheel];
                let most = (STRIDE * window as u64) as f64 * STEPS_A_TICK + 1.0;
                assert!(
                    steps.abs() <= most,
                    "{steps} steps of wheel {wheel} from tick {} to {}",
                    from.0,
                    to.0
                );
            }
        }
    }
}

/// Counters of pauses fit each other and the lateness.
fn pauses_are_counted(summary: &Value) {
    let [late, lost, longest] =
        ["ticks_late", "paused_ticks", "paused_max_ticks"].map(|key| number(summary, key));
    assert!(longest <= lost && late <= lost && (late > 0.0) == (lost > 0.0), "{summary}");
    assert!(lost <= late * longest, "{summary}");
    let lateness = &summary["lateness_us"];
    assert!(number(lateness, "max") >= longest * 1e3, "a pause of n ticks was n ticks late: {summary}");
    if late == 0.0 {
        // Buckets of the histogram may round up.
        assert!(number(lateness, "max") < 1.2e3, "late by a tick and not counted: {summary}");
    }
    for (a, b) in [("p50", "p99"), ("p99", "p99_9")] {
        assert!(number(lateness, a) <= number(lateness, b), "{summary}");
    }
    assert!(number(lateness, "p50") > 0.0, "{summary}");
}

#[test]
fn a_minute_beside_a_load_on_every_core() {
    if quick("a_minute_beside_a_load_on_every_core") {
        return;
    }
    let lab = Lab::new();
    let robot = lab.robot();
    let simulated: Value = serde_json::from_str(
        &lab.hilare(&["run", "so", "--clock", "in-process", "--json"]).expect_code(0).stdout,
    )
    .expect("JSON");
    let stop = AtomicBool::new(false);
    let ended = thread::scope(|scope| {
        for n in 0..2 * thread::available_parallelism().map_or(1, usize::from) {
            let stop = &stop;
            scope.spawn(move || load(stop, n % 2 == 0));
        }
        // Ends the load when the test fails, too: a scope waits for its threads.
        let _stop = StopOnDrop(&stop);
        // The policy of stopping after a pause of 0.1 s is not what is tested on a shared host.
        let args = ["run", "so", "--robot", &robot, "--out", "report", "--set", "timing.pause_stop_ticks=0"];
        lab.start(&args).wait(Duration::from_secs(300))
    });
    let ended = ended.expect_code(0);
    let report = lab.dir().join("report");
    let summary = lab.summary(&report);
    println!("{summary:#}");
    assert_eq!(summary["reached"], true);
    pauses_are_counted(&summary);
    assert_eq!(
        ended.stdout.contains("pauses    none"),
        number(&summary, "ticks_late") == 0.0,
        "{}",
        ended.stdout
    );

    let rows = steps_of(&report.join("trace.csv"));
    no_burst(&rows);
    let last = rows.last().expect("rows");
    for wheel in 0..2 {
        let counted = summary["steps"][wheel].as_f64().expect("steps");
        let most = (number(&summary, "ticks") - last.0 as f64) * STEPS_A_TICK + 1.0;
        let recorded = last.1[wheel];
        assert!((counted - recorded).abs() <= most, "wheel {wheel}: {counted} counted, {recorded} recorded");
    }
    // Late commands, or a lease of launch that ran out: the robot acted otherwise, and the verdict says so.
    let confesses = ended.stdout.contains("not expected to be the simulation's");
    assert!(confesses || number(&summary, "commands_late") == 0.0, "{}", ended.stdout);
    if !confesses {
        for key in ["ticks", "steps", "state_hash", "final_pose", "cross_track_mean_m"] {
            assert_eq!(summary[key], simulated[key], "{key}: not the simulation's");
        }
    }
    lab.assert_nothing_left("a run beside a load");
}

struct StopOnDrop<'s>(&'s AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
