//! All boxes in one thread: the same `step`s in the same order as the processes take them, without
//! wires. For the tuner, the tests and quick answers.

use super::checkpoint::StateRoom;
use super::{ClockKind, build};
use crate::config::System;
use crate::recording::Heard;
use hilare_controller::{Controller, ControllerInputs, Identity};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::latency::LatencyHistogram;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{
    Authority, Command, Mode, PathHeader, Pose, Reference, ReferenceState, Steps, Waypoint,
};
use hilare_plant::{Observed, Plant};
use hilare_pose_estimator::{EstimatorInputs, PoseEstimator};
use hilare_recorder::statistics::{RunFigures, RunStatistics};
use hilare_recorder::{RunRecord, TickRecord};
use hilare_step_generator::{StepGenerator, StepInputs};
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};
use rustix::time::{ClockId, clock_gettime};

/// Armed, with the one controller in charge.
const AUTHORITY: Authority =
    Authority { seq: 1, mode: Mode::Armed.code(), term: 1, source: 1, epoch: 1, ..Authority::ZERO };
const PATH_HEADER: PathHeader = PathHeader { path_id: 1, goal_id: 0 };
/// Who its controller is.
const IDENTITY: Identity = Identity { source: 1, epoch: 1 };

/// The whole system in one thread.
pub struct InProcess {
    period_ticks: u64,
    generator: StepGenerator,
    estimator: PoseEstimator,
    selector: WaypointSelector,
    controller: Controller,
    plant: Plant,
    /// The estimator's odometry is the plant's encoders, not the steps.
    encoders: bool,
    /// As processes, the plant would tell of its encoders.
    sensors: bool,
    path: Option<Vec<Waypoint>>,
    tick: Tick,
    pose: Pose,
    observed: Observed,
    reference: Reference,
    command: Option<Command>,
    /// Processor time of the law's steps, where it is asked for.
    law_time: Option<Box<LatencyHistogram>>,
}

impl InProcess {
    /// Armed, at the start pose, with a path to follow.
    pub fn new(system: &System, waypoints: &[Waypoint]) -> Result<Self, String> {
        let mut generator = build::step_generator(system, ClockKind::InProcess);
        generator.take_in(0, StepInputs { authority: Some(&AUTHORITY), ..StepInputs::default() });
        let mut plant = build::plant(system)?;
        let observed = plant.step(0, generator.state());
        let mut robot = Self {
            period_ticks: system.timing.period_ticks,
            pose: Pose::ZERO,
            observed,
            generator,
            estimator: build::pose_estimator(system),
            selector: build::waypoint_selector(system),
            controller: build::controller(system, system.controller.law, IDENTITY)?,
            plant,
            encoders: system.motors.has_encoders(),
            sensors: system.reads_sensors(),
            path: Some(waypoints.to_vec()),
            tick: 0,
            reference: Reference::ZERO,
            command: None,
            law_time: None,
        };
        robot.pose = robot.estimate();
        Ok(robot)
    }

    /// Goes on with other parameters from the next tick on, as processes do ([`super::renewal`]): a system that
    /// differs from the one it was built of in live keys only.
    pub fn change(&mut self, system: &System) -> Result<(), String> {
        let mut room = StateRoom::default();
        let mut controller = build::controller(system, system.controller.law, IDENTITY)?;
        controller.take_over(&mut self.controller, room.all());
        self.controller = controller;
        let mut plant = build::plant(system)?;
        plant.take_over(&mut self.plant);
        self.plant = plant;
        let mut estimator = build::pose_estimator(system);
        estimator.take_over(&mut self.estimator);
        self.estimator = estimator;
        self.selector.set_tracking(system.tracking, system.acceptance());
        self.generator.set_limits(system.limits);
        Ok(())
    }

    /// The pose after what the plant showed last.
    #[inline]
    fn estimate(&mut self) -> Pose {
        let steps = &self.generator.state().counts;
        let inputs = EstimatorInputs {
            counts: if self.encoders { &self.observed.wheels.counts } else { steps },
            fixes: self.observed.fix.as_slice(),
        };
        self.estimator.step(self.tick, inputs)
    }

    /// Measures the processor time of the law's steps from here on; what it commands is the same.
    pub fn time_the_law(&mut self) {
        self.law_time = Some(Box::new(LatencyHistogram::ZERO));
    }

    /// Processor time of the law's steps, if it was asked for; a read of the clock is in it.
    pub fn law_time(&self) -> Option<&LatencyHistogram> {
        self.law_time.as_deref()
    }

    /// The last waypoint was accepted.
    pub fn arrived(&self) -> bool {
        self.reference.state == ReferenceState::Arrived.code()
    }

    /// Number of the waypoint that is driven to; 0 before the first control period.
    pub fn waypoint(&self) -> u64 {
        self.reference.index
    }

    /// State of the step generator.
    pub fn steps(&self) -> &Steps {
        self.generator.state()
    }

    /// Executes one tick, unless the pose before it is the arrival. False then.
    #[inline]
    pub fn tick(&mut self) -> bool {
        if self.tick.is_multiple_of(self.period_ticks) {
            self.control();
            if self.arrived() {
                return false;
            }
        }
        self.advance();
        true
    }

    #[inline]
    fn advance(&mut self) {
        let commands = self.command.take();
        let inputs = StepInputs { commands: commands.as_slice(), ..StepInputs::default() };
        self.generator.advance(self.tick, inputs);
        self.tick += 1;
        self.observed = self.plant.step(self.tick, self.generator.state());
        self.pose = self.estimate();
    }

