//! Another controller in charge, or a box with other parameters, while the robot drives.
//!
//! ```text
//! swap controller LAW ─▶ newcomer starts, on trial ─▶ answers n cycles in time ─▶ takes charge ─▶ the old one leaves
//!                                     └─ dies, hangs, is late, is invalid ─▶ refused with the reason, the old one stays
//! swap planner --set … ─▶ the old one leaves, its successor starts with what it knew
//!                                     └─ dies or does not start ─▶ refused; one with the old parameters comes back
//! ```

use super::children::Running;
use super::control::Response;
use super::member::Duty;
use super::{LEASE, Manager, REST_PATIENCE};
use crate::config::{Driver, System};
use crate::shell::page::{Phase, SlotState};
use crossbeam_channel::Sender;
use hilare_interfaces::messages::Refusal;
use hilare_interfaces::wires::Role;
use rustix::process::Signal;
use std::time::{Duration, Instant};
use tracing::{info, warn};

/// What may be changed of a box alone: keys, and sections (with a dot), that no other box reads.
const OWN_KEYS: [(Role, &[&str]); 3] = [
    (Role::Controller, &["controller."]),
    (Role::Planner, &["planner."]),
    (Role::WaypointSelector, &["tracking.speed_mps", "tracking.acceptance"]),
];

/// A swap under way.
pub(super) struct Swap {
    slot: usize,
    reply: Sender<Response>,
    since: Instant,
    /// The system as it will be (controllers) or was before, and the number of its file.
    other: (u64, System),
    /// Commands that had been refused when it began.
    rejected_before: u64,
    /// The successor has been started (boxes other than controllers).
    started: bool,
}

impl Manager {
    /// `hilare swap ROLE [LAW] [--set KEY=VALUE]…`.
    pub(super) fn begin_swap(
        &mut self,
        role: &str,
        driver: Option<&str>,
        set: &[String],
        reply: &Sender<Response>,
    ) {
        let (role, system) = match self.prepare_swap(role, driver, set) {
            Ok(prepared) => prepared,
            Err(why) => return drop(reply.send(Response::wrong_use(why))),
        };
        let begun = self.may_swap().and_then(|()| match role {
            Role::Controller => self.begin_trial(system, driver.is_some() && set.is_empty(), reply),
            _ => self.begin_replacement(role, system, reply),
        });
        if let Err(why) = begun {
            let _ = reply.send(Response::refused(why));
        }
    }

    /// Nothing stands in the way of a swap now.
    fn may_swap(&self) -> Result<(), String> {
        if self.swap.is_some() {
            return Err("another swap is under way".to_owned());
        }
        if self.params.under_way.is_some() {
            return Err("parameters are being changed; try again".to_owned());
        }
        if !self.up || self.page.phase() != Phase::Go {
            return Err("the robot is still starting".to_owned());
        }
        Ok(())
    }

    /// Which box, and the system with what is asked for.
    fn prepare_swap(
        &self,
        role: &str,
        driver: Option<&str>,
        set: &[String],
    ) -> Result<(Role, System), String> {
        let role = Role::from_name(&role.replace('-', "_"));
        let own = OWN_KEYS.iter().find(|(known, _)| Some(*known) == role);
        let Some((role, own)) = own else {
            return Err("only controller, planner and waypoint_selector can be swapped".to_owned());
        };
        match (role, driver) {
            (Role::Controller, None) if set.is_empty() => {
                return Err("say which law: hilare swap controller LAW".to_owned());
            }
            (Role::Controller, _) | (_, None) => {}
            (_, Some(name)) => {
                return Err(format!("{} has no laws to choose from; drop {name:?}", role.name()));
            }
        }
        let key_of =
            |assignment: &'_ String| assignment.split('=').next().unwrap_or_default().trim().to_owned();
        let is_own =
            |key: &String| own.iter().any(|own| key == own || (own.ends_with('.') && key.starts_with(own)));
        let chosen = ["controller.law", "controller.exec", "controller.standby"];
        if let Some(key) = set.iter().map(key_of).find(|key| chosen.contains(&&**key)) {
            return Err(format!("--set {key}: say the law itself: hilare swap controller LAW"));
        }
        // A key there is not is told as such.
        self.job.system.clone().set_all(set).map_err(|error| error.to_string())?;
        if let Some(key) = set.iter().map(key_of).find(|key| !is_own(key)) {
            return Err(format!(
                "--set {key}: not a key of {} alone (those are {}); change it with hilare down, then up",
                role.name(),
                own.join(", ")
            ));
        }
        let mut keys = driver.map(Driver::keys).unwrap_or_default();
        keys.extend_from_slice(set);
        let mut system = self.job.system.clone();
        system.set_all(&keys).map_err(|error| {
            let error = error.to_string();
            // An assignment we made of the law is nothing the user has written.
            let ours = keys.iter().filter(|key| !set.contains(key));
            let what = ours.into_iter().find_map(|key| error.strip_prefix(&format!("--set {key}: ")));
            what.unwrap_or(&error).to_owned()
        })?;
        let law = system.controller.law.name;
        let of_another_law = |key: &String| {
            let section = key.strip_prefix("controller.").and_then(|key| key.split_once('.'));
            section.is_some_and(|(section, _)| section != law)
        };
        match set.iter().map(key_of).find(of_another_law) {
            Some(key) => Err(format!("--set {key}: not a key of {law}, which is to drive")),
            None => Ok((*role, system)),
        }
    }

