//! The processes of a run, from the journals of their places.

use crate::recording::Standings;
use crate::shell::standing::Stand;
use hilare_controller::{LAWS, LawSpec};
use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::{Journal, JournalKind};
use hilare_interfaces::wires::Role;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Changes of a process's parameters that are still to come: the tick from which each acts, and its system file.
#[derive(Clone, Debug, Default)]
pub struct Changes(VecDeque<(Tick, u64)>);

impl Changes {
    /// The number of the next system file that acts at `tick` or before; each once.
    pub fn due(&mut self, tick: Tick) -> Option<u64> {
        self.0.front().filter(|(from, _)| *from <= tick)?;
        self.0.pop_front().map(|(_, number)| number)
    }
}

/// A process, from the entry that says it is at work to that of its successor in the same place.
#[derive(Clone)]
pub struct Life {
    /// Its place in the system.
    pub slot: u64,
    /// Its box.
    pub role: Role,
    /// 1 for the first process of its place.
    pub incarnation: u64,
    /// Authority epoch (controllers).
    pub epoch: u64,
    /// Number of its system file.
    pub system: u64,
    /// Control law (controllers).
    pub law: Option<&'static LawSpec>,
    /// Tick at which it began.
    pub tick: Tick,
    /// The state it went on from: whose, by the place, and of which tick.
    pub state: Option<(u64, Tick)>,
    /// It was at work when the recording began, which knows where it stood: the number of the last message it had
    /// counted.
    pub met: Option<u64>,
    /// What it took from outside, in order.
    pub entries: Vec<Journal>,
    /// An entry is missing after those.
    pub broken: bool,
}

/// All processes of a run.
#[derive(Clone, Default)]
pub struct Lives {
    /// By place, then in order.
    pub all: Vec<Life>,
    /// Boxes that were at work before the recording began, by their place.
    pub earlier: BTreeMap<u64, Role>,
}

impl Lives {
    /// From the entries of all places, and from where those stood that were at work already.
    pub fn of(journal: &[Journal], standings: &Standings) -> Self {
        let mut places: BTreeMap<u64, BTreeMap<u64, &Journal>> = BTreeMap::new();
        for entry in journal {
            places.entry(entry.slot).or_default().entry(entry.seq).or_insert(entry);
        }
        let mut lives = Self::default();
        for stand in &standings.stands {
            places.entry(stand.slot).or_default();
        }
        for (slot, entries) in places {
            let stand = standings.stands.iter().find(|stand| stand.slot == slot);
            let known = stand.is_some() || standings.awaited.contains(&slot);
            // What it had noted before is in its state.
            let from = stand.map_or(0, |stand| stand.journal);
            let entries = entries.into_values().filter(|entry| entry.seq >= from);
            lives.add_place(slot, stand.and_then(Life::met), known, entries);
        }
        lives
    }

    fn add_place<'j>(
        &mut self,
        slot: u64,
        met: Option<(Life, u64)>,
        known: bool,
        entries: impl Iterator<Item = &'j Journal>,
    ) {
        let (mut life, mut next) = met.unzip();
        for entry in entries {
            let Some(role) = Role::from_code(entry.role) else { continue };
            if next.is_some_and(|next| next != entry.seq)
                && let Some(life) = &mut life
            {
                life.broken = true;
            }
            next = Some(entry.seq + 1);
            if entry.kind == JournalKind::Began.code() {
                self.all.extend(life.take());
                life = Some(Life::began(entry, role));
            } else if let Some(life) = &mut life {
                if !life.broken {
                    life.entries.push(*entry);
                }
            } else if !known {
                self.earlier.insert(slot, role);
            }
        }
        self.all.extend(life);
    }

    /// Those of a box.
    pub fn of_role(&self, role: Role) -> Vec<&Life> {
        self.all.iter().filter(|life| life.role == role).collect()
    }

    /// True if some process took in an authority of this number and hash.
    pub fn took_authority(&self, seq: u64, hash: u64) -> bool {
        let kind = JournalKind::Authority.code();
        let mut entries = self.all.iter().flat_map(|life| &life.entries);
        entries.any(|entry| entry.kind == kind && (entry.words[0], entry.words[1]) == (seq, hash))
    }

    /// The states that some process went on from: place and tick.
    pub fn wanted_states(&self) -> BTreeSet<(u64, Tick)> {
        self.all.iter().filter_map(|life| life.state).collect()
    }
}

