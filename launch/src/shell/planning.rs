//! The planner's process: goals in, paths and answers out.

use super::build;
use super::page::News;
use super::renewal::Renewals;
use super::standing::Stands;
use super::transport::{Input, Output, SliceInput, SliceOutput};
use super::worker::{Reactive, Report, Worker};
use crate::whole::write_whole;
use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{
    Answer, GoalHeader, GoalKind, JournalKind, MAX_WAYPOINTS, PathHeader, Pose, Waypoint, text_field,
};
use hilare_interfaces::wires;
use hilare_planner::{Budget, Navigator};
use std::fs::File;
use std::mem;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tracing::warn;

/// Why a goal was not planned for.
pub const OVERTAKEN: &str = "overtaken by a newer goal";

/// goal, pose → path, answer.
pub struct PlannerProcess {
    navigator: Navigator,
    renewals: Renewals<Navigator>,
    goal: SliceInput<GoalHeader, Waypoint>,
    pose: Input<Pose>,
    path: SliceOutput<PathHeader, Waypoint>,
    answer: Output<Answer>,
    /// Where the robot is; before the first pose, where the system says it starts.
    robot: WorldPoint,
    deadline: Duration,
    /// The scenario's own path, or the one a predecessor left: published first of all.
    first: Option<(PathHeader, Vec<Waypoint>)>,
    kept: KeptPath,
    /// The last search was ended by the clock or by a newer goal.
    cut_short: bool,
    report: Report,
}

impl PlannerProcess {
    /// Opens its ports, reads the scenario's path and the map, if there are any.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let incarnation = worker.assignment.incarnation;
        worker.journal_began(0, None);
        let system = &worker.system;
        let navigator = build::navigator(system)?;
        let kept = KeptPath::in_dir(&worker.assignment.runtime_dir);
        // A successor must not send the robot back to the beginning: it repeats the path under way.
        let first = match kept.read() {
            Some(path) => Some(path),
            None if incarnation == 1 => first_path(&worker.assignment.runtime_dir, &navigator)?,
            None => None,
        };
        Ok(Self {
            navigator,
            renewals: Renewals::begin(worker, build::navigator)?,
            goal: worker.domain.slice_input(&wires::GOAL)?,
            pose: worker.domain.newest(&wires::watch::POSE)?,
            path: worker.domain.slice_output(&wires::PATH)?,
            answer: worker.domain.output(&wires::ANSWER)?,
            robot: system.start.position(),
            deadline: Duration::from_millis(system.planner.deadline_ms),
            first,
            kept,
            cut_short: false,
            // Path ids go up over restarts, too.
            report: Report { path_id: (incarnation - 1) << 32, ..Report::default() },
        })
    }

    /// Goes on with other parameters, if it is to once the robot is where the pose of tick `next` says.
    fn renew_at(&mut self, worker: &mut Worker, next: Tick) {
        let Some(mut renewal) = self.renewals.due(worker, next) else { return };
        mem::swap(&mut self.navigator, &mut renewal.made);
        mem::swap(&mut worker.system, &mut renewal.system);
        self.deadline = Duration::from_millis(worker.system.planner.deadline_ms);
        self.renewals.applied(worker, renewal, next, false);
    }

    fn publish(&mut self, goal_id: u64, path: &[Waypoint]) -> bool {
        let header = PathHeader { path_id: self.report.path_id + 1, goal_id };
        self.send(header, path)
    }

    fn send(&mut self, header: PathHeader, path: &[Waypoint]) -> bool {
        // First kept: a selector that has the path must find it again.
        let before = self.kept.replace(&header, path);
        let sent = self.path.send(&header, path.iter().copied());
        if sent {
            self.report.path_id = self.report.path_id.max(header.path_id);
        } else {
            self.kept.restore(before);
        }
        sent
    }

    /// Plans for a goal and publishes the path; on any failure the old path stays.
    fn answer(&mut self, worker: &Worker, header: &GoalHeader, waypoints: &[Waypoint]) -> Answer {
        let goals = &self.goal;
        let newer_goal = || {
            worker.page.give_sign_of_life(worker.assignment.slot);
            goals.waiting()
        };
        let mut budget = Until { start: Instant::now(), limit: self.deadline, newer_goal, over: false };
        let found = path_for(&mut self.navigator, header, waypoints, self.robot, &mut budget);
        self.cut_short = budget.over;
        let found = match found {
            Err(_) if self.goal.waiting() => Err(OVERTAKEN.to_owned()),
            Ok(path) if !self.publish(header.goal_id, &path) => {
                Err("the path could not be published; is /dev/shm full?".to_owned())
            }
            found => found,
        };
        answer_of(header.goal_id, &found)
    }
}

/// The path for a goal, the robot being at `robot`; or why there is none.
pub fn path_for(
    navigator: &mut Navigator,
    header: &GoalHeader,
    waypoints: &[Waypoint],
    robot: WorldPoint,
    budget: &mut dyn Budget,
) -> Result<Vec<Waypoint>, String> {
    let kind = GoalKind::from_code(header.kind).ok_or("unknown kind of goal")?;
    if header.has_heading != 0 {
        return Err("a final heading cannot be promised yet; leave THETA away".to_owned());
    }
    navigator.path(kind, waypoints, robot, budget)
}

