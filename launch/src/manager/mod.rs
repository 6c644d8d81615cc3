//! The process manager: creates the wires, starts the workers, holds authority, watches, ends.
//!
//! One loop, woken by events (a worker died, a line of output, a signal, a request) or by time: 20
//! times a second it renews the lease on the step generator and looks at the health of everybody.

pub mod children;
pub mod control;
pub mod robot_dir;
pub mod status;

use crate::config::System;
use crate::logging::LogSink;
use crate::shell::ClockKind;
use crate::shell::observer::Handover;
use crate::shell::page::{Phase, SharedPage, SlotState};
use crate::shell::realtime;
use crate::shell::transport::{Domain, HeldServices, Input, Output, SliceOutput, write_config};
use children::{Running, Start};
use control::{Call, Request, Response};
use crossbeam_channel::{Receiver, Sender, unbounded};
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{
    Answer, Authority, Drive, GoalHeader, GoalKind, Health, HealthState, Mode, Pose, Reference, ReferenceState,
    Steps, Waypoint, field_text,
};
use hilare_interfaces::wires::{self, Role};
use robot_dir::RobotDir;
use rustix::process::Signal;
use status::{ProcessStatus, Status};
use std::collections::VecDeque;
use std::path::Path;
use std::time::{Duration, Instant};
use tracing::{error, info, warn};

/// Time between two authority messages (launch's lease) and two looks at everybody's health.
const LEASE: Duration = Duration::from_millis(50);
/// Time workers have to open their ports.
const START_PATIENCE: Duration = Duration::from_secs(10);
/// Time the robot has to come to rest at the end.
const REST_PATIENCE: Duration = Duration::from_millis(500);
/// Time workers have to leave by themselves.
const LEAVE_PATIENCE: Duration = Duration::from_secs(2);
/// Priority of launch's own loop: above ordinary work, so that load does not cost the lease, below
/// everything on the tick.
const LAUNCH_PRIORITY: u64 = 10;

/// What wakes the loop.
pub enum Event {
    /// A worker is gone.
    Died {
        /// Its slot.
        slot: usize,
        /// Which incarnation of the slot.
        incarnation: u64,
        /// How it ended.
        how: String,
    },
    /// A line a worker wrote to its standard output.
    Output {
        /// Its slot.
        slot: usize,
        /// The line.
        line: String,
    },
    /// SIGINT or SIGTERM.
    Interrupt,
    /// A request from the control socket.
    Call(Call),
}

/// What to launch.
pub struct Job {
    /// The system; `system.robot` is the name it is claimed under.
    pub system: System,
    /// `Real` or `Lockstep`.
    pub clock: ClockKind,
    /// The path to follow from the start, if any.
    pub waypoints: Vec<WorldPoint>,
    /// Whether to keep figures and a trace.
    pub record: bool,
}

/// Why a start or a run failed.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// The caller can mend it: name taken, no room, unwritable (exit code 2).
    Refused(String),
    /// Something broke (exit code 1).
    Fault(String),
}

/// One worker as launch sees it.
struct Member {
    role: Role,
    running: Option<Running>,
    incarnation: u64,
    epoch: u64,
    health: Option<Health>,
    deaths: VecDeque<Instant>,
    restarts: u64,
    /// When to start it again.
    respawn_at: Option<Instant>,
    last_end: String,
}

/// Launch's own ports.
struct Ports {
    authority: Output<Authority>,
    goal: SliceOutput<GoalHeader, Waypoint>,
    answer: Input<Answer>,
    health: Input<Health>,
    steps: Input<Steps>,
    pose: Input<Pose>,
    reference: Input<Reference>,
}

/// A goal that was passed on and not yet answered.
struct PendingGoal {
    id: u64,
    reply: Sender<Response>,
    since: Instant,
}

