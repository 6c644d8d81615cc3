//! Puts the messages of one tick together.
//!
//! Wires are read one after the other, so at any moment one of them is ahead. Messages wait here
//! until their tick is complete; a tick whose messages were lost is counted, never guessed.

use crate::TickRecord;
use hilare_interfaces::messages::{Pose, Reference, Steps, Truth};
use std::collections::VecDeque;

/// Messages waiting for the rest of their tick.
#[derive(Debug)]
pub struct Assembler {
    period_ticks: u64,
    /// Steps, poses, truths waiting, oldest first.
    pub steps: VecDeque<Steps>,
    /// Poses waiting.
    pub poses: VecDeque<Pose>,
    /// Truths waiting.
    pub truths: VecDeque<Truth>,
    /// References waiting; the first may be the one in force.
    pub references: VecDeque<Reference>,
    next_tick: u64,
    gaps: u64,
}

impl Assembler {
    /// Nothing waiting; the first tick to deliver is tick 1 (message 0 precedes the first tick).
    pub fn new(period_ticks: u64) -> Self {
        Self {
            period_ticks,
            steps: VecDeque::new(),
            poses: VecDeque::new(),
            truths: VecDeque::new(),
            references: VecDeque::new(),
            next_tick: 1,
            gaps: 0,
        }
    }

    /// Ticks that could not be put together because a message was lost.
    pub fn gaps(&self) -> u64 {
        self.gaps
    }

    /// Ticks delivered or given up.
    pub fn done(&self) -> u64 {
        self.next_tick - 1
    }

    /// Hands every complete tick to `deliver`, in order.
    pub fn drain(&mut self, deliver: impl FnMut(TickRecord<'_>)) {
        self.deliver(false, deliver);
    }

    /// The same at the end, when no message will come any more.
    pub fn finish(&mut self, deliver: impl FnMut(TickRecord<'_>)) {
        self.deliver(true, deliver);
    }

    fn deliver(&mut self, over: bool, mut deliver: impl FnMut(TickRecord<'_>)) {
        loop {
            let tick = self.next_tick;
            // The reference in force during tick n was chosen on the pose before it.
            let chosen_at = (tick - 1) / self.period_ticks * self.period_ticks;
            while self.steps.front().is_some_and(|m| m.tick < tick) {
                self.steps.pop_front();
            }
            while self.poses.front().is_some_and(|m| m.tick < tick) {
                self.poses.pop_front();
            }
            while self.truths.front().is_some_and(|m| m.tick < tick) {
                self.truths.pop_front();
            }
            // While its box is away, the reference before stays in force.
            while self.references.get(1).is_some_and(|m| m.tick <= chosen_at) {
                self.references.pop_front();
            }
            let settled = |m: &Reference| m.tick == chosen_at || over || self.references.len() > 1;
            if !self.references.front().is_some_and(settled) {
                return;
            }
            let (Some(steps), Some(pose), Some(truth), Some(reference)) =
                (self.steps.front(), self.poses.front(), self.truths.front(), self.references.front())
            else {
                return;
            };
            let complete =
                steps.tick == tick && pose.tick == tick && truth.tick == tick && reference.tick <= chosen_at;
            if complete {
                deliver(TickRecord { steps, pose, truth, reference });
            } else {
                // Every wire is past this tick, one of them without having had it.
                self.gaps += 1;
            }
            self.next_tick += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;

    fn push(assembler: &mut Assembler, tick: u64) {
        assembler.steps.push_back(Steps { tick, ..Steps::ZERO });
        assembler.poses.push_back(Pose { tick, ..Pose::ZERO });
        assembler.truths.push_back(Truth { tick, ..Truth::ZERO });
    }

    #[test]
    fn ticks_come_in_order_with_the_reference_in_force() {
        let mut assembler = Assembler::new(5);
        let mut seen = Vec::new();
        for tick in 0..=12 {
            push(&mut assembler, tick);
            if tick % 5 == 0 {
                assembler.references.push_back(Reference { tick, ..Reference::ZERO });
            }
            assembler.drain(|record| seen.push((record.steps.tick, record.pose.tick, record.reference.tick)));
        }
        let expected: Vec<_> = (1..=12).map(|n| (n, n, (n - 1) / 5 * 5)).collect();
        assert_eq!(seen, expected);
        assert_eq!(assembler.gaps(), 0);
    }

    #[test]
    fn a_lost_message_is_a_counted_gap() {
        let mut assembler = Assembler::new(5);
        assembler.references.push_back(Reference::ZERO);
        for tick in 0..=4 {
            push(&mut assembler, tick);
        }
        assembler.poses.remove(2);
        let mut seen = Vec::new();
        assembler.drain(|record| seen.push(record.steps.tick));
        assert_eq!((seen, assembler.gaps(), assembler.done()), (vec![1, 3, 4], 1, 4));
    }

    #[test]
    fn it_waits_for_the_slowest_wire() {
        let mut assembler = Assembler::new(5);
        assembler.references.push_back(Reference::ZERO);
        for tick in 0..=4 {
            push(&mut assembler, tick);
        }
        let late = assembler.truths.pop_back();
        let mut seen = 0;
        assembler.drain(|_| seen += 1);
        assert_eq!((seen, assembler.gaps()), (3, 0));
        assembler.truths.extend(late);
        assembler.drain(|_| seen += 1);
        assert_eq!((seen, assembler.gaps()), (4, 0));
    }

    #[test]
    fn while_the_selector_is_away_the_reference_before_stays_in_force() {
        let mut assembler = Assembler::new(5);
        let mut seen = Vec::new();
        for tick in 0..=22 {
            push(&mut assembler, tick);
            // None for 5 and 10, none at the end.
            if [0, 15].contains(&tick) {
                assembler.references.push_back(Reference { tick, ..Reference::ZERO });
            }
            assembler.drain(|record| seen.push(record.reference.tick));
            let done = [0, 1, 2, 3, 4, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 15, 16, 17, 18, 19, 20, 20, 20];
            assert_eq!(assembler.done(), done[tick as usize], "after tick {tick}");
        }
        assembler.finish(|record| seen.push(record.reference.tick));
        let expected: Vec<_> = (1..=22).map(|n| if n <= 15 { 0 } else { 15 }).collect();
        assert_eq!((seen, assembler.gaps()), (expected, 0));
    }
}
