//! The planner: every goal again, from the pose its journal names, with all the time there is.

use super::BoxReport;
use crate::replay::fields::{Difference, first_difference, same};
use crate::replay::ledger::Tally;
use crate::replay::lives::Life;
use crate::replay::log::{RunLog, WithWaypoints};
use crate::shell::build;
use crate::shell::planning::{OVERTAKEN, answer_of, first_of, path_for};
use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::{
    Answer, GoalHeader, Journal, JournalKind, PathHeader, Pose, Waypoint, field_text,
};
use hilare_interfaces::wires::Role;
use hilare_planner::{Navigator, Unlimited};
use std::collections::BTreeMap;

/// Replays every process of it.
pub fn replay(log: &RunLog) -> BoxReport {
    let mut report = BoxReport::new(Role::Planner);
    let mut judged = Judged::new(log);
    for life in log.lives.of_role(Role::Planner) {
        if let Err(why) = replay_life(log, life, &mut judged) {
            report.note(life, &why);
        }
    }
    judged.repeated();
    report.wires.extend([judged.paths, judged.answers]);
    report.wires.retain(|tally| tally.compared + tally.not_compared + tally.not_recorded > 0);
    report
}

/// Goals that were answered, in order.
pub struct Goals<'l> {
    asked: BTreeMap<u64, Vec<&'l WithWaypoints<GoalHeader>>>,
}

impl<'l> Goals<'l> {
    /// All that were recorded.
    pub fn of(log: &'l RunLog) -> Self {
        let mut asked: BTreeMap<u64, Vec<_>> = BTreeMap::new();
        // The first comes off the end.
        log.goals.iter().rev().for_each(|goal| asked.entry(goal.0.goal_id).or_default().push(goal));
        Self { asked }
    }

    /// The goal an entry of the journal speaks of.
    pub fn next(&mut self, entry: &Journal) -> Option<&'l WithWaypoints<GoalHeader>> {
        let same_id = self.asked.get_mut(&entry.words[0])?;
        // An id used again means another goal; the last one stays.
        if same_id.len() > 1 { same_id.pop() } else { same_id.first().copied() }
    }
}

/// Where the planner took the robot to be.
pub fn robot_at(log: &RunLog, tick: Tick, start: WorldPoint) -> Option<WorldPoint> {
    if tick == 0 {
        return Some(start);
    }
    log.poses.first(tick).filter(|pose| Pose::makes_sense(pose)).map(|pose| pose.pose().position())
}

fn replay_life(log: &RunLog, life: &Life, judged: &mut Judged<'_>) -> Result<(), String> {
    let system = log.system(life)?;
    let mut navigator = build::navigator(system)?;
    let first = life.incarnation == 1 && life.met.is_none();
    let own_path = log.path(1, None).filter(|(header, _)| header.goal_id == 0 && first);
    let begun = life.met.unwrap_or_else(|| life.incarnation.saturating_sub(1) << 32);
    let mut path_id = own_path.map_or(begun, |(header, _)| header.path_id);
    for entry in &life.entries {
        if entry.kind == JournalKind::Param.code() {
            navigator = build::navigator(log.numbered(entry.words[1])?)?;
        }
        if entry.kind != JournalKind::Goal.code() {
            continue;
        }
        let [goal_id, _, _, cut_short, ..] = entry.words;
        let recorded = judged.next_answer(goal_id);
        if cut_short != 0 {
            return Err(format!(
                "the search for goal {goal_id} was cut short by the clock or a newer goal: \
                 neither it nor those after it are compared"
            ));
        }
        let missing = |what: &str| format!("{what} of goal {goal_id} is missing in the recording");
        let (header, waypoints) = judged.goals.next(entry).ok_or_else(|| missing("the message"))?;
        let start = system.start.position();
        let robot = robot_at(log, entry.tick, start).ok_or_else(|| missing("the pose"))?;
        let found = plan(&mut navigator, header, waypoints, robot);
        let overtaken = recorded.is_some_and(|place| field_text(&log.answers[place].text) == OVERTAKEN);
        if overtaken {
            continue;
        }
        judged.answer(entry.tick, recorded, &answer_of(goal_id, &found));
        if let Ok(path) = found {
            path_id += 1;
            judged.path(entry.tick, &PathHeader { path_id, goal_id }, &path);
        }
    }
    if life.broken {
        Err("its journal has a gap: goals after it are not compared".to_owned())
    } else {
        Ok(())
    }
}