    /// Selector and controller, once a control period.
    fn control(&mut self) {
        let path = self.path.take();
        let path = path.as_ref().map(|waypoints| NewPath { header: &PATH_HEADER, waypoints });
        self.reference = self.selector.step(self.tick, SelectorInputs { pose: &self.pose, path });
        let inputs = ControllerInputs { reference: &self.reference, pose: &self.pose };
        let start_ns = self.law_time.is_some().then(thread_time_ns);
        self.command = Some(self.controller.step(self.tick, inputs));
        if let (Some(time), Some(start_ns)) = (&mut self.law_time, start_ns) {
            time.record(thread_time_ns().saturating_sub(start_ns));
        }
    }

    /// Runs until arrival or `max_ticks`, recording every tick.
    pub fn run(&mut self, max_ticks: Tick) -> RunRecord {
        let mut record = RunRecord::new(self.period_ticks);
        self.drive(max_ticks, |tick| record.push(tick));
        if self.arrived() {
            record.statistics.note_arrival();
        }
        record
    }

    /// The same, with every message that processes would send, in order, to `hear`.
    pub fn run_heard(&mut self, max_ticks: Tick, mut hear: impl FnMut(Heard<'_>)) -> RunRecord {
        let mut record = RunRecord::new(self.period_ticks);
        hear(Heard::Authority(&AUTHORITY));
        if let Some(waypoints) = &self.path {
            hear(Heard::Path(&PATH_HEADER, waypoints));
        }
        self.tell_tick(&mut hear);
        while self.tick < max_ticks {
            if self.tick.is_multiple_of(self.period_ticks) {
                self.control();
                hear(Heard::Reference(&self.reference));
                if let Some(command) = &self.command {
                    hear(Heard::Command(command));
                }
                if self.arrived() {
                    record.statistics.note_arrival();
                    break;
                }
            }
            self.advance();
            self.tell_tick(&mut hear);
            record.push(self.record());
        }
        record
    }

    fn tell_tick(&self, hear: &mut impl FnMut(Heard<'_>)) {
        hear(Heard::Steps(self.generator.state()));
        if let Some(fix) = &self.observed.fix {
            hear(Heard::Fix(fix));
        }
        if self.sensors {
            hear(Heard::Wheels(&self.observed.wheels));
        }
        hear(Heard::Pose(&self.pose));
        hear(Heard::Truth(&self.observed.truth));
    }

    fn record(&self) -> TickRecord<'_> {
        TickRecord {
            steps: self.generator.state(),
            pose: &self.pose,
            truth: &self.observed.truth,
            reference: &self.reference,
        }
    }

    /// The same with other parameters from some ticks on, the first first.
    pub fn run_changing(&mut self, max_ticks: Tick, changes: &[(Tick, System)]) -> Result<RunRecord, String> {
        let mut record = RunRecord::new(self.period_ticks);
        for (tick, system) in changes {
            self.drive((*tick).min(max_ticks), |tick| record.push(tick));
            if self.tick == *tick {
                self.change(system)?;
            }
        }
        self.drive(max_ticks, |tick| record.push(tick));
        if self.arrived() {
            record.statistics.note_arrival();
        }
        Ok(record)
    }

    /// The figures of [`Self::run`], without its curves; `watch` sees the step generator after every tick.
    pub fn run_for_figures(&mut self, max_ticks: Tick, mut watch: impl FnMut(&Steps)) -> RunFigures {
        let mut statistics = RunStatistics::default();
        self.drive(max_ticks, |tick| {
            watch(tick.steps);
            statistics.push(tick);
        });
        if self.arrived() {
            statistics.note_arrival();
        }
        statistics.figures()
    }

    /// Runs until arrival, `max_ticks` or until `push`, which sees every tick, says that it is enough.
    pub fn run_watched(&mut self, max_ticks: Tick, mut push: impl FnMut(TickRecord<'_>) -> bool) {
        while self.tick < max_ticks && self.tick() {
            if !push(self.record()) {
                break;
            }
        }
    }

    pub(crate) fn drive(&mut self, max_ticks: Tick, mut push: impl FnMut(TickRecord<'_>)) {
        self.run_watched(max_ticks, |tick| {
            push(tick);
            true
        });
    }
}

/// What this thread has used of a processor, ns.
fn thread_time_ns() -> u64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Scenario, Task};

    /// Mean cross-track and speed error, mm and mm/s.
    fn run(scenario: &str, law: &str, acceptance: &str) -> (f64, f64) {
        let mut scenario = Scenario::load(scenario).expect("built in");
        let assignments = [format!("controller.law={law}"), format!("tracking.acceptance={acceptance}")];
        scenario.system.set_all(&assignments).expect("known keys");
        let Task::Follow(waypoints) = &scenario.task else { panic!("it has no path of its own") };
        let mut robot = InProcess::new(&scenario.system, waypoints).expect("a robot");
        let figures = robot.run(200_000).statistics.figures();
        assert!(figures.reached);
        (figures.cross_track_mean_m * 1e3, figures.speed_error_mean_mps * 1e3)
    }

    #[test]
    fn the_predictive_law_meets_its_yardstick() {
        for (scenario, cross_track_mm) in [("trapezoid", 1.3), ("rectangle", 1.05), ("so", 0.5)] {
            let (cross_track, speed) = run(scenario, "qp", "law");
            assert!(
                cross_track <= cross_track_mm && speed <= 0.3,
                "{scenario}: {cross_track} mm, {speed} mm/s"
            );
        }
    }

    #[test]
    fn on_the_same_selector_it_beats_kanayama_in_both_figures() {
        for scenario in ["trapezoid", "rectangle", "rectangle-open", "so"] {
            let (ours, theirs) = (run(scenario, "qp", "rim"), run(scenario, "kanayama", "rim"));
            assert!(ours.0 < 0.6 * theirs.0 && ours.1 < 0.2 * theirs.1, "{scenario}: {ours:?} {theirs:?}");
        }
    }
}
