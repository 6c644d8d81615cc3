//! Parameters changed while the robot drives: `hilare param set`.
//!
//! ```text
//! checked as a system file is ─▶ boxes prepare ─▶ the clock chooses a tick ─▶ each box goes on with them from there
//!        │                          └─ one cannot, dies, does not answer: taken back, nothing has changed
//!        └─ unknown, out of bounds, in conflict, not live: refused
//! ```
//!
//! From the clock's decision on successors read the new system file, whatever becomes of the boxes.

use super::Manager;
use super::control::Response;
use super::member::Duty;
use crate::config::{Driver, Key, Liveness, System, key_of};
use crate::shell::change::{Answer, Applied, Stage};
use crate::shell::page::SlotState;
use crossbeam_channel::Sender;
use hilare_interfaces::block::Tick;
use hilare_interfaces::wires::Role;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};
use tracing::{info, warn};

/// Time boxes have to build what they will need: a map may be large.
const PREPARE_PATIENCE: Duration = Duration::from_secs(5);
/// Time the clock has to choose a tick.
const ASK_PATIENCE: Duration = Duration::from_secs(1);
/// Time until the caller is told who has not taken the change on yet.
const APPLY_PATIENCE: Duration = Duration::from_secs(2);
/// Time between two looks at a change under way.
pub(super) const LOOK: Duration = Duration::from_millis(1);

/// A key that was changed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Changed {
    /// Its full name.
    pub key: String,
    /// What it was.
    pub from: String,
    /// What it is.
    pub to: String,
    /// Unit of both; empty for a pure number and for text.
    pub unit: String,
}

impl Changed {
    fn to_text(&self) -> String {
        let Self { key, from, to, unit } = self;
        format!("{key} {} -> {} {unit}", shown(from), shown(to)).trim_end().to_owned()
    }
}

fn shown(value: &str) -> &str {
    if value.is_empty() { "\"\"" } else { value }
}

/// A box that took a change on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Taken {
    /// Its name; a controller with what drives in it.
    pub name: String,
    /// From which tick on.
    pub tick: Tick,
    /// Time its loop spent on it, us.
    pub took_us: f64,
    /// What it had learnt did not fit the new parameters and was forgotten.
    pub anew: bool,
}

/// What a change came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What was changed; empty if everything was so already.
    pub changes: Vec<Changed>,
    /// The tick from which on; none if no box reads any of it now.
    pub tick: Option<Tick>,
    /// Number of the system file that is in force.
    pub system: u64,
    /// Who took it on.
    pub boxes: Vec<Taken>,
}

/// Changes so far, and the one under way.
#[derive(Default)]
pub(super) struct Params {
    pub under_way: Option<UnderWay>,
    /// Changes asked for, including those that were refused by a box.
    asked: u64,
    /// Changes that are in force.
    pub made: u64,
    /// The last of them, in words.
    pub last: Option<String>,
}

/// A change under way.
pub(super) struct UnderWay {
    change: u64,
    number: u64,
    /// As it will be; after the decision as it is.
    system: System,
    stage: Stage,
    /// Since when it is in this stage.
    since: Instant,
    /// Boxes that have not taken it on yet.
    slots: Vec<usize>,
    outcome: Outcome,
    /// None once the caller was told.
    reply: Option<Sender<Response>>,
}

impl Manager {
    /// `hilare param set KEY=VALUE…`.
    pub(super) fn begin_param(&mut self, set: &[String], reply: &Sender<Response>) {
        let response = match self.check_param(set) {
            Err(why) => Response::wrong_use(why),
            Ok((system, changes)) => {
                let started = self.may_change().and_then(|()| match changes.is_empty() {
                    true => Ok(Some(self.nothing_to_change(set))),
                    false => self.start_param(system, changes, reply),
                });
                match started {
                    Ok(None) => return,
                    Ok(Some(done)) => done,
                    Err(why) => Response::refused(why),
                }
            }
        };
        let _ = reply.send(response);
    }

    /// The system with what is asked for, and what differs; or what is wrong with it.
    fn check_param(&self, set: &[String]) -> Result<(System, Vec<(Key, Changed)>), String> {
        let before = &self.job.system;
        if set.is_empty() {
            return Err("say what: hilare param set KEY=VALUE".to_owned());
        }
        for (n, assignment) in set.iter().enumerate() {
            let path = key_of(assignment);
            if !assignment.contains('=') {
                return Err(format!("{assignment:?}: write KEY=VALUE, for example tracking.speed_mps=0.03"));
            }
            if let Ok(key) = before.key(path)
                && let Liveness::Fixed(instead) = key.liveness()
            {
                return Err(format!("{path}: not while the robot is up: {instead}"));
            }
            if set[..n].iter().any(|other| key_of(other) == path) {
                return Err(format!("{path}: given twice; say which"));
            }
        }
        let mut system = before.clone();
        system.set_all(set).map_err(|error| {
            let error = error.to_string();
            let ours = set.iter().find_map(|assignment| error.strip_prefix(&format!("--set {assignment}: ")));
            ours.unwrap_or(&error).to_owned()
        })?;
        let changes = set.iter().filter_map(|assignment| {
            let key = before.key(key_of(assignment)).ok()?;
            let (from, to) = (key.value_text(before), key.value_text(&system));
            let changed = Changed { key: key.path(), from, to, unit: key.unit().to_owned() };
            (changed.from != changed.to).then_some((key, changed))
        });
        let changes = changes.collect();
        Ok((system, changes))
    }

