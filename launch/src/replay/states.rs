//! States of replayed boxes, kept for the successors that went on from them.

use super::lives::{Life, Lives};
use super::log::RunLog;
use crate::config::System;
use crate::shell::boxes::controller::state_key;
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use crate::shell::standing::Stand;
use hilare_controller::{Controller, Identity, LawSpec};
use hilare_interfaces::block::Tick;
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use hilare_interfaces::wires::Role;
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
    /// Those of the processes that were at work when the recording began; of others none yet.
    pub fn new(log: &RunLog) -> Self {
        let mut kept: BTreeMap<(u64, Tick), Vec<Kept>> = BTreeMap::new();
        for met in &log.met {
            kept.entry(met.place).or_default().push((met.key, met.words.clone()));
        }
        Self { wanted: log.lives.wanted_states(), kept, room: Box::new([0; STATE_WORDS]) }
    }

    /// Wants the state of a place after a tick, too.
    pub fn want(&mut self, place: Option<(u64, Tick)>) {
        self.wanted.extend(place);
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
        if into.load_state(words) { Ok(()) } else { Err(unfit(from)) }
    }
}

/// What a process remembered that was at work when the recording began.
#[derive(Clone)]
pub struct Met {
    /// Its place, and the tick it had answered last.
    pub place: (u64, Tick),
    /// Of what kind of box it is.
    key: u64,
    /// Its system file, and its law (controllers).
    system: System,
    law: Option<&'static LawSpec>,
    words: Vec<u64>,
}

impl Met {
    /// From where it stood; nothing of one that had answered nothing.
    pub fn of(stand: Stand, lives: &Lives, systems: &BTreeMap<u64, System>) -> Option<Self> {
        let life = lives.all.iter().find(|life| life.met.is_some() && life.slot == stand.slot)?;
        Some(Self { words: stand.words, ..Self::at(life, life.state?, systems)? })
    }

    /// Of a process after a tick; what it remembered is still to come.
    pub fn at(life: &Life, place: (u64, Tick), systems: &BTreeMap<u64, System>) -> Option<Self> {
        let system = systems.get(&life.system)?.clone();
        let key = match life.role {
            Role::StepGenerator => key_of(MOVING),
            Role::PoseEstimator => key_of((life.role, system.estimator.name())),
            Role::Controller => state_key(&system, life.law?),
            role => key_of(role),
        };
        Some(Self { place, key, system, law: life.law, words: Vec::new() })
    }

    /// With what was kept of it.
    pub fn with(self, states: &States) -> Option<Self> {
        let mut kept = states.kept.get(&self.place)?.iter();
        let words = kept.find(|(key, _)| *key == self.key)?.1.clone();
        Some(Self { words, ..self })
    }

    /// A controller of the same law with other parameters goes on from it, as at a change of parameters; one of
    /// another law begins anew.
    pub fn hand_to(&self, life: &Life, into: &mut Controller) -> Result<(), String> {
        let same_law = self.law.filter(|law| life.law.is_some_and(|other| other.name == law.name));
        let Some(law) = same_law else { return Ok(()) };
        let (source, epoch) = (life.slot + 1, life.epoch);
        let mut before = build::controller(&self.system, law, Identity { source, epoch })?;
        if !before.load_state(&self.words) {
            return Err(unfit(self.place));
        }
        into.take_over(&mut before, &mut [0; STATE_WORDS]);
        Ok(())
    }
}

/// A step generator in motion, unlike one that a successor goes on from.
pub const MOVING: (Role, &str) = (Role::StepGenerator, "in motion");

fn unfit((slot, tick): (u64, Tick)) -> String {
    format!("the state of place {slot} at tick {tick} is not one it can go on from")
}

/// Another box of the same set-up that knows what this one knows.
pub fn copied<B: Stateful>(of: &mut B, mut into: B) -> Result<B, String> {
    let mut room = vec![0; STATE_WORDS];
    let len = of.save_state(&mut room).ok_or("its state cannot be saved")?;
    if into.load_state(&room[..len]) { Ok(into) } else { Err("its state cannot be loaded".to_owned()) }
}
