//! The step generator, with authority, commands and pauses at the ticks its journal says.

use super::BoxReport;
use super::controller::Lost;
use crate::replay::fields::Difference;
use crate::replay::ledger::{Ledger, Tally};
use crate::replay::lives::Life;
use crate::replay::log::RunLog;
use crate::replay::states::{MOVING, States};
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use crate::shell::clock::last_stop;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages::{Authority, Command, Journal, JournalKind, Steps};
use hilare_interfaces::wires::Role;
use hilare_step_generator::whole::Whole;
use hilare_step_generator::{StepGenerator, StepInputs};

/// Replays every process of it.
pub fn replay(log: &RunLog, states: &mut States, lost: &Lost, measures: bool) -> BoxReport {
    let mut report = BoxReport::new(Role::StepGenerator);
    let mut ledger = Ledger::new(log.steps.all(), measures);
    let mut inputs = Tally { wire: "taken in".to_owned(), ..Tally::default() };
    ledger.certain_to(log.journal_end);
    let lives = log.lives.of_role(Role::StepGenerator);
    for (n, life) in lives.iter().enumerate() {
        // What was executed was remembered before it was told.
        let to = match lives.get(n + 1) {
            None => log.end,
            Some(next) => next.done().unwrap_or(next.tick),
        };
        if let Err(why) = replay_life(log, life, to, states, lost, (&mut ledger, &mut inputs)) {
            report.note(life, &why);
        }
    }
    if !lives.is_empty() {
        ledger.know(log.end + 1..=Tick::MAX);
    }
    report.wires.extend([ledger.tally("steps"), inputs]);
    report
}

/// What an entry of its journal says it took.
pub enum Taken {
    /// This authority.
    Authority(Authority),
    /// This command.
    Command(Command),
    /// It lost as many ticks before the next.
    Pause(u64),
    /// The system file of this number is in force.
    System(u64),
    /// Nothing that concerns the step.
    Nothing,
}

/// What an entry stands for; why not, if the recording lacks it; and whether the recorded one has other bits.
pub fn taken(log: &RunLog, lost: &Lost, entry: &Journal) -> (Result<Taken, String>, Option<Difference>) {
    let tick = entry.tick;
    let [a, b, c, d, ..] = entry.words;
    let lacks = |what: String| format!("{what}, taken in at tick {tick}, is missing in the recording");
    let check = |what: &str, recorded: u64, taken: u64| {
        let difference = Difference {
            recorded_bits: format!("{recorded:#018x}"),
            replayed_bits: format!("{taken:#018x}"),
            ..Difference::of_words(tick, what, "a message with hash", "one with hash")
        };
        (recorded != taken).then_some(difference)
    };
    match JournalKind::from_code(entry.kind) {
        Some(JournalKind::Authority) if (a, b) == (u64::MAX, last_stop().content_hash()) => {
            (Ok(Taken::Authority(last_stop())), None)
        }
        Some(JournalKind::Authority) => {
            let what = format!("authority {a}");
            let all = || log.authorities.iter();
            let numbered = || all().filter(|authority| authority.seq == a);
            // Launch says the same again and again: what another one says but for its number, was said.
            let renumbered = || all().find(|other| Authority { seq: a, ..**other }.content_hash() == b);
            let exactly = numbered().find(|authority| authority.content_hash() == b);
            match exactly.or_else(|| numbered().next()).or_else(renumbered) {
                None => (Err(lacks(what)), None),
                Some(found) => {
                    let known = found.seq != a && log.lives.took_authority(found.seq, found.content_hash());
                    let differs = check(&what, found.content_hash(), b).filter(|_| !known);
                    (Ok(Taken::Authority(Authority { seq: a, ..*found })), differs)
                }
            }
        }
        Some(JournalKind::Command) => {
            let what = format!("command {c} of controller {a}.{b}");
            // One that was lost on the way to the recording, and made again, is known by its hash.
            let again = || lost.get(&(a, b, c)).filter(|command| command.content_hash() == d);
            match log.command(a, b, c, d).or_else(again) {
                None => (Err(lacks(what)), None),
                Some(found) => {
                    let differs = check(&what, found.content_hash(), d);
                    (Ok(Taken::Command(*found)), differs)
                }
            }
        }
        Some(JournalKind::Pause) => (Ok(Taken::Pause(a)), None),
        Some(JournalKind::Param) => (Ok(Taken::System(b)), None),
        _ => (Ok(Taken::Nothing), None),
    }
}

