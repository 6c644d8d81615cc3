//! States of replayed boxes, kept for the successors that went on from them.

use super::lives::Lives;
use hilare_interfaces::block::Tick;
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use std::collections::{BTreeMap, BTreeSet};

/// A kept state: of what kind of box, and the words.
type Kept = (u64, Vec<u64>);

/// Those some process of the run went on from, as they come.
pub struct States {
    wanted: BTreeSet<(u64, Tick)>,
    /// By place and tick.
    kept: BTreeMap<(u64, Tick), Vec<Kept>>,
    room: Box<[u64; STATE_WORDS]>,
}

impl States {
    /// None yet.
    pub fn new(lives: &Lives) -> Self {
        Self { wanted: lives.wanted_states(), kept: BTreeMap::new(), room: Box::new([0; STATE_WORDS]) }
    }

    /// True if a successor went on from the state of this place after this tick.
    pub fn wants(&self, slot: u64, tick: Tick) -> bool {
        self.wanted.contains(&(slot, tick))
    }

    /// Ticks of a place, after one and up to another, whose state a successor went on from: whatever the recording
    /// has lost, they were answered.
    pub fn wanted(&self, slot: u64, after: Option<Tick>, to: Tick) -> impl Iterator<Item = Tick> + '_ {
        let ticks = self.wanted.iter().filter(move |(place, _)| *place == slot).map(|(_, tick)| *tick);
        ticks.filter(move |tick| *tick <= to && after.is_none_or(|after| *tick > after))
    }

    /// Keeps the state of a box after a tick, if it is wanted; `key` is that of its kind.
    pub fn keep(&mut self, slot: u64, tick: Tick, key: u64, of: &mut impl Stateful) {
        if self.wants(slot, tick)
            && let Some(len) = of.save_state(&mut *self.room)
        {
            let kept = self.kept.entry((slot, tick)).or_default();
            kept.retain(|(known, _)| *known != key);
            kept.push((key, self.room[..len].to_vec()));
        }
    }

    /// Makes a box go on from a state that was kept.
    pub fn load(&self, from: (u64, Tick), key: u64, into: &mut impl Stateful) -> Result<(), String> {
        let (slot, tick) = from;
        let kept = self.kept.get(&from).and_then(|kept| kept.iter().find(|(known, _)| *known == key));
        let Some((_, words)) = kept else {
            return Err(format!(
                "it went on from the state of place {slot} at tick {tick}, which is not known"
            ));
        };
        if into.load_state(words) {
            Ok(())
        } else {
            Err(format!("the state of place {slot} at tick {tick} is not one it can go on from"))
        }
    }
}

/// Another box of the same set-up that knows what this one knows.
pub fn copied<B: Stateful>(of: &mut B, mut into: B) -> Result<B, String> {
    let mut room = vec![0; STATE_WORDS];
    let len = of.save_state(&mut room).ok_or("its state cannot be saved")?;
    if into.load_state(&room[..len]) { Ok(into) } else { Err("its state cannot be loaded".to_owned()) }
}
