//! The plan where no finite-step plan keeps the bounds: the same model and the same ends, the bounds hard.
//!
//! ```text
//!   v_x │      ╱‾‾‾‾‾╲         hi(k) = min( v_xmax, v_now + a T (k+1), a T (N−k) )
//!       │    ╱╱ plan  ╲╲       Σ gain(k) v_x(k) = e_d(0) + Σ drift(k)        (19)
//!   now ●──╱            ╲──    |v_x(k+1) − v_x(k)| ≤ a T
//!       └────────────────── k  least ½ Σ v_x²                                (6)
//! ```
//!
//! Every v_x that keeps the bounds lies between the envelopes lo and hi, both keep them themselves, and
//! all gains are positive. So the ends can be met if and only if the way lies between what the envelopes
//! make good (exact, no solver asked), a mean of the two meets them, and where they cannot be met the
//! nearer envelope is the plan that comes nearest. The least effort in between is a QP: clarabel, one
//! set-up, updates in place. A v_x in action that is outside its bounds is brought back as fast as
//! the jumps allow.
//!
//! With e_θ falling as (16) over all N steps the drift alone asks for v_τ e_θ/2 in the mean; where that
//! is too much the turn is finished sooner ([`Search`]), which leaves less to make good.

use super::plan::{Bounds, Deviation, Model, STEPS_CAP, Turn};
use crate::in_place;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSolver, NonnegativeConeT, SolverStatus, SupportedConeT, ZeroConeT};

/// Gap and feasibility at which the solver stops; the problem's numbers are near 1.
const TOLERANCE: f64 = 1e-10;
/// A bound on numbers of size 1 that never binds.
const LOOSE: f64 = 4.0;

/// One value a step.
pub type PerStep = [f64; STEPS_CAP];

/// What is to be solved: v_x of N steps along a turn.
#[derive(Clone, Copy, Debug)]
pub struct Problem {
    /// N.
    pub steps: usize,
    /// The fall of e_θ.
    pub turn: Turn,
    /// What v_x has to make good, m: e_d(0) + Σ T v_τ e_θ(k).
    pub way_m: f64,
    gain_s: PerStep,
    lo: PerStep,
    hi: PerStep,
    /// What the envelopes make good, m.
    reach_m: (f64, f64),
    jump_mps: f64,
}

impl Problem {
    /// The problem of `steps` (1 to [`STEPS_CAP`]).
    pub fn new(model: &Model, start: Deviation, bounds: &Bounds, turn: Turn, steps: usize) -> Self {
        let steps = steps.clamp(1, STEPS_CAP);
        let (jump, first, now) = (bounds.jump_mps, bounds.first_jump_mps, bounds.now_mps);
        let (mut gain_s, mut lo, mut hi) = ([0.0; STEPS_CAP], [0.0; STEPS_CAP], [0.0; STEPS_CAP]);
        let mut way_m = start.distance_m;
        let mut reach_m = (0.0, 0.0);
        for k in 0..steps {
            let e = turn.heading_rad(k);
            way_m += model.drift_m(e);
            gain_s[k] = model.gain_s(e);
            let since = first + k as f64 * jump;
            let most = bounds.speed_mps.min((steps - k) as f64 * jump);
            hi[k] = most.min(now + since).max(now - since);
            lo[k] = (-most).max(now - since).min(now + since);
            reach_m.0 += gain_s[k] * lo[k];
            reach_m.1 += gain_s[k] * hi[k];
        }
        Self { steps, turn, way_m, gain_s, lo, hi, reach_m, jump_mps: jump }
    }

    /// True if both deviations can end at zero.
    pub fn can_land(&self) -> bool {
        (self.reach_m.0..=self.reach_m.1).contains(&self.way_m)
    }

    /// The mean of the envelopes that lands, or the envelope that comes nearest.
    pub fn between(&self) -> PerStep {
        let room = self.reach_m.1 - self.reach_m.0;
        let share = if room > 0.0 { ((self.way_m - self.reach_m.0) / room).clamp(0.0, 1.0) } else { 0.5 };
        core::array::from_fn(|k| self.lo[k] + share * (self.hi[k] - self.lo[k]))
    }

    /// As seen in a mirror.
    fn mirrored(mut self) -> Self {
        for k in 0..self.steps {
            (self.lo[k], self.hi[k]) = (-self.hi[k], -self.lo[k]);
        }
        self.way_m = -self.way_m;
        self.reach_m = (-self.reach_m.1, -self.reach_m.0);
        self
    }

    /// Largest |v_x| possible.
    fn scale_mps(&self) -> f64 {
        (0..self.steps).fold(f64::MIN_POSITIVE, |top, k| top.max(self.lo[k].abs()).max(self.hi[k].abs()))
    }
}

/// How N and the turn are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Fewest steps.
    pub least: usize,
    /// Most steps.
    pub most: usize,
    /// Steps of the turn where the way back cannot be made good anyhow.
    pub turn: usize,
    /// The turn takes all N steps, as (16) has it, or none is made.
    pub synchronous: bool,
}

