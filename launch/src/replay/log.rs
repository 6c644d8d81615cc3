//! A run as it was recorded, sorted for a replay: messages by wire and tick, processes by their place.

use super::lives::{Life, Lives};
use super::states::Met;
use crate::config::{System, key_of};
use crate::recording::Standings;
use crate::shell::ClockKind;
use hilare_controller::LawSpec;
use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages::{
    Answer, Authority, Command, GoalHeader, Journal, JournalKind, PathHeader, Pose, PoseFix, Reference,
    Steps, Truth, Waypoint, Wheels,
};
use hilare_interfaces::wires::Role;
use std::collections::BTreeMap;
use std::ops::{Range, RangeInclusive};

/// A message of a tick.
pub trait Dated: WireMessage {
    /// The tick it is of; of a command, that of the pose it answers.
    fn tick(&self) -> Tick;
}

macro_rules! dated {
    ($($message:ty: $tick:ident),*) => {
        $(impl Dated for $message {
            fn tick(&self) -> Tick {
                self.$tick
            }
        })*
    };
}
dated!(Steps: tick, Pose: tick, Truth: tick, Wheels: tick, PoseFix: tick, Reference: tick, Command: pose_tick);

/// A goal, or a path: its header and its waypoints.
pub type WithWaypoints<H> = (H, Vec<Waypoint>);

/// What was recorded, wire by wire, each in the order of the wire.
#[derive(Clone, Debug, Default)]
#[allow(missing_docs)]
pub struct Messages {
    pub goals: Vec<WithWaypoints<GoalHeader>>,
    pub answers: Vec<Answer>,
    pub paths: Vec<WithWaypoints<PathHeader>>,
    pub references: Vec<Reference>,
    pub commands: Vec<Command>,
    pub authorities: Vec<Authority>,
    pub steps: Vec<Steps>,
    pub wheels: Vec<Wheels>,
    pub fixes: Vec<PoseFix>,
    pub poses: Vec<Pose>,
    pub truths: Vec<Truth>,
    pub journal: Vec<Journal>,
}

/// What a recording is of.
#[derive(Clone, Debug)]
pub struct Title {
    /// Scenario, controller, and so on, for people.
    pub name: String,
    /// What drove the ticks.
    pub clock: ClockKind,
}

/// Messages of a wire by their tick; of those of one tick, the first heard is the first.
#[derive(Clone, Debug)]
pub struct Wire<M>(Vec<M>);

impl<M: Dated> Wire<M> {
    fn new(mut messages: Vec<M>) -> Self {
        messages.sort_by_key(Dated::tick);
        Self(messages)
    }

    /// The last tick of a message; of lies after `end`, none.
    pub fn last(&self, end: Tick) -> Option<Tick> {
        self.between(None, end).last().map(Dated::tick)
    }

    /// All of them.
    pub fn all(&self) -> &[M] {
        &self.0
    }

    /// Places of those of a tick.
    pub fn places(&self, tick: Tick) -> Range<usize> {
        self.after(tick, false)..self.after(tick, true)
    }

    fn after(&self, tick: Tick, or_at: bool) -> usize {
        self.0.partition_point(|message| message.tick() < tick || (or_at && message.tick() == tick))
    }

    /// Those of a tick.
    pub fn at(&self, tick: Tick) -> &[M] {
        &self.0[self.places(tick)]
    }

    /// The first of a tick.
    pub fn first(&self, tick: Tick) -> Option<&M> {
        self.at(tick).first()
    }

    /// Those after a tick, up to another one; after none, from the beginning.
    pub fn between(&self, after: Option<Tick>, to: Tick) -> &[M] {
        let from = after.map_or(0, |after| self.after(after, true));
        let to = self.after(to, true);
        &self.0[from.min(to)..to]
    }

    /// Ticks beyond `end` that cannot be: no message leads up to them from there, every `stride` ticks.
    pub fn unreachable(&self, end: Tick, stride: u64) -> RangeInclusive<Tick> {
        let mut last = end / stride * stride;
        while self.first(last.saturating_add(stride)).is_some_and(|next| next.tick() > last) {
            last += stride;
        }
        last.saturating_add(1).max(end.saturating_add(1))..=Tick::MAX
    }

    /// The ticks of [`Self::between`], each once.
    pub fn ticks(&self, after: Option<Tick>, to: Tick) -> Vec<Tick> {
        let mut ticks: Vec<Tick> = self.between(after, to).iter().map(Dated::tick).collect();
        ticks.dedup();
        ticks
    }
}

