//! What the kernel alone can do, measured beside the robot on its cores and priorities.
//!
//! ```text
//!   phase of the tick   0        ¼ ms                            ½ ms            1 ms
//!   robot               tick, steps → pose → reference → command
//!   driver                       ├ futex ─▶ 1 ─▶ 2 ─▶ 3    (even milliseconds)
//!                                └ iceoryx2 ─▶ 1 ─▶ 2 ─▶ 3 (odd ones)
//!   loop                                                         wakes, notes how late it is, sleeps
//! ```
//!
//! Each of these is a process. The loop is what cyclictest does: it sleeps until an absolute time, nothing
//! else. A futex hop is a word that one process changes and another one sleeps on; an iceoryx2 hop is
//! its publish-subscribe with its event. The three that answer have the priorities of pose estimator, waypoint
//! selector and controller, so that a core goes from one to the next as it does in the robot.

#![allow(unsafe_code)]

use crate::shell::clock::sleep_until_ns;
use crate::shell::mapped::{Mappable, Mapped};
use crate::shell::page::monotonic_ns;
use crate::shell::realtime::{self, CpuChoice, Request};
use crate::shell::timing::{Histogram, LateWakeUp, Timing};
use crate::shell::transport::Domain;
use rustix::thread::futex;
use rustix::time::Timespec;
use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// Hops from the steps to the command.
pub const HOPS: usize = 3;
const TICK_NS: u64 = 1_000_000;
/// When in the tick the chain begins, and when the loop wakes: clear of the robot's work and of each other.
const CHAIN_PHASE_NS: u64 = 250_000;
const LOOP_PHASE_NS: u64 = 500_000;
/// Longest sleep without a look at whether it is over.
const LOOK: Duration = Duration::from_millis(50);

/// How far the measurement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// All run, nothing is noted.
    WarmUp = 0,
    /// What happens is noted.
    Measuring = 1,
    /// All leave.
    Over = 2,
}

/// Hops of one kind, and all of them together.
#[repr(C)]
pub struct Chain {
    /// One by one.
    pub hops: [Histogram; HOPS],
    /// From the first to the last.
    pub all: Histogram,
}

#[repr(C, align(128))]
struct Bell {
    word: AtomicU32,
    sent_ns: AtomicU64,
}

/// What these processes share; all zero is valid and empty.
#[repr(C)]
pub struct BarePage {
    magic: AtomicU64,
    stage: AtomicU32,
    ready: AtomicU32,
    bells: [Bell; HOPS + 1],
    /// Lateness of the loop, and its pauses: their `tick` is the millisecond of CLOCK_MONOTONIC.
    pub timing: Timing,
    /// By futex.
    pub futex: Chain,
    /// By iceoryx2.
    pub iceoryx2: Chain,
    observed: AtomicU32,
    /// Times an observer joined.
    joins: AtomicU64,
    /// Messages observers have read.
    messages: AtomicU64,
}

// SAFETY: repr(C) and atomics only.
unsafe impl Mappable for BarePage {
    const FD: &'static str = "HILARE_BARE_FD";
    const MAGIC: u64 = 0x6869_6c61_7265_0102;
    const STARTED_BY: &'static str = "it is started by hilare latency";

    fn magic(&self) -> &AtomicU64 {
        &self.magic
    }
}

impl BarePage {
    /// Moves all to a stage.
    pub fn set_stage(&self, stage: Stage) {
        self.stage.store(stage as u32, Ordering::SeqCst);
    }

    /// From now on observers come and go, or not.
    pub fn set_observed(&self, observed: bool) {
        self.observed.store(u32::from(observed), Ordering::SeqCst);
    }

    /// Whether observers come and go.
    pub(super) fn observed(&self) -> bool {
        self.observed.load(Ordering::SeqCst) != 0
    }

    /// An observer has joined, read as many messages, and left.
    pub(super) fn note_observer(&self, messages: u64) {
        self.joins.fetch_add(1, Ordering::Relaxed);
        self.messages.fetch_add(messages, Ordering::Relaxed);
    }

    /// How often observers joined, and what they read in all.
    pub fn observers(&self) -> (u64, u64) {
        (self.joins.load(Ordering::Relaxed), self.messages.load(Ordering::Relaxed))
    }

    /// How far the measurement is.
    pub(super) fn stage(&self) -> Stage {
        match self.stage.load(Ordering::SeqCst) {
            0 => Stage::WarmUp,
            1 => Stage::Measuring,
            _ => Stage::Over,
        }
    }

    /// One more process is at work.
    pub(super) fn note_ready(&self) {
        self.ready.fetch_add(1, Ordering::SeqCst);
    }

    /// Processes that are at work.
    pub fn ready(&self) -> usize {
        self.ready.load(Ordering::SeqCst) as usize
    }

    fn record(&self, histogram: &Histogram, since_ns: u64, now_ns: u64) {
        if self.stage() == Stage::Measuring {
            histogram.record(now_ns.saturating_sub(since_ns));
        }
    }
}

/// One of these processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The loop.
    Loop,
    /// Whoever begins a chain.
    Driver,
    /// Whoever answers, 1 to [`HOPS`].
    Responder(usize),
    /// Whoever comes, looks at what the relay repeats, and goes.
    Observer,
    /// Whoever comes to the page, misbehaves, and goes.
    Visitor,
}

impl Part {
    /// Those there always are, in the order they start in.
    pub const BARE: [Self; 5] =
        [Self::Responder(3), Self::Responder(2), Self::Responder(1), Self::Driver, Self::Loop];

