//! What a box remembers, as plain words: saved by one process, loaded by the next.
//!
//! ```text
//!   box ──save_state──▶ words in shared memory ──load_state──▶ a new box of the same set-up
//!                                                              goes on, bit for bit
//! ```
//!
//! A box names what it remembers once, in [`Stateful::visit_state`]; one walk serves both directions, so
//! they cannot disagree. State is what a later step reads and nothing else tells: neither parameters, nor
//! what the next step works out anew, nor what belongs to the process (its identity, its counters).
//!
//! Words that are loaded may be anything: of another box, torn, made up. A load that finds them wrong says
//! so and leaves a box to be thrown away; none panics, and none leaves a box that does.

use crate::geometry::{BodyTwist, WorldPose};
use crate::layout::WireMessage;

/// Most words of one box.
pub const STATE_WORDS: usize = 4096;

/// A box, or part of one, whose state can be saved and loaded.
pub trait Stateful {
    /// Shows every piece of state to `words`, always in the same order. Allocates nothing. What it loads
    /// it checks, by [`StateWords::require`] or otherwise: any step must be safe afterwards.
    fn visit_state(&mut self, words: &mut StateWords<'_>);

    /// Writes the state into `room`; how many words it took, or `None` if there was no room for it or it is
    /// not one that could be loaded. Other words of `room` are left as they are.
    fn save_state(&mut self, room: &mut [u64]) -> Option<usize> {
        let mut words = StateWords::saving(room);
        self.visit_state(&mut words);
        words.finish()
    }

    /// Takes on the state in `words`, exactly those that a save took, in a box that was built alike. If
    /// false, they are not such a state: the box is then to be thrown away.
    #[must_use]
    fn load_state(&mut self, words: &[u64]) -> bool {
        let mut words = StateWords::loading(words);
        self.visit_state(&mut words);
        words.finish().is_some()
    }
}

/// A walk over the state of a box, in one direction or the other.
pub struct StateWords<'a> {
    side: Side<'a>,
    used: usize,
    sound: bool,
}

