//! Replays of runs in one thread; those of processes are in tests/replay.rs.

use super::boxes::BoxReport;
use super::boxes::controller::Lost;
use super::closed::{Driven, drive};
use super::collect::Collector;
use super::in_process::journal;
use super::log::{Messages, RunLog, Title};
use super::report::ReplayReport;
use super::{replay, what_if};
use crate::config::{Scenario, System, Task};
use crate::shell::in_process::InProcess;
use crate::shell::{ClockKind, build};
use hilare_interfaces::block::Block;
use hilare_interfaces::layout::{WireField, WireMessage};
use hilare_interfaces::messages::{Authority, Command, Journal, JournalKind, Mode};
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use hilare_interfaces::wires::Role;
use hilare_recorder::RunRecord;
use hilare_step_generator::StepInputs;
use std::collections::BTreeMap;

/// A run in one thread as a recording has it.
pub fn recorded(scenario: &str, set: &[&str], ticks: u64) -> (System, Messages) {
    let mut scenario = Scenario::load(scenario).expect("built in");
    scenario.system.set_all(set).expect("known keys");
    let Task::Follow(waypoints) = &scenario.task else { panic!("it has no path of its own") };
    let mut robot = InProcess::new(&scenario.system, waypoints).expect("a robot");
    let mut collector = Collector::default();
    robot.run_heard(ticks, |heard| collector.hear(heard));
    (scenario.system, collector.into_messages())
}

/// The same, sorted.
pub fn log_of(system: &System, messages: Messages) -> RunLog {
    let title = Title { name: "a run".to_owned(), clock: ClockKind::InProcess };
    RunLog::new(title, BTreeMap::from([(1, system.clone())]), messages)
}

fn differing(reports: &[BoxReport]) -> Vec<String> {
    let tallies = reports.iter().flat_map(|report| {
        let named = move |tally: &super::ledger::Tally| {
            let first = tally.first.as_ref().map_or(String::new(), |first| first.in_words());
            (tally.differing > 0).then(|| format!("{} {}: {first}", report.name, tally.wire))
        };
        report.wires.iter().filter_map(named)
    });
    tallies.collect()
}

#[test]
fn every_kind_of_robot_replays_to_its_own_bits() {
    let runs: [(&str, &[&str]); 5] = [
        ("rectangle", &["plant.slip_sd=0.05"]),
        ("rectangle", &["controller.law=qp"]),
        ("line-21deg", &[]),
        ("agv-low", &[]),
        ("line-21deg", &["estimator.kind=ekf"]),
    ];
    for (scenario, set) in runs {
        let (system, messages) = recorded(scenario, set, 8_000);
        let count = messages.steps.len()
            + messages.poses.len()
            + messages.truths.len()
            + messages.references.len()
            + messages.commands.len()
            + messages.wheels.len()
            + messages.fixes.len();
        let reports = replay(&log_of(&system, messages), &Role::BOXES, false);
        assert_eq!(differing(&reports), [] as [&str; 0], "{scenario} {set:?}");
        let compared: u64 = reports
            .iter()
            .flat_map(|report| &report.wires)
            .filter(|tally| tally.wire != "taken in")
            .map(|tally| tally.compared)
            .sum();
        assert_eq!(compared, count as u64, "{scenario} {set:?}: {reports:#?}");
        assert!(reports.iter().all(|report| report.notes.is_empty()), "{reports:#?}");
    }
}

/// Flips a bit of a message.
fn flip<M: WireMessage>(message: &mut M, bit: usize) {
    let mut bytes = message.as_bytes().to_vec();
    bytes[bit / 8] ^= 1 << (bit % 8);
    *message = M::from_bytes(&bytes).expect("as many bytes");
}

/// Every bit of some messages of a wire: flipped, it is found, at its tick or before, never passed over.
fn each_flip<M: WireMessage>(
    scenario: &str,
    set: &[&str],
    of: impl Fn(&mut Messages) -> &mut Vec<M>,
    wire: &str,
    places: &[usize],
    step: usize,
) {
    let (system, messages) = recorded(scenario, set, 400);
    for place in places {
        for bit in (0..size_of::<M>() * 8).step_by(step) {
            let mut other = messages.clone();
            other.journal = journal(Some(&system), &messages);
            flip(&mut of(&mut other)[*place], bit);
            let wire_now = of(&mut other);
            // A robot that has not moved is where it was a tick before: the same message twice is no lie.
            let twice =
                wire_now.iter().filter(|known| known.as_bytes() == wire_now[*place].as_bytes()).count();
            if twice > 1 {
                continue;
            }
            let reports = replay(&log_of(&system, other), &Role::BOXES, false);
            let found = differing(&reports);
            assert!(!found.is_empty(), "{wire} {place} bit {bit}: {reports:#?}");
            let named =
                found.iter().any(|line| line.split(':').next().is_some_and(|who| who.ends_with(wire)));
            assert!(named, "{wire} {place} bit {bit}: {found:?}");
        }
    }
}

