//! What a box remembers, kept where its death does not reach: two copies a slot in the shared page.
//!
//! After a step the worker writes its box's state over the older copy. Whoever is killed while writing
//! leaves the other copy whole; its successor goes on from there with the messages that came since. A
//! controller that is to stand by takes the state of the one in charge, if both are of the same law.
//!
//! A copy is guarded by a version that is odd while it is written (a sequence lock): readers never wait.

use hilare_interfaces::block::Tick;
use hilare_interfaces::state::STATE_WORDS;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::atomic::{AtomicU64, Ordering, fence};

/// The state of one box after one tick.
#[repr(C)]
struct Snapshot {
    /// Odd while it is written; the higher of two even ones is the newer.
    version: AtomicU64,
    /// Of what kind of box it is.
    key: AtomicU64,
    tick: AtomicU64,
    len: AtomicU64,
    words: [AtomicU64; STATE_WORDS],
}

/// The states of one slot; all zero is valid and empty.
#[repr(C)]
pub struct Area {
    copies: [Snapshot; 2],
}

/// Room for a state on its way.
pub struct StateRoom(Box<[u64; STATE_WORDS]>);

impl Default for StateRoom {
    fn default() -> Self {
        Self(Box::new([0; STATE_WORDS]))
    }
}

impl StateRoom {
    /// All of it, to save into.
    pub fn all(&mut self) -> &mut [u64] {
        &mut *self.0
    }

    /// Its first words.
    pub fn first(&self, len: usize) -> &[u64] {
        &self.0[..len.min(STATE_WORDS)]
    }
}

/// Key of what must agree for a state to be of use, within one build of hilare.
pub fn key_of(parts: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    (parts, STATE_WORDS, env!("CARGO_PKG_VERSION")).hash(&mut hasher);
    // 0 is an area nobody has written.
    hasher.finish() | 1
}

impl Area {
    /// Keeps a state; the one before stays until the next.
    pub fn store(&self, key: u64, tick: Tick, words: &[u64]) {
        let versions = [0, 1].map(|n: usize| self.copies[n].version.load(Ordering::Relaxed));
        let whole = |n: &usize| versions[*n].is_multiple_of(2);
        let newest = [0, 1].into_iter().filter(whole).max_by_key(|n| versions[*n]);
        let copy = &self.copies[1 - newest.unwrap_or(1)];
        let next = (versions[0].max(versions[1]) + 2) & !1;
        copy.version.store(next - 1, Ordering::Relaxed);
        fence(Ordering::Release);
        copy.key.store(key, Ordering::Relaxed);
        copy.tick.store(tick, Ordering::Relaxed);
        copy.len.store(words.len() as u64, Ordering::Relaxed);
        for (place, word) in copy.words.iter().zip(words) {
            place.store(*word, Ordering::Relaxed);
        }
        copy.version.store(next, Ordering::Release);
    }

    /// The newest whole state of a kind whose tick is wanted: its tick and number of words.
    pub fn load(
        &self,
        key: u64,
        wanted: impl Fn(Tick) -> bool,
        room: &mut StateRoom,
    ) -> Option<(Tick, usize)> {
        let mut order = [0, 1];
        order.sort_by_key(|n| std::cmp::Reverse(self.copies[*n].version.load(Ordering::Relaxed)));
        order.into_iter().find_map(|n| self.copies[n].read(key, &wanted, room))
    }
}

impl Snapshot {
    fn read(&self, key: u64, wanted: impl Fn(Tick) -> bool, room: &mut StateRoom) -> Option<(Tick, usize)> {
        let version = self.version.load(Ordering::Acquire);
        let (found, tick) = (self.key.load(Ordering::Relaxed), self.tick.load(Ordering::Relaxed));
        let len = self.len.load(Ordering::Relaxed) as usize;
        if version == 0 || version % 2 == 1 || found != key || !wanted(tick) || len > STATE_WORDS {
            return None;
        }
        for (word, place) in room.0.iter_mut().zip(&self.words[..len]) {
            *word = place.load(Ordering::Relaxed);
        }
        fence(Ordering::Acquire);
        (self.version.load(Ordering::Relaxed) == version).then_some((tick, len))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::page::SharedPage;

    fn load(area: &Area, key: u64, wanted: impl Fn(Tick) -> bool) -> Option<(Tick, Vec<u64>)> {
        let mut room = StateRoom::default();
        area.load(key, wanted, &mut room).map(|(tick, len)| (tick, room.first(len).to_vec()))
    }

    #[test]
    fn the_newest_two_states_are_there_and_no_other() {
        let page = SharedPage::create().unwrap();
        let area = page.area(3);
        assert_eq!(load(area, 1, |_| true), None);
        for tick in 1..10 {
            area.store(1, tick, &[tick; 7][..tick as usize % 7]);
        }
        assert_eq!(load(area, 1, |_| true), Some((9, vec![9; 2])));
        assert_eq!(load(area, 1, |tick| tick == 8), Some((8, vec![8; 1])));
        assert_eq!(load(area, 1, |tick| tick == 7), None);
        assert_eq!(load(area, 2, |_| true), None, "of another kind");
        assert_eq!(load(page.area(4), 1, |_| true), None, "of another slot");
    }

    #[test]
    fn a_writer_killed_in_the_middle_leaves_the_state_before() {
        let page = SharedPage::create().unwrap();
        let area = page.area(0);
        area.store(1, 1, &[1; 100]);
        area.store(1, 2, &[2; 100]);
        for copy in [0, 1] {
            // Torn: the version is left odd.
            let torn = &area.copies[copy].version;
            let before = torn.load(Ordering::Relaxed);
            torn.store(before | 1, Ordering::Relaxed);
            let (tick, words) = load(area, 1, |_| true).expect("the other one");
            assert_eq!(words, vec![tick; 100]);
            area.store(1, 3, &[3; 100]);
            assert_eq!(load(area, 1, |_| true), Some((3, vec![3; 100])));
            area.store(1, 2, &[2; 100]);
        }
    }

    #[test]
    fn a_reader_beside_a_writer_sees_whole_states_only() {
        let page = SharedPage::create().unwrap();
        let area = page.area(0);
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for tick in 1..20_000 {
                    area.store(1, tick, &[tick; 300]);
                }
            });
            let mut newest = 0;
            while !writer.is_finished() {
                if let Some((tick, words)) = load(area, 1, |_| true) {
                    assert!(words.iter().all(|word| *word == tick), "torn at {tick}");
                    assert!(tick + 1 >= newest);
                    newest = tick;
                }
            }
        });
        assert_eq!(load(area, 1, |_| true).map(|(tick, _)| tick), Some(19_999));
    }
}
