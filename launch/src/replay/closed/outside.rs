//! What comes from outside a drive, at its ticks: what the recording says was ordered, lost, started and ended.

use crate::replay::boxes::controller::{Lost, identity};
use crate::replay::boxes::step_generator::{Taken, taken};
use crate::replay::lives::Life;
use crate::replay::log::{Dated, RunLog, Wire};
use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::{Authority, Command, Mode, ReferenceState};
use hilare_interfaces::wires::Role;
use std::collections::{BTreeMap, BTreeSet};

/// A controller process and the pose it answers.
pub type Answer = (u64, u64, Tick);

/// Something the step generator takes, or is.
pub enum Event {
    /// Its process begins.
    Began(Life),
    /// Launch's word.
    Authority(Authority),
    /// The command that answers this comes in.
    Comes(Answer),
    /// A command of a program that is not ours.
    Foreign(Command),
    /// Ticks are lost before the next.
    Pause(u64),
    /// The system file of this number is in force.
    System(u64),
}

/// What the recording says of the outside.
pub struct Outside {
    /// In order.
    pub events: Vec<(Tick, Event)>,
    /// The first of the events with which the run was ended, because the robot had arrived.
    pub ending: Option<usize>,
    /// Answers the step generator took in at a tick of the recording.
    pub taken: BTreeSet<Answer>,
    /// Answers that were sent.
    pub sent: BTreeSet<Answer>,
    /// Ticks with a reference.
    pub references: Answered,
    /// Ticks with a pose.
    pub poses: Answered,
    /// The robot arrived.
    pub arrived: bool,
    /// Programs that are not ours: source and epoch.
    pub programs: Vec<(u64, u64)>,
    /// What was given up.
    pub notes: Vec<String>,
}

/// Ticks that were answered in the recording; beyond its end, all are.
pub struct Answered {
    ticks: BTreeSet<Tick>,
    end: Tick,
    every: u64,
    /// Ticks are those of the recording.
    as_recorded: bool,
}

impl Answered {
    fn of<M: Dated>(wire: &Wire<M>, every: u64, as_recorded: bool, end: Tick) -> Self {
        let ticks: BTreeSet<Tick> = wire.ticks(None, end).into_iter().collect();
        let end = ticks.last().copied().unwrap_or(0);
        Self { ticks, end, every, as_recorded }
    }

    /// True if ticks of the recording are ticks of this drive.
    pub fn is_as_recorded(&self) -> bool {
        self.as_recorded
    }

    /// True if the tick is answered.
    pub fn contains(&self, tick: Tick) -> bool {
        if self.as_recorded && tick <= self.end {
            self.ticks.contains(&tick)
        } else {
            tick.is_multiple_of(self.every)
        }
    }
}

/// The first process of each box has to be there: what a drive begins with.
pub fn begins_whole(log: &RunLog) -> Result<(), String> {
    let needed =
        [Role::WaypointSelector, Role::Controller, Role::StepGenerator, Role::PoseEstimator, Role::Plant];
    for role in needed {
        let first = log.lives.all.iter().any(|life| life.role == role && life.begins_whole());
        let earlier = log.lives.earlier.values().any(|earlier| *earlier == role);
        let foreign = role == Role::Controller && !log.commands.is_empty();
        if (!first && !foreign) || earlier {
            return Err(format!(
                "the recording does not have the beginning of {}: to drive again takes one from the start \
                 (hilare run); --box shows what a box would have answered",
                role.name()
            ));
        }
    }
    Ok(())
}

