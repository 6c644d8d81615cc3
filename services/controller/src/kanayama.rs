//! Kanayama's tracking law, paper 1 eq. (5), (7) (Kanayama, Kimura, Miyazaki, Noguchi, ICRA 1990).
//!
//! ```text
//!            y_e │  ● P_wk, heading θ_wk        v_c = v_r cos θ_e + k1 x_e
//!                │ /                            ω_c = ω_r + v_r (k2 y_e + k3 sin θ_e)
//!     robot  ────┼──────── x_e
//! ```
//!
//! The target pose is the current waypoint with the heading of the segment that ends in it (6), and
//! ω_r is 0. The paper's gains are for millimetres; here k2 is in 1/m² and k3 in 1/m, a factor 10⁶ and
//! 10³ larger.
//!
//! Departs from the paper in two points. With the waypoint straight behind, sin θ_e is 0 and v_c
//! negative, so the paper's robot would stand still for ever; ours turns left. And the paper has no
//! arcs: on one, the target is the place of the arc nearest to the robot, with ω_r = v_r/R.

use crate::{Built, ControlLaw, LawInputs, LawOutput, LawSetup, LawSpec};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::geometry::{BodyError, BodyTwist, WorldPose};
use hilare_interfaces::messages::Reference;
use hilare_interfaces::param_group;
use hilare_interfaces::params::ParamGroup;

param_group! {
    /// Gains; the defaults are the paper's point A (table 2).
    KanayamaGains {
        /// Gain on the along-track error, k1.
        k1_per_s: f64 = 0.0247, "1/s", 0.0, 5.0;
        /// Gain on the cross-track error, k2.
        k2_per_m2: f64 = 2.9671e6, "1/m^2", 0.0, 5e6;
        /// Gain on the heading error, k3.
        k3_per_m: f64 = 552.0, "1/m", 0.0, 5000.0;
    }
}

/// |sin θ_e| below which a waypoint behind is straight behind.
const HALF_TURN_TIE: f64 = 1e-6;

/// Its line in the registry.
pub const SPEC: LawSpec = LawSpec {
    name: "kanayama",
    title: "Kanayama's law on the current waypoint",
    source: "Kanayama et al. 1990; Mathew & Hiremath 2018, eq. 5, 7",
    chassis: &["differential"],
    acceptance: Acceptance::Rim,
    allocations: 0,
    keeps_limits: false,
    tunes_limits: true,
    params: KanayamaGains::SPECS,
    build,
};

fn build(setup: &LawSetup<'_>) -> Built {
    let mut gains = KanayamaGains::default();
    for (name, value) in setup.values {
        gains.set(name, *value).map_err(|error| (*name, error))?;
    }
    Ok(Box::new(Kanayama { gains }))
}

/// The law; it has no state.
#[derive(Clone, Copy, Debug)]
pub struct Kanayama {
    gains: KanayamaGains,
}

/// Target pose and ω_r.
fn target(reference: &Reference, pose: WorldPose) -> (WorldPose, f64) {
    let segment = reference.segment();
    if segment.is_line() {
        return (WorldPose::new(segment.to.x_m, segment.to.y_m, segment.heading_rad()), 0.0);
    }
    let station = segment.nearest(pose.position());
    let target = WorldPose::new(station.point.x_m, station.point.y_m, station.heading_rad);
    (target, reference.speed_mps * segment.curvature_per_m())
}

impl KanayamaGains {
    /// Forward speed and yaw rate for an error ahead and to the left, m, and sine and cosine of the heading
    /// error, at the reference's speed and yaw rate.
    #[inline]
    pub fn answer(
        &self,
        (x_e, y_e): (f64, f64),
        (sin, cos): (f64, f64),
        (v_r, omega_r): (f64, f64),
    ) -> (f64, f64) {
        let sin = if cos < 0.0 && sin.abs() < HALF_TURN_TIE { 1.0 } else { sin };
        // [MH18] (7)
        let vx_mps = v_r * cos + self.k1_per_s * x_e;
        let omega_radps = omega_r + v_r * (self.k2_per_m2 * y_e + self.k3_per_m * sin);
        (vx_mps, omega_radps)
    }
}

impl ControlLaw for Kanayama {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let reference = inputs.reference;
        let (target, omega_r) = target(reference, inputs.pose);
        let error = BodyError::between(inputs.pose, target);
        let heading_error = libm::sincos(error.theta_rad);
        let (vx_mps, omega_radps) =
            self.gains.answer((error.x_m, error.y_m), heading_error, (reference.speed_mps, omega_r));
        LawOutput::sound(BodyTwist::new(vx_mps, 0.0, omega_radps))
    }

    fn reset(&mut self) {}
}
