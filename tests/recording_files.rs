//! Recordings as files: what is written comes back bit for bit, and what is no recording, or one no more, is said in a
//! line.

mod support;

use hilare::config::System;
use hilare::recording::wires::RECORDED;
use hilare::recording::{Entry, Recording, RunInfo, Settings, Tape};
use hilare::shell::in_process::InProcess;
use hilare_interfaces::hostile::{self, cases};
use hilare_interfaces::layout::{WireField, WireMessage};
use hilare_interfaces::messages::{
    Authority, Command, PathHeader, Pose, PoseFix, Reference, Steps, Truth, Waypoint, Wheels,
};
use mcap::records::MessageHeader;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use support::random::Random;

/// A recording of a short drive, and what is in it.
fn drive(dir: &Path, length_m: f64, keys: &[&str]) -> (PathBuf, Vec<Entry>) {
    let mut system = System::load("epuck").expect("built in");
    system.set_all(keys).expect("keys");
    let path = [Waypoint::straight(0.0, 0.0), Waypoint::straight(length_m, 0.0)];
    let file = dir.join("run.mcap");
    let settings = Settings::of(&system, file.clone(), true);
    let info = RunInfo::new(&system, "short", "in-process");
    let mut tape = Tape::begin(settings, info, system.to_toml()).expect("a file");
    let mut robot = InProcess::new(&system, &path).expect("a robot");
    let mut entries = Vec::new();
    robot.run_heard(100_000, |heard| {
        tape.hear(heard);
        entries.push(heard.kept());
    });
    let report = tape.finish(None);
    assert!(report.complete, "{report:?}");
    assert_eq!(report.messages, entries.len() as u64);
    (file, entries)
}

/// Wire and bits: what a message is, also where a number is none.
fn bits(entry: &Entry) -> (usize, Vec<u8>) {
    let heard = entry.heard();
    let mut bytes = heard.bytes().to_vec();
    bytes.extend(heard.elements().map_or(&[][..], |(_, elements)| elements));
    (heard.place(), bytes)
}

fn by_wire(entries: &[Entry]) -> BTreeMap<usize, Vec<Vec<u8>>> {
    let mut wires: BTreeMap<usize, Vec<Vec<u8>>> = BTreeMap::new();
    for entry in entries {
        let (place, bytes) = bits(entry);
        wires.entry(place).or_default().push(bytes);
    }
    wires
}

fn read(file: &Path) -> Result<Vec<Entry>, String> {
    let recording = Recording::open(file).map_err(|error| error.to_string())?;
    recording
        .entries()
        .map(|timed| timed.map(|timed| timed.entry).map_err(|error| error.to_string()))
        .collect()
}