enum Side<'a> {
    Save(&'a mut [u64]),
    Load(&'a [u64]),
}

impl<'a> StateWords<'a> {
    /// Values go into `room`.
    pub const fn saving(room: &'a mut [u64]) -> Self {
        Self { side: Side::Save(room), used: 0, sound: true }
    }

    /// Values come from `words`.
    pub const fn loading(words: &'a [u64]) -> Self {
        Self { side: Side::Load(words), used: 0, sound: true }
    }

    /// True if values are being overwritten: what hangs on them is then to be worked out anew.
    pub const fn is_loading(&self) -> bool {
        matches!(self.side, Side::Load(_))
    }

    /// False once anything was wrong; what follows then means nothing.
    pub const fn is_sound(&self) -> bool {
        self.sound
    }

    /// States what is true of every valid state.
    #[inline]
    pub const fn require(&mut self, condition: bool) {
        self.sound &= condition;
    }

    /// Any word.
    #[inline]
    pub fn word(&mut self, value: &mut u64) {
        let fits = match &mut self.side {
            Side::Save(room) => room.get_mut(self.used).map(|word| *word = *value),
            Side::Load(words) => words.get(self.used).map(|word| *value = *word),
        };
        self.used += 1;
        self.require(fits.is_some());
    }

    /// Any whole number.
    #[inline]
    pub fn signed(&mut self, value: &mut i64) {
        let mut word = value.cast_unsigned();
        self.word(&mut word);
        *value = word.cast_signed();
    }

    /// Any number, by its bits: infinities and NaN with what it carries.
    #[inline]
    pub fn number(&mut self, value: &mut f64) {
        self.numbers(core::slice::from_mut(value));
    }

    /// Any numbers.
    #[inline]
    pub fn numbers(&mut self, values: &mut [f64]) {
        let end = self.used + values.len();
        let fits = match &mut self.side {
            Side::Save(room) => room.get_mut(self.used..end).map(|words| {
                words.iter_mut().zip(values).for_each(|(word, value)| *word = value.to_bits());
            }),
            Side::Load(words) => words.get(self.used..end).map(|words| {
                words.iter().zip(values).for_each(|(word, value)| *value = f64::from_bits(*word));
            }),
        };
        self.used = end;
        self.require(fits.is_some());
    }

    /// Finite numbers.
    #[inline]
    pub fn finite(&mut self, values: &mut [f64]) {
        self.numbers(values);
        self.require(values.iter().all(|value| value.is_finite()));
    }

    /// A finite pose.
    pub fn pose(&mut self, pose: &mut WorldPose) {
        let mut numbers = [pose.x_m, pose.y_m, pose.theta_rad];
        self.finite(&mut numbers);
        *pose = WorldPose::new(numbers[0], numbers[1], numbers[2]);
    }

    /// A finite twist.
    #[inline]
    pub fn twist(&mut self, twist: &mut BodyTwist) {
        let mut numbers = [twist.vx_mps, twist.vy_mps, twist.omega_radps];
        self.finite(&mut numbers);
        *twist = BodyTwist::new(numbers[0], numbers[1], numbers[2]);
    }

    /// A wire message, whatever it says.
    pub fn message<M: WireMessage>(&mut self, message: &mut M) {
        const { assert!(size_of::<M>().is_multiple_of(8) && align_of::<M>() == 8) };
        // SAFETY: a wire message is all fields without padding, aligned as a word by the assertion, and any
        // bit pattern is one.
        #[allow(unsafe_code)]
        let words = unsafe {
            core::slice::from_raw_parts_mut(core::ptr::from_mut(message).cast::<u64>(), size_of::<M>() / 8)
        };
        words.iter_mut().for_each(|word| self.word(word));
    }

    /// True or false.
    pub fn flag(&mut self, value: &mut bool) {
        self.code(value, u64::from, |code| (code < 2).then_some(code == 1));
    }

    /// A count below `below`; another one is never loaded.
    pub fn count(&mut self, value: &mut u64, below: u64) {
        let mut word = *value;
        self.word(&mut word);
        self.require(word < below);
        if word < below {
            *value = word;
        }
    }

    /// A place in something of `below` places; another one is never loaded.
    pub fn index(&mut self, value: &mut usize, below: usize) {
        let mut word = *value as u64;
        self.count(&mut word, below as u64);
        if word < below as u64 {
            *value = word as usize;
        }
    }

    /// A value that has a code; a code without meaning is never loaded.
    pub fn code<T: Copy>(&mut self, value: &mut T, code: fn(T) -> u64, meaning: fn(u64) -> Option<T>) {
        let mut word = code(*value);
        self.word(&mut word);
        match meaning(word) {
            Some(meant) => *value = meant,
            None => self.require(false),
        }
    }

    /// A value that may be missing. `blank` is what one is loaded over.
    pub fn option<T>(&mut self, value: &mut Option<T>, blank: T, visit: impl FnOnce(&mut T, &mut Self)) {
        let mut there = value.is_some();
        self.flag(&mut there);
        if !there {
            *value = None;
            return;
        }
        visit(value.get_or_insert(blank), self);
    }

    /// Ends the walk: the words used, or `None` if there was no room, or what was loaded is not the state of
    /// such a box, by its values or by their number.
    pub fn finish(self) -> Option<usize> {
        let complete = match self.side {
            Side::Save(_) => true,
            Side::Load(words) => words.len() == self.used,
        };
        (self.sound && complete).then_some(self.used)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::Fallback;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// One of everything.
    #[derive(Clone, Debug)]
    struct Sample {
        word: u64,
        signed: i64,
        number: f64,
        finite: [f64; 2],
        pose: WorldPose,
        twist: BodyTwist,
        flag: bool,
        count: u64,
        index: usize,
        why: Fallback,
        maybe: Option<f64>,
    }

    const BLANK: Sample = Sample {
        word: 0,
        signed: 0,
        number: 0.0,
        finite: [0.0; 2],
        pose: WorldPose::new(0.0, 0.0, 0.0),
        twist: BodyTwist::ZERO,
        flag: false,
        count: 0,
        index: 0,
        why: Fallback::None,
        maybe: None,
    };

    impl Stateful for Sample {
        fn visit_state(&mut self, words: &mut StateWords<'_>) {
            words.word(&mut self.word);
            words.signed(&mut self.signed);
            words.number(&mut self.number);
            words.finite(&mut self.finite);
            words.pose(&mut self.pose);
            words.twist(&mut self.twist);
            words.flag(&mut self.flag);
            words.count(&mut self.count, 7);
            words.index(&mut self.index, 5);
            words.code(&mut self.why, Fallback::code, Fallback::from_code);
            words.option(&mut self.maybe, 0.0, |number, words| words.number(number));
        }
    }

    fn filled() -> Sample {
        Sample {
            word: u64::MAX,
            signed: -3,
            // A NaN that carries something, and its sign.
            number: f64::from_bits(0xfff8_0000_dead_beef),
            finite: [-0.0, f64::MIN_POSITIVE / 8.0],
            pose: WorldPose::new(1.0, -2.0, 1e300),
            twist: BodyTwist::new(0.1, 0.2, -0.3),
            flag: true,
            count: 6,
            index: 4,
            why: Fallback::Infeasible,
            maybe: Some(f64::NEG_INFINITY),
        }
    }

    fn saved(sample: &mut Sample) -> Vec<u64> {
        let mut room = [0; STATE_WORDS];
        let used = sample.save_state(&mut room).expect("room");
        room[..used].to_vec()
    }

    #[test]
    fn every_bit_comes_back() {
        for mut sample in [filled(), Sample { maybe: None, ..filled() }, BLANK] {
            let words = saved(&mut sample);
            for mut other in [BLANK, filled()] {
                assert!(other.load_state(&words));
                assert_eq!(saved(&mut other), words);
                assert_eq!(other.number.to_bits(), sample.number.to_bits());
                assert_eq!((other.index, other.maybe), (sample.index, sample.maybe));
            }
        }
    }

    #[test]
    fn another_number_of_words_is_refused_and_too_little_room_too() {
        let mut sample = filled();
        let mut words = saved(&mut sample);
        for len in 0..words.len() {
            assert!(!BLANK.clone().load_state(&words[..len]), "{len}");
            assert_eq!(sample.save_state(&mut [0; STATE_WORDS][..len]), None, "{len}");
        }
        words.push(0);
        assert!(!BLANK.clone().load_state(&words));
    }

    #[test]
    fn what_no_state_has_is_neither_loaded_nor_saved() {
        let words = saved(&mut filled());
        let wrong = [
            (3, f64::NAN.to_bits()),
            (4, f64::INFINITY.to_bits()),
            (7, f64::NAN.to_bits()),
            (10, f64::NAN.to_bits()),
            (11, 2),
            (12, 7),
            (13, 5),
            (14, 99),
            (15, 2),
        ];
        for (at, word) in wrong {
            let mut bad = words.clone();
            bad[at] = word;
            let mut sample = BLANK;
            assert!(!sample.load_state(&bad), "{at}");
            assert!(sample.count < 7 && sample.index < 5, "{at}");
        }
        let mut infinite = Sample { finite: [f64::INFINITY, 0.0], ..filled() };
        assert_eq!(infinite.save_state(&mut [0; STATE_WORDS]), None);
    }

    proptest! {
        #[test]
        fn whatever_is_loaded_is_refused_or_saved_again_as_it_was(
            changes in proptest::collection::vec((0usize..17, prop_oneof![0u64..8, any::<u64>()]), 0..4),
            len in 0usize..20,
        ) {
            let mut words = saved(&mut filled());
            for (at, word) in changes {
                words[at] = word;
            }
            words.resize(if len < 16 { words.len() } else { len }, 0);
            let mut sample = BLANK;
            if sample.load_state(&words) {
                prop_assert_eq!(saved(&mut sample), words);
            }
        }
    }
}
