//! Whatever bits come over its wires, the recorder puts ticks together in bounded work and memory, and its
//! figures are numbers that can be handed on.
#![allow(clippy::disallowed_methods, reason = "a test has an environment")]

use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::hostile::{cases, message, some};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Pose, Reference, ReferenceState, Steps, Truth, Waypoint};
use hilare_recorder::RunRecord;
use hilare_recorder::assembler::{Assembler, MAX_WAITING};
use hilare_recorder::statistics::RunFigures;
use hilare_recorder::trace::parse_csv;
use proptest::prelude::*;

const PERIOD: u64 = 5;

/// The messages of a tick as they should be.
fn honest(tick: u64) -> (Steps, Pose, Truth, Option<Reference>) {
    let x = tick as f64 * 4e-5;
    let steps = Steps { tick, twist: [0.04, 0.0, 0.0], ..Steps::ZERO };
    let reference = Reference {
        tick,
        state: ReferenceState::Tracking.code(),
        path_id: 1,
        index: 1,
        total: 2,
        speed_mps: 0.04,
        current: Waypoint::straight(5.0, 0.0),
        ..Reference::ZERO
    };
    let pose = WorldPose::new(x, 0.001, 0.0);
    (steps, Pose::at(tick, pose), Truth::at(tick, pose), tick.is_multiple_of(PERIOD).then_some(reference))
}

/// What happens to the messages of a tick on their way.
#[derive(Clone, Debug)]
enum Fate {
    Arrive,
    Lost(u8),
    /// And something else in its place, or before it.
    Lied(Box<(Steps, Pose, Truth, Reference)>, u8),
}

fn fate() -> impl Strategy<Value = Fate> {
    let tick = || (0u64..80).prop_map(|tick| tick / PERIOD * PERIOD);
    let lies = (
        message(tick().prop_map(|tick| honest(tick).0)),
        message(tick().prop_map(|tick| honest(tick).1)),
        message(tick().prop_map(|tick| honest(tick).2)),
        message(tick().prop_map(|tick| honest(tick).3.unwrap_or(Reference::ZERO))),
        any::<u8>(),
    );
    prop_oneof![
        8 => Just(Fate::Arrive),
        1 => any::<u8>().prop_map(Fate::Lost),
        2 => lies.prop_map(|(steps, pose, truth, reference, which)| Fate::Lied(Box::new((steps, pose, truth, reference)), which)),
    ]
}

fn push(assembler: &mut Assembler, tick: u64, fate: &Fate) {
    let (steps, pose, truth, reference) = honest(tick);
    let (lost, lied) = match fate {
        Fate::Arrive => (0, 0),
        Fate::Lost(which) => (*which, 0),
        // The upper bits say where it comes in place of the honest one. Never on all wires: they are of
        // different processes, and where all of them agree there is nothing to tell a lie by.
        Fate::Lied(_, which) => (*which & (*which >> 4), if which & 15 == 15 { 14 } else { *which }),
    };
    if let Fate::Lied(messages, _) = fate {
        let (steps, pose, truth, reference) = **messages;
        if lied & 1 != 0 {
            assembler.push_steps(steps);
        }
        if lied & 2 != 0 {
            assembler.push_pose(pose);
        }
        if lied & 4 != 0 {
            assembler.push_truth(truth);
        }
        if lied & 8 != 0 {
            assembler.push_reference(reference);
        }
    }
    if lost & 1 == 0 {
        assembler.push_steps(steps);
    }
    if lost & 2 == 0 {
        assembler.push_pose(pose);
    }
    if lost & 4 == 0 {
        assembler.push_truth(truth);
    }
    if lost & 8 == 0 {
        reference.into_iter().for_each(|reference| assembler.push_reference(reference));
    }
}

fn are_numbers(figures: &RunFigures) -> bool {
    let numbers = [
        figures.cross_track_mean_m,
        figures.cross_track_max_m,
        figures.speed_error_mean_mps,
        figures.speed_error_truth_mean_mps,
    ];
    numbers.iter().chain(&figures.final_pose).chain(&figures.final_truth).all(|number| number.is_finite())
}

proptest! {
    #![proptest_config(cases(80))]

    #[test]
    fn any_bits_end_in_figures_that_are_numbers(fates in some(fate(), 60)) {
        let mut assembler = Assembler::new(PERIOD);
        let mut record = RunRecord::new(PERIOD);
        for (tick, fate) in fates.iter().enumerate() {
            push(&mut assembler, tick as u64, fate);
            assembler.drain(|tick| record.push(tick));
            prop_assert!(assembler.waiting() <= MAX_WAITING);
        }
        let figures = record.statistics.figures();
        prop_assert!(are_numbers(&figures), "{:?}", figures);
        // What is handed on arrives.
        let text = serde_json::to_string(&figures).expect("figures are JSON");
        let back: RunFigures = serde_json::from_str(&text).expect("figures come back");
        prop_assert_eq!(back, figures);
        prop_assert_eq!(parse_csv(&record.trace.to_csv()).expect("rows come back"), record.trace.rows());
    }

    /// After whatever lies, honest ticks are put together again.
    #[test]
    fn lies_do_not_last(fates in some(fate(), 40)) {
        let mut assembler = Assembler::new(PERIOD);
        for (tick, fate) in fates.iter().enumerate() {
            push(&mut assembler, tick as u64, fate);
            assembler.drain(|_| {});
        }
        let mut last = 0;
        let start = fates.len() as u64;
        for tick in start..start + 200 {
            push(&mut assembler, tick, &Fate::Arrive);
            assembler.drain(|record| last = record.steps.tick);
        }
        prop_assert!(last >= start + 190, "stuck at {} of {}", last, start + 199);
    }
}
