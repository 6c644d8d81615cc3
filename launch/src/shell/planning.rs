//! The planner's process: goals in, paths and answers out.

use super::build;
use super::transport::{Input, Output, SliceInput, SliceOutput};
use super::worker::{Reactive, Report, Worker};
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Answer, GoalHeader, GoalKind, PathHeader, Pose, Waypoint, text_field};
use hilare_interfaces::wires;
use hilare_planner::{Budget, Navigator};
use std::time::{Duration, Instant};

/// Why a goal was not planned for.
const OVERTAKEN: &str = "overtaken by a newer goal";

/// goal, pose → path, answer.
pub struct PlannerProcess {
    navigator: Navigator,
    goal: SliceInput<GoalHeader, Waypoint>,
    pose: Input<Pose>,
    path: SliceOutput<PathHeader, Waypoint>,
    answer: Output<Answer>,
    /// Where the robot is; before the first pose, where the system says it starts.
    robot: WorldPoint,
    deadline: Duration,
    /// The scenario's own path, published first of all.
    first: Vec<Waypoint>,
    report: Report,
}

impl PlannerProcess {
    /// Opens its ports, reads the scenario's path and the map, if there are any.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let file = worker.assignment.runtime_dir.join("waypoints.csv");
        let incarnation = worker.assignment.incarnation;
        // A successor must not send the robot back to the beginning.
        let first = match std::fs::File::open(&file) {
            Ok(text) if incarnation == 1 => hilare_planner::waypoint_file::parse(text)
                .map_err(|error| format!("{}:{error}", file.display()))?,
            _ => Vec::new(),
        };
        let system = &worker.system;
        let navigator = build::navigator(system)?;
        let first = if first.is_empty() { first } else { navigator.fitted(first)? };
        Ok(Self {
            navigator,
            goal: worker.domain.slice_input(&wires::GOAL)?,
            pose: worker.domain.newest(&wires::POSE)?,
            path: worker.domain.slice_output(&wires::PATH)?,
            answer: worker.domain.output(&wires::ANSWER)?,
            robot: system.start.position(),
            deadline: Duration::from_millis(system.planner.deadline_ms),
            first,
            // Path ids go up over restarts, too.
            report: Report { path_id: (incarnation - 1) << 32, ..Report::default() },
        })
    }

    fn publish(&mut self, goal_id: u64, path: &[Waypoint]) -> bool {
        let header = PathHeader { path_id: self.report.path_id + 1, goal_id };
        let sent = self.path.send(&header, path.iter().copied());
        if sent {
            self.report.path_id = header.path_id;
        }
        sent
    }

    /// Plans for a goal and publishes the path; on any failure the old path stays.
    fn answer(&mut self, header: &GoalHeader, waypoints: &[Waypoint]) -> Answer {
        let refused = |why: &str| Answer { goal_id: header.goal_id, text: text_field(why), ..Answer::ZERO };
        let Some(kind) = GoalKind::from_code(header.kind) else { return refused("unknown kind of goal") };
        if header.has_heading != 0 {
            return refused("a final heading cannot be promised yet; leave THETA away");
        }
        let goals = &self.goal;
        let mut budget =
            Until { start: Instant::now(), limit: self.deadline, newer_goal: || goals.waiting() };
        match self.navigator.path(kind, waypoints, self.robot, &mut budget) {
            Err(_) if self.goal.waiting() => refused(OVERTAKEN),
            Err(why) => refused(&why),
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
            self.robot = pose.pose().position();
            self.report.tick = pose.tick;
        }
        let next_goal = || self.goal.next(|header, waypoints| (*header, waypoints.to_vec()));
        let Some(mut goal) = next_goal() else { return false };
        while let Some(newer) = next_goal() {
            let text = text_field(OVERTAKEN);
            self.answer.send(&Answer { goal_id: goal.0.goal_id, text, ..Answer::ZERO });
            goal = newer;
        }
        let answer = self.answer(&goal.0, &goal.1);
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

/// Until a deadline on the machine's clock (zero is none), or until nobody wants the answer any more.
struct Until<F> {
    start: Instant,
    limit: Duration,
    newer_goal: F,
}

impl<F: Fn() -> bool> Budget for Until<F> {
    fn exhausted(&mut self) -> bool {
        (!self.limit.is_zero() && self.start.elapsed() >= self.limit) || (self.newer_goal)()
    }
}