impl Search {
    /// The fewest steps in which both deviations can end at zero, and for them the slowest turn. Where
    /// there are none, `most` steps and, as far as allowed, a turn in `turn` steps.
    pub fn choose(&self, model: &Model, start: Deviation, bounds: &Bounds) -> Problem {
        let e = start.heading_rad;
        let landing = (self.least..=self.most).find_map(|steps| {
            let fastest = if self.synchronous { steps } else { 1 };
            let turns = (fastest..=steps).rev().map(|turning| Turn::within(e, turning));
            turns
                .take_while(|turn| bounds.allow_turn(turn.rate_radps(0, model.sample_s)))
                .map(|turn| Problem::new(model, start, bounds, turn, steps))
                .find(Problem::can_land)
        });
        landing.unwrap_or_else(|| {
            let wanted = e / (self.turn.max(1) as f64 * model.sample_s);
            let turn = Turn::by(e, bounds.clip_turn(wanted).abs() * model.sample_s);
            Problem::new(model, start, bounds, turn, self.most)
        })
    }
}

/// The QP with its memory. Variables: v_x over its largest possible value, of up to `len` steps; the ones
/// behind N are left free and come out zero. Rows: (19), hi, lo, jumps up, jumps down.
pub struct LeastEffort {
    inner: DefaultSolver<f64>,
    len: usize,
    matrix: Vec<f64>,
    bound: Vec<f64>,
    /// Place in `matrix` of each variable's entry in the row of (19).
    ends: Vec<usize>,
}

impl LeastEffort {
    /// For plans of up to `len` steps. Allocates everything; `None` if clarabel refuses the pattern.
    pub fn new(len: usize, max_iter: u32) -> Option<Self> {
        let len = len.clamp(1, STEPS_CAP);
        let (matrix, ends) = pattern(len);
        let effort = CscMatrix::identity(len);
        let bound = vec![1.0; matrix.m];
        let cones: [SupportedConeT<f64>; 2] = [ZeroConeT(1), NonnegativeConeT(matrix.m - 1)];
        let settings = in_place::settings(max_iter, TOLERANCE);
        let mut inner =
            DefaultSolver::new(&effort, &vec![0.0; len], &matrix, &bound, &cones, settings).ok()?;
        // The first solve allocates more than the later ones (one, clarabel's timers).
        in_place::solve(&mut inner);
        Some(Self { inner, len, matrix: matrix.nzval, bound, ends })
    }

    /// v_x of least effort; `None` if the solver did not get there.
    pub fn solve(&mut self, problem: &Problem) -> Option<PerStep> {
        if problem.steps > self.len {
            return None;
        }
        // The world and its mirror image are one problem, so they have one answer to the bit.
        let mirror = problem.way_m < 0.0;
        let solved = if mirror { problem.mirrored() } else { *problem };
        let scale = solved.scale_mps();
        self.write(&solved, scale);
        self.inner.update_A(&self.matrix).ok()?;
        self.inner.update_b(&self.bound).ok()?;
        in_place::solve(&mut self.inner);
        let solution = &self.inner.solution;
        if !matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved)
            || !solution.x.iter().all(|value| value.is_finite())
        {
            return None;
        }
        let sign = if mirror { -1.0 } else { 1.0 };
        let mut v_x = [0.0; STEPS_CAP];
        for (k, value) in solution.x.iter().enumerate().take(solved.steps) {
            // Less what the tolerance leaves over.
            v_x[k] = sign * (scale * value).max(solved.lo[k]).min(solved.hi[k]);
        }
        Some(v_x)
    }

    fn write(&mut self, problem: &Problem, scale: f64) {
        let (len, steps) = (self.len, problem.steps);
        let unit = problem.gain_s[..steps].iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let (reach, way) = (problem.reach_m, problem.way_m);
        self.bound[0] = way.max(reach.0).min(reach.1) / (unit * scale);
        let jump = problem.jump_mps / scale;
        for k in 0..len {
            let planned = k < steps;
            self.matrix[self.ends[k]] = if planned { problem.gain_s[k] / unit } else { 0.0 };
            self.bound[1 + k] = if planned { problem.hi[k] / scale } else { LOOSE };
            self.bound[1 + len + k] = if planned { -problem.lo[k] / scale } else { LOOSE };
            if k + 1 < len {
                let most = if k + 1 < steps { jump } else { LOOSE };
                self.bound[1 + 2 * len + k] = most;
                self.bound[3 * len + k] = most;
            }
        }
    }
}

/// The constraint matrix by columns, and where the row of (19) has its entries.
fn pattern(len: usize) -> (CscMatrix<f64>, Vec<usize>) {
    let (mut columns, mut places, mut values, mut ends) = (vec![0], Vec::new(), Vec::new(), Vec::new());
    let (up, down) = (1 + 2 * len, 3 * len);
    for k in 0..len {
        ends.push(places.len());
        let mut column = vec![(0, 1.0), (1 + k, 1.0), (1 + len + k, -1.0)];
        for (rows, sign) in [(up, 1.0), (down, -1.0)] {
            // Row k: v(k+1) − v(k).
            column.extend((k > 0).then(|| (rows + k - 1, sign)));
            column.extend((k + 1 < len).then_some((rows + k, -sign)));
        }
        for (row, value) in column {
            places.push(row);
            values.push(value);
        }
        columns.push(places.len());
    }
    (CscMatrix::new(4 * len - 1, len, columns, places, values), ends)
}

#[cfg(test)]
#[path = "constrained_tests.rs"]
mod tests;
