//! `hilare latency`: how punctual a robot is on this machine, beside what the kernel alone can do.
//!
//! A whole robot drives laps; on the same cores, with the same priorities and in the same milliseconds run a
//! bare timer loop, bare futex hops and bare iceoryx2 hops ([`bare`]), beside a load if wanted ([`load`]). What
//! is compared was measured at the same time on the same machine; nothing is trimmed.

pub mod bare;
pub mod load;

mod cyclictest;
mod figures;
mod observers;
mod picture;
mod visitors;

pub use cyclictest::Cyclictest;
pub use figures::{Figures, Hop, Micros, Process, Tick};
pub use observers::{Suffering, Watched};
pub use picture::write_pictures;

use crate::config::{System, Task};
use crate::manager::children::this_program;
use crate::manager::{Cause, Claim, Counts, Failure, Job, LateTick, Manager, Timings};
use crate::recording::Order;
use crate::shell::ClockKind;
use crate::shell::mapped::{Mappable, Mapped};
use crate::shell::realtime::Granted;
use bare::{BarePage, Chain, HOPS, Part, Stage};
use hilare_interfaces::latency::LatencyHistogram;
use hilare_interfaces::messages::{Mode, Waypoint};
use hilare_interfaces::wires::Role;
use load::Load;
use observers::Turns;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Side of the square that is driven in laps, m.
const SIDE_M: f64 = 0.4;
/// Drives are this much longer than the measurement, so that it does not arrive meanwhile.
const RESERVE: f64 = 1.5;
/// Time everything runs before it is measured.
const WARM_UP: Duration = Duration::from_millis(500);
/// Time the bare processes have to start.
const PATIENCE: Duration = Duration::from_secs(10);
/// A late command and a stall of the bare loop are of one time if they lie this close, ms.
const BESIDE_MS: u64 = 50;

/// What to measure.
pub struct Measurement {
    /// The robot.
    pub system: System,
    /// For how long.
    pub seconds: f64,
    /// Beside a load.
    pub load: bool,
    /// Observers that come and go, half of the time.
    pub observers: usize,
    /// They are visitors of the page, who misbehave.
    pub visitors: bool,
    /// With the recorder, as every run has it.
    pub record: bool,
    /// Every message is recorded besides, and where.
    pub recording: Option<Order>,
}

/// Hops of one kind, and all of them together.
#[derive(Clone, Debug)]
pub struct Hops {
    /// One by one.
    pub hops: [LatencyHistogram; HOPS],
    /// From the first to the last.
    pub all: LatencyHistogram,
}

/// What was measured.
pub struct Measured {
    /// For how long, s.
    pub seconds: f64,
    /// What the load consisted of, if there was one.
    pub load: Option<&'static str>,
    /// The robot's own times.
    pub robot: Timings,
    /// Lateness of the bare loop.
    pub bare_loop: LatencyHistogram,
    /// Bare futex hops.
    pub futex: Hops,
    /// Bare iceoryx2 hops.
    pub iceoryx2: Hops,
    /// With observers and without, if there were any.
    pub watched: Option<Watched>,
    /// What cyclictest says, where it is installed.
    pub cyclictest: Option<Cyclictest>,
    /// What the step generator was granted.
    pub granted: Granted,
    /// Commands that came late, and how many of them while the bare loop stalled, too.
    pub commands_late: u64,
    /// See above.
    pub commands_late_beside_stalls: u64,
    /// Stalls of the bare loop: wake-ups late by a tick or more.
    pub bare_stalls: u64,
    /// Ticks late by a tenth of a tick or more, at most a thousand.
    pub late: Vec<LateTick>,
    /// How many each cause has.
    pub causes: [(Cause, u64); Cause::ALL.len()],
    /// What kept the processes from their work.
    pub counts: Vec<(Role, Counts)>,
    /// Time the host took away from the whole machine, s; as coarse as the kernel counts it.
    pub steal_s: f64,
}

/// Measures; `step` is called some fifty times a second with the time that has passed.
pub fn measure(
    what: &Measurement,
    claim: Claim,
    log: &crate::logging::LogSink,
    mut step: impl FnMut(Duration),
) -> Result<Measured, Failure> {
    let system = with_start(&what.system);
    let job = Job {
        task: Some(Task::Follow(laps(&system, what.seconds))),
        system,
        clock: ClockKind::Real,
        record: what.record,
        recording: what.recording.clone(),
        workers: crate::manager::join::Workers::Own,
    };
    let mut manager = Manager::start(claim, job, log)?;
    let measured = beside(&mut manager, what, &mut step);
    let outcome = manager.end();
    let recording = outcome.handover.and_then(|handover| handover.recording);
    match (outcome.fault, recording) {
        (Some(fault), _) => Err(Failure::Fault(fault)),
        (None, Some(recording)) if !recording.complete => {
            Err(Failure::Fault(format!("the recording is not complete: {}", recording.why)))
        }
        (None, None) if what.recording.is_some() => {
            Err(Failure::Fault("the recorder died; its recording has no end".to_owned()))
        }
        (None, _) => measured,
    }
}

