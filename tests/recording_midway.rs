//! Recordings begun when the robot is up, in the middle of its drive, replayed to the last bit.

mod support;

use hilare::config::System;
use hilare::recording::{Entry, Recording, Settings, Tape};
use hilare::shell::standing::Stand;
use hilare_interfaces::messages::{Pose, Reference, Steps, Truth};
use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use support::process::signal;
use support::{Ended, Lab, PATIENCE, Running, number, pid_of, text, wait_until, whole_machine};

/// A busy machine is no reason to stop, nor to give a process up.
const PATIENT: [&str; 6] = [
    "--set",
    "timing.pause_stop_ticks=0",
    "--set",
    "supervision.restart_budget=100",
    "--set",
    "supervision.hung_after_s=5",
];

/// A robot and its recording.
struct Midway {
    lab: Lab,
    robot: String,
    file: PathBuf,
}

impl Midway {
    fn new() -> Self {
        let lab = Lab::new();
        Self { robot: lab.robot(), file: lab.dir().join("midway.mcap"), lab }
    }

    /// A path longer than any test.
    fn laps(&self, laps: usize) -> String {
        let lap = "0.57,0.2\n0.57,0.48\n0.2,0.48\n0.2,0.2\n";
        let path = self.lab.file("laps.csv", format!("x,y\n0.2,0.2\n{}", lap.repeat(laps)));
        path.to_string_lossy().into_owned()
    }

    /// A robot in real time.
    fn up(&self, more: &[&str]) {
        let args = ["up", "epuck", "--detach", "--robot", &self.robot];
        self.lab.hilare(&[&args[..], &PATIENT, more].concat()).expect_code(0);
    }

    /// One in virtual time, which never rests.
    fn in_lockstep(&self, more: &[&str]) -> Running {
        let laps = self.laps(400);
        let args = ["run", "rectangle", "--path", &laps, "--start", "0.2,0.2,0", "--clock", "lockstep"];
        let place = ["--robot", &self.robot, "--no-recording", "--out", "report"];
        let run = self.lab.start(&[&args[..], &place, &PATIENT, more].concat());
        self.goes_on("it drives");
        run
    }

    fn tell(&self, args: &[&str]) -> Ended {
        self.lab.hilare(&[args, &["--robot", &self.robot]].concat())
    }

    fn status(&self) -> Value {
        self.lab.status(&self.robot).expect("it is up")
    }

    /// Waits for a third of a second of the drive.
    fn goes_on(&self, what: &str) {
        let from = std::cell::Cell::new(None);
        self.lab.await_status(&self.robot, what, |status| {
            let tick = number(status, "tick");
            if from.get().is_none() && tick > 0.0 {
                from.set(Some(tick));
            }
            from.get().is_some_and(|from| tick > from + 330.0)
        });
    }

    /// Begins the recording, and waits until it knows where the boxes stand.
    fn record(&self) -> Running {
        let file = self.file.to_string_lossy().into_owned();
        let recorder = self.lab.start(&["record", "--robot", &self.robot, "--out", &file]);
        let place = b"standings.json";
        wait_until("it knows where the boxes stand", || {
            fs::read(&file).is_ok_and(|bytes| bytes.windows(place.len()).any(|part| part == place))
        });
        recorder
    }

    fn kill(&self, process: &str) {
        let old = pid_of(&self.status(), process);
        signal(old, Signal::KILL);
        self.lab.await_status(&self.robot, &format!("a successor of {process}"), |status| {
            let processes = status["processes"].as_array().into_iter().flatten();
            processes.into_iter().any(|found| {
                let working = found["state"] != "starting" && found["state"] != "restarting";
                found["name"] == process
                    && working
                    && found["pid"].as_i64().is_some_and(|pid| pid > 1 && pid != i64::from(old))
            })
        });
    }

    fn stand(&self, role: &str) -> Option<Stand> {
        let inside = Recording::open(&self.file).expect("a recording").inside().expect("readable");
        let standings = inside.standings.expect("it knows").expect("as it should be");
        standings.stands.into_iter().find(|stand| stand.role == role)
    }

    /// Messages of some kind in the recording.
    fn count(&self, of: impl Fn(&Entry) -> bool) -> f64 {
        let entries = Recording::open(&self.file).expect("a recording").entries();
        entries.filter(|timed| of(&timed.as_ref().expect("sound").entry)).count() as f64
    }

