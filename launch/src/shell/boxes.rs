//! Which messages each box is stepped with, and what becomes of its answer.

use super::pairing::Pairing;
use super::transport::{Input, Output, SliceInput, SliceOutput};
use super::worker::{Reactive, Report, Worker};
use super::{ClockKind, build};
use hilare_controller::{Controller, ControllerInputs, Identity};
use hilare_interfaces::block::Block;
use hilare_interfaces::geometry::{WorldPoint, WorldPose};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{
    Answer, Command, GoalHeader, GoalKind, HealthState, MAX_WAYPOINTS, PathHeader, Pose, Reference, Steps,
    Truth, Waypoint, text_field,
};
use hilare_interfaces::wires;
use hilare_plant::StepperDrive;
use hilare_pose_estimator::PoseEstimator;
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};

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
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = false;
        while let Some(steps) = self.steps.next() {
            let truth = self.plant.step(steps.tick, &steps);
            self.truth.send(&truth);
            self.report.tick = steps.tick;
            self.report.steps += 1;
            worked = true;
        }
        if worked {
            worker.page.ring(&wires::TRUTH);
        }
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

/// goal, pose → path, answer.
pub struct PlannerProcess {
    goal: SliceInput<GoalHeader, Waypoint>,
    pose: Input<Pose>,
    path: SliceOutput<PathHeader, Waypoint>,
    answer: Output<Answer>,
    acceptance_radius_m: f64,
    robot: Option<WorldPose>,
    /// The scenario's own path, published first of all.
    first: Vec<WorldPoint>,
    report: Report,
}

impl PlannerProcess {
    /// Opens its ports and reads the scenario's path, if there is one.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let file = worker.assignment.runtime_dir.join("waypoints.csv");
        let incarnation = worker.assignment.incarnation;
        // A successor must not send the robot back to the beginning.
        let first = match std::fs::File::open(&file) {
            Ok(text) if incarnation == 1 => hilare_planner::waypoint_file::parse(text)
                .map_err(|error| format!("{}:{error}", file.display()))?,
            _ => Vec::new(),
        };
        Ok(Self {
            goal: worker.domain.slice_input(&wires::GOAL)?,
            pose: worker.domain.newest(&wires::POSE)?,
            path: worker.domain.slice_output(&wires::PATH)?,
            answer: worker.domain.output(&wires::ANSWER)?,
            acceptance_radius_m: worker.system.tracking.acceptance_radius_m,
            robot: None,
            first,
            // Path ids go up over restarts, too.
            report: Report { path_id: (incarnation - 1) << 32, ..Report::default() },
        })
    }

    fn publish(&mut self, goal_id: u64, path: &[WorldPoint]) -> bool {
        let header = PathHeader { path_id: self.report.path_id + 1, goal_id };
        let sent = self.path.send(&header, path.iter().map(|point| Waypoint::from(*point)));
        if sent {
            self.report.path_id = header.path_id;
        }
        sent
    }

    fn answer(&mut self, header: &GoalHeader, waypoints: &[WorldPoint]) -> Answer {
        let refused = |why: &str| Answer { goal_id: header.goal_id, text: text_field(why), ..Answer::ZERO };
        let Some(kind) = GoalKind::from_code(header.kind) else { return refused("unknown kind of goal") };
        if header.has_heading != 0 {
            return refused("a final heading cannot be promised yet; leave THETA away");
        }
        match hilare_planner::plan(kind, waypoints, self.robot, self.acceptance_radius_m) {
            Err(refusal) => refused(&refusal.to_string()),
            Ok(path) if self.publish(header.goal_id, &path) => Answer {
                goal_id: header.goal_id,
                accepted: 1,
                waypoints: path.len() as u64,
                text: text_field("accepted"),
            },
            Ok(_) => refused("the path could not be published; is /dev/shm full?"),
        }
    }
}

impl Reactive for PlannerProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let first = std::mem::take(&mut self.first);
        if !first.is_empty() && self.publish(0, &first) {
            worker.page.ring(&wires::PATH);
        }
        if let Some(pose) = self.pose.last() {
            self.robot = Some(pose.pose());
            self.report.tick = pose.tick;
        }
        let goal = self.goal.next(|header, waypoints| {
            (*header, waypoints.iter().map(|waypoint| waypoint.point()).collect::<Vec<_>>())
        });
        let Some((header, waypoints)) = goal else { return false };
        let answer = self.answer(&header, &waypoints);
        self.answer.send(&answer);
        worker.page.ring(&wires::PATH);
        self.report.steps += 1;
        true
    }

    fn report(&self) -> Report {
        self.report
    }

    fn connect(&self) {
        self.goal.connect();
        self.pose.connect();
        self.path.connect();
        self.answer.connect();
    }
}

/// How long an observer sleeps between two looks.
pub fn observer_interval(clock: ClockKind) -> std::time::Duration {
    match clock {
        ClockKind::Real => std::time::Duration::from_millis(10),
        // The lockstep clock waits for the recorder; let it not wait long.
        ClockKind::Lockstep | ClockKind::InProcess => std::time::Duration::from_millis(1),
    }
}
