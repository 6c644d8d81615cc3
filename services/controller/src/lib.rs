//! Control laws and their registry.
//!
//! A law turns a reference and a pose into a body velocity. Adding one is one file here and one line
//! in [`LAWS`]; its [`LawSpec`] feeds the command line, the system file reader and the tests.

pub mod finite_step;
mod in_place;
pub mod kanayama;
pub mod navigation_circle;
pub mod prediction;
pub mod pure_pursuit;
pub mod qp;
pub mod stanley;
mod unicycle;

use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::{BodyTwist, WorldPose};
use hilare_interfaces::messages::{Command, Fallback, Pose, Reference, ReferenceState};
use hilare_interfaces::params::{ParamError, ParamSpec};
use hilare_interfaces::state::{StateWords, Stateful};
use prediction::Prediction;

/// Every law that can be named.
pub const LAWS: &[LawSpec] = &[
    kanayama::SPEC,
    navigation_circle::SPEC,
    pure_pursuit::SPEC,
    stanley::SPEC,
    finite_step::SPEC,
    qp::SPEC,
];

/// The law of a name.
pub fn law(name: &str) -> Option<&'static LawSpec> {
    LAWS.iter().find(|law| law.name == name)
}

/// Builds a law, or says which parameter is wrong and why.
pub type BuildLaw = fn(&LawSetup<'_>) -> Built;

/// A law, or the parameter that was refused and why.
pub type Built = Result<Box<dyn ControlLaw>, (&'static str, ParamError)>;

/// What is to be known of a law before it runs.
#[derive(Clone, Copy)]
pub struct LawSpec {
    /// Name on the command line and in system files.
    pub name: &'static str,
    /// One line for people.
    pub title: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// Chassis it can drive ([`Chassis::name`]).
    pub chassis: &'static [&'static str],
    /// The rule of the waypoint selector it is made for; a system file may ask for another.
    pub acceptance: Acceptance,
    /// Most allocations of one step.
    pub allocations: u64,
    /// Its twists are inside the limits and the motor diamond before the step generator sees them.
    pub keeps_limits: bool,
    /// Its paper tunes the limits v_max and ω_max along with the parameters.
    pub tunes_limits: bool,
    /// Its parameters.
    pub params: &'static [ParamSpec],
    /// Builds it.
    pub build: BuildLaw,
}

/// The input constraints a twist meets in the step generator; the motor diamond is the chassis's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistLimits {
    /// Least speed along x, v_min.
    pub v_min_mps: f64,
    /// Greatest linear speed, v_max.
    pub v_max_mps: f64,
    /// Greatest yaw rate, ω_max.
    pub omega_max_radps: f64,
}

impl TwistLimits {
    /// What the step generator makes of `twist`, the least yaw rate aside.
    fn carried_out(&self, chassis: &Chassis, twist: BodyTwist) -> BodyTwist {
        let omega = twist.omega_radps.max(-self.omega_max_radps).min(self.omega_max_radps);
        let cut = if chassis.is_omnidirectional() {
            let shorten = (self.v_max_mps / libm::hypot(twist.vx_mps, twist.vy_mps)).min(1.0);
            BodyTwist::new(twist.vx_mps * shorten, twist.vy_mps * shorten, omega)
        } else {
            BodyTwist::new(twist.vx_mps.max(self.v_min_mps).min(self.v_max_mps), 0.0, omega)
        };
        cut.scaled(1.0 / chassis.motor_use(cut).max(1.0))
    }
}

/// What a law is built from.
#[derive(Clone, Copy, Debug)]
pub struct LawSetup<'a> {
    /// The robot.
    pub chassis: &'a Chassis,
    /// What the step generator lets through.
    pub limits: TwistLimits,
    /// Distance at which the selector accepts a waypoint, d_T, m.
    pub acceptance_radius_m: f64,
    /// Where within that distance it accepts.
    pub acceptance: Acceptance,
    /// Ticks from one command to the next, and from a pose to the command it leads to.
    pub period_ticks: u64,
    /// Parameter values by name; what is missing has its default.
    pub values: &'a [(&'static str, f64)],
}

/// What a law sees: the reference is under way (`Tracking`).
///
/// Where the current segment has a crab angle, pose and twists are those of the *course frame*: the
/// robot's frame turned by that angle, so that its x axis is the wanted direction of travel. A law that
/// drives forwards along a path thus drives sideways along it without knowing. Laws that look beyond
/// the current segment find the crab angles of the coming ones in the reference.
#[derive(Clone, Copy, Debug)]
pub struct LawInputs<'a> {
    /// Estimated pose, moved on to the present where it came late ([`prediction`]); in the course frame.
    pub pose: WorldPose,
    /// What to track.
    pub reference: &'a Reference,
    /// What this controller commanded last: it acts until the command of this step does. In the course
    /// frame.
    pub acting: BodyTwist,
}

/// What a law answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawOutput {
    /// Wanted twist, before the input constraints of the step generator; in the course frame.
    pub twist: BodyTwist,
    /// What it had to do without.
    pub fallback: Fallback,
}

impl LawOutput {
    /// A twist the law fully stands by.
    pub const fn sound(twist: BodyTwist) -> Self {
        Self { twist, fallback: Fallback::None }
    }
}

/// A control law: called once a control period, with a reference and a pose that make sense
/// ([`hilare_interfaces::messages::sense`]) and any finite twist in action. Without clock or allocation; it
/// always comes to an end, and never panics. An answer that is not finite counts as none.
pub trait ControlLaw: Send {
    /// The twist for one control period.
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput;

