//! The recorder on robots in real processes: what other people's readers find in its files, and what becomes of them
//! when the recorder or launch is killed, when the disk is full.

mod support;

use hilare::recording::{Entry, Recording, Timed};
use rustix::process::{Pid, Resource, Rlimit, Signal, prlimit};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use support::{Lab, PATIENCE, number, pid_of, process, python_with, wait_until};

/// The end of a run that was recorded, as a file, and its summary.
fn run(lab: &Lab, clock: &str, more: &[&str]) -> (std::path::PathBuf, Value) {
    let robot = lab.robot();
    let out = lab.dir().join(clock);
    let out_text = out.to_string_lossy().into_owned();
    let args = [&["run", "--clock", clock, "--robot", &robot, "--out", &out_text], more].concat();
    lab.hilare(&args).expect_code(0);
    let summary = lab.summary(&out);
    let recording = &summary["recording"];
    assert_eq!((&recording["complete"], &recording["why"]), (&true.into(), &"".into()), "{recording}");
    assert_eq!((number(recording, "gaps"), number(recording, "dropped")), (0.0, 0.0));
    (out.join("run.mcap"), summary)
}

fn entries(file: &Path) -> Vec<Timed> {
    let recording = Recording::open(file).expect("a recording");
    recording.entries().map(|timed| timed.expect("a message")).collect()
}

/// Ticks of the steps.
fn ticks(entries: &[Timed]) -> Vec<u64> {
    let steps = entries.iter().filter(|timed| matches!(timed.entry, Entry::Steps(_)));
    steps.filter_map(|timed| timed.entry.tick()).collect()
}

fn is_gapless(ticks: &[u64]) -> bool {
    ticks.windows(2).all(|pair| pair[1] == pair[0] + 1)
}

/// What each wire carried up to the last reference, which says that the robot has arrived.
fn until_arrival(file: &Path) -> BTreeMap<&'static str, Vec<Entry>> {
    let entries = entries(file);
    let arrival = entries.iter().find_map(|timed| match &timed.entry {
        Entry::Reference(reference) if reference.state == 2 => Some(reference.tick),
        _ => None,
    });
    let arrival = arrival.expect("it arrived");
    let mut wires: BTreeMap<_, Vec<Entry>> = BTreeMap::new();
    for timed in entries {
        // Of one thread there is no journal.
        let told = timed.entry.wire().name() != "journal";
        if told && timed.entry.tick().is_some_and(|tick| tick <= arrival) {
            wires.entry(timed.entry.wire().name()).or_default().push(timed.entry);
        }
    }
    wires
}

#[test]
fn others_read_it_and_come_to_the_same_figures() {
    let test = "others_read_it_and_come_to_the_same_figures";
    let Some(python) = python_with(test, "mcap_ros2, rosbags") else { return };
    let lab = Lab::new();
    // Lines and an arc, a chassis whose wheels slip.
    let path = lab.file("path.csv", "x,y,bulge\n0,0,0\n0.12,0,0\n0.2,0.08,0.4\n0.2,0.2,0\n");
    let path = path.to_string_lossy().into_owned();
    let slippery = ["--path", &path, "--set", "plant.slip_mean=0.03", "--seed", "7"];
    let cases = [("lockstep", &slippery[..], "mcap"), ("in-process", &slippery[..], "rosbags")];
    for (clock, more, reader) in cases {
        let (file, summary) = run(&lab, clock, more);
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/read_recording.py");
        for reader in ["mcap", "rosbags"].into_iter().filter(|known| clock == "lockstep" || *known == reader)
        {
            let ended = Command::new(&python).arg(&script).arg(reader).arg(&file).output().expect("Python");
            assert!(ended.status.success(), "{reader}: {}", String::from_utf8_lossy(&ended.stderr));
            let found: Value = serde_json::from_slice(&ended.stdout).expect("JSON");
            for key in ["reached", "ticks", "state_hash", "final_pose", "final_truth"] {
                assert_eq!(found[key], summary[key], "{clock}, {reader}: {key}");
            }
            assert_eq!(
                found["steps"].as_array().expect("steps")[..2],
                summary["steps"].as_array().expect("steps")[..]
            );
            for key in [
                "cross_track_mean_m",
                "cross_track_max_m",
                "speed_error_mean_mps",
                "speed_error_truth_mean_mps",
            ] {
                let (found, told) = (number(&found, key), number(&summary, key));
                assert!(
                    (found - told).abs() < 1e-12,
                    "{clock}, {reader}: {key}: {found}, summary.json {told}"
                );
            }
            let messages: f64 = found["messages"]
                .as_object()
                .expect("messages")
                .iter()
                .filter(|(topic, _)| topic.starts_with("/hilare/"))
                .map(|(_, count)| count.as_f64().expect("a count"))
                .sum();
            assert_eq!(messages, number(&summary["recording"], "messages"), "{clock}, {reader}");
        }
    }
}

