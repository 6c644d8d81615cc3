//! However a run ends, nothing is left; and a worker that dies costs what the design says, not more.

mod support;

use rustix::process::Signal;
use std::time::Duration;
use support::random::Random;
use support::{Ended, Lab, Running, comes_true, number, pid_of};

#[test]
fn fifty_runs_in_a_row() {
    let lab = Lab::new();
    let path = lab.straight(0.1);
    let (path, robot) = (path.to_string_lossy(), lab.robot());
    let args =
        ["run", "--path", &path, "--clock", "lockstep", "--json", "--robot", &robot, "--out", "report"];
    let first = lab.hilare(&args).expect_code(0);
    for n in 2..=50 {
        let ended = lab.hilare(&args).expect_code(0);
        // How many ticks after the arrival are recorded is not the run's.
        let size = |line: &str| ["\"messages\": ", "\"bytes\": "].iter().any(|key| line.contains(key));
        let differing: Vec<_> = first
            .stdout
            .lines()
            .zip(ended.stdout.lines())
            .filter(|(a, b)| a != b && !(size(a) && size(b)))
            .collect();
        assert!(differing.is_empty(), "run {n} is not the first one again: {differing:?}");
        assert_eq!(ended.stderr, "", "run {n}");
        lab.assert_nothing_left(&format!("run {n}"));
    }
}

/// A run or a robot that stays up, in real time.
fn start_something(lab: &Lab, n: u64) -> Running {
    let (robot, out) = (lab.robot(), format!("report-{n}"));
    if n.is_multiple_of(2) {
        lab.start(&["run", "so", "--robot", &robot, "--out", &out])
    } else {
        lab.start(&["up", "--robot", &robot])
    }
}

#[test]
fn fifty_times_ctrl_c() {
    let lab = Lab::new();
    let mut random = Random::new("fifty_times_ctrl_c", 1);
    for n in 0..50 {
        // Half of them while it starts, which takes about 60 ms.
        let after_ms = random.whole(0, if n % 4 < 2 { 60 } else { 400 });
        let launch = start_something(&lab, n);
        std::thread::sleep(Duration::from_millis(after_ms));
        launch.signal(Signal::INT);
        let ended = launch.wait(support::PATIENCE);
        let what = format!("Ctrl-C {n}, {after_ms} ms after the start: {ended:?}");
        // Before main has begun, the signal's own end is all there can be.
        assert!(matches!((ended.code, ended.signal), (Some(0 | 1), None) | (None, Some(2))), "{what}");
        assert!(!ended.stderr.contains("panicked"), "{what}");
        assert!(
            comes_true(Duration::from_secs(2), || lab.processes().is_empty()),
            "{what}: {:?}",
            lab.processes()
        );
        lab.assert_nothing_left(&what);
    }
}

#[test]
fn twenty_times_kill_9_of_launch() {
    let lab = Lab::new();
    let mut random = Random::new("twenty_times_kill_9_of_launch", 2);
    let path = lab.straight(0.04);
    let (path, robot) = (path.to_string_lossy(), lab.robot());
    for n in 0..20 {
        let after_ms = random.whole(0, 400);
        let launch = start_something(&lab, n);
        std::thread::sleep(Duration::from_millis(after_ms));
        launch.signal(Signal::KILL);
        launch.wait(support::PATIENCE);
        let what = format!("kill -9 {n}, {after_ms} ms after the start");
        // The design's bound is a second; the machine may be busy.
        assert!(
            comes_true(Duration::from_secs(3), || lab.processes().is_empty()),
            "{what}: {:?}",
            lab.processes()
        );
        // The next start works unattended, and cleans up.
        let ended =
            lab.hilare(&["run", "--path", &path, "--clock", "lockstep", "--robot", &robot, "--out", "next"]);
        assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""), "the start after {what}: {ended:#?}");
        lab.assert_nothing_left(&format!("the start after {what}"));
    }
}

