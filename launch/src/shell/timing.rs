//! What a process measures of itself, in the shared page: who looks at it costs nobody anything.
//!
//! Times are taken in three places. *Taken*: how long a message was on its way, from just before it was sent
//! until its reader had it; of the clock, how late it woke. *Step*: from waking to having told everything.
//! *Age*: how old the steps were that an answer is based on when it was out; of the clock, how long a command
//! was ready before it was taken in.
//!
//! No message carries a time, so that they are the same bits in every run: when a message of a tick was sent
//! stands beside the wires, in the slot of whoever sent it.

use hilare_interfaces::block::Tick;
use hilare_interfaces::latency::{BUCKETS, LatencyHistogram, bucket};
use std::sync::atomic::{AtomicU64, Ordering};

/// Ticks of which is kept when they were told: more than a message that is not lost can be on its way.
const STAMPS: usize = 64;
/// Late wake-ups that are kept one by one.
const LATE_KEPT: u64 = 64;
/// Lateness of a wake-up from which its cause is asked for: a tenth of a tick.
pub const LATE_NS: u64 = 100_000;

/// A [`LatencyHistogram`] with one writer and any readers.
#[repr(C)]
pub struct Histogram {
    count: AtomicU64,
    max_ns: AtomicU64,
    buckets: [AtomicU64; BUCKETS],
}

impl Histogram {
    /// Counts a duration.
    #[inline]
    pub fn record(&self, ns: u64) {
        // One writer: no read-modify-write is needed.
        let add = |word: &AtomicU64| word.store(word.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
        add(&self.buckets[bucket(ns)]);
        add(&self.count);
        if ns > self.max_ns.load(Ordering::Relaxed) {
            self.max_ns.store(ns, Ordering::Relaxed);
        }
    }

    /// What was counted so far.
    pub fn snapshot(&self) -> LatencyHistogram {
        let mut copy = LatencyHistogram::ZERO;
        for (to, from) in copy.buckets.iter_mut().zip(&self.buckets) {
            *to = from.load(Ordering::Relaxed);
            copy.count += *to;
        }
        copy.max_ns = self.max_ns.load(Ordering::Relaxed);
        copy
    }
}

/// When a message of a tick was sent.
#[repr(C)]
struct Stamp {
    tick: AtomicU64,
    ns: AtomicU64,
}

/// A wake-up of the clock that was late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LateWakeUp {
    /// Ticks executed before it.
    pub tick: Tick,
    /// How late it was.
    pub late_ns: u64,
    /// The tick before was still at work when it should have begun.
    pub own_work: bool,
}

/// The measurements of one slot; all zero is valid and empty.
#[repr(C)]
pub struct Timing {
    /// See the module's head.
    pub taken: Histogram,
    /// See the module's head.
    pub step: Histogram,
    /// See the module's head.
    pub age: Histogram,
    over_budget: AtomicU64,
    phase_ns: AtomicU64,
    late_count: AtomicU64,
    late: [[AtomicU64; 3]; LATE_KEPT as usize],
    stamps: [Stamp; STAMPS],
}

impl Timing {
    /// Notes that a message of `tick` is about to be sent.
    #[inline]
    pub fn stamp(&self, tick: Tick, now_ns: u64) {
        let stamp = &self.stamps[tick as usize % STAMPS];
        stamp.ns.store(now_ns, Ordering::Relaxed);
        stamp.tick.store(tick, Ordering::Relaxed);
    }

    /// How long ago the message of `tick` was sent; `None` if that is not known any more. What the message
    /// itself came over has ordered the two.
    #[inline]
    pub fn since(&self, tick: Tick, now_ns: u64) -> Option<u64> {
        let stamp = &self.stamps[tick as usize % STAMPS];
        let sent_ns = stamp.ns.load(Ordering::Relaxed);
        (stamp.tick.load(Ordering::Relaxed) == tick && sent_ns != 0).then(|| now_ns.saturating_sub(sent_ns))
    }

