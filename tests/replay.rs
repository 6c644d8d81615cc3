//! Recordings of real processes, replayed to the last bit: of every scenario, and after everything that may happen on
//! the way.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;
use support::process::signal;
use support::{Lab, PATIENCE, PATIENT, Running, number, pid_of, quick, text, wait_until, whole_machine};

/// Scenarios that every installation has.
const SCENARIOS: [&str; 10] = [
    "rectangle",
    "rectangle-open",
    "trapezoid",
    "so",
    "platform",
    "line-21deg",
    "arc-102cm",
    "agv-low",
    "agv-high",
    "agv-course",
];

/// Boxes of which a recording has messages.
const BOXES: [&str; 5] = ["waypoint_selector", "controller", "step_generator", "pose_estimator", "plant"];

/// A run in real time that is recorded, along a path longer than any test.
struct Drive<'l> {
    lab: &'l Lab,
    robot: String,
    run: Running,
    dir: PathBuf,
}

impl<'l> Drive<'l> {
    fn begin(lab: &'l Lab, more: &[&str]) -> Self {
        let robot = lab.robot();
        let path = lab.laps(20);
        let dir = lab.dir().join("report");
        let mut command = lab.command(&["run", "rectangle", "--path", &path]);
        command.args(["--robot", &robot, "--start", "0.2,0.2,0", "--out", &dir.to_string_lossy()]);
        command.args(PATIENT).args(more);
        let run = Running::start(command);
        let drive = Self { lab, robot, run, dir };
        drive.goes_on("it drives");
        drive
    }

    fn status(&self) -> Value {
        self.lab.status(&self.robot).expect("it is up")
    }

    fn tell(&self, args: &[&str]) {
        self.lab.hilare(&[args, &["--robot", &self.robot]].concat()).expect_code(0);
    }

    /// Waits for half a second of the drive.
    fn goes_on(&self, what: &str) {
        self.lab.await_ticks(&self.robot, what, 500.0);
    }

    fn kill(&self, process: &str) {
        self.lab.replace(&self.robot, process);
        self.goes_on(&format!("ticks after the death of {process}"));
    }

    fn end(self) -> PathBuf {
        self.run.signal(Signal::INT);
        let ended = self.run.wait(PATIENCE);
        println!("{}", ended.stderr);
        self.dir
    }
}

/// Replays a recording, which must end in its own bits; what it came to.
#[track_caller]
fn replayed(lab: &Lab, dir: &Path) -> Value {
    let ended = lab.hilare(&["replay", &dir.to_string_lossy(), "--json"]);
    let report: Value =
        serde_json::from_str(&ended.stdout).unwrap_or_else(|error| panic!("{error}: {ended:#?}"));
    assert!(ended.code == Some(0) && report["equal"] == true, "{report:#}");
    for wanted in BOXES {
        let boxes = report["boxes"].as_array().expect("boxes").iter();
        let compared: f64 = boxes
            .filter(|found| text(found, "box").starts_with(wanted))
            .flat_map(|found| found["wires"].as_array().expect("wires"))
            .map(|tally| number(tally, "compared"))
            .sum();
        assert!(compared > 0.0, "nothing of {wanted} was compared: {report:#}");
    }
    report
}

/// Notes of all boxes.
fn notes(report: &Value) -> Vec<String> {
    let boxes = report["boxes"].as_array().expect("boxes").iter();
    boxes.flat_map(|found| found["notes"].as_array().expect("notes")).map(Value::to_string).collect()
}

/// Driven again with a value it has already, it never leaves the recording.
#[track_caller]
fn driven_again(lab: &Lab, dir: &Path) {
    let args = ["replay", &dir.to_string_lossy(), "--set", "timing.hold_cycles=2", "--json"];
    let ended = lab.hilare(&args).expect_code(0);
    let report: Value = serde_json::from_str(&ended.stdout).expect("JSON");
    assert_eq!(report["parted"], Value::Null, "{report:#}");
}

#[test]
fn every_scenario_replays_to_its_bits_in_virtual_time() {
    let lab = Lab::new();
    for clock in ["in-process", "lockstep"] {
        for scenario in SCENARIOS {
            if clock == "lockstep" && scenario != "line-21deg" && quick(&format!("{scenario} in lockstep")) {
                continue;
            }
            let dir = lab.dir().join(format!("{scenario}-{clock}"));
            let robot = lab.robot();
            let args =
                ["run", scenario, "--clock", clock, "--robot", &robot, "--out", &dir.to_string_lossy()];
            lab.hilare(&args);
            let report = replayed(&lab, &dir);
            assert_eq!(notes(&report), [] as [&str; 0], "{scenario} {clock}: {report:#}");
            driven_again(&lab, &dir);
        }
    }
}

