//! Every controller process, in charge, standing by or on trial, with the reference and the pose of each of its commands.

use super::BoxReport;
use crate::config::System;
use crate::replay::fields::{Difference, same};
use crate::replay::ledger::Ledger;
use crate::replay::lives::{Changes, Life};
use crate::replay::log::RunLog;
use crate::replay::states::{States, copied};
use crate::shell::boxes::controller::state_key;
use crate::shell::build;
use hilare_controller::{Controller, ControllerInputs, Identity};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{Command, JournalKind, Reference};
use hilare_interfaces::state::STATE_WORDS;
use hilare_interfaces::wires::Role;
use std::collections::{BTreeMap, BTreeSet};

/// Source and epoch of a process.
pub fn identity(life: &Life) -> (u64, u64) {
    (life.slot + 1, life.epoch)
}

/// Commands that were sent and are not in the recording, by source, epoch and number: as the replay made them.
pub type Lost = BTreeMap<(u64, u64, u64), Command>;

/// Replays every process, those first whose state others went on from.
pub fn replay(log: &RunLog, states: &mut States, measures: bool) -> (Vec<BoxReport>, Lost) {
    let mut lost = Lost::new();
    let mut reports = Vec::new();
    let mut waiting = log.lives.of_role(Role::Controller);
    let mut ours = BTreeSet::new();
    while !waiting.is_empty() {
        let place = waiting.iter().position(|life| !waits_for_another(life, &waiting)).unwrap_or(0);
        let life = waiting.remove(place);
        ours.insert(identity(life));
        reports.push(((life.tick, identity(life)), replay_life(log, life, states, &mut lost, measures)));
    }
    for (writer, commands) in &log.commands {
        if !ours.contains(writer) {
            let first = commands.first().map_or(0, |command| command.pose_tick);
            reports.push(((first, *writer), taken_as_given(*writer, commands, log)));
        }
    }
    reports.sort_by_key(|(order, _)| *order);
    (reports.into_iter().map(|(_, report)| report).collect(), lost)
}

/// True if it went on from the state of a process that has not been replayed.
fn waits_for_another(life: &Life, waiting: &[&Life]) -> bool {
    let Some((slot, tick)) = life.state else { return false };
    let before = |other: &&Life| {
        other.slot == slot
            && other.tick <= tick
            && (other.slot != life.slot || other.incarnation < life.incarnation)
    };
    waiting.iter().any(before)
}

/// A program that is not ours, or a process of which the recording lacks the beginning.
fn taken_as_given(writer: (u64, u64), commands: &[Command], log: &RunLog) -> BoxReport {
    let mut report = BoxReport::new(Role::Controller);
    report.name = format!("controller {}.{}", writer.0, writer.1);
    let mut tally = Ledger::new(commands, false).tally("command");
    let heard =
        log.lives.all.iter().flat_map(|life| &life.entries).any(|entry| {
            entry.kind == JournalKind::Command.code() && (entry.words[0], entry.words[1]) == writer
        });
    let whole = log.lives.of_role(Role::StepGenerator).iter().any(|life| !life.broken);
    let note = if heard || !whole {
        match log.lives.earlier.get(&writer.0.wrapping_sub(1)) {
            Some(Role::Controller) => "at work before the recording began: its commands are taken as given",
            _ if !log.lives.earlier.is_empty() => {
                "what drove is not in the recording, which began later: its commands are taken as given"
            }
            _ => "a program that is not hilare's: its commands are taken as given",
        }
    } else {
        (tally.differing, tally.compared, tally.not_compared) = (tally.not_compared, tally.not_compared, 0);
        let tick = commands.first().map_or(0, |command| command.pose_tick);
        let name = format!("{}.{}", writer.0, writer.1);
        tally.first =
            Some(Difference::of_words(tick, "source, epoch", name, "no command of such a controller"));
        "the step generator never heard of it"
    };
    report.notes.push(note.to_owned());
    report.wires.push(tally);
    report
}

/// A controller of a process with the parameters of a system, and the key of its state.
pub fn built(system: &System, life: &Life) -> Result<(Controller, u64), String> {
    let law = life.law.ok_or("it has a law that this hilare does not know")?;
    let (source, epoch) = identity(life);
    let controller = build::controller(system, law, Identity { source, epoch })?;
    Ok((controller, state_key(system, law)))
}

/// A controller process under way.
pub struct AtWork<'l> {
    log: &'l RunLog,
    life: &'l Life,
    system: &'l System,
    changes: Changes,
    /// The box.
    pub controller: Controller,
    /// Key of its state.
    pub key: u64,
}

impl<'l> AtWork<'l> {
    /// As its process begins, without a state.
    pub fn begin(log: &'l RunLog, life: &'l Life) -> Result<Self, String> {
        let system = log.system(life)?;
        let (controller, key) = built(system, life)?;
        Ok(Self { log, life, system, changes: life.changes(), controller, key })
    }

    /// Goes on from a state; one that was at work when the recording began also with other parameters than it had.
    pub fn go_on(&mut self, states: &States, from: (u64, Tick)) -> Result<(), String> {
        let loaded = states.load(from, self.key, &mut self.controller);
        let Some(number) = self.life.met else { return loaded };
        if loaded.is_err() {
            let met = self.log.met.iter().find(|met| met.place == from);
            met.map_or(loaded, |met| met.hand_to(self.life, &mut self.controller))?;
        }
        self.controller.number_on(number);
        Ok(())
    }

