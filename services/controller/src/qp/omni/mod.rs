//! The predictive law of a Mecanum drive: position and heading are free of one another, so the plan
//! follows the path with its midpoint and turns the body as it likes, as far as the wheels allow both.
//!
//! ```text
//!   pose k ──▶ pose k+T ──▶ legs ahead ──▶ walk along them ──▶ QP ──▶ first input
//!     (what acts now)        [`Track`]      [`wanted`]      [`programme`]   [`limits`]
//! ```
//!
//! Stages are of fixed *time*, the first a control period, each further one longer, so that the near
//! future is fine and the horizon sees a half turn coming. With velocities in the plan's frame as inputs
//! the motion is linear; only the wheels' limits depend on the heading of the plan before (in the first
//! stage exactly: the command is laid out in the very heading its rows were written for).
//!
//! Wanted are: no cross-track error, the body turned to the tangent less the crab angle of the leg,
//! v_r along the path; at the end of the horizon `[Qian18] (19)`, e_d = e_θ = 0, as an exact penalty.
//! Departs from paper 3 in that all of its (5) are constraints of the one optimisation, and that what
//! cannot be reached in the horizon is come as near to as can be.
//!
//! The plan switches legs at waypoints, where [`Acceptance::Bisector`] does on a path that is kept to;
//! a robot that finds itself behind a waypoint that was not accepted goes back for it.
//!
//! [`Acceptance::Bisector`]: hilare_interfaces::acceptance::Acceptance::Bisector

pub mod limits;
pub mod programme;
mod sparse;
pub mod wanted;

use super::QpParams;
use super::frame::{Scale, Track};
use super::solver::{Numbers, Outcome};
use crate::prediction::moved;
use crate::{ControlLaw, LawInputs, LawOutput, LawSetup, TwistLimits};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::MecanumParams;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::Fallback;
use hilare_interfaces::state::{StateWords, Stateful};
use limits::Limits;
use programme::{Plan, Problem, Programme, Rows, Weights};
use wanted::{Grid, Wanted};

/// Stages of a plan.
pub const STAGES: usize = 11;
/// Time that is looked ahead, in 1/ω_max: a half turn.
const HORIZON: f64 = 3.2;
/// Gap and feasibility at which the solver stops; the problem's numbers are near 1.
const TOLERANCE: f64 = 3e-9;
/// Size of the prices, so that the tolerance is small beside the errors that matter. What is left at the
/// end costs as much a turn radius or radian: more than it can gain anywhere else.
const PRICE: f64 = 1e3;

/// The law.
pub struct Omni {
    params: QpParams,
    robot: MecanumParams,
    twist_limits: TwistLimits,
    acceptance_m: f64,
    passes: bool,
    period_s: f64,
    /// `None` if the robot cannot move, or clarabel refused the pattern; then the law says so.
    programme: Option<Programme>,
    grid: Grid,
    track: Track,
    wanted: Wanted,
    /// The plan of the period before, in the frame of its own start.
    plan: Plan,
    /// Way along the track at each node of `plan`.
    progress: [f64; STAGES + 1],
    /// Heading of the body in each stage of it, rad, in the frame of this period.
    heading: [f64; STAGES],
    /// What the plan goes on with in the next period, in the body's frame.
    next: BodyTwist,
    /// What `plan` is measured in; `None` before there is one.
    scale: Option<Scale>,
    iterations: u32,
}

impl Omni {
    /// From the robot and checked parameters.
    pub fn new(setup: &LawSetup<'_>, robot: MecanumParams, params: QpParams) -> Self {
        let period_s = setup.period_ticks as f64 * TICK_S;
        let limits = setup.limits;
        let grid = Grid::new(period_s * limits.omega_max_radps, HORIZON);
        let mut law = Self {
            params,
            robot,
            twist_limits: limits,
            acceptance_m: setup.acceptance_radius_m,
            passes: setup.acceptance == Acceptance::Passed,
            period_s,
            programme: None,
            grid,
            track: Track::new(true),
            wanted: Wanted::new(),
            plan: Plan::STILL,
            progress: grid.at,
            heading: [0.0; STAGES],
            next: BodyTwist::ZERO,
            scale: None,
            iterations: 0,
        };
        if let Some(scale) = Scale::new(limits.v_max_mps, &limits) {
            law.programme = law.programme(&scale, TOLERANCE);
        }
        law
    }

    fn programme(&self, scale: &Scale, tolerance: f64) -> Option<Programme> {
        let limits = self.limits(scale);
        let weights = self.weights(scale, 0.0);
        let example = Problem {
            grid: &self.grid,
            wanted: &self.wanted,
            heading: &self.heading,
            acting: BodyTwist::ZERO,
            crab: 0.0,
            limits: &limits,
            weights: &weights,
        };
        let rows = Rows::needed(&limits, &self.grid);
        Programme::new(rows, &example, self.params.max_iterations as u32, tolerance)
    }

    /// Interior-point iterations of the last step.
    pub fn iterations(&self) -> u32 {
        self.iterations
    }