#[test]
fn a_swap_of_law_and_of_parameters_a_goal_and_a_stop_are_replayed() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let drive = Drive::begin(&lab, &["--standby", "kanayama"]);
    drive.tell(&["swap", "controller", "qp"]);
    drive.goes_on("it drives on with the other law");
    drive.tell(&["swap", "waypoint_selector", "--set", "tracking.speed_mps=0.03"]);
    drive.goes_on("it drives on with another speed");
    drive.tell(&["goal", "0.6", "0.5"]);
    drive.goes_on("it drives to the goal");
    let path = lab.file("other.csv", "x,y\n0.3,0.3\n0.5,0.3\n0.5,0.5\n");
    drive.tell(&["follow", &path.to_string_lossy()]);
    drive.goes_on("it follows");
    drive.tell(&["stop"]);
    drive.goes_on("it stands");
    drive.tell(&["arm"]);
    drive.goes_on("it drives again");
    let dir = drive.end();
    let report = replayed(&lab, &dir);
    let controllers = report["boxes"].as_array().expect("boxes").iter();
    let laws: Vec<&str> =
        controllers.map(|found| text(found, "box")).filter(|name| name.starts_with("controller")).collect();
    assert!(laws.iter().any(|name| name.ends_with("qp")) && laws.len() >= 3, "{laws:?}");
    driven_again(&lab, &dir);
}

#[test]
fn changes_of_parameters_are_replayed_also_by_successors() {
    let _machine = whole_machine();
    let lab = Lab::new();
    for (more, first) in [
        (&["--standby", "kanayama"][..], "controller.kanayama.k1_per_s=0.05"),
        (&["--controller", "qp", "--set", "estimator.kind=ekf"], "controller.qp.knee_m=0.001"),
    ] {
        let drive = Drive::begin(&lab, more);
        let ekf = more.contains(&"estimator.kind=ekf");
        let noise = if ekf { "estimator.camera_sd_m=0.002" } else { "tracking.acceptance_radius_m=0.025" };
        let changes = [
            &[first][..],
            &["tracking.speed_mps=0.03", "limits.v_max_mps=0.035", noise],
            &["plant.slip_mean=0.02", "plant.slip_sd=0.01"],
            &["limits.omega_max_radps=0.6"],
        ];
        for change in changes {
            drive.tell(&[&["param", "set"], change].concat());
            drive.goes_on("it drives on with other parameters");
        }
        for process in ["controller", "waypoint_selector", "pose_estimator"] {
            drive.kill(process);
        }
        drive.tell(&["param", "set", "tracking.speed_mps=0.035"]);
        drive.goes_on("successors drive on with other parameters");
        let dir = drive.end();
        replayed(&lab, &dir);
        driven_again(&lab, &dir);
        // What was changed is in it: without the changes it is another drive.
        let args = ["replay", &dir.to_string_lossy(), "--set", "tracking.speed_mps=0.005", "--json"];
        let report: Value = serde_json::from_str(&lab.hilare(&args).expect_code(0).stdout).expect("JSON");
        assert_ne!(report["parted"], Value::Null, "{report:#}");
    }
}

#[test]
fn the_death_of_each_box_is_replayed() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let drive = Drive::begin(&lab, &["--standby", "kanayama"]);
    for process in ["planner", "waypoint_selector", "controller", "pose_estimator", "controller"] {
        drive.kill(process);
    }
    let dir = drive.end();
    replayed(&lab, &dir);
    driven_again(&lab, &dir);
}

#[test]
fn a_run_that_ends_with_a_death_or_an_emergency_stop_is_replayed_so_far() {
    let _machine = whole_machine();
    for end in ["step_generator", "plant", "launch", "estop"] {
        let lab = Lab::new();
        let drive = Drive::begin(&lab, &["--controller", "qp"]);
        let status = drive.status();
        match end {
            "estop" => drive.tell(&["estop"]),
            "launch" => signal(drive.run.pid(), Signal::KILL),
            process => signal(pid_of(&status, process), Signal::KILL),
        }
        let ended = drive.run.wait(PATIENCE);
        assert_ne!(ended.code, Some(0), "{end}");
        wait_until("the recorder has left, too", || lab.processes().is_empty());
        replayed(&lab, &drive.dir);
    }
}

#[test]
fn a_pause_of_the_clock_is_replayed() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let drive = Drive::begin(&lab, &["--controller", "stanley", "--standby", "pure-pursuit"]);
    let clock = pid_of(&drive.status(), "step_generator");
    for _ in 0..5 {
        signal(clock, Signal::STOP);
        sleep(Duration::from_millis(37));
        signal(clock, Signal::CONT);
        drive.goes_on("it drives on");
    }
    let paused = number(&drive.status(), "paused_ticks");
    assert!(paused >= 100.0, "{paused} ticks paused");
    let dir = drive.end();
    replayed(&lab, &dir);
    driven_again(&lab, &dir);
}

