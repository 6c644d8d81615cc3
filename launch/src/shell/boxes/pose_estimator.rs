//! The pose estimator's process.

use super::is_new;
use crate::config::System;
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use crate::shell::pairing::{Fixes, Pairing};
use crate::shell::renewal::Renewals;
use crate::shell::standing::Stands;
use crate::shell::told::Told;
use crate::shell::transport::{Input, Output};
use crate::shell::worker::{Reactive, Report, Worker};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{HealthState, Pose, PoseFix, Steps, Wheels};
use hilare_interfaces::state::{StateWords, Stateful};
use hilare_interfaces::wires::{self, Role};
use hilare_pose_estimator::{EstimatorInputs, PoseEstimator};
use std::{iter, mem};

/// The box, and the poses it told last.
#[derive(Clone)]
pub struct Reckoner {
    /// The box.
    pub estimator: PoseEstimator,
    last: Pose,
    /// Those that began a control period.
    begins: Told<Pose>,
    period_ticks: u64,
}

impl Reckoner {
    /// At the system's start pose.
    pub fn new(system: &System) -> Self {
        Self {
            estimator: build::pose_estimator(system),
            last: Pose::ZERO,
            begins: Told::default(),
            period_ticks: system.timing.period_ticks,
        }
    }

    /// One step of the box.
    pub fn step(&mut self, tick: Tick, inputs: EstimatorInputs<'_>) -> Pose {
        self.last = self.estimator.step(tick, inputs);
        if self.begins_period(&self.last) {
            self.begins.keep(self.last);
        }
        self.last
    }

    /// True if a controller is to answer a pose.
    pub const fn begins_period(&self, pose: &Pose) -> bool {
        pose.tick.is_multiple_of(self.period_ticks)
    }

    /// What a successor tells again, the newest last.
    pub fn told(&self) -> impl Iterator<Item = &Pose> {
        let last = (!self.begins_period(&self.last)).then_some(&self.last);
        self.begins.iter().chain(last)
    }
}

impl Stateful for Reckoner {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.estimator.visit_state(words);
        words.message(&mut self.last);
        self.begins.visit_state(words);
    }
}

/// steps, wheels, fix → pose.
pub struct EstimatorProcess {
    reckoner: Reckoner,
    /// What a predecessor told last is to be told again.
    repeats: bool,
    steps: Input<Steps>,
    /// Only of a robot whose sensors it reads: then each tick waits for its wheels.
    sensors: Option<SensorInputs>,
    pose: Output<Pose>,
    key: u64,
    renewals: Renewals<PoseEstimator>,
    /// The tick that was estimated last.
    done: Option<Tick>,
    report: Report,
}

/// What the plant says of the robot.
struct SensorInputs {
    wheels: Input<Wheels>,
    fix: Input<PoseFix>,
    /// The odometry is the encoders', not the steps'.
    encoders: bool,
    pairing: Pairing<Steps, Wheels>,
    fixes: Fixes,
}

impl EstimatorProcess {
    /// Opens its ports.
    pub fn new(worker: &mut Worker) -> Result<Self, String> {
        let key = key_of((Role::PoseEstimator, worker.system.estimator.name()));
        let (reckoner, done) = worker.resume(key, Reckoner::new);
        worker.journal_began(done.unwrap_or(0), done.map(|tick| (tick, worker.assignment.slot)));
        let system = &worker.system;
        let sensors = match system.reads_sensors() {
            true => Some(SensorInputs {
                // The fixes first: by the time it has wheels, it has their fixes.
                fix: worker.domain.input(&wires::FIX)?,
                wheels: worker.domain.input(&wires::WHEELS)?,
                encoders: system.motors.has_encoders(),
                pairing: Pairing::default(),
                fixes: Fixes::default(),
            }),
            false => None,
        };
        Ok(Self {
            reckoner,
            repeats: done.is_some(),
            steps: worker.domain.input(&wires::STEPS)?,
            sensors,
            pose: worker.domain.output(&wires::POSE)?,
            key,
            renewals: Renewals::begin(worker, |system| Ok(build::pose_estimator(system)))?,
            done,
            // The lockstep clock waits for whoever seems to be behind.
            report: Report { tick: done.unwrap_or(0), ..Report::default() },
        })
    }