#[test]
fn a_flipped_bit_of_any_wire_is_found_and_named() {
    each_flip("rectangle", &[], |m| &mut m.steps, "steps", &[0, 123, 390], 37);
    each_flip("rectangle", &[], |m| &mut m.poses, "pose", &[123, 200], 7);
    each_flip("rectangle", &[], |m| &mut m.truths, "truth", &[123, 300], 7);
    each_flip("rectangle", &[], |m| &mut m.references, "reference", &[20, 41], 301);
    each_flip("rectangle", &[], |m| &mut m.commands, "command", &[20, 41], 7);
    each_flip("line-21deg", &[], |m| &mut m.wheels, "wheels", &[123], 7);
    each_flip("line-21deg", &["estimator.kind=ekf"], |m| &mut m.fixes, "fix", &[2], 7);
    each_flip("rectangle", &[], |m| &mut m.authorities, "taken in", &[0], 5);
}

#[test]
fn another_parameter_or_law_is_another_run() {
    let (system, messages) = recorded("rectangle", &[], 3_000);
    let log = log_of(&system, messages);
    let changes = [
        ("tracking.speed_mps=0.03", "waypoint_selector"),
        ("controller.kanayama.k1_per_s=4", "controller"),
        ("limits.v_max_mps=0.03", "step_generator"),
        ("start.x_m=0.1", "pose_estimator"),
        ("plant.slip_sd=0.02", "plant"),
    ];
    for (change, changed) in changes {
        let other = log.clone().changed(&[change.to_owned()], None).expect("a key");
        let found = differing(&replay(&other, &Role::BOXES, true));
        assert!(found.iter().any(|line| line.starts_with(changed)), "{change}: {found:?}");
    }
    let law = hilare_controller::law("stanley");
    let other = log.changed(&[], law).expect("a law");
    let reports = replay(&other, &Role::BOXES, true);
    let controller = reports.iter().find(|report| report.name.contains("stanley")).expect("it");
    assert!(controller.differing() > 100 && controller.wires[0].deviations.iter().any(|d| d.rms > 0.0));
}

#[test]
fn what_the_recording_lacks_is_not_a_difference() {
    let (system, messages) = recorded("rectangle", &[], 2_000);
    type Lose = fn(&mut Messages);
    let losses: [(&str, Lose); 6] = [
        ("steps", |m| drop(m.steps.drain(500..520))),
        ("poses", |m| drop(m.poses.drain(500..520))),
        ("truths", |m| drop(m.truths.drain(500..520))),
        ("references", |m| drop(m.references.drain(100..103))),
        ("commands", |m| drop(m.commands.drain(100..103))),
        ("the end", |m| {
            m.steps.truncate(1000);
            m.commands.truncate(150);
        }),
    ];
    for (what, lose) in losses {
        let mut other = messages.clone();
        // The journal is noted, whatever is lost.
        other.journal = journal(Some(&system), &messages);
        lose(&mut other);
        let reports = replay(&log_of(&system, other), &Role::BOXES, false);
        assert_eq!(differing(&reports), [] as [&str; 0], "{what}");
        let compared: u64 = reports.iter().map(BoxReport::compared).sum();
        assert!(compared > 3_000, "{what}: {compared}");
    }
}

/// Messages of a drive that are not the recording's, by wire.
fn parts(driven: &Driven) -> Vec<String> {
    let parted = driven.parted.iter().filter_map(|(wire, parted)| {
        parted
            .first
            .as_ref()
            .map(|first| format!("{wire}: {} of {}, {}", parted.differing, parted.compared, first.in_words()))
    });
    parted.collect()
}

#[test]
fn driven_again_without_changes_it_ends_in_the_same_bits() {
    let runs: [(&str, &[&str]); 3] =
        [("rectangle", &["plant.slip_sd=0.05"]), ("line-21deg", &["estimator.kind=ekf"]), ("agv-low", &[])];
    for (scenario, set) in runs {
        for ticks in [3_000, 200_000] {
            let (system, messages) = recorded(scenario, set, ticks);
            let count = messages.poses.len() as u64;
            let log = log_of(&system, messages);
            let driven = drive(&log, &Lost::new()).expect("it begins whole");
            assert_eq!(parts(&driven), [] as [&str; 0], "{scenario} {ticks}");
            assert_eq!(
                (driven.parted["pose"].compared, driven.ticks),
                (count, log.end),
                "{scenario} {ticks}"
            );
            let figures = |record: &RunRecord| record.statistics.figures();
            assert_eq!(figures(&driven.record), figures(&what_if::recorded(&log, 5)), "{scenario} {ticks}");
        }
    }
}

