//! The step generator: one call is one tick of the robot.
//!
//! Commands in, steps out, at 1 kHz. A tick (1) takes in what arrived, (2) decides which command
//! acts ([`authority`]), without a jump where another controller's begins to ([`handover`]), (3) puts it
//! inside the input constraints ([`limits`], paper 1 eq. 9–24; nothing reaches the wheels around
//! them), (4) turns it into pulses ([`pulses`], eq. 25–29).
#![no_std]

#[cfg(test)]
extern crate std;

pub mod authority;
pub mod candidate;
pub mod handover;
pub mod limits;
pub mod pulses;
pub mod whole;

use authority::{Gate, GateParams};
use handover::Handover;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Command, Drive, Steps};
use hilare_interfaces::motors::Motors;
use hilare_interfaces::state::{StateWords, Stateful};
use limits::Limits;
use pulses::PulseTrain;

/// No counter gets as far: a state that says so is not one.
const COUNTED_MAX: u64 = 1 << 60;

/// What a tick reads: what arrived since the last one.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepInputs<'a> {
    /// Newest authority, if one arrived.
    pub authority: Option<&'a Authority>,
    /// Commands that arrived, in order.
    pub commands: &'a [Command],
    /// Whole ticks the clock lost before this one (a pause), 0 normally.
    pub paused_ticks: u64,
}

/// The box.
#[derive(Clone, Debug)]
pub struct StepGenerator {
    chassis: Chassis,
    limits: Limits,
    gate: Gate,
    pulses: PulseTrain,
    handover: Handover,
    /// What is carried out.
    twist: BodyTwist,
    state: Steps,
}

impl StepGenerator {
    /// A step generator at rest, disarmed, having counted no step.
    pub fn new(chassis: Chassis, motors: Motors, limits: Limits, gate: GateParams) -> Self {
        let pulses = PulseTrain::new(&motors, &chassis);
        Self {
            chassis,
            limits,
            gate: Gate::new(gate),
            handover: Handover::new(&chassis, &limits),
            twist: BodyTwist::ZERO,
            state: Steps { dir_level: pulses.dir_levels(), ..Steps::ZERO },
            pulses,
        }
    }

    /// Other limits from the next tick on. What acts goes on; it is put inside them.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
        self.handover.constrain_anew(&self.chassis, &limits);
    }

    /// The state after the last tick; before the first, all zero but the levels of DIR.
    pub fn state(&self) -> &Steps {
        &self.state
    }

    /// True when the tick to come opens a control cycle whose command has not arrived yet: what
    /// the lockstep clock waits for.
    pub fn awaits_command(&self, tick: Tick) -> bool {
        self.gate.awaits_command(tick)
    }

    /// Takes in authority and commands without spending a tick.
    pub fn take_in(&mut self, tick: Tick, inputs: StepInputs<'_>) {
        if let Some(authority) = inputs.authority {
            self.gate.set_authority(tick, authority);
        }
        for command in inputs.commands {
            self.gate.offer(tick, command);
        }
    }

    /// What is carried out in this tick, and why.
    fn next_twist(&mut self, tick: Tick) -> (BodyTwist, Drive) {
        let decision = self.gate.decide(tick);
        let twist = match decision.drive {
            Drive::Command | Drive::Hold => {
                let beside = || self.gate.beside();
                let target = self.handover.target(&decision, beside, &self.chassis, &self.limits);
                return (self.limits.ramp_to(self.twist, target), decision.drive);
            }
            Drive::EStop | Drive::Disarmed => BodyTwist::ZERO,
            Drive::Ramp | Drive::Stop | Drive::LeaseLost | Drive::PauseStop => {
                self.limits.ramp_down(self.twist)
            }
        };
        self.handover.interrupt(twist);
        (twist, decision.drive)
    }

    /// Executes the tick after `tick` ticks have been executed; [`Self::state`] then carries
    /// `tick + 1`.
    #[inline]
    pub fn advance(&mut self, tick: Tick, inputs: StepInputs<'_>) {
        self.take_in(tick, inputs);
        if inputs.paused_ticks > 0 {
            self.gate.note_pause(inputs.paused_ticks);
            self.state.ticks_late += 1;
            self.state.paused_ticks += inputs.paused_ticks;
            self.state.paused_max_ticks = self.state.paused_max_ticks.max(inputs.paused_ticks);
        }
        let (twist, drive) = self.next_twist(tick);
        // Wheel speeds change a few hundred times a second at most, pulses a thousand times.
        if twist != self.twist {
            self.twist = twist;
            self.state.twist = [twist.vx_mps, twist.vy_mps, twist.omega_radps];
            self.state.wheel_speed_radps = self.pulses.set_speeds(self.chassis.wheel_speeds(twist));
        }
        self.pulses.tick();
        self.state.tick = tick + 1;
        self.state.counts = self.pulses.counts();
        self.state.dir_level = self.pulses.dir_levels();
        self.state.drive = drive.code();
        self.gate.report(&mut self.state);
    }
}

impl Block for StepGenerator {
    type Inputs<'a> = StepInputs<'a>;
    type Output = Steps;

    fn step(&mut self, tick: Tick, inputs: StepInputs<'_>) -> Steps {
        self.advance(tick, inputs);
        self.state
    }
}

/// Where the wheels are and what has been counted. A successor stands still and is disarmed: it does not
/// know what happened since.
impl Stateful for StepGenerator {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        let state = &mut self.state;
        let counters =
            [&mut state.tick, &mut state.ticks_late, &mut state.paused_ticks, &mut state.paused_max_ticks];
        counters.into_iter().for_each(|counter| words.count(counter, COUNTED_MAX));
        self.pulses.visit_state(words);
        self.gate.visit_state(words);
        if words.is_loading() {
            self.state.counts = self.pulses.counts();
            self.state.dir_level = self.pulses.dir_levels();
            self.gate.report(&mut self.state);
        }
    }
}

#[cfg(test)]
mod tests;
