//! The process manager: creates the wires, starts the workers, holds authority, watches, ends.
//!
//! One loop, woken by events (a worker died, a line of output, a signal, a request) or by time: 50
//! times a second it renews the lease on the step generator and looks at the health of everybody.

pub mod children;
pub mod control;
pub mod join;
pub mod measured;
pub mod notify;
pub mod param;
pub mod robot_dir;
pub mod standings;
pub mod status;

mod calls;
mod counts;
mod crew;
mod ending;
mod lateness;
mod member;
mod ports;
mod start;
mod supervise;
mod swap;
mod systems;

use crate::config::{Driver, System, Task};
use crate::logging::LogSink;
use crate::operator::{port, token};
use crate::recording::Order;
use crate::report::drove::Drove;
use crate::shell::ClockKind;
use crate::shell::observer::Handover;
use crate::shell::page::SharedPage;
use crate::shell::realtime::Granted;
use crate::shell::transport::{Domain, HeldServices, Janitor, Sweeper};
use control::{Call, Response};
pub use counts::Counts;
use crossbeam_channel::{Receiver, Sender, unbounded};
use hilare_interfaces::latency::Quantiles;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{
    Authority, Drive, GoalHeader, Mode, Pose, Reference, ReferenceState, Steps, Waypoint,
};
use hilare_interfaces::wires::Role;
use join::Workers;
pub use lateness::{Cause, LateTick, Timings};
use member::{Duty, Member};
use ports::Ports;
use robot_dir::RobotDir;
use std::collections::VecDeque;
use std::iter;
use std::path::Path;
use std::time::{Duration, Instant};
use tracing::{info, warn};

/// Time between two authority messages (launch's lease) and two looks at everybody's health.
const LEASE: Duration = Duration::from_millis(20);
/// Messages of a wire taken in at most in one look.
const MESSAGES_A_LOOK: usize = 64;
/// Time workers have to open their ports.
const START_PATIENCE: Duration = Duration::from_secs(10);
/// Time the robot has to come to rest at the end.
const REST_PATIENCE: Duration = Duration::from_millis(500);
/// Time workers have to leave by themselves.
const LEAVE_PATIENCE: Duration = Duration::from_secs(2);
/// Priority of launch's own loop: above ordinary work, so that load does not cost the lease, below
/// everything on the tick.
pub const LAUNCH_PRIORITY: u64 = 10;

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
    /// What to drive from the start, if anything.
    pub task: Option<Task>,
    /// Whether to keep figures and a trace.
    pub record: bool,
    /// Whether every message is kept besides, and where.
    pub recording: Option<Order>,
    /// Who starts the workers.
    pub workers: Workers,
}

/// A robot that is ours, before anything of it runs.
pub struct Claim {
    dir: RobotDir,
    sender: Sender<Event>,
    events: Receiver<Event>,
}

impl Claim {
    /// Claims a robot by name. From here on signals end a launch in good order.
    pub fn new(robot: &str) -> Result<Self, Failure> {
        // Before anything exists that an interrupt could leave behind.
        let (sender, events) = unbounded();
        start::catch_signals(&sender)?;
        let dir = RobotDir::claim(robot).map_err(|error| Failure::Refused(error.to_string()))?;
        Ok(Self { dir, sender, events })
    }
}

/// Why a start or a run failed.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// The caller can mend it: name taken, no room, unwritable (exit code 2).
    Refused(String),
    /// Something broke (exit code 1).
    Fault(String),
    /// Told to end before it was up.
    Interrupted,
}

/// A goal that was passed on and not yet answered.
struct PendingGoal {
    id: u64,
    /// It waits for the planner to be at work.
    unsent: Option<Vec<Waypoint>>,
    header: GoalHeader,
    reply: Sender<Response>,
    by: &'static str,
    since: Instant,
}

/// A launched system.
pub struct Manager {
    // Order matters: ports and services go before the directory is wiped.
    ports: Ports,
    _services: HeldServices,
    janitor: Janitor,
    sweeper: Sweeper,
    page: SharedPage,
    job: Job,
    page_url: Option<String>,
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
    /// Everybody is at work.
    up: bool,
    leaving: bool,
    handover: Option<Handover>,
    lateness: lateness::LateWatch,
    systems: systems::SystemFiles,
    /// A swap under way.
    swap: Option<swap::Swap>,
    swaps: u64,
    drove: Drove,
    drove_names: Vec<String>,
    params: param::Params,
    /// Why the robot has to be armed again, if so.
    halted: Option<String>,
    notify: notify::Notify,
    born: Instant,
    dir: RobotDir,
}

