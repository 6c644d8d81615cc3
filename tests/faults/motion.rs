//! Step generator, plant and pose estimator of the virtual rig, as their processes are.

use super::life::Life;
use super::memory::Memory;
use super::plan::{Line, Plan, Process};
use super::watch::Watch;
use super::wire::Link;
use hilare::config::System;
use hilare::shell::boxes::Reckoner;
use hilare::shell::checkpoint::key_of;
use hilare::shell::pairing::{Fixes, Pairing};
use hilare::shell::{ClockKind, build};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Command, Pose, PoseFix, Steps, Truth, Wheels};
use hilare_interfaces::wires;
use hilare_plant::Plant;
use hilare_pose_estimator::EstimatorInputs;
use hilare_step_generator::{StepGenerator, StepInputs};

/// Commands taken in at most in one tick.
const COMMANDS_PER_TICK: usize = 16;

/// The step generator, in real time's terms: with a lease, and with pauses.
pub struct Clock {
    /// Whether it is there.
    pub life: Life,
    /// From launch.
    pub authority: Link<Authority>,
    system: System,
    generator: StepGenerator,
    key: u64,
    /// Ticks lost since the last one.
    lost: Tick,
    /// A successor repeats what its predecessor said last.
    repeats: bool,
    kind: ClockKind,
}

impl Clock {
    /// At rest. In lockstep, time waits for commands; else it passes.
    pub fn new(system: &System, kind: ClockKind, plan: &Plan, seed: u64) -> Self {
        Self {
            life: Life::new(plan, Process::StepGenerator),
            authority: Link::new(&wires::AUTHORITY, Line::Authority, plan, seed),
            generator: build::step_generator(system, kind),
            kind,
            key: key_of("step_generator"),
            system: system.clone(),
            lost: 0,
            repeats: true,
        }
    }

    /// A successor: it stands still, disarmed, and knows what was counted.
    pub fn start(&mut self, now: Tick, memory: &mut Memory) {
        self.life.start(now);
        let build = |system: &System| build::step_generator(system, self.kind);
        (self.generator, _) = memory.resume(Process::StepGenerator, self.key, &self.system, build);
        self.authority.new_reader(now);
        (self.lost, self.repeats) = (0, true);
    }

    /// The machine took so many ticks away.
    pub fn lose(&mut self, ticks: Tick) {
        self.lost += ticks;
    }

    /// What is to be said before the first tick of a process.
    pub fn first_words(&mut self, now: Tick) -> Option<Steps> {
        (self.life.runs(now) && std::mem::take(&mut self.repeats)).then(|| *self.generator.state())
    }

    /// Executes a tick, if it runs: the state that follows, and whether it was sent.
    pub fn step<'c>(
        &mut self,
        now: Tick,
        commands: impl Iterator<Item = &'c mut Link<Command>>,
        watch: &mut Watch,
        memory: &mut Memory,
    ) -> Option<(Steps, bool)> {
        if !self.life.runs(now) {
            self.lost += u64::from(self.life.alive());
            return None;
        }
        let tick = self.generator.state().tick;
        while let Some(authority) = self.authority.next(now) {
            watch.told(tick, &authority);
            let inputs = StepInputs { authority: Some(&authority), ..StepInputs::default() };
            self.generator.take_in(tick, inputs);
        }
        let mut room = COMMANDS_PER_TICK;
        for link in commands {
            while let Some(command) = (room > 0).then(|| link.next(now)).flatten() {
                let inputs = StepInputs { commands: std::slice::from_ref(&command), ..StepInputs::default() };
                self.generator.take_in(tick, inputs);
                room -= 1;
            }
        }
        if self.kind == ClockKind::Lockstep && self.generator.awaits_command(tick) {
            return None;
        }
        let paused_ticks = std::mem::take(&mut self.lost);
        let steps = self.generator.step(tick, StepInputs { paused_ticks, ..StepInputs::default() });
        watch.tick(&steps);
        memory.remember(Process::StepGenerator, self.key, steps.tick, &mut self.generator);
        Some((steps, !self.life.strike_amid(now)))
    }
}

/// Where the robot thinks it is.
pub struct Estimator {
    /// Whether it is there.
    pub life: Life,
    /// From the step generator.
    pub steps: Link<Steps>,
    /// Of a robot that has them.
    pub sensors: Option<Sensors>,
    system: System,
    reckoner: Reckoner,
    repeats: bool,
    key: u64,
    done: Option<Tick>,
}

