//! What only can be seen from inside: a disk that is slow, full, or gone.

use super::part::Part;
use super::ros::Body;
use super::*;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Pose, Steps};
use std::fs;
use std::path::PathBuf;
use std::time::Duration;

fn settings(path: PathBuf) -> Settings {
    Settings {
        path,
        rotate_bytes: 0,
        rotate_ns: 0,
        queue_bytes: 200_000,
        chunk_bytes: 50_000,
        body: Body::default(),
        patient: false,
        mode: None,
    }
}

fn info() -> RunInfo {
    RunInfo { recording: "test".into(), period_ticks: 5, ..RunInfo::default() }
}

fn hear_ticks(tape: &mut Tape, ticks: std::ops::Range<u64>) {
    for tick in ticks {
        tape.hear(Heard::Steps(&Steps { tick, ..Steps::ZERO }));
        tape.hear(Heard::Pose(&Pose { tick, ..Pose::ZERO }));
        if tick % 10 == 9 {
            tape.hand_over();
        }
    }
}

/// Ticks of the steps in a recording, and sequence numbers that were passed over.
fn read_back(file: &Path) -> (Vec<u64>, u64) {
    let (mut ticks, mut next, mut skipped) = (Vec::new(), 0, 0);
    for timed in Recording::open(file).unwrap().entries() {
        let timed = timed.unwrap();
        if let Entry::Steps(steps) = timed.entry {
            skipped += u64::from(timed.sequence - next);
            next = timed.sequence + 1;
            ticks.push(steps.tick);
        }
    }
    (ticks, skipped)
}

#[test]
fn a_disk_that_is_too_slow_drops_nothing_silently() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("run.mcap");
    let hindrance = || std::thread::sleep(Duration::from_millis(3));
    let mut tape = Tape::begin_with(settings(file.clone()), info(), String::new(), hindrance).unwrap();
    // Far faster than 10 ticks in 3 ms; then the disk catches up.
    hear_ticks(&mut tape, 0..20_000);
    while tape.waiting() > 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    hear_ticks(&mut tape, 20_000..20_100);
    let report = tape.finish(None);
    let steps = report.wires.iter().find(|wire| wire.wire == "steps").unwrap();
    assert!(steps.dropped > 1000 && steps.messages > 300, "{steps:?}");
    assert_eq!(steps.messages + steps.dropped, 20_100);
    assert_eq!((report.gaps, report.complete), (0, false), "{report:?}");
    assert!(report.why.starts_with("given up, the disk was too slow: "), "{}", report.why);
    let (ticks, skipped) = read_back(&file);
    // Whoever reads sees how much is missing, and where.
    assert_eq!((ticks.len() as u64, skipped), (steps.messages, steps.dropped));
    assert!(ticks.windows(2).all(|pair| pair[1] > pair[0]) && ticks.last() == Some(&20_099));
}

#[test]
fn in_virtual_time_a_slow_disk_is_waited_for() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("run.mcap");
    let hindrance = || std::thread::sleep(Duration::from_micros(300));
    let patient = Settings { patient: true, ..settings(file.clone()) };
    let mut tape = Tape::begin_with(patient, info(), String::new(), hindrance).unwrap();
    hear_ticks(&mut tape, 0..20_000);
    let report = tape.finish(None);
    assert!(report.complete && report.messages == 40_000, "{report:?}");
    assert_eq!(read_back(&file), ((0..20_000).collect(), 0));
}

#[test]
fn a_disk_that_hangs_is_given_up_at_the_end() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("run.mcap");
    let hindrance = || std::thread::sleep(Duration::from_secs(3600));
    let mut tape = Tape::begin_with(settings(file), info(), String::new(), hindrance).unwrap();
    hear_ticks(&mut tape, 0..100);
    let report = tape.finish(Some(Duration::from_millis(50)));
    assert!(!report.complete && report.why.contains("did not take the rest"), "{report:?}");
}

