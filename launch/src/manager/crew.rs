//! The controllers: which one is in charge, which stands by, which is on trial.
//!
//! Launch says so to the step generator fifty times a second and at every change, under a term that
//! goes up whenever another one comes into charge. The step generator may put the standby in charge by
//! itself, under the next term; launch then follows.

use super::Manager;
use super::member::Duty;
use crate::shell::ClockKind;
use crate::shell::page::News;
use crate::shell::realtime::{self, CpuChoice};
use hilare_interfaces::wires::Role;
use rustix::process::Pid;
use tracing::{info, warn};

impl Manager {
    /// The controller with a duty.
    pub(super) fn controller(&self, duty: Duty) -> Option<usize> {
        self.members.iter().position(|member| member.role == Role::Controller && member.duty == duty)
    }

    /// Source and epoch of a controller; (0, 0) for none.
    fn pair(&self, duty: Duty) -> (u64, u64) {
        self.controller(duty).map_or((0, 0), |slot| (slot as u64 + 1, self.members[slot].epoch))
    }

    /// Tells the step generator who may drive; also launch's lease.
    pub(super) fn send_authority(&mut self) {
        self.authority.seq += 1;
        (self.authority.source, self.authority.epoch) = self.pair(Duty::Work);
        (self.authority.standby_source, self.authority.standby_epoch) = self.pair(Duty::Standby);
        (self.authority.trial_source, self.authority.trial_epoch) = self.pair(Duty::Trial);
        self.ports.authority.send(&self.authority);
        self.page.announce(News::Authority);
        for slot in self.page.members(Role::StepGenerator) {
            self.page.ring_slot(slot);
        }
    }

    /// Puts the controller in `slot` in charge; whoever was gets `duty`.
    pub(super) fn put_in_charge(&mut self, slot: usize, duty: Duty) {
        if let Some(old) = self.controller(Duty::Work) {
            self.members[old].duty = duty;
        }
        self.members[slot].duty = Duty::Work;
        self.authority.term += 1;
        self.send_authority();
        self.place_controllers();
    }

    /// The step generator has put the standby in charge: the one that failed it is replaced.
    pub(super) fn follow_promotion(&mut self) {
        let steps = self.newest.steps;
        if steps.term <= self.authority.term || steps.in_charge == 0 {
            return;
        }
        self.authority.term = steps.term;
        let slot = steps.in_charge as usize - 1;
        let old = self.controller(Duty::Work).filter(|old| *old != slot);
        if slot >= self.members.len() || self.members[slot].role != Role::Controller {
            return;
        }
        self.members[slot].duty = Duty::Work;
        if let Some(old) = old {
            let misses = self.job.system.timing.promote_after;
            warn!(
                "{} had no command {misses} cycles in a row: {} is in charge now, and the other one is replaced",
                self.members[old].name(),
                self.members[slot].name()
            );
            self.members[old].duty = Duty::Standby;
            if self.members[old].running.is_some() {
                self.members[old].doom(format!("had no command {misses} cycles in a row"));
            }
        }
        self.send_authority();
        self.place_controllers();
    }

    /// Processor for a controller that is not in charge: another one than the control path's, so that a
    /// controller that spins takes no time from its stand-in; as a key of the system file.
    pub(super) fn spare_cpu(&self) -> i64 {
        let wanted = self.job.system.realtime(Role::Controller).cpu;
        match realtime::another_cpu(CpuChoice::from_key(wanted)) {
            Some(cpu) => cpu as i64,
            None => wanted,
        }
    }

    /// Moves the controllers to the processors of their duties.
    fn place_controllers(&self) {
        if self.job.clock != ClockKind::Real {
            return;
        }
        let wanted = self.job.system.realtime(Role::Controller).cpu;
        for member in self.members.iter().filter(|member| member.role == Role::Controller) {
            let Some(pid) = member.running.as_ref().and_then(|running| Pid::from_raw(running.pid as i32))
            else {
                continue;
            };
            let key = if member.duty == Duty::Work { wanted } else { self.spare_cpu() };
            realtime::place(pid, CpuChoice::from_key(key));
        }
    }

    /// The controller in charge has died. True if its standby takes over.
    pub(super) fn hand_to_standby(&mut self, slot: usize) -> bool {
        let standby =
            self.controller(Duty::Standby).filter(|standby| self.members[*standby].running.is_some());
        let drove = self.controller(Duty::Work) == Some(slot);
        let Some(standby) = standby.filter(|_| drove) else { return false };
        self.put_in_charge(standby, Duty::Standby);
        info!("{} is in charge now", self.members[standby].name());
        true
    }
}
