//! A recording begun in mid-drive, moved on to a tick at which it can be driven again.
//!
//! The boxes said where they stood one after the other, some ticks apart. Each is replayed from there to a common cut, the
//! beginning S of a control period: the step generator has told S, and nobody has answered it yet.
//!
//! ```text
//!   step generator ─ S      plant, estimator ─ S − 1      selector, controllers ─ S − period
//! ```

use super::super::boxes;
use super::super::lives::Life;
use super::super::log::RunLog;
use super::super::states::{Met, States};
use crate::replay::boxes::controller::identity;
use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::{Journal, JournalKind};
use hilare_interfaces::wires::Role;

/// The cut.
#[derive(Clone, Copy)]
struct Cut {
    tick: Tick,
    period: u64,
}

impl Cut {
    /// The tick a box has answered last; none for one without a state.
    fn done(self, role: Role) -> Option<Tick> {
        match role {
            Role::StepGenerator => Some(self.tick),
            Role::Plant | Role::PoseEstimator => Some(self.tick - 1),
            Role::WaypointSelector | Role::Controller => Some(self.tick - self.period),
            _ => None,
        }
    }

    /// True if a box noted an entry before the cut. Those that answer ticks note what acts on the next one.
    fn is_before(self, role: Role, entry: &Journal) -> bool {
        match role {
            Role::Plant | Role::PoseEstimator => entry.tick + 1 < self.tick,
            Role::WaypointSelector | Role::Controller => entry.tick + self.period <= self.tick,
            _ => entry.tick < self.tick,
        }
    }
}

/// The recording from where it can be driven: as it is, if it has the beginning.
pub fn moved(mut log: RunLog) -> Result<RunLog, String> {
    let met = || log.lives.all.iter().filter(|life| life.met.is_some());
    let Some(last) = met().filter_map(Life::done).max().filter(|last| *last > 0) else { return Ok(log) };
    let clock = met().find(|life| life.role == Role::StepGenerator);
    let clock = clock.ok_or("where the step generator stood when the recording began is not known")?;
    let period = log.system(clock)?.timing.period_ticks;
    let cut = Cut { tick: (last / period + 2) * period, period };
    if cut.tick >= log.end {
        return Err("the recording ends where it begins: there is nothing to drive again".to_owned());
    }
    let mut states = States::new(&log);
    for life in met() {
        states.want(cut.done(life.role).map(|done| (life.slot, done)));
    }
    boxes::waypoint_selector::replay(&log, &mut states, false);
    let (_, lost) = boxes::controller::replay(&log, &mut states, false);
    boxes::step_generator::replay(&log, &mut states, &lost, false);
    boxes::pose_estimator::replay(&log, &mut states, false);
    boxes::plant::replay(&log, &mut states, false);

    let (mut lives, mut remembered) = (log.lives.clone(), Vec::new());
    for life in lives.all.iter_mut().filter(|life| life.met.is_some()) {
        move_life(life, cut, &log);
        let Some(place) = life.state.filter(|_| life.role != Role::Planner) else { continue };
        let met = Met::at(life, place, &log.systems).and_then(|met| met.with(&states));
        match met {
            Some(met) => remembered.push(met),
            // It had left by then.
            None if life.role == Role::Controller && !answers_after(&log, life, place.1) => {}
            None => {
                let (name, tick) = (life.name(), place.1);
                return Err(format!(
                    "what {name} remembered at tick {tick} does not follow from the recording"
                ));
            }
        }
    }
    (log.lives, log.met, log.begin) = (lives, remembered, cut.tick);
    Ok(log)
}

fn answers_after(log: &RunLog, life: &Life, tick: Tick) -> bool {
    let sent = log.commands.get(&identity(life)).into_iter().flatten();
    sent.into_iter().any(|command| command.pose_tick > tick)
}

fn move_life(life: &mut Life, cut: Cut, log: &RunLog) {
    let role = life.role;
    let in_force = |entry: &&Journal| entry.kind == JournalKind::Param.code() && cut.is_before(role, entry);
    life.system = life.entries.iter().rfind(in_force).map_or(life.system, |entry| entry.words[1]);
    life.entries.retain(|entry| !cut.is_before(role, entry));
    let Some(done) = cut.done(role) else { return };
    (life.tick, life.state) = (done, Some((life.slot, done)));
    if role == Role::Controller {
        let sent = log.commands.get(&identity(life)).into_iter().flatten();
        let last = sent.filter(|command| command.pose_tick <= done).map(|command| command.seq).max();
        life.met = life.met.max(last);
    }
}
