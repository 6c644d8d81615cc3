//! Puts the messages of one tick together.
//!
//! Wires are read one after the other, so at any moment one of them is ahead. Messages wait here
//! until their tick is complete; a tick whose messages were lost is counted, never guessed.
//!
//! What makes no sense counts as lost. Ticks rise on every wire, so of two messages that contradict this
//! the newer one is believed: a single lie costs the ticks around it, not those that come.

use crate::TickRecord;
use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::sense::TICK_MAX;
use hilare_interfaces::messages::{Pose, Reference, Steps, Truth};
use std::collections::VecDeque;

/// Messages of a wire that wait at most; beyond, the oldest are given up: another wire is silent.
pub const MAX_WAITING: usize = 4096;
/// Ticks further ahead than this are no ticks of this run: eleven days.
const AHEAD_MAX: u64 = 1_000_000_000;

/// Messages waiting for the rest of their tick.
#[derive(Debug)]
pub struct Assembler {
    period_ticks: u64,
    steps: Queue<Steps>,
    poses: Queue<Pose>,
    truths: Queue<Truth>,
    /// The first may be the one in force.
    references: Queue<Reference>,
    next_tick: Tick,
    gaps: u64,
}

/// Messages of one wire, ticks rising.
#[derive(Debug)]
struct Queue<M> {
    messages: VecDeque<M>,
    tick: fn(&M) -> Tick,
}

impl<M> Queue<M> {
    const fn new(tick: fn(&M) -> Tick) -> Self {
        Self { messages: VecDeque::new(), tick }
    }

    /// Takes a message of a tick not before `first`.
    fn push(&mut self, message: M, first: Tick, makes_sense: bool) {
        let tick = (self.tick)(&message);
        let possible = tick >= first && tick <= TICK_MAX && tick - first <= AHEAD_MAX;
        if !(possible && makes_sense) {
            return;
        }
        while self.newest().is_some_and(|newest| newest >= tick) {
            self.messages.pop_back();
        }
        if self.messages.len() == MAX_WAITING {
            self.messages.pop_front();
        }
        self.messages.push_back(message);
    }

    fn newest(&self) -> Option<Tick> {
        self.messages.back().map(self.tick)
    }

    /// The oldest message not before `first`; what is before it is given up.
    fn oldest_from(&mut self, first: Tick) -> Option<&M> {
        while self.messages.front().is_some_and(|message| (self.tick)(message) < first) {
            self.messages.pop_front();
        }
        self.messages.front()
    }
}

impl Queue<Reference> {
    /// Gives up what a newer reference of `last` or before has taken the place of: while its box is away, the
    /// reference before stays in force. True if others wait behind the first.
    fn keep_newest_to(&mut self, last: Tick) -> bool {
        while self.messages.get(1).is_some_and(|next| next.tick <= last) {
            self.messages.pop_front();
        }
        self.messages.len() > 1
    }
}

impl Assembler {
    /// Nothing waiting; the first tick to deliver is tick 1 (message 0 precedes the first tick).
    pub fn new(period_ticks: u64) -> Self {
        Self {
            period_ticks: period_ticks.max(1),
            steps: Queue::new(|message| message.tick),
            poses: Queue::new(|message| message.tick),
            truths: Queue::new(|message| message.tick),
            references: Queue::new(|message| message.tick),
            next_tick: 1,
            gaps: 0,
        }
    }

    /// Ticks that could not be put together because a message was lost, or made no sense.
    pub fn gaps(&self) -> u64 {
        self.gaps
    }

    /// Ticks delivered or given up.
    pub fn done(&self) -> u64 {
        self.next_tick - 1
    }

    /// Messages waiting on the wire that has most of them; at most [`MAX_WAITING`].
    pub fn waiting(&self) -> usize {
        let Self { steps, poses, truths, references, .. } = self;
        [steps.messages.len(), poses.messages.len(), truths.messages.len(), references.messages.len()]
            .into_iter()
            .max()
            .unwrap_or(0)
    }

