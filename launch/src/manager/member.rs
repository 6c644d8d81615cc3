//! One worker as launch sees it.

use super::Counts;
use super::children::Running;
use super::status::ProcessStatus;
use crate::config::Driver;
use crate::shell::page::SlotState;
use crate::shell::realtime::{self, Granted};
use hilare_interfaces::messages::{Health, HealthState, field_text};
use hilare_interfaces::wires::Role;
use rustix::process::{Pid, Signal};
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use tracing::warn;

/// A worker that lived shorter than this died of itself, not of an accident.
const YOUNG: Duration = Duration::from_millis(250);
/// Wait before the second start in a row of one that dies young; doubles with each.
const BACK_OFF: Duration = Duration::from_millis(20);
/// Longest such wait.
const BACK_OFF_MAX: Duration = Duration::from_secs(1);
/// Least time between two words of the log that a worker is degraded.
const WORD_EVERY: Duration = Duration::from_secs(10);

/// What a worker is there for at present.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Duty {
    /// Nobody is wanted here: a place for one more controller.
    Vacant,
    /// At work: the box itself, or the controller in charge.
    Work,
    /// A controller ready to take over.
    Standby,
    /// A controller that is being judged.
    Trial,
    /// Told to leave; nobody comes after it.
    Retiring,
}

/// One worker as launch sees it.
pub(super) struct Member {
    pub role: Role,
    pub duty: Duty,
    /// What drives, if it is a controller.
    pub driver: Option<Driver>,
    pub running: Option<Running>,
    /// It is started by somebody else, and joins.
    pub joined: bool,
    /// What whoever joins in this place is to be told; none while nobody is awaited.
    pub invitation: Option<Vec<String>>,
    pub incarnation: u64,
    pub epoch: u64,
    pub health: Option<Health>,
    /// When the log had a word of that it is degraded.
    worded: Option<Instant>,
    pub started: Instant,
    /// When it was told to leave.
    pub retired: Instant,
    /// When its process died, ns on CLOCK_MONOTONIC, until its successor is at work.
    pub missed_since_ns: Option<u64>,
    /// Why launch is ending it, if it is.
    pub doom: Option<String>,
    deaths: VecDeque<Instant>,
    died_young: u32,
    pub restarts: u64,
    /// When to start it again.
    pub respawn_at: Option<Instant>,
    pub last_end: String,
    /// The sign of life seen last, and for how many looks in a row.
    sign: u64,
    silent_looks: u32,
}

impl Member {
    pub(super) fn new(role: Role, duty: Duty, driver: Option<Driver>) -> Self {
        Self {
            role,
            duty,
            driver,
            running: None,
            joined: false,
            invitation: None,
            incarnation: 0,
            epoch: 0,
            health: None,
            worded: None,
            started: Instant::now(),
            retired: Instant::now(),
            missed_since_ns: None,
            doom: None,
            deaths: VecDeque::new(),
            died_young: 0,
            restarts: 0,
            respawn_at: None,
            last_end: String::new(),
            sign: 0,
            silent_looks: 0,
        }
    }

    /// Takes over what it says of itself; when it becomes degraded the log has a word of it, now and then.
    pub(super) fn hear(&mut self, health: Health) {
        let is_degraded = |health: &Health| health.state == HealthState::Degraded.code();
        let begins = is_degraded(&health) && !self.health.as_ref().is_some_and(is_degraded);
        if begins && self.worded.is_none_or(|at| at.elapsed() >= WORD_EVERY) {
            self.worded = Some(Instant::now());
            warn!("{} is degraded: {}", self.name(), field_text(&health.text));
        }
        self.health = Some(health);
    }

    /// A process was started in this place.
    pub(super) fn began(&mut self, running: Running) {
        self.running = Some(running);
        self.started = Instant::now();
        self.silent_looks = 0;
    }

    /// Ends its process at once; `why` is what its death is put down to.
    pub(super) fn doom(&mut self, why: String) {
        if let Some(running) = &self.running {
            running.signal(Signal::KILL);
            self.doom = Some(why);
        }
    }

