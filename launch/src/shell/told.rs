//! What a box told last, for its successor to tell again.
//!
//! Whoever is killed may have remembered a message that nobody has heard, and its readers may be new and hold
//! none of what it told them. The history of a wire goes with its writer. So a successor begins with the
//! messages its readers may still have to answer; those who know them pass over them.

use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::state::{StateWords, Stateful};
use hilare_interfaces::wires::SUCCESSOR_PERIODS;

/// The newest messages of as many control periods, the oldest first.
#[derive(Clone, Debug)]
pub struct Told<M> {
    newest: [Option<M>; SUCCESSOR_PERIODS],
}

impl<M: Copy> Default for Told<M> {
    fn default() -> Self {
        Self { newest: [None; SUCCESSOR_PERIODS] }
    }
}

impl<M> Told<M> {
    /// Keeps a message in the place of the oldest.
    pub fn keep(&mut self, message: M) {
        self.newest.rotate_left(1);
        self.newest[SUCCESSOR_PERIODS - 1] = Some(message);
    }

    /// Those there are.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &M> {
        self.newest.iter().flatten()
    }
}

impl<M: WireMessage> Stateful for Told<M> {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        for message in &mut self.newest {
            words.option(message, M::ZERO, |message, words| words.message(message));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::messages::{Reference, Waypoint};
    use hilare_interfaces::state::STATE_WORDS;

    #[test]
    fn the_newest_come_back_to_the_last_bit_and_in_order() {
        let mut told = Told::default();
        for tick in 1..=5 {
            assert_eq!(told.iter().count(), SUCCESSOR_PERIODS.min(tick as usize - 1));
            let mut reference = Reference { tick, index: 7, speed_mps: f64::NAN, ..Reference::default() };
            reference.preview.fill(Waypoint::straight(tick as f64, -0.0));
            told.keep(reference);
        }
        let mut room = [0; STATE_WORDS];
        let len = told.save_state(&mut room).expect("room");
        let mut other = Told::<Reference>::default();
        assert!(other.load_state(&room[..len]));
        assert_eq!(other.iter().map(|reference| reference.tick).collect::<Vec<_>>(), [3, 4, 5]);
        assert_eq!(format!("{other:?}"), format!("{told:?}"));
        assert!(!other.load_state(&room[..len - 1]));
    }
}
