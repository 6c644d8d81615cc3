//! A driver that has been looked at with an oscilloscope: it sees the levels of DIR and the counts of every tick, and
//! knows the times that were asked for in nanoseconds. It has no part of the step generator in it.

use std::fmt;

/// A tick, ns.
const TICK_NS: u64 = 1_000_000;

/// What a driver asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// STEP active, at least, ns.
    pub length_ns: u64,
    /// STEP idle between two pulses, at least, ns.
    pub space_ns: u64,
    /// DIR before a pulse, at least, ns.
    pub setup_ns: u64,
    /// DIR after a pulse, at least, ns.
    pub hold_ns: u64,
    /// By how much ticks may come closer, ns.
    pub jitter_ns: u64,
    /// From a pulse to the next by the highest rate, ns; 0 for none.
    pub period_ns: u64,
}

/// What a driver would have done wrong by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Violation {
    /// A tick that does not follow the last one.
    Tick,
    /// The last message told again, but another one.
    Repeat,
    /// More than one pulse in a tick.
    Burst,
    /// A pulse too soon after the one before for its length, the space, or the rate.
    TooSoon,
    /// A pulse too soon after DIR has changed.
    Setup,
    /// DIR changed too soon after a pulse.
    Hold,
    /// A level that is neither high nor low.
    Level,
    /// A count that goes the other way than DIR says.
    WrongWay,
    /// A pulse of a robot that is to stand.
    Standing,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

/// What is on a wheel's wires in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Line {
    /// Cumulative count.
    pub count: i64,
    /// Level of DIR.
    pub level: u64,
}

/// One wheel.
#[derive(Clone, Debug)]
pub struct Judge {
    times: Times,
    /// Level of DIR at which counts go down.
    reverse_level: u64,
    tick: u64,
    line: Line,
    pulse: Option<u64>,
    turn: Option<u64>,
}

impl Judge {
    /// Of the message before the first tick, which sets DIR.
    pub fn new(times: Times, inverted: bool, first: Line) -> Self {
        Self { times, reverse_level: u64::from(inverted), tick: 0, line: first, pulse: None, turn: Some(0) }
    }

    /// True if `ticks` ticks last for `ns` at the drive, however they come.
    fn lasts(&self, ticks: u64, ns: u64) -> bool {
        ticks * TICK_NS >= ns + self.times.jitter_ns
    }

    /// The next message; the robot is to stand or not.
    pub fn sees(&mut self, tick: u64, line: Line, standing: bool) -> Result<(), Violation> {
        let wrong = |wrong: bool, what: Violation| if wrong { Err(what) } else { Ok(()) };
        wrong(tick != self.tick + 1, Violation::Tick)?;
        self.tick = tick;
        wrong(line.level > 1, Violation::Level)?;
        let times = self.times;
        if line.level != self.line.level {
            let after = self.pulse.map(|pulse| tick - pulse);
            let held = after.is_none_or(|ticks| self.lasts(ticks, times.length_ns + times.hold_ns));
            wrong(!held, Violation::Hold)?;
            self.turn = Some(tick);
        }
        if line.count != self.line.count {
            wrong(standing, Violation::Standing)?;
            wrong(line.count.abs_diff(self.line.count) != 1, Violation::Burst)?;
            let forward = line.level != self.reverse_level;
            wrong((line.count > self.line.count) != forward, Violation::WrongWay)?;
            if let Some(ticks) = self.pulse.map(|pulse| tick - pulse) {
                let apart = self.lasts(ticks, times.length_ns + times.space_ns);
                wrong(!apart || ticks * TICK_NS < times.period_ns, Violation::TooSoon)?;
            }
            let stood = self.turn.map(|turn| tick - turn);
            let set_up = times.setup_ns == 0 || stood.is_none_or(|ticks| self.lasts(ticks, times.setup_ns));
            wrong(!set_up, Violation::Setup)?;
            self.pulse = Some(tick);
        }
        self.line = line;
        Ok(())
    }

    /// The message that a successor begins with: what its predecessor told last.
    pub fn sees_again(&mut self, tick: u64, line: Line) -> Result<(), Violation> {
        if (tick, line) == (self.tick, self.line) { Ok(()) } else { Err(Violation::Repeat) }
    }
}
