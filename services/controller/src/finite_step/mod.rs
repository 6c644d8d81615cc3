//! Finite-step path tracking for a Mecanum robot, paper 3 (spec 3): both deviations are brought to zero
//! in N sample periods with the least ½ Σ v_x², no weights to choose.
//!
//! ```text
//!             path ▲ v_τ, κ           paper (its Y axis is forwards)   here, course frame (REP-103)
//!                  │   ╱ x, robot     e_θ  heading − path's            the same, counter-clockwise
//!                  │e_θ╱              e_d  distance to the path        cross-track, robot left positive
//!          robot   │╱                 v_x  sideways, to the path       −v_y   (v_x > 0 makes e_d fall)
//!            ●─────┤                  v_y  forwards                     v_x
//!              e_d │                  Δω   fall of e_θ                  v_τ κ − ω
//! ```
//!
//! At each sample: the pose moved on to where the command will act, its deviations, then the
//! shortest plan in closed form that keeps the constraint set (5) ([`plan`]); where there is none, the
//! least-effort plan with hard bounds ([`constrained`]), and the answer says so. Twist and yaw rate are held
//! until the next sample.
//!
//! Receding (the default) plans anew at every sample, and *keeps the end step*: after one sample a plan
//! of N is followed by one of N − 1, so both deviations land at the step first promised. A horizon of
//! always N would take away a share 1/N of e_θ a sample and never land. If the end can no longer be kept
//! within the bounds, the shortest plan that can takes its place; when it is reached a new one begins.
//! `receding` off carries a plan out as computed, blind to its end.
//!
//! Departures from the paper:
//! * Between samples the robot turns, so e_d grows by T v_τ times the *mean* e_θ of a sample, not the
//!   first, as (12) has it: a plan carried out blindly misses by T v_τ e_θ(0)/2. Receding measures that.
//! * e_d is the distance to the path; the camera's is e_d/cos e_θ, 1 % more at 8°. Both are zero together.
//! * Paths bend: e_d, e_θ are against the nearest place of an arc, and ω has v_τ κ added.
//! * A sample is cut short where the path's next segment begins.
//! * a_max bounds v_x, the correction. The travel itself starts, stops and, where the crab angle changes,
//!   turns its direction in the robot as the path says; what acts is then carried over as v_x.
//! * Where (5) leaves no closed plan from the v_x in action, the turn may be finished before the step at
//!   which e_d lands (`synchronous` off): the drift v_τ e_θ is what asks for v_x.

pub mod constrained;
pub mod plan;
mod sight;

use crate::prediction::moved;
use crate::{Built, ControlLaw, LawInputs, LawOutput, LawSetup, LawSpec};
use constrained::{LeastEffort, PerStep, Search};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::Fallback;
use hilare_interfaces::param_group;
use hilare_interfaces::params::{ParamError, ParamGroup};
use hilare_interfaces::state::{StateWords, Stateful};
use plan::{Bounds, Deviation, FiniteStep, Model, STEPS_CAP, Turn};
use sight::{Leg, Sight};

param_group! {
    /// What a plan may take; the defaults are those of the paper's tables 1, 2.
    FiniteStepParams {
        /// Sample period T_s; a whole multiple of the control period.
        sample_period_s: f64 = 0.1, "s", 0.001, 1.0;
        /// Fewest steps of a new plan.
        steps_min: u64 = 8, "", 1, STEPS_CAP;
        /// Most steps of a plan in closed form; at least steps_min.
        steps_max: u64 = 12, "", 1, STEPS_CAP;
        /// Most steps of a plan with hard bounds, where there is none in closed form; at least steps_min.
        fallback_steps_max: u64 = 30, "", 1, STEPS_CAP;
        /// Greatest sideways speed, v_xmax.
        sideways_max_mps: f64 = 0.5, "m/s", 0.001, 10.0;
        /// Greatest sideways acceleration, a_max.
        accel_max_mps2: f64 = 0.05, "m/s^2", 0.001, 100.0;
        /// The jumps into and out of a plan in closed form count against accel_max_mps2; the paper leaves them out.
        end_jumps: bool = true, "", 0, 1;
        /// Heading deviation up to which the model holds; the paper's 8°.
        validity_rad: f64 = 0.139_626_340_159_546_36, "rad", 0.01, 0.5;
        /// Plan anew at every sample instead of carrying a plan out blindly.
        receding: bool = true, "", 0, 1;
        /// Without a plan in closed form, too, the turn takes as many steps as the way back.
        synchronous: bool = false, "", 0, 1;
        /// Iteration cap of the solver.
        max_iterations: u64 = 50, "", 1, 200;
    }
}

