//! The quadratic programme in clarabel's form, updated in place.
//!
//! Variables: k_0 … k_{N−1}, z_0 … z_{N−1}. Rows of stage j, each `A x ≤ b`:
//!
//! ```text
//!    k_j − hi_j z_j ≤ 0        yaw rate: lo ≤ ω/ω_max ≤ hi (stage 0: as far as it can change)
//!   −k_j + lo_j z_j ≤ 0
//!         −z_j ≤ −least_j      speed: v_hi/z between its bounds (stage 0 likewise)
//!          z_j ≤ most_j
//!   ± m k_j − z_j ≤ −d         motor diamond d/z + m|k|/z ≤ 1; left out where the box implies it
//! ```
//!
//! There is always a feasible point: what acts now, held. Presolve and the dropping of zeros are off
//! and the pattern is full, so the set-up is done once; equilibration is off because the problem comes
//! in pure numbers near 1.

use super::model::{Model, TRIANGLE, entry};
use super::rollout::{Plan, STAGES};
use crate::in_place;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, NonnegativeConeT, SolverStatus};
use hilare_interfaces::messages::Fallback;

/// Gap and feasibility at which the solver stops; the problem's numbers are near 1.
const TOLERANCE: f64 = 1e-10;

/// Bounds of one stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageBounds {
    /// Least ω/ω_max.
    pub turn_lo: f64,
    /// Greatest ω/ω_max.
    pub turn_hi: f64,
    /// Least slowness.
    pub slowness_lo: f64,
    /// Greatest slowness.
    pub slowness_hi: f64,
}

/// What the inputs may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The first stage: also within reach of what acts now.
    pub first: StageBounds,
    /// All others.
    pub rest: StageBounds,
    /// Motor use of v_hi, d.
    pub motor_straight: f64,
    /// Motor use of ω_max, m.
    pub motor_turn: f64,
}

impl Bounds {
    fn of(&self, stage: usize) -> &StageBounds {
        if stage == 0 { &self.first } else { &self.rest }
    }
}

/// How a solve went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// What the answer lacks: nothing, or the optimum it stopped short of, or any answer at all.
    pub fallback: Fallback,
    /// Interior-point iterations.
    pub iterations: u32,
}

/// The solver with its memory.
pub struct Solver {
    inner: DefaultSolver<f64>,
    rows: usize,
    hessian: CscMatrix<f64>,
    gradient: Vec<f64>,
    matrix: CscMatrix<f64>,
    bound: Vec<f64>,
}

/// The last problem in numbers: ½ xᵀPx + qᵀx with A x ≤ b, P's upper triangle.
#[derive(Clone, Copy, Debug)]
pub struct Numbers<'a> {
    /// P.
    pub hessian: &'a CscMatrix<f64>,
    /// q.
    pub gradient: &'a [f64],
    /// A.
    pub matrix: &'a CscMatrix<f64>,
    /// b.
    pub bound: &'a [f64],
    /// x, as it was solved.
    pub solution: &'a [f64],
    /// So many of the first rows are equations.
    pub equations: usize,
}

impl Solver {
    /// Allocates everything. `diamond`: the box of speeds reaches outside the motor diamond.
    pub fn new(diamond: bool, max_iter: u32) -> Option<Self> {
        Self::with_tolerance(diamond, max_iter, TOLERANCE)
    }

    /// The same, stopping at another tolerance.
    pub fn with_tolerance(diamond: bool, max_iter: u32, tolerance: f64) -> Option<Self> {
        let rows = if diamond { 6 } else { 4 };
        let variables = 2 * STAGES;
        // H: a full upper triangle for k, a diagonal for z.
        let mut columns = vec![0];
        let mut places = Vec::new();
        for j in 0..variables {
            places.extend(if j < STAGES { 0..=j } else { j..=j });
            columns.push(places.len());
        }
        let hessian = CscMatrix::new(variables, variables, columns, places, identity());
        let matrix = pattern(rows);
        let bound = vec![1.0; rows * STAGES];
        let gradient = vec![0.0; variables];
        let settings = DefaultSettings {
            tol_gap_abs: 0.01 * tolerance,
            tol_gap_rel: 0.01 * tolerance,
            ..in_place::settings(max_iter, tolerance)
        };
        let cones = [NonnegativeConeT(rows * STAGES)];
        let mut inner = DefaultSolver::new(&hessian, &gradient, &matrix, &bound, &cones, settings).ok()?;
        // The first solve allocates more than the later ones (one, clarabel's timers).
        in_place::solve(&mut inner);
        Some(Self { inner, rows, hessian, gradient, matrix, bound })
    }