#[test]
fn what_is_heard_comes_back_bit_for_bit() {
    fn some<M: WireMessage + std::fmt::Debug>() -> BoxedStrategy<Vec<M>> {
        hostile::some(hostile::message(Just(M::ZERO)), 4)
    }
    let paths = (hostile::message(Just(PathHeader::ZERO)), prop_oneof![Just(Vec::new()), some::<Waypoint>()]);
    let all = (
        proptest::collection::vec(paths, 1..4),
        some::<Authority>(),
        some::<Steps>(),
        some::<Wheels>(),
        some::<PoseFix>(),
        some::<Pose>(),
        some::<Truth>(),
        some::<Reference>(),
        some::<Command>(),
    );
    let dir = tempfile::tempdir().expect("a directory");
    let system = System::load("epuck").expect("built in");
    let mut runner = TestRunner::new(cases(64));
    let mut number = 0;
    let test = |(paths, authorities, steps, wheels, fixes, poses, truths, references, commands)| {
        number += 1;
        let file = dir.path().join(format!("{number}.mcap"));
        let mut sent: Vec<Entry> = Vec::new();
        let paths: Vec<(PathHeader, Vec<Waypoint>)> = paths;
        sent.extend(paths.into_iter().map(|(header, waypoints)| Entry::Path(header, waypoints)));
        sent.extend(Vec::<Authority>::into_iter(authorities).map(Entry::Authority));
        sent.extend(Vec::<Steps>::into_iter(steps).map(Entry::Steps));
        sent.extend(Vec::<Wheels>::into_iter(wheels).map(Entry::Wheels));
        sent.extend(Vec::<PoseFix>::into_iter(fixes).map(Entry::Fix));
        sent.extend(Vec::<Pose>::into_iter(poses).map(Entry::Pose));
        sent.extend(Vec::<Truth>::into_iter(truths).map(Entry::Truth));
        sent.extend(Vec::<Reference>::into_iter(references).map(Entry::Reference));
        sent.extend(Vec::<Command>::into_iter(commands).map(Entry::Command));
        let settings = Settings::of(&system, file.clone(), true);
        let mut tape =
            Tape::begin(settings, RunInfo::new(&system, "", "test"), String::new()).expect("a file");
        sent.iter().for_each(|entry| tape.hear(entry.heard()));
        // Ticks of hostile messages leave gaps; all of them are written.
        prop_assert_eq!(tape.finish(None).messages, sent.len() as u64);
        let got = read(&file).map_err(TestCaseError::fail)?;
        // In the file they stand by time; on each wire, in the order in which they came if they agree on it.
        let sorted = |entries: &[Entry]| {
            let mut all: Vec<_> = entries.iter().map(bits).collect();
            all.sort();
            all
        };
        prop_assert_eq!(sorted(&got), sorted(&sent));
        fs::remove_file(&file).expect("it is there");
        Ok(())
    };
    let mut test = test;
    let cell = std::cell::RefCell::new(&mut test);
    runner.run(&all, |case| (cell.borrow_mut())(case)).expect("every message");
}

#[test]
fn a_drive_comes_back_in_order_with_what_it_was() {
    let dir = tempfile::tempdir().expect("a directory");
    let (file, sent) = drive(dir.path(), 0.06, &["estimator.kind=ekf", "plant.seed=7"]);
    let recording = Recording::open(dir.path()).expect("a recording");
    assert_eq!(recording.files(), [file]);
    assert_eq!(recording.truncated(), None);
    let info = recording.info();
    assert_eq!(
        (info.scenario.as_str(), info.clock.as_str(), info.controller.as_str(), info.seed.as_str()),
        ("short", "in-process", "kanayama", "7")
    );
    let system = System::parse("recorded", recording.system().expect("a system")).expect("a system");
    assert_eq!(system.get("plant.seed"), Some(7.0));
    let mut got = Vec::new();
    let mut last_ns = 0;
    for timed in recording.entries() {
        let timed = timed.expect("a message");
        assert!(timed.log_time_ns >= last_ns);
        last_ns = timed.log_time_ns;
        got.push(timed.entry);
    }
    assert_eq!(by_wire(&got), by_wire(&sent));
    // A robot with a camera has everything but what processes say to launch and it to them.
    assert_eq!(by_wire(&got).len(), RECORDED.len() - ["goal", "answer", "health", "journal"].len());
}