    fn nothing_to_change(&self, set: &[String]) -> Response {
        let system = &self.job.system;
        let is = set.iter().filter_map(|assignment| system.key(key_of(assignment)).ok()).map(|key| {
            let value = key.value_text(system);
            format!("{} is {} {}", key.path(), shown(&value), key.unit()).trim_end().to_owned()
        });
        let message = format!("nothing to change: {} already", is.collect::<Vec<_>>().join(", "));
        let outcome = Outcome { system: self.systems.current, ..Outcome::default() };
        Response { param: Some(outcome), ..Response::done(message) }
    }

    /// Nothing stands in the way of a change now.
    fn may_change(&self) -> Result<(), String> {
        if let Some(param) = &self.params.under_way {
            let who = self.names(&param.slots);
            return Err(match param.stage {
                Stage::Decided => {
                    format!("the change before is not over: {who} has not taken it on yet; try again")
                }
                _ => "another change is under way; try again".to_owned(),
            });
        }
        if self.swap.is_some() {
            return Err("a swap is under way; try again".to_owned());
        }
        if !self.up || self.leaving {
            return Err(
                if self.up { "the robot is going down" } else { "the robot is still starting" }.to_owned()
            );
        }
        Ok(())
    }

    /// The boxes that have to take a change of `keys` on.
    fn concerned(&self, keys: &[(Key, Changed)], system: &System) -> Vec<usize> {
        let reads = |slot: &usize| {
            let member = &self.members[*slot];
            let at_work = matches!(member.duty, Duty::Work | Duty::Standby) && !member.is_foreign();
            at_work
                && keys.iter().any(|(key, _)| {
                    let its_law = key.law().is_none_or(|law| member.driver == Driver::of(law));
                    its_law && key.readers(system).contains(&member.role)
                })
        };
        (0..self.members.len()).filter(reads).collect()
    }

    /// Has boxes prepare a change; the answer, if there is nobody who has to.
    fn start_param(
        &mut self,
        system: System,
        changes: Vec<(Key, Changed)>,
        reply: &Sender<Response>,
    ) -> Result<Option<Response>, String> {
        let slots = self.concerned(&changes, &system);
        let clock = self.slot_at_work(Role::StepGenerator);
        if let Some(slot) = slots.iter().copied().chain(clock).find(|slot| !self.is_at_work(*slot)) {
            return Err(format!("{} is just being started; try again", self.members[slot].name()));
        }
        let number = self.systems.write(self.dir.path(), &system)?;
        let changes = changes.into_iter().map(|(_, changed)| changed).collect();
        let outcome = Outcome { changes, system: number, ..Outcome::default() };
        self.params.asked += 1;
        let mut param = UnderWay {
            change: self.params.asked,
            number,
            system,
            stage: Stage::Prepare,
            since: Instant::now(),
            slots,
            outcome,
            reply: Some(reply.clone()),
        };
        if param.slots.is_empty() {
            self.put_in_force(&mut param);
            let message = format!("{}; no box that is at work reads it", in_words(&param.outcome));
            return Ok(Some(Response { param: Some(param.outcome), ..Response::done(message) }));
        }
        let bits = param.slots.iter().fold(0, |bits, slot| bits | 1 << slot);
        self.page.change().prepare(param.change, number, bits);
        self.params.under_way = Some(param);
        Ok(None)
    }

    fn is_at_work(&self, slot: usize) -> bool {
        self.members[slot].running.is_some() && self.page.state(slot) == SlotState::Working
    }

    fn names(&self, slots: &[usize]) -> String {
        slots.iter().map(|slot| self.members[*slot].name()).collect::<Vec<_>>().join(", ")
    }

    /// From now on successors are as the change says.
    fn put_in_force(&mut self, param: &mut UnderWay) {
        self.systems.current = param.number;
        self.job.system = param.system.clone();
        self.params.made += 1;
        let at = param.outcome.tick.map_or_else(String::new, |tick| format!(" at tick {tick}"));
        for changed in &param.outcome.changes {
            info!("param: {}{at}", changed.to_text());
        }
        self.params.last = Some(in_words(&param.outcome));
    }

    /// Looks how the change under way goes.
    pub(super) fn judge_param(&mut self) {
        let Some(mut param) = self.params.under_way.take() else { return };
        let waited = param.since.elapsed();
        let over = match param.stage {
            Stage::Prepare => self.judge_preparation(&mut param, waited),
            Stage::Asked => self.judge_decision(&mut param, waited),
            _ => self.judge_application(&mut param, waited),
        };
        if !over {
            self.params.under_way = Some(param);
        }
    }