/// A launched system.
pub struct Manager {
    // Order matters: ports and services go before the directory is wiped.
    ports: Ports,
    _services: HeldServices,
    domain: Domain,
    page: SharedPage,
    job: Job,
    members: Vec<Member>,
    events: Receiver<Event>,
    sender: Sender<Event>,
    log: LogSink,
    authority: Authority,
    newest: Newest,
    goals: VecDeque<PendingGoal>,
    next_goal: u64,
    next_epoch: u64,
    lease_due: Instant,
    fault: Option<String>,
    interrupted: bool,
    down: bool,
    leaving: bool,
    handover: Option<Handover>,
    dir: RobotDir,
}

/// The newest of each wire launch looks at.
#[derive(Clone, Copy, Debug, Default)]
pub struct Newest {
    /// Step generator.
    pub steps: Steps,
    /// Estimated pose.
    pub pose: Pose,
    /// Path progress.
    pub reference: Reference,
}

/// What a run left.
pub struct Outcome {
    /// The recorder's figures, if it lived to hand them over.
    pub handover: Option<Handover>,
    /// The recorder's trace, as CSV.
    pub trace_csv: Option<String>,
    /// Newest state of the step generator.
    pub steps: Steps,
    /// Lateness of the ticks.
    pub lateness: hilare_interfaces::latency::Quantiles,
    /// Workers started again.
    pub restarts: u64,
    /// What went wrong.
    pub fault: Option<String>,
    /// Ended by a signal or `hilare down`.
    pub interrupted: bool,
}

impl Manager {
    /// Claims the robot, creates its wires, starts every worker and waits until all are connected.
    pub fn start(job: Job, log: &LogSink) -> Result<Self, Failure> {
        let refused = |e: &dyn std::fmt::Display| Failure::Refused(e.to_string());
        let dir = RobotDir::claim(&job.system.robot).map_err(|e| refused(&e))?;
        write_files(dir.path(), &job)?;
        let domain = Domain::join(dir.path(), "launch").map_err(|e| refused(&e))?;
        let services = domain.create_services().map_err(|e| refused(&e))?;
        let ports = Ports::open(&domain).map_err(|e| refused(&e))?;
        let page = SharedPage::create().map_err(|e| Failure::Fault(format!("memfd: {e}")))?;
        let (sender, events) = unbounded();
        listen(dir.path(), &sender)?;
        let mut manager = Self {
            ports,
            _services: services,
            domain,
            page,
            members: roles(&job).map(Member::new).collect(),
            job,
            events,
            sender,
            log: log.clone(),
            authority: Authority::ZERO,
            newest: Newest::default(),
            goals: VecDeque::new(),
            next_goal: 1,
            next_epoch: 1,
            lease_due: Instant::now(),
            fault: None,
            interrupted: false,
            down: false,
            leaving: false,
            handover: None,
            dir,
        };
        let started = manager.start_workers();
        if let Err(failure) = started {
            manager.leave();
            return Err(failure);
        }
        Ok(manager)
    }

    fn start_workers(&mut self) -> Result<(), Failure> {
        for slot in 0..self.members.len() {
            self.page.assign(slot, self.members[slot].role);
            self.spawn(slot).map_err(Failure::Fault)?;
        }
        self.await_all(SlotState::Ready)?;
        self.page.set_phase(Phase::Go);
        self.await_all(SlotState::Working)?;
        // After the children, which shall not inherit it.
        let _ = realtime::set_fifo(LAUNCH_PRIORITY, true);
        if !self.job.waypoints.is_empty() {
            self.await_path()?;
        }
        self.report_grants();
        info!("{} workers at work", self.members.len());
        Ok(())
    }