    /// From its name on the command line.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::BARE.into_iter().chain([Self::Observer, Self::Visitor]).find(|part| part.name() == name)
    }

    /// Name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Loop => "loop",
            Self::Driver => "driver",
            Self::Responder(1) => "responder-1",
            Self::Responder(2) => "responder-2",
            Self::Responder(_) => "responder-3",
            Self::Observer => "observer",
            Self::Visitor => "visitor",
        }
    }
}

/// Where a part runs.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Processor, as a key of a system file.
    pub cpu: i64,
    /// SCHED_FIFO priority; 0 is not real-time.
    pub priority: u64,
    /// Phase of the robot's tick, ns.
    pub phase_ns: u64,
}

/// Runs one of these processes until the measurement is over. `runtime_dir` is the robot's.
pub fn run(part: Part, place: Place, runtime_dir: &Path) -> Result<(), String> {
    let page: Mapped<BarePage> = Mapped::inherit().map_err(|e| e.to_string())?;
    if part == Part::Observer {
        return super::observers::come_and_go(&page, runtime_dir);
    }
    if part == Part::Visitor {
        return super::visitors::come_and_go(&page, runtime_dir);
    }
    let ports = match part {
        Part::Loop => None,
        _ => Some(Domain::join(runtime_dir, part.name())?),
    };
    let output = |n: usize| ports.as_ref().filter(|_| n < HOPS).map(|ports| ports.bare_output(HOP_NAMES[n]));
    let number = if let Part::Responder(number) = part { number } else { 0 };
    let output = output(number).transpose()?;
    let input = ports.as_ref().filter(|_| number > 0).map(|ports| ports.bare_input(HOP_NAMES[number - 1]));
    let input = input.transpose()?;
    realtime::apply(Request {
        priority: place.priority,
        cpu: CpuChoice::from_key(place.cpu),
        lock_memory: place.priority > 0,
    });
    page.note_ready();
    match (part, input) {
        (Part::Loop, _) => run_loop(&page, place.phase_ns + LOOP_PHASE_NS),
        (_, None) => {
            let mut turn = 0u64;
            every_tick(&page, place.phase_ns + CHAIN_PHASE_NS, |_, _| {
                match &output {
                    Some(output) if turn % 2 == 1 => pass_on(&page, 0, || output.send()),
                    _ => pass_on(&page, 0, || ring(&page, 1)),
                }
                turn += 1;
            });
        }
        (_, Some(input)) => {
            let mut seen = 0;
            while page.stage() != Stage::Over {
                if await_ring(&page, number, &mut seen) {
                    answer(&page, &page.futex, number, || ring(&page, number + 1));
                }
                while page.stage() != Stage::Over && !input.wait(LOOK) {}
                answer(&page, &page.iceoryx2, number, || output.iter().for_each(|output| output.send()));
            }
        }
    }
    Ok(())
}

const HOP_NAMES: [&str; HOPS] = ["1", "2", "3"];

/// Wakes at a phase of every tick and acts; told when it should have woken, and when it did.
fn every_tick(page: &BarePage, phase_ns: u64, mut act: impl FnMut(u64, u64)) {
    let phase_ns = phase_ns % TICK_NS;
    let mut deadline_ns = monotonic_ns() / TICK_NS * TICK_NS + phase_ns + TICK_NS;
    while page.stage() != Stage::Over {
        sleep_until_ns(deadline_ns);
        let woke_ns = monotonic_ns();
        act(deadline_ns, woke_ns);
        // As the robot's clock does: what was lost is not hurried after.
        deadline_ns += (woke_ns.saturating_sub(deadline_ns) / TICK_NS + 1) * TICK_NS;
    }
}

fn run_loop(page: &BarePage, phase_ns: u64) {
    every_tick(page, phase_ns, |deadline_ns, woke_ns| {
        page.record(&page.timing.taken, deadline_ns, woke_ns);
        let late_ns = woke_ns.saturating_sub(deadline_ns);
        if late_ns >= TICK_NS {
            let wake_up = LateWakeUp { tick: woke_ns / TICK_NS, late_ns, own_work: false };
            page.timing.woke_late(wake_up);
        }
    });
}

/// Notes when a hop begins, and begins it.
fn pass_on(page: &BarePage, number: usize, send: impl FnOnce()) {
    page.bells[number].sent_ns.store(monotonic_ns(), Ordering::Relaxed);
    send();
}

/// Notes how long the hop took, and goes on.
fn answer(page: &BarePage, chain: &Chain, number: usize, send: impl FnOnce()) {
    let now_ns = monotonic_ns();
    page.record(&chain.hops[number - 1], page.bells[number - 1].sent_ns.load(Ordering::Relaxed), now_ns);
    if number == HOPS {
        page.record(&chain.all, page.bells[0].sent_ns.load(Ordering::Relaxed), now_ns);
    } else {
        pass_on(page, number, send);
    }
}

fn ring(page: &BarePage, number: usize) {
    let word = &page.bells[number].word;
    word.fetch_add(1, Ordering::SeqCst);
    let _ = futex::wake(word, futex::Flags::empty(), 1);
}

/// True when it rang; false when the measurement is over.
fn await_ring(page: &BarePage, number: usize, seen: &mut u32) -> bool {
    let word = &page.bells[number].word;
    let limit = Timespec { tv_sec: 0, tv_nsec: i64::from(LOOK.subsec_nanos()) };
    loop {
        let now = word.load(Ordering::SeqCst);
        if now != *seen {
            *seen = now;
            return true;
        }
        if page.stage() == Stage::Over {
            return false;
        }
        let _ = futex::wait(word, futex::Flags::empty(), now, Some(&limit));
    }
}