    /// The last problem in numbers; its first input is x_0, x_1 in v_hi and x_2 in ω_max.
    pub fn numbers(&self) -> Option<Numbers<'_>> {
        self.programme.as_ref().map(Programme::numbers)
    }

    fn limits(&self, scale: &Scale) -> Limits {
        let accel = (self.params.accel_mps2, self.params.accel_radps2);
        Limits::new(&self.robot, &self.twist_limits, accel, scale)
    }

    /// `off`: cross-track error now, turn radii. Beyond one it counts by its size, not its square.
    fn weights(&self, scale: &Scale, off: f64) -> Weights {
        let square = |x: f64| x * x;
        let far = PRICE / libm::sqrt(1.0 + off * off);
        let radian = PRICE * square(self.params.heading_price_m / scale.radius_m);
        let settle = square(self.params.settle_s * scale.omega_radps);
        Weights {
            off: far,
            heading: radian,
            speed: PRICE * square(self.params.pace_price_s * scale.omega_radps),
            lateral: settle * far,
            yaw: settle * radian,
            end_off: PRICE,
            end_heading: radian,
        }
    }

    /// Moves the plan of the period before on to now: only its progress and its turning are used. In the
    /// first stage the body turns about as it does: `acting`, in ω_max.
    fn advance(&mut self, kept: bool, acting: f64) {
        let body = -self.track.legs()[0].crab;
        let turned = if kept {
            self.progress = self.grid.advance(&self.progress);
            self.grid.advance(&self.plan.turned)
        } else {
            self.progress = self.grid.at;
            [0.0; STAGES + 1]
        };
        for (k, heading) in self.heading.iter_mut().enumerate() {
            *heading = body + 0.5 * (turned[k] + turned[k + 1]);
        }
        self.heading[0] = body + 0.5 * acting.clamp(-1.0, 1.0) * self.grid.time[0];
    }

    /// What the plan achieved, for the next period.
    fn keep(&mut self, limits: &Limits) {
        for k in 0..STAGES {
            let along = self.wanted.stages[k].along.dot(self.plan.velocity[k]).clamp(0.0, limits.speed);
            self.progress[k + 1] = self.progress[k] + along * self.grid.time[k];
        }
    }

    /// Body twist of a stage of the plan.
    fn twist(&self, stage: usize) -> BodyTwist {
        let velocity = self.plan.velocity[stage];
        BodyTwist::new(velocity.x, velocity.y, self.plan.yaw_rate[stage]).turned(-self.heading[stage])
    }

    fn look(&mut self, inputs: LawInputs<'_>, scale: &Scale) {
        let start = moved(inputs.pose, inputs.acting, self.period_s);
        self.track.look(inputs.reference, start, scale, self.acceptance_m);
        if !self.passes {
            self.track.turn_back_if_missed(0.0);
        }
        let kept = self.scale == Some(*scale);
        self.scale = Some(*scale);
        self.advance(kept, inputs.acting.omega_radps / scale.omega_radps);
        self.wanted.look(&self.track, &self.grid, &self.progress);
    }
}

impl ControlLaw for Omni {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let crab = inputs.reference.current.crab_rad;
        let moving = inputs.reference.speed_mps > 1e-6;
        let Some(scale) = Scale::new(inputs.reference.speed_mps, &self.twist_limits).filter(|_| moving)
        else {
            return LawOutput { twist: BodyTwist::ZERO, fallback: Fallback::NoMotion };
        };
        self.look(inputs, &scale);
        let limits = self.limits(&scale);
        let pure = |t: BodyTwist| {
            let v = scale.speed_mps;
            BodyTwist::new(t.vx_mps / v, t.vy_mps / v, t.omega_radps / scale.omega_radps)
        };
        let acting = limits.inside(pure(inputs.acting.turned(crab)));
        let first = &self.wanted.nodes[0];
        let weights = self.weights(&scale, first.normal.dot(first.place));
        let problem = Problem {
            grid: &self.grid,
            wanted: &self.wanted,
            heading: &self.heading,
            acting: acting.turned(-crab),
            crab,
            limits: &limits,
            weights: &weights,
        };
        let outcome = match &mut self.programme {
            Some(programme) => programme.solve(&problem, &mut self.plan),
            None => Outcome { fallback: Fallback::Unsolved, iterations: 0 },
        };
        self.iterations = outcome.iterations;
        let wanted = if outcome.fallback == Fallback::Unsolved {
            self.scale = None;
            self.next
        } else {
            self.keep(&limits);
            self.next = self.twist(1);
            self.twist(0)
        };
        let twist = limits.reach(acting, wanted, self.grid.time[0]);
        let (v, w) = (scale.speed_mps, scale.omega_radps);
        let body = BodyTwist::new(twist.vx_mps * v, twist.vy_mps * v, twist.omega_radps * w);
        LawOutput { twist: body.turned(-crab), fallback: outcome.fallback }
    }

    fn reset(&mut self) {
        self.scale = None;
        self.next = BodyTwist::ZERO;
        self.wanted.reset();
    }

    /// Of a plan the progress and the turning, at all nodes but the first, where both are 0. What the solver
    /// holds is of its last problem, and the next one begins without it ([`in_place`](crate::in_place)).
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.wanted.visit_state(words);
        words.twist(&mut self.next);
        Scale::visit_state(&mut self.scale, &self.twist_limits, words);
        if self.scale.is_some() {
            words.finite(&mut self.progress[1..]);
            words.finite(&mut self.plan.turned[1..]);
        }
    }
}

#[cfg(test)]
mod tests;
