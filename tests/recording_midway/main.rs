//! Recordings begun when the robot is up, in the middle of its drive, replayed to the last bit.

#[path = "../support/mod.rs"]
mod support;

mod damage;
mod midway;

use midway::{Midway, compared};
use rustix::process::Signal;
use serde_json::Value;
use std::path::Path;
use support::{PATIENT, Running, number, whole_machine};

/// Whatever may happen on the way.
fn adventures(midway: &Midway) {
    midway.goes_on("it drives on");
    midway.tell(&["param", "set", "tracking.speed_mps=0.035", "limits.omega_max_radps=0.6"]).expect_code(0);
    midway.goes_on("with other parameters");
    midway.tell(&["swap", "controller", "qp"]).expect_code(0);
    midway.goes_on("with another law");
    for process in ["planner", "waypoint_selector", "pose_estimator", "controller"] {
        midway.lab.replace(&midway.robot, process);
        midway.goes_on(&format!("after the death of {process}"));
    }
    midway.tell(&["swap", "waypoint_selector", "--set", "tracking.speed_mps=0.03"]).expect_code(0);
    midway.goes_on("with another selector");
}

/// One with a whole recording: where messages are missing, once more.
fn whole(record: impl Fn() -> (Midway, bool)) -> Midway {
    let mut tries = (0..10).map(|_| record());
    tries.find(|(_, whole)| *whole).expect("a machine that lets the recorder work").0
}

fn in_real_time() -> (Midway, bool) {
    let midway = Midway::new();
    midway.up(&["--standby", "kanayama"]);
    midway.tell(&["arm"]).expect_code(0);
    midway.tell(&["follow", &midway.lab.laps(20)]).expect_code(0);
    midway.tell(&["param", "set", "controller.kanayama.k1_per_s=1.5"]).expect_code(0);
    midway.goes_on("it drives");
    let recorder = midway.record();
    adventures(&midway);
    midway.tell(&["goal", "0.4", "0.4"]).expect_code(0);
    midway.goes_on("it drives to the goal");
    midway.lab.replace(&midway.robot, "step_generator");
    midway.tell(&["arm"]).expect_code(0);
    midway.goes_on("it drives again");
    midway.tell(&["stop"]).expect_code(0);
    midway.goes_on("it stands");
    let whole = midway.ended_whole(recorder);
    midway.tell(&["down"]).expect_code(0);
    (midway, whole)
}

#[test]
fn a_recording_begun_in_mid_drive_replays_to_its_bits_in_real_time() {
    let _machine = whole_machine();
    let midway = whole(in_real_time);
    let report = midway.replayed(500.0);
    assert!(compared(&report, "controller", "command") > 500.0, "{report:#}");
    assert!(compared(&report, "step_generator", "taken in") > 500.0, "{report:#}");
    assert_eq!(compared(&report, "planner", "answer"), 1.0, "{report:#}");

    driven_again(&midway);
    let differing = |change: &[&str]| {
        let ended = midway.replay(&[&["--box", "controller", "--json"], change].concat()).expect_code(0);
        let report: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        assert!(number(&report, "compared") > 500.0, "{report:#}");
        number(&report, "differing")
    };
    assert_eq!(differing(&["--set", "timing.hold_cycles=2"]), 0.0);
    assert!(differing(&["--set", "controller.kanayama.k1_per_s=2.5"]) > 50.0);
    assert!(differing(&["--controller", "stanley"]) > 50.0);

    damage::a_flipped_bit_is_found(&midway);
    damage::standings_that_are_none_are_said_so(&midway);
}

