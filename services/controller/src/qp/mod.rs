//! The QP-constrained predictive law (spec 4): one convex QP a control period, solved by clarabel.
//!
//! ```text
//!   pose k ──▶ pose k+T ──▶ legs ahead ──▶ plan of last time, moved on ──▶ convex model ──▶ QP ──▶ u_0
//!     (what acts now)     [`frame`]          [`rollout`]                   [`model`]      [`solver`]
//! ```
//!
//! The command computed from the pose of tick k acts from tick k + T on, so the plan starts at the
//! pose that what acts now leads to. It looks ahead a fixed *travel*, over as many waypoints as fit;
//! in it the line or arc to track switches where the selector would switch it. One Gauss–Newton step a
//! period is taken about the plan of the period before (real-time iteration), and only as far as the
//! true cost falls. The hard limits are rows of the QP; everything else is a price, so it is always
//! feasible. If the solver stops at its iteration cap or fails, the best plan at hand is used, its first
//! input inside the limits, and the output says which ([`Fallback`]).
//!
//! All this is the law of a differential drive; a Mecanum drive, whose motion is of another kind, has a
//! formulation of its own in [`omni`].
//!
//! How near to the best it comes: ∫|e| ds over one corner at full speed (R = 53.5 mm, d_T = 27 mm),
//! optimised offline (multiple shooting, IPOPT, a phase before the switch and one behind), in mm²:
//!
//! | turn | switch on the rim, `[MH18] (8)` | switch anywhere inside the circle |
//! |---|---|---|
//! | 28° | 133 | 12 |
//! | 56.3° | 382 | 99 |
//! | 90° | 555 | 398 |
//! | 123.7° | 1958 | 1957 |
//!
//! Over the closed rectangle that is a mean of 1.27 mm and 0.91 mm. Whatever the law, a switch on the
//! rim costs (1 − |cos turn|) d_T²/2, because the two lines are that far apart there. Spec 4's yardstick
//! is of the second kind, so this law asks the selector for [`Acceptance::Bisector`].

pub mod frame;
pub mod model;
pub mod omni;
pub mod rollout;
pub mod solver;
pub mod weights;

use crate::prediction::moved;
use crate::{Built, ControlLaw, LawInputs, LawOutput, LawSetup, LawSpec, TwistLimits};
use frame::{Scale, Track};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::Fallback;
use hilare_interfaces::param_group;
use hilare_interfaces::params::ParamGroup;
use hilare_interfaces::state::StateWords;
use model::Model;
use omni::Omni;
use rollout::{Grid, Plan, Rollout, STAGES};
use solver::{Bounds, Numbers, Solver, StageBounds};
use weights::Weights;

param_group! {
    /// Prices and bounds of the predictive law.
    QpParams {
        /// Differential: cross-track error that one unit of speed error is worth, λ: m per m/s.
        speed_price_s: f64 = 1.25, "s", 0.01, 100.0;
        /// Cross-track error below which it counts quadratically, δ.
        knee_m: f64 = 0.0005, "m", 1e-5, 0.1;
        /// Length of travel looked ahead, in turn radii (or in acceptance diameters if those are larger).
        horizon: f64 = 5.0, "", 1.0, 20.0;
        /// How far inside the acceptance circle a plan must come, for steps and slip.
        circle_margin_m: f64 = 0.0005, "m", 0.0, 0.01;
        /// Weight of the cross-track error ahead of the horizon's end.
        end_off: f64 = 0.5, "", 0.0, 100.0;
        /// Price of the heading at the horizon's end.
        end_heading: f64 = 2.0, "", 0.0, 100.0;
        /// Price of a changing curvature.
        smooth: f64 = 1e-5, "", 0.0, 10.0;
        /// Mecanum: the same for its speed along the path.
        pace_price_s: f64 = 0.1, "s", 0.001, 100.0;
        /// Mecanum: cross-track error that one radian of heading error is worth.
        heading_price_m: f64 = 0.05, "m", 1e-4, 10.0;
        /// Mecanum: time constant with which an error is taken out.
        settle_s: f64 = 0.1, "s", 0.001, 10.0;
        /// Greatest change of speed.
        accel_mps2: f64 = 2.0, "m/s^2", 0.01, 100.0;
        /// Greatest change of yaw rate.
        accel_radps2: f64 = 40.0, "rad/s^2", 0.01, 10000.0;
        /// Iteration cap of the solver: what bounds the time of a step.
        max_iterations: u64 = 20, "", 1, 200;
    }
}

/// Its line in the registry.
pub const SPEC: LawSpec = LawSpec {
    name: "qp",
    title: "predictive law with all limits inside, a QP a period",
    source: "hilare, spec 4; solver: Goulart & Chen 2024 (clarabel)",
    chassis: &["differential", "mecanum"],
    acceptance: Acceptance::Bisector,
    // The timers of clarabel.
    allocations: 1,
    keeps_limits: true,
    tunes_limits: false,
    params: QpParams::SPECS,
    build,
};

