//! Which command acts on a tick.
//!
//! A command is computed from the pose of tick k and acts from k + period on (logical execution time):
//! it waits here until its tick. At the tick that opens a control cycle there is
//!
//! ```text
//! a command of the controller in charge      ──▶ it acts
//! else one of the standby for the same tick  ──▶ it acts: borrowed; several cycles in a row: it takes charge
//! else nothing                               ──▶ the last one is held for `hold_cycles`, then a ramp to zero
//! ```
//!
//! Nothing here needs another process to be alive. Authority is a pair (source, epoch) under a term:
//! launch and this box both may put another controller in charge, each with a higher term, and the
//! higher term wins; whoever lost charge is not heard any more.

use crate::COUNTED_MAX;
use crate::candidate::{Candidate, Pair, visit_command};
use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Command, Drive, Mode, Refusal, Steps};
use hilare_interfaces::param_group;
use hilare_interfaces::state::{StateWords, Stateful};

param_group! {
    /// Control period and what to do without commands, launch or time.
    GateParams {
        /// Control period; also the paper's T_lag: a command acts one period after its pose.
        period_ticks: u64 = 5, "ticks", 1, 1000;
        /// Control cycles the last command is held when none comes.
        hold_cycles: u64 = 2, "", 0, 100;
        /// Control cycles in a row driven by the standby's command after which it takes charge.
        promote_after: u64 = 2, "", 1, 100;
        /// Ticks without a sign of launch after which the robot stops; 0 never (lockstep).
        lease_ticks: u64 = 75, "ticks", 0, 10000;
        /// A single pause of this many ticks stops the robot; 0 never.
        pause_stop_ticks: u64 = 100, "ticks", 0, 100000;
    }
}

/// The command that acts.
#[derive(Clone, Copy, Debug)]
struct Acting {
    command: Command,
    twist: BodyTwist,
    beside: Beside,
}

/// What acts on a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// The commanded twist; meaningful for `Drive::Command` and `Drive::Hold`.
    pub twist: BodyTwist,
    /// Why.
    pub drive: Drive,
    /// Whose command it is; (0, 0) for none.
    pub pair: Pair,
}

/// What else is known of the cycle whose command acts: where another controller's begins to, it begins there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside {
    /// What the same controller commanded for the cycle before, if it did.
    pub before: Option<BodyTwist>,
    /// What the controller whose command acted last commands for the same cycle, if it does.
    pub old: Option<BodyTwist>,
}

/// Takes commands in and decides, tick by tick, which one acts.
#[derive(Clone, Debug)]
pub struct Gate {
    params: GateParams,
    authority: Authority,
    mode: Mode,
    term: u64,
    in_charge: Candidate,
    standby: Candidate,
    trial: Candidate,
    /// Who launch has put out of charge last: what it still says is no fault of anybody.
    dismissed: Pair,
    acting: Option<Acting>,
    /// First cycle start from which a command is due.
    due_from: Tick,
    /// Start of the present control cycle.
    cycle_start: Tick,
    /// Cycles in a row without a command of their own, the present one included.
    misses: u64,
    /// Cycles in a row the standby's command acted.
    borrowed_row: u64,
    lease_age: u64,
    pause_stop: bool,
    late: u64,
    rejected: u64,
    refusal: Refusal,
    refused_source: u64,
    without: u64,
    borrowed: u64,
    promotions: u64,
}

impl Gate {
    /// Disarmed, nobody in charge.
    pub fn new(params: GateParams) -> Self {
        Self {
            params,
            authority: Authority::ZERO,
            mode: Mode::Disarmed,
            term: 0,
            in_charge: Candidate::NOBODY,
            standby: Candidate::NOBODY,
            trial: Candidate::NOBODY,
            dismissed: (0, 0),
            acting: None,
            due_from: Tick::MAX,
            cycle_start: 0,
            misses: 0,
            borrowed_row: 0,
            lease_age: 0,
            pause_stop: false,
            late: 0,
            rejected: 0,
            refusal: Refusal::None,
            refused_source: 0,
            without: 0,
            borrowed: 0,
            promotions: 0,
        }
    }

