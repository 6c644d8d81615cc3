//! Tuning: `hilare tune` from its options to a robot that runs.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};
use support::{Lab, PATIENCE, number};

/// A corner with short legs, so that many candidates are driven in little time.
const CORNER: &str = "description = \"a corner\"\nsystem = \"epuck\"\n\
    waypoints_m = [[0.0, 0.0], [0.10, 0.0], [0.10, 0.08]]\n";

fn tune(lab: &Lab, args: &[&str]) -> Value {
    let ended = lab.hilare(&[&["tune", "--json"], args].concat()).expect_code(0);
    assert_eq!(ended.stderr, "");
    serde_json::from_str(&ended.stdout).expect("JSON alone")
}

fn lab() -> Lab {
    let lab = Lab::new();
    lab.file("corner.toml", CORNER);
    lab
}

fn read(path: impl AsRef<Path>) -> String {
    let path = path.as_ref();
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn objectives(point: &Value) -> [f64; 2] {
    ["cross_track_mean_m", "speed_error_mean_mps"].map(|key| number(&point["objectives"], key))
}

#[test]
fn a_front_beats_point_a_and_its_robot_drives_as_promised() {
    let lab = lab();
    let out = lab.dir().join("out");
    let args = ["corner.toml", "--evaluations", "400", "--out", "out", "--held-out", "rectangle"];
    let answer = tune(&lab, &args);
    assert_eq!(answer["evaluations"], Value::from(400));
    assert!(number(&answer, "seconds") > 0.0 && number(&answer, "ticks_per_second") > 1e4);
    let front = answer["front"].as_array().expect("a front");
    assert!((10..=100).contains(&front.len()), "{}", front.len());
    let untuned = &answer["untuned"]["figures"];
    let before = ["cross_track_mean_m", "speed_error_mean_mps"].map(|key| number(untuned, key));
    let dominates = |point: &Value| objectives(point).iter().zip(before).all(|(now, before)| *now < before);
    assert!(front.iter().any(dominates), "nothing dominates point A: {answer}");
    for (n, a) in front.iter().enumerate() {
        let covers = |b: &Value| objectives(b).iter().zip(objectives(a)).all(|(b, a)| *b <= a);
        assert!(!front.iter().enumerate().any(|(m, b)| m != n && covers(b)), "{a} is dominated");
        let parameters = a["parameters"].as_object().expect("parameters");
        let names: Vec<&str> = parameters.keys().map(String::as_str).collect();
        let gains =
            ["controller.kanayama.k1_per_s", "controller.kanayama.k2_per_m2", "controller.kanayama.k3_per_m"];
        assert_eq!(names, [&gains[..], &["limits.omega_max_radps", "limits.v_max_mps"]].concat());
        let v_max = parameters["limits.v_max_mps"].as_f64().expect("a number");
        assert!((0.04..=0.1).contains(&v_max));
    }
    assert!(number(&answer, "hypervolume") > 0.0);
    let held = &answer["held_out"][0];
    assert_eq!(held["scenario"], "rectangle");
    // Spec 1's figure of point A on the rectangle.
    let known = number(&held["untuned"], "cross_track_mean_m");
    assert!((known / 0.0037897 - 1.0).abs() < 0.005, "{held}");
    assert!(held["chosen"].is_object(), "{held}");
    assert_eq!(answer, serde_json::from_str::<Value>(&read(out.join("tune.json"))).expect("JSON"));
    let csv = read(out.join("front.csv"));
    assert_eq!(csv.lines().count(), 1 + front.len());
    assert!(
        csv.starts_with("cross_track_mean_m,speed_error_mean_mps,controller.kanayama.k1_per_s,"),
        "{csv}"
    );
    let picture = read(out.join("front.svg"));
    assert!(picture.contains("point A") && picture.contains("mean speed error, mm/s"));

    let run = lab.hilare(&["run", "out/scenario.toml", "--clock", "in-process", "--json"]).expect_code(0);
    let run: Value = serde_json::from_str(&run.stdout).expect("JSON");
    let driven = ["cross_track_mean_m", "speed_error_mean_mps"].map(|key| number(&run, key));
    // The front's figures are the fast path's: means of the same terms, to rounding.
    for (driven, promised) in driven.iter().zip(objectives(&answer["chosen"])) {
        assert!((driven - promised).abs() < 1e-12, "{driven} {promised}");
    }
}

#[test]
fn the_same_bits_with_any_number_of_threads_and_another_seed_gives_others() {
    let lab = lab();
    let front = |more: &[&str]| {
        let args = [
            "--scenario",
            "corner.toml",
            "--evaluations",
            "170",
            "--set",
            "plant.slip_sd=0.1",
            "--seeds",
            "2",
        ];
        tune(&lab, &[&args, more].concat())["front"].clone()
    };
    let one = front(&["--threads", "1"]);
    assert_eq!(one, front(&["--threads", "2"]));
    assert_ne!(one, front(&["--seed", "2"]));
    assert!(lab.dir().join("runs/tune-3/front.svg").is_file(), "each search has a directory of its own");
}

#[test]
fn ctrl_c_stops_and_resume_comes_to_the_same() {
    let lab = lab();
    let args = ["corner.toml", "--evaluations", "600"];
    let whole = tune(&lab, &[&args[..], &["--out", "whole"]].concat());
    let running = lab.start(&[&["tune"], &args[..], &["--out", "part"]].concat());
    let log = lab.dir().join("part/evaluations.csv");
    let deadline = Instant::now() + PATIENCE;
    while fs::read_to_string(&log).map_or(0, |text| text.lines().count()) < 60 {
        assert!(Instant::now() < deadline, "nothing is evaluated");
        std::thread::sleep(Duration::from_millis(5));
    }
    let busy = lab.hilare(&["tune", "--resume", "part"]).expect_code(2);
    assert!(busy.stderr.contains("another search is writing it"), "{}", busy.stderr);
    running.signal(Signal::INT);
    let ended = running.wait(PATIENCE).expect_code(1);
    assert!(ended.stderr.contains("go on with: hilare tune --resume part"), "{}", ended.stderr);
    let stopped: Value = serde_json::from_str(&read(lab.dir().join("part/tune.json"))).expect("JSON");
    assert_eq!(stopped["stopped"], Value::Bool(true));
    assert!(number(&stopped, "evaluations") < 600.0);
    // A crash would have torn the last line.
    let text = read(&log);
    fs::write(&log, &text[..text.len() - 9]).expect("the log");
    let resumed = tune(&lab, &["--resume", "part"]);
    assert_eq!(resumed["front"], whole["front"]);
    assert_eq!((&resumed["evaluations"], &resumed["stopped"]), (&Value::from(600), &Value::Bool(false)));
    assert_eq!(read(&log), read(lab.dir().join("whole/evaluations.csv")));
    // On to more: as if it had been asked for at once.
    let longer = tune(&lab, &["--resume", "part", "--evaluations", "700"]);
    let at_once = tune(&lab, &["corner.toml", "--evaluations", "700"]);
    assert_eq!(longer["front"], at_once["front"]);
    // Another robot under the same log is noticed.
    lab.file("corner.toml", CORNER.replace("0.08", "0.09"));
    let other = lab.hilare(&["tune", "--resume", "part"]).expect_code(2);
    assert!(other.stderr.contains("log of another search"), "{}", other.stderr);
}

#[test]
fn any_law_objectives_and_ranges() {
    let lab = lab();
    let args = ["corner.toml", "--evaluations", "120", "--controller", "pure-pursuit"];
    let choice =
        ["--objectives", "time,effort,cross-track-max", "--parameter", "tracking.speed_mps=0.03..0.05:log"];
    let fixed = [
        "--set",
        "controller.pure-pursuit.lookahead_bends=1.5",
        "--set",
        "limits.v_max_mps=0.06",
        "--weights",
        "1,1,5",
    ];
    let answer = tune(&lab, &[&args[..], &choice, &fixed].concat());
    let front = answer["front"].as_array().expect("a front");
    let keys = |value: &Value| value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&front[0]["objectives"]), ["cross_track_max_m", "duration_s", "effort_per_s"]);
    assert_eq!(keys(&front[0]["parameters"]), ["controller.pure-pursuit.lookahead_s", "tracking.speed_mps"]);
    let speeds = front.iter().map(|point| number(&point["parameters"], "tracking.speed_mps"));
    assert!(speeds.clone().all(|speed| (0.03..=0.05).contains(&speed)));
    assert!(speeds.fold(0.0, f64::max) > 0.045, "the fastest is quick");
    // Whole numbers, and a Mecanum robot.
    let args = ["agv-low", "--controller", "qp", "--evaluations", "3", "--parameter", "max_iterations=3..9"];
    let answer = tune(&lab, &args);
    for point in answer["front"].as_array().expect("a front") {
        assert_eq!(number(&point["parameters"], "controller.qp.max_iterations").fract(), 0.0);
    }
}