/// Ticks without a message after which what comes is not of this run: a tick that is a lie.
const APART_MAX: u64 = 100_000;

/// A run as it was recorded.
#[derive(Clone)]
#[allow(missing_docs)]
pub struct RunLog {
    pub title: Title,
    /// The system files of the run by their number.
    pub systems: BTreeMap<u64, System>,
    pub goals: Vec<WithWaypoints<GoalHeader>>,
    pub answers: Vec<Answer>,
    pub paths: Vec<WithWaypoints<PathHeader>>,
    pub references: Wire<Reference>,
    /// Of each process, in the order in which they came.
    pub commands: BTreeMap<(u64, u64), Vec<Command>>,
    pub authorities: Vec<Authority>,
    pub steps: Wire<Steps>,
    pub wheels: Wire<Wheels>,
    pub fixes: Wire<PoseFix>,
    pub poses: Wire<Pose>,
    pub truths: Wire<Truth>,
    pub lives: Lives,
    /// What those remembered that were at work when it began.
    pub met: Vec<Met>,
    /// The tick from which on it can be driven again; 0 if it has the beginning.
    pub begin: Tick,
    /// The last tick of which there are steps.
    pub end: Tick,
    /// The last tick of which there is an entry in a journal: the end of a recording may lack those that follow.
    pub journal_end: Tick,
}

impl RunLog {
    /// Sorts what was recorded. Without a journal, as in a run in one thread, what it would say follows from the
    /// messages.
    pub fn new(title: Title, systems: BTreeMap<u64, System>, messages: Messages) -> Self {
        Self::begun_in_mid_drive(title, systems, messages, Standings::default())
    }

    /// The same of one that was begun in mid-drive, with where each box stood.
    pub fn begun_in_mid_drive(
        title: Title,
        systems: BTreeMap<u64, System>,
        messages: Messages,
        mut standings: Standings,
    ) -> Self {
        let journal = if messages.journal.is_empty() && title.clock == ClockKind::InProcess {
            super::in_process::journal(systems.values().next(), &messages)
        } else {
            messages.journal
        };
        let mut commands: BTreeMap<(u64, u64), Vec<Command>> = BTreeMap::new();
        for command in messages.commands {
            commands.entry((command.source, command.epoch)).or_default().push(command);
        }
        let steps = Wire::new(messages.steps);
        let apart = |pair: &[Steps]| pair[1].tick.saturating_sub(pair[0].tick) > APART_MAX;
        let together = steps.all().windows(2).position(apart).map_or(steps.all().len(), |last| last + 1);
        let end = together.checked_sub(1).map_or(0, |last| steps.all()[last].tick);
        // Beyond the end there is nothing to compare, or it is a lie.
        standings.stands.retain(|stand| stand.done.is_none_or(|done| done <= end));
        let lives = Lives::of(&journal, &standings);
        let met = standings.stands.into_iter().filter_map(|stand| Met::of(stand, &lives, &systems)).collect();
        Self {
            title,
            met,
            begin: 0,
            systems,
            goals: messages.goals,
            answers: messages.answers,
            paths: messages.paths,
            references: Wire::new(messages.references),
            commands,
            authorities: messages.authorities,
            steps,
            wheels: Wire::new(messages.wheels),
            fixes: Wire::new(messages.fixes),
            poses: Wire::new(messages.poses),
            truths: Wire::new(messages.truths),
            lives,
            journal_end: journal
                .iter()
                .map(|entry| entry.tick)
                .filter(|tick| *tick <= end)
                .max()
                .unwrap_or(0),
            end,
        }
    }

    /// The system file a process has read.
    pub fn system(&self, life: &Life) -> Result<&System, String> {
        self.numbered(life.system)
    }

    /// The system file of a number.
    pub fn numbered(&self, number: u64) -> Result<&System, String> {
        let missing = || format!("its system file (number {number}) is not in the recording");
        self.systems.get(&number).ok_or_else(missing)
    }

    /// The first system file.
    pub fn first_system(&self) -> Option<&System> {
        self.systems.values().next()
    }

    /// The path of a number, with as many waypoints.
    pub fn path(&self, path_id: u64, waypoints: Option<u64>) -> Option<&WithWaypoints<PathHeader>> {
        self.paths.iter().find(|(header, points)| {
            header.path_id == path_id && waypoints.is_none_or(|wanted| wanted == points.len() as u64)
        })
    }

