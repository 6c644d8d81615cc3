//! The step generator's process: the clock of the system.
//!
//! `real`: absolute sleeps on CLOCK_MONOTONIC, one tick each. A wake-up less than a tick late keeps
//! the schedule. One a tick or more late (the host stole the core) drops the whole ticks lost, keeps
//! the phase and counts them as a pause: the robot waits, it never hurries to catch up, no step is
//! lost, and the bits stay those of the simulation.
//!
//! `lockstep`: virtual time. A tick is executed as soon as the command of its cycle is there and the
//! readers of the steps have kept up.

use super::change::Stage;
use super::checkpoint::key_of;
use super::page::{MAX_WAIT, News, SharedPage, monotonic_ns};
use super::renewal::Renewals;
use super::standing::Stands;
use super::timing::{LATE_NS, LateWakeUp};
use super::transport::{Input, Output, max_publishers};
use super::worker::{Report, Worker};
use super::{ClockKind, build, realtime};
use hilare_interfaces::block::{Block, TICK_S, Tick};
use hilare_interfaces::layout::{WireField, WireMessage};
use hilare_interfaces::messages::{Authority, Command, HealthState, JournalKind, Mode, Steps};
use hilare_interfaces::state::Stateful;
use hilare_interfaces::wires::{self, Role};
use hilare_step_generator::whole::Whole;
use hilare_step_generator::{StepGenerator, StepInputs};
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::Timespec;
use std::mem;
use std::time::Duration;

const TICK_NS: u64 = (TICK_S * 1e9) as u64;
/// Ticks the lockstep clock may be ahead of the slowest reader; well inside the wires' buffers.
const LOCKSTEP_LEAD: u64 = 512;
/// Control periods it may be. Between two looks of the relay at the commands it goes on by twice as many at most: when
/// the recorder has what the relay found before it came to the commands.
const LOCKSTEP_LEAD_PERIODS: u64 = wires::COMMAND.buffer as u64 / 4;
/// How long the lockstep clock sleeps when a reader is behind.
const BACK_PRESSURE: Duration = Duration::from_micros(200);
/// Commands taken in at most in one tick: all that may wait, so that a program that floods the wire keeps
/// nobody else's command from being read.
const COMMANDS_PER_TICK: usize = COMMANDS_WAITING * max_publishers(&wires::COMMAND);
/// Commands of a controller, and words of launch, that may wait: what is older is of no use here.
const COMMANDS_WAITING: usize = 64;
const AUTHORITIES_WAITING: usize = 8;
/// Ticks after which authority is looked for unasked.
const LOOKS: u32 = 10;
/// Ticks in which a robot told to end its drive must stand still before the process leaves.
const FAREWELL_TICKS: u64 = 100;

/// The process.
pub struct ClockProcess {
    generator: StepGenerator,
    authority: Input<Authority>,
    command: Input<Command>,
    steps: Output<Steps>,
    key: u64,
    /// All it needs is in the system.
    renewals: Renewals<()>,
    period_ticks: u64,
    tick: Tick,
    /// The tick of the state it went on from, if it is a successor.
    resumed: Option<Tick>,
    armed_once: bool,
    /// The announcement of authority that was looked after last, and the looks since.
    announced: u32,
    looks: u32,
    report: Report,
}

impl ClockProcess {
    /// Opens its ports. A successor goes on at the tick and with the counts its predecessor left, disarmed.
    pub fn new(worker: &mut Worker) -> Result<Self, String> {
        let (key, clock) = (key_of(Role::StepGenerator), worker.assignment.clock);
        let (generator, resumed) = worker.resume(key, |system| build::step_generator(system, clock));
        Ok(Self {
            generator,
            key,
            renewals: Renewals::begin(worker, |_| Ok(()))?,
            period_ticks: worker.system.timing.period_ticks,
            authority: worker.domain.input_of(&wires::AUTHORITY, AUTHORITIES_WAITING)?,
            command: worker.domain.input_of(&wires::COMMAND, COMMANDS_WAITING)?,
            steps: worker.domain.output(&wires::STEPS)?,
            tick: resumed.unwrap_or(0),
            resumed,
            armed_once: resumed.is_some(),
            announced: 0,
            looks: LOOKS,
            report: Report::default(),
        })
    }

