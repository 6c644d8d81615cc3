//! What the relay repeats: the wires of the control path for those who only look (recorder, launch, planner,
//! `hilare topic`, programs in any language).
//!
//! A reader that joins or leaves costs a writer 90 to 140 µs inside `send`. Here it costs the relay, which
//! nobody on the tick waits for. Messages come at most some ten milliseconds after those of the wire itself.

use super::{Reader, Role, Wire, polls};

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

/// Paths; who comes late gets the one in force.
pub const PATH: Wire = watch(&super::PATH, "watch/path", &[], 1);

/// References.
pub const REFERENCE: Wire =
    watch(&super::REFERENCE, "watch/reference", &[polls(Role::Recorder), polls(Role::Launch)], 1);

/// Commands of every controller: of up to four on one wire, so deeper than the wire itself.
pub const COMMAND: Wire = Wire { buffer: 512, ..watch(&super::COMMAND, "watch/command", &[], 0) };

/// Who may drive; who comes late gets the last word. Deeper than the wire itself, which the relay finds full when it
/// begins.
pub const AUTHORITY: Wire = Wire { buffer: 256, ..watch(&super::AUTHORITY, "watch/authority", &[], 1) };

/// Steps.
pub const STEPS: Wire = watch(&super::STEPS, "watch/steps", &[polls(Role::Recorder), polls(Role::Launch)], 1);

/// Encoders.
pub const WHEELS: Wire = watch(&super::WHEELS, "watch/wheels", &[], 0);

/// Camera.
pub const FIX: Wire = watch(&super::FIX, "watch/fix", &[], 0);

/// Estimated poses.
pub const POSE: Wire =
    watch(&super::POSE, "watch/pose", &[polls(Role::Planner), polls(Role::Recorder), polls(Role::Launch)], 1);

/// True poses.
pub const TRUTH: Wire = watch(&super::TRUTH, "watch/truth", &[polls(Role::Recorder)], 0);