/// The newest of each wire launch looks at.
#[derive(Clone, Copy, Debug, Default)]
pub struct Newest {
    /// Step generator.
    pub steps: Steps,
    /// Estimated pose; none before the first tick.
    pub pose: Option<Pose>,
    /// Path progress.
    pub reference: Reference,
}

/// What a run left.
pub struct Outcome {
    /// The recorder's figures, if it lived to hand them over.
    pub handover: Option<Handover>,
    /// The recorder's trace, as CSV.
    pub trace_csv: Option<String>,
    /// Lateness of the ticks.
    pub lateness: Quantiles,
    /// Workers started again.
    pub restarts: u64,
    /// Controllers and boxes swapped.
    pub swaps: u64,
    /// Changes of parameters.
    pub param_changes: u64,
    /// Laws and programs that drove, oldest first.
    pub drove: Vec<String>,
    /// What went wrong.
    pub fault: Option<String>,
    /// Ended by a signal or `hilare down`.
    pub interrupted: bool,
}

impl Manager {
    /// Creates the wires, starts every worker and waits until all are connected.
    pub fn start(claim: Claim, job: Job, log: &LogSink) -> Result<Self, Failure> {
        let refused = |e: &dyn std::fmt::Display| Failure::Refused(e.to_string());
        let Claim { dir, sender, events } = claim;
        if job.workers == Workers::Own {
            port::check_all(&job.system).map_err(Failure::Refused)?;
        }
        let page_url = token::make(dir.path(), &job.system.listen).map_err(Failure::Refused)?;
        start::write_files(dir.path(), &job)?;
        let systems = systems::SystemFiles::begin(dir.path(), &job.system).map_err(Failure::Refused)?;
        let domain = Domain::join(dir.path(), "launch").map_err(|e| refused(&e))?;
        let services = domain.create_services().map_err(|e| refused(&e))?;
        let ports = Ports::open(&domain).map_err(|e| refused(&e))?;
        let page = SharedPage::create().map_err(|e| Failure::Fault(format!("memfd: {e}")))?;
        let no_thread = |e: &std::io::Error| Failure::Fault(format!("thread: {e}"));
        let fifo = (job.clock == ClockKind::Real).then_some(children::WATCH_PRIORITY);
        start::listen(dir.path(), &page, &sender)?;
        let mut manager = Self {
            ports,
            _services: services,
            sweeper: domain.sweeper(fifo).map_err(|e| no_thread(&e))?,
            janitor: domain.into_janitor().map_err(|e| no_thread(&e))?,
            page,
            members: start::members(&job),
            job,
            page_url,
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
            up: false,
            leaving: false,
            handover: None,
            lateness: lateness::LateWatch::default(),
            systems,
            swap: None,
            swaps: 0,
            drove: Drove::default(),
            drove_names: Vec::new(),
            params: param::Params::default(),
            halted: None,
            notify: notify::Notify::from_environment(),
            born: Instant::now(),
            dir,
        };
        if robot_dir::estop_latch(&manager.job.system.robot).exists() {
            manager.authority.mode = Mode::EStop.code();
            warn!("the emergency stop is still on; hilare reset releases it");
        }
        let started = manager.start_workers();
        if let Err(failure) = started {
            manager.leave();
            return Err(failure);
        }
        Ok(manager)
    }

    /// Renews the lease, takes in what arrived, for at most `patience` if nothing does.
    pub fn step(&mut self, patience: Duration) {
        let now = Instant::now();
        self.tell_service_manager(now);
        if now >= self.lease_due {
            self.lease_due = now + LEASE;
            self.send_authority();
            self.respawn_due(now);
            self.welcome();
            self.look_for_the_hung();
            self.look_at_lateness();
            self.goals.retain(|goal| now.duration_since(goal.since) < control::PATIENCE);
        }
        self.look();
        self.judge_swap();
        self.judge_param();
        self.send_goals_that_wait();
        let patience = if self.params.under_way.is_some() { patience.min(param::LOOK) } else { patience };
        let wait = patience.min(self.lease_due.saturating_duration_since(Instant::now()));
        if let Ok(event) = self.events.recv_timeout(wait) {
            self.take(event);
            while let Ok(event) = self.events.try_recv() {
                self.take(event);
            }
        }
    }