/// Encoders and camera.
pub struct Sensors {
    wheels: Link<Wheels>,
    fix: Link<PoseFix>,
    encoders: bool,
    pairing: Pairing<Steps, Wheels>,
    fixes: Fixes,
}

impl Estimator {
    /// At the start.
    pub fn new(system: &System, plan: &Plan, seed: u64) -> Self {
        let sensors = system.reads_sensors().then(|| Sensors {
            wheels: Link::new(&wires::WHEELS, Line::Wheels, plan, seed),
            fix: Link::new(&wires::FIX, Line::Fix, plan, seed),
            encoders: system.motors.has_encoders(),
            pairing: Pairing::default(),
            fixes: Fixes::default(),
        });
        Self {
            life: Life::new(plan, Process::PoseEstimator),
            steps: Link::new(&wires::STEPS, Line::StepsToEstimator, plan, seed),
            sensors,
            reckoner: Reckoner::new(system),
            repeats: false,
            key: key_of(system.estimator.name()),
            system: system.clone(),
            done: None,
        }
    }

    /// A successor.
    pub fn start(&mut self, now: Tick, memory: &mut Memory) {
        self.life.start(now);
        (self.reckoner, self.done) =
            memory.resume(Process::PoseEstimator, self.key, &self.system, Reckoner::new);
        self.repeats = self.done.is_some();
        self.steps.new_reader(now);
        if let Some(sensors) = &mut self.sensors {
            sensors.wheels.new_reader(now);
            sensors.fix.new_reader(now);
            (sensors.pairing, sensors.fixes) = (Pairing::default(), Fixes::default());
        }
    }

    /// The next tick of which everything has come.
    fn next(&mut self, now: Tick) -> Option<Pose> {
        let (steps_in, done) = (&mut self.steps, self.done);
        let new = |steps: &Steps| done.is_none_or(|done| steps.tick > done);
        let mut new_steps = || std::iter::from_fn(|| steps_in.next(now)).find(new);
        let Some(sensors) = &mut self.sensors else {
            let steps = new_steps()?;
            let inputs = EstimatorInputs { counts: &steps.counts, fixes: &[] };
            return Some(self.reckoner.step(steps.tick, inputs));
        };
        let Sensors { wheels, fix, encoders, pairing, fixes } = sensors;
        let (steps, wheels) = pairing.next(new_steps, || wheels.next(now))?;
        let counts = if *encoders { &wheels.counts } else { &steps.counts };
        let inputs = EstimatorInputs { counts, fixes: fixes.due(steps.tick, || fix.next(now)) };
        Some(self.reckoner.step(steps.tick, inputs))
    }

    /// Estimates what has come; `send` is what it says.
    pub fn step(&mut self, now: Tick, memory: &mut Memory, mut send: impl FnMut(&Pose)) {
        if !self.life.runs(now) {
            return;
        }
        if std::mem::take(&mut self.repeats) {
            self.reckoner.told().for_each(&mut send);
        }
        while let Some(pose) = self.next(now) {
            send(&pose);
            if self.life.strike_amid(now) {
                return;
            }
            self.done = Some(pose.tick);
            memory.remember(Process::PoseEstimator, self.key, pose.tick, &mut self.reckoner);
        }
    }
}

/// The simulated robot. Whoever kills it has no robot any more; it can stand still.
pub struct Wheelwork {
    life: Life,
    /// From the step generator.
    pub steps: Link<Steps>,
    plant: Plant,
    done: Option<Tick>,
    truth: Truth,
}

impl Wheelwork {
    /// At its start.
    pub fn new(system: &System, plan: &Plan, seed: u64) -> Self {
        Self {
            life: Life::new(plan, Process::Plant),
            steps: Link::new(&wires::STEPS, Line::StepsToPlant, plan, seed),
            plant: build::plant(system).expect("a simulated robot"),
            done: None,
            truth: Truth::ZERO,
        }
    }

    /// Where it is.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// Rolls, and shows what encoders and camera see of it.
    pub fn step(&mut self, now: Tick, sensors: Option<&mut Sensors>) {
        if !self.life.runs(now) {
            return;
        }
        let mut sensors = sensors;
        while let Some(steps) = self.steps.next(now) {
            if self.done.is_some_and(|done| steps.tick <= done) {
                continue;
            }
            self.done = Some(steps.tick);
            let observed = self.plant.step(steps.tick, &steps);
            self.truth = observed.truth;
            if let Some(sensors) = &mut sensors {
                if let Some(fix) = &observed.fix {
                    sensors.fix.send(now, fix);
                }
                sensors.wheels.send(now, &observed.wheels);
            }
        }
    }
}
