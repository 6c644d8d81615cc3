//! The convex model of the cost about a plan (Gauss–Newton, majorised absolute values).
//!
//! Turning stage i a little more swings everything behind it about the stage's middle c_i:
//!
//! ```text
//!            ╭─● p        ∂p/∂k_i = ds_i · left(p − c_i)          (p behind stage i)
//!        c_i ●            ∂θ/∂k_i = ds_i
//!   ────────╯
//! ```
//!
//! * A piece costs z|e|: the quadratic ½ w e², w = z/√(e² + δ²), touches it from above, so a step
//!   that lowers the model lowers the cost (as far as e is linear in k).
//! * A switch at s* costs ∂J/∂s* = z (|e_before| − |e_after|): worth moving if the legs are
//!   unequally far. It moves with the point: δs* = ρ̂·δp / |ρ̂·t|, ρ̂ pointing out of the circle, t
//!   along the motion. Without this term the plan would not know that it may choose where to enter.
//! * Slowness is priced linearly, exactly as it costs.

use super::frame::{Track, Vector};
use super::rollout::{Grid, Plan, Rollout, STAGES};
use super::weights::Weights;

/// Entries of the upper triangle of the curvatures' Hessian, column by column.
pub const TRIANGLE: usize = STAGES * (STAGES + 1) / 2;
/// Least |ρ̂·t|: a circle entered at a glancing angle must not promise miracles.
const GLANCING: f64 = 0.3;
/// Pull towards the plan the model was made about, per travel.
const PROXIMAL: f64 = 1e-2;
/// The same for slowness; makes the optimum unique where the price is flat.
const PROXIMAL_SLOWNESS: f64 = 1e-3;

/// ½ kᵀHk + gᵀk over curvatures, ½ Σ h_j z_j² + Σ c_j z_j over slownesses.
#[derive(Clone, Debug)]
pub struct Model {
    /// H, upper triangle.
    pub hessian: Box<[f64; TRIANGLE]>,
    /// g.
    pub gradient: [f64; STAGES],
    /// h.
    pub slowness_hessian: [f64; STAGES],
    /// c.
    pub slowness_gradient: [f64; STAGES],
}

impl Model {
    /// All zero.
    pub fn new() -> Self {
        Self {
            hessian: Box::new([0.0; TRIANGLE]),
            gradient: [0.0; STAGES],
            slowness_hessian: [0.0; STAGES],
            slowness_gradient: [0.0; STAGES],
        }
    }

    /// The model about `plan`, whose motion is `rollout`.
    pub fn build(&mut self, plan: &Plan, rollout: &Rollout, grid: &Grid, track: &Track, weights: &Weights) {
        self.hessian.fill(0.0);
        self.gradient = [0.0; STAGES];
        for j in 0..STAGES {
            self.slowness_hessian[j] = PROXIMAL_SLOWNESS * grid.travel[j];
            self.slowness_gradient[j] =
                (weights.slow - PROXIMAL_SLOWNESS * plan.slowness[j]) * grid.travel[j];
        }
        let swing = Swing { rollout, grid };
        self.add_pieces(plan, &swing, track, weights);
        self.add_switches(plan, &swing, track, weights);
        self.add_end(&swing, track, weights);
        self.add_effort(plan, grid, weights);
        self.take_gradient_to_origin(plan);
    }

    fn add_pieces(&mut self, plan: &Plan, swing: &Swing<'_>, track: &Track, weights: &Weights) {
        for piece in swing.rollout.pieces() {
            let leg = &track.legs()[piece.leg];
            let middle = swing.rollout.middle(piece, plan, swing.grid, leg);
            let off = leg.cross_track(middle);
            let row = swing.of_point(piece.stage, piece.at, leg.normal_at(middle));
            let weight = piece.travel * plan.slowness[piece.stage] * weights.majorant(off);
            self.add(&row, piece.stage + 1, weight, off);
            self.slowness_gradient[piece.stage] += piece.travel * weights.size(off);
        }
    }

    fn add_switches(&mut self, plan: &Plan, swing: &Swing<'_>, track: &Track, weights: &Weights) {
        let rollout = swing.rollout;
        for switch in rollout.switches() {
            let legs = track.legs();
            let point = rollout.point(switch.stage, switch.at);
            let away = point.minus(legs[switch.before].end);
            let way = rollout.position[switch.stage + 1].minus(rollout.position[switch.stage]);
            let (radius, length) = (away.norm(), way.norm());
            if radius < 1e-9 || length < 1e-9 {
                continue;
            }
            let outward = Vector::new(away.x / radius, away.y / radius);
            let row = swing.of_point(switch.stage, switch.at, outward);
            if switch.excess > 0.0 {
                let weight = weights.miss / switch.excess.max(weights.knee);
                self.add(&row, switch.stage + 1, weight, switch.excess);
                continue;
            }
            let entry = (-outward.dot(way) / length).max(GLANCING);
            let gain = weights.size(legs[switch.before].cross_track(point))
                - weights.size(legs[switch.after].cross_track(point));
            let price = plan.slowness[switch.stage] * gain / entry;
            for (slope, gain) in self.gradient.iter_mut().zip(&row) {
                *slope += price * gain;
            }
        }
    }

