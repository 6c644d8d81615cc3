//! The Stanley law (Hoffmann, Tomlin, Montemerlo, Thrun, ACC 2007), for robots without a front axle.
//!
//! ```text
//!                     path, direction β_f          δ = ψ_e + atan(k e/(k_s + v))
//!        ──────────────────●──────▶                ψ_e = β_f − θ
//!                          │ e                     e    of the front wheel, positive: path to its left
//!           b    ╱╱ δ      │
//!    ●━━━━━━━━━━╱╱─────────┘                       ω = v tan δ / b
//!  midpoint    virtual front wheel
//! ```
//!
//! Hoffmann's car steers its front wheels; this one has a virtual front wheel, b ahead of the midpoint of
//! its axle, and drives what a bicycle of that wheelbase would.
//!
//! Departs from the paper in this:
//!
//! * v is the midpoint's speed, not the front wheel's, so ω = v tan δ / b where the paper has v sin δ / b;
//!   and δ ends at a parameter, not at a mechanical stop.
//! * On an arc of radius R the front wheel of a robot whose midpoint is on the path runs on the concentric
//!   arc √(R² + b²), with δ = atan(b/R). So e is measured from that one: no error gives ω = v/R, where the
//!   paper's car cuts the bend by b²/2R.
//! * The terms for tyres and servo (yaw damping, steering lag) are left out: ω is commanded itself.
//! * Where the bend asks for more than the highest yaw rate, the robot slows down.

use crate::unicycle::{bend, half_track_m};
use crate::{Built, ControlLaw, LawInputs, LawOutput, LawSetup, LawSpec, TwistLimits};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::geometry::{WorldPoint, WorldPose, wrap_angle_rad};
use hilare_interfaces::param_group;
use hilare_interfaces::params::ParamGroup;
use hilare_interfaces::segment::Segment;

param_group! {
    /// Gains and the virtual front wheel.
    StanleyParams {
        /// Gain on the cross-track error, k.
        gain_per_s: f64 = 2.0, "1/s", 0.0, 100.0;
        /// What is added to the speed that the error is divided by, k_s.
        soft_speed_mps: f64 = 0.01, "m/s", 0.0001, 10.0;
        /// Virtual wheelbase b, in tracks (2L; Mecanum: 2 (L1 + L2)).
        wheelbase_tracks: f64 = 0.6, "", 0.05, 20.0;
        /// Greatest steering angle δ.
        steer_max_rad: f64 = 1.2, "rad", 0.01, 1.55;
    }
}

/// Its line in the registry.
pub const SPEC: LawSpec = LawSpec {
    name: "stanley",
    title: "heading and cross-track error of a virtual front wheel",
    source: "Hoffmann et al. 2007, ACC, Stanley's steering law",
    chassis: &["differential", "mecanum"],
    acceptance: Acceptance::Passed,
    allocations: 0,
    keeps_limits: false,
    tunes_limits: false,
    params: StanleyParams::SPECS,
    build,
};

fn build(setup: &LawSetup<'_>) -> Built {
    let mut params = StanleyParams::default();
    for (name, value) in setup.values {
        params.set(name, *value).map_err(|error| (*name, error))?;
    }
    let wheelbase_m = params.wheelbase_tracks * 2.0 * half_track_m(setup.chassis);
    Ok(Box::new(Stanley { params, limits: setup.limits, wheelbase_m }))
}

/// The law; it has no state.
#[derive(Clone, Copy, Debug)]
pub struct Stanley {
    params: StanleyParams,
    limits: TwistLimits,
    /// b.
    wheelbase_m: f64,
}

impl Stanley {
    /// ψ_e, and e in the paper's sense: positive if the path is to the left.
    fn errors(&self, pose: WorldPose, segment: Segment) -> (f64, f64) {
        let b = self.wheelbase_m;
        let (sin, cos) = libm::sincos(pose.theta_rad);
        let station = segment.nearest(WorldPoint::new(pose.x_m + b * cos, pose.y_m + b * sin));
        let curvature = segment.curvature_per_m();
        // √(R² + b²) − R, written so that it does not divide by a small curvature; outside is to the
        // right of an arc to the left.
        let bend = curvature * b;
        let outside = bend * b / (1.0 + libm::sqrt(1.0 + bend * bend));
        (wrap_angle_rad(station.heading_rad - pose.theta_rad), -station.cross_track_m - outside)
    }
}

impl ControlLaw for Stanley {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let v = inputs.reference.speed_mps;
        let (psi, e) = self.errors(inputs.pose, inputs.reference.segment());
        let max = self.params.steer_max_rad;
        let steer = psi + libm::atan(self.params.gain_per_s * e / (self.params.soft_speed_mps + v.abs()));
        let delta = steer.clamp(-max, max);
        LawOutput::sound(bend(v, libm::tan(delta) / self.wheelbase_m, &self.limits))
    }

    fn reset(&mut self) {}
}

#[cfg(test)]
mod tests;
