//! `hilare topic`: what the wires carry, of a robot in real processes.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::io::Read;
use std::process::Stdio;
use support::{Lab, PATIENCE, number, text};

fn up(lab: &Lab) -> String {
    let robot = lab.robot();
    lab.hilare(&["up", "--detach", "--robot", &robot]).expect_code(0);
    // Ticks are counted from then on.
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    robot
}

/// JSON objects, one a line.
fn lines(stdout: &str) -> Vec<Value> {
    stdout.lines().map(|line| serde_json::from_str(line).expect("an object a line")).collect()
}

#[test]
fn messages_come_as_they_were_sent_without_a_gap() {
    let lab = Lab::new();
    let robot = up(&lab);
    let path = lab.straight(1.0);
    lab.hilare(&["follow", &path.to_string_lossy(), "--robot", &robot]).expect_code(0);
    lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.03);
    let echo = |topic: &str, more: &[&str]| {
        let args = [&["topic", "echo", topic, "--json", "--robot", &robot], more].concat();
        lines(&lab.hilare(&args).expect_code(0).stdout)
    };

    let poses = echo("pose", &["--all", "--count", "400"]);
    let ticks: Vec<f64> = poses.iter().map(|pose| number(pose, "tick")).collect();
    assert!(ticks.windows(2).all(|pair| pair[1] == pair[0] + 1.0), "{ticks:?}");
    assert_eq!(ticks.len(), 400);
    // 0.4 s straight ahead at 40 mm/s, as the pose and as the steps have it: two ways to the same figure.
    let x: Vec<f64> = poses.iter().map(|pose| number(pose, "x_m")).collect();
    let moved = x.last().expect("poses") - x[0];
    assert!((moved - 0.399 * 0.04).abs() < 5e-4 && poses.iter().all(|pose| number(pose, "y_m").abs() < 1e-9));
    let steps = echo("hilare/watch/steps", &["--all", "--count", "400"]);
    let counts = |steps: &Value| steps["counts"][0].as_f64().expect("a count");
    let travelled = (counts(&steps[399]) - counts(&steps[0])) * 0.13e-3;
    assert!((travelled - moved).abs() < 5e-4, "{travelled} {moved}");

    // The newest only, slower than they come.
    let slow = echo("pose", &["--rate", "50", "--count", "3"]);
    let ticks: Vec<f64> = slow.iter().map(|pose| number(pose, "tick")).collect();
    assert!(ticks.windows(2).all(|pair| pair[1] >= pair[0] + 5.0), "{ticks:?}");
    let picked = echo("reference", &["--field", "current.x_m", "--field", "total", "--count", "1"]);
    assert_eq!(picked[0].as_object().expect("an object").len(), 2);
    assert_eq!((number(&picked[0], "current.x_m"), number(&picked[0], "total")), (1.0, 2.0));
    // Who comes late gets the path in force.
    let path = echo("path", &["--count", "1"]);
    assert_eq!(path[0]["elements"].as_array().map(Vec::len), Some(2));
    assert_eq!(number(&path[0]["elements"][1], "x_m"), 1.0);

    let hz = |topic: &str| {
        let args = ["topic", "hz", topic, "--seconds", "1", "--json", "--robot", &robot];
        let rates = lines(&lab.hilare(&args).expect_code(0).stdout);
        (number(&rates[0], "hz_of_ticks"), number(&rates[0], "gap_max_ticks"))
    };
    assert_eq!((hz("truth"), hz("command")), ((1000.0, 1.0), (200.0, 5.0)));
    let said = lab.hilare(&["topic", "echo", "authority", "--count", "1", "--robot", &robot]).expect_code(0);
    assert!(said.stdout.contains("mode ") && said.stdout.contains("(Armed)"), "{}", said.stdout);
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("looking");
}