/// Its line in the registry.
pub const SPEC: LawSpec = LawSpec {
    name: "finite-step",
    title: "both deviations to zero in N steps, sideways included",
    source: "Qian, Zhu, Lou, Zhang 2018, eq. 5, 12, 16, 19-22",
    chassis: &["mecanum"],
    acceptance: Acceptance::Passed,
    // The timers of clarabel, where a plan has hard bounds.
    allocations: 1,
    keeps_limits: true,
    tunes_limits: false,
    params: FiniteStepParams::SPECS,
    build,
};

fn build(setup: &LawSetup<'_>) -> Built {
    let mut params = FiniteStepParams::default();
    for (name, value) in setup.values {
        params.set(name, *value).map_err(|error| (*name, error))?;
    }
    let refused = |name, why| Err((name, ParamError::Conflict(why)));
    if params.steps_max < params.steps_min {
        return refused("steps_max", "must be at least steps_min");
    }
    if params.fallback_steps_max < params.steps_min {
        return refused("fallback_steps_max", "must be at least steps_min");
    }
    let periods = params.sample_period_s / (setup.period_ticks as f64 * TICK_S);
    let whole = libm::round(periods);
    if whole < 1.0 || (periods - whole).abs() > 1e-6 {
        return refused("sample_period_s", "must be a whole multiple of the control period");
    }
    Ok(Box::new(FiniteStepLaw::new(setup, params, whole as u64)))
}

/// A plan being carried out.
#[derive(Clone, Copy, Debug)]
struct Course {
    steps: usize,
    done: usize,
    v_x: PerStep,
    turn: Turn,
    fallback: Fallback,
}

impl Course {
    /// What one is loaded over.
    const BLANK: Self =
        Self { steps: 1, done: 0, v_x: [0.0; STEPS_CAP], turn: Turn::NONE, fallback: Fallback::None };

    /// In closed form.
    fn closed(plan: &FiniteStep) -> Self {
        let v_x = core::array::from_fn(|k| plan.v_x(k));
        Self { steps: plan.steps, done: 0, v_x, turn: plan.turn(), fallback: Fallback::None }
    }

    const fn left(&self) -> usize {
        self.steps.saturating_sub(self.done)
    }
}

impl Stateful for Course {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.index(&mut self.steps, STEPS_CAP + 1);
        words.index(&mut self.done, self.steps + 1);
        words.finite(&mut self.v_x);
        self.turn.visit_state(words);
        words.code(&mut self.fallback, Fallback::code, Fallback::from_code);
    }
}

/// The law.
pub struct FiniteStepLaw {
    params: FiniteStepParams,
    /// Speed limit of the robot, and what the wheels leave for the forward speed: m/s, rad/s.
    v_max_mps: f64,
    sideways_max_mps: f64,
    yaw_max_radps: f64,
    /// Motor use of one m/s forwards, one sideways, one rad/s.
    motor: [f64; 3],
    /// The control period, and how many of them a sample has.
    period_s: f64,
    periods: u64,
    sample_s: f64,
    /// `None` only if clarabel refused the pattern; then the mean of the envelopes is the plan.
    solver: Option<LeastEffort>,
    course: Option<Course>,
    leg: Option<Leg>,
    crab_rad: f64,
    /// Periods left of the sample under way.
    left: u64,
    held: LawOutput,
}