    fn spawn(&mut self, slot: usize) -> Result<(), String> {
        let epoch = self.next_epoch;
        self.next_epoch += 1;
        let member = &mut self.members[slot];
        member.epoch = epoch;
        member.incarnation += 1;
        member.health = None;
        let arguments = vec![
            "--runtime-dir".to_owned(),
            self.dir.path().display().to_string(),
            "--slot".to_owned(),
            slot.to_string(),
            "--epoch".to_owned(),
            epoch.to_string(),
            "--incarnation".to_owned(),
            member.incarnation.to_string(),
            "--clock".to_owned(),
            self.job.clock.to_string(),
            "--launch-pid".to_owned(),
            std::process::id().to_string(),
        ];
        let start =
            Start { role: member.role, slot, incarnation: member.incarnation, arguments, page: &self.page };
        let running = children::start(start, &self.sender, &self.log)
            .map_err(|error| format!("cannot start {}: {error}", member.role.name()))?;
        member.running = Some(running);
        Ok(())
    }

    /// Waits until every worker has come as far as `state`, or one of them failed.
    fn await_all(&mut self, state: SlotState) -> Result<(), Failure> {
        let deadline = Instant::now() + START_PATIENCE;
        loop {
            let missing = (0..self.members.len()).find(|slot| self.page.state(*slot) < state);
            let Some(missing) = missing else { return Ok(()) };
            self.step(Duration::from_millis(1));
            if let Some(fault) = self.fault.take() {
                return Err(Failure::Fault(fault));
            }
            if self.interrupted || self.down {
                return Err(Failure::Fault("interrupted while starting".to_owned()));
            }
            if Instant::now() > deadline {
                let name = self.members[missing].role.name();
                return Err(Failure::Fault(format!("{name} did not start within {START_PATIENCE:?}")));
            }
        }
    }

    /// Waits until the waypoint selector has the path, so that the run begins with it at tick 0.
    fn await_path(&mut self) -> Result<(), Failure> {
        let deadline = Instant::now() + START_PATIENCE;
        let has_path = |member: &Member| {
            member.role == Role::WaypointSelector && member.health.is_some_and(|health| health.path_id > 0)
        };
        while !self.members.iter().any(has_path) {
            self.step(Duration::from_millis(1));
            if let Some(fault) = self.fault.take() {
                return Err(Failure::Fault(fault));
            }
            if self.interrupted || Instant::now() > deadline {
                return Err(Failure::Fault("the path did not reach the waypoint selector".to_owned()));
            }
        }
        Ok(())
    }

    /// Says in one line what was asked of the kernel and refused.
    fn report_grants(&self) {
        if self.job.clock != ClockKind::Real {
            return;
        }
        let refused: Vec<&str> = self
            .members
            .iter()
            .filter(|member| self.job.system.realtime(member.role).priority > 0)
            .filter(|member| member.health.is_none_or(|health| health.granted_fifo == 0))
            .map(|member| member.role.name())
            .collect();
        if !refused.is_empty() {
            warn!(
                "SCHED_FIFO was refused for {}: best effort, ticks may be late; allow it with `ulimit -r 99`, \
                 LimitRTPRIO=99 or CAP_SYS_NICE (hilare doctor)",
                refused.join(", ")
            );
        }
    }

    /// Renews the lease, takes in what arrived, for at most `patience` if nothing does.
    pub fn step(&mut self, patience: Duration) {
        let now = Instant::now();
        if now >= self.lease_due {
            self.lease_due = now + LEASE;
            self.send_authority();
            self.respawn_due(now);
            self.goals.retain(|goal| now.duration_since(goal.since) < Duration::from_secs(5));
        }
        self.look();
        let wait = patience.min(self.lease_due.saturating_duration_since(Instant::now()));
        if let Ok(event) = self.events.recv_timeout(wait) {
            self.take(event);
            while let Ok(event) = self.events.try_recv() {
                self.take(event);
            }
        }
    }

    fn send_authority(&mut self) {
        self.authority.seq += 1;
        if let Some((source, epoch)) = self.controller() {
            (self.authority.source, self.authority.epoch) = (source, epoch);
        }
        self.ports.authority.send(&self.authority);
        for slot in self.page.members(Role::StepGenerator) {
            self.page.ring_slot(slot);
        }
    }

