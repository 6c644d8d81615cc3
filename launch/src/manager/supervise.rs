//! When a worker dies: start it again, or stop the robot and say why.

use super::Manager;
use crate::shell::page::{Phase, SlotState};
use hilare_interfaces::messages::Mode;
use hilare_interfaces::wires::Role;
use std::time::{Duration, Instant};
use tracing::{error, warn};

impl Manager {
    pub(super) fn died(&mut self, slot: usize, incarnation: u64, how: &str) {
        if self.members[slot].incarnation != incarnation {
            return;
        }
        self.page.set_state(slot, SlotState::Empty);
        self.members[slot].running = None;
        self.members[slot].last_end = how.to_owned();
        if self.leaving {
            return;
        }
        self.domain.clean_up_after_the_dead();
        let role = self.members[slot].role;
        match role {
            Role::Controller | Role::Planner if self.page.phase() == Phase::Go => {
                self.plan_respawn(slot, how);
            }
            Role::Recorder if self.page.phase() == Phase::Go => {
                error!("recorder {how}: the run goes on, its figures are lost");
            }
            _ => {
                // These know where the robot is; a fresh one would not.
                self.authority.mode = Mode::Stop.code();
                self.send_authority();
                self.fault = Some(format!("{} {how}", role.name()));
                error!("{} {how}: the robot is being stopped", role.name());
            }
        }
    }

    /// Stateless boxes are started again, within the budget.
    fn plan_respawn(&mut self, slot: usize, how: &str) {
        let supervision = &self.job.system.supervision;
        let (budget, window) =
            (supervision.restart_budget, Duration::from_secs_f64(supervision.restart_window_s));
        let now = Instant::now();
        let member = &mut self.members[slot];
        member.deaths.retain(|death| now.duration_since(*death) < window);
        member.deaths.push_back(now);
        let name = member.role.name();
        if member.deaths.len() as u64 > budget {
            self.authority.mode = Mode::Stop.code();
            self.fault =
                Some(format!("{name} {how}, more than {budget} times in {} s", window.as_secs_f64()));
            error!("{name} {how}: more than {budget} times in {} s, giving up", window.as_secs_f64());
            return;
        }
        // The first comes back at once, the next ones wait a little longer each.
        let wait = Duration::from_millis(20 * (member.deaths.len() as u64 - 1));
        member.respawn_at = Some(now + wait);
        warn!("{name} {how}: starting it again");
        self.respawn_due(now);
    }

    pub(super) fn respawn_due(&mut self, now: Instant) {
        for slot in 0..self.members.len() {
            let due = self.members[slot].respawn_at.is_some_and(|at| at <= now);
            if due && !self.leaving {
                self.members[slot].respawn_at = None;
                self.members[slot].restarts += 1;
                if let Err(why) = self.spawn(slot) {
                    error!("{why}");
                    self.fault = Some(why);
                }
                self.send_authority();
            }
        }
    }
}