/// What is answered to a goal for which this was found.
pub fn answer_of(goal_id: u64, found: &Result<Vec<Waypoint>, String>) -> Answer {
    match found {
        Ok(path) => {
            Answer { goal_id, accepted: 1, waypoints: path.len() as u64, text: text_field("accepted") }
        }
        Err(why) => Answer { goal_id, text: text_field(why), ..Answer::ZERO },
    }
}

/// As many waypoints of a goal as are looked at: one more than there may be, so that too many are refused as such.
pub fn first_of(waypoints: &[Waypoint]) -> &[Waypoint] {
    &waypoints[..waypoints.len().min(MAX_WAYPOINTS + 1)]
}

impl Reactive for PlannerProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        if let Some((header, path)) = self.first.take()
            && self.send(header, &path)
        {
            worker.page.announce(News::Path);
            worker.page.ring(&wires::PATH);
        }
        if let Some(pose) = self.pose.last().filter(Pose::makes_sense) {
            self.robot = pose.pose().position();
            self.report.tick = pose.tick;
        }
        self.renew_at(worker, self.report.tick);
        let next_goal = || self.goal.next(|header, waypoints| (*header, first_of(waypoints).to_vec()));
        let Some(mut goal) = next_goal() else { return false };
        while let Some(newer) = next_goal() {
            let text = text_field(OVERTAKEN);
            self.answer.send(&Answer { goal_id: goal.0.goal_id, text, ..Answer::ZERO });
            goal = newer;
        }
        let answer = self.answer(worker, &goal.0, &goal.1);
        let cut_short = u64::from(mem::take(&mut self.cut_short));
        let words = [answer.goal_id, answer.accepted, self.report.path_id, cut_short];
        worker.journal(self.report.tick, JournalKind::Goal, &words);
        self.answer.send(&answer);
        worker.page.announce(News::Path);
        worker.page.ring(&wires::PATH);
        self.report.steps += 1;
        true
    }

    fn report(&self) -> Report {
        self.report
    }

    fn stands(&mut self, _room: &mut [u64]) -> Option<Stands> {
        Some(Stands { number: self.report.path_id, ..Stands::default() })
    }

    fn connect(&self) {
        self.goal.connect();
        self.pose.connect();
        self.path.connect();
        self.answer.connect();
    }
}

/// The scenario's own path, if it has one.
fn first_path(dir: &Path, navigator: &Navigator) -> Result<Option<(PathHeader, Vec<Waypoint>)>, String> {
    let file = dir.join("waypoints.csv");
    let Ok(text) = File::open(&file) else { return Ok(None) };
    let waypoints =
        hilare_planner::waypoint_file::parse(text).map_err(|error| format!("{}:{error}", file.display()))?;
    let path = navigator.fitted(waypoints)?;
    Ok(Some((PathHeader { path_id: 1, goal_id: 0 }, path)))
}

/// The path under way, in a file: a selector that starts again has to get it, and the planner that found it
/// may be gone.
struct KeptPath(PathBuf);

impl KeptPath {
    fn in_dir(dir: &Path) -> Self {
        Self(dir.join("path.csv"))
    }

    /// Keeps another path; returns the text of the one before.
    fn replace(&self, header: &PathHeader, path: &[Waypoint]) -> Option<String> {
        let before = std::fs::read_to_string(&self.0).ok();
        let waypoints = hilare_planner::waypoint_file::write(path);
        self.write(&format!("# {} {}\n{waypoints}", header.path_id, header.goal_id));
        before
    }

    /// Goes back to the path before; nobody has got the new one.
    fn restore(&self, before: Option<String>) {
        match before {
            Some(text) => self.write(&text),
            None => drop(std::fs::remove_file(&self.0)),
        }
    }

    /// Whole or not at all. Without room the drive goes on; only a successor will have no path.
    fn write(&self, text: &str) {
        if let Err(error) = write_whole(&self.0, text.as_bytes()) {
            warn!("{error}: a successor will not know the path");
        }
    }

    fn read(&self) -> Option<(PathHeader, Vec<Waypoint>)> {
        let text = std::fs::read_to_string(&self.0).ok()?;
        let (head, waypoints) = text.split_once('\n')?;
        let (path_id, goal_id) = head.strip_prefix("# ")?.split_once(' ')?;
        let header = PathHeader { path_id: path_id.parse().ok()?, goal_id: goal_id.parse().ok()? };
        let path = hilare_planner::waypoint_file::parse(waypoints.as_bytes()).ok()?;
        Some((header, path))
    }
}

/// Until a deadline on the machine's clock (zero is none), or until nobody wants the answer any more.
struct Until<F> {
    start: Instant,
    limit: Duration,
    newer_goal: F,
    /// It has ended something.
    over: bool,
}

impl<F: Fn() -> bool> Budget for Until<F> {
    fn exhausted(&mut self) -> bool {
        self.over |= (!self.limit.is_zero() && self.start.elapsed() >= self.limit) || (self.newer_goal)();
        self.over
    }
}
