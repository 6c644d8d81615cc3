//! The finite-step plan, paper 3 eq. (12), (16), (20)–(22), and what bounds it: pure mathematics.
//!
//! ```text
//!   e_θ ●                        e_θ(k) = (N−k)/N e_θ(0)                 (16)  a straight line to zero
//!       │ ●                      e_d(k+1) = e_d(k) + T v_τ e_θ(k)
//!       │   ●                                      − T v_x(k) (1 + e_θ²(k))      (12)
//!       │     ●                  least ½ Σ v_x² with e_d(N) = 0:
//!       └───────●─ k             v_x(k) = c T (1 + e_θ²(k))              (21), c from (20)
//!       0       N
//! ```
//!
//! Letters and signs are the paper's: e_d and v_x as in the module above, Δω the rate at which e_θ falls.
//!
//! Misprints mended: (7) has + Δω, (12) −; (12) it is. (21) prints ω_z(k) = (N−k)/(N T) e_θ(0), which
//! does not land on zero (at N = 10 and 5° it ends at −22.5°); what gives (16) is Δω = e_θ(0)/(N T).
//! (22) leaves out the jump from the v_x in action to v_x(0), and so allows N = 1 nearly always; ours
//! bounds that jump and the one to rest at the end as well ([`Bounds`]), unless told not to.
//!
//! Outside its validity, |e_θ| ≤ 8°, (12) is not used as it stands: the robot drives no faster than that
//! its drift T v_τ e_θ stays that of the rim, and facing backwards it only turns.

use hilare_interfaces::state::{StateWords, Stateful};

/// Most steps a plan can have.
pub const STEPS_CAP: usize = 40;

/// Pose state of the robot against its path, e_θ and e_d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// e_θ: heading minus the path's, rad, counter-clockwise.
    pub heading_rad: f64,
    /// e_d: distance to the path, m, positive if the robot is to its left.
    pub distance_m: f64,
}

/// The discrete model, paper 3 eq. (12).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Sample period T_s, s.
    pub sample_s: f64,
    /// Speed along the path v_τ, m/s.
    pub along_mps: f64,
    /// |e_θ| up to which (12) holds, rad.
    pub validity_rad: f64,
}

impl Model {
    /// Share of a speed along or across the path that is left outside the validity.
    fn share(&self, heading_rad: f64) -> f64 {
        if heading_rad.abs() <= self.validity_rad {
            return 1.0;
        }
        (libm::cos(heading_rad) / libm::cos(self.validity_rad)).max(0.0)
    }

    /// Growth of e_d in a sample for want of heading, T v_τ e_θ.
    pub fn drift_m(&self, heading_rad: f64) -> f64 {
        if heading_rad.abs() > self.validity_rad && libm::cos(heading_rad) <= 0.0 {
            return 0.0;
        }
        self.sample_s * self.along_mps * heading_rad.clamp(-self.validity_rad, self.validity_rad)
    }

    /// Fall of e_d in a sample by one m/s of v_x: T (1 + e_θ²).
    pub fn gain_s(&self, heading_rad: f64) -> f64 {
        let valid = heading_rad.clamp(-self.validity_rad, self.validity_rad);
        self.sample_s * (1.0 + valid * valid) * self.share(heading_rad)
    }

    /// Forward speed at which the speed along the path is v_τ: (9), v_τ = v_y cos e_θ + v_x sin e_θ.
    pub fn forward_mps(&self, heading_rad: f64, v_x: f64) -> f64 {
        let (sin, cos) = libm::sincos(heading_rad);
        if cos <= 0.0 {
            0.0
        } else if heading_rad.abs() <= self.validity_rad {
            (self.along_mps - v_x * sin) / cos
        } else {
            self.along_mps * libm::sin(self.validity_rad) / sin.abs()
        }
    }

    /// The next pose state: `// [Qian18] (12)`.
    pub fn next(&self, state: Deviation, turn_radps: f64, v_x: f64) -> Deviation {
        let e = state.heading_rad;
        Deviation {
            heading_rad: e - turn_radps * self.sample_s,
            distance_m: state.distance_m + self.drift_m(e) - self.gain_s(e) * v_x,
        }
    }
}

/// How e_θ falls: by Δω T a step until it is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    start_rad: f64,
    step_rad: f64,
}

impl Turn {
    /// Of no deviation.
    pub const NONE: Self = Self { start_rad: 0.0, step_rad: 0.0 };

    /// To zero in `steps`: `// [Qian18] (16)`.
    pub fn within(start_rad: f64, steps: usize) -> Self {
        Self::by(start_rad, start_rad.abs() / steps.max(1) as f64)
    }

    /// Towards zero by `step_rad` (≥ 0) a step.
    pub fn by(start_rad: f64, step_rad: f64) -> Self {
        Self { start_rad, step_rad }
    }

