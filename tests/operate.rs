//! A robot that stays up: every verb, in the order a day brings them.

mod support;

use serde_json::Value;
use std::time::Duration;
use support::{Lab, Running, comes_true, number, pid_of, text};

const WORKERS: [&str; 7] =
    ["planner", "waypoint_selector", "controller", "step_generator", "pose_estimator", "plant", "relay"];

/// A robot brought up with `--detach`.
struct Robot<'l> {
    lab: &'l Lab,
    name: String,
}

impl<'l> Robot<'l> {
    fn up(lab: &'l Lab, name: String, more: &[&str]) -> Self {
        let ended = lab.hilare(&[&["up", "--detach", "--robot", &name], more].concat()).expect_code(0);
        assert!(ended.stdout.contains(&name) && ended.stderr.is_empty(), "{ended:#?}");
        Self { lab, name }
    }

    /// A verb that must be done.
    #[track_caller]
    fn tell(&self, args: &[&str]) -> String {
        let ended = self.lab.hilare(&[args, &["--robot", &self.name]].concat()).expect_code(0);
        assert_eq!(ended.stderr, "", "{args:?}");
        ended.stdout
    }

    /// A verb that must be refused: exit code 1, the reason in one line; the same in JSON.
    #[track_caller]
    fn refuses(&self, args: &[&str], reason: &str) {
        let args = [args, &["--robot", &self.name]].concat();
        let ended = self.lab.hilare(&args).expect_code(1);
        assert_eq!((ended.stdout.as_str(), ended.complaints().len()), ("", 1), "{args:?}: {ended:#?}");
        assert!(ended.stderr.starts_with("hilare: refused: ") && ended.stderr.contains(reason), "{ended:#?}");
        let ended = self.lab.hilare(&[&args[..], &["--json"]].concat()).expect_code(1);
        let answer: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        assert!(answer["ok"] == false && text(&answer, "message").contains(reason), "{answer}");
    }

    fn status(&self) -> Value {
        self.lab.status(&self.name).expect("it is up")
    }

    #[track_caller]
    fn await_status(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        self.lab.await_status(&self.name, what, wanted)
    }

    fn await_speed(&self) -> Value {
        self.await_status("it drives", |status| number(status, "speed_mps") > 0.02)
    }
}

fn moved_m(from: &Value, to: &Value) -> f64 {
    let at = |status: &Value, axis: usize| status["pose"][axis].as_f64().expect("a pose");
    (at(from, 0) - at(to, 0)).hypot(at(from, 1) - at(to, 1))
}

#[test]
fn a_working_day() {
    let lab = Lab::new();
    let path = lab.straight(2.0);
    let path = path.to_string_lossy();
    let robot = Robot::up(&lab, lab.robot(), &["--log", "robot.log"]);
    let before = robot.status();
    assert_eq!((text(&before, "mode"), text(&before, "clock")), ("disarmed", "real"));
    assert!(before["pose"].is_null() && before["fault"].is_null(), "{before}");
    for worker in WORKERS {
        pid_of(&before, worker);
    }

    assert!(
        robot.tell(&["goal", "1", "0"]).contains("not armed"),
        "accepted from where it starts, with a hint"
    );
    assert!(robot.tell(&["follow", &path]).contains("not armed"), "and overtaken by this");
    assert_eq!(number(&robot.status(), "speed_mps"), 0.0, "it does not drive before it is armed");
    robot.tell(&["arm"]);
    let driving = robot.await_speed();
    assert_eq!((text(&driving, "mode"), text(&driving, "path_state")), ("armed", "tracking"));

    stop_and_go_on(&robot);
    emergency_stop(&robot);

    robot.refuses(&["goal", "1", "0", "1.57"], "heading");
    robot.refuses(&["goal", "1e9", "0"], "metres");
    assert!(robot.tell(&["goal", "0.25", "0.05"]).contains("accepted"));
    let there = robot.await_status("it arrives", |status| status["path_state"] == "arrived");
    let off = [there["pose"][0].as_f64().unwrap() - 0.25, there["pose"][1].as_f64().unwrap() - 0.05];
    assert!(off[0].hypot(off[1]) < 0.035, "within the acceptance radius: {there}");
    robot.await_status("it stands at its goal", |status| number(status, "speed_mps") == 0.0);

    let shown = robot.tell(&["status"]);
    for worker in WORKERS {
        assert!(shown.contains(worker), "{shown}");
    }
    let granted = robot.status();
    assert!(robot.tell(&["down"]).contains("is down"));
    lab.assert_nothing_left("down");
    let log = std::fs::read_to_string(lab.dir().join("robot.log")).expect("the log");
    the_log_is_merged(&log);
    what_was_granted_is_not_called_refused(&granted, &log);
}