impl FiniteStepLaw {
    /// From the robot and checked parameters; a sample is `periods` (≥ 1) control periods.
    pub fn new(setup: &LawSetup<'_>, params: FiniteStepParams, periods: u64) -> Self {
        let period_s = setup.period_ticks as f64 * TICK_S;
        let axis = |x, y, omega| setup.chassis.motor_use(BodyTwist::new(x, y, omega)).max(1e-9);
        let motor = [axis(1.0, 0.0, 0.0), axis(0.0, 1.0, 0.0), axis(0.0, 0.0, 1.0)];
        Self {
            params,
            v_max_mps: setup.limits.v_max_mps,
            // Half of the motors each at most, so that the two never quarrel; forwards gets the rest.
            sideways_max_mps: params.sideways_max_mps.min(setup.limits.v_max_mps).min(0.5 / motor[1]),
            yaw_max_radps: setup.limits.omega_max_radps.min(0.5 / motor[2]),
            motor,
            period_s,
            periods: periods.max(1),
            sample_s: periods.max(1) as f64 * period_s,
            solver: LeastEffort::new(params.fallback_steps_max as usize, params.max_iterations as u32),
            course: None,
            leg: None,
            crab_rad: 0.0,
            left: 0,
            held: LawOutput::sound(BodyTwist::ZERO),
        }
    }

    fn bounds(&self, now_mps: f64, elapsed: u64, path_radps: f64) -> Bounds {
        let jump_mps = self.params.accel_max_mps2 * self.sample_s;
        Bounds {
            speed_mps: self.sideways_max_mps,
            jump_mps,
            first_jump_mps: jump_mps * elapsed as f64 / self.periods as f64,
            now_mps,
            yaw_radps: self.yaw_max_radps,
            path_radps,
            ends: self.params.end_jumps,
        }
    }

    /// The plan from here: the one under way with its end kept, if the bounds allow, or the shortest.
    fn plan(&mut self, model: &Model, start: Deviation, bounds: &Bounds) -> Course {
        let params = &self.params;
        let (steps_min, steps_max) = (params.steps_min as usize, params.steps_max as usize);
        let valid = start.heading_rad.abs() <= params.validity_rad;
        let kept = self.course.map_or(0, |course| course.left());
        let mut search = Search {
            least: steps_min,
            most: params.fallback_steps_max as usize,
            turn: steps_min,
            synchronous: params.synchronous,
        };
        let closed =
            |least, most| valid.then(|| FiniteStep::shortest(model, start, bounds, least, most)).flatten();
        if kept > 0 {
            search.least = kept.min(search.most);
            search.turn = kept.min(steps_min);
            if let Some(plan) = closed(kept, kept) {
                return Course::closed(&plan);
            }
            let same_end = Search { most: search.least, ..search }.choose(model, start, bounds);
            if valid && same_end.can_land() {
                return self.constrained(&same_end, Fallback::Infeasible);
            }
        }
        if let Some(plan) = closed(search.least, steps_max.max(search.least)) {
            return Course::closed(&plan);
        }
        let why = if valid { Fallback::Infeasible } else { Fallback::OutsideValidity };
        self.constrained(&search.choose(model, start, bounds), why)
    }

    fn constrained(&mut self, problem: &constrained::Problem, why: Fallback) -> Course {
        let (v_x, fallback) = if problem.can_land() {
            let solved = self.solver.as_mut().and_then(|solver| solver.solve(problem));
            solved.map_or((problem.between(), Fallback::IterationCap), |v_x| (v_x, why))
        } else {
            (problem.between(), why)
        };
        Course { steps: problem.steps, done: 0, v_x, turn: problem.turn, fallback }
    }