#[test]
fn a_cart_with_encoders_and_camera_and_one_on_mecanum_wheels_are_replayed_in_real_time() {
    let _machine = whole_machine();
    let lab = Lab::new();
    for (scenario, more, killed) in [
        ("line-21deg", &["--set", "estimator.kind=ekf"][..], "pose_estimator"),
        ("agv-low", &[], "waypoint_selector"),
        ("arc-102cm", &[], "pose_estimator"),
    ] {
        let dir = lab.dir().join(scenario);
        let robot = lab.robot();
        let mut command = lab.command(&["run", scenario, "--robot", &robot, "--out", &dir.to_string_lossy()]);
        command
            .args(["--set", "timing.pause_stop_ticks=0", "--set", "supervision.hung_after_s=5"])
            .args(more);
        let run = Running::start(command);
        let status = lab.await_status(&robot, "it drives", |status| number(status, "tick") > 500.0);
        signal(pid_of(&status, killed), Signal::KILL);
        let tick = number(&status, "tick");
        wait_until("it drives on or has arrived", || {
            lab.status(&robot).is_none_or(|status| number(&status, "tick") > tick + 1500.0)
        });
        run.signal(Signal::INT);
        run.wait(PATIENCE);
        replayed(&lab, &dir);
        driven_again(&lab, &dir);
    }
}

/// A verb's one line on standard error.
#[track_caller]
fn refusal(lab: &Lab, args: &[&str]) -> String {
    let ended = lab.hilare(args).expect_code(2);
    let lines: Vec<&str> = ended.stderr.lines().collect();
    assert!(lines.len() == 1 && ended.stdout.is_empty(), "{ended:#?}");
    ended.stderr.trim().to_owned()
}

#[test]
fn what_cannot_be_replayed_is_said_with_the_cure() {
    let lab = Lab::new();
    let dir = lab.dir().join("whole");
    let named = dir.to_string_lossy().into_owned();
    lab.hilare(&["run", "rectangle", "--clock", "in-process", "--out", &named]).expect_code(0);

    let nowhere = lab.dir().join("nosuch");
    let said = refusal(&lab, &["replay", &nowhere.to_string_lossy()]);
    assert!(said.contains("no such recording") && said.contains("runs/"), "{said}");
    let said = refusal(&lab, &["replay", &named, "--box", "plant", "--controller", "qp"]);
    assert!(said.contains("--controller qp") && said.contains("--box controller"), "{said}");

    let args = ["replay", &named, "--box", "planner", "--set", "controller.kanayama.k1_per_s=2"];
    let ended = lab.hilare(&args).expect_code(1);
    assert!(ended.stdout.contains("planner: what it took is not in the recording"), "{ended:#?}");

    // One byte in the middle, and a length that cannot be.
    let whole = std::fs::read(dir.join("run.mcap")).expect("a recording");
    let file = lab.dir().join("damaged.mcap");
    let flip = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x55;
        std::fs::write(&file, bytes).expect("a file");
        refusal(&lab, &["replay", &file.to_string_lossy()])
    };
    let chunks = chunks(&whole);
    let (begin, length) = chunks[chunks.len() / 2];
    for at in [begin + 9 + length / 2, begin + 6] {
        let said = flip(at);
        assert!(said.contains(&format!("damaged at byte {begin}:")), "{said}");
        assert!(said.contains("mcap recover"), "{said}");
    }
}

/// Offset and length of the chunks of a file.
fn chunks(bytes: &[u8]) -> Vec<(usize, usize)> {
    const CHUNK: u8 = 0x06;
    let (mut at, mut found) = (8, Vec::new());
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight")) as usize;
        found.extend((bytes[at] == CHUNK).then_some((at, length)));
        at += 9 + length;
    }
    found
}

#[test]
fn a_later_part_alone_says_that_it_is_one() {
    let lab = Lab::new();
    let dir = lab.dir().join("parts");
    let (robot, named) = (lab.robot(), dir.to_string_lossy().into_owned());
    let args = ["run", "rectangle", "--clock", "lockstep", "--robot", &robot, "--out", &named];
    lab.hilare(&[&args[..], &["--set", "recording.rotate_s=10"]].concat()).expect_code(0);
    let part = dir.join("run-0001.mcap");
    let ended = lab.hilare(&["replay", &part.to_string_lossy()]);
    assert!(ended.stdout.contains("is part 2 of a recording"), "{ended:#?}");
    assert!(!ended.stdout.contains("not hilare's"), "{ended:#?}");
    replayed(&lab, &dir);
}