impl Outside {
    /// From a recording; `period_ticks` as it is to be driven.
    pub fn of(log: &RunLog, lost: &Lost, period_ticks: u64) -> Result<Self, String> {
        let recorded_period = recorded_period(log).unwrap_or(period_ticks);
        let as_recorded = recorded_period == period_ticks;
        let mut outside = Self {
            events: Vec::new(),
            ending: None,
            taken: BTreeSet::new(),
            sent: BTreeSet::new(),
            references: Answered::of(&log.references, period_ticks, as_recorded, log.end),
            poses: Answered::of(&log.poses, 1, true, log.end),
            arrived: false,
            programs: log.programs(),
            notes: Vec::new(),
        };
        if !outside.programs.is_empty() {
            let names: Vec<_> =
                outside.programs.iter().map(|(source, epoch)| format!("{source}.{epoch}")).collect();
            outside.notes.push(format!(
                "controller {} is a program that is not hilare's: its commands are taken as given and answer to no \
                 change; while it is in charge, the figures are judged by the references it had. --controller LAW \
                 drives in its place",
                names.join(", ")
            ));
        }
        let arrived = log.references.between(None, log.end).iter();
        let arrived = arrived.filter(|reference| reference.state == ReferenceState::Arrived.code());
        let arrived = arrived.map(|reference| reference.tick).next();
        outside.arrived = arrived.is_some();
        let ours: BTreeSet<(u64, u64)> =
            log.lives.of_role(Role::Controller).into_iter().map(identity).collect();
        for ((source, epoch), commands) in &log.commands {
            if ours.contains(&(*source, *epoch)) {
                outside.sent.extend(commands.iter().map(|command| (*source, *epoch, command.pose_tick)));
            }
        }
        outside.sent.extend(lost.values().map(|command| (command.source, command.epoch, command.pose_tick)));
        for life in log.lives.of_role(Role::StepGenerator) {
            outside.add_life(log, life, lost, &ours)?;
        }
        outside.ending = arrived.and_then(|arrived| outside.find_ending(arrived));
        Ok(outside)
    }

    /// Commands of ours that were sent when the drive begins, and are taken in later.
    pub fn under_way(&self, log: &RunLog, lost: &Lost) -> BTreeMap<Answer, Command> {
        let sent = log.commands.values().flatten().chain(lost.values());
        let sent = sent.filter(|command| command.pose_tick < log.begin);
        let answers = sent.map(|command| ((command.source, command.epoch, command.pose_tick), *command));
        answers.filter(|(answer, _)| self.taken.contains(answer)).collect()
    }

    fn add_life(
        &mut self,
        log: &RunLog,
        life: &Life,
        lost: &Lost,
        ours: &BTreeSet<(u64, u64)>,
    ) -> Result<(), String> {
        self.events.push((life.done().unwrap_or(0), Event::Began(life.clone())));
        for entry in &life.entries {
            let (found, _) = taken(log, lost, entry);
            let event = match found {
                Ok(Taken::Authority(authority)) => Event::Authority(authority),
                Ok(Taken::Command(command)) if ours.contains(&(command.source, command.epoch)) => {
                    let answer = (command.source, command.epoch, command.pose_tick);
                    self.taken.insert(answer);
                    Event::Comes(answer)
                }
                Ok(Taken::Command(command)) => Event::Foreign(command),
                Ok(Taken::Pause(ticks)) => Event::Pause(ticks),
                Ok(Taken::System(number)) => Event::System(number),
                Ok(Taken::Nothing) => continue,
                Err(why) => {
                    self.notes.push(why);
                    continue;
                }
            };
            self.events.push((entry.tick, event));
        }
        if life.broken {
            let last = life.entries.last().map_or(life.tick, |entry| entry.tick);
            self.notes.push(format!("the step generator's journal has a gap after tick {last}"));
        }
        Ok(())
    }

    /// Launch stops the robot when it has arrived: where no word to drive follows any more.
    fn find_ending(&self, arrived: Tick) -> Option<usize> {
        let words = self.events.iter().enumerate().filter_map(|(place, (tick, event))| match event {
            Event::Authority(authority) => Some((place, *tick, authority.mode == Mode::Armed.code())),
            _ => None,
        });
        let words: Vec<_> = words.collect();
        let last_armed = words.iter().rposition(|(.., armed)| *armed)?;
        words.get(last_armed + 1).filter(|(_, tick, _)| *tick >= arrived).map(|(place, ..)| *place)
    }
}

/// The control period of the recording, ticks: the least distance of two references.
fn recorded_period(log: &RunLog) -> Option<u64> {
    let ticks = log.references.ticks(None, log.end);
    ticks.windows(2).map(|pair| pair[1] - pair[0]).min()
}