    /// Runs until the process is to leave.
    pub fn run(mut self, mut worker: Worker) -> Result<(), String> {
        let connect = || {
            self.authority.connect();
            self.command.connect();
            self.steps.connect();
        };
        if !worker.go(connect) {
            return Ok(());
        }
        worker.timing().set_phase(monotonic_ns() % TICK_NS);
        let real = worker.assignment.clock == ClockKind::Real;
        let _awake = (real && worker.system.wake_up.keep_awake).then(realtime::keep_awake);
        self.begin(&mut worker);
        if self.armed_once {
            match worker.assignment.clock {
                ClockKind::Real => self.run_real(&mut worker),
                ClockKind::Lockstep | ClockKind::InProcess => self.run_lockstep(&mut worker),
            }
        }
        realtime::release();
        Ok(())
    }

    /// Time begins with the first arming: message 0 tells everybody where the robot stands. A successor
    /// repeats its predecessor's last message, which may not have been sent any more.
    fn begin(&mut self, worker: &mut Worker) {
        let slot = worker.assignment.slot;
        worker.journal_began(self.tick, self.resumed.map(|tick| (tick, slot)));
        while !worker.leaving() {
            let seen = worker.page.bell(slot);
            self.take_in(worker);
            // After authority: a change that was asked for before the robot was armed is there from the beginning.
            self.change(worker, if self.resumed.is_some() { self.next_period() } else { 0 });
            if self.armed_once {
                self.steps.send(self.generator.state());
                worker.page.ring(&wires::STEPS);
                return;
            }
            let report = Report { state: HealthState::Ready, ..self.report };
            worker.heartbeat(monotonic_ns(), || report);
            self.stand(worker);
            worker.page.wait(slot, seen, Duration::from_millis(10));
        }
    }

    /// Takes in everything that arrived, without spending a tick; the newest command.
    fn take_in(&mut self, worker: &Worker) -> Option<Command> {
        self.take_in_authority(worker);
        let mut newest = None;
        for _ in 0..COMMANDS_PER_TICK {
            let Some(command) = self.command.next() else { break };
            let inputs = StepInputs { commands: std::slice::from_ref(&command), ..StepInputs::default() };
            self.generator.take_in(self.tick, inputs);
            let words = [command.source, command.epoch, command.seq, command.content_hash()];
            worker.journal(self.tick, JournalKind::Command, &words);
            newest = Some(command);
        }
        newest
    }

    /// Authority is looked for when it was announced, and now and then.
    fn take_in_authority(&mut self, worker: &Worker) {
        let announced = worker.page.announced(News::Authority);
        self.looks += 1;
        if announced == self.announced && self.looks < LOOKS {
            return;
        }
        (self.announced, self.looks) = (announced, 0);
        while let Some(authority) = self.authority.next() {
            self.armed_once |= authority.mode == Mode::Armed.code();
            self.obey(worker, &authority);
        }
    }

    fn obey(&mut self, worker: &Worker, authority: &Authority) {
        let inputs = StepInputs { authority: Some(authority), ..StepInputs::default() };
        self.generator.take_in(self.tick, inputs);
        worker.journal(self.tick, JournalKind::Authority, &[authority.seq, authority.content_hash()]);
    }

    /// The first tick of which nobody has heard and at which a control period begins.
    const fn next_period(&self) -> Tick {
        (self.tick / self.period_ticks + 1) * self.period_ticks
    }

    /// Chooses the tick of a change of parameters that waits for one: `first`. Goes on with other limits, if it is
    /// their time.
    #[inline]
    fn change(&mut self, worker: &mut Worker, first: Tick) {
        let change = worker.page.change();
        let turn = change.turn();
        if turn.stage() == Stage::Asked {
            change.decide(turn, first);
        }
        let Some(mut renewal) = self.renewals.due(worker, self.tick) else { return };
        mem::swap(&mut worker.system, &mut renewal.system);
        self.generator.set_limits(worker.system.limits);
        self.renewals.applied(worker, renewal, self.tick, false);
    }

    /// Tells where it stands, if launch wants to know.
    #[inline]
    fn stand(&mut self, worker: &mut Worker) {
        let Self { generator, tick, .. } = self;
        worker.stand(|room| {
            let words = Whole(generator).save_state(room).unwrap_or(0);
            Some(Stands { done: Some(*tick), number: 0, words })
        });
    }

    /// Executes one tick and publishes it.
    fn execute(&mut self, worker: &mut Worker, paused_ticks: u64) -> Steps {
        self.change(worker, self.next_period());
        if paused_ticks > 0 {
            worker.journal(self.tick, JournalKind::Pause, &[paused_ticks]);
        }
        let steps = self.generator.step(self.tick, StepInputs { paused_ticks, ..StepInputs::default() });
        self.tick = steps.tick;
        // First remembered, then sent: what nobody knows of may be repeated, what was done may not.
        worker.remember(self.key, steps.tick, &mut self.generator);
        worker.note_telling(steps.tick);
        self.steps.send(&steps);
        self.report.tick = steps.tick;
        self.report.steps += 1;
        self.report.rejected = steps.commands_rejected;
        steps
    }

