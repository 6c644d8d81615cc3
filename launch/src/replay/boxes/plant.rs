//! The simulated robot, from its seed, with the steps of each tick.

use super::BoxReport;
use crate::replay::ledger::Ledger;
use crate::replay::lives::Changes;
use crate::replay::log::RunLog;
use crate::replay::states::States;
use crate::replay::walk::{Walker, rising, walk};
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{PoseFix, Truth, Wheels};
use hilare_interfaces::wires::Role;
use hilare_plant::{Observed, Plant};

/// Replays it. A simulated robot has no successor: its death is the end of the robot.
pub fn replay(log: &RunLog, states: &mut States, measures: bool) -> BoxReport {
    let mut report = BoxReport::new(Role::Plant);
    let mut truths = Ledger::new(log.truths.all(), measures);
    let mut wheels: Ledger<'_, Wheels> = Ledger::new(log.wheels.all(), measures);
    let mut fixes: Ledger<'_, PoseFix> = Ledger::new(log.fixes.all(), measures);
    let lives = log.lives.of_role(Role::Plant);
    for life in lives.iter().take(1) {
        let to = log.end;
        let next = life.done().map_or(life.tick, |done| done + 1);
        let mut replay_life = || -> Result<(), String> {
            let system = log.system(life)?;
            let sensors = system.reads_sensors();
            let (mut plant, changes) = (build::plant(system)?, life.changes());
            if let Some(from) = life.state {
                states.load(from, key_of(Role::Plant), &mut plant)?;
            }
            let mut walker = Simulating { log, plant, changes, seen: Vec::new() };
            let before = next.checked_sub(1);
            let ticks = rising([log.truths.ticks(before, to), log.wheels.ticks(before, to)].concat());
            walk(&mut walker, next, 1, &ticks, &log.truths, |truth, walker| {
                let tick = truth.tick;
                states.keep(life.slot, tick, key_of(Role::Plant), &mut walker.plant);
                truths.make(log.truths.places(tick), truth);
                let seen = walker.seen.iter().find(|seen| sensors && seen.truth.tick == tick).copied();
                walker.seen.retain(|seen| seen.truth.tick > tick);
                if let Some(seen) = seen {
                    wheels.make(log.wheels.places(tick), &seen.wheels);
                    if let Some(fix) = &seen.fix {
                        fixes.make(log.fixes.places(fix.tick), fix);
                    }
                }
            })
        };
        match replay_life() {
            Ok(()) => {
                let known = next..=to;
                truths.know(known.clone());
                wheels.know(known.clone());
                fixes.know(known);
            }
            Err(why) => report.note(life, &why),
        }
    }
    if !lives.is_empty() {
        truths.know(log.truths.unreachable(log.end, 1));
        wheels.know(log.wheels.unreachable(log.end, 1));
        fixes.know(log.wheels.unreachable(log.end, 1));
    }
    report.wires.extend([truths.tally("truth"), wheels.tally("wheels"), fixes.tally("fix")]);
    report.wires.retain(|tally| tally.compared + tally.not_compared + tally.not_recorded > 0);
    report
}

/// Lets a robot go on with the parameters that are in force for its step to `tick`.
pub fn change(plant: &mut Plant, log: &RunLog, changes: &mut Changes, tick: Tick) -> Result<(), String> {
    while let Some(number) = changes.due(tick.saturating_sub(1)) {
        let mut other = build::plant(log.numbered(number)?)?;
        other.take_over(plant);
        *plant = other;
    }
    Ok(())
}

#[derive(Clone)]
struct Simulating<'l> {
    log: &'l RunLog,
    plant: Plant,
    changes: Changes,
    seen: Vec<Observed>,
}

impl Walker for Simulating<'_> {
    type Answer = Truth;

    fn step(&mut self, tick: Tick) -> Result<Truth, String> {
        let missing = || format!("the steps of tick {tick} are missing in the recording");
        let steps = self.log.steps.first(tick).ok_or_else(missing)?;
        change(&mut self.plant, self.log, &mut self.changes, tick)?;
        let observed = self.plant.step(tick, steps);
        self.seen.push(observed);
        Ok(observed.truth)
    }
}
