//! The shell: everything a block needs around it to be a process, written once.
//!
//! * [`transport`]: ports of the wire table over iceoryx2 (the only place that uses it),
//! * [`page`], [`mapped`]: doorbells and progress marks, a page of shared memory beside the wires,
//! * [`checkpoint`], [`told`]: what a box remembers, and told last, for its successor,
//! * [`standing`]: where each box stands, for a recording begun in mid-drive,
//! * [`change`], [`renewal`]: other parameters while a box works,
//! * [`timing`]: what each process measures of itself,
//! * [`realtime`]: what is asked of the kernel, and what it granted,
//! * [`worker`]: a process from start to end: handshake, heartbeat, loop, shutdown,
//! * [`build`]: boxes from a system file,
//! * [`boxes`], [`planning`], [`observer`], [`pairing`]: which messages each box is stepped with,
//! * [`relay`]: the wires repeated for those who only look,
//! * [`clock`]: the step generator's process, which is the clock: `real` and `lockstep`,
//! * [`in_process`]: all boxes in one thread,
//! * [`fast`]: thousands of such runs at once, for tuning.

pub mod boxes;
pub mod build;
pub mod change;
pub mod checkpoint;
pub mod clock;
pub mod fast;
pub mod in_process;
pub mod journal;
pub mod mapped;
pub mod observer;
pub mod page;
pub mod pairing;
pub mod planning;
pub mod realtime;
pub mod relay;
pub mod renewal;
pub mod standing;
pub mod timing;
pub mod told;
pub mod transport;
pub mod worker;

use std::fmt;
use std::str::FromStr;

/// What drives the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockKind {
    /// 1 kHz on CLOCK_MONOTONIC.
    Real,
    /// The same processes in virtual time, as fast as they go.
    Lockstep,
    /// All boxes in one thread, virtual time.
    InProcess,
}

impl ClockKind {
    /// Name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Real => "real",
            Self::Lockstep => "lockstep",
            Self::InProcess => "in-process",
        }
    }
}

impl fmt::Display for ClockKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ClockKind {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        [Self::Real, Self::Lockstep, Self::InProcess]
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| format!("unknown clock {name:?}; one of real, lockstep, in-process"))
    }
}
