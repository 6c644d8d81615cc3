//! Control laws and their registry.
//!
//! A law turns a reference and a pose into a body velocity. Adding one is one file here and one line
//! in [`LAWS`]; its [`LawSpec`] feeds the command line, the system file reader and the tests.

pub mod kanayama;
pub mod qp;

use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::{BodyTwist, WorldPose};
use hilare_interfaces::messages::{Command, Pose, Reference, ReferenceState};
use hilare_interfaces::params::{ParamError, ParamSpec};

/// Every law that can be named.
pub const LAWS: &[LawSpec] = &[kanayama::SPEC, qp::SPEC];

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

/// What a law is built from.
#[derive(Clone, Copy, Debug)]
pub struct LawSetup<'a> {
    /// The robot.
    pub chassis: &'a Chassis,
    /// What the step generator lets through.
    pub limits: TwistLimits,
    /// Distance at which the selector accepts a waypoint, d_T, m.
    pub acceptance_radius_m: f64,
    /// It accepts there only once the next line is as near as the current one.
    pub accept_at_bisector: bool,
    /// Ticks from one command to the next, and from a pose to the command it leads to.
    pub period_ticks: u64,
    /// Parameter values by name; what is missing has its default.
    pub values: &'a [(&'static str, f64)],
}

/// What a law sees: the reference is under way (`Tracking`).
#[derive(Clone, Copy, Debug)]
pub struct LawInputs<'a> {
    /// Estimated pose.
    pub pose: WorldPose,
    /// What to track.
    pub reference: &'a Reference,
    /// What this controller commanded last: it acts until the command of this step does.
    pub acting: BodyTwist,
}

/// What a law answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawOutput {
    /// Wanted twist, before the input constraints of the step generator.
    pub twist: BodyTwist,
    /// True if the law had to fall back on something lesser.
    pub degraded: bool,
}

/// A control law: called once a control period; total, without clock or allocation.
pub trait ControlLaw: Send {
    /// The twist for one control period.
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput;

    /// Forgets everything learnt since it was built.
    fn reset(&mut self);
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

/// The box: a law with an identity, stamping its commands.
pub struct Controller {
    law: Box<dyn ControlLaw>,
    identity: Identity,
    period_ticks: u64,
    seq: u64,
    path_id: u64,
    acting: BodyTwist,
}

impl Controller {
    /// A controller whose commands act `period_ticks` after their pose.
    pub fn new(law: Box<dyn ControlLaw>, identity: Identity, period_ticks: u64) -> Self {
        Self { law, identity, period_ticks, seq: 0, path_id: 0, acting: BodyTwist::ZERO }
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
        let output = if reference.state == ReferenceState::Tracking.code() {
            self.law.step(LawInputs { pose: inputs.pose.pose(), reference, acting: self.acting })
        } else {
            LawOutput { twist: BodyTwist::ZERO, degraded: false }
        };
        self.acting = output.twist;
        self.seq += 1;
        Command {
            source: self.identity.source,
            epoch: self.identity.epoch,
            seq: self.seq,
            pose_tick: tick,
            effective_tick: tick + self.period_ticks,
            vx_mps: output.twist.vx_mps,
            vy_mps: output.twist.vy_mps,
            omega_radps: output.twist.omega_radps,
            degraded: u64::from(output.degraded),
        }
    }
}

#[cfg(test)]
mod tests;