    /// e_θ(k).
    pub fn heading_rad(&self, k: usize) -> f64 {
        let left = self.start_rad.abs() - k as f64 * self.step_rad;
        left.max(0.0).copysign(self.start_rad)
    }

    /// Δω(k), rad/s.
    pub fn rate_radps(&self, k: usize, sample_s: f64) -> f64 {
        (self.heading_rad(k) - self.heading_rad(k + 1)) / sample_s
    }
}

impl Stateful for Turn {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.finite(core::slice::from_mut(&mut self.start_rad));
        words.finite(core::slice::from_mut(&mut self.step_rad));
    }
}

/// The constraint set, paper 3 eq. (5), as it meets a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Greatest |v_x|, m/s.
    pub speed_mps: f64,
    /// Greatest change of v_x from one step to the next, a_max T_s, m/s.
    pub jump_mps: f64,
    /// The same from what acts now to the first step: less after a shortened sample.
    pub first_jump_mps: f64,
    /// v_x in action, m/s.
    pub now_mps: f64,
    /// Greatest yaw rate, rad/s.
    pub yaw_radps: f64,
    /// Yaw rate the path itself asks for, v_τ κ, rad/s.
    pub path_radps: f64,
    /// The jumps into and out of a plan count too; the paper's (22) leaves them out.
    pub ends: bool,
}

impl Bounds {
    /// True if e_θ may fall at this rate.
    pub fn allow_turn(&self, turn_radps: f64) -> bool {
        (self.path_radps - turn_radps).abs() <= self.yaw_radps * (1.0 + 1e-12)
    }

    /// The greatest part of a wanted rate that is allowed, towards zero at least none.
    pub fn clip_turn(&self, turn_radps: f64) -> f64 {
        let (lo, hi) = (self.path_radps - self.yaw_radps, self.path_radps + self.yaw_radps);
        turn_radps.max(lo.min(0.0)).min(hi.max(0.0))
    }
}

/// The plan in closed form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiniteStep {
    /// N.
    pub steps: usize,
    /// c of (20), m/s².
    pub c: f64,
    turn: Turn,
    sample_s: f64,
}

impl FiniteStep {
    /// The least effort that brings both deviations to zero in `steps` (at least 1).
    pub fn new(model: &Model, start: Deviation, steps: usize) -> Self {
        let n = steps.max(1) as f64;
        let (t, e) = (model.sample_s, start.heading_rad);
        let square = e * e;
        // [Qian18] (20)
        let c1 = (n + 1.0) * (2.0 * n + 1.0) * (3.0 * n * n + 3.0 * n - 1.0) / (30.0 * n * n * n);
        let c2 = (n + 1.0) * (2.0 * n + 1.0) / (3.0 * n);
        let way = start.distance_m + t * model.along_mps * (n + 1.0) / 2.0 * e;
        let c = way / (t * t * (c1 * square * square + n + c2 * square));
        Self { steps: steps.max(1), c, turn: Turn::within(e, steps), sample_s: t }
    }

    /// v_x(k), m/s; 0 behind the end.
    pub fn v_x(&self, k: usize) -> f64 {
        if k >= self.steps {
            return 0.0;
        }
        let e = self.turn.heading_rad(k);
        // [Qian18] (21)
        self.c * self.sample_s * (e * e + 1.0)
    }

    /// The fall of e_θ, (16).
    pub const fn turn(&self) -> Turn {
        self.turn
    }

    /// True if it keeps the bounds: (22), and the yaw rate. |v_x| falls with k, and so do its jumps.
    pub fn keeps(&self, bounds: &Bounds) -> bool {
        let (first, last) = (self.v_x(0), self.v_x(self.steps - 1));
        let inside = self.steps == 1 || (first - self.v_x(1)).abs() <= bounds.jump_mps;
        let ends = (first - bounds.now_mps).abs() <= bounds.first_jump_mps && last.abs() <= bounds.jump_mps;
        first.abs() <= bounds.speed_mps
            && inside
            && (ends || !bounds.ends)
            && bounds.allow_turn(self.turn.rate_radps(0, self.sample_s))
    }