    /// Takes in steps.
    pub fn push_steps(&mut self, steps: Steps) {
        self.steps.push(steps, self.next_tick, steps.makes_sense());
    }

    /// Takes in a pose.
    pub fn push_pose(&mut self, pose: Pose) {
        self.poses.push(pose, self.next_tick, pose.makes_sense());
    }

    /// Takes in a true pose.
    pub fn push_truth(&mut self, truth: Truth) {
        self.truths.push(truth, self.next_tick, truth.makes_sense());
    }

    /// Takes in a reference.
    pub fn push_reference(&mut self, reference: Reference) {
        self.references.push(reference, self.chosen_at(self.next_tick), reference.makes_sense());
    }

    /// The tick on whose pose the reference in force during `tick` was chosen: the last before it.
    fn chosen_at(&self, tick: Tick) -> Tick {
        (tick - 1) / self.period_ticks * self.period_ticks
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
            let chosen_at = self.chosen_at(tick);
            // No tick beyond what every wire has come to can be judged.
            let judged = [
                self.steps.newest(),
                self.poses.newest(),
                self.truths.newest(),
                self.references.newest().map(|newest| newest + self.period_ticks),
            ];
            let more_references = self.references.keep_newest_to(chosen_at);
            let (Some(steps), Some(pose), Some(truth), Some(reference)) = (
                self.steps.oldest_from(tick),
                self.poses.oldest_from(tick),
                self.truths.oldest_from(tick),
                self.references.messages.front(),
            ) else {
                return;
            };
            if !(reference.tick == chosen_at || more_references || over) {
                return;
            }
            let complete =
                steps.tick == tick && pose.tick == tick && truth.tick == tick && reference.tick <= chosen_at;
            if complete {
                deliver(TickRecord { steps, pose, truth, reference });
                self.next_tick += 1;
                continue;
            }
            // Every wire is past this tick, one of them without having had it, and all before that one's next.
            let possible = steps.tick.max(pose.tick).max(truth.tick).max(reference.tick + 1);
            let judged = judged.into_iter().flatten().min().unwrap_or(tick);
            let next = possible.min(judged + 1).max(tick + 1);
            self.gaps = self.gaps.saturating_add(next - tick);
            self.next_tick = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;

    fn push(assembler: &mut Assembler, tick: u64) {
        assembler.push_steps(Steps { tick, ..Steps::ZERO });
        assembler.push_pose(Pose { tick, ..Pose::ZERO });
        assembler.push_truth(Truth { tick, ..Truth::ZERO });
    }

    #[test]
    fn ticks_come_in_order_with_the_reference_in_force() {
        let mut assembler = Assembler::new(5);
        let mut seen = Vec::new();
        for tick in 0..=12 {
            push(&mut assembler, tick);
            if tick % 5 == 0 {
                assembler.push_reference(Reference { tick, ..Reference::ZERO });
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
        assembler.push_reference(Reference::ZERO);
        for tick in 0..=4 {
            push(&mut assembler, tick);
        }
        assembler.poses.messages.remove(1);
        let mut seen = Vec::new();
        assembler.drain(|record| seen.push(record.steps.tick));
        assert_eq!((seen, assembler.gaps(), assembler.done()), (vec![1, 3, 4], 1, 4));
    }

    #[test]
    fn it_waits_for_the_slowest_wire() {
        let mut assembler = Assembler::new(5);
        assembler.push_reference(Reference::ZERO);
        for tick in 0..=4 {
            push(&mut assembler, tick);
        }
        let late = assembler.truths.messages.pop_back();
        let mut seen = 0;
        assembler.drain(|_| seen += 1);
        assert_eq!((seen, assembler.gaps()), (3, 0));
        late.into_iter().for_each(|truth| assembler.push_truth(truth));
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
                assembler.push_reference(Reference { tick, ..Reference::ZERO });
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
