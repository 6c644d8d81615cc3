//! The quadratic programme of a Mecanum plan in clarabel's form, updated in place.
//!
//! Variables are of each stage the inputs u_k, ω_k and the node they lead to, p_{k+1} and the heading
//! δ_{k+1} gained since now; and two slacks for the end. Every term and every row couples neighbours
//! only, so the factorisation is a band.
//!
//! ```text
//!   p_{k+1} = p_k + T_k u_k     δ_{k+1} = δ_k + T_k ω_k     exactly
//!
//!   J = Σ ½ T' (c_e e_k² + c_ψ ψ_k²) + Σ ½ T (c_v v∥² + c_y v⊥² + c_ω ω²) + ρ (s_e + s_ψ)
//!       e_k = n_k·(p_k − q_k)   ψ_k = δ_k − h_k       v, ω: less what is wanted of the stage
//!
//!   f_i·u_k ≤ v_max                 an octagon about the disc, one side square to the way
//!   ±ω_k ≤ 1
//!   ±x ±y ±arm ω ≤ r ω_i max        x, y: u_k in the body's frame, heading as planned before
//!   |Δx|, |Δy| ≤ a T̄, |Δω| ≤ α T̄    between neighbours and from what acts now to the first
//!   ±e_N ≤ s_e, ±ψ_N ≤ s_ψ          [Qian18] (19), e_d = e_θ = 0, as an exact penalty
//! ```
//!
//! Holding the body twist that acts now is always feasible. The time of a step goes with the number of
//! rows, so those are left out that the robot cannot meet, and in stages behind the first (whose input
//! alone is carried out) those that only a plan against the way would meet.

use super::STAGES;
use super::limits::{Limits, SIGNS};
use super::sparse::{Sparse, Writer};
use super::wanted::{Grid, Wanted};
use crate::in_place;
use crate::qp::frame::Vector;
use crate::qp::solver::{Numbers, Outcome, meaning};
use clarabel::solver::{DefaultSettings, DefaultSolver, NonnegativeConeT, ZeroConeT};
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::Fallback;

/// Columns: inputs and node of every stage, and the slacks.
const COLUMNS: usize = 6 * STAGES + 2;
const SLACK_OFF: usize = 6 * STAGES;
const SLACK_HEADING: usize = 6 * STAGES + 1;
/// Rows that are equations: the motion.
const EQUATIONS: usize = 3 * STAGES;
/// Sides of the polygon about the disc of speeds.
const SIDES: usize = 8;
/// Those that face forwards or aside; later stages do without the others, which cost alone forbids.
const SIDES_AHEAD: usize = 5;
/// Most stages that know the limits of acceleration.
const ACCEL_STAGES: usize = 6;

/// Prices as pure numbers (lengths in turn radii, times in 1/ω_max).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Of a cross-track error, c_e.
    pub off: f64,
    /// Of a heading error, c_ψ.
    pub heading: f64,
    /// Of a speed error along the way, c_v.
    pub speed: f64,
    /// Of a speed across it, c_y.
    pub lateral: f64,
    /// Of a yaw rate the track does not ask for, c_ω.
    pub yaw: f64,
    /// Of a cross-track error left at the end, ρ.
    pub end_off: f64,
    /// Of a heading error left at the end, ρ.
    pub end_heading: f64,
}

/// Which rows there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rows {
    /// The wheels' limits cut into what speed and yaw rate allow.
    pub wheels: bool,
    /// The disc cuts into what the wheels allow.
    pub disc: bool,
    /// Stages over which the acceleration matters.
    pub accel: usize,
    /// Stages over which the yaw acceleration matters.
    pub yaw_accel: usize,
}

impl Rows {
    /// Those that `limits` call for.
    pub fn needed(limits: &Limits, grid: &Grid) -> Self {
        // As long as a stop takes.
        let matters = |stop: f64| grid.at.iter().take_while(|at| **at < stop).count().clamp(1, ACCEL_STAGES);
        let most = core::f64::consts::SQRT_2 * limits.speed + limits.arm;
        Self {
            wheels: most > limits.wheel,
            disc: limits.speed < limits.wheel,
            accel: matters(limits.speed / limits.accel),
            yaw_accel: matters(1.0 / limits.yaw_accel),
        }
    }

    fn count(&self) -> usize {
        let first = 2 + if self.wheels { 8 } else { 0 } + if self.disc { SIDES } else { 0 };
        let stage = 2 + if self.wheels { 4 } else { 0 } + if self.disc { SIDES_AHEAD } else { 0 };
        EQUATIONS + first + (STAGES - 1) * stage + 4 * self.accel + 2 * self.yaw_accel + 4
    }
}