#[test]
fn it_ends_with_ctrl_c_with_its_reader_and_with_the_robot() {
    let lab = Lab::new();
    let robot = up(&lab);
    let echo = lab.start(&["topic", "echo", "pose", "--robot", &robot]);
    lab.await_status(&robot, "it ticks", |status| number(status, "tick") > 300.0);
    echo.signal(Signal::INT);
    assert_eq!(echo.wait(PATIENCE).expect_code(0).stderr, "");

    let mut command = lab.command(&["topic", "echo", "steps", "--all", "--robot", &robot]);
    let mut child = command.stdout(Stdio::piped()).spawn().expect("it starts");
    let mut first = [0; 64];
    child.stdout.take().expect("piped").read_exact(&mut first).expect("messages");
    assert_eq!(child.wait().expect("it ends").code(), Some(0), "nobody reads any more");

    let endless = lab.start(&["topic", "hz", "steps", "--robot", &robot]);
    let counted = lab.start(&["topic", "echo", "path", "--count", "1", "--robot", &robot]);
    let before = number(&lab.status(&robot).expect("up"), "tick");
    lab.await_status(&robot, "they look", |status| number(status, "tick") > before + 1500.0);
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    let endless = endless.wait(PATIENCE).expect_code(0);
    assert!(endless.stdout.contains("Hz of the robot's time"), "{}", endless.stdout);
    let counted = counted.wait(PATIENCE).expect_code(1);
    assert_eq!(counted.stderr, format!("hilare: robot {robot:?} went down\n"));
    lab.assert_nothing_left("looking to the end");
}

#[test]
fn before_the_robot_is_armed_it_says_why_nothing_comes() {
    let lab = Lab::new();
    let robot = lab.robot();
    lab.hilare(&["up", "--detach", "--robot", &robot]).expect_code(0);
    let ended = lab.hilare(&["topic", "hz", "pose", "--seconds", "3", "--robot", &robot]).expect_code(0);
    assert!(ended.stdout.starts_with("0.0 Hz: 0 messages"), "{}", ended.stdout);
    assert!(ended.complaints().len() == 1 && ended.stderr.contains("once it is armed"), "{}", ended.stderr);
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("a look at a robot that stands");
}

#[test]
fn wires_are_listed_and_described_without_a_robot() {
    let lab = Lab::new();
    let all: Value =
        serde_json::from_str(&lab.hilare(&["topic", "list", "--json"]).expect_code(0).stdout).expect("JSON");
    let names: Vec<&str> = all.as_array().expect("a list").iter().map(|topic| text(topic, "name")).collect();
    assert_eq!(
        names,
        [
            "goal",
            "answer",
            "path",
            "reference",
            "command",
            "authority",
            "steps",
            "wheels",
            "fix",
            "pose",
            "truth",
            "health",
            "journal"
        ]
    );
    let list = lab.hilare(&["topic", "list"]).expect_code(0).stdout;
    assert_eq!(list.lines().count(), names.len());
    let info = lab.hilare(&["topic", "info", "pose"]).expect_code(0).stdout;
    for what in ["pose_estimator", "hilare/watch/pose", "1 kHz", "theta_rad", "layout"] {
        assert!(info.contains(what), "{what}: {info}");
    }
    for (args, expected) in [
        (&["echo", "poes"][..], "no topic \"poes\": there are goal, answer, path, reference"),
        (&["echo", "pose", "--field", "x"], "--field x: pose has tick, "),
        (&["echo", "pose", "--count", "0"], "--count"),
        (&["echo", "pose", "--rate", "0"], "--rate 0: above 0"),
        (&["hz", "pose", "--seconds", "-1"], "--seconds -1"),
        (&["echo", "pose", "--robot", "none"], "robot \"none\" is not up"),
    ] {
        let ended = lab.hilare(&[&["topic"], args].concat()).expect_code(2);
        assert_eq!(ended.complaints().len(), 1, "{ended:#?}");
        assert!(ended.stderr.contains(expected), "{expected}: {ended:#?}");
    }
}
