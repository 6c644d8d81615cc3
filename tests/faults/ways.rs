//! Planner and waypoint selector of the virtual rig, as their processes are.

use super::life::Life;
use super::memory::Memory;
use super::plan::{Line, Plan, Process};
use super::wire::Link;
use hilare::config::System;
use hilare::shell::build;
use hilare::shell::checkpoint::key_of;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{GoalKind, PathHeader, Pose, Reference, ReferenceState, Waypoint};
use hilare_interfaces::wires;
use hilare_planner::{Navigator, Unlimited};
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};

/// A path and who it is.
type Path = (PathHeader, Vec<Waypoint>);

/// Goals into paths.
pub struct Planner {
    /// Whether it is there.
    pub life: Life,
    navigator: Navigator,
    path_id: u64,
    /// What it publishes first of all.
    first: Option<Path>,
    /// The path under way, in a file beside the robot.
    kept: Option<Path>,
    /// A goal on its way.
    goal: Option<(Tick, Vec<Waypoint>)>,
    /// What the present process has published last, for readers to come.
    history: Option<Path>,
}

impl Planner {
    /// With the scenario's own path, and a goal that comes later.
    pub fn new(system: &System, path: &[Waypoint], goal: Option<(Tick, Vec<Waypoint>)>, plan: &Plan) -> Self {
        Self {
            life: Life::new(plan, Process::Planner),
            navigator: build::navigator(system).expect("a map that can be read"),
            path_id: 0,
            first: Some((PathHeader { path_id: 1, goal_id: 0 }, path.to_vec())),
            kept: None,
            goal,
            history: None,
        }
    }

    /// A successor: it repeats the path under way.
    pub fn start(&mut self, now: Tick) {
        self.life.start(now);
        self.first = self.kept.clone();
        self.history = None;
        self.path_id = (self.life.incarnation() - 1) << 32;
    }

    /// Publishes what there is to publish.
    pub fn step(&mut self, now: Tick, robot: WorldPoint, selector: &mut Selector) {
        if !self.life.runs(now) {
            // What was asked of a dead one is lost.
            self.goal.take_if(|(at, _)| *at <= now && !self.life.alive());
            return;
        }
        if let Some(path) = self.first.take() {
            self.publish(now, path, selector);
        }
        if let Some((_, waypoints)) = self.goal.take_if(|(at, _)| *at <= now) {
            let path = self.navigator.path(GoalKind::Follow, &waypoints, robot, &mut Unlimited);
            let header = PathHeader { path_id: self.path_id + 1, goal_id: 1 };
            self.publish(now, (header, path.expect("a path that can be followed")), selector);
        }
    }

    /// First kept, then sent: a selector that has the path must find it again.
    fn publish(&mut self, now: Tick, path: Path, selector: &mut Selector) {
        self.kept = Some(path.clone());
        if self.life.strike_amid(now) {
            return;
        }
        self.path_id = self.path_id.max(path.0.path_id);
        selector.path = Some(path.clone());
        self.history = Some(path);
    }
}

/// Which waypoint.
pub struct Selector {
    /// Whether it is there.
    pub life: Life,
    /// From the pose estimator.
    pub pose: Link<Pose>,
    system: System,
    selector: WaypointSelector,
    key: u64,
    /// A path on its way.
    path: Option<Path>,
    /// The path this process has heard of last.
    path_id: u64,
    /// One that takes effect at the next control period.
    waiting: Option<Path>,
    done: Option<Tick>,
    /// The two newest poses that could not be answered for want of the path.
    held: [Option<Pose>; 2],
    reference: Reference,
}

impl Selector {
    /// Without a path.
    pub fn new(system: &System, plan: &Plan, seed: u64) -> Self {
        Self {
            life: Life::new(plan, Process::WaypointSelector),
            pose: Link::new(&wires::POSE, Line::PoseToSelector, plan, seed),
            selector: build::waypoint_selector(system),
            key: key_of("waypoint_selector"),
            system: system.clone(),
            path: None,
            path_id: 0,
            waiting: None,
            done: None,
            held: [None; 2],
            reference: Reference::ZERO,
        }
    }

    /// A successor.
    pub fn start(&mut self, now: Tick, planner: &Planner, memory: &mut Memory) {
        self.life.start(now);
        let build = build::waypoint_selector;
        (self.selector, self.done) = memory.resume(Process::WaypointSelector, self.key, &self.system, build);
        (self.path, self.path_id, self.waiting) = (planner.history.clone(), 0, None);
        self.held = [None; 2];
        self.pose.new_reader(now);
    }

    /// What it said last.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The last waypoint was accepted.
    pub fn arrived(&self) -> bool {
        self.reference.state == ReferenceState::Arrived.code()
    }

    /// Answers the poses that have come; `send` is what it says.
    pub fn step(&mut self, now: Tick, memory: &mut Memory, mut send: impl FnMut(&Reference)) {
        if !self.life.runs(now) {
            return;
        }
        if let Some(path) = self.path.take().filter(|path| path.0.path_id != self.path_id) {
            self.path_id = path.0.path_id;
            self.waiting = Some(path);
        }
        self.take_up(&mut send);
        let lost = self.selector.awaits_path().is_some() && self.waiting.is_none();
        while let Some(pose) = self.next(now, lost) {
            let begins_period = pose.tick.is_multiple_of(self.system.timing.period_ticks);
            if !begins_period || self.done.is_some_and(|done| pose.tick <= done) {
                continue;
            }
            if lost {
                self.held = [self.held[1], Some(pose)];
                continue;
            }
            let path = self.waiting.take();
            let path = path.as_ref().map(|(header, waypoints)| NewPath { header, waypoints });
            self.reference = self.selector.step(pose.tick, SelectorInputs { pose: &pose, path });
            send(&self.reference);
            if self.life.strike_amid(now) {
                return;
            }
            self.done = Some(pose.tick);
            memory.remember(Process::WaypointSelector, self.key, pose.tick, &mut self.selector);
        }
    }
    fn next(&mut self, now: Tick, lost: bool) -> Option<Pose> {
        let held = self.held.iter_mut().find_map(|held| held.take_if(|_| !lost));
        held.or_else(|| self.pose.next(now))
    }

    /// The awaited path is there: what the predecessor said last is said again.
    fn take_up(&mut self, send: &mut impl FnMut(&Reference)) {
        let Some((header, waypoints)) =
            self.waiting.as_ref().filter(|_| self.selector.awaits_path().is_some())
        else {
            return;
        };
        for reference in self.selector.take_up(NewPath { header, waypoints }) {
            self.reference = reference;
            send(&reference);
        }
        if self.selector.awaits_path().is_none() {
            self.waiting = None;
        }
    }
}
