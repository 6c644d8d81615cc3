//! The navigation circle, paper 2 ([LM12]): lines and arcs, a PID on one angle.
//!
//! ```text
//!              ╭───╮                    H   cross-track error, positive to the left of the path
//!      R0 ── ╭─┤ ● │ ╲  robot, heading θ    β   direction of the path where it is nearest
//!            ╰─┼─┼─╯  ╲                 α   asin(H/R0): the way back, from the robot to where its
//!       ───────┼─┴──────●──▶ β              circle meets the path ahead, is β − α
//!                        aim            γ = θ − (β − α)   0 is: heads for that point
//! ```
//!
//! γ holds heading and position deviation at once; the wheels get V_L = V + u, V_R = V − u with u a PID
//! on γ, on top of what an arc asks for. As twist: v = V, ω = V/R − u/L.
//!
//! Where the paper is loose:
//!
//! * (4) has sin α = H/R0, (7) arctan for the same α, and outside the circle the former has no value.
//!   Here α = asin(clamp(H/R0, −1, 1)): from farther away than R0 the robot drives straight at the path.
//! * (5)–(7) measure β from the y axis with a sign that fails for half of all directions; here all angles
//!   are REP-103's and γ is wrapped to (−π, π]. (18) is the same γ with the tangent for β; the sign of
//!   the curvature serves both turning senses.
//! * The printed (11) has "K_P + [" for "K_P [". Its u is a speed; ours is V times a pure number, so that
//!   one K_P serves every speed and, with R0 in tracks, every size: near the path the robot moves on
//!   H'' + κ H' + κ/R0 H = 0 over the way s with κ = K_P/L: damping ½√(κ R0), 0.73 by default, which is
//!   the published one overshoot.
//! * The sum of (9) winds up. Ours adds only while |γ| is small, the circle reaches the path, and the twist
//!   is inside the limits; and it is bounded. It is kept over the end of a segment, since what it has
//!   learnt (unequal wheels, a wrong track) is the robot's and not the segment's.
//! * The difference of (10) jumps where a new segment begins. Ours is that of the measurement: both poses
//!   against the segment under way; and it is filtered, for poses come with noise.
//! * u0 is the arc's share, (19).
//!
//! T_S is the control period. That a command acts one period late is not made up for: within a period the
//! robot moves a thirtieth of R0 at most. Mecanum is driven as a unicycle, v_y = 0.

use crate::unicycle::half_track_m;
use crate::{Built, ControlLaw, LawInputs, LawOutput, LawSetup, LawSpec, TwistLimits};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::{BodyTwist, WorldPose, wrap_angle_rad};
use hilare_interfaces::param_group;
use hilare_interfaces::params::ParamGroup;
use hilare_interfaces::segment::Segment;
use hilare_interfaces::state::StateWords;

param_group! {
    /// Circle and PID.
    NavigationCircleParams {
        /// Radius of the navigation circle, R0, in tracks (2L; Mecanum: 2 (L1 + L2)).
        circle_tracks: f64 = 1.2, "", 0.1, 100.0;
        /// Share of V by which the wheels differ from it a radian of γ, K_P.
        proportional_per_rad: f64 = 0.9, "1/rad", 0.0, 100.0;
        /// Integral time, T_I.
        integral_s: f64 = 4.0, "s", 0.01, 1000.0;
        /// Derivative time, T_D.
        derivative_s: f64 = 0.05, "s", 0.0, 10.0;
        /// Time constant of the filter on the derivative.
        derivative_filter_s: f64 = 0.05, "s", 0.001, 10.0;
        /// |γ| above which nothing is added to the integral.
        integral_band_rad: f64 = 0.1, "rad", 0.0, 3.2;
        /// Greatest integral, as an angle that is added to γ.
        integral_max_rad: f64 = 0.1, "rad", 0.0, 3.2;
    }
}

/// Its line in the registry.
pub const SPEC: LawSpec = LawSpec {
    name: "navigation-circle",
    title: "lines and arcs by a PID on the angle to the navigation circle",
    source: "J. Mech. & Elec. Eng. 29 (2012) 730–732, eq. 3–20",
    chassis: &["differential", "mecanum"],
    acceptance: Acceptance::Passed,
    allocations: 0,
    keeps_limits: false,
    tunes_limits: false,
    params: NavigationCircleParams::SPECS,
    build,
};

fn build(setup: &LawSetup<'_>) -> Built {
    let mut params = NavigationCircleParams::default();
    for (name, value) in setup.values {
        params.set(name, *value).map_err(|error| (*name, error))?;
    }
    Ok(Box::new(NavigationCircle::new(setup, params)))
}