#[test]
fn parts_are_files_of_their_own_and_one_recording() {
    let dir = tempfile::tempdir().expect("a directory");
    let (file, sent) = drive(dir.path(), 0.2, &["recording.rotate_s=1", "recording.chunk_kb=16"]);
    let recording = Recording::open(&file).expect("a recording");
    let files = recording.files().to_vec();
    assert!(files.len() >= 5, "{files:?}");
    assert_eq!(by_wire(&read(dir.path()).expect("all parts")), by_wire(&sent));
    // Each of them alone, with system and metadata of its own.
    let mut alone = 0;
    let elsewhere = tempfile::tempdir().expect("a directory");
    for (number, part) in files.iter().enumerate() {
        let copy = elsewhere.path().join("one.mcap");
        fs::copy(part, &copy).expect("a copy");
        let part = Recording::open(&copy).expect("a recording");
        assert_eq!((part.info().part, part.info().scenario.as_str()), (number as u64, "short"));
        assert!(part.system().is_some() && part.truncated().is_none());
        let steps = part.entries().map(Result::unwrap).filter(|timed| matches!(timed.entry, Entry::Steps(_)));
        let steps = steps.count();
        assert!(steps <= 1001, "{steps}");
        alone += steps;
    }
    assert_eq!(alone, sent.iter().filter(|entry| matches!(entry, Entry::Steps(_))).count());
    // From a part that is named on; and what lies beside from another recording does not belong to it.
    let rest = Recording::open(&files[2]).expect("a recording");
    assert_eq!(rest.files(), &files[2..]);
    let other = tempfile::tempdir().expect("a directory");
    let (foreign, _) = drive(other.path(), 0.01, &[]);
    fs::copy(foreign, &files[3]).expect("a copy");
    assert_eq!(Recording::open(&file).expect("a recording").files().len(), files.len() - 1);

    let dir = tempfile::tempdir().expect("a directory");
    let (_, sent) = drive(dir.path(), 1.5, &["recording.rotate_mb=1"]);
    let recording = Recording::open(dir.path()).expect("a recording");
    let sizes: Vec<u64> =
        recording.files().iter().map(|file| fs::metadata(file).expect("a file").len()).collect();
    assert!(sizes.len() >= 3, "{sizes:?}");
    assert!(sizes[..sizes.len() - 1].iter().all(|size| (1_000_000..2_000_000).contains(size)), "{sizes:?}");
    assert_eq!(by_wire(&read(dir.path()).expect("all parts")), by_wire(&sent));
}

/// An MCAP file with one channel and a message.
fn mcap_with(topic: &str, encoding: &str, metadata: &[(&str, &str)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4));
    let mut writer = options.create(std::io::Cursor::new(&mut bytes)).expect("a writer");
    let metadata = metadata.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    let channel = writer.add_channel(0, topic, encoding, &metadata).expect("a channel");
    let header = MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, &[1, 2, 3]).expect("a message");
    writer.finish().expect("an end");
    drop(writer);
    bytes
}

/// As if a program had compressed it in a way that hilare does not know.
fn compressed_otherwise(mut bytes: Vec<u8>) -> Vec<u8> {
    let places: Vec<usize> =
        (0..bytes.len()).filter(|at| bytes[*at..].starts_with(b"\x03\0\0\0lz4")).collect();
    assert!(!places.is_empty());
    for at in places {
        bytes[at + 4..at + 7].copy_from_slice(b"xyz");
    }
    bytes
}

#[test]
fn what_is_no_recording_is_said_in_a_line() {
    let dir = tempfile::tempdir().expect("a directory");
    let pose = RECORDED.iter().find(|recorded| recorded.name() == "pose").expect("it is recorded");
    let layout = pose.layout();
    let file = |name: &str, bytes: &[u8]| {
        let file = dir.path().join(name);
        fs::write(&file, bytes).expect("a file");
        file
    };
    fs::create_dir(dir.path().join("nothing")).expect("a directory");
    let cases = [
        (dir.path().join("nothing"), "no recording in it (run.mcap); hilare run and hilare record make one"),
        (dir.path().join("missing.mcap"), "there is no such recording; hilare run"),
        (file("empty.mcap", b""), "is empty: nothing was recorded"),
        (file("text.mcap", b"x,y\n0,0\n1,0\n"), "is no MCAP file"),
        (file("short.mcap", &mcap::MAGIC[..5]), "is no MCAP file"),
        (
            file("foreign.mcap", &mcap_with("/imu", "cdr", &[])),
            "is no recording of hilare: it has no channels /hilare/...",
        ),
        (
            file("foreign-xyz.mcap", &compressed_otherwise(mcap_with("/imu", "cdr", &[]))),
            "is no recording of hilare: it has no channels /hilare/...",
        ),
        (
            file("xyz.mcap", &compressed_otherwise(mcap_with("/hilare/pose", "cdr", &[("layout", &layout)]))),
            "xyz",
        ),
        (
            file(
                "other.mcap",
                &mcap_with("/hilare/pose", "cdr", &[("message", "hilare/Pose/v1"), ("layout", "00ff")]),
            ),
            "/hilare/pose is hilare/Pose/v1 with layout 00ff there, hilare/Pose/v2 with layout ",
        ),
        (
            file("json.mcap", &mcap_with("/hilare/pose", "json", &[("layout", &layout)])),
            "read it with the hilare that wrote it",
        ),
        (
            file("bytes.mcap", &mcap_with("/hilare/pose", "cdr", &[("layout", &layout)])),
            "is damaged: a message of 3 bytes on /hilare/pose",
        ),
    ];
    for (file, expected) in cases {
        let error = read(&file).expect_err("no recording");
        assert!(error.contains(expected), "{error}");
        assert!(error.starts_with(&file.display().to_string()) && error.lines().count() == 1, "{error}");
    }
}

