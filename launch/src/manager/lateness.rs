//! Why ticks were late, as far as can be told from outside the tick.

use super::Manager;
use super::counts::page_faults;
use crate::shell::page::SharedPage;
use crate::shell::timing::LateWakeUp;
use hilare_interfaces::block::Tick;
use hilare_interfaces::latency::LatencyHistogram;
use hilare_interfaces::wires::Role;
use serde::Serialize;
use std::fs;

/// Late wake-ups that are kept one by one.
const KEPT: usize = 1000;

/// Why a tick was late.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// The tick before was still at work.
    OwnWork,
    /// A page of the step generator was not in memory.
    PageFault,
    /// It was ready to run, and another box of the robot, at work for longer than it should, had the core.
    AnotherBox,
    /// It was ready to run, and something else of this machine had the core: the kernel, or another program.
    AnotherProgram,
    /// It was not even ready: the timer itself came late, because the host had taken the core away or let it sleep
    /// deeply.
    Host,
}

impl Cause {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::OwnWork, Self::PageFault, Self::AnotherBox, Self::AnotherProgram, Self::Host];

    /// For people.
    pub const fn label(self) -> &'static str {
        match self {
            Self::OwnWork => "the tick before was still at work",
            Self::PageFault => "page fault",
            Self::AnotherBox => "another box had the core",
            Self::AnotherProgram => "the kernel or another program had the core",
            Self::Host => "the timer came late: the host had the core",
        }
    }
}

/// A tick that was late.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LateTick {
    /// Ticks executed before it.
    pub tick: Tick,
    /// How late it woke, µs.
    pub late_us: f64,
    /// Why.
    pub cause: Cause,
}

/// Looks, as often as the lease is renewed, at what the step generator waited for meanwhile.
#[derive(Default)]
pub(super) struct LateWatch {
    seen: u64,
    pid: u32,
    before: Account,
    ticks: Vec<LateTick>,
    counts: [u64; Cause::ALL.len()],
}

/// What the kernel has put down for the step generator, and what the other boxes have for themselves.
#[derive(Clone, Copy, Debug, Default)]
struct Account {
    /// Time it was ready and did not run, ns.
    waited_ns: u64,
    page_faults: u64,
    /// Steps of other boxes that took too long.
    over_budget: u64,
}

impl LateWatch {
    /// Takes in what was late since the last look. `pid` is the step generator's.
    fn look(&mut self, page: &SharedPage, slot: usize, pid: u32) {
        let now = Account::of(page, slot, pid);
        if pid == self.pid {
            self.judge(page.timing(slot).late_since(self.seen), self.before, now);
        }
        (self.seen, self.pid, self.before) = (page.timing(slot).late_count(), pid, now);
    }

    fn judge(&mut self, late: impl Iterator<Item = LateWakeUp>, before: Account, now: Account) {
        let late: Vec<LateWakeUp> = late.collect();
        let late_ns: u64 = late.iter().map(|one| one.late_ns).sum();
        let cause = if now.page_faults > before.page_faults {
            Cause::PageFault
        } else if now.waited_ns.saturating_sub(before.waited_ns) < late_ns / 2 {
            Cause::Host
        } else if now.over_budget > before.over_budget {
            Cause::AnotherBox
        } else {
            Cause::AnotherProgram
        };
        for one in late {
            let cause = if one.own_work { Cause::OwnWork } else { cause };
            self.counts[cause as usize] += 1;
            if self.ticks.len() < KEPT {
                self.ticks.push(LateTick { tick: one.tick, late_us: one.late_ns as f64 / 1e3, cause });
            }
        }
    }
}

