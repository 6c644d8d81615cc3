//! Every control law on every robot it drives, in every clock, and side by side.

mod support;

use hilare_controller::{LAWS, LawSpec};
use serde_json::Value;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;
use support::{Lab, Running, number, quick, skip, text};

/// A job for each robot: chassis, scenario.
const JOBS: [(&str, &str); 3] =
    [("differential", "rectangle"), ("differential", "arc-102cm"), ("mecanum", "agv-course")];

fn pairs() -> impl Iterator<Item = (&'static LawSpec, &'static str)> {
    LAWS.iter().flat_map(|law| {
        JOBS.iter().filter(|(kind, _)| law.chassis.contains(kind)).map(move |(_, scenario)| (law, *scenario))
    })
}

fn run(lab: &Lab, scenario: &str, law: &str, clock: &str, more: &[&str]) -> Value {
    let robot = lab.robot_named(clock);
    let args = ["run", scenario, "--controller", law, "--clock", clock, "--json", "--robot", &robot];
    let ended = lab.hilare(&[&args[..], more].concat()).expect_code(0);
    serde_json::from_str(&ended.stdout).expect("--json answers in JSON, and nothing else")
}

#[test]
fn in_lockstep_every_pair_ends_in_the_bits_of_one_thread() {
    let lab = Lab::new();
    for (law, scenario) in pairs() {
        let [mut alone, mut together] =
            ["in-process", "lockstep"].map(|clock| run(&lab, scenario, law.name, clock, &[]));
        for summary in [&mut alone, &mut together] {
            let object = summary.as_object_mut().expect("an object");
            assert!(object.remove("clock").is_some() && object.remove("lateness_us").is_some());
            // What processes say of themselves is recorded, too, and one thread has none.
            assert_eq!(object.remove("recording").expect("a recording")["complete"], true);
        }
        assert_eq!(alone, together, "{} on {scenario}", law.name);
        assert_eq!(alone["reached"], true, "{} on {scenario}", law.name);
    }
    lab.assert_nothing_left("lockstep runs");
}

#[test]
fn estimators_keep_the_bits_too() {
    let lab = Lab::new();
    for (scenario, kind) in
        [("rectangle", "ekf"), ("rectangle", "camera"), ("arc-102cm", "ekf"), ("agv-low", "ekf")]
    {
        let set = format!("estimator.kind={kind}");
        let law = if scenario == "agv-low" { "finite-step" } else { "navigation-circle" };
        let [alone, together] =
            ["in-process", "lockstep"].map(|clock| run(&lab, scenario, law, clock, &["--set", &set]));
        assert_eq!(alone["state_hash"], together["state_hash"], "{scenario}, {kind}");
    }
    // A picture a tick and a long control period: the plant gets far ahead of the estimator.
    let ahead =
        ["--set", "estimator.kind=ekf", "--set", "camera.period_ticks=1", "--set", "timing.period_ticks=200"];
    let [alone, together] =
        ["in-process", "lockstep"].map(|clock| run(&lab, "agv-low", "pure-pursuit", clock, &ahead));
    assert_eq!(alone["state_hash"], together["state_hash"], "a picture a tick");
}

/// Robots in real time have the cores for themselves, as far as these tests go.
static CORES: Mutex<()> = Mutex::new(());

/// A real run on one core, and whether its verdict expects the bits of the simulation.
fn real(lab: &Lab, scenario: &str, law: &str, cpu: usize) -> (Value, bool) {
    let out = lab.dir().join(format!("{scenario}-{law}"));
    let robot = lab.robot_named(scenario);
    let args = ["run", scenario, "--controller", law, "--robot", &robot, "--out", &out.to_string_lossy()];
    let mut command = lab.command(&args);
    // A shared machine may take the core away for longer than the policy allows.
    command.args(["--set", "timing.pause_stop_ticks=0"]);
    for process in ["waypoint_selector", "controller", "step_generator", "pose_estimator", "plant"] {
        command.args(["--set", &format!("realtime.{process}.cpu={cpu}")]);
    }
    let ended = Running::start(command).wait(Duration::from_secs(180)).expect_code(0);
    let summary = lab.summary(&out);
    let on_time = !ended.stdout.contains("not expected to be the simulation's");
    assert!(!on_time || number(&summary, "commands_late") == 0.0, "{scenario}: {}", ended.stdout);
    (summary, on_time)
}

