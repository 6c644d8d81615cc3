//! When a worker dies or hangs: start it again, or stop the robot and say why.

use super::children::Running;
use super::member::Duty;
use super::swap::with_last_words;
use super::{LEASE, LEAVE_PATIENCE, Manager, START_PATIENCE};
use crate::config::Driver;
use crate::shell::page::{Phase, SlotState, monotonic_ns};
use hilare_interfaces::messages::{Drive, Mode};
use hilare_interfaces::wires::Role;
use std::time::{Duration, Instant};
use tracing::{error, info, warn};

/// A planner may think for a while between two signs of life, and whoever repeats for others waits for a busy machine.
const PATIENCE_OFF_THE_LOOP: f64 = 10.0;

impl Manager {
    pub(super) fn died(&mut self, slot: usize, incarnation: u64, how: &str) {
        if self.members[slot].incarnation != incarnation {
            return;
        }
        self.page.set_state(slot, SlotState::Empty);
        self.members[slot].missed_since_ns = Some(monotonic_ns());
        let gone = self.members[slot].running.take();
        let doom = self.members[slot].doom.take();
        let how = &*doom.unwrap_or_else(|| how.to_owned());
        how.clone_into(&mut self.members[slot].last_end);
        if self.leaving {
            return;
        }
        if self.members[slot].role == Role::Planner {
            self.refuse_goals_of_the_dead();
        }
        self.param_meets_death(slot, how);
        // First of all the robot has a driver again, then there is a successor; then comes the tidying up.
        let handed_over = self.hand_to_standby(slot);
        self.succeed(slot, how, gone.as_ref(), handed_over);
        self.janitor.call();
    }

    /// What becomes of the place of a dead worker.
    fn succeed(&mut self, slot: usize, how: &str, gone: Option<&Running>, handed_over: bool) {
        if self.page.phase() != Phase::Go {
            return self.fail_to_start(slot, &with_last_words(how, self.members[slot].role, gone));
        }
        if self.replaced(slot, how, gone) {
            return;
        }
        match (self.members[slot].role, self.members[slot].duty) {
            (_, Duty::Retiring) => self.vacate(slot),
            (_, Duty::Vacant) => {}
            (_, Duty::Trial) => self.trial_died(slot, how, gone),
            (Role::Recorder, _) => error!("recorder {how}: the run goes on, its figures are lost"),
            // A simulated robot that is gone is no robot.
            (Role::Plant | Role::Launch, _) => self.give_up(slot, how),
            (role, duty) => {
                let drives = role == Role::Controller && duty == Duty::Work;
                if drives && !handed_over && self.job.system.supervision.resume_by_operator {
                    self.halt(Mode::Stop, &format!("controller {how}"));
                }
                if role == Role::StepGenerator {
                    // Its successor knows where the wheels are, not what happened meanwhile.
                    self.halt(Mode::Disarmed, &format!("step_generator {how}"));
                }
                let handed_over = if handed_over { ", its standby took over" } else { "" };
                self.plan_respawn(slot, &format!("{how}{handed_over}"));
            }
        }
    }

    /// The robot stops until the operator arms it again.
    pub(super) fn halt(&mut self, mode: Mode, why: &str) {
        if self.authority.mode == Mode::Armed.code() {
            let halted = format!("{why}; the robot has to be armed again (hilare arm)");
            warn!("{halted}");
            self.halted = Some(halted);
        }
        if self.authority.mode != Mode::EStop.code() {
            self.authority.mode = mode.code();
        }
        self.send_authority();
    }

    /// Nobody drives yet. Whoever asked for the robot gets this as the answer, so it is not logged besides.
    fn fail_to_start(&mut self, slot: usize, how: &str) {
        let member = &self.members[slot];
        let program = match &member.driver {
            Some(Driver::Exec(program)) => format!("; its program is {}", program.display()),
            _ => String::new(),
        };
        let why = format!("{} {how}{program}", member.role.name());
        self.authority.mode = Mode::Stop.code();
        self.send_authority();
        self.fault.get_or_insert(why);
    }

    /// The robot cannot go on.
    fn give_up(&mut self, slot: usize, how: &str) {
        self.stop_for_good(format!("{} {how}", self.members[slot].role.name()));
    }

    /// Stops the robot, which cannot be armed again. What came first is why.
    fn stop_for_good(&mut self, why: String) {
        error!("{why}: the robot is being stopped");
        if self.authority.mode != Mode::EStop.code() {
            self.authority.mode = Mode::Stop.code();
        }
        self.send_authority();
        self.fault.get_or_insert(why);
    }

    /// A place for another controller.
    pub(super) fn vacate(&mut self, slot: usize) {
        let member = &mut self.members[slot];
        (member.duty, member.driver, member.health) = (Duty::Vacant, None, None);
        member.missed_since_ns = None;
        member.respawn_at = None;
        // Whoever is put here next is launch's own.
        (member.joined, member.invitation) = (false, None);
    }

