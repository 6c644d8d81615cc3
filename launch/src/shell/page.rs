//! Doorbells, progress marks, measurements, and what the boxes remember: a piece of shared memory beside the wires.
//!
//! Messages travel over iceoryx2; what it does not give is a cheap way to sleep until one is there
//! (its events cost about 12 µs a hop, a futex on the same core 4 µs). So every worker has a doorbell,
//! a futex word that writers ring after sending. Nobody depends on it for correctness: a lost or a
//! spurious ring only changes when a worker looks at its wires, and each looks every
//! [`MAX_WAIT`] anyway.

#![allow(unsafe_code)]

use super::change::Change;
use super::checkpoint::Area;
use super::journal::JournalRing;
use super::mapped::{Mappable, Mapped};
use super::timing::Timing;
use hilare_interfaces::block::Tick;
use hilare_interfaces::wires::{Role, Wire};
use rustix::thread::futex;
use rustix::time::{ClockId, Timespec, clock_gettime};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// Processes a system can have.
pub const MAX_SLOTS: usize = 16;
/// Longest sleep on a doorbell.
pub const MAX_WAIT: Duration = Duration::from_millis(50);
/// Environment variable that tells a worker the inherited page.
pub const PAGE_FD: &str = "HILARE_PAGE_FD";

/// Where the system as a whole is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Workers open their ports.
    Starting = 0,
    /// All ports exist: connect, then work.
    Go = 1,
    /// The boxes leave.
    Leave = 2,
    /// Then the relay, which repeats the last they said.
    RelayLeaves = 3,
    /// Then who looks, and whoever is still there.
    AllLeave = 4,
}

impl Phase {
    /// When a role leaves.
    pub fn leaves(role: Role) -> Self {
        match role {
            Role::Relay => Self::RelayLeaves,
            Role::Recorder | Role::Operator => Self::AllLeave,
            _ => Self::Leave,
        }
    }
}

/// What comes so seldom that whoever waits for it looks only when it is announced, and now and then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum News {
    /// A path.
    Path = 0,
    /// A change of authority.
    Authority = 1,
}

/// How far a worker is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
pub enum SlotState {
    /// Not running.
    Empty = 0,
    /// Its ports exist.
    Ready = 1,
    /// Connected and working.
    Working = 2,
}

/// Own cache lines, so that one worker's doorbell does not slow another's.
#[repr(C, align(128))]
struct Slot {
    bell: AtomicU32,
    waiting: AtomicU32,
    state: AtomicU32,
    progress: AtomicU64,
    /// Goes up as long as the worker's loop turns.
    life: AtomicU64,
    /// When its state was set last, ns on CLOCK_MONOTONIC.
    since: AtomicU64,
}

/// The page as it lies in memory; all zero is a valid, empty page.
#[repr(C)]
pub struct Page {
    magic: AtomicU64,
    phase: AtomicU32,
    news: [AtomicU32; 2],
    /// Bit set of slots for each role.
    members: [AtomicU64; Role::WORKERS.len() + 1],
    slots: [Slot; MAX_SLOTS],
    areas: [Area; MAX_SLOTS],
    timings: [Timing; MAX_SLOTS],
    journals: [JournalRing; MAX_SLOTS],
    change: Change,
    /// Goes up when launch wants to know where the boxes stand.
    standings_asked: AtomicU64,
    standings: [Area; MAX_SLOTS],
}

impl Page {
    /// Rings every worker that the wire wakes.
    pub fn ring(&self, wire: &Wire) {
        for reader in wire.to.iter().filter(|reader| reader.wakes) {
            let mut members = self.members[reader.role as usize].load(Ordering::Relaxed);
            while members != 0 {
                self.ring_slot(members.trailing_zeros() as usize);
                members &= members - 1;
            }
        }
    }

    /// Rings one worker.
    pub fn ring_slot(&self, slot: usize) {
        let slot = &self.slots[slot % MAX_SLOTS];
        // SeqCst on both sides: either the waiter sees the new bell, or we see that it waits.
        slot.bell.fetch_add(1, Ordering::SeqCst);
        if slot.waiting.load(Ordering::SeqCst) != 0 {
            let _ = futex::wake(&slot.bell, futex::Flags::empty(), i32::MAX as u32);
        }
    }

    /// Says that something was sent.
    pub fn announce(&self, what: News) {
        self.news[what as usize].fetch_add(1, Ordering::Release);
    }