    /// Awake before its time: what can be done early is done, which warms the caches for the rest. The newest command
    /// that came.
    fn await_awake(&mut self, worker: &Worker, deadline_ns: u64) -> Option<Command> {
        let early = self.take_in(worker);
        self.steps.connect();
        while monotonic_ns() < deadline_ns {
            std::hint::spin_loop();
        }
        early
    }

    fn run_real(&mut self, worker: &mut Worker) {
        let spin_ns = worker.system.wake_up.spin_us * 1000;
        let phase_ns = worker.timing().phase_ns();
        let mut deadline_ns = monotonic_ns() / TICK_NS * TICK_NS + phase_ns;
        let (mut done_ns, mut farewell) = (0, 0);
        loop {
            deadline_ns += TICK_NS;
            sleep_until_ns(deadline_ns - spin_ns);
            let early = if spin_ns > 0 { self.await_awake(worker, deadline_ns) } else { None };
            let woke_ns = monotonic_ns();
            let late_ns = woke_ns.saturating_sub(deadline_ns);
            worker.timing().taken.record(late_ns);
            if late_ns >= LATE_NS {
                let own_work = done_ns > deadline_ns;
                worker.timing().woke_late(LateWakeUp { tick: self.tick, late_ns, own_work });
            }
            let paused = late_ns / TICK_NS;
            deadline_ns += paused * TICK_NS;
            if worker.leaving() {
                // Nobody is left to command: without fresh authority the ramp ends the motion.
                self.obey(worker, &last_stop());
                farewell += 1;
            } else if let Some(command) = self.take_in(worker).or(early) {
                let slot = command.source.wrapping_sub(1) as usize;
                if let Some(ns) = worker.page.timing(slot).since(command.pose_tick, woke_ns) {
                    worker.timing().age.record(ns);
                }
            }
            let steps = self.execute(worker, paused);
            worker.page.ring(&wires::STEPS);
            done_ns = monotonic_ns();
            worker.timing().stepped(done_ns - woke_ns, worker.budget_ns);
            let report = self.report;
            worker.heartbeat(done_ns, || report);
            self.stand(worker);
            let still = steps.twist == [0.0; 3];
            if farewell > 0 && (still || farewell > FAREWELL_TICKS) {
                return;
            }
        }
    }

    fn run_lockstep(&mut self, worker: &mut Worker) {
        let slot = worker.assignment.slot;
        while !worker.leaving() {
            let seen = worker.page.bell(slot);
            self.stand(worker);
            self.take_in(worker);
            if self.generator.awaits_command(self.tick) {
                // A successor among the readers may lack the steps that lead to it.
                self.steps.connect();
                worker.page.ring(&wires::STEPS);
                worker.page.wait(slot, seen, MAX_WAIT);
            } else if readers_behind(&worker.page, worker.system.timing.period_ticks, self.tick) {
                worker.page.ring(&wires::STEPS);
                worker.page.wait(slot, seen, BACK_PRESSURE);
            } else {
                self.execute(worker, 0);
                continue;
            }
            let report = self.report;
            worker.heartbeat(monotonic_ns(), || report);
        }
    }
}

/// The authority a departing clock gives itself.
pub fn last_stop() -> Authority {
    Authority { seq: u64::MAX, mode: Mode::Stop.code(), ..Authority::ZERO }
}

fn readers_behind(page: &SharedPage, period_ticks: u64, tick: Tick) -> bool {
    let readers = [Role::PoseEstimator, Role::Plant, Role::Recorder];
    let lead = LOCKSTEP_LEAD.min(LOCKSTEP_LEAD_PERIODS * period_ticks);
    tick > page.least_progress(&readers).saturating_add(lead)
}

/// Sleeps until a time on CLOCK_MONOTONIC.
pub fn sleep_until_ns(deadline_ns: u64) {
    let (tv_sec, tv_nsec) = (deadline_ns / 1_000_000_000, deadline_ns % 1_000_000_000);
    let deadline = Timespec { tv_sec: tv_sec as i64, tv_nsec: tv_nsec as i64 };
    // A signal ends the sleep early: sleep on, the flag is read after the tick.
    while clock_nanosleep_absolute(ClockId::Monotonic, &deadline) == Err(rustix::io::Errno::INTR) {}
}