fn build(setup: &LawSetup<'_>) -> Built {
    let mut params = QpParams::default();
    for (name, value) in setup.values {
        params.set(name, *value).map_err(|error| (*name, error))?;
    }
    Ok(match setup.chassis {
        Chassis::Differential(_) => Box::new(Qp::new(setup, params)),
        Chassis::Mecanum(robot) => Box::new(Omni::new(setup, *robot, params)),
    })
}

/// Slowest planned speed as a share of the fastest: the plan counts travel, so it cannot stand.
const SLOWEST: f64 = 0.2;
/// Tightest curvature of the helmsmen who offer a plan, in 1/R.
const HELMSMEN: [f64; 2] = [1.0, 3.0];
/// Shares of a step that are tried until the true cost falls.
const STEP_SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// The law.
pub struct Qp {
    params: QpParams,
    chassis: Chassis,
    limits: TwistLimits,
    acceptance_m: f64,
    period_s: f64,
    /// `None` only if clarabel refused the pattern; then the law steers without it and says so.
    solver: Option<Solver>,
    track: Track,
    model: Model,
    rollout: Rollout,
    trial: Rollout,
    plan: Plan,
    grid: Grid,
    /// What `plan` is measured in; `None` before there is one.
    scale: Option<Scale>,
    /// Interior-point iterations of the last solve.
    iterations: u32,
}

impl Qp {
    /// From the robot and checked parameters.
    pub fn new(setup: &LawSetup<'_>, params: QpParams) -> Self {
        let limits = setup.limits;
        let corner = BodyTwist::new(limits.v_max_mps, 0.0, limits.omega_max_radps);
        let diamond = setup.chassis.motor_use(corner) > 1.0;
        Self {
            params,
            chassis: *setup.chassis,
            limits,
            acceptance_m: (setup.acceptance_radius_m - params.circle_margin_m)
                .max(0.5 * setup.acceptance_radius_m),
            period_s: setup.period_ticks as f64 * TICK_S,
            solver: Solver::new(diamond, params.max_iterations as u32),
            track: Track::new(setup.acceptance != Acceptance::Rim),
            model: Model::new(),
            rollout: Rollout::new(),
            trial: Rollout::new(),
            plan: Plan::STRAIGHT,
            grid: Grid::new(1.0),
            scale: None,
            iterations: 0,
        }
    }

    /// Interior-point iterations of the last step.
    pub fn iterations(&self) -> u32 {
        self.iterations
    }