    /// Forgets everything learnt since it was built.
    fn reset(&mut self);

    /// Shows what it remembers, as [`Stateful::visit_state`]: all that a later answer hangs on and that is no
    /// parameter. A law without memory has nothing to show.
    fn visit_state(&mut self, _words: &mut StateWords<'_>) {}
}

/// Who a controller process is, from launch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Its source number, from 1.
    pub source: u64,
    /// The epoch it was started under.
    pub epoch: u64,
}

/// What a step reads: reference and pose of the same tick.
#[derive(Clone, Copy, Debug)]
pub struct ControllerInputs<'a> {
    /// What to track.
    pub reference: &'a Reference,
    /// Estimated pose at `reference.tick`.
    pub pose: &'a Pose,
}

/// The step generator refuses it: the same as if none had come, and said so.
const NO_COMMAND: BodyTwist = BodyTwist::new(f64::NAN, f64::NAN, f64::NAN);

/// The box: a law with an identity, stamping its commands.
pub struct Controller {
    law: Box<dyn ControlLaw>,
    identity: Identity,
    period_ticks: u64,
    seq: u64,
    path_id: u64,
    acting: BodyTwist,
    prediction: Prediction,
}

impl Controller {
    /// A controller whose commands act `period_ticks` after their pose, for a robot that stands.
    pub fn new(
        law: Box<dyn ControlLaw>,
        identity: Identity,
        period_ticks: u64,
        prediction: Prediction,
    ) -> Self {
        Self { law, identity, period_ticks, seq: 0, path_id: 0, acting: BodyTwist::ZERO, prediction }
    }

    /// Goes on where `before` is, a controller of the same law and identity with other parameters. False if the
    /// law could not make its own what the other one remembers (a plan on another grid): then it begins anew, as
    /// with every new path. `room` is for the state of a controller. Allocates nothing.
    pub fn take_over(&mut self, before: &mut Self, room: &mut [u64]) -> bool {
        (self.seq, self.path_id, self.acting) = (before.seq, before.path_id, before.acting);
        self.prediction.take_over(&before.prediction);
        let mut words = StateWords::saving(room);
        before.law.visit_state(&mut words);
        let taken = words.finish().is_some_and(|len| {
            let mut words = StateWords::loading(&room[..len]);
            self.law.visit_state(&mut words);
            words.finish().is_some()
        });
        if !taken {
            self.law.reset();
        }
        taken
    }

    /// Number of the last command.
    pub const fn number(&self) -> u64 {
        self.seq
    }

    /// Numbers commands as one whose last had this number.
    pub const fn number_on(&mut self, last: u64) {
        self.seq = last;
    }

    /// The law's answer, in the robot's own frame.
    fn ask(&mut self, pose: WorldPose, reference: &Reference) -> LawOutput {
        let crab_rad = reference.current.crab_rad;
        if crab_rad == 0.0 {
            return self.law.step(LawInputs { pose, reference, acting: self.acting });
        }
        let course = WorldPose::new(pose.x_m, pose.y_m, pose.theta_rad + crab_rad);
        let acting = self.acting.turned(-crab_rad);
        let output = self.law.step(LawInputs { pose: course, reference, acting });
        LawOutput { twist: output.twist.turned(crab_rad), ..output }
    }

    /// What the law makes of reference and pose; nothing if they, or what it makes of them, make no sense.
    fn answer(&mut self, tick: Tick, inputs: ControllerInputs<'_>) -> Option<LawOutput> {
        let present = self.prediction.present(inputs.pose, tick);
        if !(inputs.reference.makes_sense() && inputs.pose.makes_sense() && present.makes_sense()) {
            return None;
        }
        let output = self.ask(present, inputs.reference);
        if output.twist.is_finite() {
            return Some(output);
        }
        // It may have learnt what it could not answer, or what acts may be why.
        self.law.reset();
        self.acting = BodyTwist::ZERO;
        None
    }
}

impl Block for Controller {
    type Inputs<'a> = ControllerInputs<'a>;
    type Output = Command;

    fn step(&mut self, tick: Tick, inputs: ControllerInputs<'_>) -> Command {
        let reference = inputs.reference;
        if reference.path_id != self.path_id {
            self.path_id = reference.path_id;
            self.law.reset();
        }
        let acted = self.acting;
        let output = if reference.state == ReferenceState::Tracking.code() {
            self.answer(tick, inputs)
        } else {
            Some(LawOutput::sound(BodyTwist::ZERO))
        };
        // What was commanded last acts until this command does.
        self.prediction.note(acted);
        // A command that is none leaves in force what acts.
        self.acting = output.map_or(self.acting, |output| output.twist);
        let LawOutput { twist, fallback } =
            output.unwrap_or(LawOutput { twist: NO_COMMAND, fallback: Fallback::NoSense });
        self.seq = self.seq.wrapping_add(1);
        Command {
            source: self.identity.source,
            epoch: self.identity.epoch,
            seq: self.seq,
            pose_tick: tick,
            effective_tick: tick.saturating_add(self.period_ticks),
            vx_mps: twist.vx_mps,
            vy_mps: twist.vy_mps,
            omega_radps: twist.omega_radps,
            fallback: fallback.code(),
        }
    }
}

impl Stateful for Controller {
    /// Identity and number of the last command are the process's own. A controller that takes on another
    /// one's state goes on with the next tick's reference and pose as that one would have.
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.path_id);
        words.twist(&mut self.acting);
        self.prediction.visit_state(words);
        self.law.visit_state(words);
    }
}

#[cfg(test)]
mod cart;
#[cfg(test)]
mod contract;