    /// A new sample: what to hold until the next one. `now_mps`: v_x in action; `elapsed`: periods since
    /// the last sample; `changed`: the path's segment is another one.
    fn sample(&mut self, sight: &Sight, now_mps: f64, elapsed: u64, changed: bool) -> LawOutput {
        let along_mps = sight.along_mps.clamp(-self.v_max_mps, self.v_max_mps);
        let model = Model { sample_s: self.sample_s, along_mps, validity_rad: self.params.validity_rad };
        let path = (along_mps * sight.curvature_per_m).clamp(-self.yaw_max_radps, self.yaw_max_radps);
        let bounds = self.bounds(now_mps, elapsed, path);
        let blind = |course: &Course| {
            !self.params.receding
                && !changed
                && course.left() > 0
                && course.fallback != Fallback::OutsideValidity
        };
        let course = match self.course.filter(blind) {
            Some(course) => course,
            None => self.plan(&model, sight.deviation, &bounds),
        };
        let k = course.done.min(STEPS_CAP - 1);
        self.course = Some(Course { done: course.done + 1, ..course });
        let first = bounds.first_jump_mps;
        let (turn, mut v_x) = (course.turn.rate_radps(k, self.sample_s), course.v_x[k]);
        if bounds.ends || course.fallback != Fallback::None {
            // A plan in progress that a cut sample has come into.
            v_x = v_x.max(now_mps - first).min(now_mps + first);
        }
        let heading = if self.params.receding || k == 0 {
            sight.deviation.heading_rad
        } else {
            course.turn.heading_rad(k)
        };
        let omega_radps = (path - turn).clamp(-self.yaw_max_radps, self.yaw_max_radps);
        let vx_mps = self.forward(model.forward_mps(heading, v_x), v_x, omega_radps);
        LawOutput { twist: BodyTwist::new(vx_mps, -v_x, omega_radps), fallback: course.fallback }
    }

    /// The wanted forward speed, or what sideways speed and yaw rate leave of the robot's and the
    /// wheels' limits: the step generator then has nothing to shorten.
    fn forward(&self, wanted_mps: f64, v_x: f64, omega_radps: f64) -> f64 {
        let speed = libm::sqrt((self.v_max_mps * self.v_max_mps - v_x * v_x).max(0.0));
        let motors = 1.0 - self.motor[1] * v_x.abs() - self.motor[2] * omega_radps.abs();
        let most = speed.min(motors.max(0.0) / self.motor[0]);
        wanted_mps.clamp(-most, most)
    }
}

impl ControlLaw for FiniteStepLaw {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let crab_rad = inputs.reference.current.crab_rad;
        // The command of this step acts a period from now.
        let sight = Sight::new(moved(inputs.pose, inputs.acting, self.period_s), inputs.reference);
        let before = self.leg.replace(sight.leg);
        let changed = before.is_some_and(|leg| leg != sight.leg);
        let turned = before.is_some() && crab_rad != self.crab_rad;
        self.crab_rad = crab_rad;
        if self.left == 0 || changed || turned {
            let elapsed = self.periods - self.left;
            let acting = if turned { self.held.twist } else { inputs.acting };
            self.held = self.sample(&sight, -acting.vy_mps, elapsed, changed);
            self.left = self.periods;
        }
        self.left -= 1;
        self.held
    }

    fn reset(&mut self) {
        self.course = None;
        self.leg = None;
        self.left = 0;
    }

    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.option(&mut self.course, Course::BLANK, Course::visit_state);
        words.option(&mut self.leg, Leg::default(), Leg::visit_state);
        words.number(&mut self.crab_rad);
        words.count(&mut self.left, self.periods + 1);
        words.twist(&mut self.held.twist);
        words.code(&mut self.held.fallback, Fallback::code, Fallback::from_code);
    }
}

#[cfg(test)]
mod agv;
#[cfg(test)]
mod tests;
