//! A worker process from start to end.
//!
//! Start: inherit the page, join the domain, open the ports, report ready; when launch says go,
//! connect, ask the kernel for what the system file wants, report working. Then the loop: look at
//! the wires, step, publish, ring; asleep on the doorbell in between. It ends when launch says
//! leave, when launch is gone, or on SIGTERM. Nothing in the loop formats, logs or allocates.

use super::ClockKind;
use super::checkpoint::StateRoom;
use super::clock::sleep_until_ns;
use super::page::{Phase, SharedPage, SlotState, monotonic_ns};
use super::realtime::{self, CpuChoice, Request};
use super::standing::Stands;
use super::timing::Timing;
use super::transport::{Domain, Output};
use crate::config::System;
use hilare_controller::LAWS;
use hilare_interfaces::block::{TICK_S, Tick};
use hilare_interfaces::messages::{Health, HealthState, JournalKind, text_field};
use hilare_interfaces::state::Stateful;
use hilare_interfaces::wires::{self, Role};
use rustix::process::{
    Resource, Rlimit, Signal, getppid, getrlimit, set_parent_process_death_signal, setrlimit,
};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time between two heartbeats.
const HEARTBEAT_NS: u64 = 50_000_000;
/// A step may take this part of the time until the next one.
const BUDGET_PART: f64 = 0.1;

/// Name of a numbered system file in the runtime directory. What a box may ever have read stays as it was.
pub fn system_file(number: u64) -> String {
    format!("system-{number}.toml")
}

/// The number of a system file of this name.
pub fn system_number(name: &str) -> Option<u64> {
    name.strip_prefix("system-")?.strip_suffix(".toml")?.parse().ok()
}

/// What launch tells a worker on its command line.
#[derive(Clone, Debug)]
pub struct Assignment {
    /// Its box.
    pub role: Role,
    /// Its slot in the page.
    pub slot: usize,
    /// The robot's runtime directory.
    pub runtime_dir: PathBuf,
    /// What drives the ticks.
    pub clock: ClockKind,
    /// Process id of launch, to notice that it died before we could ask for the signal.
    pub launch_pid: i32,
    /// True if somebody else started it: then it is not the kernel that ends it with launch.
    pub joined: bool,
    /// Number of its system file in the runtime directory.
    pub system: u64,
    /// Processor, as a key of the system file.
    pub cpu: i64,
    /// Control law (controllers).
    pub law: Option<String>,
    /// Authority epoch (controllers).
    pub epoch: u64,
    /// 1 for the first process in this slot, 2 for its successor, …
    pub incarnation: u64,
}

/// What was found is not the state of such a box, which is half changed now and to be built anew.
#[derive(Clone, Copy, Debug)]
pub struct Garbled;

/// A worker under way.
pub struct Worker {
    /// What it was told.
    pub assignment: Assignment,
    /// The system it is part of.
    pub system: System,
    /// Doorbells.
    pub page: Arc<SharedPage>,
    /// Its place on the wires.
    pub domain: Domain,
    terminate: Arc<AtomicBool>,
    health: Output<Health>,
    last_beat_ns: u64,
    /// Asked for once: it is a system call.
    pid: u64,
    room: StateRoom,
    /// Number of the system file that is in force here.
    pub in_force: u64,
    /// The question of launch that was answered last (see [`super::standing`]).
    pub(super) stood: u64,
    /// What a step may take.
    pub budget_ns: u64,
    /// What the kernel refused.
    refusal: &'static str,
}

/// What a box reports in its heartbeat.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// State.
    pub state: HealthState,
    /// Why, if there is more to say than the state.
    pub reason: &'static str,
    /// Newest tick worked on.
    pub tick: u64,
    /// Steps taken.
    pub steps: u64,
    /// Messages refused or missing.
    pub rejected: u64,
    /// Newest path seen (planner: published), 0 before the first.
    pub path_id: u64,
}

impl Default for Report {
    fn default() -> Self {
        Self { state: HealthState::Running, reason: "", tick: 0, steps: 0, rejected: 0, path_id: 0 }
    }
}

