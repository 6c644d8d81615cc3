//! `hilare latency`: its figures, its files, its errors.

mod support;

use serde_json::Value;
use std::fs;
use support::{Lab, number, whole_machine};

const QUANTILES: [&str; 4] = ["p50", "p99", "p99_9", "max"];

fn quantiles(of: &Value) -> [f64; 4] {
    QUANTILES.map(|key| number(of, key))
}

/// Measured, in order.
fn sound(of: &Value) {
    let values = quantiles(of);
    assert!(values[0] > 0.0 && values.is_sorted(), "{of}");
}

/// `over` is `ours` over `base`, each quantile by itself.
fn is_ratio(over: &Value, ours: &Value, base: &Value) {
    for ((over, ours), base) in quantiles(over).iter().zip(quantiles(ours)).zip(quantiles(base)) {
        assert!((over * base - ours).abs() <= 1e-9 * ours, "{over} {ours} {base}");
    }
}

#[test]
fn its_figures_are_whole_and_its_files_there() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = lab.robot();
    let args = ["--seconds", "2", "--load", "--observers", "4", "--json", "--out", "measured"];
    let args = [&["latency", "--robot", &robot], &args[..]].concat();
    let ended = lab.hilare(&args).expect_code(0);
    let figures: Value = serde_json::from_str(&ended.stdout).expect("JSON alone on standard output");
    assert!((2.0..20.0).contains(&number(&figures, "seconds")), "{figures}");
    let samples = number(&figures, "samples");
    assert!(
        samples > 500.0 && samples <= 1100.0 * number(&figures, "seconds") && figures["load"] == true,
        "{figures}"
    );
    let tick = &figures["tick"];
    sound(&tick["ours"]);
    sound(&tick["bare_loop"]);
    is_ratio(&tick["ratio"], &tick["ours"], &tick["bare_loop"]);
    let hops = figures["hops"].as_array().expect("hops");
    let names: Vec<&str> = hops.iter().map(|hop| hop["name"].as_str().expect("a name")).collect();
    assert_eq!(names, ["steps->pose", "pose->reference", "reference->command", "steps->command"]);
    for hop in hops {
        ["ours", "futex", "iceoryx2"].iter().for_each(|kind| sound(&hop[kind]));
        is_ratio(&hop["ratio"], &hop["ours"], &hop["futex"]);
        is_ratio(&hop["ratio_iceoryx2"], &hop["ours"], &hop["iceoryx2"]);
    }
    // The whole way is no shorter than a part of it.
    for part in &hops[..3] {
        for kind in ["ours", "futex", "iceoryx2"] {
            assert!(number(&hops[3][kind], "p50") >= number(&part[kind], "p50"), "{kind}: {figures}");
        }
    }
    sound(&figures["work"]);
    sound(&figures["command_ready"]);
    looking_is_measured(&figures["watched"]);
    let processes = figures["processes"].as_array().expect("processes");
    let names: Vec<&str> = processes.iter().map(|one| one["name"].as_str().expect("a name")).collect();
    for name in ["step_generator", "pose_estimator", "waypoint_selector", "controller", "relay", "recorder"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    for count in ["over_budget", "page_faults", "involuntary_switches"] {
        assert!(processes.iter().all(|one| one[count].is_u64()), "{count}: {processes:?}");
    }
    let granted = &figures["granted"];
    assert!(["fifo", "other"].contains(&granted["policy"].as_str().expect("a policy")), "{granted}");
    assert!(granted["priority"].is_u64() && granted["mlock"].is_boolean(), "{granted}");
    assert!(number(&figures, "commands_late") >= number(&figures, "commands_late_beside_stalls"));
    let causes = figures["causes"].as_object().expect("causes");
    let late: f64 = causes.values().filter_map(Value::as_f64).sum();
    assert_eq!(figures["late"].as_array().expect("late ticks").len(), (late as usize).min(1000));

    let dir = lab.dir().join("measured");
    let written: Value =
        serde_json::from_str(&fs::read_to_string(dir.join("latency.json")).expect("written")).expect("JSON");
    assert_eq!(written, figures);
    let raw = fs::read_to_string(dir.join("histograms.csv")).expect("written");
    let count = |what: &str| -> f64 {
        let rows = raw.lines().filter_map(|line| line.strip_prefix(what)?.strip_prefix(','));
        rows.filter_map(|row| row.split_once(',')?.1.parse::<f64>().ok()).sum()
    };
    assert_eq!(count("tick lateness"), samples, "every sample is in the raw histogram");
    for name in ["lateness.svg", "hops.svg"] {
        let svg = fs::read_to_string(dir.join(name)).expect("written");
        assert!(svg.starts_with("<svg") && svg.contains("bare"), "{name}");
    }
    lab.assert_nothing_left("a measurement");
}