/// Driven again from the middle on, it never leaves the recording; with other parameters it does.
#[track_caller]
fn driven_again(midway: &Midway) {
    let drive = |change: &[&str]| -> Value {
        let ended = midway.replay(&[change, &["--json"]].concat()).expect_code(0);
        serde_json::from_str(&ended.stdout).expect("JSON")
    };
    let same = drive(&["--set", "timing.hold_cycles=2"]);
    assert_eq!(same["parted"], Value::Null, "{same:#}");
    // Of the last moment one wire may have more than another.
    let seconds = ["recorded", "changed"].map(|which| number(&same[which], "duration_s"));
    assert!(seconds[0] > 0.3 && (seconds[0] - seconds[1]).abs() < 0.1, "{same:#}");
    for change in [["--set", "limits.v_max_mps=0.01"], ["--controller", "stanley"]] {
        let other = drive(&change);
        assert_ne!(other["parted"], Value::Null, "{other:#}");
    }
}

fn end(run: Running) {
    run.signal(Signal::INT);
    run.wait(support::PATIENCE);
}

#[test]
fn a_recording_begun_in_mid_drive_replays_to_its_bits_in_virtual_time() {
    let _machine = whole_machine();
    let midway = whole(|| {
        let midway = Midway::new();
        let run = midway.in_lockstep(&["--standby", "kanayama"]);
        let recorder = midway.record();
        adventures(&midway);
        let whole = midway.ended_whole(recorder);
        end(run);
        (midway, whole)
    });
    // Eight times a third of a second, five ticks a control period.
    let report = midway.replayed(500.0);
    assert!(compared(&report, "controller", "command") > 500.0, "{report:#}");
    driven_again(&midway);
}

#[test]
fn sensors_servos_and_a_camera_are_met_in_mid_drive_too() {
    let _machine = whole_machine();
    for (scenario, more) in [("line-21deg", &["--set", "estimator.kind=ekf"][..]), ("agv-course", &[])] {
        let midway = whole(|| {
            let midway = Midway::new();
            let args = ["run", scenario, "--robot", &midway.robot, "--no-recording", "--out", "report"];
            let run = midway.lab.start(&[&args[..], &PATIENT, more].concat());
            midway.goes_on("it drives");
            let recorder = midway.record();
            midway.goes_on("it drives on");
            midway.lab.replace(&midway.robot, "pose_estimator");
            midway.goes_on("it drives on with a successor");
            let whole = midway.ended_whole(recorder);
            end(run);
            (midway, whole)
        });
        let report = midway.replayed(100.0);
        assert!(compared(&report, "plant", "wheels") > 500.0, "{scenario}: {report:#}");
        driven_again(&midway);
        assert!(more.is_empty() || compared(&report, "plant", "fix") > 5.0, "{scenario}: {report:#}");
    }
}

#[test]
fn begun_before_the_robot_is_armed_a_recording_is_whole_and_can_be_driven_again() {
    let _machine = whole_machine();
    let midway = whole(|| {
        let midway = Midway::new();
        midway.up(&[]);
        let keys = ["tracking.speed_mps=0.03", "controller.kanayama.k1_per_s=1.5"];
        midway.tell(&[&["param", "set"], &keys[..]].concat()).expect_code(0);
        let recorder = midway.record();
        midway.tell(&["arm"]).expect_code(0);
        midway.tell(&["follow", &midway.lab.laps(20)]).expect_code(0);
        midway.goes_on("it drives");
        midway.tell(&["param", "set", "tracking.speed_mps=0.04"]).expect_code(0);
        midway.goes_on("it drives on");
        let whole = midway.ended_whole(recorder);
        midway.tell(&["down"]).expect_code(0);
        (midway, whole)
    });
    let report = midway.replayed(100.0);
    assert_eq!(report["notes"].as_array().map(Vec::len), Some(0), "{report:#}");
    driven_again(&midway);
}

#[test]
fn one_that_ends_before_the_boxes_were_asked_says_so() {
    let midway = Midway::new();
    midway.up(&[]);
    let file = midway.file.to_string_lossy().into_owned();
    let ended = midway.tell(&["record", "--out", &file, "--seconds", "0.1"]).expect_code(0);
    assert!(ended.stderr.contains("before the boxes had said where they stand"), "{ended:#?}");
    assert!(Path::new(&file).exists());
    midway.tell(&["down"]).expect_code(0);
}
