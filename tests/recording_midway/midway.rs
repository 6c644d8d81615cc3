//! A robot that is up, its recording, and what a replay makes of it.

use crate::support::{Ended, Lab, PATIENCE, PATIENT, Running, number, text, wait_until};
use hilare::config::System;
use hilare::recording::{Entry, Recording, Settings, Tape};
use hilare::shell::standing::Stand;
use hilare_interfaces::messages::{Pose, Reference, Steps, Truth};
use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::path::PathBuf;

/// A robot and its recording.
pub struct Midway {
    pub lab: Lab,
    pub robot: String,
    pub file: PathBuf,
}

impl Midway {
    pub fn new() -> Self {
        let lab = Lab::new();
        Self { robot: lab.robot(), file: lab.dir().join("midway.mcap"), lab }
    }

    /// A robot in real time.
    pub fn up(&self, more: &[&str]) {
        let args = ["up", "epuck", "--detach", "--robot", &self.robot];
        self.lab.hilare(&[&args[..], &PATIENT, more].concat()).expect_code(0);
    }

    /// One in virtual time, which never rests.
    pub fn in_lockstep(&self, more: &[&str]) -> Running {
        let laps = self.lab.laps(400);
        let args = ["run", "rectangle", "--path", &laps, "--start", "0.2,0.2,0", "--clock", "lockstep"];
        let place = ["--robot", &self.robot, "--no-recording", "--out", "report"];
        let run = self.lab.start(&[&args[..], &place, &PATIENT, more].concat());
        self.goes_on("it drives");
        run
    }

    pub fn tell(&self, args: &[&str]) -> Ended {
        self.lab.hilare(&[args, &["--robot", &self.robot]].concat())
    }

    /// Waits for a third of a second of the drive.
    pub fn goes_on(&self, what: &str) {
        self.lab.await_ticks(&self.robot, what, 330.0);
    }

    /// Begins the recording, and waits until it knows where the boxes stand.
    pub fn record(&self) -> Running {
        let file = self.file.to_string_lossy().into_owned();
        let recorder = self.lab.start(&["record", "--robot", &self.robot, "--out", &file]);
        let place = b"standings.json";
        wait_until("it knows where the boxes stand", || {
            fs::read(&file).is_ok_and(|bytes| bytes.windows(place.len()).any(|part| part == place))
        });
        recorder
    }

    /// Ends the recording. False if this machine has kept the recorder from its work for so long that messages are missing:
    /// that is no matter of this test, but what there is has its own bits all the same.
    pub fn ended_whole(&self, recorder: Running) -> bool {
        recorder.signal(Signal::INT);
        let ended = recorder.wait(PATIENCE);
        assert!(ended.stderr.contains("a replay of it compares every box"), "{ended:#?}");
        if ended.code != Some(0) {
            assert!(ended.stderr.contains("the recording is not complete"), "{ended:#?}");
            let replayed = self.replay(&["--json"]);
            let report: Value = serde_json::from_str(&replayed.stdout).expect("JSON");
            assert_eq!(number(&report, "differing"), 0.0, "{report:#}");
        }
        ended.code == Some(0)
    }

    pub fn stand(&self, role: &str) -> Option<Stand> {
        let inside = Recording::open(&self.file).expect("a recording").inside().expect("readable");
        let standings = inside.standings.expect("it knows").expect("as it should be");
        standings.stands.into_iter().find(|stand| stand.role == role)
    }

    /// Messages of some kind in the recording.
    pub fn count(&self, of: impl Fn(&Entry) -> bool) -> f64 {
        let entries = Recording::open(&self.file).expect("a recording").entries();
        entries.filter(|timed| of(&timed.as_ref().expect("sound").entry)).count() as f64
    }

    pub fn replay(&self, more: &[&str]) -> Ended {
        let file = self.file.to_string_lossy().into_owned();
        self.lab.hilare(&[&["replay", &file], more].concat())
    }

    /// Replays it, which must end in its own bits and compare all that came after the boxes were asked.
    #[track_caller]
    pub fn replayed(&self, at_least: f64) -> Value {
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
    pub fn rewritten(&self, name: &str, mut change: impl FnMut(&mut Entry)) -> Midway {
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
pub fn compared(report: &Value, name: &str, wire: &str) -> f64 {
    let boxes = report["boxes"].as_array().expect("boxes").iter();
    boxes
        .filter(|found| text(found, "box").starts_with(name))
        .flat_map(|found| found["wires"].as_array().expect("wires"))
        .filter(|tally| text(tally, "wire") == wire)
        .map(|tally| number(tally, "compared"))
        .sum()
}
