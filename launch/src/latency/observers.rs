//! Observers that come and go while it is measured, by turns: what looking costs the tick.

use super::bare::{BarePage, Stage};
use crate::manager::Timings;
use crate::shell::realtime;
use crate::shell::transport::{Domain, Input, TransportError};
use hilare_interfaces::latency::LatencyHistogram;
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages::{Pose, Reference, Steps, Truth};
use hilare_interfaces::wires::watch;
use std::fmt;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How long an observer stays.
const STAY: Duration = Duration::from_millis(100);
/// Time between two of its looks.
const LOOK: Duration = Duration::from_millis(10);
/// Longest time between two turns.
const TURN: Duration = Duration::from_secs(5);
/// Turns of each kind at least.
const TURNS: u32 = 2;

/// What of the tick could suffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suffering {
    /// Lateness of the tick.
    pub lateness: LatencyHistogram,
    /// From its waking until it has told everybody.
    pub work: LatencyHistogram,
    /// From the steps until the command they lead to is out.
    pub cycle: LatencyHistogram,
    /// Lateness of the bare loop, which no observer can reach but by the processor.
    pub bare_loop: LatencyHistogram,
}

/// The tick with observers that come and go, and without, by turns in the same run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watched {
    /// Processes that observed.
    pub observers: usize,
    /// They were visitors of the page, and what they read is counted in kilobytes.
    pub visitors: bool,
    /// How often one of them joined.
    pub joins: u64,
    /// Messages they read.
    pub messages: u64,
    /// While they stayed away.
    pub without: Suffering,
    /// While they came and went.
    pub with: Suffering,
}

/// Divides a measurement into turns.
pub(super) struct Turns {
    observers: usize,
    length: Duration,
    next: Duration,
    before: Suffering,
    /// Without, with.
    sums: [Suffering; 2],
    with: bool,
}

impl Suffering {
    const NONE: Self = Self {
        lateness: LatencyHistogram::ZERO,
        work: LatencyHistogram::ZERO,
        cycle: LatencyHistogram::ZERO,
        bare_loop: LatencyHistogram::ZERO,
    };

    fn of(robot: &Timings, page: &BarePage) -> Self {
        Self {
            lateness: robot.lateness,
            work: robot.work,
            cycle: robot.cycle,
            bare_loop: page.timing.taken.snapshot(),
        }
    }

    fn add(&mut self, now: &Self, before: &Self) {
        self.lateness.merge(&now.lateness.since(&before.lateness));
        self.work.merge(&now.work.since(&before.work));
        self.cycle.merge(&now.cycle.since(&before.cycle));
        self.bare_loop.merge(&now.bare_loop.since(&before.bare_loop));
    }
}

impl Turns {
    /// From now on, for so long; the first turn is without.
    pub(super) fn new(observers: usize, seconds: f64, robot: &Timings, page: &BarePage) -> Self {
        let length = TURN.min(Duration::from_secs_f64(seconds) / (2 * TURNS));
        let before = Suffering::of(robot, page);
        Self { observers, length, next: length, before, sums: [Suffering::NONE; 2], with: false }
    }

    /// Changes turns when it is time; `passed` is that since the beginning.
    pub(super) fn look(&mut self, passed: Duration, robot: impl Fn() -> Timings, page: &BarePage) {
        if self.observers == 0 || passed < self.next {
            return;
        }
        self.next += self.length;
        self.close(&robot(), page);
        self.with = !self.with;
        page.set_observed(self.with);
    }

    fn close(&mut self, robot: &Timings, page: &BarePage) {
        let now = Suffering::of(robot, page);
        self.sums[usize::from(self.with)].add(&now, &self.before);
        self.before = now;
    }

    /// The last turn is over.
    pub(super) fn end(mut self, robot: &Timings, page: &BarePage) -> Option<Watched> {
        self.close(robot, page);
        let (joins, messages) = page.observers();
        let [without, with] = self.sums;
        (self.observers > 0).then_some(Watched {
            observers: self.observers,
            visitors: false,
            joins,
            messages,
            without,
            with,
        })
    }
}

/// A reader of what the relay repeats at full rate.
struct Observer {
    steps: Input<Steps>,
    pose: Input<Pose>,
    reference: Input<Reference>,
    truth: Input<Truth>,
}

impl Observer {
    fn join(domain: &Domain) -> Result<Self, TransportError> {
        Ok(Self {
            steps: domain.input(&watch::STEPS)?,
            pose: domain.input(&watch::POSE)?,
            reference: domain.input(&watch::REFERENCE)?,
            truth: domain.input(&watch::TRUTH)?,
        })
    }

    fn look(&self) -> u64 {
        fn read<T: WireMessage + fmt::Debug>(wire: &Input<T>) -> u64 {
            std::iter::from_fn(|| wire.next()).count() as u64
        }
        read(&self.steps) + read(&self.pose) + read(&self.reference) + read(&self.truth)
    }
}

/// An observer's process: joins the robot, looks for a tenth of a second, leaves, again and again.
pub(super) fn come_and_go(page: &BarePage, runtime_dir: &Path) -> Result<(), String> {
    realtime::leave_the_control_path();
    page.note_ready();
    while page.stage() != Stage::Over {
        if !page.observed() {
            sleep(LOOK);
            continue;
        }
        let domain = Domain::join(runtime_dir, "observer")?;
        let observer = Observer::join(&domain)?;
        let (came, mut messages) = (Instant::now(), 0);
        while came.elapsed() < STAY && page.stage() != Stage::Over {
            messages += observer.look();
            sleep(LOOK);
        }
        page.note_observer(messages);
    }
    Ok(())
}