    /// A number that changes with every announcement.
    #[inline]
    pub fn announced(&self, what: News) -> u32 {
        self.news[what as usize].load(Ordering::Acquire)
    }

    /// The bell of a slot; read it before looking at the wires, then give it to [`Page::wait`].
    pub fn bell(&self, slot: usize) -> u32 {
        self.slots[slot].bell.load(Ordering::SeqCst)
    }

    /// Sleeps until the bell is no longer `seen`, a signal comes, or `timeout` (at most
    /// [`MAX_WAIT`]) is over.
    pub fn wait(&self, slot: usize, seen: u32, timeout: Duration) {
        let slot = &self.slots[slot];
        let timeout = timeout.min(MAX_WAIT);
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(timeout.subsec_nanos()) };
        slot.waiting.store(1, Ordering::SeqCst);
        if slot.bell.load(Ordering::SeqCst) == seen {
            // EINTR, EAGAIN and time-out all mean the same to the caller: look again.
            let _ = futex::wait(&slot.bell, futex::Flags::empty(), seen, Some(&timeout));
        }
        slot.waiting.store(0, Ordering::SeqCst);
    }

    /// Marks ticks as worked on, for the lockstep clock.
    pub fn set_progress(&self, slot: usize, tick: u64) {
        self.slots[slot].progress.store(tick, Ordering::Release);
    }

    /// A worker's loop turns: it neither hangs nor spins in a step.
    pub fn give_sign_of_life(&self, slot: usize) {
        self.slots[slot].life.fetch_add(1, Ordering::Relaxed);
    }

    /// Launch: a number that changes as long as the worker's loop turns.
    pub fn sign_of_life(&self, slot: usize) -> u64 {
        self.slots[slot].life.load(Ordering::Relaxed)
    }

    /// The least progress of the working members of `roles`; `u64::MAX` without any.
    pub fn least_progress(&self, roles: &[Role]) -> u64 {
        roles
            .iter()
            .flat_map(|role| self.members(*role))
            .filter(|slot| self.state(*slot) == SlotState::Working)
            .map(|slot| self.slots[slot].progress.load(Ordering::Acquire))
            .min()
            .unwrap_or(u64::MAX)
    }

    /// Where a slot's box keeps what it remembers.
    pub fn area(&self, slot: usize) -> &Area {
        &self.areas[slot % MAX_SLOTS]
    }

    /// What a slot's process measures of itself.
    pub fn timing(&self, slot: usize) -> &Timing {
        &self.timings[slot % MAX_SLOTS]
    }

    /// What a slot's box took from outside.
    pub fn journal(&self, slot: usize) -> &JournalRing {
        &self.journals[slot % MAX_SLOTS]
    }

    /// The change of parameters under way.
    #[inline]
    pub fn change(&self) -> &Change {
        &self.change
    }

    /// Launch: asks the boxes where they stand; the number of the question.
    pub fn ask_standings(&self) -> u64 {
        let asked = self.standings_asked.fetch_add(1, Ordering::SeqCst) + 1;
        (0..MAX_SLOTS).for_each(|slot| self.ring_slot(slot));
        asked
    }

    /// Number of the last such question; 0 before the first.
    #[inline]
    pub fn standings_asked(&self) -> u64 {
        self.standings_asked.load(Ordering::Relaxed)
    }

    /// Where a slot's box writes down where it stands.
    pub fn standing(&self, slot: usize) -> &Area {
        &self.standings[slot % MAX_SLOTS]
    }

    /// The role a slot was given to, if any.
    pub fn role(&self, slot: usize) -> Option<Role> {
        Role::WORKERS.into_iter().find(|role| self.members(*role).any(|member| member == slot))
    }

    /// How long ago a box of `role` sent its message of `tick`.
    #[inline]
    pub fn since_told(&self, role: Role, tick: Tick, now_ns: u64) -> Option<u64> {
        self.members(role).find_map(|slot| self.timing(slot).since(tick, now_ns))
    }

    /// When the clock ticks, from the beginning of any millisecond of CLOCK_MONOTONIC.
    pub fn clock_phase_ns(&self) -> u64 {
        self.members(Role::StepGenerator).next().map_or(0, |slot| self.timing(slot).phase_ns())
    }

    /// Slots of a role.
    pub fn members(&self, role: Role) -> impl Iterator<Item = usize> + use<> {
        let members = self.members[role as usize].load(Ordering::Relaxed);
        (0..MAX_SLOTS).filter(move |slot| members >> slot & 1 == 1)
    }

    /// Launch: gives a slot to a role, empty.
    pub fn assign(&self, slot: usize, role: Role) {
        self.set_state(slot, SlotState::Empty);
        self.slots[slot].progress.store(0, Ordering::Relaxed);
        self.members[role as usize].fetch_or(1 << slot, Ordering::SeqCst);
    }

    /// Sets how far a worker is.
    pub fn set_state(&self, slot: usize, state: SlotState) {
        self.slots[slot].since.store(monotonic_ns(), Ordering::Relaxed);
        self.slots[slot].state.store(state as u32, Ordering::SeqCst);
    }

    /// When a worker got as far as it is, ns on CLOCK_MONOTONIC.
    pub fn since_ns(&self, slot: usize) -> u64 {
        self.slots[slot].since.load(Ordering::Relaxed)
    }

    /// How far a worker is.
    pub fn state(&self, slot: usize) -> SlotState {
        match self.slots[slot].state.load(Ordering::SeqCst) {
            0 => SlotState::Empty,
            1 => SlotState::Ready,
            _ => SlotState::Working,
        }
    }

    /// Launch: moves the system to a phase and wakes everybody.
    pub fn set_phase(&self, phase: Phase) {
        self.phase.store(phase as u32, Ordering::SeqCst);
        (0..MAX_SLOTS).for_each(|slot| self.ring_slot(slot));
    }

    /// Where the system is.
    pub fn phase(&self) -> Phase {
        match self.phase.load(Ordering::SeqCst) {
            0 => Phase::Starting,
            1 => Phase::Go,
            2 => Phase::Leave,
            3 => Phase::RelayLeaves,
            _ => Phase::AllLeave,
        }
    }
}