    /// Takes an authority message: mode, who is in charge, standby and on trial; renews the lease.
    ///
    /// An older `seq` is ignored, an unknown mode is a stop. Emergency stop is left only through
    /// `Disarmed` (the operator's reset), whatever else is asked for. Of a lower term only the mode
    /// counts: launch does not know yet who took charge.
    pub fn set_authority(&mut self, tick: Tick, authority: &Authority) {
        if authority.seq <= self.authority.seq {
            return;
        }
        self.lease_age = 0;
        // A term that nobody can have counted to is none: the next one could not be counted.
        if (self.term..COUNTED_MAX).contains(&authority.term) {
            self.put_in_charge(authority);
        }
        let wanted = Mode::from_code(authority.mode).unwrap_or(Mode::Stop);
        let mode = if self.mode == Mode::EStop && wanted != Mode::Disarmed { Mode::EStop } else { wanted };
        if mode == Mode::Armed && self.mode != Mode::Armed {
            // The first pose that can be answered is that of the next cycle.
            let period = self.params.period_ticks;
            self.due_from = tick.div_ceil(period).saturating_mul(period).saturating_add(period);
        }
        if mode != self.mode {
            self.acting = None;
            self.misses = 0;
            self.borrowed_row = 0;
            self.pause_stop = false;
        }
        self.mode = mode;
        self.authority = *authority;
    }

    /// Whoever is known already keeps the commands that wait, in whatever place.
    fn put_in_charge(&mut self, authority: &Authority) {
        let known = [self.in_charge, self.standby, self.trial];
        let candidate = |pair: Pair| match known.iter().find(|known| known.pair() == pair) {
            Some(known) if pair.0 != 0 => *known,
            _ => Candidate::new(if pair.0 == 0 { (0, 0) } else { pair }),
        };
        let in_charge = (authority.source, authority.epoch);
        if authority.term > self.term || self.in_charge.pair().0 == 0 {
            self.term = authority.term;
            self.borrowed_row = 0;
            self.dismissed = self.in_charge.pair();
            self.in_charge = candidate(in_charge);
        } else if in_charge != self.in_charge.pair() {
            // Another one under the same term: launch's and this box's decision crossed. Ours came first.
            return;
        }
        self.standby = candidate((authority.standby_source, authority.standby_epoch));
        self.trial = candidate((authority.trial_source, authority.trial_epoch));
    }

    /// Takes a command in, or refuses and counts it.
    pub fn offer(&mut self, tick: Tick, command: &Command) {
        let writer =
            [&mut self.in_charge, &mut self.standby, &mut self.trial].into_iter().find(|c| c.wrote(command));
        let taken = match writer {
            Some(writer) => {
                sound(tick, self.params.period_ticks, command).and_then(|()| writer.keep(command))
            }
            None if (command.source, command.epoch) == self.dismissed => Ok(()),
            None => Err(Refusal::Stranger),
        };
        if let Err(why) = taken {
            self.rejected += 1;
            (self.refusal, self.refused_source) = (why, command.source);
        }
    }

    /// A pause of `ticks` happened; a long one stops the robot until it is armed again.
    pub fn note_pause(&mut self, ticks: u64) {
        if self.params.pause_stop_ticks != 0 && ticks >= self.params.pause_stop_ticks {
            self.pause_stop = true;
        }
    }

    /// True if tick `tick` opens a cycle for which a command is due and has not come: of the controller
    /// in charge, or of another that has begun to answer.
    pub fn awaits_command(&self, tick: Tick) -> bool {
        let others = [&self.standby, &self.trial];
        self.mode == Mode::Armed
            && tick.is_multiple_of(self.params.period_ticks)
            && tick >= self.due_from
            && (self.in_charge.owes(tick) || others.iter().any(|other| other.is_heard() && other.owes(tick)))
    }