/// A box in its process: woken by its wires.
pub trait Reactive {
    /// Works off what the wires hold. True if there was anything.
    fn poll(&mut self, worker: &mut Worker) -> bool;

    /// What to say of itself.
    fn report(&self) -> Report;

    /// How long it may sleep without a ring.
    fn poll_interval(&self) -> Duration {
        super::page::MAX_WAIT
    }

    /// False if it looks by itself: then nobody spends a wake-up on it.
    fn is_woken(&self) -> bool {
        true
    }

    /// Connects its ports to the other ends.
    fn connect(&self);

    /// Where the box stands, all it remembers in `room`; nothing if it has not begun, or is no box of the loop.
    fn stands(&mut self, _room: &mut [u64]) -> Option<Stands> {
        None
    }

    /// The last call before the process ends in good order.
    fn finish(&mut self) -> Result<(), String> {
        Ok(())
    }
}

/// Who goes first when memory runs out, as `oom_score_adj`: those the robot can do without. To be spared more
/// than others takes a privilege; without it nothing changes.
pub const fn memory_rank(role: Role) -> i32 {
    match role {
        // Only looks; what it lacks is seen.
        Role::Operator => 750,
        Role::Recorder => 600,
        Role::Relay => 450,
        Role::Planner => 300,
        _ => -500,
    }
}

/// From here on this process ends with launch; if launch is gone already, nobody would tell.
pub fn die_with_launch(launch_pid: i32) -> Result<(), String> {
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
    if getppid().is_none_or(|pid| pid.as_raw_nonzero().get() != launch_pid) {
        return Err("launch is gone".to_owned());
    }
    Ok(())
}

impl Worker {
    /// Starts up to the point where the ports can be opened.
    pub fn start(assignment: Assignment) -> Result<Self, String> {
        if !assignment.joined {
            die_with_launch(assignment.launch_pid)?;
        }
        let terminate = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(libc::SIGTERM, Arc::clone(&terminate)).map_err(|e| e.to_string())?;
        let page = Arc::new(SharedPage::inherit().map_err(|e| e.to_string())?);
        let file = assignment.runtime_dir.join(system_file(assignment.system));
        let system = System::load(&file.to_string_lossy()).map_err(|e| e.to_string())?;
        // Writing a core file takes longer than a successor needs to start.
        if !system.supervision.core_files {
            let limit = Rlimit { current: Some(0), ..getrlimit(Resource::Core) };
            let _ = setrlimit(Resource::Core, limit);
        }
        let _ = std::fs::write("/proc/self/oom_score_adj", memory_rank(assignment.role).to_string());
        let domain = Domain::join(&assignment.runtime_dir, assignment.role.name())?;
        let health = domain.output::<Health>(&wires::HEALTH)?;
        let budget_ticks = match assignment.role {
            Role::WaypointSelector | Role::Controller => system.timing.period_ticks,
            _ => 1,
        };
        Ok(Self {
            in_force: assignment.system,
            stood: 0,
            assignment,
            system,
            page,
            domain,
            terminate,
            health,
            last_beat_ns: monotonic_ns(),
            pid: u64::from(std::process::id()),
            room: StateRoom::default(),
            budget_ns: (budget_ticks as f64 * TICK_S * 1e9 * BUDGET_PART) as u64,
            refusal: "",
        })
    }

    /// Ports are open: waits for launch's go, then connects and asks the kernel. False if the
    /// worker is to leave instead.
    pub fn go(&mut self, connect: impl FnOnce()) -> bool {
        let slot = self.assignment.slot;
        self.page.set_state(slot, SlotState::Ready);
        while self.page.phase() == Phase::Starting && !self.leaving() {
            let seen = self.page.bell(slot);
            self.page.give_sign_of_life(slot);
            if self.page.phase() == Phase::Starting {
                self.page.wait(slot, seen, super::page::MAX_WAIT);
            }
        }
        if self.leaving() {
            return false;
        }
        connect();
        self.health.connect();
        let wanted = self.system.realtime(self.assignment.role);
        let on_the_tick = self.assignment.clock == ClockKind::Real && wanted.priority > 0;
        realtime::apply(Request {
            priority: if on_the_tick { wanted.priority } else { 0 },
            cpu: CpuChoice::from_key(self.assignment.cpu),
            lock_memory: on_the_tick,
        });
        if on_the_tick && !realtime::granted(None).fifo {
            self.refusal = "best effort: SCHED_FIFO was refused";
        }
        self.page.set_state(slot, SlotState::Working);
        self.beat(&Report { state: HealthState::Ready, ..Report::default() });
        true
    }