/// The same; where commands came late it must say so, and it is run again.
fn real_on_time(lab: &Lab, scenario: &str, law: &str, cpu: usize) -> Value {
    for _ in 0..3 {
        let (summary, on_time) = real(lab, scenario, law, cpu);
        if on_time {
            return summary;
        }
    }
    panic!("{scenario}, {law}: commands or the lease were late in three runs");
}

#[test]
fn in_real_time_each_robot_ends_in_the_bits_of_one_thread() {
    if quick("in_real_time_each_robot_ends_in_the_bits_of_one_thread (a minute)") {
        return;
    }
    let _cores = CORES.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let lab = &lab;
    let jobs = [("arc-102cm", "navigation-circle"), ("agv-course", "finite-step")];
    thread::scope(|scope| {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let start = |i: usize| scope.spawn(move || real_on_time(lab, jobs[i].0, jobs[i].1, i % cores));
        let runs: Vec<_> = (0..jobs.len()).map(start).collect();
        for ((scenario, law), run_in_real_time) in jobs.into_iter().zip(runs) {
            let hash = run_in_real_time.join().expect("the run's thread")["state_hash"].clone();
            assert_eq!(hash, run(lab, scenario, law, "in-process", &[])["state_hash"], "{scenario}, {law}");
        }
    });
    lab.assert_nothing_left("real runs");
}

/// The targets of the predictive law: mean cross-track, mm; mean speed error, mm/s.
const YARDSTICK: [(&str, f64); 3] = [("trapezoid", 1.3), ("rectangle", 1.05), ("so", 0.5)];
const SPEED_ERROR_MMPS: f64 = 0.3;

#[track_caller]
fn assert_yardstick(scenario: &str, cross_track_mm: f64, summary: &Value) {
    let cross_track = number(summary, "cross_track_mean_m") * 1e3;
    let speed = number(summary, "speed_error_mean_mps") * 1e3;
    assert!(
        cross_track <= cross_track_mm && speed <= SPEED_ERROR_MMPS,
        "{scenario}: {cross_track} mm, {speed} mm/s"
    );
}

#[test]
fn the_predictive_law_meets_its_yardstick_in_one_thread() {
    let lab = Lab::new();
    for (scenario, cross_track_mm) in YARDSTICK {
        assert_yardstick(scenario, cross_track_mm, &run(&lab, scenario, "qp", "in-process", &[]));
    }
}

#[test]
fn the_predictive_law_meets_its_yardstick_in_real_time() {
    if quick("the_predictive_law_meets_its_yardstick_in_real_time (a minute)") {
        return;
    }
    let _cores = CORES.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let check = |scenario: &str, cross_track_mm: f64, cpu: usize| {
        let (summary, on_time) = real(&lab, scenario, "qp", cpu);
        assert_yardstick(scenario, cross_track_mm, &summary);
        // A host that makes a command late changes bits, and the run has said so; not what it came to.
        if on_time {
            let alone = run(&lab, scenario, "qp", "in-process", &[]);
            assert_eq!(summary["state_hash"], alone["state_hash"], "{scenario}");
        } else {
            skip("the bits of the predictive law in real time", scenario);
        }
    };
    let last = thread::available_parallelism().map_or(1, usize::from) - 1;
    // The long one on one core, the two short ones after one another on another.
    let [trapezoid, rectangle, so] = YARDSTICK;
    thread::scope(|scope| {
        scope.spawn(|| check(so.0, so.1, last));
        check(trapezoid.0, trapezoid.1, 0);
        check(rectangle.0, rectangle.1, 0);
    });
}

#[test]
fn compare_shows_every_law_that_drives_the_robot() {
    let lab = Lab::new();
    let ended = lab.hilare(&["compare", "agv-low", "rectangle", "--json", "--out", "laws"]).expect_code(0);
    let rows: Value = serde_json::from_str(&ended.stdout).expect("JSON");
    for (scenario, kind) in [("agv-low", "mecanum"), ("rectangle", "differential")] {
        let of_it: Vec<&Value> =
            rows.as_array().expect("rows").iter().filter(|row| row["scenario"] == scenario).collect();
        let names: Vec<&str> = of_it.iter().map(|row| text(row, "controller")).collect();
        let expected: Vec<&str> =
            LAWS.iter().filter(|law| law.chassis.contains(&kind)).map(|law| law.name).collect();
        assert_eq!(names, expected, "{scenario}");
        for row in of_it {
            assert_eq!((&row["runs"], &row["arrived"]), (&1.into(), &1.into()), "{row}");
            assert!(number(row, "cross_track_mean_m") > 0.0 && number(row, "duration_s") > 1.0, "{row}");
            assert!(number(&row["step_cpu_us"], "p50") > 0.0, "{row}");
            assert_eq!(row["correction"].is_object(), scenario == "agv-low", "{row}");
        }
        for picture in ["path", "cross_track"] {
            let svg = std::fs::read_to_string(lab.dir().join(format!("laws/{scenario}-{picture}.svg")));
            let svg = svg.expect("a picture");
            assert!(expected.iter().all(|law| svg.contains(law)), "{scenario}-{picture}.svg lacks a law");
        }
    }
    let alone = run(&lab, "rectangle", "qp", "in-process", &[]);
    let row = rows
        .as_array()
        .expect("rows")
        .iter()
        .find(|row| row["controller"] == "qp" && row["scenario"] == "rectangle");
    assert_eq!(row.expect("qp")["cross_track_mean_m"], alone["cross_track_mean_m"]);
}

