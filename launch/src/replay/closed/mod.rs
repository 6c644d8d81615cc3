//! The whole drive again, closed: in one thread, with what came from outside in the recording, at its ticks.
//!
//! ```text
//! recording ─▶ outside: words of launch, goals, pauses, which process when ─┐
//!                                                                           ▼
//!      planner ─▶ selector ─▶ controllers ─▶ step generator ─▶ plant ─▶ estimator ─┐
//!                    ▲──────────────────────────────────────────────────────────────┘
//! ```
//!
//! With the recorded system files it ends in the recorded bits. With others, commands come in at the ticks at which the
//! recorded ones did; where there is none, at once. A robot that had arrived in the recording and has not here drives on:
//! launch's word to stop was due to the arrival. Commands of a program that is not ours come in as they were: while it is
//! in charge, the drive is as long as the recording, and judged by the recorded references.

pub mod boxes;
pub mod goals;
pub mod midway;
pub mod outside;

use super::fields::{Difference, first_difference};
use super::log::{Dated, RunLog, Wire};
use super::states::States;
use crate::replay::boxes::controller::Lost;
use crate::replay::boxes::step_generator::begin;
use crate::shell::checkpoint::key_of;
use boxes::{Driving, Estimating, Paths, Selecting, Simulated};
use goals::Planning;
use hilare_interfaces::block::{Block, TICKS_PER_SECOND, Tick};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Command, Mode, Pose, Reference, ReferenceState, Steps, Truth};
use hilare_interfaces::wires::Role;
use hilare_plant::Observed;
use hilare_recorder::{RunRecord, TickRecord};
use hilare_step_generator::{StepGenerator, StepInputs};
use outside::{Answer, Event, Outside};
use std::collections::BTreeMap;

/// Where a wire of the drive first says something else than the recording.
#[derive(Clone, Debug, Default)]
pub struct Parted {
    /// Messages compared.
    pub compared: u64,
    /// Those that differ.
    pub differing: u64,
    /// The first of them.
    pub first: Option<Difference>,
}

impl Parted {
    fn compare<M: Dated>(&mut self, recorded: &Wire<M>, made: &M) {
        let Some(known) = recorded.first(made.tick()) else { return };
        self.compare_with(known, made);
    }

    fn compare_with<M: Dated>(&mut self, recorded: &M, made: &M) {
        self.compared += 1;
        if let Some(difference) = first_difference(made.tick(), recorded, made) {
            self.differing += 1;
            self.first.get_or_insert(difference);
        }
    }
}

/// A drive that was driven again.
pub struct Driven {
    /// Its figures and curves.
    pub record: RunRecord,
    /// Wire by wire, against the recording.
    pub parted: BTreeMap<&'static str, Parted>,
    /// The paths it had.
    pub paths: Paths,
    /// Ticks it took.
    pub ticks: Tick,
    /// What is to be said of it.
    pub notes: Vec<String>,
}

/// Five times as long as the recording, and a minute: then it does not arrive any more.
fn time_limit(end: Tick) -> Tick {
    5 * end + 60 * TICKS_PER_SECOND
}

/// Drives again, with the system files and laws of `log`; `lost` are commands the recording lacks.
pub fn drive(log: &RunLog, lost: &Lost) -> Result<Driven, String> {
    outside::begins_whole(log)?;
    let first = log.lives.of_role(Role::StepGenerator)[0];
    let period_ticks = log.system(first)?.timing.period_ticks;
    let outside = Outside::of(log, lost, period_ticks)?;
    let commands = outside.under_way(log, lost);
    let mut drive = Drive::new(log, outside, commands, period_ticks)?;
    drive.begin()?;
    loop {
        drive.choose()?;
        if !drive.goes_on() {
            break;
        }
        drive.tick()?;
    }
    if drive.arrived() || (drive.program_drives && drive.outside.arrived) {
        drive.record.statistics.note_arrival();
    }
    let Drive { record, parted, paths, tick, mut planning, mut outside, .. } = drive;
    let mut notes = std::mem::take(&mut outside.notes);
    notes.append(&mut planning.notes);
    notes.dedup();
    Ok(Driven { record, parted, paths, ticks: tick, notes })
}

