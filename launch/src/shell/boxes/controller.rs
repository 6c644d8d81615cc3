//! A controller's process.

use super::is_new;
use crate::config::System;
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use crate::shell::page::MAX_WAIT;
use crate::shell::pairing::Pairing;
use crate::shell::renewal::Renewals;
use crate::shell::standing::Stands;
use crate::shell::told::Told;
use crate::shell::transport::{Input, Output};
use crate::shell::worker::{Garbled, Reactive, Report, Worker};
use hilare_controller::{Controller, ControllerInputs, Identity, LawSpec};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{Command, Fallback, HealthState, Pose, Reference};
use hilare_interfaces::state::Stateful;
use hilare_interfaces::wires::{self, Role, SUCCESSOR_PERIODS};
use std::time::Duration;
use std::{iter, mem};

/// reference, pose → command.
pub struct ControllerProcess {
    controller: Controller,
    law: &'static LawSpec,
    identity: Identity,
    reference: Input<Reference>,
    pose: Input<Pose>,
    pairing: Pairing<Reference, Pose>,
    command: Output<Command>,
    key: u64,
    /// Another controller, and the key of its state.
    renewals: Renewals<(Controller, u64)>,
    period_ticks: u64,
    /// The tick that was answered last, or that the state it began with is of.
    done: Option<Tick>,
    /// The tick of the state it began with, and the place of whose it was.
    began_with: Option<(Tick, usize)>,
    report: Report,
}

/// Ticks after which the state a predecessor left is of no use to a controller any more.
const STALE_TICKS: Tick = 100;

/// How long a reference whose pose is not there yet is slept on: the pose wakes nobody here.
const APART: Duration = Duration::from_micros(50);

/// What must agree for a controller to go on from the state of another.
pub fn state_key(system: &System, law: &LawSpec) -> u64 {
    let setup = (law.name, format!("{:?}", system.controller.values_of(law.name)));
    key_of((Role::Controller, setup, system.acceptance().name()))
}

impl ControllerProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let identity = Identity { source: worker.assignment.slot as u64 + 1, epoch: worker.assignment.epoch };
        let named = worker.assignment.law.as_deref().and_then(hilare_controller::law);
        let law = named.unwrap_or(worker.system.controller.law);
        let build = move |system: &System| {
            build::controller(system, law, identity).map(|controller| (controller, state_key(system, law)))
        };
        let (controller, key) = build(&worker.system)?;
        Ok(Self {
            key,
            renewals: Renewals::begin(worker, build)?,
            period_ticks: worker.system.timing.period_ticks,
            done: None,
            began_with: None,
            controller,
            law,
            identity,
            reference: worker.domain.input(&wires::REFERENCE)?,
            pose: worker.domain.input(&wires::POSE)?,
            pairing: Pairing::default(),
            command: worker.domain.output(&wires::COMMAND)?,
            report: Report::default(),
        })
    }
}

impl ControllerProcess {
    /// Goes on with other parameters, if it is to before it answers what is of tick `next`.
    #[inline]
    fn renew_at(&mut self, worker: &mut Worker, next: Tick) {
        let Some(mut renewal) = self.renewals.due(worker, next) else { return };
        let (controller, key) = &mut renewal.made;
        let kept = controller.take_over(&mut self.controller, worker.room());
        mem::swap(&mut self.controller, controller);
        mem::swap(&mut self.key, key);
        mem::swap(&mut worker.system, &mut renewal.system);
        self.renewals.applied(worker, renewal, next, !kept);
    }

    fn next(&mut self) -> Option<(Reference, Pose)> {
        // A successor of the waypoint selector repeats what its predecessor said last.
        let mut new = || iter::from_fn(|| self.reference.next()).find(|new| is_new(self.done, new.tick));
        self.pairing.next(&mut new, || self.pose.next())
    }

    /// The controller as it was built.
    fn renew(&mut self, worker: &Worker) {
        if let Ok(controller) = build::controller(&worker.system, self.law, self.identity) {
            self.controller = controller;
        }
    }

