//! Messages that no honest program sends, for the tests of whoever reads them (feature `hostile`).
//!
//! Every bit pattern is a value of a wire message. Drawn evenly, hardly one would get beyond the first check;
//! so most are a sensible message in which some words are not.

#![allow(unsafe_code)]

use crate::layout::WireMessage;
use proptest::prelude::*;
use std::vec::Vec;

/// Cases a test runs: `HILARE_FUZZ_CASES`, or `default`.
pub fn cases(default: u32) -> ProptestConfig {
    let asked = std::env::var("HILARE_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok());
    ProptestConfig { cases: asked.unwrap_or(default), failure_persistence: None, ..ProptestConfig::default() }
}

/// Numbers that break arithmetic.
const BREAKING: &[f64] = &[
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    f64::from_bits(1),
    f64::MIN_POSITIVE,
    f64::MAX,
    f64::MIN,
    1e300,
    1e-300,
    1e154,
    -1e16,
    1e7,
    core::f64::consts::PI,
    -core::f64::consts::PI,
];

/// Any number, those that break arithmetic more often than others.
pub fn number() -> BoxedStrategy<f64> {
    prop_oneof![
        4 => proptest::sample::select(BREAKING),
        2 => any::<u64>().prop_map(f64::from_bits),
        2 => -3.0..3.0f64,
        1 => -1e7..1e7f64,
    ]
    .boxed()
}

/// Any integer, those at the ends of the range and small ones more often than others.
pub fn integer() -> BoxedStrategy<u64> {
    prop_oneof![
        2 => (0u64..4).prop_map(|n| u64::MAX - n),
        1 => (0u64..4).prop_map(|n| (1 << 63) - 2 + n),
        1 => (0u64..8).prop_map(|n| u64::from(u32::MAX) - 4 + n),
        3 => 0u64..70,
        1 => 0u64..100_000,
        2 => any::<u64>(),
    ]
    .boxed()
}

/// A word of a message.
fn word() -> BoxedStrategy<u64> {
    prop_oneof![integer(), number().prop_map(f64::to_bits)].boxed()
}

/// The words of a message.
fn words<M: WireMessage>(message: &mut M) -> &mut [u64] {
    const { assert!(align_of::<M>() == 8 && size_of::<M>().is_multiple_of(8)) }
    let (start, len) = (std::ptr::from_mut(message).cast::<u64>(), size_of::<M>() / 8);
    // SAFETY: a WireMessage has no padding and is valid for every bit pattern, so its bytes may be read and
    // written as integers; alignment and size are asserted above, the borrow is that of `message`.
    unsafe { std::slice::from_raw_parts_mut(start, len) }
}

/// `sensible` messages with up to eight words that are not, or with no sensible word at all.
pub fn message<M: WireMessage + core::fmt::Debug>(
    sensible: impl Strategy<Value = M> + 'static,
) -> BoxedStrategy<M> {
    let len = size_of::<M>() / 8;
    let some = proptest::collection::vec((0..len, word()), 0..=8);
    let edited = (sensible, some).prop_map(|(mut message, edits)| {
        for (place, word) in edits {
            words(&mut message)[place] = word;
        }
        message
    });
    let all = proptest::collection::vec(word(), len).prop_map(|all| {
        let mut message = M::ZERO;
        words(&mut message).copy_from_slice(&all);
        message
    });
    // A vector as long as a message is slow to shrink: the rarer kind.
    prop_oneof![6 => edited, 1 => all].boxed()
}

/// Between one and `most` messages in a row.
pub fn some<M: core::fmt::Debug + 'static>(
    one: impl Strategy<Value = M> + 'static,
    most: usize,
) -> BoxedStrategy<Vec<M>> {
    proptest::collection::vec(one, 1..=most).boxed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{WorldPoint, wrap_angle_rad};
    use crate::layout::WireField;
    use crate::messages::{
        Answer, Command, Drive, Fallback, GoalKind, Health, HealthState, Mode, PREVIEW, Reference,
        ReferenceState, TEXT_BYTES, field_text,
    };
    use crate::segment::Segment;

    #[test]
    fn words_cover_every_field() {
        let mut command = Command::ZERO;
        words(&mut command).fill(f64::NAN.to_bits());
        assert!(
            command.vx_mps.is_nan() && command.omega_radps.is_nan() && command.source == command.fallback
        );
        let mut answer = Answer::ZERO;
        words(&mut answer).fill(u64::MAX);
        assert!(answer.text.iter().all(|byte| *byte == 255) && answer.waypoints == u64::MAX);
    }

    fn point() -> impl Strategy<Value = WorldPoint> {
        (number(), number()).prop_map(|(x, y)| WorldPoint::new(x, y))
    }

    proptest! {
        #![proptest_config(cases(500))]

        #[test]
        fn what_readers_of_any_message_call_has_an_answer(
            health in message(Just(Health::ZERO)),
            reference in message(Just(Reference::ZERO)),
            code in integer(),
        ) {
            prop_assert!(field_text(&health.text).len() <= TEXT_BYTES);
            prop_assert!(reference.ahead().count() <= PREVIEW + 1);
            let known = [
                GoalKind::from_code(code).map(GoalKind::code),
                ReferenceState::from_code(code).map(ReferenceState::code),
                Mode::from_code(code).map(Mode::code),
                Fallback::from_code(code).map(Fallback::code),
                Drive::from_code(code).map(Drive::code),
                HealthState::from_code(code).map(HealthState::code),
            ];
            prop_assert!(known.into_iter().flatten().all(|known| known == code));
        }

        #[test]
        fn any_segment_and_angle_have_an_answer(
            from in point(), to in point(), at in point(), bulge in number(), angle in number(),
        ) {
            let segment = Segment::new(from, to, bulge);
            let _ = (segment.nearest(at), segment.point_at(angle), segment.cross_track_m(at), segment.length_m());
            let wrapped = wrap_angle_rad(angle);
            prop_assert!(!wrapped.is_finite() || wrapped.abs() <= core::f64::consts::PI);
        }
    }
}