/// All a problem is made of.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Times.
    pub grid: &'a Grid,
    /// What to measure against.
    pub wanted: &'a Wanted,
    /// Heading of the body in each stage, rad.
    pub heading: &'a [f64; STAGES],
    /// What acts now, in the course frame, inside the limits.
    pub acting: BodyTwist,
    /// From the body's frame to the course frame: crab angle of the current leg, rad.
    pub crab: f64,
    /// Limits.
    pub limits: &'a Limits,
    /// Prices.
    pub weights: &'a Weights,
}

/// A plan, in the frame of its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// u_0 … u_{N−1}.
    pub velocity: [Vector; STAGES],
    /// ω_0 … ω_{N−1}.
    pub yaw_rate: [f64; STAGES],
    /// δ_0 … δ_N, rad.
    pub turned: [f64; STAGES + 1],
}

impl Plan {
    /// Standing.
    pub const STILL: Self = Self {
        velocity: [Vector::new(0.0, 0.0); STAGES],
        yaw_rate: [0.0; STAGES],
        turned: [0.0; STAGES + 1],
    };
}

/// The solver with its memory.
pub struct Programme {
    inner: DefaultSolver<f64>,
    rows: Rows,
    hessian: Sparse,
    matrix: Sparse,
    gradient: Vec<f64>,
    bound: Vec<f64>,
}

impl Programme {
    /// Allocates everything; `None` if clarabel refuses the pattern.
    pub fn new(rows: Rows, example: &Problem<'_>, max_iter: u32, tolerance: f64) -> Option<Self> {
        let (mut gradient, mut bound) = (vec![0.0; COLUMNS], Vec::with_capacity(rows.count()));
        let (mut p, mut a) = (Vec::new(), Vec::new());
        Writing { hessian: &mut p, matrix: &mut a, gradient: &mut gradient, bound: &mut bound }
            .write(rows, example);
        let mut hessian = Sparse::new(COLUMNS, COLUMNS, &p);
        let mut matrix = Sparse::new(bound.len(), COLUMNS, &a);
        fill(&mut hessian, &mut matrix, &mut gradient, &mut bound, rows, example);
        let settings = DefaultSettings {
            equilibrate_enable: true,
            tol_gap_rel: 1e-2 * tolerance,
            ..in_place::settings(max_iter, tolerance)
        };
        let cones = [ZeroConeT(EQUATIONS), NonnegativeConeT(bound.len() - EQUATIONS)];
        let (p, a) = (&hessian.matrix, &matrix.matrix);
        let mut inner = DefaultSolver::new(p, &gradient, a, &bound, &cones, settings).ok()?;
        // The first solve allocates more than the later ones (one, clarabel's timers).
        in_place::solve(&mut inner);
        Some(Self { inner, rows, hessian, matrix, gradient, bound })
    }

    /// Solves; `plan` is left as it was unless the solver converged or ran into its iteration cap.
    pub fn solve(&mut self, problem: &Problem<'_>, plan: &mut Plan) -> Outcome {
        let Self { hessian, matrix, gradient, bound, .. } = self;
        fill(hessian, matrix, gradient, bound, self.rows, problem);
        let updated = self.inner.update_P(&self.hessian.matrix.nzval).is_ok()
            && self.inner.update_q(&self.gradient).is_ok()
            && self.inner.update_A(&self.matrix.matrix.nzval).is_ok()
            && self.inner.update_b(&self.bound).is_ok();
        if !updated {
            return Outcome { fallback: Fallback::Unsolved, iterations: 0 };
        }
        in_place::solve(&mut self.inner);
        let solution = &self.inner.solution;
        let fallback = meaning(solution.status, &solution.x);
        if fallback != Fallback::Unsolved {
            for (k, stage) in solution.x[..SLACK_OFF].chunks_exact(6).enumerate() {
                plan.velocity[k] = Vector::new(stage[0], stage[1]);
                plan.yaw_rate[k] = stage[2];
                plan.turned[k + 1] = stage[5];
            }
        }
        Outcome { fallback, iterations: solution.iterations }
    }

    /// The last problem, for those who judge it.
    pub fn numbers(&self) -> Numbers<'_> {
        Numbers {
            hessian: &self.hessian.matrix,
            gradient: &self.gradient,
            matrix: &self.matrix.matrix,
            bound: &self.bound,
            solution: &self.inner.solution.x,
            equations: EQUATIONS,
        }
    }
}

