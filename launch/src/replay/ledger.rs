//! Recorded messages of a wire, ticked off as the replay makes them.

use super::fields::{Deviation, Deviations, Difference, first_difference, same};
use super::log::Dated;
use hilare_interfaces::block::Tick;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::{Range, RangeInclusive};

/// What the replay of a wire came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Name of the wire.
    pub wire: String,
    /// Messages compared with what the replay made in their place.
    pub compared: u64,
    /// Those of them that differ.
    pub differing: u64,
    /// Messages whose inputs are not whole in the recording.
    pub not_compared: u64,
    /// Messages the replay made that are not in the recording.
    pub not_recorded: u64,
    /// The first that differs, and where.
    pub first: Option<Difference>,
    /// How far its numbers are off, field by field, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub deviations: Vec<Deviation>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    Not,
    Equal,
    Differs,
}

/// Follows the messages of one wire, or of one writer on it.
pub struct Ledger<'l, M> {
    recorded: &'l [M],
    seen: Vec<Seen>,
    /// What was made in the place of a recorded message, where that differs.
    made: BTreeMap<usize, M>,
    /// Ticks of which the replay knows every message there can be.
    known: Vec<RangeInclusive<Tick>>,
    not_recorded: u64,
    deviations: Option<Deviations>,
    /// Beyond, the recording may lack what the box took.
    certain_to: Tick,
}

impl<'l, M: Dated> Ledger<'l, M> {
    /// Nothing made yet. `measures`: also how far numbers are off.
    pub fn new(recorded: &'l [M], measures: bool) -> Self {
        Self {
            recorded,
            seen: vec![Seen::Not; recorded.len()],
            made: BTreeMap::new(),
            known: Vec::new(),
            not_recorded: 0,
            deviations: measures.then(Deviations::default),
            certain_to: Tick::MAX,
        }
    }

    /// Beyond a tick, what differs is not compared: something was taken that the recording lacks.
    pub fn certain_to(&mut self, tick: Tick) {
        self.certain_to = tick;
    }

    /// The replay made a message that belongs to these places: each of them is to be the same, unless another one
    /// made for it is. A repeated message has several places.
    pub fn make(&mut self, places: Range<usize>, message: &M) {
        if places.is_empty() {
            self.not_recorded += 1;
        }
        for place in places {
            if self.seen[place] == Seen::Equal {
                continue;
            }
            let recorded = &self.recorded[place];
            if same(recorded, message) {
                self.seen[place] = Seen::Equal;
                self.made.remove(&place);
            } else if self.seen[place] == Seen::Not {
                self.seen[place] = Seen::Differs;
                self.made.insert(place, *message);
            }
            if let Some(deviations) = &mut self.deviations {
                deviations.add(recorded, message);
            }
        }
    }

    /// A tick that can be none is a lie, whatever the recording lacks.
    fn is_uncertain(&self, made: Tick, recorded: Tick) -> bool {
        let lie = self.known.iter().any(|known| *known.end() == Tick::MAX && known.contains(&recorded));
        made > self.certain_to && !lie
    }

    /// Of these ticks the replay has made every message there can be.
    pub fn know(&mut self, ticks: RangeInclusive<Tick>) {
        self.known.push(ticks);
    }

    /// What it came to.
    pub fn tally(&self, wire: &str) -> Tally {
        let mut tally = Tally {
            wire: wire.to_owned(),
            not_recorded: self.not_recorded,
            deviations: self.deviations.as_ref().map(Deviations::of::<M>).unwrap_or_default(),
            ..Tally::default()
        };
        let mut differs = |tick: Tick, what: &dyn Fn() -> Option<Difference>| {
            tally.differing += 1;
            if tally.first.as_ref().is_none_or(|first| tick < first.tick) {
                tally.first = what();
            }
        };
        for (place, recorded) in self.recorded.iter().enumerate() {
            let tick = recorded.tick();
            let made_tick = self.made.get(&place).map_or(tick, Dated::tick);
            match self.seen[place] {
                Seen::Equal => tally.compared += 1,
                _ if self.is_uncertain(made_tick, tick) => tally.not_compared += 1,
                Seen::Differs => {
                    tally.compared += 1;
                    let made = self.made.get(&place);
                    // Sorted by the tick they were made for: that of a recorded message may be what differs.
                    differs(made_tick, &|| made.and_then(|made| first_difference(made_tick, recorded, made)));
                }
                Seen::Not if self.known.iter().any(|known| known.contains(&tick)) => {
                    tally.compared += 1;
                    differs(tick, &|| {
                        Some(Difference::of_words(tick, "the message", "there", "none of this tick"))
                    });
                }
                Seen::Not => tally.not_compared += 1,
            }
        }
        tally
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;
    use hilare_interfaces::messages::Pose;

    fn pose(tick: Tick, x_m: f64) -> Pose {
        Pose { tick, x_m, ..Pose::ZERO }
    }

    #[test]
    fn a_repeated_message_is_to_be_the_same_as_any_made_for_it() {
        let recorded = [pose(1, 1.0), pose(2, 2.0), pose(2, 2.5), pose(3, 3.0)];
        let mut ledger = Ledger::new(&recorded, false);
        ledger.make(0..1, &pose(1, 1.0));
        ledger.make(1..3, &pose(2, 2.5));
        assert_eq!(ledger.tally("pose").differing, 1);
        ledger.make(1..3, &pose(2, 2.0));
        ledger.make(4..4, &pose(9, 0.0));
        let tally = ledger.tally("pose");
        assert_eq!((tally.compared, tally.differing, tally.not_compared, tally.not_recorded), (3, 0, 1, 1));
    }

    #[test]
    fn the_first_difference_is_that_of_the_lowest_tick() {
        let recorded = [pose(1, 1.0), pose(2, 2.0), pose(3, 3.0), pose(900, 0.0)];
        let mut ledger = Ledger::new(&recorded, true);
        ledger.make(2..3, &pose(3, 4.0));
        ledger.make(1..2, &pose(2, 2.25));
        ledger.make(0..1, &pose(1, 1.0));
        ledger.know(0..=1000);
        let tally = ledger.tally("pose");
        assert_eq!((tally.compared, tally.differing), (4, 3));
        let first = tally.first.unwrap();
        assert_eq!((first.tick, &*first.field, &*first.replayed), (2, "x_m", "2.25"));
        assert_eq!(tally.deviations[0].max, 1.0);
    }
}
