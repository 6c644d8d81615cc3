//! Goals of the recording, planned for again from where the robot is in this drive.

use super::boxes::Paths;
use crate::replay::boxes::planner::{Goals, plan};
use crate::replay::lives::{Changes, Life};
use crate::replay::log::RunLog;
use crate::shell::build;
use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::{Journal, JournalKind, PathHeader};
use hilare_interfaces::wires::Role;
use hilare_planner::Navigator;
use std::collections::VecDeque;

/// Goals to come.
pub struct Planning<'l> {
    waiting: VecDeque<(&'l Life, &'l Journal)>,
    goals: Goals<'l>,
    at_work: Option<(&'l Life, Navigator, Changes)>,
    /// What became of them, where it is not a path.
    pub notes: Vec<String>,
}

impl<'l> Planning<'l> {
    /// All of a recording.
    pub fn new(log: &'l RunLog) -> Self {
        let mut waiting: Vec<(&Life, &Journal)> = Vec::new();
        for life in log.lives.of_role(Role::Planner) {
            let goals = life.entries.iter().filter(|entry| entry.kind == JournalKind::Goal.code());
            waiting.extend(goals.map(|entry| (life, entry)));
        }
        Self { waiting: waiting.into(), goals: Goals::of(log), at_work: None, notes: Vec::new() }
    }

    /// Plans for those whose tick has come; their paths go among the others.
    pub fn plan(
        &mut self,
        log: &RunLog,
        tick: Tick,
        robot: Option<WorldPoint>,
        paths: &mut Paths,
    ) -> Result<(), String> {
        while let Some((life, entry)) = self.waiting.front().copied().filter(|(_, entry)| entry.tick <= tick)
        {
            self.waiting.pop_front();
            let [goal_id, accepted, path_id, cut_short, ..] = entry.words;
            let Some((header, waypoints)) = self.goals.next(entry) else {
                self.notes
                    .push(format!("goal {goal_id} is missing in the recording: its path is taken as it was"));
                continue;
            };
            if self.at_work.as_ref().is_none_or(|(known, ..)| !std::ptr::eq(*known, life)) {
                self.at_work = Some((life, build::navigator(log.system(life)?)?, life.changes()));
            }
            let Some((_, navigator, changes)) = &mut self.at_work else { continue };
            while let Some(number) = changes.due(entry.tick) {
                *navigator = build::navigator(log.numbered(number)?)?;
            }
            let start = log.system(life)?.start.position();
            let robot = if entry.tick == 0 { start } else { robot.unwrap_or(start) };
            let found = plan(navigator, header, waypoints, robot);
            if accepted == 0 || cut_short != 0 {
                if cut_short != 0 {
                    self.notes.push(format!(
                        "goal {goal_id} was searched for against the clock: its path is taken as it was"
                    ));
                }
                continue;
            }
            match found {
                Ok(path) => drop(paths.insert(path_id, (PathHeader { path_id, goal_id }, path))),
                Err(why) => {
                    paths.remove(&path_id);
                    self.notes.push(format!("goal {goal_id} at tick {tick} is refused now: {why}"));
                }
            }
        }
        Ok(())
    }
}
