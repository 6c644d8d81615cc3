//! The waypoint selector, with the pose of each reference's tick; a path acts from the tick its journal says.

use super::BoxReport;
use crate::replay::ledger::Ledger;
use crate::replay::lives::{Changes, Life, last_tick};
use crate::replay::log::RunLog;
use crate::replay::states::States;
use crate::replay::walk::{Walker, rising, walk};
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{JournalKind, Reference};
use hilare_interfaces::wires::Role;
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};
use std::collections::BTreeMap;

/// Replays every process of it.
pub fn replay(log: &RunLog, states: &mut States, measures: bool) -> BoxReport {
    let mut report = BoxReport::new(Role::WaypointSelector);
    let mut ledger = Ledger::new(log.references.all(), measures);
    // Of the end, some wires may have more than others.
    let end = log.poses.last(log.end).unwrap_or(0);
    ledger.certain_to(log.journal_end);
    let lives = log.lives.of_role(Role::WaypointSelector);
    for (n, life) in lives.iter().enumerate() {
        let period = log.system(life).map_or(1, |system| system.timing.period_ticks);
        let to = last_tick(&lives, n, period, end);
        if let Err(why) = replay_life(log, life, to, states, &mut ledger) {
            report.note(life, &why);
        }
    }
    if !lives.is_empty() {
        let period = log.first_system().map_or(1, |system| system.timing.period_ticks);
        ledger.know(log.references.unreachable(log.end, period));
    }
    report.wires.push(ledger.tally("reference"));
    report
}

/// Paths a process took, by the tick from which they act: number and length.
pub fn paths_taken(life: &Life) -> BTreeMap<Tick, (u64, u64)> {
    let taken = life.entries.iter().filter(|entry| entry.kind == JournalKind::Path.code());
    taken.map(|entry| (entry.tick, (entry.words[0], entry.words[2]))).collect()
}

fn replay_life(
    log: &RunLog,
    life: &Life,
    to: Tick,
    states: &mut States,
    ledger: &mut Ledger<'_, Reference>,
) -> Result<(), String> {
    let system = log.system(life)?;
    let period = system.timing.period_ticks;
    let key = key_of(Role::WaypointSelector);
    let (selector, paths, changes) = (build::waypoint_selector(system), paths_taken(life), life.changes());
    let mut walker = Selecting { log, selector, paths, changes };
    if let Some(from) = life.state {
        states.load(from, key, &mut walker.selector)?;
        for reference in walker.take_up()? {
            ledger.make(log.references.places(reference.tick), &reference);
        }
        states.keep(from.0, from.1, key, &mut walker.selector);
    }
    let answered = log.references.ticks(life.done(), to).into_iter();
    let answered = answered.filter(|tick| tick.is_multiple_of(period));
    let taken = walker.paths.keys().copied().filter(|tick| *tick <= to);
    let wanted = states.wanted(life.slot, life.done(), to);
    let ticks = rising(answered.chain(taken).chain(wanted));
    let next = life.done().map_or(0, |done| done + period);
    let broken = life.broken.then(|| life.entries.last().map_or(life.tick, |entry| entry.tick));
    let whole: Vec<Tick> = ticks.into_iter().filter(|tick| broken.is_none_or(|last| *tick <= last)).collect();
    walk(&mut walker, next, period, &whole, &log.references, |reference, walker| {
        ledger.make(log.references.places(reference.tick), reference);
        states.keep(life.slot, reference.tick, key, &mut walker.selector);
    })?;
    match broken {
        Some(last) => Err(format!("its journal has a gap after tick {last}")),
        None => {
            ledger.know(next..=to);
            Ok(())
        }
    }
}

/// Lets a selector go on with the parameters that are in force for its answer to the pose of `tick`.
pub fn change(
    selector: &mut WaypointSelector,
    log: &RunLog,
    changes: &mut Changes,
    tick: Tick,
) -> Result<(), String> {
    while let Some(number) = changes.due(tick) {
        let system = log.numbered(number)?;
        selector.set_tracking(system.tracking, system.acceptance());
    }
    Ok(())
}

#[derive(Clone)]
struct Selecting<'l> {
    log: &'l RunLog,
    selector: WaypointSelector,
    paths: BTreeMap<Tick, (u64, u64)>,
    changes: Changes,
}

impl Selecting<'_> {
    /// A successor takes up the path its predecessor was on, and repeats what that one said of it last.
    fn take_up(&mut self) -> Result<Vec<Reference>, String> {
        let Some(path_id) = self.selector.awaits_path() else { return Ok(Vec::new()) };
        let (header, waypoints) = self
            .log
            .path(path_id, None)
            .ok_or_else(|| format!("path {path_id}, which it was on, is not in the recording"))?;
        Ok(self.selector.take_up(NewPath { header, waypoints }).collect())
    }
}

impl Walker for Selecting<'_> {
    type Answer = Reference;

    fn step(&mut self, tick: Tick) -> Result<Reference, String> {
        let missing = || format!("the pose of tick {tick} is missing in the recording");
        let pose = self.log.poses.first(tick).ok_or_else(missing)?;
        change(&mut self.selector, self.log, &mut self.changes, tick)?;
        let path = match self.paths.get(&tick) {
            Some((path_id, waypoints)) => {
                let (header, waypoints) = self.log.path(*path_id, Some(*waypoints)).ok_or_else(|| {
                    format!(
                        "path {path_id} with {waypoints} waypoints, taken at tick {tick}, is not recorded"
                    )
                })?;
                Some(NewPath { header, waypoints })
            }
            None => None,
        };
        Ok(self.selector.step(tick, SelectorInputs { pose, path }))
    }
}