    /// Begins where another controller of the same law is: its predecessor, or the one it stands by. `first`
    /// and `last` are the references that wait.
    fn catch_up(&mut self, worker: &mut Worker, first: Tick, last: Tick) {
        let period = self.period_ticks;
        // Best: as it was before the first. Else it is some ticks ahead: those are not answered. Else it is behind.
        let ahead =
            (first.saturating_sub(period)..=last).step_by(period as usize).take(SUCCESSOR_PERIODS + 1);
        for wanted in ahead {
            if self.recall(worker, |saved| saved == wanted) {
                return;
            }
        }
        if !self.recall(worker, |saved| saved < first && saved + STALE_TICKS > first) {
            self.done = first.checked_sub(period);
        }
    }

    /// Takes on a state that any controller of the same law has left of a wanted tick. False if there is none.
    fn recall(&mut self, worker: &mut Worker, wanted: impl Fn(Tick) -> bool) -> bool {
        for slot in worker.page.members(Role::Controller) {
            match worker.recall(slot, self.key, &wanted, &mut self.controller) {
                Ok(Some(saved)) => {
                    self.done = Some(saved);
                    self.began_with = Some((saved, slot));
                    return true;
                }
                Ok(None) => {}
                Err(Garbled) => self.renew(worker),
            }
        }
        false
    }

    /// Whoever comes late has nothing to say of what is over. Of the references that wait it answers the last
    /// three: the one whose command may act now, that after it, and that before, which a predecessor may have
    /// answered and not remembered, and by which the step generator sees how the commands go on.
    fn begin(&mut self, worker: &mut Worker) {
        let mut last = Told::default();
        while let Some(next) = self.next() {
            last.keep(next);
        }
        let mut ticks = last.iter().map(|(reference, _)| reference.tick);
        if let Some(first) = ticks.next() {
            self.catch_up(worker, first, ticks.next_back().unwrap_or(first));
            worker.journal_began(self.done.unwrap_or(0), self.began_with);
        }
        for (reference, pose) in last.iter() {
            self.answer(worker, reference, pose);
        }
        if self.done.is_some() {
            worker.page.ring(&wires::COMMAND);
        }
    }

    /// Answers a reference with a command, once.
    fn answer(&mut self, worker: &mut Worker, reference: &Reference, pose: &Pose) {
        if !is_new(self.done, reference.tick) {
            return;
        }
        worker.note_taken(Role::WaypointSelector, reference.tick);
        self.renew_at(worker, reference.tick);
        let command = self.controller.step(reference.tick, ControllerInputs { reference, pose });
        worker.note_telling(reference.tick);
        self.command.send(&command);
        worker.note_told(reference.tick);
        self.done = Some(reference.tick);
        worker.remember(self.key, reference.tick, &mut self.controller);
        (self.report.state, self.report.reason) = match Fallback::from_code(command.fallback) {
            None | Some(Fallback::None) => (HealthState::Running, ""),
            Some(fallback) => (HealthState::Degraded, fallback.label()),
        };
        self.report.tick = reference.tick;
        self.report.steps += 1;
        self.report.rejected = self.pairing.lost();
    }
}

impl Reactive for ControllerProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        // Before time begins there is no message to do it at.
        self.renew_at(worker, 0);
        if self.done.is_none() {
            self.begin(worker);
        }
        let mut worked = false;
        while let Some((reference, pose)) = self.next() {
            self.answer(worker, &reference, &pose);
            worked = true;
        }
        if worked {
            worker.page.ring(&wires::COMMAND);
        }
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn stands(&mut self, room: &mut [u64]) -> Option<Stands> {
        self.done.map(|done| Stands {
            done: Some(done),
            number: self.controller.number(),
            words: self.controller.save_state(room).unwrap_or(0),
        })
    }

    fn poll_interval(&self) -> Duration {
        if self.pairing.waits() { APART } else { MAX_WAIT }
    }

    fn connect(&self) {
        self.reference.connect();
        self.pose.connect();
        self.command.connect();
    }
}
