//! The boxes of a drive, each replaced by its successor where the recording has one.

use super::outside::{Answer, Outside};
use crate::replay::boxes::controller::{AtWork, identity};
use crate::replay::boxes::waypoint_selector::{self, paths_taken};
use crate::replay::boxes::{plant, pose_estimator};
use crate::replay::lives::{Changes, Life};
use crate::replay::log::{RunLog, WithWaypoints};
use crate::replay::states::States;
use crate::shell::boxes::Reckoner;
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use hilare_controller::ControllerInputs;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{Command, PathHeader, Pose, PoseFix, Reference, Steps, Wheels};
use hilare_interfaces::wires::Role;
use hilare_plant::{Observed, Plant};
use hilare_pose_estimator::EstimatorInputs;
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};
use std::collections::{BTreeMap, VecDeque};

/// Paths by their number, as they are in this drive.
pub type Paths = BTreeMap<u64, WithWaypoints<PathHeader>>;

/// Processes of a box that are still to come.
struct Line<'l>(VecDeque<&'l Life>);

impl<'l> Line<'l> {
    fn of(log: &'l RunLog, role: Role) -> Self {
        Self(log.lives.of_role(role).into())
    }

    /// The one that is at work from this tick on, if another one was before.
    fn next(&mut self, tick: Tick) -> Option<&'l Life> {
        let begins = |life: &&Life| life.done().map_or(life.tick <= tick, |done| done < tick);
        let mut next = None;
        while self.0.front().is_some_and(begins) {
            next = self.0.pop_front();
        }
        next
    }
}

/// The pose estimator.
pub struct Estimating<'l> {
    line: Line<'l>,
    at_work: Option<(&'l Life, Reckoner, Changes, bool, bool)>,
    fixes: Vec<PoseFix>,
}

impl<'l> Estimating<'l> {
    /// None at work yet.
    pub fn new(log: &'l RunLog) -> Self {
        Self { line: Line::of(log, Role::PoseEstimator), at_work: None, fixes: Vec::new() }
    }

    /// A fix has come.
    pub fn see(&mut self, fix: Option<PoseFix>) {
        self.fixes.extend(fix);
    }

    /// The pose of a tick.
    pub fn step(
        &mut self,
        log: &RunLog,
        states: &mut States,
        steps: &Steps,
        wheels: &Wheels,
    ) -> Result<Option<Pose>, String> {
        let tick = steps.tick;
        if let Some(life) = self.line.next(tick) {
            let system = log.system(life)?;
            let mut reckoner = Reckoner::new(system);
            if let Some(from) = life.state {
                states.load(from, estimator_key(log, life)?, &mut reckoner)?;
            }
            let encoders = system.motors.has_encoders();
            self.at_work = Some((life, reckoner, life.changes(), encoders, system.reads_sensors()));
        }
        let Some((life, reckoner, changes, encoders, sensors)) = &mut self.at_work else { return Ok(None) };
        pose_estimator::change(reckoner, log, changes, tick)?;
        let counts = if *encoders { &wheels.counts } else { &steps.counts };
        let due = self.fixes.iter().take_while(|fix| fix.tick <= tick && *sensors).count();
        let pose = reckoner.step(tick, EstimatorInputs { counts, fixes: &self.fixes[..due] });
        self.fixes.drain(..due);
        let key = estimator_key(log, life)?;
        states.keep(life.slot, tick, key, reckoner);
        Ok(Some(pose))
    }
}

fn estimator_key(log: &RunLog, life: &Life) -> Result<u64, String> {
    Ok(key_of((Role::PoseEstimator, log.system(life)?.estimator.name())))
}

/// The waypoint selector.
pub struct Selecting<'l> {
    line: Line<'l>,
    at_work: Option<(&'l Life, WaypointSelector, Changes)>,
    /// Paths to be taken, by tick.
    paths: VecDeque<(Tick, u64)>,
}

impl<'l> Selecting<'l> {
    /// None at work yet.
    pub fn new(log: &'l RunLog) -> Self {
        let line = Line::of(log, Role::WaypointSelector);
        let mut paths: Vec<(Tick, u64)> = line.0.iter().flat_map(|life| taken(life)).collect();
        paths.sort_unstable();
        Self { line, at_work: None, paths: paths.into() }
    }

