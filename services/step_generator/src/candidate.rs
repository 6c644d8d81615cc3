//! A controller whose commands are taken in: in charge, standby or on trial.

use crate::COUNTED_MAX;
use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Command, Refusal};
use hilare_interfaces::state::{StateWords, Stateful};

/// Commands of one controller that can wait for their tick.
const PENDING: usize = 4;

/// Who a controller process is: its source number (0: nobody) and its epoch.
pub type Pair = (u64, u64);

/// Commands of one controller, and how well it keeps time.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    pair: Pair,
    last_seq: u64,
    pending: [Option<Command>; PENDING],
    /// Effective tick of the earliest command that waits; most ticks have nothing to do.
    next_due: Tick,
    /// The command whose time came last.
    taken: Option<Command>,
    /// The one before, if it was that of the cycle before.
    before: Option<Command>,
    answers: u64,
}

impl Candidate {
    /// Nothing heard of it yet.
    pub const fn new(pair: Pair) -> Self {
        Self {
            pair,
            last_seq: 0,
            pending: [None; PENDING],
            next_due: Tick::MAX,
            taken: None,
            before: None,
            answers: 0,
        }
    }

    /// Nobody.
    pub const NOBODY: Self = Self::new((0, 0));

    /// Source and epoch.
    pub const fn pair(&self) -> Pair {
        self.pair
    }

    /// True if `command` says it is of this controller.
    pub const fn wrote(&self, command: &Command) -> bool {
        self.pair.0 != 0 && command.source == self.pair.0 && command.epoch == self.pair.1
    }

    /// True once it has sent anything.
    pub const fn is_heard(&self) -> bool {
        self.last_seq > 0
    }

    /// Control cycles in a row for which its command was there in time.
    pub const fn answers(&self) -> u64 {
        self.answers
    }

    /// Its command of the cycle before the one taken last, if it had one.
    pub const fn before(&self) -> Option<Command> {
        self.before
    }

    /// Keeps a command until its tick; without room that for the earliest tick goes. Refuses an old one.
    pub fn keep(&mut self, command: &Command) -> Result<(), Refusal> {
        if command.seq <= self.last_seq {
            return Err(Refusal::OldSeq);
        }
        let newest = self.known().map(|known| known.effective_tick).max();
        if newest.is_some_and(|newest| command.effective_tick <= newest) {
            return Err(Refusal::OldTick);
        }
        self.last_seq = command.seq;
        let earliest = |slot: &&mut Option<Command>| slot.map_or(0, |command| command.effective_tick);
        if let Some(slot) = self.pending.iter_mut().min_by_key(earliest) {
            *slot = Some(*command);
        }
        self.note_next_due();
        Ok(())
    }

    /// True if the lockstep clock has to wait for its command of `tick`: it is not there, and may come.
    pub fn owes(&self, tick: Tick) -> bool {
        self.pair.0 != 0 && !self.known().any(|command| command.effective_tick >= tick)
    }

    /// Commands that wait, and the one taken last.
    fn known(&self) -> impl Iterator<Item = &Command> {
        self.pending.iter().chain([&self.taken]).flatten()
    }

    fn note_next_due(&mut self) {
        let waiting = self.pending.iter().flatten();
        self.next_due = waiting.map(|command| command.effective_tick).min().unwrap_or(Tick::MAX);
    }

    /// Takes the newest command whose time has come at `tick`, once. One of the cycle before may come together
    /// with it: a successor answers what its predecessor may have left unanswered.
    #[inline]
    pub fn due(&mut self, tick: Tick, period_ticks: u64) -> Option<Command> {
        if tick < self.next_due { None } else { self.take(tick, period_ticks) }
    }

    fn take(&mut self, tick: Tick, period_ticks: u64) -> Option<Command> {
        let due = self.pending.iter().flatten().filter(|command| command.effective_tick <= tick);
        let command = *due.max_by_key(|command| command.effective_tick)?;
        let of_the_cycle_before =
            |known: &&Command| known.effective_tick + period_ticks == command.effective_tick;
        let before = self.known().find(of_the_cycle_before).copied();
        (self.before, self.taken) = (before, Some(command));
        for slot in &mut self.pending {
            if slot.as_ref().is_some_and(|command| command.effective_tick <= tick) {
                *slot = None;
            }
        }
        self.note_next_due();
        Some(command)
    }

    /// Opens the cycle that begins at `tick`: as [`Self::due`], and counts whether it kept time.
    pub fn open_cycle(&mut self, tick: Tick, period_ticks: u64) -> Option<Command> {
        let command = self.due(tick, period_ticks);
        let in_time = command.is_some_and(|command| command.effective_tick == tick);
        self.answers = if in_time { self.answers + 1 } else { 0 };
        command
    }
}

impl Stateful for Candidate {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.pair.0);
        words.word(&mut self.pair.1);
        words.word(&mut self.last_seq);
        words.count(&mut self.answers, COUNTED_MAX);
        let commands = self.pending.iter_mut().chain([&mut self.taken, &mut self.before]);
        for command in commands {
            words.option(command, Command::ZERO, visit_command);
        }
        if words.is_loading() {
            self.note_next_due();
        }
    }
}

/// A command that was taken in: one for a tick that there may be.
pub fn visit_command(command: &mut Command, words: &mut StateWords<'_>) {
    words.message(command);
    words.require(command.effective_tick < COUNTED_MAX);
}