    /// The last problem in numbers; its first input is 1/z_0, k_0/z_0.
    pub fn numbers(&self) -> Option<Numbers<'_>> {
        self.solver.as_ref().map(Solver::numbers)
    }

    fn new_grid(&self, scale: &Scale) -> Grid {
        let reach = scale.radius_m.max(2.0 * self.acceptance_m) / scale.radius_m;
        Grid::new(self.params.horizon * reach)
    }

    fn bounds(&self, scale: &Scale, acting: BodyTwist) -> Bounds {
        let v_hi = scale.speed_mps;
        let motor_straight = self.chassis.motor_use(BodyTwist::new(v_hi, 0.0, 0.0));
        let motor_turn = self.chassis.motor_use(BodyTwist::new(0.0, 0.0, scale.omega_radps));
        let floor = self.limits.v_min_mps.max(SLOWEST * v_hi).min(v_hi / motor_straight.max(1.0));
        let rest = StageBounds {
            turn_lo: -1.0,
            turn_hi: 1.0,
            slowness_lo: 1.0,
            slowness_hi: (v_hi / floor).max(1.0 + 1e-6),
        };
        // What can be reached from what acts now within a period.
        let dv = self.params.accel_mps2 * self.period_s;
        let least = (acting.vx_mps - dv).max(floor).min(acting.vx_mps.max(0.0) + dv);
        let least = least.max(1e-3 * v_hi);
        let most = (acting.vx_mps + dv).min(v_hi).max(least);
        let dw = self.params.accel_radps2 * self.period_s;
        let turn = |omega: f64| (omega / scale.omega_radps).clamp(-1.0, 1.0);
        let first = StageBounds {
            turn_lo: turn(acting.omega_radps - dw).min(1.0 - 1e-6),
            turn_hi: turn(acting.omega_radps + dw).max(-1.0 + 1e-6),
            slowness_lo: v_hi / most,
            slowness_hi: (v_hi / least).max(v_hi / most * (1.0 + 1e-6)),
        };
        Bounds { first, rest, motor_straight, motor_turn }
    }

    /// The plan to improve: that of the last period moved on, or a helmsman's if that is better, one who
    /// keeps his speed or one who slows down to turn on a smaller circle.
    fn choose_start(&mut self, weights: &Weights, travelled: Option<f64>) -> f64 {
        if let Some(travelled) = travelled {
            self.plan.advance(&mut self.grid, travelled);
        }
        let grid = &self.grid;
        let mut best_cost = f64::INFINITY;
        self.rollout.follow(&self.plan, grid, &self.track);
        if travelled.is_some() {
            // A plan without a cost is worse than any.
            best_cost = self.rollout.cost(&self.plan, grid, &self.track, weights).min(best_cost);
        }
        for tightest in HELMSMEN {
            let mut steered = Plan::STRAIGHT;
            self.trial.steer(&mut steered, grid, &self.track, tightest);
            let cost = self.trial.cost(&steered, grid, &self.track, weights);
            if cost < best_cost {
                best_cost = cost;
                self.plan = steered;
                core::mem::swap(&mut self.rollout, &mut self.trial);
            }
        }
        best_cost
    }

    /// One Gauss–Newton step, as far as the true cost falls.
    fn improve(&mut self, weights: &Weights, bounds: &Bounds, cost: f64) -> Fallback {
        let Some(solver) = &mut self.solver else { return Fallback::Unsolved };
        let grid = &self.grid;
        self.model.build(&self.plan, &self.rollout, grid, &self.track, weights);
        let mut best = self.plan;
        let outcome = solver.solve(&self.model, bounds, &mut best);
        self.iterations = outcome.iterations;
        for share in STEP_SHARES {
            let trial = self.plan.blend(&best, share);
            self.trial.follow(&trial, grid, &self.track);
            if self.trial.cost(&trial, grid, &self.track, weights) < cost {
                self.plan = trial;
                break;
            }
        }
        outcome.fallback
    }

    /// The first input, inside its bounds whatever the plan says. Where the diamond cuts a corner off
    /// the box the yaw rate has its way as far as the speed can make room within a period.
    fn first_input(&self, scale: &Scale, bounds: &Bounds) -> BodyTwist {
        let first = &bounds.first;
        let slowest = 1.0 / first.slowness_hi;
        let room = ((1.0 - bounds.motor_straight * slowest) / bounds.motor_turn).max(0.0);
        let turn = self.plan.curvature[0] / self.plan.slowness[0];
        let turn = turn.clamp(-room, room).clamp(first.turn_lo, first.turn_hi);
        let fastest = (1.0 - bounds.motor_turn * turn.abs()) / bounds.motor_straight;
        let speed = (1.0 / self.plan.slowness[0]).min(fastest).clamp(slowest, 1.0 / first.slowness_lo);
        let twist = BodyTwist::new(scale.speed_mps * speed, 0.0, scale.omega_radps * turn);
        let motor_use = self.chassis.motor_use(twist);
        if motor_use > 1.0 { twist.scaled(1.0 / motor_use) } else { twist }
    }
}

impl ControlLaw for Qp {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let Some(scale) = Scale::new(inputs.reference.speed_mps, &self.limits) else {
            let vx_mps = inputs.reference.speed_mps.min(self.limits.v_max_mps).max(self.limits.v_min_mps);
            return LawOutput { twist: BodyTwist::new(vx_mps, 0.0, 0.0), fallback: Fallback::NoMotion };
        };
        let start = moved(inputs.pose, inputs.acting, self.period_s);
        let weights = Weights::new(&self.params, &scale);
        let travelled = (self.scale == Some(scale))
            .then_some(inputs.acting.vx_mps.max(0.0) * self.period_s / scale.radius_m);
        if travelled.is_none() {
            (self.grid, self.plan) = (self.new_grid(&scale), Plan::STRAIGHT);
        }
        self.scale = Some(scale);
        self.track.look(inputs.reference, start, &scale, self.acceptance_m);
        self.track.turn_back_if_missed(self.track.acceptance);
        let bounds = self.bounds(&scale, inputs.acting);
        let cost = self.choose_start(&weights, travelled);
        let fallback = self.improve(&weights, &bounds, cost);
        LawOutput { twist: self.first_input(&scale, &bounds), fallback }
    }

    fn reset(&mut self) {
        self.scale = None;
    }

    /// The plan, and how far into its first stage it is: of the grid nothing else changes. What the solver
    /// holds is of its last problem, and the next one begins without it ([`in_place`](crate::in_place)).
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        Scale::visit_state(&mut self.scale, &self.limits, words);
        let Some(scale) = self.scale else { return };
        if words.is_loading() {
            self.grid = self.new_grid(&scale);
        }
        let whole = self.grid.travel[STAGES - 1];
        words.number(&mut self.grid.travel[0]);
        words.require((0.0..=2.0 * whole).contains(&self.grid.travel[0]));
        words.finite(&mut self.plan.curvature);
        words.finite(&mut self.plan.slowness);
        words.require(self.plan.slowness.iter().all(|slowness| *slowness > 0.0));
    }
}

#[cfg(test)]
mod tests;