#[test]
fn a_file_that_is_taken_away_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("run");
    fs::create_dir(&folder).unwrap();
    let file = folder.join("run.mcap");
    let mut tape = Tape::begin(settings(file), info(), String::new()).unwrap();
    hear_ticks(&mut tape, 0..100);
    fs::remove_dir_all(&folder).unwrap();
    hear_ticks(&mut tape, 100..200);
    let report = tape.finish(None);
    assert!(!report.complete && report.why.contains("somebody has taken the file away"), "{report:?}");
}

#[test]
fn a_directory_that_is_gone_when_a_new_part_begins_ends_the_recording() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("run");
    fs::create_dir(&folder).unwrap();
    let rotated = Settings { rotate_ns: 1_000_000_000, patient: true, ..settings(folder.join("run.mcap")) };
    let mut tape = Tape::begin(rotated, info(), String::new()).unwrap();
    hear_ticks(&mut tape, 0..900);
    fs::remove_dir_all(&folder).unwrap();
    hear_ticks(&mut tape, 900..2000);
    let report = tape.finish(None);
    let steps = report.wires.iter().find(|wire| wire.wire == "steps").unwrap();
    assert!(!report.complete && steps.refused >= 1000, "{report:?}");
    assert_eq!(steps.messages + steps.refused, 2000);
}

#[test]
fn a_part_that_is_left_is_readable_to_its_last_chunk() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("run.mcap");
    let small = Settings { chunk_bytes: 20_000, ..settings(file.clone()) };
    let mut part = Part::create(&file, &small, &info(), "robot = \"a\"", &ros::channels()).unwrap();
    let mut cdr = Vec::new();
    for tick in 0..500 {
        cdr.clear();
        let steps = Steps { tick, ..Steps::ZERO };
        cdr::write_message(&mut cdr, Heard::Steps(&steps).bytes(), None);
        part.write(Heard::Steps(&steps).place(), tick as u32, tick, &cdr).unwrap();
    }
    let whole = part.abandon();
    drop(part);
    assert_eq!(fs::metadata(&file).unwrap().len(), whole);
    let recording = Recording::open(&file).unwrap();
    assert_eq!(recording.truncated(), Some(file.as_path()));
    assert_eq!(recording.system(), Some("robot = \"a\""));
    let (ticks, _) = read_back(&file);
    assert!(ticks.len() > 400 && ticks.iter().copied().eq(0..ticks.len() as u64), "{ticks:?}");
}

#[test]
fn time_goes_with_the_ticks_and_what_has_none_goes_with_the_newest() {
    use hilare_interfaces::messages::{Authority, PathHeader, Waypoint};
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("run.mcap");
    let mut tape = Tape::begin(settings(file.clone()), info(), String::new()).unwrap();
    tape.hear(Heard::Path(&PathHeader::ZERO, &[Waypoint::ZERO; 3]));
    // Joined in mid-drive.
    for tick in 70_000..70_010 {
        tape.hear(Heard::Steps(&Steps { tick, ..Steps::ZERO }));
    }
    tape.hear(Heard::Authority(&Authority::ZERO));
    assert!(tape.finish(None).complete);
    let timed: Vec<Timed> = Recording::open(&file).unwrap().entries().map(Result::unwrap).collect();
    let began = timed[1].log_time_ns;
    assert!(timed[0].log_time_ns <= began);
    assert!(matches!(&timed[0].entry, Entry::Path(_, waypoints) if waypoints.len() == 3));
    for (n, steps) in timed[1..=10].iter().enumerate() {
        assert_eq!(steps.log_time_ns, began + n as u64 * 1_000_000);
        assert_eq!(steps.entry.tick(), Some(70_000 + n as u64));
    }
    assert_eq!(timed[11].entry, Entry::Authority(Authority::ZERO));
    assert_eq!(timed[11].log_time_ns, began + 9_000_000);
}
