//! A run from its directory, and from a recording of its ticks.

use super::PastRun;
use crate::config::{Scenario, Task};
use crate::recording::ros::Body;
use crate::recording::{Heard, RunInfo, Settings, Tape};
use crate::report::pictures::{PICTURES, write_plots};
use crate::report::{Counters, PlotInput, RunIdentity, Summary, write_report};
use crate::shell::in_process::InProcess;
use hilare_interfaces::latency::Quantiles;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{PathHeader, Reference, ReferenceState, Waypoint};
use hilare_recorder::RunRecord;
use std::fs;
use std::path::Path;

const NAMES: (&str, &str) = ("kanayama", "in-process");

/// Drives into a directory and, every tick, onto a tape; what became of it in both.
fn driven(dir: &Path, changes: &[&str]) -> (RunRecord, Vec<Waypoint>) {
    let mut scenario = Scenario::load("rectangle-open").unwrap();
    scenario.system.set_all(changes).unwrap();
    let Task::Follow(waypoints) = scenario.task else { panic!("a path is given") };
    let system = &scenario.system;
    let period_ticks = system.timing.period_ticks;
    let settings = Settings {
        path: dir.join("alone.mcap"),
        rotate_bytes: 0,
        rotate_ns: 0,
        queue_bytes: 1 << 20,
        chunk_bytes: 1 << 20,
        patient: true,
        body: Body::default(),
        mode: None,
    };
    let info = RunInfo {
        scenario: scenario.name.clone(),
        controller: NAMES.0.to_owned(),
        clock: NAMES.1.to_owned(),
        period_ticks,
        ..RunInfo::default()
    };
    let mut tape = Tape::begin(settings, info, system.to_toml()).unwrap();
    tape.hear(Heard::Path(&PathHeader { path_id: 1, ..PathHeader::ZERO }, &waypoints));
    let mut record = RunRecord::new(period_ticks);
    let mut heard = None;
    let mut last = Reference::ZERO;
    InProcess::new(system, &waypoints).unwrap().drive(100_000, |tick| {
        record.push(tick);
        if heard.replace(tick.reference.tick) != Some(tick.reference.tick) {
            tape.hear(Heard::Reference(tick.reference));
            last = *tick.reference;
        }
        tape.hear(Heard::Steps(tick.steps));
        tape.hear(Heard::Pose(tick.pose));
        tape.hear(Heard::Truth(tick.truth));
        tape.hand_over();
    });
    record.statistics.note_arrival();
    let tick = last.tick + period_ticks;
    tape.hear(Heard::Reference(&Reference { tick, state: ReferenceState::Arrived.code(), ..last }));
    assert_eq!(tape.finish(None).dropped, 0);
    let identity = RunIdentity { scenario: &scenario.name, controller: NAMES.0, clock: NAMES.1 };
    let figures = record.statistics.figures();
    let summary = Summary::new(identity, &figures, 2, Counters::default(), Quantiles::default());
    let input = PlotInput {
        title: &super::title(&scenario.name, NAMES.0, NAMES.1),
        waypoints: &waypoints,
        later_paths: &[],
        acceptance_radius_m: system.tracking.acceptance_radius_m,
        reference_speed_mps: system.tracking.speed_mps,
        reference_speeds: &[],
        rows: record.trace.rows(),
        map: None,
        mishaps: &[],
    };
    write_report(dir, &summary, &input, &record.trace.to_csv()).unwrap();
    fs::write(dir.join("system.toml"), system.to_toml()).unwrap();
    (record, waypoints)
}

#[test]
fn a_recording_gives_what_the_directory_gives_and_every_tick_besides() {
    let scratch = tempfile::tempdir().unwrap();
    let (record, waypoints) = driven(scratch.path(), &["plant.slip_mean=0.02"]);
    let directory = PastRun::open(scratch.path()).unwrap();
    let recording = PastRun::open(&scratch.path().join("alone.mcap")).unwrap();
    for run in [&directory, &recording] {
        assert_eq!(run.rows, record.trace.rows());
        assert_eq!((&run.waypoints, run.lacking.len()), (&waypoints, 0), "{:?}", run.lacking);
    }
    assert_eq!(recording.summary, directory.summary);
    assert_eq!(recording.system, directory.system);
    assert_eq!(recording.poses().count() as u64, record.statistics.ticks());
    assert!(recording.poses().map(|(tick, _)| tick).eq(1..=record.statistics.ticks()));
    // Nothing went amiss: both ends suffice.
    let ticks: Vec<u64> = recording.mishaps.iter().map(|row| row.tick).collect();
    assert_eq!(ticks, [1, record.statistics.ticks()]);
    // What the run has drawn is drawn again, to the byte, from either.
    let drawn = |file: &str| fs::read(scratch.path().join(file)).unwrap();
    let title = directory.title();
    for run in [&directory, &recording] {
        let again = tempfile::tempdir().unwrap();
        let written = write_plots(again.path(), &run.plot_input(&title)).unwrap();
        assert_eq!(written.len(), 3);
        for file in written {
            assert!(
                fs::read(&file).unwrap() == drawn(&file.file_name().unwrap().to_string_lossy()),
                "{file:?}"
            );
        }
    }
    let late = PICTURES.iter().find(|picture| picture.name == "late").unwrap();
    assert!(!late.can_be_drawn(&directory.plot_input("")) && late.can_be_drawn(&recording.plot_input("")));
    assert!(late.svg(&recording.plot_input(""), None).unwrap().contains("ticks lost to pauses"));
}

#[test]
fn a_directory_with_its_recording_has_every_tick_too() {
    let scratch = tempfile::tempdir().unwrap();
    let (record, _) = driven(scratch.path(), &[]);
    let (own, damaged) = (scratch.path().join("run.mcap"), scratch.path().join("damaged.mcap"));
    fs::rename(scratch.path().join("alone.mcap"), &own).unwrap();
    let run = PastRun::open(scratch.path()).unwrap();
    assert_eq!(run.poses().count() as u64, record.statistics.ticks());
    // A recording that breaks off is read as far as it goes, and it is said.
    let bytes = fs::read(&own).unwrap();
    fs::write(&damaged, &bytes[..bytes.len() * 3 / 4]).unwrap();
    let run = PastRun::open(&damaged).unwrap();
    assert!(!run.rows.is_empty() && run.rows.len() < record.trace.rows().len() && !run.summary.reached);
    assert!(run.lacking.iter().any(|what| what.contains("has no end")), "{:?}", run.lacking);
    // One that is none leaves the directory readable.
    fs::write(&own, "no recording").unwrap();
    let run = PastRun::open(scratch.path()).unwrap();
    assert_eq!(run.rows, record.trace.rows());
    assert!(run.poses.is_empty() && run.lacking[0].ends_with("; left aside"), "{:?}", run.lacking);
    let error = PastRun::open(&own).unwrap_err();
    assert!(error.contains("run.mcap") && error.lines().count() == 1, "{error}");
}
