//! `hilare top`: a robot on a terminal, of a robot in real processes.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::path::Path;
use support::{Lab, PATIENCE, Running, number, text, wait_until};

fn driving(lab: &Lab) -> String {
    let robot = lab.robot();
    lab.hilare(&["up", "--detach", "--standby", "kanayama", "--robot", &robot]).expect_code(0);
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    let path = lab.straight(3.0);
    lab.hilare(&["follow", &path.to_string_lossy(), "--robot", &robot]).expect_code(0);
    lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.03);
    robot
}

fn process<'v>(shown: &'v Value, name: &str) -> &'v Value {
    let processes = shown["processes"].as_array().expect("processes");
    processes.iter().find(|one| text(one, "name") == name).unwrap_or_else(|| panic!("no {name} in {shown}"))
}

#[test]
fn one_frame_shows_the_robot_as_it_is() {
    let lab = Lab::new();
    let robot = driving(&lab);
    let ended = lab.hilare(&["top", "--once", "--json", "--robot", &robot]).expect_code(0);
    let shown: Value = serde_json::from_str(&ended.stdout).expect("one object");
    let status = lab.status(&robot).expect("up");
    assert_eq!((text(&shown, "robot"), text(&shown, "mode")), (&*robot, "armed"));
    assert_eq!(shown["launch_pid"], status["launch_pid"]);
    assert_eq!((text(&shown, "in_charge"), text(&shown, "standby")), ("kanayama", "kanayama"));
    assert_eq!((number(&shown, "waypoint"), number(&shown, "waypoint_last")), (1.0, 1.0));
    assert!(number(&shown, "tick") <= number(&status, "tick"));
    assert!(number(&shown, "uptime_s") <= number(&status, "uptime_s"));
    // Straight ahead along x: aside is y, of the estimate as of the truth.
    assert!(number(&shown, "cross_track_m").abs() < 1e-6, "{shown}");
    assert!(number(&shown, "cross_track_truth_m").abs() < 1e-6, "{shown}");
    let (pose, truth) = (&shown["pose"][0], &shown["truth"][0]);
    assert!(pose.as_f64().expect("x") > 0.0 && truth.as_f64().expect("x") > 0.0, "{shown}");

    // Every process of the status, launch before them, alive as the kernel has it.
    let names = |value: &Value| -> Vec<String> {
        let processes = value["processes"].as_array().expect("processes");
        processes.iter().map(|one| format!("{} {}", text(one, "name"), one["pid"])).collect()
    };
    let shown_names = names(&shown);
    assert_eq!(shown_names[0], format!("launch {}", status["launch_pid"]));
    assert_eq!(shown_names[1..], names(&status)[..]);
    for one in shown["processes"].as_array().expect("processes") {
        let pid = number(one, "pid");
        let statm = std::fs::read_to_string(format!("/proc/{pid}/statm")).expect("it lives");
        let pages: f64 = statm.split(' ').nth(1).expect("resident").parse().expect("a number");
        let (resident, now) = (number(one, "resident_bytes"), pages * rustix::param::page_size() as f64);
        assert!((resident - now).abs() < 0.5 * now + 1e6, "{one}: {now} bytes now");
        assert!(number(one, "cpu_percent") >= 0.0, "{one}");
    }
    // What pulses as often as the tick does so equally often; a controller a fifth of that, each of the two.
    let hz = |name: &str| number(process(&shown, name), "hz");
    assert!(hz("step_generator") > 100.0, "{shown}");
    let of_steps = |name: &str| hz(name) / hz("step_generator");
    for (name, share) in
        [("pose_estimator", 1.0), ("plant", 1.0), ("waypoint_selector", 0.2), ("controller", 0.2)]
    {
        assert!((of_steps(name) / share - 1.0).abs() < 0.2, "{name}: {shown}");
    }
    let late = &process(&shown, "step_generator")["lateness_us"];
    assert!(number(late, "p50") > 0.0 && number(late, "p50") <= number(late, "max"), "{late}");
    let bars = shown["lateness_bars"].as_array().expect("bars").iter().filter_map(Value::as_f64).sum::<f64>();
    assert!(bars > 50.0 && bars <= number(&shown, "tick"), "{bars}");

    let mut command = lab.command(&["top", "--once", "--interval", "0.3", "--robot", &robot]);
    command.env("LC_ALL", "C");
    let frame = Running::start(command).wait(PATIENCE).expect_code(0).stdout;
    for said in [&*robot, "armed", "controller* kanayama", "step_generator", "wires/s", "late us", "mm "] {
        assert!(frame.contains(said), "{said:?} is not in\n{frame}");
    }
    assert!(frame.is_ascii() && !frame.contains('\u{1b}'), "no terminal, no colours: {frame:?}");
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("one frame");
}

#[test]
fn it_ends_with_a_signal_with_its_reader_and_with_the_robot() {
    let lab = Lab::new();
    let robot = driving(&lab);
    for signal in [Signal::INT, Signal::TERM, Signal::HUP] {
        let out = lab.dir().join(format!("{signal:?}.jsonl"));
        let mut command = lab.command(&["top", "--json", "--interval", "0.1", "--robot", &robot]);
        command.stdout(std::fs::File::create(&out).expect("a file"));
        let top = Running::start_as_is(command);
        let lines = || std::fs::read_to_string(&out).unwrap_or_default().lines().count();
        wait_until("two frames", || lines() > 2);
        top.signal(signal);
        top.wait(PATIENCE).expect_code(0);
    }
    let endless = lab.start(&["top", "--robot", &robot]);
    let before = number(&lab.status(&robot).expect("up"), "tick");
    lab.await_status(&robot, "it looks", |status| number(status, "tick") > before + 1500.0);
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    let ended = endless.wait(PATIENCE).expect_code(1);
    assert_eq!(ended.stderr, format!("hilare: robot {robot:?} went down\n"));
    assert!(ended.stdout.contains("late us"), "it has shown something: {}", ended.stdout);
    lab.assert_nothing_left("looking to the end");
}

#[test]
fn wrong_use_is_said() {
    let lab = Lab::new();
    for (args, said) in [
        (&["top"][..], "no robot is up"),
        (&["top", "--robot", "nobody"], "is not up"),
        (&["top", "--interval", "0"], "--interval 0: 0.1 to 3600"),
        (&["top", "--interval", "NaN"], "--interval NaN"),
    ] {
        let ended = lab.hilare(args).expect_code(2);
        assert!(ended.complaints().len() == 1 && ended.stderr.contains(said), "{}", ended.stderr);
    }
}

/// A terminal of its own for `hilare top`: keys, a new size, and what is left of it afterwards.
#[test]
fn a_terminal_is_used_and_given_back() {
    let lab = Lab::new();
    if std::process::Command::new("python3").arg("--version").output().is_err() {
        return support::skip("a_terminal_is_used_and_given_back", "no python3");
    }
    let robot = driving(&lab);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/terminal.py");
    for how in ["q", "ctrl-c", "term", "hup", "resize", "no-color", "no-stdin", "down"] {
        let mut command = lab.command_of("python3");
        command.arg(&script).args([how, env!("CARGO_BIN_EXE_hilare"), "top", "--interval", "0.2"]);
        command.args(["--robot", &robot]);
        let ended = Running::start(command).wait(PATIENCE);
        assert_eq!((ended.code, &*ended.stdout), (Some(0), "as it should\n"), "{how}: {}", ended.stderr);
    }
    lab.assert_nothing_left("terminals");
}