    fn judge_preparation(&mut self, param: &mut UnderWay, waited: Duration) -> bool {
        let change = self.page.change();
        let answers = param.slots.iter().map(|slot| (*slot, change.answer(*slot, param.change)));
        let mut missing = Vec::new();
        for (slot, answer) in answers {
            match answer {
                Answer::Prepared => {}
                Answer::Refused(why) => {
                    let name = self.members[slot].name();
                    return self.take_back(param, &format!("{name}: {why}"));
                }
                _ => missing.push(slot),
            }
        }
        if missing.is_empty() {
            change.ask(param.change);
            (param.stage, param.since) = (Stage::Asked, Instant::now());
            // It looks at every tick; before time begins it sleeps.
            self.page.members(Role::StepGenerator).for_each(|slot| self.page.ring_slot(slot));
        } else if waited > PREPARE_PATIENCE {
            let why = format!("{} did not prepare it within {PREPARE_PATIENCE:?}", self.names(&missing));
            return self.take_back(param, &why);
        }
        false
    }

    fn judge_decision(&mut self, param: &mut UnderWay, waited: Duration) -> bool {
        if self.page.change().turn().stage() == Stage::Decided {
            self.decided(param);
        } else if waited > ASK_PATIENCE {
            return self
                .take_back(param, &format!("the clock did not choose a tick within {ASK_PATIENCE:?}"));
        }
        false
    }

    /// The clock has chosen: nothing takes the change back any more.
    fn decided(&mut self, param: &mut UnderWay) {
        let tick = self.page.change().tick();
        param.outcome.tick = Some(tick);
        (param.stage, param.since) = (Stage::Decided, Instant::now());
        self.put_in_force(param);
        // Messages wake them; before time begins there are none, and the planner has few.
        let asleep = |slot: &&usize| tick == 0 || self.members[**slot].role == Role::Planner;
        param.slots.iter().filter(asleep).for_each(|slot| self.page.ring_slot(*slot));
    }

    fn judge_application(&mut self, param: &mut UnderWay, waited: Duration) -> bool {
        let change = param.change;
        let mut waiting = Vec::new();
        for slot in std::mem::take(&mut param.slots) {
            let Answer::Applied(Applied { tick, took_ns, anew }) = self.page.change().answer(slot, change)
            else {
                waiting.push(slot);
                continue;
            };
            let name = self.members[slot].name();
            param.outcome.boxes.push(Taken { name, tick, took_us: took_ns as f64 * 1e-3, anew });
        }
        param.slots = waiting;
        let over = param.slots.is_empty();
        if over {
            self.page.change().end(change);
        }
        if (over || waited > APPLY_PATIENCE)
            && let Some(reply) = param.reply.take()
        {
            let outcome = param.outcome.clone();
            let mut message = in_words(&outcome);
            for taken in outcome.boxes.iter().filter(|taken| taken.anew) {
                message.push_str(&format!("; {} began anew, what it had learnt does not fit", taken.name));
            }
            if !over {
                message.push_str(&format!("; {} has not taken it on yet", self.names(&param.slots)));
            }
            let _ = reply.send(Response { param: Some(outcome), ..Response::done(message) });
        }
        over
    }

    /// Nothing has changed, and the caller is told why.
    fn take_back(&mut self, param: &mut UnderWay, why: &str) -> bool {
        if !self.page.change().cancel(param.change) {
            // The clock was faster.
            self.decided(param);
            return false;
        }
        let wanted = param.outcome.changes.iter().map(Changed::to_text).collect::<Vec<_>>().join(", ");
        warn!("param: {wanted}: {why}; nothing was changed");
        if let Some(reply) = param.reply.take() {
            let _ = reply.send(Response::refused(format!("{why}; nothing was changed")));
        }
        true
    }

    /// A process has died: a change it is to prepare, or whose tick it is to choose, is taken back. Its successor reads
    /// what is in force then.
    pub(super) fn param_meets_death(&mut self, slot: usize, how: &str) {
        let Some(mut param) = self.params.under_way.take() else { return };
        let clock = self.members[slot].role == Role::StepGenerator;
        let mut over = false;
        if param.stage != Stage::Decided && (clock || param.slots.contains(&slot)) {
            over = self.take_back(&mut param, &format!("{} {how}", self.members[slot].name()));
        }
        if !over {
            param.slots.retain(|other| *other != slot);
            self.params.under_way = Some(param);
        }
    }
}

/// What was changed, and from when on.
fn in_words(outcome: &Outcome) -> String {
    let changes = outcome.changes.iter().map(Changed::to_text).collect::<Vec<_>>().join(", ");
    match outcome.tick {
        Some(tick) => format!("{changes} from tick {tick} on"),
        None => changes,
    }
}