    /// Goes on with the parameters that are in force for its answer to `tick`.
    pub fn change(&mut self, tick: Tick) -> Result<(), String> {
        while let Some(number) = self.changes.due(tick) {
            self.system = self.log.numbered(number)?;
            let (mut controller, key) = built(self.system, self.life)?;
            controller.take_over(&mut self.controller, &mut [0; STATE_WORDS]);
            (self.controller, self.key) = (controller, key);
        }
        Ok(())
    }
}

fn replay_life(log: &RunLog, life: &Life, states: &mut States, lost: &mut Lost, measures: bool) -> BoxReport {
    let writer = identity(life);
    let commands = log.commands.get(&writer).map_or(&[][..], Vec::as_slice);
    let mut report = BoxReport::new(Role::Controller);
    let law = life.law.map_or("?", |law| law.name);
    report.name = format!("controller {}.{} {law}", writer.0, writer.1);
    let mut ledger = Ledger::new(commands, measures);
    if let Err(why) = replay_commands(log, life, commands, states, (&mut ledger, lost)) {
        report.notes.push(why);
    }
    report.wires.push(ledger.tally("command"));
    report
}

fn replay_commands(
    log: &RunLog,
    life: &Life,
    commands: &[Command],
    states: &mut States,
    (ledger, lost): (&mut Ledger<'_, Command>, &mut Lost),
) -> Result<(), String> {
    let mut at_work = AtWork::begin(log, life)?;
    if let Some(from) = life.state {
        at_work.go_on(states, from)?;
        states.keep(from.0, from.1, at_work.key, &mut at_work.controller);
    }
    let mut last = life.done();
    let mut number = at_work.controller.number();
    // Those it had sent before the recording knew where it stood are in its state.
    let sent = commands.iter().position(|command| command.seq > number).unwrap_or(commands.len());
    // Of the end, some wires may have more than others.
    let inputs = [log.poses.last(log.end), log.references.last(log.end)];
    let end = inputs.into_iter().flatten().min().unwrap_or(0);
    let is_whole = |command: &&Command| !(end + 1..=log.horizon()).contains(&command.pose_tick);
    let commands =
        &commands[..commands.iter().rposition(|command| is_whole(&command)).map_or(0, |last| last + 1)];
    for (place, recorded) in commands.iter().enumerate().skip(if number == 0 { 0 } else { sent }) {
        let tick = answered(log, recorded, last, number)?;
        // Commands the recording has lost: as many as there were references meanwhile.
        let between = match last {
            Some(_) => log.references.ticks(last, tick.saturating_sub(1)),
            None => Vec::new(),
        };
        let missing = recorded.seq.wrapping_sub(number).wrapping_sub(1);
        if missing > 0 && missing == between.len() as u64 {
            for tick in between {
                let command = answer(&mut at_work, tick, None)?;
                ledger.make(0..0, &command);
                lost.insert((command.source, command.epoch, command.seq), command);
                states.keep(life.slot, tick, at_work.key, &mut at_work.controller);
            }
        }
        let command = answer(&mut at_work, tick, Some(recorded))?;
        ledger.make(place..place + 1, &command);
        states.keep(life.slot, tick, at_work.key, &mut at_work.controller);
        (last, number) = (Some(tick), command.seq);
    }
    Ok(())
}

/// The tick a command answers: its own, unless that can be none; then the next after the last.
fn answered(log: &RunLog, recorded: &Command, last: Option<Tick>, number: u64) -> Result<Tick, String> {
    let tick = recorded.pose_tick;
    let period = log.first_system().map_or(1, |system| system.timing.period_ticks);
    let odd = !tick.is_multiple_of(period) || tick > log.horizon() || last.is_some_and(|last| tick <= last);
    let answered = match last {
        Some(last) if odd && recorded.seq == number.wrapping_add(1) => {
            log.references.between(Some(last), log.end).first().map(|reference| reference.tick)
        }
        _ => log.references.first(tick).map(|reference| reference.tick),
    };
    answered.ok_or_else(|| format!("the reference of tick {tick} is missing in the recording"))
}

/// Answers a tick. Where a successor of the waypoint selector has said something else of it than its predecessor, the
/// controller has had one of both: that which leads to the recorded command.
fn answer(at_work: &mut AtWork<'_>, tick: Tick, recorded: Option<&Command>) -> Result<Command, String> {
    at_work.change(tick)?;
    let AtWork { log, life, system, controller, .. } = at_work;
    let missing = |wire: &str| format!("the {wire} of tick {tick} is missing in the recording");
    let pose = log.poses.first(tick).ok_or_else(|| missing("pose"))?;
    let references = variants(log.references.at(tick));
    let mut reference = *references.first().ok_or_else(|| missing("reference"))?;
    if let (Some(recorded), 2..) = (recorded, references.len()) {
        for other in references {
            let mut trial = copied(controller, built(system, life)?.0)?;
            let command = trial.step(tick, ControllerInputs { reference: other, pose });
            // Numbers are the process's own.
            if same(&Command { seq: recorded.seq, ..command }, recorded) {
                reference = other;
                break;
            }
        }
    }
    Ok(controller.step(tick, ControllerInputs { reference, pose }))
}

/// Messages of one tick that say different things.
fn variants(at: &[Reference]) -> Vec<&Reference> {
    let mut variants: Vec<&Reference> = Vec::new();
    for reference in at {
        if !variants.iter().any(|known| same(*known, reference)) {
            variants.push(reference);
        }
    }
    variants
}