    fn begin_trial(&mut self, system: System, plain: bool, reply: &Sender<Response>) -> Result<(), String> {
        let driver = system.controller.driver();
        let warm = self.controller(Duty::Standby).filter(|slot| {
            plain
                && self.members[*slot].driver.as_ref() == Some(&driver)
                && self.newest.steps.standby_answers > 0
        });
        if let Some(slot) = warm {
            self.put_in_charge(slot, Duty::Standby);
            self.swaps += 1;
            let done = format!("{} is in charge, the other one stands by", driver.name());
            self.conclude(reply, system, done);
            return Ok(());
        }
        let slot =
            self.controller(Duty::Vacant).ok_or("controllers swapped out have not left yet; try again")?;
        self.systems.trial = self.systems.write(self.dir.path(), &system)?;
        self.members[slot].duty = Duty::Trial;
        self.members[slot].driver = Some(driver);
        self.swap = Some(Swap {
            slot,
            reply: reply.clone(),
            since: Instant::now(),
            other: (self.systems.trial, system),
            rejected_before: self.newest.steps.commands_rejected,
            started: true,
        });
        if let Err(why) = self.spawn(slot) {
            self.end_trial(&why);
        }
        Ok(())
    }

    /// Looks how the swap under way goes.
    pub(super) fn judge_swap(&mut self) {
        let Some(swap) = &self.swap else { return };
        let (slot, since, started) = (swap.slot, swap.since, swap.started);
        let waited = since.elapsed();
        let late = waited > Duration::from_secs_f64(self.job.system.supervision.trial_timeout_s);
        let working = self.page.state(slot) == SlotState::Working;
        if self.members[slot].role != Role::Controller {
            if !started && waited > REST_PATIENCE {
                self.members[slot].doom("did not leave when it was told to".to_owned());
            }
            return match (started && working, late) {
                (true, _) => self.end_replacement(None),
                (_, true) => self.end_replacement(Some("it did not start in time")),
                _ => {}
            };
        }
        let steps = &self.newest.steps;
        let (wanted, answers) = (self.job.system.supervision.trial_cycles, steps.trial_answers);
        // Before the robot was armed for the first time there is no tick to be in time for.
        let ticking = steps.tick > 0;
        let foreign = self.members[slot].is_foreign();
        let settled = if foreign { waited > 10 * LEASE } else { working };
        if (ticking && answers >= wanted && (working || foreign)) || (!ticking && settled) {
            self.conclude_trial(waited);
        } else if late {
            self.end_trial(&self.why_late(slot));
        }
    }

    fn why_late(&self, slot: usize) -> String {
        let supervision = &self.job.system.supervision;
        let within = supervision.trial_timeout_s;
        let steps = &self.newest.steps;
        let before = self.swap.as_ref().map_or(0, |swap| swap.rejected_before);
        let refused = steps.commands_rejected.saturating_sub(before);
        let last = Refusal::from_code(steps.refusal).map_or("unknown", Refusal::label);
        match self.page.state(slot) {
            SlotState::Empty if !self.members[slot].is_foreign() => {
                format!("it did not open its wires within {within} s")
            }
            SlotState::Ready => format!("it did not begin to work within {within} s"),
            _ if refused > 0 && steps.refused_source == slot as u64 + 1 => {
                format!("{refused} commands were refused meanwhile, its last one because {last}")
            }
            _ => format!(
                "it did not answer {} cycles in a row in time within {within} s",
                supervision.trial_cycles
            ),
        }
    }

    fn conclude_trial(&mut self, waited: Duration) {
        let Some(swap) = self.swap.take() else { return };
        let old = self.leaving_controller();
        self.put_in_charge(
            swap.slot,
            if old == self.controller(Duty::Work) { Duty::Retiring } else { Duty::Standby },
        );
        if let Some(old) = old {
            self.members[old].duty = Duty::Retiring;
        }
        self.send_authority();
        let old = old.map_or_else(String::new, |old| {
            self.members[old].retired = Instant::now();
            if let Some(running) = &self.members[old].running {
                running.signal(Signal::TERM);
            } else {
                self.vacate(old);
            }
            self.members[old].name()
        });
        self.swaps += 1;
        let new = self.members[swap.slot].name();
        info!("{new} is in charge instead of {old}");
        let done = format!("{new} is in charge, {} ms after it was asked for", waited.as_millis());
        self.conclude(&swap.reply, swap.other.1, done);
    }

    /// Another controller is in charge: from now on successors are as in `system`.
    fn conclude(&mut self, reply: &Sender<Response>, system: System, done: String) {
        let answer = match self.adopt(system) {
            Ok(()) => Response::done(done),
            Err(why) => Response::refused(format!("{done}; but a successor would not be: {why}")),
        };
        let _ = reply.send(answer);
    }

