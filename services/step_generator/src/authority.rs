//! Which command acts on a tick.
//!
//! Authority is a pair (source, epoch). A command is computed from the pose of tick k and acts from
//! k + period on (logical execution time): it waits here until its tick. If none is there, the last
//! one is held for `hold_cycles` cycles, then the robot ramps to zero. Nothing here needs another
//! process to be alive.

use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Command, Drive, Mode, Steps};
use hilare_interfaces::param_group;

/// Commands that can wait for their tick.
const PENDING: usize = 4;

param_group! {
    /// Control period and what to do without commands, launch or time.
    GateParams {
        /// Control period; also the paper's T_lag: a command acts one period after its pose.
        period_ticks: u64 = 5, "ticks", 1, 1000;
        /// Control cycles the last command is held when none comes.
        hold_cycles: u64 = 2, "", 0, 100;
        /// Ticks without a sign of launch after which the robot stops; 0 never (lockstep).
        lease_ticks: u64 = 75, "ticks", 0, 10000;
        /// A single pause of this many ticks stops the robot; 0 never.
        pause_stop_ticks: u64 = 100, "ticks", 0, 100000;
    }
}

/// What acts on a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// The commanded twist; meaningful for `Drive::Command` and `Drive::Hold`.
    pub twist: BodyTwist,
    /// Why.
    pub drive: Drive,
}

/// Takes commands in and decides, tick by tick, which one acts.
#[derive(Clone, Debug)]
pub struct Gate {
    params: GateParams,
    authority: Authority,
    mode: Mode,
    pending: [Option<Command>; PENDING],
    acting: Option<Command>,
    last_seq: u64,
    /// First cycle start from which a command is due.
    due_from: Tick,
    /// Start of the present control cycle.
    cycle_start: Tick,
    /// Cycles in a row without a command of their own, the present one included.
    misses: u64,
    lease_age: u64,
    pause_stop: bool,
    late: u64,
    rejected: u64,
    without: u64,
}

impl Gate {
    /// Disarmed, nobody in charge.
    pub fn new(params: GateParams) -> Self {
        Self {
            params,
            authority: Authority::ZERO,
            mode: Mode::Disarmed,
            pending: [None; PENDING],
            acting: None,
            last_seq: 0,
            due_from: Tick::MAX,
            cycle_start: 0,
            misses: 0,
            lease_age: 0,
            pause_stop: false,
            late: 0,
            rejected: 0,
            without: 0,
        }
    }

    /// Takes an authority message: mode, source, epoch; renews the lease.
    ///
    /// An older `seq` is ignored, an unknown mode is a stop. Emergency stop is left only through
    /// `Disarmed` (the operator's reset), whatever else is asked for.
    pub fn set_authority(&mut self, tick: Tick, authority: &Authority) {
        if authority.seq <= self.authority.seq {
            return;
        }
        self.lease_age = 0;
        let wanted = Mode::from_code(authority.mode).unwrap_or(Mode::Stop);
        let mode = if self.mode == Mode::EStop && wanted != Mode::Disarmed { Mode::EStop } else { wanted };
        let handed_over =
            (authority.source, authority.epoch) != (self.authority.source, self.authority.epoch);
        if handed_over {
            self.pending = [None; PENDING];
            self.last_seq = 0;
        }
        if mode == Mode::Armed && (self.mode != Mode::Armed || handed_over) {
            // The first pose the source can answer is that of the next cycle.
            let period = self.params.period_ticks;
            self.due_from = tick.div_ceil(period) * period + period;
        }
        if mode != self.mode {
            self.acting = None;
            self.misses = 0;
            self.pause_stop = false;
        }
        self.mode = mode;
        self.authority = *authority;
    }

    /// Takes a command in, or refuses and counts it.
    pub fn offer(&mut self, tick: Tick, command: &Command) {
        if !self.acceptable(tick, command) {
            self.rejected += 1;
            return;
        }
        self.last_seq = command.seq;
        match self.pending.iter_mut().find(|slot| slot.is_none()) {
            Some(slot) => *slot = Some(*command),
            None => self.rejected += 1,
        }
    }