#[test]
fn every_clock_records_the_same_messages() {
    let lab = Lab::new();
    let path = lab.straight(0.15);
    let path = path.to_string_lossy().into_owned();
    // With a camera, so that every wire carries something.
    let more = ["--path", &path, "--set", "estimator.kind=ekf", "--seed", "3"];
    let (in_process, _) = run(&lab, "in-process", &more);
    let (lockstep, summary) = run(&lab, "lockstep", &more);
    let (ours, theirs) = (until_arrival(&in_process), until_arrival(&lockstep));
    assert_eq!(ours.keys().collect::<Vec<_>>(), theirs.keys().collect::<Vec<_>>());
    assert!(ours.contains_key("wheels") && ours.contains_key("fix"));
    for (wire, ours) in &ours {
        let theirs = &theirs[wire];
        // What processes count and know of themselves is another matter; which controller, and when armed.
        let comparable: fn(&Entry) -> Entry = match *wire {
            "steps" => |entry| match entry {
                Entry::Steps(steps) => Entry::Steps(hilare_interfaces::messages::Steps {
                    tick: steps.tick,
                    counts: steps.counts,
                    dir_level: steps.dir_level,
                    wheel_speed_radps: steps.wheel_speed_radps,
                    twist: steps.twist,
                    ..Default::default()
                }),
                other => other.clone(),
            },
            "command" => |entry| match entry {
                Entry::Command(command) => {
                    Entry::Command(hilare_interfaces::messages::Command { source: 0, epoch: 0, ..*command })
                }
                other => other.clone(),
            },
            _ => Entry::clone,
        };
        let (ours, theirs): (Vec<_>, Vec<_>) =
            (ours.iter().map(comparable).collect(), theirs.iter().map(comparable).collect());
        assert!(
            ours == theirs,
            "{wire}: {} messages in one thread, {} of processes",
            ours.len(),
            theirs.len()
        );
    }
    let (real, _) = run(&lab, "real", &more);
    let ticks = ticks(&entries(&real));
    assert!(is_gapless(&ticks) && ticks.len() as f64 >= number(&summary, "ticks"), "{} ticks", ticks.len());
}

#[test]
fn without_a_recording_there_is_none() {
    let lab = Lab::new();
    let path = lab.straight(0.05);
    let (robot, path) = (lab.robot(), path.to_string_lossy().into_owned());
    for clock in ["in-process", "lockstep"] {
        let args = ["run", "--path", &path, "--clock", clock, "--robot", &robot, "--out", "report"];
        lab.hilare(&args).expect_code(0);
        let file = lab.dir().join("report/run.mcap");
        assert!(file.exists());
        // What an earlier run has left is not taken for a part of this one.
        fs::write(lab.dir().join("report/run-0001.mcap"), b"old").expect("a file");
        lab.hilare(&[&args[..], &["--no-recording"]].concat()).expect_code(0);
        assert!(!file.exists() && !lab.dir().join("report/run-0001.mcap").exists());
        assert!(lab.summary(&lab.dir().join("report")).get("recording").is_none());
    }
}

/// A robot that drives, recorded by `hilare run`, and the file.
fn driving(lab: &Lab, robot: &str, more: &[&str]) -> (support::Running, std::path::PathBuf) {
    let path = lab.straight(20.0);
    let path = path.to_string_lossy().into_owned();
    let running = lab.start(&[&["run", "--path", &path, "--robot", robot, "--out", "report"], more].concat());
    lab.await_status(robot, "it drives", |status| number(status, "speed_mps") > 0.03);
    (running, lab.dir().join("report/run.mcap"))
}