/// Everything that runs beside a robot that is up.
fn beside(
    manager: &mut Manager,
    what: &Measurement,
    step: &mut impl FnMut(Duration),
) -> Result<Measured, Failure> {
    let fault = |error: std::io::Error| Failure::Fault(format!("bare processes: {error}"));
    let load = if what.load { Some(Load::start(what.seconds).map_err(fault)?) } else { None };
    let mut bare = Bare::start(manager, what).map_err(fault)?;
    bare.await_ready(manager)?;
    pass(manager, WARM_UP, |_, _| {})?;
    let clock = what.system.realtime(Role::StepGenerator);
    let cyclictest = cyclictest::start(clock, what.seconds);
    let steal_before = steal_s();
    bare.page.set_stage(Stage::Measuring);
    manager.set_mode(Mode::Armed, "the command line").map_err(Failure::Fault)?;
    let mut late_commands = LateCommands::default();
    let counts_before = manager.counts();
    let began = Instant::now();
    let mut turns = Turns::new(what.observers, what.seconds, &manager.timings(), &bare.page);
    pass(manager, Duration::from_secs_f64(what.seconds), |manager, passed| {
        late_commands.look(manager, &bare.page);
        turns.look(passed, || manager.timings(), &bare.page);
        step(passed);
    })?;
    // Both at the same time.
    bare.page.set_stage(Stage::Over);
    let robot = manager.timings();
    let seconds = began.elapsed().as_secs_f64();
    let watched = turns.end(&robot, &bare.page).map(|watched| Watched { visitors: what.visitors, ..watched });
    let counts = since(manager.counts(), &counts_before);
    bare.all_went_well()?;
    let (late, causes) = manager.late_ticks();
    Ok(Measured {
        seconds,
        load: load.as_ref().map(Load::by),
        robot,
        bare_loop: bare.page.timing.taken.snapshot(),
        futex: Hops::of(&bare.page.futex),
        iceoryx2: Hops::of(&bare.page.iceoryx2),
        watched,
        cyclictest: cyclictest.and_then(cyclictest::Started::end),
        granted: manager.clock_granted().unwrap_or_default(),
        commands_late: late_commands.seen,
        commands_late_beside_stalls: late_commands.beside_stalls(),
        bare_stalls: bare.page.timing.late_count(),
        late: late.to_vec(),
        causes,
        counts,
        steal_s: steal_s() - steal_before,
    })
}

/// What was counted meanwhile; a successor began at nothing.
fn since(now: Vec<(Role, Counts)>, before: &[(Role, Counts)]) -> Vec<(Role, Counts)> {
    let of = |role| {
        before.iter().find(|(other, _)| *other == role).map_or(Counts::default(), |(_, counts)| *counts)
    };
    now.into_iter().map(|(role, counts)| (role, counts.since(of(role)))).collect()
}

/// Lets time pass.
fn pass(
    manager: &mut Manager,
    time: Duration,
    mut look: impl FnMut(&Manager, Duration),
) -> Result<(), Failure> {
    let began = Instant::now();
    while began.elapsed() < time {
        manager.step(Duration::from_millis(20));
        look(manager, began.elapsed());
        if let Some(why) = manager.fault().or(manager.halted()) {
            return Err(Failure::Fault(why.to_owned()));
        }
        if manager.mode() == Mode::EStop {
            return Err(Failure::Fault("emergency stop; hilare reset releases it".to_owned()));
        }
        if manager.told_to_end() {
            return Err(Failure::Fault("interrupted".to_owned()));
        }
    }
    Ok(())
}

/// The robot stands on the first waypoint, in the direction of the second.
fn with_start(system: &System) -> System {
    let mut system = system.clone();
    system.start = hilare_interfaces::geometry::WorldPose::new(0.0, 0.0, 0.0);
    // A stall is what is measured, not a reason to stop.
    system.timing.pause_stop_ticks = 0;
    system
}

