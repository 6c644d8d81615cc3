//! What a plan is judged by.

use super::QpParams;
use super::frame::Scale;
use super::rollout::{Grid, Plan, STAGES};

/// Distance ahead of the horizon's end at which the plan is measured once more, turn radii.
const AHEAD: f64 = 0.75;
/// Price of a waypoint missed by one turn radius: above all a plan could gain by missing it.
const MISS: f64 = 30.0;

/// Prices of a plan as pure numbers (lengths in turn radii).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Below this a cross-track error counts quadratically, above it by its size, δ.
    pub knee: f64,
    /// Price of standing still, λ v_r.
    pub slow: f64,
    /// The point ahead of the horizon's end at which it is measured once more.
    pub ahead: f64,
    /// Weight of that measurement.
    pub end_off: f64,
    /// Price of heading away from the line at the end of the horizon.
    pub end_heading: f64,
    /// Price of passing a waypoint outside its circle.
    pub miss: f64,
    /// Price of a change of curvature.
    pub smooth: f64,
}

impl Weights {
    /// From the parameters.
    pub fn new(params: &QpParams, scale: &Scale) -> Self {
        Self {
            knee: params.knee_m / scale.radius_m,
            slow: params.speed_price_s * scale.omega_radps,
            ahead: AHEAD,
            end_off: params.end_off,
            end_heading: params.end_heading,
            miss: MISS,
            smooth: params.smooth,
        }
    }

    /// √(e² + δ²) − δ: |e| with a round tip, so that its derivatives exist.
    pub fn size(&self, off: f64) -> f64 {
        libm::sqrt(off * off + self.knee * self.knee) - self.knee
    }

    /// The weight w for which ½ w e² touches [`size`](Self::size) at `off` and lies above it elsewhere.
    pub fn majorant(&self, off: f64) -> f64 {
        1.0 / libm::sqrt(off * off + self.knee * self.knee)
    }

    /// ½ smooth Σ (k_{j+1} − k_j)²/ds.
    pub fn effort(&self, plan: &Plan, grid: &Grid) -> f64 {
        let mut sum = 0.0;
        for j in 1..STAGES {
            let change = plan.curvature[j] - plan.curvature[j - 1];
            sum += change * change / grid.travel[j];
        }
        0.5 * self.smooth * sum
    }
}