impl Life {
    /// Its changes of parameters.
    pub fn changes(&self) -> Changes {
        let changes = self.entries.iter().filter(|entry| entry.kind == JournalKind::Param.code());
        Changes(changes.map(|entry| (entry.tick, entry.words[1])).collect())
    }

    /// A process that was at work, and the number of the first entry that is not in its state.
    fn met(stand: &Stand) -> Option<(Self, u64)> {
        let law = stand.law.as_deref().and_then(hilare_controller::law);
        let life = Self {
            slot: stand.slot,
            role: Role::from_name(&stand.role)?,
            incarnation: stand.incarnation,
            epoch: stand.epoch,
            system: stand.system,
            law,
            tick: stand.done.unwrap_or(0),
            state: stand.done.map(|done| (stand.slot, done)),
            met: Some(stand.number),
            entries: Vec::new(),
            broken: false,
        };
        Some((life, stand.journal))
    }

    fn began(entry: &Journal, role: Role) -> Self {
        let [incarnation, epoch, system, law, saved, whose] = entry.words;
        let law = law.checked_sub(1).and_then(|place| LAWS.get(place as usize));
        Self {
            slot: entry.slot,
            role,
            incarnation,
            epoch,
            system,
            law,
            tick: entry.tick,
            state: whose.checked_sub(1).zip(saved.checked_sub(1)),
            met: None,
            entries: Vec::new(),
            broken: false,
        }
    }

    /// True if a drive can begin with it: it has no predecessor, or its recording knows where it stood.
    pub fn begins_whole(&self) -> bool {
        self.state.is_none() || self.met.is_some()
    }

    /// The tick of the state it went on from: what it has answered, or rather its predecessor.
    pub fn done(&self) -> Option<Tick> {
        self.state.map(|(_, tick)| tick)
    }

    /// For people: nothing for the first of its place.
    pub fn name(&self) -> String {
        match self.incarnation {
            1 => self.role.name().to_owned(),
            n => format!("{} (process {n})", self.role.name()),
        }
    }
}

/// Ticks a process may have answered beyond the state its successor went on from: what it told last it may not have
/// remembered any more.
const UNREMEMBERED: Tick = 2;

/// The last tick the process `n` of a place can have answered.
pub fn last_tick(lives: &[&Life], n: usize, stride: u64, end: Tick) -> Tick {
    let next = lives.get(n + 1).and_then(|next| next.done());
    next.map_or(end, |done| done.saturating_add(UNREMEMBERED * stride).min(end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;

    fn entry(slot: u64, seq: u64, kind: JournalKind, words: [u64; 6]) -> Journal {
        let role = Role::StepGenerator.code();
        Journal { slot, role, seq, tick: seq * 10, kind: kind.code(), words }
    }

    #[test]
    fn a_place_has_one_process_after_the_other() {
        let journal = [
            entry(1, 4, JournalKind::Began, [2, 7, 1, 0, 41, 2]),
            entry(1, 0, JournalKind::Began, [1, 3, 1, 1, 0, 0]),
            entry(1, 1, JournalKind::Pause, [5, 0, 0, 0, 0, 0]),
            entry(1, 1, JournalKind::Pause, [5, 0, 0, 0, 0, 0]),
            entry(1, 3, JournalKind::Pause, [6, 0, 0, 0, 0, 0]),
            entry(2, 9, JournalKind::Pause, [1, 0, 0, 0, 0, 0]),
            Journal { role: 99, ..Journal::ZERO },
        ];
        let lives = Lives::of(&journal, &Standings::default());
        let [first, second] = &lives.all[..] else { panic!("{}", lives.all.len()) };
        assert_eq!((first.epoch, first.entries.len(), first.broken, first.state), (3, 1, true, None));
        assert_eq!(first.law.map(|law| law.name), Some(LAWS[0].name));
        assert_eq!((second.incarnation, second.broken, second.state), (2, false, Some((1, 40))));
        assert_eq!(lives.wanted_states().into_iter().collect::<Vec<_>>(), [(1, 40)]);
        assert_eq!(lives.earlier.keys().collect::<Vec<_>>(), [&2]);
        assert_eq!(last_tick(&[first, second], 0, 5, 1000), 50);
        assert_eq!(last_tick(&[first, second], 1, 5, 1000), 1000);
    }
}