struct Drive<'l> {
    log: &'l RunLog,
    period_ticks: u64,
    /// Control periods are those of the recording.
    as_recorded: bool,
    outside: Outside,
    next_event: usize,
    states: States,
    planning: Planning<'l>,
    selecting: Selecting<'l>,
    controllers: Vec<Driving<'l>>,
    generator: Option<(StepGenerator, u64)>,
    plant: Simulated,
    estimating: Estimating<'l>,
    paths: Paths,
    /// Commands on their way.
    commands: BTreeMap<Answer, Command>,
    /// Those that come in with the next tick.
    at_once: Vec<Command>,
    /// Launch's last word to drive, repeated as its lease once the recording is over.
    lease: Option<Authority>,
    prolonged: bool,
    /// Who is in charge is a program that is not ours.
    program_drives: bool,
    tick: Tick,
    pose: Option<Pose>,
    observed: Option<Observed>,
    reference: Reference,
    record: RunRecord,
    parted: BTreeMap<&'static str, Parted>,
}

impl<'l> Drive<'l> {
    fn new(
        log: &'l RunLog,
        outside: Outside,
        commands: BTreeMap<Answer, Command>,
        period_ticks: u64,
    ) -> Result<Self, String> {
        let mut paths = Paths::new();
        for path in &log.paths {
            paths.entry(path.0.path_id).or_insert_with(|| path.clone());
        }
        let controllers = Driving::all(log, period_ticks);
        let states = States::new(log);
        Ok(Self {
            as_recorded: outside.references.is_as_recorded(),
            planning: Planning::new(log),
            selecting: Selecting::new(log),
            controllers,
            generator: None,
            plant: Simulated::begin(log, &states)?,
            states,
            estimating: Estimating::new(log),
            paths,
            commands,
            at_once: Vec::new(),
            lease: None,
            prolonged: false,
            program_drives: false,
            tick: log.begin,
            pose: None,
            observed: None,
            reference: Reference::ZERO,
            record: RunRecord::new(period_ticks),
            parted: BTreeMap::new(),
            next_event: 0,
            log,
            period_ticks,
            outside,
        })
    }

    fn arrived(&self) -> bool {
        self.reference.state == ReferenceState::Arrived.code()
    }

    /// To the end of the recording; on to the arrival, if the recorded robot arrived.
    fn goes_on(&self) -> bool {
        let waits = self.outside.arrived && !self.arrived() && !self.program_drives;
        self.tick < self.log.end || (waits && self.tick < time_limit(self.log.end))
    }

    /// Message 0 precedes the first tick; in mid-drive it begins with the message nobody has answered yet.
    fn begin(&mut self) -> Result<(), String> {
        if let Some((tick, Event::Began(life))) = self.outside.events.first()
            && *tick == self.log.begin
        {
            self.generator = Some((begin(self.log, life, &self.states)?, life.slot));
            self.next_event = 1;
        }
        let (generator, _) = self.generator.as_ref().ok_or("the recording has no beginning")?;
        let steps = *generator.state();
        self.look(&steps)
    }

    /// Planner, selector and controllers on the pose of a tick.
    fn choose(&mut self) -> Result<(), String> {
        let robot = self.pose.filter(Pose::makes_sense).map(|pose| pose.pose().position());
        self.planning.plan(self.log, self.tick, robot, &mut self.paths)?;
        self.control()
    }

    /// The next tick, and its pose.
    fn tick(&mut self) -> Result<(), String> {
        let paused_ticks = self.take_in()?;
        let Some((generator, slot)) = &mut self.generator else { return Err("nobody counts".to_owned()) };
        let steps = generator.step(self.tick, StepInputs { paused_ticks, ..StepInputs::default() });
        self.states.keep(*slot, steps.tick, key_of(Role::StepGenerator), generator);
        self.tick = steps.tick;
        self.look(&steps)?;
        if let (Some(pose), Some(observed)) = (&self.pose, &self.observed) {
            let (truth, mut reference) = (&observed.truth, &self.reference);
            if self.program_drives
                && let Some(known) = self.log.references.between(None, self.tick.saturating_sub(1)).last()
            {
                reference = known;
            }
            self.record.push(TickRecord { steps: &steps, pose, truth, reference });
        }
        Ok(())
    }

    /// Plant and estimator.
    fn look(&mut self, steps: &Steps) -> Result<(), String> {
        let log = self.log;
        self.compare("steps", &log.steps, steps);
        let observed = self.plant.step(self.log, steps)?;
        self.compare::<Truth>("truth", &log.truths, &observed.truth);
        self.estimating.see(observed.fix);
        self.observed = Some(observed);
        if self.outside.poses.contains(steps.tick)
            && let Some(pose) = self.estimating.step(log, &mut self.states, steps, &observed.wheels)?
        {
            self.compare("pose", &log.poses, &pose);
            self.pose = Some(pose);
        }
        Ok(())
    }