    fn replay(&self, more: &[&str]) -> Ended {
        let file = self.file.to_string_lossy().into_owned();
        self.lab.hilare(&[&["replay", &file], more].concat())
    }

    /// Replays it, which must end in its own bits and compare all that came after the boxes were asked.
    #[track_caller]
    fn replayed(&self, at_least: f64) -> Value {
        let ended = self.replay(&["--json"]);
        let report: Value =
            serde_json::from_str(&ended.stdout).unwrap_or_else(|error| panic!("{error}: {ended:#?}"));
        assert!(ended.code == Some(0) && report["equal"] == true, "{report:#}");
        let after =
            |role: &str| self.stand(role).and_then(|stand| stand.done).map_or(-1.0, |tick| tick as f64);
        let (clock, estimator, plant) = (after("step_generator"), after("pose_estimator"), after("plant"));
        let selector = after("waypoint_selector");
        for (wire, whole) in [
            // Where it stood is compared as well.
            ("steps", self.count(|entry| matches!(entry, Entry::Steps(Steps { tick, .. }) if *tick as f64 >= clock))),
            ("pose", self.count(|entry| matches!(entry, Entry::Pose(Pose { tick, .. }) if *tick as f64 > estimator))),
            ("truth", self.count(|entry| matches!(entry, Entry::Truth(Truth { tick, .. }) if *tick as f64 > plant))),
            (
                "reference",
                self.count(
                    |entry| matches!(entry, Entry::Reference(Reference { tick, .. }) if *tick as f64 > selector),
                ),
            ),
        ] {
            let compared = compared(&report, "", wire);
            // Of the last moment one wire may have more than another; what a selector told last, it is to have told again.
            assert!(whole >= at_least && compared >= whole - 20.0, "{wire}: {compared} of {whole}: {report:#}");
        }
        report
    }

    /// The same recording with other messages.
    fn rewritten(&self, name: &str, mut change: impl FnMut(&mut Entry)) -> Midway {
        let recording = Recording::open(&self.file).expect("a recording");
        let inside = recording.inside().expect("readable");
        let text = recording.system().expect("a system");
        let system = System::parse("test", text).expect("a system");
        let other = Midway::new();
        let file = other.lab.dir().join(name);
        for (number, text) in &inside.systems {
            other.lab.file(&format!("system-{number}.toml"), text);
        }
        let settings = Settings::of(&system, file.clone(), true);
        let mut tape = Tape::begin(settings, recording.info().clone(), text.to_owned()).expect("a file");
        tape.keep_systems_of(other.lab.dir());
        tape.keep_standings(&inside.standings.expect("it knows").expect("as it should be"));
        for timed in recording.entries() {
            let mut entry = timed.expect("sound").entry;
            change(&mut entry);
            tape.hear(entry.heard());
        }
        tape.finish(None);
        Midway { file, ..other }
    }
}

/// Messages of a wire that were compared, of boxes whose name begins so.
fn compared(report: &Value, name: &str, wire: &str) -> f64 {
    let boxes = report["boxes"].as_array().expect("boxes").iter();
    boxes
        .filter(|found| text(found, "box").starts_with(name))
        .flat_map(|found| found["wires"].as_array().expect("wires"))
        .filter(|tally| text(tally, "wire") == wire)
        .map(|tally| number(tally, "compared"))
        .sum()
}

/// Whatever may happen on the way.
fn adventures(midway: &Midway) {
    midway.goes_on("it drives on");
    midway.tell(&["param", "set", "tracking.speed_mps=0.035", "limits.omega_max_radps=0.6"]).expect_code(0);
    midway.goes_on("with other parameters");
    midway.tell(&["swap", "controller", "qp"]).expect_code(0);
    midway.goes_on("with another law");
    for process in ["planner", "waypoint_selector", "pose_estimator", "controller"] {
        midway.kill(process);
        midway.goes_on(&format!("after the death of {process}"));
    }
    midway.tell(&["swap", "waypoint_selector", "--set", "tracking.speed_mps=0.03"]).expect_code(0);
    midway.goes_on("with another selector");
}

