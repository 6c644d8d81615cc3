//! A recording, read into a [`RunLog`].

use super::lives::Life;
use super::log::{Messages, RunLog, Title};
use crate::config::System;
use crate::recording::{Entry, Heard, Recording, STANDINGS_ATTACHMENT, Standings};
use crate::shell::ClockKind;
use crate::shell::worker::system_file;
use std::collections::BTreeMap;
use std::path::Path;

/// Takes in what was recorded, message by message.
#[derive(Default)]
pub struct Collector {
    messages: Messages,
}

impl Collector {
    /// A message came.
    pub fn hear(&mut self, heard: Heard<'_>) {
        let messages = &mut self.messages;
        match heard {
            Heard::Goal(header, waypoints) => messages.goals.push((*header, waypoints.to_vec())),
            Heard::Answer(answer) => messages.answers.push(*answer),
            Heard::Health(_) => {}
            Heard::Journal(entry) => messages.journal.push(*entry),
            Heard::Path(header, waypoints) => messages.paths.push((*header, waypoints.to_vec())),
            Heard::Authority(authority) => messages.authorities.push(*authority),
            Heard::Steps(steps) => messages.steps.push(*steps),
            Heard::Wheels(wheels) => messages.wheels.push(*wheels),
            Heard::Fix(fix) => messages.fixes.push(*fix),
            Heard::Pose(pose) => messages.poses.push(*pose),
            Heard::Truth(truth) => messages.truths.push(*truth),
            Heard::Reference(reference) => messages.references.push(*reference),
            Heard::Command(command) => messages.commands.push(*command),
        }
    }

    /// All of them.
    pub fn into_messages(self) -> Messages {
        self.messages
    }
}

/// Reads a run's directory, or a file of a recording; the second is what is to be said of it. An error is one line.
pub fn read(path: &Path) -> Result<(RunLog, Vec<String>), String> {
    let recording = Recording::open(path).map_err(|error| error.to_string())?;
    let info = recording.info();
    let mut notes = Vec::new();
    if let Some(file) = recording.truncated() {
        notes.push(format!("{} has no end: what came after its last whole chunk is lost", file.display()));
    }
    if info.part > 0 {
        notes.push(format!(
            "{} is part {} of a recording: how each box began, and with which law, is in the parts before; give \
             the directory or the first file (run.mcap)",
            path.display(),
            info.part + 1
        ));
    }
    let mut collector = Collector::default();
    for timed in recording.entries() {
        let timed: Entry = timed.map_err(|error| error.to_string())?.entry;
        collector.hear(timed.heard());
    }
    let mut systems = BTreeMap::new();
    if let Some(text) = recording.system() {
        let origin = format!("{}: system.toml", path.display());
        systems.insert(1, System::parse(&origin, text).map_err(|error| error.to_string())?);
    }
    let inside = recording.inside().map_err(|error| error.to_string())?;
    for (number, text) in inside.systems {
        let origin = format!("{}: {}", path.display(), system_file(number));
        systems.insert(number, System::parse(&origin, &text).map_err(|error| error.to_string())?);
    }
    let clock: ClockKind = info.clock.parse().map_err(|why| format!("{}: {why}", path.display()))?;
    let name = [&*info.scenario, &*info.controller, &*info.clock]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(", ");
    let standings = match inside.standings {
        Some(Ok(standings)) => standings,
        Some(Err(why)) => {
            notes.push(format!(
                "where each box stood when it began ({STANDINGS_ATTACHMENT} in it) {why}: those that were at work then \
                 are not compared"
            ));
            Standings::default()
        }
        None => Standings::default(),
    };
    let title = Title { name, clock };
    let log = RunLog::begun_in_mid_drive(title, systems, collector.into_messages(), standings);
    let from = log.lives.all.iter().filter(|life| life.met.is_some()).filter_map(Life::done);
    if let Some(last) = from.max().filter(|last| *last > 0) {
        notes.push(format!(
            "begun when the robot was up: each box goes on from where it stood at tick {last} or just before; what it \
             said until then is not compared"
        ));
    }
    Ok((log, notes))
}