    fn look(&mut self) {
        // Bounded: whoever floods these wires shall not cost the lease.
        for health in iter::from_fn(|| self.ports.health.next()).take(MESSAGES_A_LOOK) {
            if let Some(member) = self.members.get_mut(health.slot as usize) {
                let pid = member.running.as_ref().map_or(0, |running| u64::from(running.pid));
                if pid == 0 || pid == health.pid {
                    member.hear(health);
                }
            }
        }
        if let Some(steps) = self.ports.steps.last() {
            self.newest.steps = steps;
            self.follow_promotion();
            self.note_driver(&steps);
            if steps.drive == Drive::PauseStop.code() && self.authority.mode == Mode::Armed.code() {
                let limit = self.job.system.timing.pause_stop_ticks;
                self.halt(Mode::Stop, &format!("paused for {limit} ticks or more (timing.pause_stop_ticks)"));
            }
        }
        if let Some(pose) = self.ports.pose.last() {
            self.newest.pose = Some(pose);
        }
        if let Some(reference) = self.ports.reference.last() {
            self.newest.reference = reference;
        }
        for _ in 0..MESSAGES_A_LOOK {
            let Some(answer) = self.ports.answer.next() else { break };
            self.pass_on(&answer);
        }
    }

    /// Who drives, by the name it has now: later its place may be another's.
    fn note_driver(&mut self, steps: &Steps) {
        let Some((source, _)) = self.drove.note(steps) else { return };
        let member = usize::try_from(source - 1).ok().and_then(|slot| self.members.get(slot));
        self.drove_names.extend(member.and_then(|member| member.driver.as_ref()).map(Driver::short_name));
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::Died { slot, incarnation, how } => self.died(slot, incarnation, &how),
            Event::Output { slot, line } => {
                if self.members[slot].role == Role::Recorder {
                    self.handover = serde_json::from_str(&line).ok();
                }
            }
            Event::Interrupt => self.interrupted = true,
            Event::Call(call) => self.answer(call),
        }
    }

    /// Sets what the operator wants. Refused where it would be unsafe.
    pub fn set_mode(&mut self, wanted: Mode, by: &str) -> Result<(), String> {
        let now = Mode::from_code(self.authority.mode).unwrap_or(Mode::Stop);
        match (now, wanted) {
            (Mode::EStop, Mode::Armed) => {
                return Err("the emergency stop is on; hilare reset releases it".to_owned());
            }
            (Mode::EStop | Mode::Disarmed, Mode::Stop) => return Ok(()),
            (_, Mode::Armed) if self.fault.is_some() => {
                return Err(format!("fault: {}; hilare down, then up", self.fault.as_deref().unwrap_or("")));
            }
            _ => {}
        }
        let robot = &self.job.system.robot;
        if now == Mode::EStop && wanted != Mode::EStop {
            // First the latch: what cannot be released would be on again after a restart.
            robot_dir::unlatch_estop(robot)?;
        }
        self.authority.mode = wanted.code();
        self.halted = None;
        self.send_authority();
        if now != wanted {
            info!("{}, by {by}", wanted.label());
        }
        if wanted == Mode::EStop
            && let Err(why) = robot_dir::latch_estop(&self.job.system.robot)
        {
            warn!("{why}: the emergency stop will not outlast a restart of launch");
        }
        Ok(())
    }

    /// The directory of what belongs to the robot while it is up.
    pub fn runtime_dir(&self) -> &Path {
        self.dir.path()
    }

    /// What the kernel has granted the step generator.
    pub fn clock_granted(&self) -> Option<Granted> {
        self.members[self.slot_at_work(Role::StepGenerator)?].granted()
    }

    /// Where the process of a role is that is in charge, or the only one.
    fn slot_at_work(&self, role: Role) -> Option<usize> {
        self.members.iter().position(|member| member.role == role && member.duty == Duty::Work)
    }

    /// Newest state of what launch looks at.
    pub fn newest(&self) -> &Newest {
        &self.newest
    }

    /// What the operator wants.
    pub fn mode(&self) -> Mode {
        Mode::from_code(self.authority.mode).unwrap_or(Mode::Stop)
    }

    /// What keeps the robot from going on.
    pub fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }

    /// Why it does not go on before the operator arms it again, if so.
    pub fn halted(&self) -> Option<&str> {
        self.halted.as_deref()
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
