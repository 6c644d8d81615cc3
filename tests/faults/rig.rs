//! The robot in virtual time: every box as a process of its own, every wire a queue, faults on both.
//!
//! The boxes are those of the shell ([`hilare::shell::build`]), stepped in the order of the diagram; so without
//! faults the bits are those of a run in one thread. A process can be killed, stopped, started again with
//! what it remembered; a message can be lost, late, doubled, spoilt. No operating system takes part:
//! thousands of runs a minute.

use super::controller::{self, Post};
use super::launch::{Launch, Policy};
use super::memory::Memory;
use super::motion::{Clock, Estimator, Wheelwork};
use super::plan::{Event, Fault, Place, Plan};
use super::watch::Watch;
use super::ways::{Planner, Selector};
use hilare::config::System;
use hilare::shell::ClockKind;
use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Mode, Pose, Reference, Steps, Truth, Waypoint};
use hilare_recorder::assembler::Assembler;
use hilare_recorder::statistics::RunStatistics;

/// What is to be driven, and by whom.
#[derive(Clone)]
pub struct Setup {
    /// The robot, with the law of the controller in charge.
    pub system: System,
    /// The same with the law of the standby; `None`: there is no standby.
    pub standby: Option<System>,
    /// Its path.
    pub path: Vec<Waypoint>,
    /// How launch deals with faults.
    pub policy: Policy,
    /// Waypoints that are asked for later, and when.
    pub goal: Option<(Tick, Vec<Waypoint>)>,
    /// Whether time passes or waits.
    pub clock: ClockKind,
}

/// The robot.
pub struct Rig {
    now: Tick,
    policy: Policy,
    pauses: Vec<Event>,
    memory: Memory,
    launch: Launch,
    planner: Planner,
    selector: Selector,
    /// The controllers: the one in charge at first, the standby.
    pub posts: Vec<Post>,
    clock: Clock,
    estimator: Estimator,
    plant: Wheelwork,
    pose: Pose,
    watch: Watch,
    statistics: RunStatistics,
    recorder: Assembler,
    steps: Vec<Steps>,
}

impl Rig {
    /// Armed, at the start, with a path; `seed` decides the details of the plan.
    pub fn new(setup: &Setup, plan: &Plan, seed: u64) -> Self {
        let system = &setup.system;
        let mut posts = vec![Post::new(&controller::ACTIVE, system, 10, plan, seed)];
        posts.extend(
            setup.standby.iter().map(|system| Post::new(&controller::STANDBY, system, 11, plan, seed)),
        );
        Self {
            now: 0,
            policy: setup.policy,
            pauses: plan.at(Place::Machine),
            memory: Memory::new(),
            launch: Launch::new(plan, seed, setup.policy, &posts),
            planner: Planner::new(system, &setup.path, setup.goal.clone(), plan),
            selector: Selector::new(system, plan, seed),
            posts,
            clock: Clock::new(system, setup.clock, plan, seed),
            estimator: Estimator::new(system, plan, seed),
            plant: Wheelwork::new(system, plan, seed),
            pose: Pose::ZERO,
            watch: Watch::new(system),
            statistics: RunStatistics::default(),
            recorder: Assembler::new(system.timing.period_ticks),
            steps: Vec::new(),
        }
    }

    /// Machine ticks so far.
    pub fn now(&self) -> Tick {
        self.now
    }

    /// State of the step generator after every tick executed.
    pub fn steps(&self) -> &[Steps] {
        &self.steps
    }

    /// The newest state; all zero before the first tick.
    pub fn newest(&self) -> Steps {
        self.steps.last().copied().unwrap_or(Steps::ZERO)
    }

    /// The newest pose.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Where the robot is.
    pub fn truth(&self) -> &Truth {
        self.plant.truth()
    }

    /// What the waypoint selector said last.
    pub fn reference(&self) -> &Reference {
        self.selector.reference()
    }

    /// The figures of the run so far; its hash is that of the estimated poses.
    pub fn statistics(&self) -> &RunStatistics {
        &self.statistics
    }

    /// What every tick was checked against.
    pub fn watch(&self) -> &Watch {
        &self.watch
    }

    /// The operator wants something.
    pub fn want(&mut self, mode: Mode) {
        self.launch.want(mode);
    }

    /// Launch wants something that it would refuse an operator.
    pub fn insist(&mut self, mode: Mode) {
        self.launch.insist(mode);
    }

    /// The last waypoint was accepted.
    pub fn arrived(&self) -> bool {
        self.selector.arrived()
    }

    /// Lets time pass until the robot has arrived, or `ticks` more have passed. True if it has.
    pub fn run(&mut self, ticks: Tick) -> bool {
        let end = self.now + ticks;
        while self.now < end && !self.arrived() {
            self.step();
        }
        self.arrived()
    }

