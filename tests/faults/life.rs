//! Whether a process of the virtual rig is there, and whether it runs.

use super::plan::{Event, Fault, Plan, Process};
use hilare_interfaces::block::Tick;

/// The fate of a process and its successors.
pub struct Life {
    events: Vec<Event>,
    alive: bool,
    /// When the present process was started; what struck before is not its concern.
    since: Tick,
    died: Tick,
    incarnation: u64,
}

impl Life {
    /// There from the start, with what `plan` does to `process`.
    pub fn new(plan: &Plan, process: Process) -> Self {
        Self { events: plan.at(process), alive: true, since: 0, died: 0, incarnation: 1 }
    }

    /// Kills it if its time has come.
    pub fn strike(&mut self, now: Tick) {
        if self.due(Fault::Kill, now) {
            self.kill(now);
        }
    }

    /// In the middle of a step, what it answers sent or remembered but not both: true if it ends there.
    pub fn strike_amid(&mut self, now: Tick) -> bool {
        let struck = self.due(Fault::KillAmid, now);
        if struck {
            self.kill(now);
        }
        struck
    }

    /// A process that is to be killed amid a step waits for one.
    fn due(&self, fault: Fault, now: Tick) -> bool {
        let due = |event: &Event| match fault {
            Fault::KillAmid => event.lasts_at(now) && event.from >= self.since,
            _ => event.from == now,
        };
        self.alive && self.events.iter().any(|event| event.fault == fault && due(event))
    }

    /// It is gone.
    pub fn kill(&mut self, now: Tick) {
        if self.alive {
            (self.alive, self.died) = (false, now);
        }
    }

    /// A successor is there.
    pub fn start(&mut self, now: Tick) {
        (self.alive, self.since) = (true, now);
        self.incarnation += 1;
    }

    /// 1 for the first process, 2 for its successor, …
    pub fn incarnation(&self) -> u64 {
        self.incarnation
    }

    /// There, running or not.
    pub fn alive(&self) -> bool {
        self.alive
    }

    /// When it died, if it is dead.
    pub fn died(&self) -> Option<Tick> {
        (!self.alive).then_some(self.died)
    }

    /// There, and not stopped.
    pub fn runs(&self, now: Tick) -> bool {
        self.alive && self.stopped_for(now).is_none()
    }

    /// How long it has been standing still, if it does.
    pub fn stopped_for(&self, now: Tick) -> Option<Tick> {
        let stops = self.events.iter().filter(|event| event.fault == Fault::Stop && event.from >= self.since);
        let since = stops.filter(|event| event.lasts_at(now)).map(|event| event.from).min();
        since.filter(|_| self.alive).map(|since| now - since)
    }
}