#[test]
fn a_recording_begun_in_mid_drive_replays_to_its_bits_in_real_time() {
    let _machine = whole_machine();
    let midway = Midway::new();
    midway.up(&["--standby", "kanayama"]);
    midway.tell(&["arm"]).expect_code(0);
    midway.tell(&["follow", &midway.laps(20)]).expect_code(0);
    midway.tell(&["param", "set", "controller.kanayama.k1_per_s=1.5"]).expect_code(0);
    midway.goes_on("it drives");
    let recorder = midway.record();
    adventures(&midway);
    midway.tell(&["goal", "0.4", "0.4"]).expect_code(0);
    midway.goes_on("it drives to the goal");
    midway.kill("step_generator");
    midway.tell(&["arm"]).expect_code(0);
    midway.goes_on("it drives again");
    midway.tell(&["stop"]).expect_code(0);
    midway.goes_on("it stands");
    recorder.signal(Signal::INT);
    let recorded = recorder.wait(PATIENCE).expect_code(0);
    assert!(recorded.stderr.contains("compares every box from tick"), "{}", recorded.stderr);
    midway.tell(&["down"]).expect_code(0);
    let report = midway.replayed(700.0);
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

    a_flipped_bit_is_found(&midway);
    standings_that_are_none_are_said_so(&midway);
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

fn a_flipped_bit_is_found(midway: &Midway) {
    type Number = fn(&mut Entry) -> Option<&mut f64>;
    let numbers: [(&str, Number); 5] = [
        (
            "steps",
            |entry| {
                if let Entry::Steps(steps) = entry { Some(&mut steps.wheel_speed_radps[0]) } else { None }
            },
        ),
        ("pose", |entry| if let Entry::Pose(pose) = entry { Some(&mut pose.x_m) } else { None }),
        ("truth", |entry| if let Entry::Truth(truth) = entry { Some(&mut truth.theta_rad) } else { None }),
        ("reference", |entry| {
            if let Entry::Reference(reference) = entry { Some(&mut reference.speed_mps) } else { None }
        }),
        (
            "command",
            |entry| if let Entry::Command(command) = entry { Some(&mut command.vx_mps) } else { None },
        ),
    ];
    for (wire, number_in) in numbers {
        let total = midway.count(|entry| number_in(&mut entry.clone()).is_some());
        let mut seen = 0.0;
        let other = midway.rewritten("flipped.mcap", |entry| {
            if let Some(number) = number_in(entry) {
                seen += 1.0;
                if seen == (total / 2.0).floor() {
                    *number = f64::from_bits(number.to_bits() ^ 1);
                }
            }
        });
        let ended = other.replay(&["--json"]).expect_code(1);
        let report: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        let boxes = report["boxes"].as_array().expect("boxes").iter();
        let mut tallies = boxes.flat_map(|found| found["wires"].as_array().expect("wires"));
        let found = tallies.any(|tally| text(tally, "wire") == wire && number(tally, "differing") >= 1.0);
        assert!(found, "{wire}: {report:#}");
    }
    // Rewritten without a change, it is as it was.
    let same = midway.rewritten("same.mcap", |_| {});
    same.replay(&[]).expect_code(0);
}

/// The bytes of a file's standings, and of their checksum.
fn standings_in(bytes: &[u8]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let begin = b"{\"version\":1,\"hilare\"";
    let at = bytes.windows(begin.len()).position(|part| part == begin).expect("standings");
    let length = u64::from_le_bytes(bytes[at - 8..at].try_into().expect("eight")) as usize;
    (at..at + length, at + length..at + length + 4)
}

fn standings_that_are_none_are_said_so(midway: &Midway) {
    let whole = fs::read(&midway.file).expect("a file");
    let (place, crc) = standings_in(&whole);
    let file = midway.lab.dir().join("other.mcap");
    let replay = |change: &dyn Fn(&mut Vec<u8>), checked: bool| {
        let mut bytes = whole.clone();
        let mut inside = bytes[place.clone()].to_vec();
        change(&mut inside);
        assert_eq!(inside.len(), place.len(), "as long as it was");
        bytes[place.clone()].copy_from_slice(&inside);
        if !checked {
            bytes[crc.clone()].fill(0);
        }
        fs::write(&file, bytes).expect("a file");
        let ended = midway.lab.hilare(&["replay", &file.to_string_lossy()]);
        assert!(matches!(ended.code, Some(0 | 1)) && !ended.stderr.contains("panicked"), "{ended:#?}");
        ended
    };
    let find = |inside: &[u8], what: &str| {
        inside.windows(what.len()).position(|part| part == what.as_bytes()).expect("it is there") + what.len()
    };
    let said = replay(&|inside| inside[100] ^= 1, true).stdout;
    assert!(said.contains("standings.json") && said.contains("is damaged"), "{said}");
    let foreign = |inside: &mut Vec<u8>| {
        let at = find(inside, "\"hilare\":\"");
        inside[at] = b'9';
    };
    let said = replay(&foreign, false).stdout;
    assert!(said.contains("is of hilare \"9"), "{said}");
    let said = replay(&|inside| *inside.last_mut().expect("text") = b' ', false).stdout;
    assert!(said.contains("is not what it should be"), "{said}");
    // Words of one box that are too few, and that are none.
    for (filler, words) in [(b' ', 20), (b'f', 16)] {
        for role in ["waypoint_selector", "controller", "step_generator", "pose_estimator", "plant"] {
            let change = |inside: &mut Vec<u8>| {
                let stand = find(inside, &format!("\"role\":\"{role}\""));
                let begin = stand + find(&inside[stand..], "\"words\":\"");
                let end = begin + inside[begin..].iter().position(|byte| *byte == b'"').expect("an end");
                let from = if filler == b' ' { begin + 2 } else { begin };
                let to = if filler == b' ' { end } else { end.min(begin + words) };
                inside[from..to].fill(filler);
            };
            let ended = replay(&change, false);
            let noticed = ended.code == Some(1) || ended.stdout.contains("not one it can go on from");
            assert!(noticed, "{role}: {ended:#?}");
        }
    }
    // A tick that never was.
    let later = |inside: &mut Vec<u8>| {
        let begin = find(inside, "\"done\":");
        let digits = inside[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        inside[begin..begin + digits].fill(b'9');
    };
    let ended = replay(&later, false);
    assert!(
        ended.code == Some(1) || ended.stdout.contains("at work before the recording began"),
        "{ended:#?}"
    );
}

#[test]
fn a_recording_begun_in_mid_drive_replays_to_its_bits_in_virtual_time() {
    let _machine = whole_machine();
    let midway = Midway::new();
    let run = midway.in_lockstep(&["--standby", "kanayama"]);
    let recorder = midway.record();
    adventures(&midway);
    recorder.signal(Signal::INT);
    recorder.wait(PATIENCE);
    run.signal(Signal::INT);
    run.wait(PATIENCE);
    let report = midway.replayed(2000.0);
    assert!(compared(&report, "controller", "command") > 2000.0, "{report:#}");
    driven_again(&midway);
}

#[test]
fn sensors_servos_and_a_camera_are_met_in_mid_drive_too() {
    let _machine = whole_machine();
    for (scenario, more) in [("line-21deg", &["--set", "estimator.kind=ekf"][..]), ("agv-course", &[])] {
        let midway = Midway::new();
        let args = ["run", scenario, "--robot", &midway.robot, "--no-recording", "--out", "report"];
        let run = midway.lab.start(&[&args[..], &PATIENT, more].concat());
        midway.goes_on("it drives");
        let recorder = midway.record();
        midway.goes_on("it drives on");
        midway.kill("pose_estimator");
        midway.goes_on("it drives on with a successor");
        recorder.signal(Signal::INT);
        recorder.wait(PATIENCE).expect_code(0);
        run.signal(Signal::INT);
        run.wait(PATIENCE);
        let report = midway.replayed(100.0);
        assert!(compared(&report, "plant", "wheels") > 500.0, "{scenario}: {report:#}");
        driven_again(&midway);
        assert!(more.is_empty() || compared(&report, "plant", "fix") > 5.0, "{scenario}: {report:#}");
    }
}

#[test]
fn begun_before_the_robot_is_armed_a_recording_is_whole_and_can_be_driven_again() {
    let _machine = whole_machine();
    let midway = Midway::new();
    midway.up(&[]);
    midway
        .tell(&["param", "set", "tracking.speed_mps=0.03", "controller.kanayama.k1_per_s=1.5"])
        .expect_code(0);
    let recorder = midway.record();
    midway.tell(&["arm"]).expect_code(0);
    midway.tell(&["follow", &midway.laps(20)]).expect_code(0);
    midway.goes_on("it drives");
    midway.tell(&["param", "set", "tracking.speed_mps=0.04"]).expect_code(0);
    midway.goes_on("it drives on");
    recorder.signal(Signal::INT);
    let recorded = recorder.wait(PATIENCE).expect_code(0);
    assert!(
        recorded.stderr.contains("compares every box, and can drive again with changes"),
        "{}",
        recorded.stderr
    );
    midway.tell(&["down"]).expect_code(0);
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
