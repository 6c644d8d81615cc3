//! A controller's place in the virtual rig, and whoever holds it.

use super::life::Life;
use super::memory::Memory;
use super::plan::{Line, Plan, Process};
use super::wire::Link;
use hilare::config::System;
use hilare::shell::build;
use hilare::shell::checkpoint::key_of;
use hilare::shell::pairing::Pairing;
use hilare::shell::told::Told;
use hilare_controller::{Controller, ControllerInputs, Identity};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{Command, Pose, Reference};
use hilare_interfaces::wires;
use std::iter;

/// Ticks after which what a predecessor left is of no use to a controller any more.
const STALE_TICKS: Tick = 100;

/// What strikes a controller's place and its wires.
pub struct Place {
    source: u64,
    process: Process,
    pose: Line,
    reference: Line,
    command: Line,
}

/// In charge at first.
pub const ACTIVE: Place = Place {
    source: 3,
    process: Process::Active,
    pose: Line::PoseToActive,
    reference: Line::ReferenceToActive,
    command: Line::CommandOfActive,
};

/// Beside it.
pub const STANDBY: Place = Place {
    source: 5,
    process: Process::Standby,
    pose: Line::PoseToStandby,
    reference: Line::ReferenceToStandby,
    command: Line::CommandOfStandby,
};

/// The place and its process.
pub struct Post {
    /// Whether it is there.
    pub life: Life,
    /// From the pose estimator.
    pub pose: Link<Pose>,
    /// From the waypoint selector.
    pub reference: Link<Reference>,
    /// To the step generator.
    pub command: Link<Command>,
    system: System,
    process: Process,
    key: u64,
    identity: Identity,
    pairing: Pairing<Reference, Pose>,
    controller: Controller,
    /// The tick that was answered last.
    done: Option<Tick>,
    /// What it commanded in the present tick, the newest, and how often.
    last: Option<Command>,
    sent: u64,
}

impl Post {
    /// With the law of `system`.
    pub fn new(place: &Place, system: &System, epoch: u64, plan: &Plan, seed: u64) -> Self {
        let identity = Identity { source: place.source, epoch };
        Self {
            life: Life::new(plan, place.process),
            pose: Link::new(&wires::POSE, place.pose, plan, seed),
            reference: Link::new(&wires::REFERENCE, place.reference, plan, seed),
            command: Link::new(&wires::COMMAND, place.command, plan, seed),
            system: system.clone(),
            process: place.process,
            key: key_of(system.controller.law.name),
            identity,
            pairing: Pairing::default(),
            controller: built(system, identity),
            done: None,
            last: None,
            sent: 0,
        }
    }

    /// Source and epoch.
    pub fn pair(&self) -> (u64, u64) {
        (self.identity.source, self.identity.epoch)
    }

    /// A successor takes the place.
    pub fn start(&mut self, now: Tick, epoch: u64) {
        self.life.start(now);
        self.identity.epoch = epoch;
        self.controller = built(&self.system, self.identity);
        (self.pairing, self.done) = (Pairing::default(), None);
        self.pose.new_reader(now);
        self.reference.new_reader(now);
        self.command.lose_writer();
    }

    /// Answers what has come.
    pub fn step(&mut self, now: Tick, memory: &mut Memory) {
        (self.last, self.sent) = (None, 0);
        if !self.life.runs(now) {
            return;
        }
        if self.done.is_none() {
            // Whoever comes late answers the last three references that wait: what was before is over.
            let mut waiting = Told::default();
            while let Some(next) = self.next(now) {
                waiting.keep(next);
            }
            let mut ticks = waiting.iter().map(|(reference, _)| reference.tick);
            if let Some(first) = ticks.next() {
                self.catch_up(first, ticks.next_back().unwrap_or(first), memory);
            }
            for (reference, pose) in waiting.iter() {
                self.answer(now, reference, pose, memory);
            }
        }
        while let Some((reference, pose)) = self.next(now) {
            self.answer(now, &reference, &pose, memory);
        }
    }

    fn next(&mut self, now: Tick) -> Option<(Reference, Pose)> {
        let (references, poses) = (&mut self.reference, &mut self.pose);
        let done = self.done;
        let new = |reference: &Reference| done.is_none_or(|done| reference.tick > done);
        self.pairing.next(&mut || iter::from_fn(|| references.next(now)).find(new), || poses.next(now))
    }

    fn answer(&mut self, now: Tick, reference: &Reference, pose: &Pose, memory: &mut Memory) {
        if !self.life.alive() || self.done.is_some_and(|done| reference.tick <= done) {
            return;
        }
        let command = self.controller.step(reference.tick, ControllerInputs { reference, pose });
        self.command.send(now, &command);
        (self.last, self.sent) = (Some(command), self.sent + 1);
        if !self.life.strike_amid(now) {
            self.done = Some(reference.tick);
            memory.remember(self.process, self.key, reference.tick, &mut self.controller);
        }
    }

    /// Begins where another controller of the same law is.
    fn catch_up(&mut self, first: Tick, last: Tick, memory: &mut Memory) {
        let period = self.system.timing.period_ticks;
        for wanted in (first.saturating_sub(period)..=last).step_by(period as usize).take(4) {
            if self.recall(memory, |saved| saved == wanted) {
                return;
            }
        }
        if !self.recall(memory, |saved| saved < first && saved + STALE_TICKS > first) {
            self.done = first.checked_sub(period);
        }
    }

    fn recall(&mut self, memory: &mut Memory, wanted: impl Fn(Tick) -> bool) -> bool {
        let from = [Process::Active, Process::Standby].into_iter();
        let found =
            from.filter_map(|process| memory.recall(process, self.key, &wanted, &mut self.controller)).next();
        self.done = found.or(self.done);
        found.is_some()
    }

    /// What it commanded in this tick, the newest.
    pub fn last(&self) -> Option<&Command> {
        self.last.as_ref()
    }

    /// How many commands it sent in this tick.
    pub fn sent(&self) -> u64 {
        self.sent
    }
}

fn built(system: &System, identity: Identity) -> Controller {
    build::controller(system, system.controller.law, identity).expect("a law that was checked")
}
