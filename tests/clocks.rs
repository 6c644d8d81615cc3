//! One system, three clocks: the table of spec 1 in-process, and the same bits from processes over shared
//! memory, in virtual and in real time.

mod support;

use serde_json::Value;
use std::thread;
use std::time::Duration;
use support::{Lab, Running, number, quick, text};

/// A line of spec 1's table, lag 5, in its units.
struct Line {
    scenario: &'static str,
    cross_track_mean_mm: f64,
    cross_track_max_mm: f64,
    speed_error_mmps: f64,
    ticks: u64,
    steps: [i64; 2],
    pose: [f64; 3],
}

const TABLE: [Line; 4] = [
    Line {
        scenario: "trapezoid",
        cross_track_mean_mm: 2.7699,
        cross_track_max_mm: 22.53,
        speed_error_mmps: 2.5822,
        ticks: 37145,
        steps: [12065, 10350],
        pose: [214.863, 222.266, 4.12870],
    },
    Line {
        scenario: "rectangle",
        cross_track_mean_mm: 3.7897,
        cross_track_max_mm: 26.86,
        speed_error_mmps: 2.9021,
        ticks: 34390,
        steps: [11259, 9294],
        pose: [199.505, 226.920, 4.73056],
    },
    Line {
        scenario: "rectangle-open",
        cross_track_mean_mm: 3.3857,
        cross_track_max_mm: 26.86,
        speed_error_mmps: 2.6199,
        ticks: 26770,
        steps: [8720, 7410],
        pose: [226.814, 500.456, 3.15370],
    },
    Line {
        scenario: "so",
        cross_track_mean_mm: 5.8737,
        cross_track_max_mm: 24.58,
        speed_error_mmps: 1.4702,
        ticks: 60420,
        steps: [19939, 17067],
        pose: [898.193, 329.172, 6.91407],
    },
];

/// Runs a scenario in virtual time.
fn run(lab: &Lab, scenario: &str, clock: &str) -> Value {
    let robot = lab.robot_named(scenario);
    let args = ["run", scenario, "--clock", clock, "--json", "--robot", &robot];
    let ended = lab.hilare(&args).expect_code(0);
    assert_eq!(ended.stderr, "", "{scenario}, {clock}");
    serde_json::from_str(&ended.stdout).expect("--json answers in JSON, and nothing else")
}

#[track_caller]
fn assert_share(what: &str, found: f64, wanted: f64, share: f64) {
    assert!((found / wanted - 1.0).abs() <= share, "{what}: {found}, the table says {wanted}");
}

#[test]
fn the_table_of_spec_1() {
    let lab = Lab::new();
    for line in &TABLE {
        let summary = run(&lab, line.scenario, "in-process");
        let what = line.scenario;
        assert_eq!(summary["reached"], true, "{what}");
        assert_eq!(summary["ticks"], line.ticks, "{what}");
        assert_eq!(number(&summary, "duration_s"), line.ticks as f64 / 1e3, "{what}");
        for (wheel, wanted) in line.steps.iter().enumerate() {
            let steps = summary["steps"][wheel].as_i64().expect("steps");
            assert!(
                (steps - wanted).abs() <= 2,
                "{what}: {steps} steps of wheel {wheel}, {wanted} in the table"
            );
        }
        assert_share(what, number(&summary, "cross_track_mean_m") * 1e3, line.cross_track_mean_mm, 0.005);
        assert_share(what, number(&summary, "cross_track_max_m") * 1e3, line.cross_track_max_mm, 0.005);
        assert_share(what, number(&summary, "speed_error_mean_mps") * 1e3, line.speed_error_mmps, 0.005);
        let pose = &summary["final_pose"];
        let off = [number(pose, "x_m") * 1e3 - line.pose[0], number(pose, "y_m") * 1e3 - line.pose[1]];
        assert!(off[0].hypot(off[1]) <= 0.2, "{what}: {pose}");
        assert!((number(pose, "theta_rad") - line.pose[2]).abs() <= 0.002, "{what}: {pose}");
    }
    lab.assert_nothing_left("in-process runs");
}

#[test]
fn lockstep_ends_in_the_bits_of_one_thread() {
    let lab = Lab::new();
    for line in &TABLE {
        let [mut alone, mut together] =
            ["in-process", "lockstep"].map(|clock| run(&lab, line.scenario, clock));
        // Lateness is of the host; everything else is the run.
        for summary in [&mut alone, &mut together] {
            let object = summary.as_object_mut().expect("an object");
            assert!(object.remove("clock").is_some() && object.remove("lateness_us").is_some());
            // Processes go on for some ticks after the arrival.
            let recording = object.remove("recording").expect("a recording");
            assert_eq!(recording["complete"], true, "{recording}");
        }
        assert_eq!(alone, together, "{}", line.scenario);
        assert_eq!(text(&alone, "state_hash").len(), 16);
    }
    lab.assert_nothing_left("lockstep runs");
}

/// Runs of a scenario at most, if the host spoils them: stalls of some milliseconds can meet every one of three.
const ATTEMPTS: u32 = 6;

/// A real run; where commands came late the bits may differ, it must say so, and it is run again.
fn real_hash(lab: &Lab, scenario: &str, cpu: usize) -> Result<String, String> {
    let mut late = Vec::new();
    for attempt in 1..=ATTEMPTS {
        let out = lab.dir().join(format!("{scenario}-{attempt}"));
        let robot = lab.robot_named(scenario);
        let args = ["run", scenario, "--clock", "real", "--robot", &robot, "--out", &out.to_string_lossy()];
        // A host that takes the core away for 0.1 s would stop the robot by policy; a test on a shared machine
        // lives with such pauses: they may not change a bit either.
        let mut command = lab.command(&args);
        command.args(["--set", "timing.pause_stop_ticks=0"]);
        // By default every robot sits on the last core; four of them in a debug build are too many for one.
        for process in ["waypoint_selector", "controller", "step_generator", "pose_estimator", "plant"] {
            command.args(["--set", &format!("realtime.{process}.cpu={cpu}")]);
        }
        let ended = Running::start(command).wait(Duration::from_secs(180)).expect_code(0);
        let summary = lab.summary(&out);
        assert!(ended.stdout.contains(text(&summary, "state_hash")), "{}", ended.stdout);
        // Late commands, or a lease of launch that ran out: the robot acted otherwise, and the verdict says so.
        let confesses = ended.stdout.contains("not expected to be the simulation's");
        assert!(confesses || number(&summary, "commands_late") == 0.0, "{scenario}: {}", ended.stdout);
        if !confesses {
            return Ok(text(&summary, "state_hash").to_owned());
        }
        late.push(summary);
    }
    Err(format!("{scenario}: {ATTEMPTS} runs in which commands or the lease were late: {late:#?}"))
}

#[test]
fn real_time_ends_in_the_bits_of_one_thread() {
    if quick("real_time_ends_in_the_bits_of_one_thread (a minute)") {
        return;
    }
    let lab = Lab::new();
    let lab = &lab;
    thread::scope(|scope| {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let start = |i: usize| scope.spawn(move || real_hash(lab, TABLE[i].scenario, i % cores));
        let runs: Vec<_> = (0..TABLE.len()).map(start).collect();
        for (line, run_in_real_time) in TABLE.iter().zip(runs) {
            let hash =
                run_in_real_time.join().expect("the run's thread").unwrap_or_else(|why| panic!("{why}"));
            assert_eq!(hash, run(lab, line.scenario, "in-process")["state_hash"], "{}", line.scenario);
        }
    });
    lab.assert_nothing_left("real runs");
}