    /// Room for the state of a box.
    pub fn room(&mut self) -> &mut [u64] {
        self.room.all()
    }

    /// Keeps the state of the box after `tick` for whoever comes after this process.
    pub fn remember(&mut self, key: u64, tick: Tick, of: &mut impl Stateful) {
        if let Some(len) = of.save_state(self.room.all()) {
            self.page.area(self.assignment.slot).store(key, tick, self.room.first(len));
        }
    }

    /// Keeps the first words of the room as where the box stands, for the `asked`th question.
    pub(super) fn store_standing(&self, asked: u64, used: usize) {
        self.page.standing(self.assignment.slot).store(asked, 0, self.room.first(used));
    }

    /// The newest state of a kind that a slot has, if its tick is wanted, into a box; its tick, or `None`
    /// if there is none.
    pub fn recall(
        &mut self,
        slot: usize,
        key: u64,
        wanted: impl Fn(Tick) -> bool,
        into: &mut impl Stateful,
    ) -> Result<Option<Tick>, Garbled> {
        let Some((tick, len)) = self.page.area(slot).load(key, wanted, &mut self.room) else {
            return Ok(None);
        };
        if into.load_state(self.room.first(len)) { Ok(Some(tick)) } else { Err(Garbled) }
    }

    /// A box as its predecessor in this slot left it, and the tick of that; or a new one.
    pub fn resume<B: Stateful>(&mut self, key: u64, build: impl Fn(&System) -> B) -> (B, Option<Tick>) {
        let mut built = build(&self.system);
        match self.recall(self.assignment.slot, key, |_| true, &mut built) {
            Ok(tick) => (built, tick),
            Err(Garbled) => (build(&self.system), None),
        }
    }

    /// Notes what the box took from outside.
    #[inline]
    pub fn journal(&self, tick: Tick, kind: JournalKind, words: &[u64]) {
        self.page.journal(self.assignment.slot).note(tick, kind, words);
    }

    /// Notes that the process is at work, and the state it went on from: its tick and whose it was.
    pub fn journal_began(&self, tick: Tick, state: Option<(Tick, usize)>) {
        let told = &self.assignment;
        let law = told.law.as_deref().and_then(|name| LAWS.iter().position(|law| law.name == name));
        let law = law.map_or(0, |place| place as u64 + 1);
        let (saved, whose) = state.map_or((0, 0), |(tick, slot)| (tick + 1, slot as u64 + 1));
        let words = [told.incarnation, told.epoch, self.in_force, law, saved, whose];
        self.journal(tick, JournalKind::Began, &words);
    }

    /// What this process measures of itself.
    pub fn timing(&self) -> &Timing {
        self.page.timing(self.assignment.slot)
    }

    /// A message of `tick` has come from a box of `role`.
    #[inline]
    pub fn note_taken(&self, role: Role, tick: Tick) {
        if let Some(ns) = self.page.since_told(role, tick, monotonic_ns()) {
            self.timing().taken.record(ns);
        }
    }

    /// The answer to `tick` is about to be sent.
    #[inline]
    pub fn note_telling(&self, tick: Tick) {
        self.timing().stamp(tick, monotonic_ns());
    }

    /// The answer to `tick` is out.
    #[inline]
    pub fn note_told(&self, tick: Tick) {
        if let Some(ns) = self.page.since_told(Role::StepGenerator, tick, monotonic_ns()) {
            self.timing().age.record(ns);
        }
    }