#[test]
fn candidates_through_a_pipe_are_judged_alike() {
    let lab = lab();
    let mut command = lab.command(&["tune", "corner.toml", "--evaluate"]);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it starts");
    let a = "[0.0247, 2967100.0, 552.0, 0.041, 0.747]";
    let asked = format!("[{a}, [0.0, 0.0, 0.0, 0.04, 0.0]]\n[]\n[{a}]\n");
    child.stdin.take().expect("a pipe").write_all(asked.as_bytes()).expect("it listens");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines[0]["parameters"].as_array().map(Vec::len), Some(5));
    let untuned = &tune(&lab, &["corner.toml", "--evaluations", "1"])["untuned"]["figures"];
    let want = ["cross_track_mean_m", "speed_error_mean_mps"].map(|key| number(untuned, key));
    assert_eq!(lines[1][0], serde_json::json!([0.0, want[0], want[1]]));
    let lame = lines[1][1][0].as_f64().expect("a violation");
    assert!(lame > 0.0 && lame <= 1.0, "it cannot turn: {lame}");
    assert_eq!(lines[2], serde_json::json!([]));
    assert_eq!(lines[3][0], lines[1][0]);
}

#[test]
fn bad_input_is_one_line_with_exit_code_2() {
    let lab = lab();
    let cases: &[(&[&str], &str)] = &[
        (&["nowhere"], "unknown scenario"),
        (&["--controller", "kanyama"], "kanyama"),
        (&["agv-low", "--controller", "kanayama"], "kanayama"),
        (&["--controller", "/bin/true"], "executable"),
        (&["trapezoid", "agv-low"], "agv-low"),
        (&["--objectives", "time"], "two or three"),
        (&["--objectives", "time,haste"], "unknown objective \"haste\""),
        (&["--parameter", "k1_per_s=1..0"], "below the upper"),
        (&["--parameter", "k9=0..1"], "k9"),
        (&["--parameter", "k1_per_s=0..1\nx"], "--parameter"),
        (&["--set", "plant.slip_man=0.1"], "slip_man"),
        (&["--weights", "1"], "--weights"),
        (&["--reference", "0.006,-1"], "--reference"),
        (&["--evaluations", "0"], "--evaluations"),
        (&["--swarm", "0"], "--swarm"),
        (&["--threads", "0"], "--threads"),
        (&["--seeds", "0"], "--seeds"),
        (&["--held-out", "nowhere"], "unknown scenario"),
        (&["--held-out", "agv-low"], "agv-low"),
        (&["--resume", "nowhere"], "--resume nowhere"),
        (&["--resume", "nowhere", "--seed", "2"], "--seed"),
        (&["--out", "corner.toml"], "--out corner.toml"),
    ];
    for (args, what) in cases {
        let ended = lab.hilare(&[&["tune", "--evaluations", "2"], *args].concat()).expect_code(2);
        assert_eq!((ended.stdout.as_str(), ended.complaints().len()), ("", 1), "{args:?}: {ended:#?}");
        assert!(ended.stderr.contains(what), "{args:?}: {}", ended.stderr);
    }
    assert!(!lab.dir().join("runs").exists(), "nothing half-written");
    tune(&lab, &["corner.toml", "--evaluations", "2", "--out", "taken"]);
    let fewer = lab.hilare(&["tune", "--resume", "taken", "--evaluations", "1"]).expect_code(2);
    assert!(fewer.stderr.contains("2 candidates are evaluated already"), "{}", fewer.stderr);
    let taken = lab.hilare(&["tune", "corner.toml", "--out", "taken"]).expect_code(2);
    assert!(taken.stderr.contains("go on with hilare tune --resume taken"), "{}", taken.stderr);
}

/// With slip the robot strays beyond 6 mm: a reference there would judge nothing.
#[test]
fn hypervolume_counts_up_to_where_the_robot_is() {
    let lab = lab();
    let args = ["trapezoid", "--set", "plant.slip_mean=0.03", "--evaluations", "60", "--out", "slip"];
    let slips = tune(&lab, &args);
    assert!(number(&slips["untuned"]["figures"], "cross_track_mean_m") > 0.006, "{slips}");
    assert!(number(&slips, "hypervolume") > 0.0, "{slips}");
}