/// The planner's answer to a goal, with all the time there is.
pub fn plan(
    navigator: &mut Navigator,
    header: &GoalHeader,
    waypoints: &[Waypoint],
    robot: WorldPoint,
) -> Result<Vec<Waypoint>, String> {
    path_for(navigator, header, first_of(waypoints), robot, &mut Unlimited)
}

/// Recorded answers and paths, ticked off.
struct Judged<'l> {
    log: &'l RunLog,
    goals: Goals<'l>,
    paths: Tally,
    answers: Tally,
    path_seen: Vec<bool>,
    answer_seen: Vec<bool>,
}

impl<'l> Judged<'l> {
    fn new(log: &'l RunLog) -> Self {
        let tally = |wire: &str, recorded: usize| Tally {
            wire: wire.to_owned(),
            not_compared: recorded as u64,
            ..Tally::default()
        };
        Self {
            log,
            goals: Goals::of(log),
            paths: tally("path", log.paths.len()),
            answers: tally("answer", log.answers.len()),
            path_seen: vec![false; log.paths.len()],
            answer_seen: vec![false; log.answers.len()],
        }
    }

    fn next_answer(&mut self, goal_id: u64) -> Option<usize> {
        let answers = self.log.answers.iter().zip(&self.answer_seen);
        let place = answers.into_iter().position(|(answer, seen)| !seen && answer.goal_id == goal_id)?;
        self.answer_seen[place] = true;
        Some(place)
    }

    fn answer(&mut self, tick: Tick, recorded: Option<usize>, made: &Answer) {
        let Some(place) = recorded else {
            self.answers.not_recorded += 1;
            return;
        };
        note(&mut self.answers, first_difference(tick, &self.log.answers[place], made));
    }

    fn path(&mut self, tick: Tick, header: &PathHeader, made: &[Waypoint]) {
        let mut found = false;
        for (place, (known, waypoints)) in self.log.paths.iter().enumerate() {
            if known.path_id == header.path_id && !self.path_seen[place] {
                (self.path_seen[place], found) = (true, true);
                note(&mut self.paths, path_difference(tick, (known, waypoints), (header, made)));
            }
        }
        self.paths.not_recorded += u64::from(!found);
    }

    /// Of a path that is taken as given, its repetitions.
    fn repeated(&mut self) {
        let paths = &self.log.paths;
        for (place, (header, waypoints)) in paths.iter().enumerate() {
            let first = paths[..place].iter().find(|(known, _)| known.path_id == header.path_id);
            if let Some((known, points)) = first.filter(|_| !self.path_seen[place]) {
                note(&mut self.paths, path_difference(0, (header, waypoints), (known, points)));
            }
        }
    }
}

fn note(tally: &mut Tally, difference: Option<Difference>) {
    tally.not_compared = tally.not_compared.saturating_sub(1);
    tally.compared += 1;
    if let Some(difference) = difference {
        tally.differing += 1;
        tally.first.get_or_insert(difference);
    }
}

fn path_difference(
    tick: Tick,
    recorded: (&PathHeader, &[Waypoint]),
    made: (&PathHeader, &[Waypoint]),
) -> Option<Difference> {
    let header = first_difference(tick, recorded.0, made.0);
    let pairs = recorded.1.iter().zip(made.1).enumerate();
    let number = || {
        let (known, made) = (recorded.1.len(), made.1.len());
        (known != made)
            .then(|| Difference::of_words(tick, "number of waypoints", known.to_string(), made.to_string()))
    };
    let inside = || {
        let (i, (known, made)) = pairs.into_iter().find(|(_, (known, made))| !same(*known, *made))?;
        let found = first_difference(tick, known, made)?;
        Some(Difference { field: format!("waypoints[{i}].{}", found.field), ..found })
    };
    header.or_else(number).or_else(inside)
}