/// The status and the log speak of the same kernel.
fn what_was_granted_is_not_called_refused(status: &Value, log: &str) {
    let processes = status["processes"].as_array().expect("processes");
    for process in processes.iter().filter(|process| text(process, "granted").contains("fifo")) {
        let refused =
            log.lines().find(|line| line.contains("refused") && line.contains(text(process, "name")));
        assert!(refused.is_none(), "{process}\n{refused:?}");
    }
}

/// `stop` ramps, stays, and `arm` goes on along the same path.
fn stop_and_go_on(robot: &Robot) {
    robot.tell(&["stop"]);
    // 41 mm/s at 2 m/s² are 21 ticks; the status is of the newest tick launch saw.
    let stopped = robot.await_status("it stops", |status| number(status, "speed_mps") == 0.0);
    assert_eq!(text(&stopped, "mode"), "stop");
    assert!(comes_true(Duration::from_secs(10), || number(&robot.status(), "tick")
        > number(&stopped, "tick") + 300.0));
    let later = robot.status();
    assert_eq!(moved_m(&stopped, &later), 0.0, "it stays: {later}");
    robot.tell(&["arm"]);
    let on = robot.await_speed();
    assert_eq!((text(&on, "path_state"), &on["waypoint"]), ("tracking", &later["waypoint"]));
    robot.await_status("it goes on", |status| moved_m(&later, status) > 0.01);
}

/// `estop` is latched: nothing but `reset` releases it, and `reset` does not arm.
fn emergency_stop(robot: &Robot) {
    robot.tell(&["estop"]);
    let stopped = robot.await_status("it stops at once", |status| number(status, "speed_mps") == 0.0);
    assert_eq!(text(&stopped, "mode"), "e-stop");
    robot.refuses(&["arm"], "reset");
    robot.tell(&["stop"]);
    assert_eq!(text(&robot.status(), "mode"), "e-stop", "a stop does not weaken it");
    assert!(robot.tell(&["goal", "0.25", "0.05"]).contains("emergency stop"), "accepted, with a hint");
    assert!(robot.tell(&["reset"]).contains("disarmed"));
    robot.await_status("it is disarmed", |status| {
        status["mode"] == "disarmed" && number(status, "speed_mps") == 0.0
    });
    robot.tell(&["arm"]);
    robot.await_speed();
}

/// Every line is `seconds LEVEL process: message`, of a process there is.
fn the_log_is_merged(log: &str) {
    assert!(log.lines().count() >= 2, "{log}");
    let mut last_s = 0.0;
    for line in log.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [seconds, level, process, _, ..] = words[..] else { panic!("not a log line: {line:?}") };
        let seconds: f64 = seconds.parse().unwrap_or_else(|_| panic!("no time: {line:?}"));
        // Lines of several processes pass pipes of their own, so neighbours may have changed places.
        assert!(seconds > last_s - 1.0, "time runs backwards: {line:?}");
        last_s = seconds;
        assert!(["ERROR", "WARN", "INFO"].contains(&level), "{line:?}");
        let process = process.strip_suffix(':').unwrap_or_else(|| panic!("no process: {line:?}"));
        assert!(process == "launch" || WORKERS.contains(&process), "no such process: {line:?}");
    }
    assert!(log.contains("launch: "), "{log}");
}