#[test]
fn with_changes_it_drives_on_until_it_arrives() {
    let (system, messages) = recorded("rectangle-open", &[], 200_000);
    let log = log_of(&system, messages);
    let slower = ["tracking.speed_mps=0.02".to_owned()];
    let compared = what_if::compare(log.clone(), &slower, None).expect("a key").what_if;
    let (was, would) = (compared.recorded, compared.changed);
    assert!(was.reached && would.reached && would.duration_s > 1.5 * was.duration_s, "{compared:?}");
    assert!(compared.parted.is_some_and(|first| first.tick < 200));
    // It is what the run would have been.
    let (_, slow) = recorded("rectangle-open", &["tracking.speed_mps=0.02"], 200_000);
    let mut slow_system = system.clone();
    slow_system.set_all(&slower).expect("a key");
    let run = what_if::recorded(&log_of(&slow_system, slow), 5).statistics.figures();
    assert_eq!(would, run.into());

    let other = what_if::compare(log.clone(), &[], hilare_controller::law("qp")).expect("a law").what_if;
    let (_, qp) = recorded("rectangle-open", &["controller.law=qp"], 200_000);
    assert_eq!(other.changed, what_if::recorded(&log_of(&system, qp), 5).statistics.figures().into());
    // Another control period: nothing of the recorded ticks holds.
    let period = what_if::compare(log, &["timing.period_ticks=10".to_owned()], None).expect("a key").what_if;
    assert!(period.changed.reached, "{period:?}");
}

/// A step generator's own run: what it told, and the journal of its two processes.
fn with_a_successor(system: &System) -> Messages {
    let mut messages = Messages::default();
    let role = Role::StepGenerator.code();
    let note = |journal: &mut Vec<Journal>, tick, kind: JournalKind, words: &[u64]| {
        let mut entry =
            Journal { slot: 5, role, seq: journal.len() as u64, tick, kind: kind.code(), ..Journal::ZERO };
        entry.words[..words.len()].copy_from_slice(words);
        journal.push(entry);
    };
    let mut generator = build::step_generator(system, ClockKind::Real);
    for (life, ticks) in [(1, 0..100), (2, 100..260)] {
        let mut room = vec![0; STATE_WORDS];
        let saved = if life == 1 { [0, 0] } else { [101, 6] };
        if life == 2 {
            let len = generator.save_state(&mut room).expect("room");
            generator = build::step_generator(system, ClockKind::Real);
            assert!(generator.load_state(&room[..len]));
        }
        note(&mut messages.journal, ticks.start, JournalKind::Began, &[life, life, 1, 0, saved[0], saved[1]]);
        messages.steps.push(*generator.state());
        for tick in ticks {
            if tick % 20 == 0 {
                let seq = tick / 20 + 1;
                let mode = Mode::Armed.code();
                let authority = Authority { seq, mode, term: life, source: 1, epoch: 1, ..Authority::ZERO };
                let words = [seq, authority.content_hash()];
                note(&mut messages.journal, tick, JournalKind::Authority, &words);
                messages.authorities.push(authority);
                let authority = Some(&authority);
                generator.take_in(tick, StepInputs { authority, ..StepInputs::default() });
            }
            if tick % 5 == 0 {
                let command = Command {
                    source: 1,
                    epoch: 1,
                    seq: tick / 5 + 1,
                    pose_tick: tick,
                    effective_tick: tick + 5,
                    vx_mps: 0.03 + tick as f64 * 1e-5,
                    ..Command::ZERO
                };
                let words = [1, 1, command.seq, command.content_hash()];
                note(&mut messages.journal, tick, JournalKind::Command, &words);
                messages.commands.push(command);
                generator.take_in(tick, StepInputs { commands: &[command], ..StepInputs::default() });
            }
            let paused_ticks = if tick % 50 == 33 { tick % 7 } else { 0 };
            if paused_ticks > 0 {
                note(&mut messages.journal, tick, JournalKind::Pause, &[paused_ticks]);
            }
            messages.steps.push(generator.step(tick, StepInputs { paused_ticks, ..StepInputs::default() }));
        }
    }
    messages
}