    /// Decides what acts on the tick that follows `tick` executed ticks.
    pub fn decide(&mut self, tick: Tick) -> Decision {
        self.lease_age += 1;
        if tick.is_multiple_of(self.params.period_ticks) {
            self.close_cycle();
            self.open_cycle(tick);
        } else {
            self.take_late(tick);
        }
        let drive = self.drive(tick);
        match &self.acting {
            Some(Acting { command, twist, .. }) => {
                Decision { twist: *twist, drive, pair: (command.source, command.epoch) }
            }
            None => Decision { twist: BodyTwist::ZERO, drive, pair: (0, 0) },
        }
    }

    /// What is known beside the command that acts.
    pub fn beside(&self) -> Beside {
        self.acting.as_ref().map_or_else(Beside::default, |acting| acting.beside)
    }

    fn close_cycle(&mut self) {
        let due = self.mode == Mode::Armed && self.cycle_start >= self.due_from;
        if due && (self.misses > 0 || self.held_back()) {
            self.without += 1;
        }
    }

    /// A new cycle begins: whose command is there for it?
    fn open_cycle(&mut self, tick: Tick) {
        let period = self.params.period_ticks;
        self.cycle_start = tick;
        let own = self.in_charge.open_cycle(tick, period);
        let spare = self.standby.open_cycle(tick, period);
        self.trial.open_cycle(tick, period);
        let due = self.mode == Mode::Armed && tick >= self.due_from;
        let own_is_late = own.is_some_and(|own| own.effective_tick < tick);
        if own_is_late && self.mode == Mode::Armed {
            self.late += 1;
        }
        if own.is_some() && !own_is_late {
            self.act(own, self.in_charge.before(), spare);
            (self.misses, self.borrowed_row) = (0, 0);
        } else if due && spare.is_some_and(|spare| spare.effective_tick == tick) {
            self.act(spare, self.standby.before(), own);
            self.misses = 0;
            self.borrowed += 1;
            self.borrowed_row += 1;
            if self.borrowed_row >= self.params.promote_after {
                self.promote();
            }
        } else {
            self.act(own, self.in_charge.before(), spare);
            self.misses += u64::from(due);
        }
    }

    /// Between two cycle starts: what comes now is late, and acts if its cycle has nothing better.
    fn take_late(&mut self, tick: Tick) {
        let period = self.params.period_ticks;
        let own = self.in_charge.due(tick, period);
        let spare = self.standby.due(tick, period);
        self.trial.due(tick, period);
        if own.is_none() && spare.is_none() {
            return;
        }
        let armed = self.mode == Mode::Armed;
        self.late += u64::from(armed && own.is_some());
        if armed && self.misses == 0 && tick >= self.due_from {
            return;
        }
        let of_this_cycle = |command: &Command| command.effective_tick == self.cycle_start;
        let (own_is_for_now, spare_is_for_now) =
            (own.as_ref().is_some_and(of_this_cycle), spare.as_ref().is_some_and(of_this_cycle));
        if armed && !own_is_for_now && spare_is_for_now {
            self.late += 1;
            self.borrowed += 1;
            self.act(spare, self.standby.before(), own);
        } else {
            self.act(own, self.in_charge.before(), spare);
        }
        if own_is_for_now || spare_is_for_now {
            self.misses = 0;
        }
    }