/// Starts a run of 0.3 m in real time and kills a worker with -9 while it drives.
fn kill_while_driving(lab: &Lab, worker: &str) -> Ended {
    let (path, robot) = (lab.straight(0.3), lab.robot());
    let mut command =
        lab.command(&["run", "--path", &path.to_string_lossy(), "--robot", &robot, "--out", "report"]);
    // A pause of a shared host may not stop the robot here: it is the dead worker that is tested.
    command.args(["--set", "timing.pause_stop_ticks=0"]);
    let run = Running::start(command);
    let status = lab.await_status(&robot, "it drives", |status| number(status, "tick") > 500.0);
    support::process::signal(pid_of(&status, worker), Signal::KILL);
    let ended = run.wait(Duration::from_secs(120));
    assert!(!ended.stderr.contains("panicked"), "{ended:#?}");
    lab.assert_nothing_left(&format!("kill -9 of the {worker}"));
    ended
}

/// Lines on standard error about this worker; that it runs best effort (without root) is another matter.
fn lines_about<'e>(ended: &'e Ended, worker: &str) -> Vec<&'e str> {
    let lines = ended.complaints().into_iter().filter(|line| !line.contains("SCHED_FIFO was refused"));
    lines.filter(|line| line.contains(worker)).collect()
}

fn report(lab: &Lab) -> std::path::PathBuf {
    lab.dir().join("report")
}

#[test]
fn kill_9_of_the_controller() {
    let lab = Lab::new();
    let ended = kill_while_driving(&lab, "controller").expect_code(0);
    let summary = lab.summary(&report(&lab));
    assert_eq!((&summary["reached"], &summary["restarts"]), (&true.into(), &1.into()), "{ended:#?}");
    assert_eq!(lines_about(&ended, "controller").len(), 1, "{ended:#?}");
    assert!(ended.stderr.contains("starting it again"), "{ended:#?}");
    assert!(ended.stdout.contains("ARRIVED") && ended.stdout.contains("1 restarts"), "{}", ended.stdout);
    // The robot held its course or waited; it did not turn away.
    assert!(number(&summary, "cross_track_max_m") < 0.02, "{summary}");
}

#[test]
fn kill_9_of_the_planner() {
    let lab = Lab::new();
    let ended = kill_while_driving(&lab, "planner").expect_code(0);
    let summary = lab.summary(&report(&lab));
    assert_eq!((&summary["reached"], &summary["restarts"]), (&true.into(), &1.into()), "{ended:#?}");
    assert_eq!(lines_about(&ended, "planner").len(), 1, "{ended:#?}");
}

/// Boxes whose successors know what they knew: the robot waits for them and goes on.
fn kill_9_and_on(worker: &str) {
    let lab = Lab::new();
    let ended = kill_while_driving(&lab, worker).expect_code(0);
    let summary = lab.summary(&report(&lab));
    assert_eq!((&summary["reached"], &summary["restarts"]), (&true.into(), &1.into()), "{ended:#?}");
    let lines = lines_about(&ended, worker);
    assert!(lines.len() == 1 && lines[0].contains("starting it again"), "{ended:#?}");
    // It neither forgot where it was nor turned away.
    let truth = &summary["final_truth"];
    assert!(number(truth, "y_m").abs() < 1e-3 && number(truth, "x_m") > 0.27, "{summary}");
    for key in ["x_m", "y_m", "theta_rad"] {
        let off = number(&summary["final_pose"], key) - number(truth, key);
        assert!(off.abs() < 2e-4, "no step is lost: {key} {off}");
    }
}

#[test]
fn kill_9_of_the_pose_estimator() {
    kill_9_and_on("pose_estimator");
}

#[test]
fn kill_9_of_the_waypoint_selector() {
    kill_9_and_on("waypoint_selector");
}

/// Its successor knows where the wheels are; whether the robot may go on is for the operator to say, and in
/// a run there is none.
#[test]
fn kill_9_of_the_step_generator() {
    let lab = Lab::new();
    let ended = kill_while_driving(&lab, "step_generator").expect_code(1);
    assert!(ended.stdout.contains("NOT ARRIVED") && ended.stdout.contains("armed again"), "{}", ended.stdout);
    let summary = lab.summary(&report(&lab));
    assert_eq!((&summary["reached"], &summary["restarts"]), (&false.into(), &1.into()));
    assert!(number(&summary["final_truth"], "x_m") < 0.2, "killed at 0.02 m: {summary}");
}