#[test]
fn a_successor_of_the_step_generator_goes_on_from_its_state() {
    let system = System::default();
    let messages = with_a_successor(&system);
    assert!(messages.steps.last().is_some_and(|last| last.counts[0] > 50 && last.paused_ticks > 5));
    let title = Title { name: "a run".to_owned(), clock: ClockKind::Real };
    let log = |messages| RunLog::new(title.clone(), BTreeMap::from([(1, system.clone())]), messages);
    let reports = replay(&log(messages.clone()), &[Role::StepGenerator], false);
    assert_eq!(differing(&reports), [] as [&str; 0]);
    assert_eq!((reports[0].wires[0].compared, reports[0].wires[0].not_compared), (262, 0), "{reports:#?}");
    // Without what its predecessor did, or with a gap in the journal, it is not compared.
    let mut without = messages.clone();
    without.journal.retain(|entry| entry.seq > 20);
    let reports = replay(&log(without), &[Role::StepGenerator], false);
    assert_eq!((reports[0].compared(), reports[0].notes.len()), (0, 2), "{reports:#?}");
    let mut gap = messages;
    gap.journal.remove(12);
    let reports = replay(&log(gap), &[Role::StepGenerator], false);
    assert!(reports[0].differing() == 0 && reports[0].wires[0].not_compared > 100, "{reports:#?}");
}

/// A run whose controller is a program that is not ours: nobody has noted its beginning.
fn driven_by_a_program() -> (RunLog, RunLog) {
    let (system, mut messages) = recorded("rectangle-open", &[], 200_000);
    let ours = log_of(&system, messages.clone());
    messages.journal = journal(Some(&system), &messages);
    messages.journal.retain(|entry| entry.role != Role::Controller.code());
    (ours, log_of(&system, messages))
}

#[test]
fn another_law_drives_in_place_of_a_program_that_is_not_ours() {
    let (ours, program) = driven_by_a_program();
    let qp = hilare_controller::law("qp");
    let wanted = what_if::compare(ours, &[], qp).expect("a law").what_if;
    let found = what_if::compare(program, &[], qp).expect("a law").what_if;
    assert!(found.parted.is_some(), "another law is another drive");
    assert_eq!(found.changed, wanted.changed);
    assert_eq!(found.notes, [] as [&str; 0]);
}

#[test]
fn a_program_s_commands_are_as_given_whatever_is_set_and_judged_by_what_they_followed() {
    let (_, program) = driven_by_a_program();
    let slow = ["tracking.speed_mps=0.01".to_owned()];
    let found = what_if::compare(program, &slow, None).expect("a key").what_if;
    assert_eq!(found.changed, found.recorded);
    assert_eq!(found.parted, None);
    let [note] = &found.notes[..] else { panic!("{:?}", found.notes) };
    assert!(note.contains("taken as given") && note.contains("--controller LAW"), "{note}");
}

#[test]
fn a_change_of_the_recording_that_is_overruled_is_said() {
    let (system, mut messages) = recorded("rectangle-open", &[], 3_000);
    messages.journal = journal(Some(&system), &messages);
    let last = messages.journal.iter().rfind(|entry| entry.role == Role::WaypointSelector.code());
    let last = *last.expect("it has begun");
    let kind = JournalKind::Param.code();
    messages.journal.push(Journal {
        seq: last.seq + 1,
        tick: 500,
        kind,
        words: [1, 2, 500, 0, 0, 0],
        ..last
    });
    let mut slower = system.clone();
    slower.set_all(&["tracking.speed_mps=0.02"]).expect("a key");
    let title = Title { name: "a run".to_owned(), clock: ClockKind::InProcess };
    let log = RunLog::new(title, BTreeMap::from([(1, system), (2, slower)]), messages);
    let notes_of = |set: &str| {
        let set = [set.to_owned()];
        what_if::compare(log.clone(), &set, None).expect("a key").what_if.notes
    };
    let notes = notes_of("tracking.speed_mps=0.03");
    let [note] = &notes[..] else { panic!("{notes:?}") };
    assert!(note.starts_with("tracking.speed_mps was changed to 0.02 at tick 500"), "{note}");
    assert_eq!(notes_of("limits.v_max_mps=0.05"), [] as [&str; 0], "of another key nothing is said");
}

#[test]
fn the_verdict_says_how_much_was_not_compared() {
    let (system, messages) = recorded("rectangle", &[], 2_000);
    let verdict = |messages: Messages| {
        let log = log_of(&system, messages);
        let text = ReplayReport::new(&log, Vec::new(), replay(&log, &Role::BOXES, false)).to_text();
        text.lines().last().unwrap_or_default().to_owned()
    };
    // The path is from outside.
    let said = verdict(messages.clone());
    assert!(said.ends_with("messages; 1 not compared: see above."), "{said}");
    let mut without = messages;
    without.journal = journal(Some(&system), &without);
    without.journal.retain(|entry| entry.role != Role::PoseEstimator.code());
    let poses = without.poses.len();
    let wanted = format!("messages; {} not compared: see above.", poses + 1);
    let said = verdict(without);
    assert!(said.starts_with("Bit for bit the same: ") && said.ends_with(&wanted), "{said}");
}