    /// Lets a command act, unless a newer one does; `other` is what the other one of controller in charge
    /// and standby has come up with.
    fn act(&mut self, command: Option<Command>, before: Option<Command>, other: Option<Command>) {
        let Some(command) = command else { return };
        let last = self.acting.as_ref().map(|acting| &acting.command);
        if last.is_some_and(|last| command.effective_tick <= last.effective_tick) {
            return;
        }
        let acted_last = |other: &Command| {
            other.effective_tick == command.effective_tick
                && last.is_some_and(|last| (last.source, last.epoch) == (other.source, other.epoch))
        };
        let old = other.filter(acted_last).and_then(|other| other.twist());
        if let Some(twist) = command.twist() {
            let before = before.and_then(|before| before.twist());
            self.acting = Some(Acting { command, twist, beside: Beside { before, old } });
        }
    }

    /// The standby takes charge; who was in charge is not heard any more.
    fn promote(&mut self) {
        self.in_charge = core::mem::replace(&mut self.standby, Candidate::NOBODY);
        self.term += 1;
        self.promotions += 1;
        self.borrowed_row = 0;
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
        state.source = self.acting.map_or(0, |acting| acting.command.source);
        state.term = self.term;
        (state.in_charge, state.epoch) = self.in_charge.pair();
        state.standby_answers = self.standby.answers();
        state.trial_answers = self.trial.answers();
        state.commands_late = self.late;
        state.commands_rejected = self.rejected;
        (state.refusal, state.refused_source) = (self.refusal.code(), self.refused_source);
        state.cycles_without_command = self.without;
        state.commands_borrowed = self.borrowed;
        state.promotions = self.promotions;
    }
}

/// Counters and the term; who is in charge and the mode come from launch. Why the last command was refused is
/// of this process alone.
impl Stateful for Gate {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        let counters = [
            &mut self.term,
            &mut self.late,
            &mut self.rejected,
            &mut self.without,
            &mut self.borrowed,
            &mut self.promotions,
        ];
        counters.into_iter().for_each(|counter| words.count(counter, COUNTED_MAX));
    }
}

impl Gate {
    /// What drives, beside the state that a successor takes on.
    pub(crate) fn visit_drive(&mut self, words: &mut StateWords<'_>) {
        words.message(&mut self.authority);
        words.code(&mut self.mode, Mode::code, Mode::from_code);
        let candidates = [&mut self.in_charge, &mut self.standby, &mut self.trial];
        candidates.into_iter().for_each(|candidate| candidate.visit_state(words));
        let plain = [
            &mut self.dismissed.0,
            &mut self.dismissed.1,
            &mut self.due_from,
            &mut self.cycle_start,
            &mut self.refused_source,
        ];
        plain.into_iter().for_each(|word| words.word(word));
        words.option(&mut self.acting, Acting::BLANK, Acting::visit_state);
        let rows = [&mut self.misses, &mut self.borrowed_row, &mut self.lease_age];
        rows.into_iter().for_each(|count| words.count(count, COUNTED_MAX));
        words.flag(&mut self.pause_stop);
        words.code(&mut self.refusal, Refusal::code, Refusal::from_code);
    }
}

impl Acting {
    const BLANK: Self =
        Self { command: Command::ZERO, twist: BodyTwist::ZERO, beside: Beside { before: None, old: None } };
}

impl Stateful for Acting {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        visit_command(&mut self.command, words);
        words.twist(&mut self.twist);
        for beside in [&mut self.beside.before, &mut self.beside.old] {
            words.option(beside, BodyTwist::ZERO, |twist, words| words.twist(twist));
        }
    }
}

/// A command is finite, and for the beginning of a control cycle that is at most two periods away, computed
/// one period before it.
fn sound(tick: Tick, period: u64, command: &Command) -> Result<(), Refusal> {
    let refused = [
        (command.twist().is_none(), Refusal::NotFinite),
        (!command.effective_tick.is_multiple_of(period), Refusal::OffGrid),
        (command.effective_tick != command.pose_tick.saturating_add(period), Refusal::NotOnePeriod),
        (command.effective_tick > tick.saturating_add(2 * period), Refusal::TooFarAhead),
    ];
    refused.into_iter().find(|(is_so, _)| *is_so).map_or(Ok(()), |(_, why)| Err(why))
}