#[test]
fn the_terminal_shows_what_the_log_holds() {
    let lab = Lab::new();
    let robot = lab.robot();
    let mut command = lab.command(&["up", "--robot", &robot, "--log", "robot.log"]);
    command.env("HILARE_LOG", "trace");
    let launch = Running::start(command);
    // While it starts, a death is the end of the start.
    let log = || std::fs::read_to_string(lab.dir().join("robot.log")).unwrap_or_default();
    support::wait_until("the robot is up", || log().contains(" is up"));
    let status = lab.status(&robot).expect("it is up");
    // Nothing a worker can put in words: launch says it, by the worker's name.
    support::process::signal(pid_of(&status, "planner"), rustix::process::Signal::ABORT);
    lab.await_status(&robot, "the planner is back", |status| {
        status["processes"].as_array().is_some_and(|all| all.iter().any(|one| one["restarts"] == 1))
    });
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    let ended = launch.wait(support::PATIENCE).expect_code(0);
    assert!(log().contains("WARN  launch: planner was killed by signal 6"), "{}", log());
    // In the foreground the terminal shows what the file holds.
    assert!(ended.stderr.contains("planner was killed by signal 6"), "{ended:#?}");
    lab.assert_nothing_left("down");
}

#[test]
fn two_robots_side_by_side() {
    let lab = Lab::new();
    let path = lab.straight(1.0);
    let path = path.to_string_lossy();
    let robots = ["left", "right"].map(|suffix| Robot::up(&lab, lab.robot_named(suffix), &[]));
    let [left, right] = &robots;
    let ended = lab.hilare(&["status"]).expect_code(2);
    assert!(ended.stderr.contains(&left.name) && ended.stderr.contains("--robot"), "which one? {ended:#?}");
    for robot in &robots {
        robot.tell(&["arm"]);
    }
    left.tell(&["follow", &path]);
    left.await_status("the left one drives", |status| status["pose"][0].as_f64().is_some_and(|x| x > 0.02));
    assert_eq!(number(&right.status(), "speed_mps"), 0.0, "the right one was told nothing");

    let pid = left.status()["launch_pid"].to_string();
    for more in [&[][..], &["--detach"]] {
        let ended = lab.hilare(&[&["up", "--robot", &left.name], more].concat()).expect_code(2);
        assert!(ended.stderr.contains(&pid) && ended.complaints().len() == 1, "{ended:#?}");
    }
    left.tell(&["estop"]);
    assert_eq!(text(&right.status(), "mode"), "armed", "an e-stop is of one robot");
    left.tell(&["down"]);
    right.tell(&["follow", &path]);
    right.await_speed();
    right.tell(&["down"]);
    // An emergency stop outlasts its robot.
    let ended = lab.hilare(&["up", "--detach", "--robot", &left.name]).expect_code(0);
    assert!(ended.stdout.contains("is up"), "{ended:#?}");
    assert_eq!(text(&left.status(), "mode"), "e-stop");
    assert!(lab.hilare(&["arm", "--robot", &left.name]).expect_code(1).stderr.contains("hilare reset"));
    left.tell(&["down"]);
    left.tell(&["reset"]);
    lab.assert_nothing_left("two robots");
}

#[test]
fn a_detached_robot_outlives_its_terminal_and_ends_on_sigterm() {
    let lab = Lab::new();
    let ended = lab.hilare(&["up", "--detach", "--json", "--robot", &lab.robot()]).expect_code(0);
    let status: Value = serde_json::from_str(&ended.stdout).expect("JSON and nothing else");
    assert_eq!(status["robot"], lab.robot().as_str());
    let pid = status["launch_pid"].as_i64().and_then(|pid| i32::try_from(pid).ok()).expect("a pid");
    assert_eq!(lab.processes().len(), WORKERS.len() + 1, "{:?}", lab.processes());
    support::process::signal(pid, rustix::process::Signal::TERM);
    support::wait_until("everybody is gone", || lab.processes().is_empty());
    lab.assert_nothing_left("SIGTERM");
}