    /// The shortest one of `least..=most` steps that keeps the bounds: `// [Qian18] (22)`.
    pub fn shortest(
        model: &Model,
        start: Deviation,
        bounds: &Bounds,
        least: usize,
        most: usize,
    ) -> Option<Self> {
        (least..=most).map(|steps| Self::new(model, start, steps)).find(|plan| plan.keeps(bounds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table(along_mps: f64) -> (Model, Deviation) {
        let model = Model { sample_s: 0.1, along_mps, validity_rad: 8_f64.to_radians() };
        (model, Deviation { heading_rad: 5_f64.to_radians(), distance_m: 0.01 })
    }

    /// Tables 1 and 2, from rest or with the ends left out.
    fn bounds(ends: bool) -> Bounds {
        Bounds {
            speed_mps: 0.5,
            jump_mps: 0.005,
            first_jump_mps: 0.005,
            now_mps: 0.0,
            yaw_radps: 2.0,
            path_radps: 0.0,
            ends,
        }
    }

    /// End state and greatest |e_d| of a plan carried out on the model.
    fn carry_out(model: &Model, start: Deviation, plan: &FiniteStep) -> (Deviation, f64) {
        let (mut state, mut peak) = (start, start.distance_m.abs());
        for k in 0..plan.steps {
            state = model.next(state, plan.turn().rate_radps(k, model.sample_s), plan.v_x(k));
            peak = peak.max(state.distance_m.abs());
        }
        (state, peak)
    }

    #[test]
    fn the_reference_values_of_tables_1_and_2() {
        // c, v_x(0) m/s, peak |e_d| m; worked out from the paper's equations apart from this code.
        for (along, steps, c, v_x, peak) in [
            (0.3, 10, Some(0.2426), Some(0.02444), 0.0102),
            (0.5, 10, Some(0.3380), Some(0.03406), 0.0115),
            (0.3, 20, None, None, 0.0124),
            (0.5, 20, None, None, 0.0164),
        ] {
            let (model, start) = table(along);
            let plan = FiniteStep::new(&model, start, steps);
            assert!(c.is_none_or(|c: f64| (plan.c - c).abs() < 5e-5), "{}", plan.c);
            assert!(v_x.is_none_or(|v: f64| (plan.v_x(0) - v).abs() < 5e-6), "{}", plan.v_x(0));
            let reached = carry_out(&model, start, &plan).1;
            assert!((reached - peak).abs() < 5e-5, "{along} {steps}: {reached}");
        }
    }

    #[test]
    fn both_deviations_end_at_zero() {
        for along in [0.3, 0.5] {
            for steps in [5, 8, 10, 12, 20] {
                let (model, start) = table(along);
                let (end, _) = carry_out(&model, start, &FiniteStep::new(&model, start, steps));
                assert!(end.heading_rad.abs() < 1e-15 && end.distance_m.abs() < 1e-15, "{steps}: {end:?}");
            }
        }
    }

    #[test]
    fn what_22_allows_as_printed_and_with_the_ends_counted() {
        for along in [0.3, 0.5] {
            let (model, start) = table(along);
            let shortest = |bounds| FiniteStep::shortest(&model, start, &bounds, 1, 1000);
            assert_eq!(shortest(bounds(false)).map(|plan| plan.steps), Some(1));
            // v_x(0) tends to v_τ e_θ/2 = 13 and 22 mm/s with growing N; the jump may be 5 mm/s.
            assert_eq!(shortest(bounds(true)), None);
        }
    }

    proptest! {
        /// (20), (21) are the optimum: J does not fall along any direction that keeps (19).
        #[test]
        fn no_neighbour_that_lands_costs_less(
            heading in -0.139..0.139f64, distance in -0.1..0.1f64, along in 0.0..1.0f64,
            steps in 2usize..=20, i in 0usize..20, j in 0usize..20, size in -0.1..0.1f64,
        ) {
            let (i, j) = (i % steps, j % steps);
            prop_assume!(i != j);
            let model = Model { sample_s: 0.1, along_mps: along, validity_rad: 0.14 };
            let start = Deviation { heading_rad: heading, distance_m: distance };
            let plan = FiniteStep::new(&model, start, steps);
            let (end, _) = carry_out(&model, start, &plan);
            prop_assert!(end.heading_rad.abs() < 1e-14 && end.distance_m.abs() < 1e-14);
            let gain = |k: usize| model.gain_s(plan.turn().heading_rad(k));
            let effort = |shift: f64| -> f64 {
                let v = |k: usize| plan.v_x(k)
                    + if k == i { shift / gain(i) } else if k == j { -shift / gain(j) } else { 0.0 };
                (0..steps).map(|k| 0.5 * v(k) * v(k)).sum()
            };
            prop_assert!(effort(size) >= effort(0.0) - 1e-15);
        }

        #[test]
        fn outside_the_validity_it_still_turns_towards_the_path(heading in -3.1..3.1f64, along in 0.0..1.0f64) {
            let model = Model { sample_s: 0.1, along_mps: along, validity_rad: 0.14 };
            // The drift is never more than that of the rim, and the robot never backs.
            prop_assert!(model.drift_m(heading).abs() <= 0.1 * along * 0.14 * (1.0 + 1e-12));
            prop_assert!(model.gain_s(heading) >= 0.0);
            if heading.abs() > 0.14 {
                let forward = model.forward_mps(heading, 0.05);
                prop_assert!((0.0..=along * (1.0 + 1e-12)).contains(&forward));
                prop_assert!(forward * libm::sin(heading).abs() <= along * 0.14);
            }
        }
    }
}