    /// Goes on with other parameters, if it is to before the tick after `executed` ticks.
    #[inline]
    fn renew_at(
        renewals: &mut Renewals<PoseEstimator>,
        reckoner: &mut Reckoner,
        worker: &mut Worker,
        executed: Tick,
    ) {
        let Some(mut renewal) = renewals.due(worker, executed) else { return };
        renewal.made.take_over(&mut reckoner.estimator);
        mem::swap(&mut reckoner.estimator, &mut renewal.made);
        mem::swap(&mut worker.system, &mut renewal.system);
        renewals.applied(worker, renewal, executed, false);
    }

    /// The next tick of which everything is there, estimated.
    fn next(&mut self, worker: &mut Worker) -> Option<Pose> {
        let Some(SensorInputs { wheels, fix, encoders, pairing, fixes }) = &mut self.sensors else {
            // A predecessor, or that of the step generator, may have been as far.
            let steps = iter::from_fn(|| self.steps.next()).find(|steps| is_new(self.done, steps.tick))?;
            worker.note_taken(Role::StepGenerator, steps.tick);
            let executed = steps.tick.saturating_sub(1);
            Self::renew_at(&mut self.renewals, &mut self.reckoner, worker, executed);
            let inputs = EstimatorInputs { counts: &steps.counts, fixes: &[] };
            let pose = self.reckoner.step(steps.tick, inputs);
            self.report.rejected = self.reckoner.estimator.refused();
            return Some(pose);
        };
        let done = self.done;
        let mut new_steps = || iter::from_fn(|| self.steps.next()).find(|steps| is_new(done, steps.tick));
        let (steps, wheels) = pairing.next(&mut new_steps, || wheels.next())?;
        worker.note_taken(Role::Plant, steps.tick);
        Self::renew_at(&mut self.renewals, &mut self.reckoner, worker, steps.tick.saturating_sub(1));
        let counts = if *encoders { &wheels.counts } else { &steps.counts };
        // Those of the wire's history that a predecessor has used are in the state it left.
        let mut new_fixes = || iter::from_fn(|| fix.next()).find(|fix| is_new(done, fix.tick));
        let inputs = EstimatorInputs { counts, fixes: fixes.due(steps.tick, &mut new_fixes) };
        let pose = self.reckoner.step(steps.tick, inputs);
        self.report.rejected = pairing.lost() + self.reckoner.estimator.refused();
        Some(pose)
    }
}

impl Reactive for EstimatorProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = false;
        let mut period_begins = false;
        // Before time begins there is no message to do it at.
        Self::renew_at(&mut self.renewals, &mut self.reckoner, worker, 0);
        if mem::take(&mut self.repeats) {
            self.reckoner.told().for_each(|pose| {
                self.pose.send(pose);
            });
            period_begins = true;
        }
        while let Some(pose) = self.next(worker) {
            worker.note_telling(pose.tick);
            self.pose.send(&pose);
            worker.note_told(pose.tick);
            if self.done.is_some_and(|done| pose.tick > done + 1) {
                self.report.state = HealthState::Degraded;
                self.report.reason = "ticks were lost: the pose was reckoned across the gap";
            }
            self.done = Some(pose.tick);
            worker.remember(self.key, pose.tick, &mut self.reckoner);
            self.report.tick = pose.tick;
            self.report.steps += 1;
            period_begins |= self.reckoner.begins_period(&pose);
            worked = true;
        }
        // Only the pose that begins a control period is a reason to wake anybody.
        if period_begins {
            worker.page.ring(&wires::POSE);
        }
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn stands(&mut self, room: &mut [u64]) -> Option<Stands> {
        let words = self.reckoner.save_state(room).unwrap_or(0);
        Some(Stands { done: self.done, number: 0, words })
    }

    fn connect(&self) {
        self.steps.connect();
        if let Some(sensors) = &self.sensors {
            sensors.wheels.connect();
            sensors.fix.connect();
        }
        self.pose.connect();
    }
}
