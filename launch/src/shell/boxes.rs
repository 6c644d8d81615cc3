//! Which messages each box is stepped with, and what becomes of its answer.

use super::pairing::Pairing;
use super::transport::{Input, Output, SliceInput};
use super::worker::{Reactive, Report, Worker};
use super::{ClockKind, build};
use hilare_controller::{Controller, ControllerInputs, Identity};
use hilare_interfaces::block::Block;
use hilare_interfaces::messages::{
    Command, HealthState, MAX_WAYPOINTS, PathHeader, Pose, Reference, Steps, Truth, Waypoint,
};
use hilare_interfaces::wires;
use hilare_plant::StepperDrive;
use hilare_pose_estimator::PoseEstimator;
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};
use std::time::Duration;

/// steps → pose.
pub struct EstimatorProcess {
    estimator: PoseEstimator,
    steps: Input<Steps>,
    pose: Output<Pose>,
    period_ticks: u64,
    report: Report,
}

impl EstimatorProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        Ok(Self {
            estimator: build::pose_estimator(&worker.system),
            steps: worker.domain.input(&wires::STEPS)?,
            pose: worker.domain.output(&wires::POSE)?,
            period_ticks: worker.system.timing.period_ticks,
            report: Report::default(),
        })
    }
}

impl Reactive for EstimatorProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = false;
        let mut period_begins = false;
        while let Some(steps) = self.steps.next() {
            let pose = self.estimator.step(steps.tick, &steps);
            self.pose.send(&pose);
            self.report.tick = steps.tick;
            self.report.steps += 1;
            period_begins |= steps.tick.is_multiple_of(self.period_ticks);
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

    fn connect(&self) {
        self.steps.connect();
        self.pose.connect();
    }
}

/// pose, path → reference.
pub struct SelectorProcess {
    selector: WaypointSelector,
    pose: Input<Pose>,
    path: SliceInput<PathHeader, Waypoint>,
    reference: Output<Reference>,
    period_ticks: u64,
    /// A path that came since the last control period.
    waiting: Option<PathHeader>,
    waiting_points: Vec<Waypoint>,
    report: Report,
}

impl SelectorProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        Ok(Self {
            selector: build::waypoint_selector(&worker.system),
            pose: worker.domain.input(&wires::POSE)?,
            path: worker.domain.slice_input(&wires::PATH)?,
            reference: worker.domain.output(&wires::REFERENCE)?,
            period_ticks: worker.system.timing.period_ticks,
            waiting: None,
            waiting_points: Vec::with_capacity(MAX_WAYPOINTS),
            report: Report::default(),
        })
    }

    /// Copies a new path out of shared memory; it takes effect at the next control period.
    fn take_path(&mut self) -> bool {
        let (waiting, points, report) = (&mut self.waiting, &mut self.waiting_points, &mut self.report);
        let took = self.path.next(|header, waypoints| {
            *waiting = Some(*header);
            points.clear();
            points.extend_from_slice(waypoints);
            report.path_id = header.path_id;
        });
        took.is_some()
    }
}

impl Reactive for SelectorProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = self.take_path();
        let mut chosen = false;
        while let Some(pose) = self.pose.next() {
            worked = true;
            self.report.tick = pose.tick;
            if !pose.tick.is_multiple_of(self.period_ticks) {
                continue;
            }
            let header = self.waiting.take();
            let path = header.as_ref().map(|header| NewPath { header, waypoints: &self.waiting_points });
            let reference = self.selector.step(pose.tick, SelectorInputs { pose: &pose, path });
            self.reference.send(&reference);
            self.report.steps += 1;
            self.report.rejected = self.selector.rejected_paths();
            chosen = true;
        }
        if chosen {
            worker.page.ring(&wires::REFERENCE);
        }
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn connect(&self) {
        self.pose.connect();
        self.path.connect();
        self.reference.connect();
    }
}

/// reference, pose → command.
pub struct ControllerProcess {
    controller: Controller,
    reference: Input<Reference>,
    pose: Input<Pose>,
    pairing: Pairing,
    command: Output<Command>,
    report: Report,
}

impl ControllerProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let identity = Identity { source: worker.assignment.slot as u64 + 1, epoch: worker.assignment.epoch };
        Ok(Self {
            controller: build::controller(&worker.system, identity)?,
            reference: worker.domain.input(&wires::REFERENCE)?,
            pose: worker.domain.input(&wires::POSE)?,
            pairing: Pairing::default(),
            command: worker.domain.output(&wires::COMMAND)?,
            report: Report::default(),
        })
    }
}

impl Reactive for ControllerProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = false;
        while let Some((reference, pose)) = self.pairing.next(|| self.reference.next(), || self.pose.next()) {
            worked = true;
            self.report.tick = reference.tick;
            let inputs = ControllerInputs { reference: &reference, pose: &pose };
            let command = self.controller.step(reference.tick, inputs);
            (self.report.state, self.report.reason) = match command.degraded {
                0 => (HealthState::Running, ""),
                _ => (HealthState::Degraded, "the law fell back on a lesser answer"),
            };
            self.command.send(&command);
            self.report.steps += 1;
            self.report.rejected = self.pairing.lost();
        }
        if worked {
            worker.page.ring(&wires::COMMAND);
        }
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn connect(&self) {
        self.reference.connect();
        self.pose.connect();
        self.command.connect();
    }
}

/// steps → truth.
pub struct PlantProcess {
    plant: StepperDrive,
    steps: Input<Steps>,
    truth: Output<Truth>,
    report: Report,
}

impl PlantProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        Ok(Self {
            plant: build::plant(&worker.system)?,
            steps: worker.domain.input(&wires::STEPS)?,
            truth: worker.domain.output(&wires::TRUTH)?,
            report: Report::default(),
        })
    }
}

impl Reactive for PlantProcess {
    fn poll(&mut self, _worker: &mut Worker) -> bool {
        let mut worked = false;
        while let Some(steps) = self.steps.next() {
            let truth = self.plant.step(steps.tick, &steps);
            self.truth.send(&truth);
            self.report.tick = steps.tick;
            self.report.steps += 1;
            worked = true;
        }
        // Nobody is woken by the truth: its only reader looks by itself.
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn connect(&self) {
        self.steps.connect();
        self.truth.connect();
    }
}

/// How long an observer sleeps between two looks.
pub fn observer_interval(clock: ClockKind) -> Duration {
    match clock {
        ClockKind::Real => Duration::from_millis(10),
        // The lockstep clock waits for the recorder; let it not wait long.
        ClockKind::Lockstep | ClockKind::InProcess => Duration::from_millis(1),
    }
}
