//! A wire into one reader, on which faults act: a queue in the place of shared memory.
//!
//! As on the wires of iceoryx2 a message that was sent is there even if its writer dies, a reader that is too
//! far behind loses the oldest, and one that comes late gets the newest that its writer, if it lives, has sent.

use super::message::Message;
use super::plan::{Event, Fault, Line, Plan};
use crate::support::random::Random;
use hilare_interfaces::block::Tick;
use hilare_interfaces::wires::Wire;
use std::collections::VecDeque;

/// Ticks until a writer that has nothing to say sees a new reader, at most.
const LOOKS_ROUND: Tick = 10;

/// The wire.
pub struct Link<T> {
    depth: usize,
    kept: usize,
    events: Vec<Event>,
    random: Random,
    /// Messages and when they are to be read, as they were sent.
    waiting: VecDeque<(Tick, T)>,
    /// The newest message sent before a [`Fault::Freeze`].
    thawed: Option<T>,
    /// The newest messages of the present writer, for a reader to come.
    history: VecDeque<T>,
    /// When a new reader gets it.
    promised: Option<Tick>,
    forged: u64,
}

impl<T: Message> Link<T> {
    /// As deep as `wire`, with what `plan` does to `line`; `seed` decides the details.
    pub fn new(wire: &Wire, line: Line, plan: &Plan, seed: u64) -> Self {
        Self {
            depth: wire.buffer,
            kept: wire.history,
            events: plan.at(line),
            random: Random::of_seed(seed ^ ((line as u64 + 1) << 48)),
            waiting: VecDeque::new(),
            thawed: None,
            history: VecDeque::new(),
            promised: None,
            forged: 0,
        }
    }

    /// Sends a message at `now`, or what becomes of it.
    pub fn send(&mut self, now: Tick, message: &T) {
        self.keep_promise(now, true);
        if self.events.is_empty() {
            self.keep(message);
            return self.push(now, *message);
        }
        let mut sent = *message;
        let (mut due, mut lost, mut again, mut frozen) = (now, false, None, false);
        for n in 0..self.events.len() {
            let event = self.events[n];
            if !event.lasts_at(now) {
                continue;
            }
            match event.fault {
                Fault::Delay(ticks) => due += ticks,
                Fault::Drop => lost = true,
                Fault::Duplicate(ticks) => again = Some(ticks),
                Fault::Corrupt(bits) => (0..bits).for_each(|_| sent.flip(self.random.word())),
                Fault::Nan => sent.spoil(self.random.word()),
                Fault::Overdo(times) => sent.overdo(times as f64),
                Fault::Freeze => frozen = true,
                Fault::Forge(forgery) => {
                    if let Some(forged) = message.forged(forgery) {
                        self.forged += 1;
                        self.push(now, forged);
                    }
                }
                _ => {}
            }
        }
        self.keep(message);
        if frozen {
            sent = *self.thawed.get_or_insert(sent);
        } else {
            self.thawed = Some(sent);
        }
        if !lost {
            self.push(due, sent);
            if let Some(ticks) = again {
                self.push(due + ticks, sent);
            }
        }
    }

    fn push(&mut self, due: Tick, message: T) {
        if self.waiting.len() == self.depth {
            self.waiting.pop_front();
        }
        self.waiting.push_back((due, message));
    }

    /// The next message that has come by `now`.
    pub fn next(&mut self, now: Tick) -> Option<T> {
        self.keep_promise(now, false);
        if self.waiting.front()?.0 <= now {
            return self.waiting.pop_front().map(|(_, message)| message);
        }
        let place = self.waiting.iter().position(|(due, _)| *due <= now)?;
        self.waiting.remove(place).map(|(_, message)| message)
    }

    fn keep(&mut self, message: &T) {
        self.history.push_back(*message);
        if self.history.len() > self.kept {
            self.history.pop_front();
        }
    }

    /// The reader was another process: with it went what waited. What is kept is there for the new one once the
    /// writer looks round, at the latest with its next message.
    pub fn new_reader(&mut self, now: Tick) {
        self.waiting.clear();
        self.promised = Some(now + self.random.whole(0, LOOKS_ROUND));
    }

    fn keep_promise(&mut self, now: Tick, looks: bool) {
        if self.promised.take_if(|due| looks || *due <= now).is_none() {
            return;
        }
        let kept = self.history.len().min(self.depth);
        for n in self.history.len() - kept..self.history.len() {
            self.push(now, self.history[n]);
        }
    }

    /// The writer is gone, and with it what it kept.
    pub fn lose_writer(&mut self) {
        self.history.clear();
        self.promised = None;
    }

    /// Commands of nobody that were slipped in.
    pub fn forged(&self) -> u64 {
        self.forged
    }
}