    /// Source and epoch of the controller.
    fn controller(&self) -> Option<(u64, u64)> {
        let slot = self.members.iter().position(|member| member.role == Role::Controller)?;
        Some((slot as u64 + 1, self.members[slot].epoch))
    }

    fn look(&mut self) {
        while let Some(health) = self.ports.health.next() {
            if let Some(member) = self.members.get_mut(health.slot as usize) {
                let pid = member.running.as_ref().map_or(0, |running| u64::from(running.pid));
                // The step generator's lateness is wanted after its end as well.
                if pid == 0 || pid == health.pid {
                    member.health = Some(health);
                }
            }
        }
        if let Some(steps) = self.ports.steps.last() {
            self.newest.steps = steps;
        }
        if let Some(pose) = self.ports.pose.last() {
            self.newest.pose = pose;
        }
        if let Some(reference) = self.ports.reference.last() {
            self.newest.reference = reference;
        }
        while let Some(answer) = self.ports.answer.next() {
            self.pass_on(&answer);
        }
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::Died { slot, incarnation, how } => self.died(slot, incarnation, how),
            Event::Output { slot, line } => {
                if self.members[slot].role == Role::Recorder {
                    self.handover = serde_json::from_str(&line).ok();
                }
            }
            Event::Interrupt => self.interrupted = true,
            Event::Call(call) => self.answer(call),
        }
    }

    fn died(&mut self, slot: usize, incarnation: u64, how: String) {
        if self.members[slot].incarnation != incarnation {
            return;
        }
        self.page.set_state(slot, SlotState::Empty);
        self.members[slot].running = None;
        self.members[slot].last_end = how.clone();
        if self.leaving {
            return;
        }
        self.domain.clean_up_after_the_dead();
        let role = self.members[slot].role;
        match role {
            Role::Controller | Role::Planner if self.page.phase() == Phase::Go => self.plan_respawn(slot, &how),
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
        let (budget, window) = (supervision.restart_budget, Duration::from_secs_f64(supervision.restart_window_s));
        let now = Instant::now();
        let member = &mut self.members[slot];
        member.deaths.retain(|death| now.duration_since(*death) < window);
        member.deaths.push_back(now);
        let name = member.role.name();
        if member.deaths.len() as u64 > budget {
            self.authority.mode = Mode::Stop.code();
            self.fault = Some(format!("{name} {how}, more than {budget} times in {} s", window.as_secs_f64()));
            error!("{name} {how}: more than {budget} times in {} s, giving up", window.as_secs_f64());
            return;
        }
        // The first comes back at once, the next ones wait a little longer each.
        let wait = Duration::from_millis(20 * (member.deaths.len() as u64 - 1));
        member.respawn_at = Some(now + wait);
        warn!("{name} {how}: starting it again");
        self.respawn_due(now);
    }

    fn respawn_due(&mut self, now: Instant) {
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

    /// Sets what the operator wants. Refused where it would be unsafe.
    pub fn set_mode(&mut self, wanted: Mode) -> Result<(), String> {
        let now = Mode::from_code(self.authority.mode).unwrap_or(Mode::Stop);
        match (now, wanted) {
            (Mode::EStop, Mode::Armed) => return Err("the emergency stop is on; hilare reset first".to_owned()),
            (Mode::EStop, Mode::Stop) => return Ok(()),
            (_, Mode::Armed) if self.fault.is_some() => {
                return Err(format!("fault: {}; hilare down, then up", self.fault.as_deref().unwrap_or("")));
            }
            _ => {}
        }
        self.authority.mode = wanted.code();
        self.send_authority();
        Ok(())
    }

    /// Newest state of what launch looks at.
    pub fn newest(&self) -> &Newest {
        &self.newest
    }

    /// What keeps the robot from going on.
    pub fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }

    /// Somebody wants it to end: a signal, or `hilare down`.
    pub fn told_to_end(&self) -> bool {
        self.interrupted || self.down
    }

    /// The last waypoint was accepted.
    pub fn arrived(&self) -> bool {
        self.newest.reference.state == ReferenceState::Arrived.code()
    }
}