/// As its process begins.
pub fn begin(log: &RunLog, life: &Life, states: &States) -> Result<StepGenerator, String> {
    let mut generator = build::step_generator(log.system(life)?, log.title.clock);
    match (life.state, life.met) {
        (Some(from), Some(_)) => states.load(from, key_of(MOVING), &mut Whole(&mut generator))?,
        (Some(from), None) => states.load(from, key_of(Role::StepGenerator), &mut generator)?,
        (None, _) => {}
    }
    Ok(generator)
}

fn replay_life(
    log: &RunLog,
    life: &Life,
    to: Tick,
    states: &mut States,
    lost: &Lost,
    (ledger, inputs): (&mut Ledger<'_, Steps>, &mut Tally),
) -> Result<(), String> {
    let key = key_of(Role::StepGenerator);
    let mut generator = begin(log, life, states)?;
    let mut tick = life.done().unwrap_or(0);
    // It begins with where the robot stands.
    ledger.make(log.steps.places(tick), generator.state());
    if life.met.is_some() {
        states.keep(life.slot, tick, key, &mut generator);
    }
    let mut advance = |generator: &mut StepGenerator, tick: &mut Tick, paused_ticks: u64| {
        let steps = generator.step(*tick, StepInputs { paused_ticks, ..StepInputs::default() });
        *tick = steps.tick;
        ledger.make(log.steps.places(steps.tick), &steps);
        states.keep(life.slot, steps.tick, key, generator);
        states.keep(life.slot, steps.tick, key_of(MOVING), &mut Whole(generator));
    };
    let from = tick;
    let mut fault = None;
    let mut paused = 0;
    for entry in &life.entries {
        if entry.tick < tick || entry.tick > log.horizon() {
            fault = Some(format!("its journal speaks of tick {} after tick {tick}", entry.tick));
            break;
        }
        while tick < entry.tick.min(to) {
            advance(&mut generator, &mut tick, std::mem::take(&mut paused));
        }
        if tick < entry.tick {
            break;
        }
        let (taken, differs) = taken(log, lost, entry);
        inputs.compared += u64::from(matches!(taken, Ok(Taken::Authority(_) | Taken::Command(_))));
        if let Some(differs) = differs {
            inputs.differing += 1;
            inputs.first.get_or_insert(differs);
        }
        match taken {
            Ok(Taken::Authority(authority)) => {
                let inputs = StepInputs { authority: Some(&authority), ..StepInputs::default() };
                generator.take_in(tick, inputs);
            }
            Ok(Taken::Command(command)) => {
                let commands = std::slice::from_ref(&command);
                generator.take_in(tick, StepInputs { commands, ..StepInputs::default() });
            }
            Ok(Taken::Pause(ticks)) => paused += ticks,
            Ok(Taken::System(number)) => match log.numbered(number) {
                Ok(system) => generator.set_limits(system.limits),
                Err(why) => {
                    fault = Some(why);
                    break;
                }
            },
            Ok(Taken::Nothing) => {}
            Err(why) => {
                fault = Some(why);
                break;
            }
        }
    }
    let fault = fault.or_else(|| {
        life.broken.then(|| format!("its journal has a gap after tick {tick}: entries were lost"))
    });
    while fault.is_none() && tick < to {
        advance(&mut generator, &mut tick, std::mem::take(&mut paused));
    }
    ledger.know(from..=tick);
    fault.map_or(Ok(()), Err)
}