    /// True when launch said leave, or a signal did.
    pub fn leaving(&self) -> bool {
        self.page.phase() >= Phase::leaves(self.assignment.role) || self.terminate.load(Ordering::Relaxed)
    }

    /// Gives a sign of life, and sends a heartbeat if one is due at `now`.
    pub fn heartbeat(&mut self, now_ns: u64, report: impl FnOnce() -> Report) {
        self.page.give_sign_of_life(self.assignment.slot);
        if now_ns.saturating_sub(self.last_beat_ns) >= HEARTBEAT_NS {
            self.last_beat_ns = now_ns;
            self.beat(&report());
        }
    }

    fn beat(&self, report: &Report) {
        let idle = report.state == HealthState::Running && report.steps == 0;
        let state = if idle { HealthState::Ready } else { report.state };
        let reason = if report.reason.is_empty() { self.refusal } else { report.reason };
        self.health.send(&Health {
            slot: self.assignment.slot as u64,
            role: self.assignment.role.code(),
            pid: self.pid,
            state: state.code(),
            tick: report.tick,
            steps: report.steps,
            rejected: report.rejected,
            path_id: report.path_id,
            text: text_field(reason),
        });
    }

    /// How long after each tick this box looks at its wires, if it is not its messages that wake it.
    fn looks_by_time(&self) -> Option<u64> {
        let wake_up = &self.system.wake_up;
        let after_us = match self.assignment.role {
            Role::PoseEstimator => wake_up.pose_estimator_us,
            Role::WaypointSelector => wake_up.waypoint_selector_us,
            Role::Controller => wake_up.controller_us,
            _ => 0,
        };
        (after_us > 0 && self.assignment.clock == ClockKind::Real).then_some(after_us * 1000)
    }

    /// Hosts a box until the end.
    pub fn host(mut self, mut hosted: impl Reactive) -> Result<(), String> {
        if !self.go(|| hosted.connect()) {
            return Ok(());
        }
        let slot = self.assignment.slot;
        let by_time = self.looks_by_time();
        while !self.leaving() {
            let seen = self.page.bell(slot);
            let start_ns = monotonic_ns();
            let worked = hosted.poll(&mut self);
            let mut now_ns = start_ns;
            if worked {
                now_ns = monotonic_ns();
                self.timing().stepped(now_ns - start_ns, self.budget_ns);
            }
            self.page.set_progress(slot, hosted.report().tick);
            self.heartbeat(now_ns, || hosted.report());
            self.stand(|room| hosted.stands(room));
            if !worked {
                // Who has come since gets what it missed now, not with the next message: it may be what that
                // one waits for.
                hosted.connect();
            }
            // Nothing else before it sleeps: on a shared core whoever it woke waits for that. What has come
            // meanwhile has rung.
            if let Some(after_ns) = by_time {
                sleep_until_ns(next_look_ns(monotonic_ns(), self.page.clock_phase_ns() + after_ns));
            } else if hosted.is_woken() {
                self.page.wait(slot, seen, hosted.poll_interval());
            } else {
                std::thread::sleep(hosted.poll_interval());
            }
        }
        realtime::release();
        hosted.poll(&mut self);
        let finished = hosted.finish();
        let state = if finished.is_ok() { HealthState::Ready } else { HealthState::Fault };
        self.beat(&Report { state, ..hosted.report() });
        finished
    }
}

/// The next time after `now_ns` at a phase of the tick.
fn next_look_ns(now_ns: u64, phase_ns: u64) -> u64 {
    const TICK_NS: u64 = 1_000_000;
    let phase_ns = phase_ns % TICK_NS;
    (now_ns + TICK_NS - phase_ns) / TICK_NS * TICK_NS + phase_ns
}

#[cfg(test)]
mod tests {
    use super::next_look_ns;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_next_look_is_within_a_tick_and_at_its_phase(now in 0u64..1 << 50, phase in 0u64..3_000_000) {
            let next = next_look_ns(now, phase);
            prop_assert!(next > now && next <= now + 1_000_000);
            prop_assert_eq!(next % 1_000_000, phase % 1_000_000);
        }
    }
}