    /// Who goes when a newcomer takes charge: the one in charge; but if that is the standby the robot is to
    /// have, which has taken over meanwhile, then the one it took over from.
    fn leaving_controller(&self) -> Option<usize> {
        let (work, standby) = (self.controller(Duty::Work), self.controller(Duty::Standby));
        let wanted = self.job.system.controller.standby();
        let is_wanted = |slot: &usize| wanted.is_some() && self.members[*slot].driver == wanted;
        match (work.filter(is_wanted), standby) {
            (Some(_), Some(standby)) if !is_wanted(&standby) => Some(standby),
            _ => work,
        }
    }

    /// From now on successors are as in `system`.
    fn adopt(&mut self, system: System) -> Result<(), String> {
        self.systems.current = self.systems.write(self.dir.path(), &system)?;
        self.job.system = system;
        Ok(())
    }

    /// The newcomer on trial has died.
    pub(super) fn trial_died(&mut self, slot: usize, how: &str, gone: Option<&Running>) {
        self.end_trial(&with_last_words(how, Role::Controller, gone));
        self.vacate(slot);
    }

    /// The newcomer is not taken; the old one stays in charge.
    fn end_trial(&mut self, why: &str) {
        let Some(swap) = self.swap.take() else { return };
        let name = self.members[swap.slot].name();
        self.members[swap.slot].duty = Duty::Retiring;
        match &self.members[swap.slot].running {
            // What hangs does not listen.
            Some(running) => running.signal(Signal::KILL),
            None => self.vacate(swap.slot),
        }
        self.send_authority();
        let stays = self.controller(Duty::Work).map_or_else(String::new, |slot| self.members[slot].name());
        warn!("{name} was not taken: {why}; {stays} stays in charge");
        let _ = swap.reply.send(Response::refused(format!("{name}: {why}; {stays} stays in charge")));
    }

    fn begin_replacement(
        &mut self,
        role: Role,
        system: System,
        reply: &Sender<Response>,
    ) -> Result<(), String> {
        let slot = self.members.iter().position(|member| member.role == role).ok_or("there is none")?;
        let before = self.systems.current;
        self.systems.current = self.systems.write(self.dir.path(), &system)?;
        let other = (before, std::mem::replace(&mut self.job.system, system));
        self.swap = Some(Swap {
            slot,
            reply: reply.clone(),
            since: Instant::now(),
            other,
            rejected_before: 0,
            started: self.members[slot].running.is_none(),
        });
        if let Err(why) = self.restart(slot) {
            self.end_replacement(Some(&why));
        }
        Ok(())
    }

    /// The box in `slot` leaves and its successor starts as soon as it is gone.
    fn restart(&mut self, slot: usize) -> Result<(), String> {
        // Whoever started it sees an end in good order and does not start another one.
        (self.members[slot].joined, self.members[slot].invitation) = (false, None);
        // It is not started twice.
        self.members[slot].respawn_at = None;
        match &self.members[slot].running {
            Some(running) => running.signal(Signal::TERM),
            None => self.spawn(slot)?,
        }
        Ok(())
    }

    /// A box that is being replaced has ended: true if that was wanted.
    pub(super) fn replaced(&mut self, slot: usize, how: &str, gone: Option<&Running>) -> bool {
        let is_box = self.members[slot].role != Role::Controller;
        let Some(swap) = self.swap.as_mut().filter(|swap| is_box && swap.slot == slot) else { return false };
        if std::mem::replace(&mut swap.started, true) {
            let how = with_last_words(how, self.members[slot].role, gone);
            self.end_replacement(Some(&how));
        } else if let Err(why) = self.spawn(slot) {
            self.end_replacement(Some(&why));
        }
        true
    }

    fn end_replacement(&mut self, failure: Option<&str>) {
        let Some(swap) = self.swap.take() else { return };
        let name = self.members[swap.slot].role.name();
        let Some(why) = failure else {
            self.swaps += 1;
            let _ = swap.reply.send(Response::done(format!("{name}: a new one is at work")));
            return;
        };
        (self.systems.current, self.job.system) = swap.other;
        let restored = match &self.members[swap.slot].running {
            Some(running) => {
                running.signal(Signal::KILL);
                Ok(())
            }
            None => self.spawn(swap.slot),
        };
        let end =
            restored.map_or_else(|error| error, |()| "one with the old parameters comes back".to_owned());
        warn!("{name} was not taken: {why}; {end}");
        let _ = swap.reply.send(Response::refused(format!("{name}: {why}; {end}")));
    }
}

/// How a process has ended, and the last line it wrote.
pub(super) fn with_last_words(how: &str, role: Role, gone: Option<&Running>) -> String {
    let line = gone.map(Running::last_words).unwrap_or_default();
    // Its own log line, without time and level.
    let words = line.split_once(&format!("{}: ", role.name())).map_or(&*line, |(_, words)| words);
    if words.is_empty() { how.to_owned() } else { format!("{how}: {words}") }
}
