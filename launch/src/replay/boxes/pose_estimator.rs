//! The pose estimator, with the steps, wheels and fixes of each pose's tick.

use super::BoxReport;
use crate::config::System;
use crate::replay::ledger::Ledger;
use crate::replay::lives::{Changes, Life, last_tick};
use crate::replay::log::RunLog;
use crate::replay::states::States;
use crate::replay::walk::{Walker, rising, walk};
use crate::shell::boxes::Reckoner;
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::Pose;
use hilare_interfaces::wires::Role;
use hilare_pose_estimator::EstimatorInputs;

/// Replays every process of it.
pub fn replay(log: &RunLog, states: &mut States, measures: bool) -> BoxReport {
    let mut report = BoxReport::new(Role::PoseEstimator);
    let mut ledger = Ledger::new(log.poses.all(), measures);
    let lives = log.lives.of_role(Role::PoseEstimator);
    for (n, life) in lives.iter().enumerate() {
        // Of the end, some wires may have more than others.
        let sensors = log.system(life).is_ok_and(System::reads_sensors);
        let inputs = [log.steps.last(log.end), log.wheels.last(log.end).filter(|_| sensors)];
        let end = inputs.into_iter().flatten().min().unwrap_or(0);
        let to = last_tick(&lives, n, 1, end);
        if let Err(why) = replay_life(log, life, to, states, &mut ledger) {
            report.note(life, &why);
        }
    }
    if !lives.is_empty() {
        ledger.know(log.poses.unreachable(log.end, 1));
    }
    report.wires.push(ledger.tally("pose"));
    report
}

fn replay_life(
    log: &RunLog,
    life: &Life,
    to: Tick,
    states: &mut States,
    ledger: &mut Ledger<'_, Pose>,
) -> Result<(), String> {
    let system = log.system(life)?;
    let key = key_of((Role::PoseEstimator, system.estimator.name()));
    let mut walker = Estimating {
        log,
        reckoner: Reckoner::new(system),
        encoders: system.motors.has_encoders(),
        sensors: system.reads_sensors(),
        changes: life.changes(),
        done: life.done(),
    };
    if let Some(from) = life.state {
        states.load(from, key, &mut walker.reckoner)?;
        let told: Vec<Pose> = walker.reckoner.told().copied().collect();
        told.iter().for_each(|pose| ledger.make(log.poses.places(pose.tick), pose));
        states.keep(from.0, from.1, key, &mut walker.reckoner);
    }
    let ticks = log.poses.ticks(life.done(), to);
    let ticks = rising(ticks.into_iter().chain(states.wanted(life.slot, life.done(), to)));
    let next = life.done().map_or(0, |done| done + 1);
    walk(&mut walker, next, 1, &ticks, &log.poses, |pose, walker| {
        ledger.make(log.poses.places(pose.tick), pose);
        states.keep(life.slot, pose.tick, key, &mut walker.reckoner);
    })?;
    ledger.know(next..=to);
    Ok(())
}

/// Lets an estimator go on with the parameters that are in force for its step to `tick`.
pub fn change(
    reckoner: &mut Reckoner,
    log: &RunLog,
    changes: &mut Changes,
    tick: Tick,
) -> Result<(), String> {
    while let Some(number) = changes.due(tick.saturating_sub(1)) {
        let mut estimator = build::pose_estimator(log.numbered(number)?);
        estimator.take_over(&mut reckoner.estimator);
        reckoner.estimator = estimator;
    }
    Ok(())
}

/// The box, and the tick it has answered last.
#[derive(Clone)]
struct Estimating<'l> {
    log: &'l RunLog,
    reckoner: Reckoner,
    encoders: bool,
    sensors: bool,
    changes: Changes,
    done: Option<Tick>,
}

impl Walker for Estimating<'_> {
    type Answer = Pose;

    fn step(&mut self, tick: Tick) -> Result<Pose, String> {
        let missing = |wire: &str| format!("the {wire} of tick {tick} are missing in the recording");
        let steps = self.log.steps.first(tick).ok_or_else(|| missing("steps"))?;
        change(&mut self.reckoner, self.log, &mut self.changes, tick)?;
        let pose = if self.sensors {
            let wheels = self.log.wheels.first(tick).ok_or_else(|| missing("wheels"))?;
            let counts = if self.encoders { &wheels.counts } else { &steps.counts };
            let fixes = self.log.fixes.between(self.done, tick);
            self.reckoner.step(tick, EstimatorInputs { counts, fixes })
        } else {
            self.reckoner.step(tick, EstimatorInputs { counts: &steps.counts, fixes: &[] })
        };
        self.done = Some(tick);
        Ok(pose)
    }
}