/// An upgrade under a robot that is up: whoever dies is replaced by what was there before.
#[test]
fn a_program_that_is_replaced_drives_on_as_it_was() {
    let lab = Lab::new();
    let robot = lab.robot();
    let program = lab.dir().join("hilare");
    std::fs::copy(env!("CARGO_BIN_EXE_hilare"), &program).expect("a copy");
    let mut command = lab.command_of(&program);
    command.args(["up", "--robot", &robot]);
    let launch = Running::start(command);
    let robot = Robot { lab: &lab, name: robot };
    let status = robot.await_status("it is up", |status| status["mode"] == "disarmed");
    let name = std::fs::read_to_string(format!("/proc/{}/comm", pid_of(&status, "planner")));
    assert_eq!(name.expect("a name").trim(), "hilare");
    let other = lab.file("other", "#!/bin/sh\nexit 7\n");
    std::fs::rename(other, &program).expect("another program in its place");
    support::process::signal(pid_of(&status, "planner"), rustix::process::Signal::KILL);
    robot.await_status("the planner is back", |status| {
        let all = status["processes"].as_array().expect("processes").iter();
        all.clone().any(|one| one["restarts"] == 1 && one["state"] == "ready")
    });
    robot.tell(&["down"]);
    launch.wait(support::PATIENCE).expect_code(0);
    lab.assert_nothing_left("a robot whose program was replaced");
}

/// A pause longer than the policy allows: the robot stands, says why, and goes on when it is armed again.
#[test]
fn after_a_long_pause_it_says_so_and_drives_on_once_armed() {
    let lab = Lab::new();
    let robot = Robot::up(&lab, lab.robot(), &[]);
    robot.tell(&["follow", &lab.straight(1.0).to_string_lossy()]);
    robot.tell(&["arm"]);
    let status = robot.await_speed();
    let clock = pid_of(&status, "step_generator");
    support::process::signal(clock, rustix::process::Signal::STOP);
    std::thread::sleep(Duration::from_millis(200));
    support::process::signal(clock, rustix::process::Signal::CONT);
    let halted = robot.await_status("it has stopped", |status| status["mode"] == "stop");
    let why = text(&halted, "fault");
    assert!(why.contains("paused for") && why.contains("hilare arm"), "{halted}");
    robot.tell(&["arm"]);
    let status = robot.await_speed();
    assert!(status["fault"].is_null(), "{status}");
    robot.tell(&["down"]);
    lab.assert_nothing_left("a robot that was paused");
}

/// A successor that hangs before it is at work: it is found, too, and the next one drives on.
#[test]
fn a_worker_that_hangs_while_it_starts_is_replaced() {
    let lab = Lab::new();
    let robot = Robot::up(&lab, lab.robot(), &["--set", "supervision.restart_budget=100"]);
    let one = |status: &Value| {
        let all = status["processes"].as_array().expect("processes");
        all.iter().find(|one| one["name"] == "waypoint_selector").expect("the selector").clone()
    };
    let selector = |except: i32| {
        let services = lab.processes().into_iter().filter(|(_, line)| line.contains(" service "));
        let mut pids = services.filter(|(_, line)| line.contains("waypoint_selector")).map(|(pid, _)| pid);
        pids.find(|pid| *pid != except)
    };
    // It starts within milliseconds: on a busy machine it may be at work before it is stopped.
    let hung = (0..10).find_map(|_| {
        let first = pid_of(&robot.status(), "waypoint_selector");
        support::process::signal(first, rustix::process::Signal::KILL);
        let mut second = None;
        support::wait_until("a successor", || {
            second = selector(first);
            second.is_some()
        });
        let second = second.filter(|pid| *pid > 1)?;
        support::process::signal(second, rustix::process::Signal::STOP);
        std::thread::sleep(Duration::from_secs(1));
        let now = one(&robot.status());
        (now["state"] == "starting" && now["pid"] == second).then_some(second)
    });
    let hung = hung.expect("a worker that was stopped while it started");
    robot.tell(&["follow", &lab.straight(1.0).to_string_lossy()]);
    robot.tell(&["arm"]);
    robot.await_status("its successor is at work", |status| {
        one(status)["pid"] != hung && one(status)["state"] == "running"
    });
    robot.await_speed();
    robot.tell(&["down"]);
    lab.assert_nothing_left("a robot whose worker hung while it started");
}