    /// The command of a writer with a number, and these bits if there are several.
    pub fn command(&self, source: u64, epoch: u64, seq: u64, hash: u64) -> Option<&Command> {
        let written = self.commands.get(&(source, epoch))?;
        // Nearly always in order.
        let place = written.partition_point(|command| command.seq < seq);
        let near = &written[place.saturating_sub(2)..(place + 3).min(written.len())];
        let wanted = |command: &&Command| command.seq == seq && command.content_hash() == hash;
        let numbered = |command: &&Command| command.seq == seq;
        near.iter()
            .find(wanted)
            .or_else(|| written.iter().find(wanted))
            .or_else(|| near.iter().find(numbered))
            .or_else(|| written.iter().find(numbered))
    }

    /// The last tick any message can be of; beyond, it is a lie.
    pub fn horizon(&self) -> Tick {
        self.end.saturating_add(APART_MAX)
    }

    /// The run with other system files, and another law in every controller of ours.
    pub fn changed(mut self, set: &[String], law: Option<&'static LawSpec>) -> Result<Self, String> {
        let law_key = law.map(|law| format!("controller.law={}", law.name));
        let keys: Vec<&String> = set.iter().chain(&law_key).collect();
        for system in self.systems.values_mut() {
            system.set_all(&keys).map_err(|error| {
                let error = error.to_string();
                // The assignment we made of a flag is nothing the user has written.
                let own = law.zip(law_key.as_ref()).and_then(|(law, key)| {
                    let what = error.strip_prefix(&format!("--set {key}: "))?;
                    Some(format!("--controller {}: {what}", law.name))
                });
                own.unwrap_or(error)
            })?;
        }
        let sets_law = keys.iter().any(|key| key.split('=').next().map(str::trim) == Some("controller.law"));
        if sets_law {
            self.replace_programs();
        }
        for life in self.lives.all.iter_mut().filter(|life| sets_law && life.role == Role::Controller) {
            life.law = self.systems.get(&life.system).map(|system| system.controller.law);
        }
        Ok(self)
    }

    /// Changes of the recording (`hilare param set`) that do not hold any more where the same key is set for the
    /// whole drive, in words.
    pub fn overruled(&self, set: &[String]) -> Vec<String> {
        let mut notes = Vec::new();
        for key in set.iter().filter_map(|assignment| self.first_system()?.key(key_of(assignment)).ok()) {
            let mut changes: Vec<(Tick, String)> = Vec::new();
            for life in &self.lives.all {
                let mut last = self.systems.get(&life.system).map(|system| key.value_text(system));
                for entry in life.entries.iter().filter(|entry| entry.kind == JournalKind::Param.code()) {
                    let Some(system) = self.systems.get(&entry.words[1]) else { continue };
                    let value = key.value_text(system);
                    if last.replace(value.clone()).is_some_and(|last| last != value) {
                        changes.push((entry.words[2], value));
                    }
                }
            }
            changes.sort();
            changes.dedup_by_key(|(_, value)| value.clone());
            notes.extend(changes.iter().map(|(tick, value)| {
                format!(
                    "{} was changed to {value} at tick {tick} of the recording: what is set now holds instead, for \
                     the whole drive",
                    key.path()
                )
            }));
        }
        notes
    }

    /// Programs that are not hilare's and have driven, by source and epoch.
    pub fn programs(&self) -> Vec<(u64, u64)> {
        let is_ours = |(source, epoch): &(u64, u64)| {
            let mut ours = self.lives.all.iter().filter(|life| life.role == Role::Controller);
            ours.any(|life| (life.slot + 1, life.epoch) == (*source, *epoch))
                || self.lives.earlier.contains_key(&source.wrapping_sub(1))
        };
        self.commands.keys().filter(|writer| !is_ours(writer)).copied().collect()
    }

    /// Puts a controller of ours in the place of each program, from its first command on.
    fn replace_programs(&mut self) {
        let Some(system) = self.lives.of_role(Role::StepGenerator).first().map(|life| life.system) else {
            return;
        };
        for (source, epoch) in self.programs() {
            let first = self.commands[&(source, epoch)].first();
            self.lives.all.push(Life {
                slot: source.wrapping_sub(1),
                role: Role::Controller,
                incarnation: 1,
                epoch,
                system,
                law: None,
                tick: first.map_or(0, |command| command.pose_tick),
                state: None,
                met: None,
                entries: Vec::new(),
                broken: false,
            });
        }
    }
}