    /// The reference of a tick.
    pub fn step(
        &mut self,
        log: &RunLog,
        states: &mut States,
        pose: &Pose,
        paths: &Paths,
    ) -> Result<Option<Reference>, String> {
        let (tick, key) = (pose.tick, key_of(Role::WaypointSelector));
        if let Some(life) = self.line.next(tick) {
            let mut selector = build::waypoint_selector(log.system(life)?);
            if let Some(from) = life.state {
                states.load(from, key, &mut selector)?;
                let awaited = selector.awaits_path().and_then(|path_id| paths.get(&path_id));
                if let Some((header, waypoints)) = awaited {
                    selector.take_up(NewPath { header, waypoints }).for_each(drop);
                }
            }
            self.at_work = Some((life, selector, life.changes()));
        }
        let Some((life, selector, changes)) = &mut self.at_work else { return Ok(None) };
        waypoint_selector::change(selector, log, changes, tick)?;
        let mut path_id = None;
        while let Some((_, taken)) = self.paths.front().filter(|(from, _)| *from <= tick) {
            path_id = Some(*taken);
            self.paths.pop_front();
        }
        let path = path_id.and_then(|path_id| paths.get(&path_id));
        let path = path.map(|(header, waypoints)| NewPath { header, waypoints });
        let reference = selector.step(tick, SelectorInputs { pose, path });
        states.keep(life.slot, tick, key, selector);
        Ok(Some(reference))
    }
}

fn taken(life: &Life) -> impl Iterator<Item = (Tick, u64)> {
    paths_taken(life).into_iter().map(|(tick, (path_id, _))| (tick, path_id))
}

/// A controller process.
pub struct Driving<'l> {
    life: &'l Life,
    at_work: Option<AtWork<'l>>,
    /// First and last tick it answered in the recording.
    answered: Option<(Tick, Tick)>,
    /// It was still at work when the recording ended.
    stays: bool,
}

impl<'l> Driving<'l> {
    /// Every one of the recording.
    pub fn all(log: &'l RunLog, period_ticks: u64) -> Vec<Self> {
        let last_reference = log.references.last(log.end).unwrap_or(0);
        let lives = log.lives.of_role(Role::Controller).into_iter();
        lives
            .map(|life| {
                let commands = log.commands.get(&identity(life)).map_or(&[][..], Vec::as_slice);
                let ticks = commands.iter().map(|command| command.pose_tick);
                let answered = ticks.clone().min().zip(ticks.max());
                let stays =
                    answered.is_some_and(|(_, last)| last + 4 * period_ticks.max(5) >= last_reference);
                Self { life, at_work: None, answered, stays }
            })
            .collect()
    }

    /// What it answers, if it does.
    fn answers(&self, tick: Tick, outside: &Outside, as_recorded: bool) -> bool {
        let Some((first, last)) = self.answered else { return false };
        let (source, epoch) = identity(self.life);
        match tick {
            tick if tick > last => self.stays,
            tick if as_recorded => outside.sent.contains(&(source, epoch, tick)),
            tick => tick >= first,
        }
    }

    /// The command for a reference and its pose, if it is at work; and which answer that is.
    pub fn step(
        &mut self,
        log: &'l RunLog,
        states: &mut States,
        outside: &Outside,
        as_recorded: bool,
        inputs: (&Reference, &Pose),
    ) -> Result<Option<(Answer, Command)>, String> {
        let (reference, pose) = inputs;
        let tick = reference.tick;
        if !self.answers(tick, outside, as_recorded) {
            return Ok(None);
        }
        if self.at_work.is_none() {
            let mut at_work = AtWork::begin(log, self.life)?;
            if let Some(from) = self.life.state
                && at_work.go_on(states, from).is_err()
            {
                // Of another law, or changed: it begins anew, with its own numbers.
                at_work = AtWork::begin(log, self.life)?;
                at_work.controller.number_on(self.life.met.unwrap_or(0));
            }
            self.at_work = Some(at_work);
        }
        let Some(at_work) = &mut self.at_work else { return Ok(None) };
        at_work.change(tick)?;
        let command = at_work.controller.step(tick, ControllerInputs { reference, pose });
        states.keep(self.life.slot, tick, at_work.key, &mut at_work.controller);
        Ok(Some(((command.source, command.epoch, tick), command)))
    }
}

/// The simulated robot.
pub struct Simulated {
    plant: Plant,
    changes: Changes,
}

impl Simulated {
    /// As its process begins.
    pub fn begin(log: &RunLog, states: &States) -> Result<Self, String> {
        let life = log.lives.of_role(Role::Plant).into_iter().next();
        let life = life.ok_or("the recording does not have the beginning of the plant")?;
        let mut plant = build::plant(log.system(life)?)?;
        if let Some(from) = life.state {
            states.load(from, key_of(Role::Plant), &mut plant)?;
        }
        Ok(Self { plant, changes: life.changes() })
    }

    /// What it shows after the steps.
    pub fn step(&mut self, log: &RunLog, steps: &Steps) -> Result<Observed, String> {
        plant::change(&mut self.plant, log, &mut self.changes, steps.tick)?;
        Ok(self.plant.step(steps.tick, steps))
    }
}