mod calls;
mod ending;

fn write_files(dir: &Path, job: &Job) -> Result<(), Failure> {
    let write = |name: &str, text: String| {
        let file = dir.join(name);
        std::fs::write(&file, text).map_err(|e| Failure::Refused(format!("{}: {e}", file.display())))
    };
    write("system.toml", job.system.to_toml())?;
    if !job.waypoints.is_empty() {
        write("waypoints.csv", hilare_planner::waypoint_file::write(&job.waypoints))?;
    }
    write_config(dir, &job.system.robot).map_err(|e| Failure::Refused(e.to_string()))
}

/// The system's workers, readers before the writers that wake them, the clock last.
fn roles(job: &Job) -> impl Iterator<Item = Role> + use<> {
    let recorder = job.record;
    wires::start_order().into_iter().filter(move |role| *role != Role::Recorder || recorder)
}

fn listen(dir: &Path, sender: &Sender<Event>) -> Result<(), Failure> {
    let fault = |what: &str, error: std::io::Error| Failure::Fault(format!("{what}: {error}"));
    let calls = sender.clone();
    control::listen(&dir.join("control.sock"), move |call| {
        let _ = calls.send(Event::Call(call));
    })
    .map_err(|error| fault("control socket", error))?;
    let interrupts = sender.clone();
    let mut signals = signal_hook::iterator::Signals::new([libc::SIGINT, libc::SIGTERM, libc::SIGHUP])
        .map_err(|error| fault("signals", error))?;
    std::thread::Builder::new()
        .name("signals".into())
        .stack_size(128 << 10)
        .spawn(move || {
            for _ in signals.forever() {
                let _ = interrupts.send(Event::Interrupt);
            }
        })
        .map_err(|error| fault("signals", error))?;
    Ok(())
}

impl Member {
    fn new(role: Role) -> Self {
        Self {
            role,
            running: None,
            incarnation: 0,
            epoch: 0,
            health: None,
            deaths: VecDeque::new(),
            restarts: 0,
            respawn_at: None,
            last_end: String::new(),
        }
    }

    fn status(&self, page_state: SlotState, authority: bool) -> ProcessStatus {
        let state = match (&self.running, page_state) {
            (None, _) => "dead",
            (_, SlotState::Empty) => HealthState::Starting.label(),
            (_, SlotState::Ready) => HealthState::Ready.label(),
            (_, SlotState::Working) => {
                self.health.and_then(|h| HealthState::from_code(h.state)).map_or("running", HealthState::label)
            }
        };
        let granted = self.health.map_or(String::new(), |health| {
            let mut granted = Vec::new();
            if health.granted_fifo == 1 {
                granted.push(format!("fifo:{}", health.granted_priority));
            }
            if health.granted_cpu > 0 {
                granted.push(format!("cpu:{}", health.granted_cpu - 1));
            }
            if health.granted_mlock == 1 {
                granted.push("mlock".to_owned());
            }
            granted.join(" ")
        });
        let text = self.health.map_or(String::new(), |health| field_text(&health.text).to_owned());
        ProcessStatus {
            name: self.role.name().to_owned(),
            pid: self.running.as_ref().map_or(0, |running| running.pid),
            state: state.to_owned(),
            reason: if self.running.is_none() { self.last_end.clone() } else { text },
            restarts: self.restarts,
            authority,
            granted,
        }
    }
}

impl Ports {
    fn open(domain: &Domain) -> Result<Self, crate::shell::transport::TransportError> {
        Ok(Self {
            authority: domain.output(&wires::AUTHORITY)?,
            goal: domain.slice_output(&wires::GOAL)?,
            answer: domain.input(&wires::ANSWER)?,
            health: domain.input(&wires::HEALTH)?,
            steps: domain.newest(&wires::STEPS)?,
            pose: domain.newest(&wires::POSE)?,
            reference: domain.newest(&wires::REFERENCE)?,
        })
    }
}