/// The law.
#[derive(Clone, Debug)]
pub struct NavigationCircle {
    params: NavigationCircleParams,
    chassis: Chassis,
    limits: TwistLimits,
    /// L.
    half_track_m: f64,
    /// R0.
    circle_m: f64,
    /// T_S.
    sample_s: f64,
    /// T_S/T_I Σ γ.
    integral_rad: f64,
    /// Filtered dγ/dt.
    slope_radps: f64,
    /// Pose of the sample before.
    before: Option<WorldPose>,
}

impl NavigationCircle {
    /// From the robot and checked parameters.
    pub fn new(setup: &LawSetup<'_>, params: NavigationCircleParams) -> Self {
        let half_track_m = half_track_m(setup.chassis);
        Self {
            params,
            chassis: *setup.chassis,
            limits: setup.limits,
            half_track_m,
            circle_m: params.circle_tracks * 2.0 * half_track_m,
            sample_s: setup.period_ticks as f64 * TICK_S,
            integral_rad: 0.0,
            slope_radps: 0.0,
            before: None,
        }
    }

    /// γ, positive if the robot heads too far to the left; and H/R0.
    fn deviation(&self, pose: WorldPose, segment: Segment) -> (f64, f64) {
        let station = segment.nearest(pose.position());
        // [LM12] (3), (14): H
        let share = station.cross_track_m / self.circle_m;
        // [LM12] (4), (15)
        let alpha = libm::asin(share.clamp(-1.0, 1.0));
        // [LM12] (6), (18)
        (wrap_angle_rad(pose.theta_rad - station.heading_rad + alpha), share)
    }

    /// The filtered derivative after one more sample.
    fn slope(&self, gamma: f64, segment: Segment) -> f64 {
        let Some(before) = self.before else { return 0.0 };
        // [LM12] (10)
        let slope = wrap_angle_rad(gamma - self.deviation(before, segment).0) / self.sample_s;
        let share = self.sample_s / (self.sample_s + self.params.derivative_filter_s);
        self.slope_radps + share * (slope - self.slope_radps)
    }

    /// The integral after one more sample.
    fn integral(&self, gamma: f64) -> f64 {
        // [LM12] (9)
        let sum = self.integral_rad + gamma * self.sample_s / self.params.integral_s;
        sum.clamp(-self.params.integral_max_rad, self.params.integral_max_rad)
    }

    fn is_inside_limits(&self, twist: BodyTwist) -> bool {
        twist.omega_radps.abs() <= self.limits.omega_max_radps && self.chassis.motor_use(twist) <= 1.0
    }
}

impl ControlLaw for NavigationCircle {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let (reference, segment) = (inputs.reference, inputs.reference.segment());
        let v = reference.speed_mps;
        let (gamma, share) = self.deviation(inputs.pose, segment);
        let (slope, integral) = (self.slope(gamma, segment), self.integral(gamma));
        // Half the sum of the wheels is V, their difference over 2L the yaw rate.
        let twist = |integral: f64| {
            // [LM12] (11), in shares of V
            let u = self.params.proportional_per_rad * (gamma + integral + self.params.derivative_s * slope);
            // [LM12] (13), (20)
            BodyTwist::new(v, 0.0, v * (segment.curvature_per_m() - u / self.half_track_m))
        };
        let learnt = twist(integral);
        if !learnt.is_finite() {
            // So that it is a matter of this sample alone.
            (self.slope_radps, self.before) = (0.0, None);
            return LawOutput::sound(BodyTwist::ZERO);
        }
        let learn =
            share.abs() < 1.0 && gamma.abs() < self.params.integral_band_rad && self.is_inside_limits(learnt);
        let twist = if learn { learnt } else { twist(self.integral_rad) };
        if learn {
            self.integral_rad = integral;
        }
        self.slope_radps = slope;
        self.before = Some(inputs.pose);
        LawOutput::sound(twist)
    }

    fn reset(&mut self) {
        self.integral_rad = 0.0;
        self.slope_radps = 0.0;
        self.before = None;
    }

    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.number(&mut self.integral_rad);
        words.require(self.integral_rad.abs() <= self.params.integral_max_rad);
        words.number(&mut self.slope_radps);
        // It is a mean of differences of wrapped angles.
        words.require(self.slope_radps.abs() <= (1.0 + 1e-9) * core::f64::consts::PI / self.sample_s);
        words.option(&mut self.before, WorldPose::default(), |pose, words| words.pose(pose));
    }
}

#[cfg(test)]
mod tests;