fn tick_of(status: &Value) -> f64 {
    number(status, "tick")
}

#[test]
fn whoever_is_killed_leaves_a_recording_up_to_a_second_before() {
    for whom in ["recorder", "launch"] {
        let lab = Lab::new();
        let robot = lab.robot();
        let (running, file) = driving(&lab, &robot, &[]);
        let status = lab.await_status(&robot, "three seconds", |status| tick_of(status) > 3000.0);
        let then = tick_of(&status);
        if whom == "launch" {
            running.signal(Signal::KILL);
        } else {
            process::signal(pid_of(&status, "recorder"), Signal::KILL);
            // The run goes on without it.
            lab.await_status(&robot, "it goes on", |status| tick_of(status) > then + 1000.0);
            running.signal(Signal::INT);
        }
        let ended = running.wait(PATIENCE);
        if whom == "recorder" {
            assert_eq!(ended.code, Some(1), "{}", ended.stderr);
            assert!(ended.stderr.contains("the run goes on, its figures are lost"), "{}", ended.stderr);
        }
        wait_until("everybody is gone", || lab.processes().is_empty());
        let recording = Recording::open(&file).expect("a recording");
        // Launch's death ends the recorder in good order, if it lives.
        assert_eq!(recording.truncated().is_some(), whom == "recorder");
        let ticks = ticks(&entries(&file));
        assert!(is_gapless(&ticks) && ticks[0] <= 1, "{whom}: {:?}", &ticks[..3.min(ticks.len())]);
        // A chunk a second, the relay's look and the recorder's; and what this machine steals.
        let last = *ticks.last().expect("ticks") as f64;
        assert!(last > then - 1500.0, "{whom}: recorded up to tick {last}, killed after {then}");
    }
}

#[test]
fn a_full_disk_ends_the_recording_and_nothing_else() {
    let lab = Lab::new();
    let robot = lab.robot();
    let (running, file) = driving(&lab, &robot, &["--set", "recording.chunk_kb=100"]);
    let status = lab.await_status(&robot, "a second", |status| tick_of(status) > 1000.0);
    // The recorder alone may write no more than so much into a file: the same to it as a disk that is full.
    let limit = fs::metadata(&file).expect("a file").len() + 300_000;
    let recorder = Pid::from_raw(pid_of(&status, "recorder"));
    let limits = Rlimit { current: Some(limit), maximum: Some(limit) };
    prlimit(recorder, Resource::Fsize, limits).expect("a limit");
    let then = tick_of(&status);
    let status = lab.await_status(&robot, "it goes on", |status| tick_of(status) > then + 5000.0);
    assert!(number(&status, "speed_mps") > 0.03 && status["fault"].is_null(), "{status}");
    running.signal(Signal::INT);
    let ended = running.wait(PATIENCE);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    let said = ended.stderr.matches("recording ends here, the run goes on").count();
    assert_eq!(said, 1, "{}", ended.stderr);
    assert!(ended.stderr.contains("files may not become larger"), "{}", ended.stderr);
    let summary = lab.summary(&lab.dir().join("report"));
    let recording = &summary["recording"];
    assert_eq!(recording["complete"], false);
    assert!(number(recording, "dropped") > 4000.0, "{recording}");
    // The figures are those of the whole run.
    assert!(number(&summary, "ticks") > then + 5000.0);
    // The file ends as any other.
    assert_eq!(Recording::open(&file).expect("a recording").truncated(), None);
    let entries = entries(&file);
    assert!(is_gapless(&ticks(&entries)));
    assert_eq!(entries.len() as f64, number(recording, "messages"));
    assert!(fs::metadata(&file).expect("a file").len() <= limit);
}

