//! What the relay repeats: the wires of the control path for those who only look (recorder, launch, planner,
//! `hilare topic`, programs in any language).
//!
//! A reader that joins or leaves costs a writer 90 to 140 µs inside `send`. Here it costs the relay, which
//! nobody on the tick waits for. Messages come at most some ten milliseconds after those of the wire itself.

use super::{Rate, Reader, Role, Wire, polls};
use crate::layout::WireMessage;
use crate::messages::Journal;

/// Those who see the robot from outside, whole.
const LOOKERS: &[Reader] = &[polls(Role::Recorder), polls(Role::Operator)];

/// A wire repeated: same messages, same depth.
const fn watch(wire: &Wire, name: &'static str, to: &'static [Reader], history: usize) -> Wire {
    Wire {
        name,
        message: wire.message,
        element: wire.element,
        layout_hash: wire.layout_hash,
        from: &[Role::Relay],
        to,
        rate: wire.rate,
        buffer: wire.buffer,
        history,
        doc: wire.doc,
    }
}

/// Goals, as launch passes them on.
pub const GOAL: Wire = watch(&super::GOAL, "watch/goal", LOOKERS, 0);

/// What the planner answers.
pub const ANSWER: Wire = watch(&super::ANSWER, "watch/answer", LOOKERS, 0);

/// Paths; who comes late gets the one in force.
pub const PATH: Wire = watch(&super::PATH, "watch/path", LOOKERS, 1);

/// References.
pub const REFERENCE: Wire = watch(
    &super::REFERENCE,
    "watch/reference",
    &[polls(Role::Recorder), polls(Role::Operator), polls(Role::Launch)],
    1,
);

/// Commands of every controller: of up to four on one wire, so deeper than the wire itself.
pub const COMMAND: Wire = Wire { buffer: 512, ..watch(&super::COMMAND, "watch/command", LOOKERS, 0) };

/// Who may drive; who comes late gets the last word. Deeper than the wire itself, which the relay finds full when it
/// begins.
pub const AUTHORITY: Wire = Wire { buffer: 256, ..watch(&super::AUTHORITY, "watch/authority", LOOKERS, 1) };

/// Steps.
pub const STEPS: Wire = watch(
    &super::STEPS,
    "watch/steps",
    &[polls(Role::Recorder), polls(Role::Operator), polls(Role::Launch)],
    1,
);

/// Encoders.
pub const WHEELS: Wire = watch(&super::WHEELS, "watch/wheels", LOOKERS, 0);

/// Camera.
pub const FIX: Wire = watch(&super::FIX, "watch/fix", LOOKERS, 0);

/// Estimated poses.
pub const POSE: Wire = watch(
    &super::POSE,
    "watch/pose",
    &[polls(Role::Planner), polls(Role::Recorder), polls(Role::Operator), polls(Role::Launch)],
    1,
);

/// True poses.
pub const TRUTH: Wire = watch(&super::TRUTH, "watch/truth", LOOKERS, 0);

/// How everybody fares: of all processes on one wire, so deeper than the wire itself.
pub const HEALTH: Wire = Wire { buffer: 64, ..watch(&super::HEALTH, "watch/health", LOOKERS, 0) };

/// What each box took from outside, and when. It comes from no wire: the boxes keep it in memory they share with
/// the relay, because a message more would cost the tick several microseconds.
pub const JOURNAL: Wire = Wire {
    name: "watch/journal",
    message: Journal::LAYOUT,
    element: None,
    layout_hash: Journal::LAYOUT_HASH,
    from: &[Role::Relay],
    to: LOOKERS,
    rate: Rate::OnDemand,
    buffer: 2048,
    history: 0,
    doc: "what each box took from outside, and at which tick: what a replay needs beside the wires",
};