    /// Solves; the plan is left as it was unless the solver converged or ran into its iteration cap,
    /// and finite numbers came back.
    pub fn solve(&mut self, model: &Model, bounds: &Bounds, plan: &mut Plan) -> Outcome {
        self.write(model, bounds);
        let updated = self.inner.update_P(&self.hessian.nzval).is_ok()
            && self.inner.update_q(&self.gradient).is_ok()
            && self.inner.update_A(&self.matrix.nzval).is_ok()
            && self.inner.update_b(&self.bound).is_ok();
        if !updated {
            return Outcome { fallback: Fallback::Unsolved, iterations: 0 };
        }
        in_place::solve(&mut self.inner);
        let solution = &self.inner.solution;
        let fallback = meaning(solution.status, &solution.x);
        if fallback != Fallback::Unsolved {
            plan.curvature.copy_from_slice(&solution.x[..STAGES]);
            plan.slowness.copy_from_slice(&solution.x[STAGES..]);
        }
        Outcome { fallback, iterations: solution.iterations }
    }

    /// The last problem, for those who judge it.
    pub fn numbers(&self) -> Numbers<'_> {
        Numbers {
            hessian: &self.hessian,
            gradient: &self.gradient,
            matrix: &self.matrix,
            bound: &self.bound,
            solution: &self.inner.solution.x,
            equations: 0,
        }
    }

    fn write(&mut self, model: &Model, bounds: &Bounds) {
        self.hessian.nzval[..TRIANGLE].copy_from_slice(&model.hessian[..]);
        self.hessian.nzval[TRIANGLE..].copy_from_slice(&model.slowness_hessian);
        self.gradient[..STAGES].copy_from_slice(&model.gradient);
        self.gradient[STAGES..].copy_from_slice(&model.slowness_gradient);
        let (per_turn, per_slowness) = (self.rows - 2, self.rows);
        for j in 0..STAGES {
            let stage = bounds.of(j);
            let slowness = STAGES * per_turn + j * per_slowness;
            self.matrix.nzval[slowness] = -stage.turn_hi;
            self.matrix.nzval[slowness + 1] = stage.turn_lo;
            let row = j * self.rows;
            self.bound[row] = 0.0;
            self.bound[row + 1] = 0.0;
            self.bound[row + 2] = -stage.slowness_lo;
            self.bound[row + 3] = stage.slowness_hi;
            if self.rows == 6 {
                let turn = j * per_turn;
                self.matrix.nzval[turn + 2] = bounds.motor_turn;
                self.matrix.nzval[turn + 3] = -bounds.motor_turn;
                self.bound[row + 4] = -bounds.motor_straight;
                self.bound[row + 5] = -bounds.motor_straight;
            }
        }
    }
}

/// What a solution lacks by its status. The problems are always feasible and their prices bounded below,
/// so a claim to the contrary is numerical trouble like any other.
pub fn meaning(status: SolverStatus, solution: &[f64]) -> Fallback {
    let fallback = match status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => Fallback::None,
        SolverStatus::MaxIterations => Fallback::IterationCap,
        _ => Fallback::Unsolved,
    };
    if solution.iter().all(|value| value.is_finite()) { fallback } else { Fallback::Unsolved }
}

/// Ones on the diagonal of the full pattern: values for the set-up.
fn identity() -> Vec<f64> {
    let mut values = vec![0.0; TRIANGLE + STAGES];
    (0..STAGES).for_each(|j| values[entry(j, j)] = 1.0);
    values[TRIANGLE..].fill(1.0);
    values
}

/// The constraint matrix, by columns, with the constant entries in place.
fn pattern(rows: usize) -> CscMatrix<f64> {
    let (mut columns, mut places, mut values) = (vec![0], Vec::new(), Vec::new());
    let turn = [(0, 1.0), (1, -1.0), (4, 1.0), (5, -1.0)];
    let slowness = [(0, -1.0), (1, -1.0), (2, -1.0), (3, 1.0), (4, -1.0), (5, -1.0)];
    for column in [&turn[..], &slowness[..]] {
        for j in 0..STAGES {
            for (row, value) in column.iter().filter(|(row, _)| *row < rows) {
                places.push(j * rows + row);
                values.push(*value);
            }
            columns.push(places.len());
        }
    }
    CscMatrix::new(rows * STAGES, 2 * STAGES, columns, places, values)
}