#[test]
fn wrong_laws_and_parameters_are_one_line() {
    let lab = Lab::new();
    let cases: [(&[&str], &[&str]); 15] = [
        (&["compare", "rectangle", "rectangle"], &["rectangle: two scenarios of this name"]),
        (&["compare", "rectangel"], &["did you mean \"rectangle\""]),
        (&["compare", "--laws", "qq"], &["unknown law \"qq\"", "known: kanayama"]),
        (&["compare", "rectangle", "--laws", "finite-step"], &["differential", "rectangle"]),
        (&["compare", "--seeds", "0"], &["0", "--seeds"]),
        (&["run", "so", "--controller", "finite-step"], &["finite-step", "mecanum", "differential"]),
        (&["run", "agv-low", "--controller", "kanayama"], &["kanayama", "mecanum"]),
        (&["run", "agv-low", "--set", "motors.kind=stepper"], &["Mecanum", "servo"]),
        (
            &["run", "agv-low", "--set", "controller.finite-step.sample_period_s=0"],
            &["sample_period_s", "0.001"],
        ),
        (&["run", "agv-low", "--set", "controller.finite-step.steps_max=0"], &["steps_max", "1 to 40"]),
        (&["run", "agv-low", "--set", "timing.period_ticks=7"], &["finite-step.sample_period_s"]),
        (&["run", "arc-102cm", "--set", "controller.navigation-circle.circle_tracks=0"], &["circle_tracks"]),
        (&["run", "arc-102cm", "--set", "controller.navigation-circle.proportional_per_rad=-1"], &["-1"]),
        (
            &["run", "so", "--controller", "qp", "--set", "controller.qp.max_iterations=0"],
            &["max_iterations"],
        ),
        (&["run", "so", "--set", "estimator.kind=kalman"], &["kalman", "ekf"]),
    ];
    for (args, hints) in cases {
        refused(&lab, args, hints);
    }
    let paths: [(&str, &str, &[&str]); 6] = [
        ("tight.csv", "x,y,bulge\n0,0,0\n0.0001,0,1\n", &["tight.csv:3", "radius below 0.001 m"]),
        ("flat.csv", "x,y,bulge\n0,0,0\n1,0,1e-9\n", &["flat.csv:3", "write bulge 0 for a line"]),
        ("round.csv", "x,y,bulge\n0,0,0\n1,0,3\n", &["round.csv:3", "270°"]),
        ("same.csv", "x,y,bulge\n0,0,0\n0,0,1\n", &["same.csv:3", "same place"]),
        ("degrees.csv", "x,y,bulge,crab_rad\n0,0,0,0\n1,0,0,90\n", &["degrees.csv:3", "radians"]),
        ("crab.csv", "x,y,bulge,crab_rad\n0,0,0,0\n1,0,0,1.57\n", &["waypoint 2", "cannot move sideways"]),
    ];
    for (name, contents, hints) in paths {
        lab.file(name, contents);
        refused(&lab, &["run", "--path", name], hints);
    }
    lab.assert_nothing_left("refusals");
}

#[track_caller]
fn refused(lab: &Lab, args: &[&str], hints: &[&str]) {
    let ended = lab.hilare(args);
    assert_eq!((ended.code, &*ended.stdout), (Some(2), ""), "{args:?}: {ended:#?}");
    assert_eq!(ended.complaints().len(), 1, "{args:?}: {ended:#?}");
    for hint in hints {
        assert!(ended.stderr.contains(hint), "{args:?}: {:?} does not say {hint:?}", ended.stderr);
    }
    assert!(!lab.dir().join("runs").exists(), "{args:?} left a report");
}