    /// Lets a tick pass. True if the step generator executed one.
    pub fn step(&mut self) -> bool {
        let now = self.now;
        self.strike();
        self.manage();
        if let Some(steps) = self.clock.first_words(now) {
            self.tell(&steps);
            self.plant.step(now, self.estimator.sensors.as_mut());
        }
        let robot = self.pose.pose().position();
        self.planner.step(now, robot, &mut self.selector);
        self.estimate();
        let (posts, memory, recorder) = (&mut self.posts, &mut self.memory, &mut self.recorder);
        self.selector.step(now, memory, |reference| {
            recorder.push_reference(*reference);
            posts.iter_mut().for_each(|post| post.reference.send(now, reference));
        });
        posts.iter_mut().for_each(|post| post.step(now, memory));
        self.record();
        let executed = !self.ends() && self.execute();
        self.plant.step(now, self.estimator.sensors.as_mut());
        self.now += 1;
        executed
    }

    /// A run in one thread executes no tick after the arrival.
    fn ends(&mut self) -> bool {
        if self.arrived() {
            self.statistics.note_arrival();
        }
        self.arrived()
    }

    fn strike(&mut self) {
        for pause in &self.pauses {
            if pause.fault == Fault::Pause && pause.from == self.now {
                // Nobody runs: nobody sees more of it than that it is later.
                self.clock.lose(pause.ticks);
            }
        }
        let lives = [
            &mut self.launch.life,
            &mut self.planner.life,
            &mut self.selector.life,
            &mut self.clock.life,
            &mut self.estimator.life,
        ];
        for life in lives.into_iter().chain(self.posts.iter_mut().map(|post| &mut post.life)) {
            life.strike(self.now);
        }
        // What the dead have kept is gone.
        if !self.selector.life.alive() {
            self.posts.iter_mut().for_each(|post| post.reference.lose_writer());
        }
        if !self.estimator.life.alive() {
            self.selector.pose.lose_writer();
            self.posts.iter_mut().for_each(|post| post.pose.lose_writer());
        }
        if !self.clock.life.alive() {
            for link in [&mut self.estimator.steps, &mut self.plant.steps, &mut self.launch.steps] {
                link.lose_writer();
            }
        }
    }

    /// Launch looks after everybody.
    fn manage(&mut self) {
        let now = self.now;
        if !self.launch.life.runs(now) {
            return;
        }
        if self.policy.knows_dead(&self.clock.life, now) {
            self.launch.disarm();
        }
        self.launch.step(now, &mut self.posts, &mut self.clock.authority);
        if self.policy.replaces(&mut self.planner.life, now) {
            self.planner.start(now);
        }
        if self.policy.replaces(&mut self.selector.life, now) {
            self.selector.start(now, &self.planner, &mut self.memory);
        }
        if self.policy.replaces(&mut self.estimator.life, now) {
            self.estimator.start(now, &mut self.memory);
        }
        if self.policy.replaces(&mut self.clock.life, now) {
            self.clock.start(now, &mut self.memory);
            self.posts.iter_mut().for_each(|post| post.command.new_reader(now));
            self.watch.restarted();
        }
    }

    fn estimate(&mut self) {
        let (now, posts, selector) = (self.now, &mut self.posts, &mut self.selector);
        let (newest, watch, recorder) = (&mut self.pose, &self.watch, &mut self.recorder);
        self.estimator.step(now, &mut self.memory, |pose| {
            watch.pose(pose);
            *newest = *pose;
            recorder.push_pose(*pose);
            selector.pose.send(now, pose);
            posts.iter_mut().for_each(|post| post.pose.send(now, pose));
        });
    }

    /// The recorder reads along.
    fn record(&mut self) {
        let truth = *self.plant.truth();
        if self.now > 0 {
            self.recorder.push_truth(truth);
        }
        let statistics = &mut self.statistics;
        self.recorder.drain(|tick| statistics.push(tick));
    }

    /// The step generator's tick, if it runs.
    fn execute(&mut self) -> bool {
        let commands = self.posts.iter_mut().map(|post| &mut post.command);
        let executed = self.clock.step(self.now, commands, &mut self.watch, &mut self.memory);
        let Some((steps, sent)) = executed else { return false };
        self.steps.push(steps);
        self.recorder.push_steps(steps);
        if sent {
            self.tell(&steps);
        }
        true
    }

    fn tell(&mut self, steps: &Steps) {
        for link in [&mut self.plant.steps, &mut self.estimator.steps, &mut self.launch.steps] {
            link.send(self.now, steps);
        }
    }
}