    /// Name in lines for people: a controller with what drives in it.
    pub(super) fn name(&self) -> String {
        match &self.driver {
            Some(driver) => format!("{} ({})", self.role.name(), driver.name()),
            None => self.role.name().to_owned(),
        }
    }

    /// Notes a death within the budget and returns how long to wait before the successor: nothing
    /// after an accident, longer and longer for one that dies as soon as it is born. `None` when the
    /// budget is used up.
    pub(super) fn next_start(&mut self, now: Instant, budget: u64, window: Duration) -> Option<Duration> {
        self.deaths.retain(|death| now.duration_since(*death) < window);
        self.deaths.push_back(now);
        let young = now.duration_since(self.started) < YOUNG;
        self.died_young = if young { self.died_young + 1 } else { 0 };
        if self.deaths.len() as u64 > budget {
            return None;
        }
        let wait = match self.died_young {
            0 | 1 => Duration::ZERO,
            n => BACK_OFF * (1 << (n - 2).min(8)),
        };
        Some(wait.min(BACK_OFF_MAX))
    }

    /// Takes in its sign of life; returns for how many looks in a row it has given none.
    pub(super) fn look(&mut self, sign: u64) -> u32 {
        self.silent_looks = if sign == self.sign { self.silent_looks + 1 } else { 0 };
        self.sign = sign;
        self.silent_looks
    }

    /// It has just been seen at work.
    pub(super) fn seen(&mut self) {
        self.silent_looks = 0;
    }

    /// As it is shown; `warm` if it stands by and has commands in time.
    pub(super) fn status(
        &self,
        slot: usize,
        page_state: SlotState,
        warm: bool,
        counts: Counts,
    ) -> ProcessStatus {
        let state = match (&self.running, page_state) {
            (None, _) if self.invitation.is_some() => "awaited",
            (None, _) => "dead",
            // A program that is not ours says nothing of its state: its commands are looked at.
            (_, SlotState::Empty) if self.is_foreign() && self.duty == Duty::Standby && warm => "standby",
            (_, SlotState::Empty) if self.is_foreign() => HealthState::Running.label(),
            (_, SlotState::Empty) => HealthState::Starting.label(),
            (_, SlotState::Ready) => HealthState::Ready.label(),
            (_, SlotState::Working) => match self.duty {
                Duty::Standby if warm => "standby",
                _ => self
                    .health
                    .and_then(|h| HealthState::from_code(h.state))
                    .map_or(HealthState::Running.label(), HealthState::label),
            },
        };
        let state = match self.duty {
            Duty::Trial => "trial",
            Duty::Retiring => "leaving",
            _ => state,
        };
        let text = self.health.map_or(String::new(), |health| field_text(&health.text).to_owned());
        ProcessStatus {
            slot,
            name: self.role.name().to_owned(),
            law: self.driver.as_ref().map(Driver::name),
            pid: self.running.as_ref().map_or(0, |running| running.pid),
            state: state.to_owned(),
            reason: if self.running.is_none() { self.last_end.clone() } else { text },
            restarts: self.restarts,
            tick: self.health.map_or(0, |health| health.tick),
            rejected: self.health.map_or(0, |health| health.rejected),
            authority: self.role == Role::Controller && self.duty == Duty::Work,
            granted: self.granted().map_or(String::new(), |granted| granted_text(&granted)),
            counts,
        }
    }

    /// What the kernel has granted it, as the kernel says.
    pub(super) fn granted(&self) -> Option<Granted> {
        let pid = self.running.as_ref().and_then(|running| Pid::from_raw(running.pid.cast_signed()))?;
        Some(realtime::granted(Some(pid)))
    }

    /// True for a program that is not ours.
    pub(super) fn is_foreign(&self) -> bool {
        matches!(self.driver, Some(Driver::Exec(_)))
    }
}

fn granted_text(granted: &Granted) -> String {
    let fifo = granted.fifo.then(|| format!("fifo:{}", granted.priority));
    let cpu = granted.cpu.map(|cpu| format!("cpu:{cpu}"));
    let mlock = granted.mlock.then(|| "mlock".to_owned());
    [fifo, cpu, mlock].into_iter().flatten().collect::<Vec<_>>().join(" ")
}