/// Now, ns on CLOCK_MONOTONIC.
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

// SAFETY: repr(C) and atomics only.
unsafe impl Mappable for Page {
    const FD: &'static str = PAGE_FD;
    const MAGIC: u64 = 0x6869_6c61_7265_0001;
    const STARTED_BY: &'static str = "workers are started by hilare up or run";

    fn magic(&self) -> &AtomicU64 {
        &self.magic
    }
}

/// The page, mapped into this process: launch creates it, workers inherit it.
pub type SharedPage = Mapped<Page>;

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::wires;
    use std::time::Instant;

    #[test]
    fn a_ring_before_the_wait_is_not_lost() {
        let page = SharedPage::create().unwrap();
        page.assign(3, Role::PoseEstimator);
        let seen = page.bell(3);
        page.ring(&wires::STEPS);
        let start = Instant::now();
        page.wait(3, seen, MAX_WAIT);
        assert!(start.elapsed() < MAX_WAIT, "returned at once, not by time-out");
        assert_ne!(page.bell(3), seen);
        let other = page.bell(4);
        page.ring(&wires::STEPS);
        assert_eq!(page.bell(4), other, "a slot without the role is left alone");
    }

    #[test]
    fn rings_wake_a_sleeper_in_another_thread() {
        const RINGS: u32 = 100;
        let page = SharedPage::create().unwrap();
        page.assign(0, Role::Plant);
        let asleep = AtomicU32::new(0);
        let start = Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for n in 0..RINGS {
                    let seen = page.bell(0);
                    asleep.store(n + 1, Ordering::Release);
                    page.wait(0, seen, MAX_WAIT);
                }
            });
            for n in 0..RINGS {
                while asleep.load(Ordering::Acquire) <= n {
                    std::hint::spin_loop();
                }
                // It is on its way into the kernel.
                std::thread::sleep(MAX_WAIT / 50);
                page.ring(&wires::STEPS);
            }
        });
        let (took, by_time_out) = (start.elapsed(), MAX_WAIT * RINGS);
        assert!(took < by_time_out / 3, "{took:?}: {by_time_out:?} if nobody wakes it");
    }

    #[test]
    fn only_working_members_hold_back_the_clock() {
        let page = SharedPage::create().unwrap();
        assert_eq!(page.least_progress(&[Role::Plant]), u64::MAX);
        page.assign(1, Role::Plant);
        page.assign(2, Role::PoseEstimator);
        page.set_state(1, SlotState::Working);
        page.set_state(2, SlotState::Working);
        page.set_progress(1, 7);
        page.set_progress(2, 9);
        assert_eq!(page.least_progress(&[Role::Plant, Role::PoseEstimator]), 7);
        page.set_state(1, SlotState::Empty);
        assert_eq!(page.least_progress(&[Role::Plant, Role::PoseEstimator]), 9);
    }
}
