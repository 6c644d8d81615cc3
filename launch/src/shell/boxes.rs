//! Which messages each box is stepped with, and what becomes of its answer.

use super::pairing::{Fixes, Pairing};
use super::transport::{Input, Output, SliceInput};
use super::worker::{Reactive, Report, Worker};
use super::{ClockKind, build};
use hilare_controller::{Controller, ControllerInputs, Identity};
use hilare_interfaces::block::Block;
use hilare_interfaces::messages::{
    Command, Fallback, HealthState, MAX_WAYPOINTS, PathHeader, Pose, PoseFix, Reference, Steps, Truth,
    Waypoint, Wheels,
};
use hilare_interfaces::wires;
use hilare_plant::Plant;
use hilare_pose_estimator::{EstimatorInputs, PoseEstimator};
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};
use std::time::Duration;

/// steps, wheels, fix → pose.
pub struct EstimatorProcess {
    estimator: PoseEstimator,
    steps: Input<Steps>,
    /// Only of a robot whose sensors it reads: then each tick waits for its wheels.
    sensors: Option<SensorInputs>,
    pose: Output<Pose>,
    period_ticks: u64,
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
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let system = &worker.system;
        let sensors = match system.reads_sensors() {
            true => Some(SensorInputs {
                wheels: worker.domain.input(&wires::WHEELS)?,
                fix: worker.domain.input(&wires::FIX)?,
                encoders: system.motors.has_encoders(),
                pairing: Pairing::default(),
                fixes: Fixes::default(),
            }),
            false => None,
        };
        Ok(Self {
            estimator: build::pose_estimator(system),
            steps: worker.domain.input(&wires::STEPS)?,
            sensors,
            pose: worker.domain.output(&wires::POSE)?,
            period_ticks: system.timing.period_ticks,
            report: Report::default(),
        })
    }

    /// The next tick of which everything is there, estimated.
    fn next(&mut self) -> Option<Pose> {
        let Some(SensorInputs { wheels, fix, encoders, pairing, fixes }) = &mut self.sensors else {
            let steps = self.steps.next()?;
            let inputs = EstimatorInputs { counts: &steps.counts, fixes: &[] };
            return Some(self.estimator.step(steps.tick, inputs));
        };
        let (steps, wheels) = pairing.next(|| self.steps.next(), || wheels.next())?;
        let counts = if *encoders { &wheels.counts } else { &steps.counts };
        let inputs = EstimatorInputs { counts, fixes: fixes.due(steps.tick, || fix.next()) };
        let pose = self.estimator.step(steps.tick, inputs);
        self.report.rejected = pairing.lost();
        Some(pose)
    }
}

impl Reactive for EstimatorProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = false;
        let mut period_begins = false;
        while let Some(pose) = self.next() {
            self.pose.send(&pose);
            self.report.tick = pose.tick;
            self.report.steps += 1;
            period_begins |= pose.tick.is_multiple_of(self.period_ticks);
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
        if let Some(sensors) = &self.sensors {
            sensors.wheels.connect();
            sensors.fix.connect();
        }
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
    pairing: Pairing<Reference, Pose>,
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
            (self.report.state, self.report.reason) = match Fallback::from_code(command.fallback) {
                None | Some(Fallback::None) => (HealthState::Running, ""),
                Some(fallback) => (HealthState::Degraded, fallback.label()),
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

/// steps → truth, wheels, fix.
pub struct PlantProcess {
    plant: Plant,
    steps: Input<Steps>,
    truth: Output<Truth>,
    /// Only of a robot whose estimator reads them.
    sensors: Option<(Output<Wheels>, Output<PoseFix>)>,
    report: Report,
}

impl PlantProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let domain = &worker.domain;
        let sensors = match worker.system.reads_sensors() {
            true => Some((domain.output(&wires::WHEELS)?, domain.output(&wires::FIX)?)),
            false => None,
        };
        Ok(Self {
            plant: build::plant(&worker.system)?,
            steps: domain.input(&wires::STEPS)?,
            truth: domain.output(&wires::TRUTH)?,
            sensors,
            report: Report::default(),
        })
    }
}

impl Reactive for PlantProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = false;
        while let Some(steps) = self.steps.next() {
            let observed = self.plant.step(steps.tick, &steps);
            if let Some((wheels, fix)) = &self.sensors {
                // The fix first: whoever has the wheels of a tick has its fixes.
                if let Some(seen) = &observed.fix {
                    fix.send(seen);
                }
                wheels.send(&observed.wheels);
            }
            self.truth.send(&observed.truth);
            self.report.tick = steps.tick;
            self.report.steps += 1;
            worked = true;
        }
        // Nobody is woken by the truth: its only reader looks by itself.
        if worked && self.sensors.is_some() {
            worker.page.ring(&wires::WHEELS);
        }
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn connect(&self) {
        self.steps.connect();
        self.truth.connect();
        if let Some((wheels, fix)) = &self.sensors {
            wheels.connect();
            fix.connect();
        }
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