/// Four observers come and go for one of two seconds: each joins some ten times, and reads what the relay repeats,
/// three wires of a message a tick.
fn looking_is_measured(watched: &Value) {
    assert_eq!(watched["observers"], 4);
    let (joins, messages) = (number(watched, "joins"), number(watched, "messages"));
    assert!((4.0..=80.0).contains(&joins) && messages > 100.0 * joins, "{watched}");
    for kind in ["tick", "bare_loop", "work", "steps_to_command"] {
        let turns = &watched[kind];
        sound(&turns["without"]);
        sound(&turns["with"]);
        is_ratio(&turns["ratio"], &turns["with"], &turns["without"]);
    }
}

#[test]
fn a_robot_that_nobody_records_is_measured_too() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = lab.robot();
    let args = ["latency", "--seconds", "1", "--no-recorder", "--json", "--robot", &robot];
    let figures: Value = serde_json::from_str(&lab.hilare(&args).expect_code(0).stdout).expect("JSON");
    let processes = figures["processes"].as_array().expect("processes");
    assert!(processes.iter().all(|one| one["name"] != "recorder"), "{processes:?}");
    assert_eq!(figures.get("watched"), None);
}

#[test]
fn it_speaks_to_people_and_ends_clean_when_interrupted() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = lab.robot();
    let ended = lab.hilare(&["latency", "--seconds", "1", "--robot", &robot]).expect_code(0);
    for what in ["lateness of the tick", "bare loop", "steps->command", "commands late", "the clock has"] {
        assert!(ended.stdout.contains(what), "{what} is missing:\n{}", ended.stdout);
    }
    let run = lab.start(&["latency", "--seconds", "60", "--robot", &robot]);
    lab.await_status(&robot, "it drives", |status| number(status, "tick") > 100.0);
    run.signal(rustix::process::Signal::INT);
    let ended = run.wait(support::PATIENCE).expect_code(1);
    assert_eq!(ended.stderr, "hilare: interrupted\n");
    lab.assert_nothing_left("an interrupted measurement");
}

#[test]
fn what_cannot_be_measured_is_one_line() {
    let lab = Lab::new();
    for (args, expected) in [
        (&["--seconds", "0"][..], "--seconds 0: 1 to 86400 are wanted"),
        (&["--seconds", "NaN"], "--seconds NaN: 1 to 86400 are wanted"),
        (&["--set", "step_generator.cpu=0"], "unknown"),
        (&["--system", "nowhere"], "nowhere"),
        (&["--observers", "61"], "--observers 61: 0 to 60 are wanted"),
        (&["--out", "/proc/none"], "--out /proc/none"),
    ] {
        let ended = lab.hilare(&[&["latency"], args].concat()).expect_code(2);
        assert_eq!(ended.complaints().len(), 1, "{ended:#?}");
        assert!(ended.stderr.contains(expected), "{expected}: {ended:#?}");
    }
    lab.assert_nothing_left("refused measurements");
}