    /// Counts a step, and whether it took longer than its budget.
    #[inline]
    pub fn stepped(&self, ns: u64, budget_ns: u64) {
        self.step.record(ns);
        if ns > budget_ns {
            self.over_budget.store(self.over_budget() + 1, Ordering::Relaxed);
        }
    }

    /// Of the clock: when it ticks, from the beginning of any millisecond of CLOCK_MONOTONIC.
    pub fn set_phase(&self, ns: u64) {
        self.phase_ns.store(ns, Ordering::Relaxed);
    }

    /// See [`Self::set_phase`].
    pub fn phase_ns(&self) -> u64 {
        self.phase_ns.load(Ordering::Relaxed)
    }

    /// Steps that took longer than their budget.
    pub fn over_budget(&self) -> u64 {
        self.over_budget.load(Ordering::Relaxed)
    }

    /// Keeps a late wake-up for whoever finds out why.
    pub fn woke_late(&self, wake_up: LateWakeUp) {
        let count = self.late_count.load(Ordering::Relaxed);
        let words = [wake_up.tick, wake_up.late_ns, u64::from(wake_up.own_work)];
        for (place, word) in self.late[(count % LATE_KEPT) as usize].iter().zip(words) {
            place.store(word, Ordering::Relaxed);
        }
        self.late_count.store(count + 1, Ordering::Release);
    }

    /// Late wake-ups so far.
    pub fn late_count(&self) -> u64 {
        self.late_count.load(Ordering::Acquire)
    }

    /// Those after the first `seen`, as far as they are kept.
    pub fn late_since(&self, seen: u64) -> impl Iterator<Item = LateWakeUp> {
        let count = self.late_count();
        (seen.max(count.saturating_sub(LATE_KEPT))..count).map(|n| {
            let [tick, late_ns, own_work] =
                [0, 1, 2].map(|word| self.late[(n % LATE_KEPT) as usize][word].load(Ordering::Relaxed));
            LateWakeUp { tick, late_ns, own_work: own_work != 0 }
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::shell::page::SharedPage;

    use super::*;

    #[test]
    fn what_is_recorded_is_what_is_read() {
        let page = SharedPage::create().expect("a page");
        let (timing, mut expected) = (page.timing(2), LatencyHistogram::ZERO);
        for ns in (0..5000).map(|n| n * n) {
            timing.taken.record(ns);
            expected.record(ns);
        }
        assert_eq!(timing.taken.snapshot(), expected);
        timing.stepped(10, 10);
        timing.stepped(11, 10);
        assert_eq!((timing.step.snapshot().count, timing.over_budget()), (2, 1));
    }

    #[test]
    fn a_stamp_is_of_its_tick_and_no_other() {
        let page = SharedPage::create().expect("a page");
        let timing = page.timing(0);
        assert_eq!(timing.since(0, 500), None, "nothing was told");
        (0..100).for_each(|tick| timing.stamp(tick, 1000 + tick));
        assert_eq!(timing.since(99, 1100), Some(1));
        assert_eq!(timing.since(36, 1100), Some(64));
        assert_eq!(timing.since(35, 1100), None, "too long ago");
        assert_eq!(timing.since(100, 1100), None, "not yet");
        assert_eq!(timing.since(99, 1000), Some(0), "never before it was sent");
    }

    #[test]
    fn late_wake_ups_are_kept_in_order() {
        let page = SharedPage::create().expect("a page");
        let timing = page.timing(0);
        let late = |tick| LateWakeUp { tick, late_ns: tick * 7, own_work: tick % 2 == 1 };
        (0..3).for_each(|tick| timing.woke_late(late(tick)));
        assert_eq!(timing.late_since(1).collect::<Vec<_>>(), [late(1), late(2)]);
        (3..100).for_each(|tick| timing.woke_late(late(tick)));
        let kept: Vec<_> = timing.late_since(3).collect();
        assert_eq!((kept.len(), kept[0], timing.late_count()), (64, late(36), 100));
        assert_eq!(timing.late_since(100).count(), 0);
    }
}
