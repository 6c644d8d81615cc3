//! What each box took from outside, and when, kept beside the wires: a ring of entries a slot in the shared page.
//!
//! The boxes write, the relay reads and repeats it as `watch/journal`. An entry costs its writer some plain
//! stores; a message of its own would cost the tick several microseconds. Who writes never waits: a relay that is
//! away for longer than the ring holds loses the oldest, and the gap in the numbers shows it.

use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Journal, JournalKind};
use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Entries a slot holds: those of more than a second of the step generator with four controllers.
const ENTRIES: usize = 1024;
/// Words an entry has for what was taken.
const WORDS: usize = 6;

#[repr(C, align(64))]
struct Entry {
    tick: AtomicU64,
    kind: AtomicU64,
    words: [AtomicU64; WORDS],
}

/// The entries of one slot; all zero is valid and empty.
#[repr(C, align(128))]
pub struct JournalRing {
    /// Entries written, over all processes of the slot.
    written: AtomicU64,
    /// Entries read; a successor of the relay goes on there.
    read: AtomicU64,
    entries: [Entry; ENTRIES],
}

impl JournalRing {
    /// The box of this slot: notes what it took.
    #[inline]
    pub fn note(&self, tick: Tick, kind: JournalKind, words: &[u64]) {
        let written = self.written.load(Ordering::Relaxed);
        let entry = &self.entries[written as usize % ENTRIES];
        // Whoever reads the entry that was here sees that it is being overwritten before it sees what is new.
        self.written.store(written + 1, Ordering::Relaxed);
        fence(Ordering::Release);
        entry.tick.store(tick, Ordering::Relaxed);
        for (i, place) in entry.words.iter().enumerate() {
            place.store(words.get(i).copied().unwrap_or(0), Ordering::Relaxed);
        }
        // Last: an entry of no kind is not there yet.
        entry.kind.store(kind.code() | (written + 1) << KIND_BITS, Ordering::Release);
    }

    /// Entries written, over all processes of the slot; of its own, a writer knows them all.
    pub fn written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// The relay: the oldest entry not yet read, without slot and role.
    pub fn next(&self) -> Option<Journal> {
        loop {
            let written = self.written.load(Ordering::Acquire);
            let oldest = written.saturating_sub(ENTRIES as u64);
            let at = self.read.load(Ordering::Relaxed).max(oldest);
            if at >= written {
                return None;
            }
            let entry = &self.entries[at as usize % ENTRIES];
            let kind = entry.kind.load(Ordering::Acquire);
            let mut found = Journal { seq: at, tick: entry.tick.load(Ordering::Relaxed), ..Journal::ZERO };
            for (word, place) in found.words.iter_mut().zip(&entry.words) {
                *word = place.load(Ordering::Relaxed);
            }
            fence(Ordering::Acquire);
            if self.written.load(Ordering::Relaxed) - at > ENTRIES as u64 {
                // Overwritten meanwhile.
                continue;
            }
            if kind >> KIND_BITS != at + 1 {
                // Its writer is at it, or has died at it; then its successor's next entry shows.
                if written > at + 1 {
                    self.read.store(at + 1, Ordering::Relaxed);
                    continue;
                }
                return None;
            }
            self.read.store(at + 1, Ordering::Relaxed);
            found.kind = kind & ((1 << KIND_BITS) - 1);
            return Some(found);
        }
    }
}

/// Bits of a kind; above them stands the entry's number plus one.
const KIND_BITS: u32 = 8;

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    fn ring() -> Arc<JournalRing> {
        let zero = || AtomicU64::new(0);
        let entry = |_| Entry { tick: zero(), kind: zero(), words: std::array::from_fn(|_| zero()) };
        Arc::new(JournalRing { written: zero(), read: zero(), entries: std::array::from_fn(entry) })
    }

    #[test]
    fn entries_come_out_as_they_went_in() {
        let ring = ring();
        assert!(ring.next().is_none());
        for n in 0..5 {
            ring.note(n, JournalKind::Command, &[n, 2 * n]);
        }
        for n in 0..5 {
            let entry = ring.next().unwrap();
            assert_eq!((entry.seq, entry.tick, entry.kind), (n, n, JournalKind::Command.code()));
            assert_eq!(entry.words, [n, 2 * n, 0, 0, 0, 0]);
        }
        assert!(ring.next().is_none());
    }

    #[test]
    fn what_was_overwritten_shows_as_a_gap() {
        let ring = ring();
        for n in 0..ENTRIES as u64 + 10 {
            ring.note(n, JournalKind::Pause, &[n]);
        }
        assert_eq!(ring.next().map(|entry| (entry.seq, entry.words[0])), Some((10, 10)));
    }

    #[test]
    fn an_entry_whose_writer_died_is_passed_over() {
        let ring = ring();
        ring.note(1, JournalKind::Pause, &[1]);
        ring.next();
        ring.written.store(2, Ordering::Relaxed);
        assert!(ring.next().is_none());
        ring.note(3, JournalKind::Pause, &[3]);
        assert_eq!(ring.next().map(|entry| (entry.seq, entry.tick)), Some((2, 3)));
    }

    #[test]
    fn a_reader_beside_a_writer_sees_whole_entries_in_order() {
        const TOTAL: u64 = 300_000;
        let ring = ring();
        let done = Arc::new(AtomicBool::new(false));
        let writer = {
            let (ring, done) = (Arc::clone(&ring), Arc::clone(&done));
            std::thread::spawn(move || {
                for n in 0..TOTAL {
                    ring.note(n, JournalKind::Command, &[n, !n, n ^ 0x5555, n * 3, n, n + 1]);
                }
                done.store(true, Ordering::Release);
            })
        };
        let (mut seen, mut last) = (0, None);
        loop {
            let over = done.load(Ordering::Acquire);
            while let Some(Journal { seq: n, tick, words, .. }) = ring.next() {
                assert_eq!((tick, words), (n, [n, !n, n ^ 0x5555, n * 3, n, n + 1]));
                assert!(last.is_none_or(|last| n > last), "{n} after {last:?}");
                (seen, last) = (seen + 1, Some(n));
            }
            if over {
                break;
            }
        }
        writer.join().unwrap();
        assert!(seen >= ENTRIES as u64 && last == Some(TOTAL - 1), "{seen} of {TOTAL}, the last {last:?}");
    }
}