    fn compare<M: Dated>(&mut self, wire: &'static str, recorded: &Wire<M>, made: &M) {
        if made.tick() <= self.log.end {
            self.parted.entry(wire).or_default().compare(recorded, made);
        }
    }

    /// Selector and controllers.
    fn control(&mut self) -> Result<(), String> {
        let log = self.log;
        let Some(pose) = self.pose.filter(|pose| pose.tick == self.tick) else { return Ok(()) };
        if !self.tick.is_multiple_of(self.period_ticks) || !self.outside.references.contains(self.tick) {
            return Ok(());
        }
        let Some(reference) = self.selecting.step(log, &mut self.states, &pose, &self.paths)? else {
            return Ok(());
        };
        self.compare("reference", &log.references, &reference);
        self.reference = reference;
        for controller in &mut self.controllers {
            let inputs = (&reference, &pose);
            let answer = controller.step(log, &mut self.states, &self.outside, self.as_recorded, inputs)?;
            let Some((answer, command)) = answer else { continue };
            let written = log.commands.get(&(answer.0, answer.1)).map_or(&[][..], Vec::as_slice);
            let place = written.partition_point(|known| known.pose_tick < self.tick);
            if let Some(known) = written.get(place).filter(|known| known.pose_tick == self.tick) {
                self.parted.entry("command").or_default().compare_with(known, &command);
            }
            if self.outside.taken.contains(&answer) {
                self.commands.insert(answer, command);
            } else if !self.outside.sent.contains(&answer) {
                self.at_once.push(command);
            }
        }
        Ok(())
    }

    /// What the step generator takes in before the next tick; the ticks that are lost before it.
    fn take_in(&mut self) -> Result<u64, String> {
        let mut paused = 0;
        let stays = self.outside.ending.filter(|_| !self.arrived() && !self.program_drives);
        while let Some((_, event)) =
            self.outside.events.get(self.next_event).filter(|(at, _)| *at <= self.tick)
        {
            if stays == Some(self.next_event) {
                // It was stopped for having arrived.
                self.prolonged = true;
                self.next_event = self.outside.events.len();
                break;
            }
            self.next_event += 1;
            let generator = self.generator.as_mut().map(|(generator, _)| generator);
            match event {
                Event::Began(life) => {
                    self.generator = Some((begin(self.log, life, &self.states)?, life.slot));
                }
                Event::Authority(authority) => {
                    if authority.mode == Mode::Armed.code() {
                        self.lease = Some(*authority);
                        let in_charge = (authority.source, authority.epoch);
                        self.program_drives = self.outside.programs.contains(&in_charge);
                    }
                    let authority = Some(authority);
                    let inputs = StepInputs { authority, ..StepInputs::default() };
                    generator.into_iter().for_each(|generator| generator.take_in(self.tick, inputs));
                }
                Event::Comes(answer) => {
                    if let (Some(command), Some(generator)) = (self.commands.remove(answer), generator) {
                        offer(generator, self.tick, &command);
                    }
                }
                Event::Foreign(command) => {
                    generator.into_iter().for_each(|generator| offer(generator, self.tick, command));
                }
                Event::Pause(ticks) => paused += ticks,
                Event::System(number) => {
                    let limits = self.log.numbered(*number)?.limits;
                    generator.into_iter().for_each(|generator| generator.set_limits(limits));
                }
            }
        }
        self.prolonged |= self.tick >= self.log.end;
        let Some((generator, _)) = &mut self.generator else { return Ok(paused) };
        if let Some(lease) = self.lease.as_mut().filter(|_| self.prolonged) {
            lease.seq += 1;
            let inputs = StepInputs { authority: Some(lease), ..StepInputs::default() };
            generator.take_in(self.tick, inputs);
        }
        let mut rest = std::mem::take(&mut self.at_once);
        if self.prolonged {
            rest.extend(std::mem::take(&mut self.commands).into_values());
        }
        rest.iter().for_each(|command| offer(generator, self.tick, command));
        Ok(paused)
    }
}

fn offer(generator: &mut StepGenerator, tick: Tick, command: &Command) {
    let commands = std::slice::from_ref(command);
    generator.take_in(tick, StepInputs { commands, ..StepInputs::default() });
}
