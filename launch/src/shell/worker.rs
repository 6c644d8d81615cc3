//! A worker process from start to end.
//!
//! Start: inherit the page, join the domain, open the ports, report ready; when launch says go,
//! connect, ask the kernel for what the system file wants, report working. Then the loop: look at
//! the wires, step, publish, ring; asleep on the doorbell in between. It ends when launch says
//! leave, when launch is gone, or on SIGTERM. Nothing in the loop formats, logs or allocates.

use super::ClockKind;
use super::page::{Phase, SharedPage, SlotState};
use super::realtime::{self, CpuChoice, Granted, Request};
use super::transport::{Domain, Output};
use crate::config::System;
use hilare_interfaces::latency::LatencyHistogram;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Health, HealthState, text_field};
use hilare_interfaces::wires::{self, Role};
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two heartbeats.
const HEARTBEAT: Duration = Duration::from_millis(50);

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
    /// Authority epoch (controllers).
    pub epoch: u64,
    /// 1 for the first process in this slot, 2 for its successor, …
    pub incarnation: u64,
}

/// A worker under way.
pub struct Worker {
    /// What it was told.
    pub assignment: Assignment,
    /// The system it is part of.
    pub system: System,
    /// Doorbells.
    pub page: SharedPage,
    /// Its place on the wires.
    pub domain: Domain,
    /// Time of steps, or lateness of ticks.
    pub latency: LatencyHistogram,
    terminate: Arc<AtomicBool>,
    health: Output<Health>,
    last_beat: Instant,
    granted: Granted,
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

    /// Connects its ports to the other ends.
    fn connect(&self);

    /// The last call before the process ends in good order.
    fn finish(&mut self) -> Result<(), String> {
        Ok(())
    }
}

impl Worker {
    /// Starts up to the point where the ports can be opened.
    pub fn start(assignment: Assignment) -> Result<Self, String> {
        // Dies with launch; if that happened already, nobody would tell.
        let _ = set_parent_process_death_signal(Some(Signal::TERM));
        if getppid().is_none_or(|pid| pid.as_raw_nonzero().get() != assignment.launch_pid) {
            return Err("launch is gone".to_owned());
        }
        let terminate = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(libc::SIGTERM, Arc::clone(&terminate)).map_err(|e| e.to_string())?;
        let page = SharedPage::inherit().map_err(|e| e.to_string())?;
        let file = assignment.runtime_dir.join("system.toml");
        let system = System::load(&file.to_string_lossy()).map_err(|e| e.to_string())?;
        let domain = Domain::join(&assignment.runtime_dir, assignment.role.name())?;
        let health = domain.output::<Health>(&wires::HEALTH)?;
        Ok(Self {
            assignment,
            system,
            page,
            domain,
            latency: LatencyHistogram::ZERO,
            terminate,
            health,
            last_beat: Instant::now(),
            granted: Granted::default(),
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
            cpu: CpuChoice::from_key(wanted.cpu),
            lock_memory: on_the_tick,
        });
        self.granted = realtime::granted();
        if on_the_tick && !self.granted.fifo {
            self.refusal = "best effort: SCHED_FIFO was refused";
        }
        self.page.set_state(slot, SlotState::Working);
        self.beat(&Report { state: HealthState::Ready, ..Report::default() });
        true
    }

    /// True when launch said leave, or a signal did.
    pub fn leaving(&self) -> bool {
        self.page.phase() == Phase::Leave || self.terminate.load(Ordering::Relaxed)
    }

    /// Sends a heartbeat if one is due at `now`.
    pub fn heartbeat(&mut self, now: Instant, report: impl FnOnce() -> Report) {
        if now.duration_since(self.last_beat) >= HEARTBEAT {
            self.last_beat = now;
            self.beat(&report());
        }
    }

    fn beat(&self, report: &Report) {
        let idle = report.state == HealthState::Running && report.steps == 0;
        let state = if idle { HealthState::Ready } else { report.state };
        let reason = if report.reason.is_empty() { self.refusal } else { report.reason };
        self.health.send(&Health {
            slot: self.assignment.slot as u64,
            pid: u64::from(std::process::id()),
            state: state.code(),
            tick: report.tick,
            steps: report.steps,
            rejected: report.rejected,
            path_id: report.path_id,
            granted_fifo: u64::from(self.granted.fifo),
            granted_priority: self.granted.priority,
            granted_cpu: self.granted.cpu.map_or(0, |cpu| cpu + 1),
            granted_mlock: u64::from(self.granted.mlock),
            latency: self.latency,
            text: text_field(reason),
        });
    }

    /// Hosts a box until the end.
    pub fn host(mut self, mut hosted: impl Reactive) -> Result<(), String> {
        if !self.go(|| hosted.connect()) {
            return Ok(());
        }
        let slot = self.assignment.slot;
        while !self.leaving() {
            let seen = self.page.bell(slot);
            let start = Instant::now();
            let worked = hosted.poll(&mut self);
            let mut now = start;
            if worked {
                now = Instant::now();
                self.latency.record(now.duration_since(start).as_nanos() as u64);
            }
            self.page.set_progress(slot, hosted.report().tick);
            self.heartbeat(now, || hosted.report());
            if !worked {
                self.page.wait(slot, seen, hosted.poll_interval());
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