    /// Starts a worker again, within the budget.
    pub(super) fn plan_respawn(&mut self, slot: usize, how: &str) {
        let supervision = &self.job.system.supervision;
        let (budget, window) =
            (supervision.restart_budget, Duration::from_secs_f64(supervision.restart_window_s));
        let now = Instant::now();
        let name = self.members[slot].name();
        match self.members[slot].next_start(now, budget, window) {
            Some(wait) => {
                self.members[slot].respawn_at = Some(now + wait);
                let again = if self.members[slot].joined { "it is awaited" } else { "starting it again" };
                warn!("{name} {how}: {again}");
                self.respawn_due(now);
            }
            None => {
                let why = format!("{how}, more than {budget} times in {} s", window.as_secs_f64());
                if self.members[slot].duty == Duty::Standby {
                    error!("{name} {why}: giving it up; the robot drives on without a standby");
                    return self.vacate(slot);
                }
                if self.members[slot].role == Role::Operator {
                    return error!("{why}: giving it up; the robot drives on without its page");
                }
                self.give_up(slot, &why);
            }
        }
    }

    pub(super) fn respawn_due(&mut self, now: Instant) {
        for slot in 0..self.members.len() {
            let due = self.members[slot].respawn_at.is_some_and(|at| at <= now);
            if due && !self.leaving {
                self.members[slot].respawn_at = None;
                self.members[slot].restarts += 1;
                match (self.spawn(slot), self.members[slot].duty) {
                    (Ok(()), _) => {}
                    (Err(why), Duty::Standby) => {
                        error!("{why}; the robot drives on without a standby");
                        self.vacate(slot);
                    }
                    (Err(why), _) if self.members[slot].role == Role::Operator => {
                        error!("{why}; the robot drives on without its page");
                    }
                    (Err(why), _) => self.stop_for_good(why),
                }
            }
        }
    }

    /// Says of successors that they are at work, and how long nobody was.
    pub(super) fn welcome(&mut self) {
        for (slot, member) in self.members.iter_mut().enumerate() {
            if member.missed_since_ns.is_some() && self.page.state(slot) == SlotState::Working {
                let missed_ns = self.page.since_ns(slot) - member.missed_since_ns.take().unwrap_or(0);
                info!("{} is back after {:.1} ms", member.name(), missed_ns as f64 * 1e-6);
            }
        }
    }

    /// Kills whoever has given no sign of life for too long, and who was told to leave and does not.
    ///
    /// Time is counted in launch's own looks: while launch itself gets no processor, nobody is late.
    pub(super) fn look_for_the_hung(&mut self) {
        let hung_after_s = self.job.system.supervision.hung_after_s;
        if self.leaving || self.page.phase() != Phase::Go {
            return;
        }
        let looks = |patience_s: f64| (patience_s / LEASE.as_secs_f64()).ceil() as u32;
        for slot in 0..self.members.len() {
            let answers = self.answers(slot);
            let working = self.page.state(slot) == SlotState::Working;
            let sign = self.page.sign_of_life(slot);
            let member = &mut self.members[slot];
            let foreign = member.is_foreign();
            let starting = member.running.is_some() && !working && !foreign;
            if answers || !(working || starting || foreign) {
                member.seen();
            }
            let silent = member.look(sign);
            let patience_s = match member.role {
                _ if starting => START_PATIENCE.as_secs_f64(),
                Role::Planner | Role::Relay | Role::Operator => hung_after_s * PATIENCE_OFF_THE_LOOP,
                _ => hung_after_s,
            };
            // An observer that hangs harms nobody, and has the figures. A trial is judged elsewhere.
            let judged = member.role != Role::Recorder && member.duty != Duty::Trial && hung_after_s > 0.0;
            if member.duty == Duty::Retiring {
                if member.retired.elapsed() > LEAVE_PATIENCE {
                    member.doom("did not leave".to_owned());
                }
            } else if judged && silent > looks(patience_s) {
                member.doom(match (starting, foreign) {
                    (true, _) => format!("did not start within {START_PATIENCE:?}"),
                    (_, true) => format!("had no valid command for {patience_s} s"),
                    (_, false) => format!("gave no sign of life for {patience_s} s"),
                });
                member.seen();
            }
        }
    }

    /// True unless a program that is not ours should answer and does not: it has no other sign of life.
    fn answers(&self, slot: usize) -> bool {
        let member = &self.members[slot];
        if !member.is_foreign() {
            return false;
        }
        let steps = &self.newest.steps;
        let asked = self.authority.mode == Mode::Armed.code() && self.newest.reference.tick + 50 > steps.tick;
        let answered = match member.duty {
            Duty::Work => steps.source == slot as u64 + 1 && steps.drive == Drive::Command.code(),
            _ => steps.standby_answers > 0,
        };
        !asked || answered || steps.tick == 0
    }
}