impl Account {
    fn of(page: &SharedPage, slot: usize, pid: u32) -> Self {
        let read = |name: &str| fs::read_to_string(format!("/proc/{pid}/{name}")).unwrap_or_default();
        let waited = read("schedstat").split_whitespace().nth(1).and_then(|ns| ns.parse().ok());
        let others = Role::WORKERS.into_iter().flat_map(|role| page.members(role)).filter(|one| *one != slot);
        Self {
            waited_ns: waited.unwrap_or(0),
            page_faults: page_faults(&read("stat")),
            over_budget: others.map(|one| page.timing(one).over_budget()).sum(),
        }
    }
}

/// Times of a launch so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Timings {
    /// How late the clock woke.
    pub lateness: LatencyHistogram,
    /// From its waking until it had told everybody.
    pub work: LatencyHistogram,
    /// Messages on their way: steps to the pose estimator, pose to the waypoint selector, reference to the
    /// controller in charge.
    pub hops: [LatencyHistogram; 3],
    /// From the steps until the command they lead to was out.
    pub cycle: LatencyHistogram,
    /// How long commands were ready before the clock took them in.
    pub ready: LatencyHistogram,
}

impl Manager {
    /// Finds out why ticks were late; called with every lease.
    pub(super) fn look_at_lateness(&mut self) {
        let clock = self.slot_at_work(Role::StepGenerator);
        let pid = clock.and_then(|slot| self.members[slot].running.as_ref()).map(|running| running.pid);
        if let (Some(slot), Some(pid)) = (clock, pid) {
            self.lateness.look(&self.page, slot, pid);
        }
    }

    /// Ticks that were late by a tenth of a tick or more, the first thousand, and how many each cause has.
    pub fn late_ticks(&self) -> (&[LateTick], [(Cause, u64); Cause::ALL.len()]) {
        (&self.lateness.ticks, Cause::ALL.map(|cause| (cause, self.lateness.counts[cause as usize])))
    }

    /// What has been measured so far.
    pub fn timings(&self) -> Timings {
        let of = |role: Role| self.slot_at_work(role).map(|slot| self.page.timing(slot));
        let [generator, estimator, selector, controller] =
            [Role::StepGenerator, Role::PoseEstimator, Role::WaypointSelector, Role::Controller].map(of);
        let none = LatencyHistogram::ZERO;
        Timings {
            lateness: generator.map_or(none, |timing| timing.taken.snapshot()),
            work: generator.map_or(none, |timing| timing.step.snapshot()),
            hops: [estimator, selector, controller].map(|one| one.map_or(none, |one| one.taken.snapshot())),
            cycle: controller.map_or(none, |timing| timing.age.snapshot()),
            ready: generator.map_or(none, |timing| timing.age.snapshot()),
        }
    }

    /// When in a millisecond of CLOCK_MONOTONIC the clock ticks, ns; known once it is at work.
    pub fn phase_ns(&self) -> u64 {
        self.page.clock_phase_ns()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn causes(own_work: bool, before: Account, now: Account) -> Vec<Cause> {
        let mut watch = LateWatch::default();
        let late = LateWakeUp { tick: 7, late_ns: 400_000, own_work };
        watch.judge([late].into_iter(), before, now);
        watch.ticks.iter().map(|tick| tick.cause).collect()
    }

    #[test]
    fn each_cause_is_told_from_the_others() {
        let zero = Account::default();
        let waited = Account { waited_ns: 390_000, ..zero };
        assert_eq!(causes(true, zero, waited), [Cause::OwnWork]);
        assert_eq!(causes(false, zero, Account { page_faults: 1, ..waited }), [Cause::PageFault]);
        assert_eq!(causes(false, zero, Account { over_budget: 1, ..waited }), [Cause::AnotherBox]);
        assert_eq!(causes(false, zero, waited), [Cause::AnotherProgram]);
        assert_eq!(causes(false, zero, Account { waited_ns: 60_000, ..zero }), [Cause::Host]);
    }

    #[test]
    fn our_own_account_can_be_read() {
        let page = SharedPage::create().expect("a page");
        let account = Account::of(&page, 0, std::process::id());
        assert!(account.page_faults > 0, "{account:?}");
    }
}