/// Laps round a square for longer than `seconds`.
fn laps(system: &System, seconds: f64) -> Vec<Waypoint> {
    let length_m = seconds * RESERVE * system.tracking.speed_mps + 2.0 * SIDE_M;
    let corners = [(0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M)];
    let count = (length_m / SIDE_M).ceil() as usize + 1;
    corners.iter().cycle().take(count).map(|(x_m, y_m)| Waypoint::straight(*x_m, *y_m)).collect()
}

impl Hops {
    fn of(chain: &Chain) -> Self {
        Self { hops: std::array::from_fn(|n| chain.hops[n].snapshot()), all: chain.all.snapshot() }
    }
}

/// The bare processes; gone with this.
struct Bare {
    page: Mapped<BarePage>,
    children: Vec<Child>,
}

impl Bare {
    fn start(manager: &Manager, what: &Measurement) -> std::io::Result<Self> {
        let observer = if what.visitors { Part::Visitor } else { Part::Observer };
        let mut bare = Self { page: Mapped::create()?, children: Vec::new() };
        for part in Part::BARE.into_iter().chain(std::iter::repeat_n(observer, what.observers)) {
            let role = match part {
                Part::Loop | Part::Driver => Role::StepGenerator,
                Part::Responder(1) => Role::PoseEstimator,
                Part::Responder(2) => Role::WaypointSelector,
                Part::Responder(_) => Role::Controller,
                Part::Observer | Part::Visitor => Role::Recorder,
            };
            let wanted = what.system.realtime(role);
            let mut command: Command = this_program();
            command.arg("bare").arg(part.name()).arg("--runtime-dir").arg(manager.runtime_dir());
            command.args([
                format!("--cpu={}", wanted.cpu),
                format!("--priority={}", wanted.priority),
                format!("--phase-ns={}", manager.phase_ns()),
            ]);
            command.env(BarePage::FD, bare.page.inherited_fd()).stdin(Stdio::null()).stdout(Stdio::null());
            bare.children.push(command.spawn()?);
        }
        Ok(bare)
    }

    fn await_ready(&self, manager: &mut Manager) -> Result<(), Failure> {
        let deadline = Instant::now() + PATIENCE;
        while self.page.ready() < self.children.len() {
            pass(manager, Duration::from_millis(20), |_, _| {})?;
            if Instant::now() > deadline {
                return Err(Failure::Fault(format!("the bare processes did not start within {PATIENCE:?}")));
            }
        }
        Ok(())
    }
}

impl Bare {
    /// The measurement is over: all leave, and none has failed.
    fn all_went_well(&mut self) -> Result<(), Failure> {
        let deadline = Instant::now() + PATIENCE;
        for child in &mut self.children {
            let ended = loop {
                match child.try_wait() {
                    Ok(Some(ended)) => break ended,
                    Ok(None) if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(2)),
                    _ => {
                        return Err(Failure::Fault(format!(
                            "a bare process did not end within {PATIENCE:?}"
                        )));
                    }
                }
            };
            if !ended.success() {
                return Err(Failure::Fault("a bare process failed; what it says stands above".to_owned()));
            }
        }
        Ok(())
    }
}

impl Drop for Bare {
    fn drop(&mut self) {
        self.page.set_stage(Stage::Over);
        let deadline = Instant::now() + Duration::from_secs(1);
        for child in &mut self.children {
            while matches!(child.try_wait(), Ok(None)) && Instant::now() < deadline {
                std::thread::sleep(Duration::from_millis(2));
            }
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// When commands were late, and when the bare loop stalled, in milliseconds of CLOCK_MONOTONIC.
#[derive(Default)]
struct LateCommands {
    seen: u64,
    commands_ms: Vec<u64>,
    stalls: u64,
    stalls_ms: Vec<u64>,
}

impl LateCommands {
    fn look(&mut self, manager: &Manager, page: &BarePage) {
        let late = manager.newest().steps.commands_late;
        let now_ms = crate::shell::page::monotonic_ns() / 1_000_000;
        self.commands_ms.extend((self.seen..late).map(|_| now_ms));
        self.seen = late;
        self.stalls_ms.extend(page.timing.late_since(self.stalls).map(|stall| stall.tick));
        self.stalls = page.timing.late_count();
    }

    fn beside_stalls(&self) -> u64 {
        let beside = |ms: &&u64| self.stalls_ms.iter().any(|stall| stall.abs_diff(**ms) <= BESIDE_MS);
        self.commands_ms.iter().filter(beside).count() as u64
    }
}

/// Time the host has taken away so far, s.
fn steal_s() -> f64 {
    let text = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    let of_all = text.lines().next().and_then(|line| line.split_whitespace().nth(8)?.parse::<f64>().ok());
    of_all.unwrap_or(0.0) / rustix::param::clock_ticks_per_second() as f64
}