fn fill(
    hessian: &mut Sparse,
    matrix: &mut Sparse,
    gradient: &mut [f64],
    bound: &mut Vec<f64>,
    rows: Rows,
    problem: &Problem<'_>,
) {
    gradient.fill(0.0);
    bound.clear();
    let (hessian, matrix) = (&mut hessian.writer(), &mut matrix.writer());
    Writing { hessian, matrix, gradient, bound }.write(rows, problem);
}

/// Takes the entries of a matrix: the pattern at set-up, values later.
trait Sink {
    fn put(&mut self, row: usize, column: usize, value: f64);
}

impl Sink for Vec<(usize, usize)> {
    fn put(&mut self, row: usize, column: usize, _: f64) {
        self.push((row, column));
    }
}

impl Sink for Writer<'_> {
    fn put(&mut self, _: usize, _: usize, value: f64) {
        Writer::put(self, value);
    }
}

/// A term's column and factor.
type Term = (usize, f64);

struct Writing<'a, S> {
    hessian: &'a mut S,
    matrix: &'a mut S,
    gradient: &'a mut [f64],
    bound: &'a mut Vec<f64>,
}

/// Columns of the inputs of a stage.
const fn inputs(stage: usize) -> [usize; 3] {
    [6 * stage, 6 * stage + 1, 6 * stage + 2]
}

/// Columns of a node; the first is where the robot is and has none.
const fn node(k: usize) -> [usize; 3] {
    [6 * k - 3, 6 * k - 2, 6 * k - 1]
}

/// `a · u` of a stage.
fn velocity(stage: usize, a: Vector) -> [Term; 2] {
    let [x, y, _] = inputs(stage);
    [(x, a.x), (y, a.y)]
}