    fn acceptable(&self, tick: Tick, command: &Command) -> bool {
        let period = self.params.period_ticks;
        let in_charge = command.source == self.authority.source
            && command.epoch == self.authority.epoch
            && command.source != 0;
        let fresh = command.seq > self.last_seq;
        let newer = self.acting.is_none_or(|acting| command.effective_tick > acting.effective_tick);
        let on_the_grid = command.effective_tick.is_multiple_of(period)
            && command.effective_tick == command.pose_tick.saturating_add(period)
            && command.effective_tick <= tick.saturating_add(2 * period);
        in_charge && fresh && newer && on_the_grid && command.twist().is_some()
    }

    /// A pause of `ticks` happened; a long one stops the robot until it is armed again.
    pub fn note_pause(&mut self, ticks: u64) {
        if self.params.pause_stop_ticks != 0 && ticks >= self.params.pause_stop_ticks {
            self.pause_stop = true;
        }
    }

    /// True if tick `tick` opens a cycle for which a command is due and has not come.
    pub fn awaits_command(&self, tick: Tick) -> bool {
        self.mode == Mode::Armed
            && tick.is_multiple_of(self.params.period_ticks)
            && tick >= self.due_from
            && !self.pending.iter().flatten().any(|command| command.effective_tick == tick)
    }

    /// Decides what acts on the tick that follows `tick` executed ticks.
    pub fn decide(&mut self, tick: Tick) -> Decision {
        self.lease_age += 1;
        if tick.is_multiple_of(self.params.period_ticks) {
            self.open_cycle(tick);
        }
        self.take_due(tick);
        let drive = self.drive(tick);
        let twist = self.acting.and_then(|command| command.twist()).unwrap_or(BodyTwist::ZERO);
        Decision { twist, drive }
    }

    /// A new cycle begins: it has missed its command until the command is found.
    fn open_cycle(&mut self, tick: Tick) {
        let due = self.mode == Mode::Armed && self.cycle_start >= self.due_from;
        if due && (self.misses > 0 || self.held_back()) {
            self.without += 1;
        }
        self.cycle_start = tick;
        if self.mode == Mode::Armed && tick >= self.due_from {
            self.misses += 1;
        }
    }

    /// Moves the newest command whose time has come from waiting to acting.
    fn take_due(&mut self, tick: Tick) {
        for slot in &mut self.pending {
            let Some(command) = slot.filter(|command| command.effective_tick <= tick) else { continue };
            *slot = None;
            if self.acting.is_none_or(|acting| command.effective_tick > acting.effective_tick) {
                self.acting = Some(command);
                if command.effective_tick < tick && self.mode == Mode::Armed {
                    self.late += 1;
                }
                if command.effective_tick >= self.cycle_start {
                    self.misses = 0;
                }
            }
        }
    }

    fn lease_lost(&self) -> bool {
        self.params.lease_ticks != 0 && self.lease_age > self.params.lease_ticks
    }

    /// Commands come and do not act.
    fn held_back(&self) -> bool {
        self.lease_lost() || self.pause_stop
    }

    fn drive(&self, tick: Tick) -> Drive {
        match self.mode {
            Mode::EStop => Drive::EStop,
            Mode::Disarmed => Drive::Disarmed,
            Mode::Stop => Drive::Stop,
            Mode::Armed if self.lease_lost() => Drive::LeaseLost,
            Mode::Armed if self.pause_stop => Drive::PauseStop,
            Mode::Armed if self.acting.is_none() => Drive::Ramp,
            Mode::Armed if self.misses == 0 || tick < self.due_from => Drive::Command,
            Mode::Armed if self.misses <= self.params.hold_cycles => Drive::Hold,
            Mode::Armed => Drive::Ramp,
        }
    }

    /// Writes authority and counters into the state message.
    pub fn report(&self, state: &mut Steps) {
        state.source = if self.acting.is_some() { self.authority.source } else { 0 };
        state.epoch = self.authority.epoch;
        state.commands_late = self.late;
        state.commands_rejected = self.rejected;
        state.cycles_without_command = self.without;
    }
}