/// Every message of a damaged recording is one of the whole one, in its order; then it ends, or says why not.
fn judge(file: &Path, whole: &[(usize, Vec<u8>)], what: &str) -> (usize, bool) {
    let Ok(recording) = Recording::open(file) else { return (0, true) };
    let mut got = 0;
    for timed in recording.entries() {
        let Ok(timed) = timed else { return (got, true) };
        assert!(got < whole.len() && bits(&timed.entry) == whole[got], "{what}: message {got}");
        got += 1;
    }
    (got, false)
}

#[test]
fn damaged_recordings_are_read_as_far_as_they_are_whole() {
    let dir = tempfile::tempdir().expect("a directory");
    let (file, _) = drive(dir.path(), 0.02, &["recording.chunk_kb=64"]);
    let bytes = fs::read(&file).expect("a recording");
    let whole: Vec<_> = read(&file).expect("a recording").iter().map(bits).collect();
    let damaged = dir.path().join("damaged.mcap");
    let mut random = Random::new("damaged_recordings", 7);
    let many =
        std::env::var("HILARE_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(1500_u64);

    // Cut anywhere: the first kilobytes byte by byte, then in steps, then the end byte by byte.
    let len = bytes.len();
    let step = (len / 400).max(1);
    let cuts =
        (0..2000.min(len)).step_by(3).chain((0..len).step_by(step)).chain(len.saturating_sub(600)..len);
    let mut most = 0;
    for cut in cuts {
        fs::write(&damaged, &bytes[..cut]).expect("a file");
        let (got, refused) = judge(&damaged, &whole, &format!("cut at {cut} of {len}"));
        assert!(!refused || got == 0, "cut at {cut}: a file without its end is no error once it has begun");
        assert!(got >= most || refused, "cut at {cut}: {got} messages, {most} before");
        most = most.max(got);
    }
    assert_eq!(most, whole.len(), "all chunks were whole");

    let mut noticed = 0;
    for case in 0..many {
        let mut changed = bytes.clone();
        for _ in 0..random.whole(1, 3) {
            let place = random.whole(0, len as u64 - 1) as usize;
            changed[place] ^= random.whole(1, 255) as u8;
        }
        fs::write(&damaged, &changed).expect("a file");
        let (got, refused) = judge(&damaged, &whole, &format!("flip {case}"));
        noticed += u64::from(refused || got < whole.len());
    }
    // Most of the file is chunks, and every chunk has a checksum.
    assert!(noticed > many / 4, "{noticed} of {many} were noticed");

    // Pieces moved about: nothing is promised but an end, and messages that are messages.
    for case in 0..many {
        let mut changed = bytes.clone();
        let mut place = || random.whole(0, len as u64 - 1) as usize;
        let (from, to, at) = (place(), place(), place());
        let piece = bytes[from.min(to)..from.max(to)].to_vec();
        match case % 3 {
            0 => drop(changed.splice(at..at, piece)),
            1 => drop(changed.drain(from.min(to)..from.max(to))),
            _ => changed[at..].iter_mut().zip(piece).for_each(|(byte, other)| *byte = other),
        }
        fs::write(&damaged, &changed).expect("a file");
        if let Ok(recording) = Recording::open(&damaged) {
            for timed in recording.entries().take(10 * whole.len()) {
                let Ok(timed) = timed else { break };
                let _ = bits(&timed.entry);
            }
        }
    }
    // A length that is a lie is not taken for memory.
    let status = fs::read_to_string("/proc/self/status").expect("a kernel");
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).expect("a high-water mark");
    let kb: u64 = line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("a number");
    assert!(kb < 1_000_000, "{line}");
}