impl<S: Sink> Writing<'_, S> {
    fn write(&mut self, rows: Rows, problem: &Problem<'_>) {
        for k in 0..STAGES {
            self.move_on(k, problem.grid.time[k]);
        }
        for k in 0..STAGES {
            self.price_node(k + 1, problem);
            self.price_stage(k, problem);
            self.limit_stage(k, rows, problem);
            self.limit_change(k, rows, problem);
        }
        self.close(problem);
    }

    /// Node k + 1 less node k less T times the inputs is nothing.
    fn move_on(&mut self, k: usize, time: f64) {
        for axis in 0..3 {
            let row = self.bound.len();
            if k > 0 {
                self.matrix.put(row, node(k)[axis], -1.0);
            }
            self.matrix.put(row, inputs(k)[axis], -time);
            self.matrix.put(row, node(k + 1)[axis], 1.0);
            self.bound.push(0.0);
        }
    }

    /// Adds ½ weight (terms − wanted)².
    fn price<const N: usize>(&mut self, terms: [Term; N], wanted: f64, weight: f64) {
        for (count, (column, factor)) in terms.iter().enumerate() {
            self.gradient[*column] -= weight * factor * wanted;
            for (row, other) in &terms[..=count] {
                self.hessian.put(*row, *column, weight * factor * other);
            }
        }
    }

    /// Adds a row: terms ≤ most.
    fn row(&mut self, terms: &[Term], most: f64) {
        let row = self.bound.len();
        for (column, factor) in terms {
            self.matrix.put(row, *column, *factor);
        }
        self.bound.push(most);
    }

    fn price_node(&mut self, k: usize, problem: &Problem<'_>) {
        let [x, y, turned] = node(k);
        let (wanted, weights) = (&problem.wanted.nodes[k], problem.weights);
        let after = problem.grid.time.get(k).copied().unwrap_or(0.0);
        let time = 0.5 * (problem.grid.time[k - 1] + after);
        let (normal, off) = (wanted.normal, wanted.normal.dot(wanted.place));
        self.price([(x, normal.x), (y, normal.y)], off, time * weights.off);
        self.price([(turned, 1.0)], wanted.turned, time * weights.heading);
    }

    fn price_stage(&mut self, k: usize, problem: &Problem<'_>) {
        let (stage, weights) = (&problem.wanted.stages[k], problem.weights);
        let time = problem.grid.time[k];
        let (along, across) = (stage.along, stage.along.left());
        self.price(velocity(k, along), along.dot(stage.way) / time, time * weights.speed);
        self.price(velocity(k, across), across.dot(stage.way) / time, time * weights.lateral);
        self.price([(inputs(k)[2], 1.0)], stage.turn / time, time * weights.yaw);
    }

    fn limit_stage(&mut self, k: usize, rows: Rows, problem: &Problem<'_>) {
        let limits = problem.limits;
        let yaw = inputs(k)[2];
        self.row(&[(yaw, 1.0)], 1.0);
        self.row(&[(yaw, -1.0)], 1.0);
        if rows.disc {
            let along = problem.wanted.stages[k].along;
            let sides = if k == 0 { SIDES } else { SIDES_AHEAD };
            for (cos, sin) in &OCTAGON[..sides] {
                let side = Vector::default().plus(along, *cos).plus(along.left(), *sin);
                self.row(&velocity(k, side), limits.speed);
            }
        }
        if rows.wheels {
            let (forward, left) = axes(problem.heading[k]);
            let along = problem.wanted.stages[k].along;
            let (x, y) = (forward.dot(along), left.dot(along));
            // The sign of the greater part is known, but for the first stage, which is exact.
            let likely = |(sx, sy, _): &(f64, f64, f64)| {
                k == 0 || if x.abs() >= y.abs() { *sx == sign(x) } else { *sy == sign(y) }
            };
            for (sx, sy, sw) in SIGNS.into_iter().filter(likely) {
                let [x, y] = velocity(k, Vector::default().plus(forward, sx).plus(left, sy));
                self.row(&[x, y, (yaw, sw * limits.arm)], limits.wheel);
            }
        }
    }

    /// Changes of the velocity seen from the turning robot, so that it may hold its twist, along the axes
    /// of its course frame, so that a crab angle makes no difference; as shares of what the time between
    /// the stages' middles allows.
    fn limit_change(&mut self, k: usize, rows: Rows, problem: &Problem<'_>) {
        let (limits, grid, acting) = (problem.limits, problem.grid, problem.acting);
        let before = grid.time[k.saturating_sub(1)];
        let between = 0.5 * (grid.time[k] + before);
        if k < rows.accel {
            let (forward, left) = axes(problem.heading[k] + problem.crab);
            let was = axes(problem.heading[k.saturating_sub(1)] + problem.crab);
            for (now, was, acts) in [(forward, was.0, acting.vx_mps), (left, was.1, acting.vy_mps)] {
                let share = 1.0 / (limits.accel * between);
                for share in [share, -share] {
                    let [x, y] = velocity(k, Vector::default().plus(now, share));
                    if k == 0 {
                        self.row(&[x, y], 1.0 + share * acts);
                    } else {
                        let [a, b] = velocity(k - 1, Vector::default().plus(was, -share));
                        self.row(&[a, b, x, y], 1.0);
                    }
                }
            }
        }
        if k < rows.yaw_accel {
            let share = 1.0 / (limits.yaw_accel * between);
            for share in [share, -share] {
                if k == 0 {
                    self.row(&[(inputs(0)[2], share)], 1.0 + share * acting.omega_radps);
                } else {
                    self.row(&[(inputs(k - 1)[2], -share), (inputs(k)[2], share)], 1.0);
                }
            }
        }
    }

    fn close(&mut self, problem: &Problem<'_>) {
        let [x, y, turned] = node(STAGES);
        let end = &problem.wanted.nodes[STAGES];
        let (normal, off) = (end.normal, end.normal.dot(end.place));
        for sign in [1.0, -1.0] {
            let terms = [(x, sign * normal.x), (y, sign * normal.y), (SLACK_OFF, -1.0)];
            self.row(&terms, sign * off);
            self.row(&[(turned, sign), (SLACK_HEADING, -1.0)], sign * end.turned);
        }
        self.gradient[SLACK_OFF] = problem.weights.end_off;
        self.gradient[SLACK_HEADING] = problem.weights.end_heading;
    }
}

/// Cosines and sines of an octagon's normals, those ahead first.
const OCTAGON: [(f64, f64); SIDES] = {
    const H: f64 = core::f64::consts::FRAC_1_SQRT_2;
    [(1.0, 0.0), (H, H), (H, -H), (0.0, 1.0), (0.0, -1.0), (-H, H), (-H, -H), (-1.0, 0.0)]
};

/// The body's axes at a heading.
fn axes(heading: f64) -> (Vector, Vector) {
    let (sin, cos) = libm::sincos(heading);
    let forward = Vector::new(cos, sin);
    (forward, forward.left())
}

fn sign(x: f64) -> f64 {
    1.0_f64.copysign(x)
}