#[test]
fn a_robot_that_is_up_can_be_recorded_and_need_not_know() {
    let lab = Lab::new();
    let robot = lab.robot();
    lab.hilare(&["up", "--detach", "--robot", &robot]).expect_code(0);
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    let path = lab.straight(5.0);
    lab.hilare(&["follow", &path.to_string_lossy(), "--robot", &robot]).expect_code(0);
    lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.03);
    let args = ["record", "--robot", &robot, "--seconds", "2", "--out", "drive.mcap", "--json"];
    let ended = lab.hilare(&args).expect_code(0);
    let told: Value = serde_json::from_str(&ended.stdout).expect("JSON");
    let file = lab.dir().join("drive.mcap");
    let found = entries(&file);
    assert_eq!((&told["complete"], number(&told, "messages")), (&true.into(), found.len() as f64));
    let ticks = ticks(&found);
    assert!(is_gapless(&ticks) && ticks[0] > 0 && ticks.len() > 1000, "{}", ticks.len());
    // Who comes late still gets the path, and knows what robot it is.
    assert!(
        matches!(&found[..], [first, ..] if found.iter().any(|t| matches!(t.entry, Entry::Path(..))) && first.log_time_ns > 0)
    );
    let recording = Recording::open(&file).expect("a recording");
    assert_eq!(recording.info().robot, robot);
    assert!(recording.system().is_some_and(|system| system.contains("track_m")));

    // What is there is not written over; a place that cannot be written is refused.
    let again = lab.hilare(&args).expect_code(2);
    assert!(again.stderr.contains("drive.mcap: is there already; choose another name"), "{}", again.stderr);
    let nowhere = lab.file("file", "");
    let nowhere = nowhere.join("x.mcap").to_string_lossy().into_owned();
    lab.hilare(&["record", "--robot", &robot, "--out", &nowhere]).expect_code(2);
    lab.hilare(&["record", "--robot", "nobody"]).expect_code(2);
    lab.hilare(&["record", "--robot", &robot, "--seconds", "0"]).expect_code(2);

    // With the robot, and with Ctrl-C.
    let until_down = lab.start(&["record", "--robot", &robot, "--out", "until-down"]);
    let until_told = lab.start(&["record", "--robot", &robot, "--out", "until-told"]);
    let grown = |name: &str| fs::metadata(lab.dir().join(name)).is_ok_and(|file| file.len() > 20_000);
    wait_until("both record", || grown("until-down/run.mcap") && grown("until-told/run.mcap"));
    until_told.signal(Signal::INT);
    let told = until_told.wait(PATIENCE).expect_code(0);
    assert!(told.stdout.contains("steps") && told.stdout.contains("until-told/run.mcap"), "{}", told.stdout);
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    until_down.wait(PATIENCE).expect_code(0);
    assert!(
        Recording::open(&lab.dir().join("until-down")).is_ok_and(|recording| recording.truncated().is_none())
    );
}

#[test]
fn a_disk_that_is_full_ends_what_is_recorded_beside_a_robot_and_is_told() {
    let lab = Lab::new();
    let robot = lab.robot();
    lab.hilare(&["up", "--detach", "--robot", &robot]).expect_code(0);
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    let recording = lab.start(&["record", "--robot", &robot, "--out", "full.mcap"]);
    let file = lab.dir().join("full.mcap");
    let bytes = || fs::metadata(&file).map_or(0, |file| file.len());
    wait_until("it records", || bytes() > 20_000);
    // The chunk that is under way and the end of the file fit in; not another chunk.
    let limit = bytes() + 600_000;
    let pid = Pid::from_raw(recording.pid());
    let limits = Rlimit { current: Some(limit), maximum: Some(limit) };
    prlimit(pid, Resource::Fsize, limits).expect("a limit");
    let ended = recording.wait(PATIENCE).expect_code(1);
    assert!(ended.stderr.contains("the recording is not complete"), "{}", ended.stderr);
    assert!(ended.stderr.contains("files may not become larger"), "{}", ended.stderr);
    // What is there is whole, and the robot has noticed nothing.
    assert_eq!(Recording::open(&file).expect("a recording").truncated(), None);
    assert!(is_gapless(&ticks(&entries(&file))) && bytes() <= limit);
    let then = tick_of(&lab.await_status(&robot, "a status", |_| true));
    let status = lab.await_status(&robot, "it goes on", |status| tick_of(status) > then + 100.0);
    assert!(status["fault"].is_null(), "{status}");
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
}