#[test]
fn kill_9_of_the_recorder() {
    let lab = Lab::new();
    let ended = kill_while_driving(&lab, "recorder").expect_code(1);
    let lines = lines_about(&ended, "recorder");
    assert!(lines.iter().any(|line| line.contains("the run goes on")), "{ended:#?}");
    assert!(ended.stderr.contains("figures are lost"), "{ended:#?}");
    assert!(!report(&lab).join("summary.json").exists(), "no figures are better than half of them");
}

/// Its successor repeats what comes; what came meanwhile the recorder lacks, and says so.
#[test]
fn kill_9_of_the_relay() {
    let lab = Lab::new();
    let ended = kill_while_driving(&lab, "relay").expect_code(1);
    assert!(ended.stdout.contains("ARRIVED") && !ended.stdout.contains("NOT ARRIVED"), "{ended:#?}");
    let said = ended.complaints();
    assert!(said.iter().any(|line| line.contains("ticks were lost to the recorder")), "{ended:#?}");
    let summary = lab.summary(&report(&lab));
    assert_eq!((&summary["reached"], &summary["restarts"]), (&true.into(), &1.into()));
}

#[test]
fn a_killed_launch_stops_the_robot_before_the_workers_go() {
    let lab = Lab::new();
    let robot = lab.robot();
    let launch = lab.start(&["run", "so", "--robot", &robot, "--out", "report"]);
    lab.await_status(&robot, "it drives", |status| number(status, "tick") > 300.0);
    launch.signal(Signal::KILL);
    assert!(comes_true(Duration::from_secs(3), || lab.processes().is_empty()), "{:?}", lab.processes());
    let doctor = lab.hilare(&["doctor"]);
    assert!(doctor.stdout.contains("leftovers"), "{}", doctor.stdout);
    let again = lab.hilare(&["up", "--detach", "--robot", &robot]).expect_code(0);
    assert_eq!(again.stderr, "");
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("the next robot of that name");
}

#[test]
fn a_launch_that_stands_still_stops_the_robot_for_as_long_and_the_verdict_says_so() {
    let lab = Lab::new();
    let (path, robot) = (lab.straight(0.2), lab.robot());
    let mut command = lab.command(&["run", "--path", &path.to_string_lossy(), "--robot", &robot]);
    command.args(["--out", "report", "--set", "timing.pause_stop_ticks=0"]);
    let run = Running::start(command);
    lab.await_status(&robot, "it drives", |status| number(status, "tick") > 500.0);
    run.signal(Signal::STOP);
    // Three leases: longer than any that is only late.
    std::thread::sleep(Duration::from_millis(210));
    run.signal(Signal::CONT);
    let ended = run.wait(support::PATIENCE).expect_code(0);
    let simulated =
        lab.hilare(&["run", "--path", &path.to_string_lossy(), "--clock", "in-process", "--json"]);
    let simulated: serde_json::Value = serde_json::from_str(&simulated.expect_code(0).stdout).expect("JSON");
    let summary = lab.summary(&report(&lab));
    assert!(number(&summary, "ticks") > number(&simulated, "ticks") + 50.0, "it stopped: {summary}");
    // Straight on: waiting costs time, not the way. Arrival is looked for every fifth tick, and the stop
    // has shifted the pulses against those ticks, so a step more or less may be under way then.
    for wheel in 0..2 {
        let of = |summary: &serde_json::Value| summary["steps"][wheel].as_i64().expect("steps");
        assert!((of(&summary) - of(&simulated)).abs() <= 2, "{summary} {simulated}");
    }
    let says_so = ended.stdout.contains("not expected to be the simulation's");
    assert!(says_so, "its hash is another one and nothing says why:\n{}", ended.stdout);
}