    /// The end of the horizon stands for all that comes after.
    fn add_end(&mut self, swing: &Swing<'_>, track: &Track, weights: &Weights) {
        let rollout = swing.rollout;
        let leg = &track.legs()[rollout.last_leg];
        let (sin, cos) = libm::sincos(rollout.heading[STAGES]);
        let heading = Vector::new(cos, sin);
        let ahead = rollout.ahead(weights.ahead, leg);
        let off = leg.cross_track(ahead);
        let row = swing.of_end(ahead, leg.normal_at(ahead));
        self.add(&row, STAGES, weights.end_off * weights.majorant(off), off);
        // 1 − cos ψ = ½ (2 sin ψ/2)²: gradient sin ψ, Gauss–Newton Hessian cos² ψ/2.
        let tangent = leg.tangent_at(rollout.position[STAGES]);
        let (along, across) = (tangent.dot(heading), tangent.left().dot(heading));
        let curved = (0.5 * (1.0 + along)).max(0.1);
        self.add(&swing.grid.travel, STAGES, weights.end_heading * curved, across / curved);
    }

    fn add_effort(&mut self, plan: &Plan, grid: &Grid, weights: &Weights) {
        for j in 0..STAGES {
            self.hessian[entry(j, j)] += PROXIMAL * grid.travel[j];
            if j > 0 {
                let price = weights.smooth / grid.travel[j];
                let change = plan.curvature[j] - plan.curvature[j - 1];
                self.hessian[entry(j, j)] += price;
                self.hessian[entry(j - 1, j - 1)] += price;
                self.hessian[entry(j - 1, j)] -= price;
                self.gradient[j] += price * change;
                self.gradient[j - 1] -= price * change;
            }
        }
    }

    /// Adds ½ weight (residual + row·δk)², the row's first `len` entries.
    fn add(&mut self, row: &[f64; STAGES], len: usize, weight: f64, residual: f64) {
        for j in 0..len {
            let scaled = weight * row[j];
            self.gradient[j] += scaled * residual;
            let column = &mut self.hessian[entry(0, j)..=entry(j, j)];
            for (h, g) in column.iter_mut().zip(row) {
                *h += scaled * g;
            }
        }
    }

    /// Slope of the model at the plan it was made about, along curvature j.
    #[cfg(test)]
    pub fn slope(&self, plan: &Plan, j: usize) -> f64 {
        let h = |i: usize| self.hessian[if i <= j { entry(i, j) } else { entry(j, i) }];
        self.gradient[j] + (0..STAGES).map(|i| h(i) * plan.curvature[i]).sum::<f64>()
    }

    /// From steps δk to curvatures k: g ← g − H k.
    fn take_gradient_to_origin(&mut self, plan: &Plan) {
        for j in 0..STAGES {
            for i in 0..j {
                let h = self.hessian[entry(i, j)];
                self.gradient[i] -= h * plan.curvature[j];
                self.gradient[j] -= h * plan.curvature[i];
            }
            self.gradient[j] -= self.hessian[entry(j, j)] * plan.curvature[j];
        }
    }
}

impl Default for Model {
    fn default() -> Self {
        Self::new()
    }
}

/// Place of row i, column j (i ≤ j) in the triangle.
pub const fn entry(i: usize, j: usize) -> usize {
    j * (j + 1) / 2 + i
}

/// How points move with the curvatures.
struct Swing<'a> {
    rollout: &'a Rollout,
    grid: &'a Grid,
}

impl Swing<'_> {
    fn of_stage(&self, stage: usize, point: Vector, along: Vector) -> f64 {
        let middle = self.rollout.point(stage, 0.5);
        self.grid.travel[stage] * along.dot(point.minus(middle).left())
    }

    /// ∂(along · p)/∂k of a point of a stage; zero behind it.
    fn of_point(&self, stage: usize, at: f64, along: Vector) -> [f64; STAGES] {
        let mut row = [0.0; STAGES];
        let point = self.rollout.point(stage, at);
        for (i, gain) in row.iter_mut().enumerate().take(stage) {
            *gain = self.of_stage(i, point, along);
        }
        row[stage] = at * self.of_stage(stage, self.rollout.position[stage + 1], along);
        row
    }

    /// The same for a point that rides ahead of the end.
    fn of_end(&self, point: Vector, along: Vector) -> [f64; STAGES] {
        let mut row = [0.0; STAGES];
        for (i, gain) in row.iter_mut().enumerate() {
            *gain = self.of_stage(i, point, along);
        }
        row
    }
}
