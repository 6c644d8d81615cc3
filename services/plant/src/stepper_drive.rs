//! A two-wheeled robot on stepper motors (the e-puck of paper 1), as seen by an overhead camera.
//!
//! ```text
//!        left ●───────w_T───────● right      each wheel rolls s = steps · length of a step
//!             │\       M        │            · (1 + diameter error) · (1 − slip)
//!        s_L  │ \______●________│ s_R        the contact points move on circles about a common
//!             ▼                 ▼            centre: M moves (s_L + s_R)/2 along an arc that turns
//!                                            the axle by (s_R − s_L)/w_T
//! ```
//!
//! The arc is followed exactly, not by Euler's rule, so truth and estimate part by the estimator's
//! own integration error even when nothing slips.

use crate::noise::Noise;
use crate::start::start_errors;
use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::Steps;
use hilare_interfaces::param_group;
use hilare_interfaces::state::{StateWords, Stateful};

param_group! {
    /// What the control path does not know.
    StepperDriveParams {
        /// Mean share of a step's travel lost to slip, both wheels.
        slip_mean: f64 = 0.0, "", -0.5, 0.9;
        /// Standard deviation of that share from step to step.
        slip_sd: f64 = 0.0, "", 0.0, 0.5;
        /// Relative error of the right wheel's diameter.
        wheel_error_right: f64 = 0.0, "", -0.5, 0.5;
        /// Relative error of the left wheel's diameter.
        wheel_error_left: f64 = 0.0, "", -0.5, 0.5;
        /// Relative error of the track.
        track_error: f64 = 0.0, "", -0.5, 0.5;
        /// True start is this much ahead of the assumed one, along world x.
        start_error_x_m: f64 = 0.0, "m", -1.0, 1.0;
        /// True start is this much ahead of the assumed one, along world y.
        start_error_y_m: f64 = 0.0, "m", -1.0, 1.0;
        /// True start heading minus the assumed one.
        start_error_theta_rad: f64 = 0.0, "rad", -3.2, 3.2;
        /// Standard deviation of a random start error, each of x and y.
        start_sd_m: f64 = 0.0, "m", 0.0, 1.0;
        /// Standard deviation of a random start heading error.
        start_sd_rad: f64 = 0.0, "rad", 0.0, 3.2;
        /// Seed of slip and start errors.
        seed: u64 = 1, "", 0, 9007199254740991u64;
    }
}

/// The robot: what its maker built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Distance between the wheels' contact points, m.
    pub track_m: f64,
    /// Rim travel of one step, m: of a pulse.
    pub step_length_m: f64,
}

/// A robot whose steps are all alike, because its slip does not vary: all there is to know of its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steady {
    /// What the contact points travel with a step, right and left, m.
    pub rolled_m: [f64; 2],
    /// Distance between them, m.
    pub track_m: f64,
    /// Where it is.
    pub pose: WorldPose,
}

/// The robot.
#[derive(Clone, Debug)]
pub struct StepperDrive {
    params: StepperDriveParams,
    /// Rim travel of a step, right and left, before slip.
    travel_m: [f64; 2],
    track_m: f64,
    pose: WorldPose,
    counts: [i64; 2],
    noise: Noise,
    tick: Tick,
}

impl StepperDrive {
    /// At `start` (the pose the control path assumes) plus the start errors.
    pub fn new(body: Body, params: StepperDriveParams, start: WorldPose) -> Self {
        let mut noise = Noise::new(params.seed);
        let pose = start_errors!(params).displaced(start, &mut noise);
        Self {
            params,
            travel_m: [params.wheel_error_right, params.wheel_error_left]
                .map(|error| body.step_length_m * (1.0 + error)),
            track_m: body.track_m * (1.0 + params.track_error),
            pose,
            counts: [0; 2],
            noise,
            tick: 0,
        }
    }

    /// Goes on where `before` is, with parameters of its own.
    pub fn take_over(&mut self, before: &Self) {
        (self.pose, self.counts, self.tick) = (before.pose, before.counts, before.tick);
        self.noise.clone_from(&before.noise);
    }

    /// The robot as it stands, if all its steps are alike.
    pub fn steady(&self) -> Option<Steady> {
        let keep = 1.0 - self.params.slip_mean;
        let rolled_m = self.travel_m.map(|travel_m| travel_m * keep);
        let steady = Steady { rolled_m, track_m: self.track_m, pose: self.pose };
        (self.params.slip_sd == 0.0).then_some(steady)
    }

    /// What a wheel's contact point travels for `steps` steps, m.
    fn rolled_m(&mut self, wheel: usize, steps: i64) -> f64 {
        if steps == 0 {
            return 0.0;
        }
        let mut slip = self.params.slip_mean;
        if self.params.slip_sd > 0.0 {
            slip += self.params.slip_sd * self.noise.normal();
        }
        steps as f64 * self.travel_m[wheel] * (1.0 - slip)
    }

    fn roll(&mut self, right_steps: i64, left_steps: i64) {
        let right = self.rolled_m(0, right_steps);
        let left = self.rolled_m(1, left_steps);
        let turn = (right - left) / self.track_m;
        let arc = (right + left) / 2.0;
        // The chord of an arc: sin(h)/h of its length, along the heading half-way. For the small
        // angles of a tick the series is exact to the last bit.
        let half = turn / 2.0;
        let chord = if half.abs() < 1e-2 {
            let h2 = half * half;
            arc * (1.0 - h2 / 6.0 * (1.0 - h2 / 20.0 * (1.0 - h2 / 42.0)))
        } else {
            arc * libm::sin(half) / half
        };
        let (sin, cos) = libm::sincos(self.pose.theta_rad + half);
        self.pose.x_m += chord * cos;
        self.pose.y_m += chord * sin;
        self.pose.theta_rad += turn;
    }
}

impl StepperDrive {
    /// The true pose after the steps of a tick; an older message changes nothing.
    #[inline]
    pub fn step(&mut self, steps: &Steps) -> WorldPose {
        if steps.tick >= self.tick {
            let counts = [steps.counts[0], steps.counts[1]];
            if counts != self.counts {
                let right = counts[0].wrapping_sub(self.counts[0]);
                let left = counts[1].wrapping_sub(self.counts[1]);
                self.roll(right, left);
                self.counts = counts;
            }
            self.tick = steps.tick;
        }
        self.pose
    }
}

impl Stateful for StepperDrive {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.pose(&mut self.pose);
        self.counts.iter_mut().for_each(|count| words.signed(count));
        self.noise.visit_state(words);
        words.word(&mut self.tick);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use hilare_interfaces::layout::WireField;

    const BODY: Body = Body { track_m: 0.054, step_length_m: 0.000_13 };

    fn drive(params: StepperDriveParams, moves: impl Iterator<Item = (i64, i64)>) -> WorldPose {
        let mut plant = StepperDrive::new(BODY, params, WorldPose::default());
        let mut steps = Steps::ZERO;
        let mut truth = WorldPose::default();
        for (right, left) in moves {
            steps.tick += 1;
            steps.counts[0] += right;
            steps.counts[1] += left;
            truth = plant.step(&steps);
        }
        truth
    }

    #[test]
    fn a_circle_of_the_right_wheel_closes() {
        // The right wheel rolls about the standing left one: midpoint on a circle of radius w_T/2.
        let half_turn_steps = PI * BODY.track_m / BODY.step_length_m;
        let pose = drive(StepperDriveParams::default(), (0..half_turn_steps.round() as i64).map(|_| (1, 0)));
        assert!((pose.theta_rad - PI).abs() < 0.002, "{pose:?}");
        assert!((pose.y_m - BODY.track_m).abs() < 1e-4 && pose.x_m.abs() < 1e-4, "{pose:?}");
    }

    #[test]
    fn one_big_arc_equals_many_small_ones() {
        let params = StepperDriveParams::default();
        let small = drive(params, (0..400).map(|_| (2, 1)));
        let big = drive(params, core::iter::once((800, 400)));
        assert!((small.x_m - big.x_m).abs() < 1e-12 && (small.y_m - big.y_m).abs() < 1e-12);
        assert!((small.theta_rad - big.theta_rad).abs() < 1e-12);
    }

    #[test]
    fn slip_shortens_and_unequal_wheels_turn() {
        let slipping = StepperDriveParams { slip_mean: 0.05, ..StepperDriveParams::default() };
        let pose = drive(slipping, (0..1000).map(|_| (1, 1)));
        assert!((pose.x_m - 0.95 * 0.13).abs() < 1e-12 && pose.theta_rad == 0.0);
        let unequal = StepperDriveParams { wheel_error_right: 0.01, ..StepperDriveParams::default() };
        let pose = drive(unequal, (0..1000).map(|_| (1, 1)));
        assert!((pose.theta_rad - 0.01 * 0.13 / 0.054).abs() < 1e-12);
    }

    #[test]
    fn noise_has_the_asked_spread_and_repeats_with_its_seed() {
        let noisy = |seed| StepperDriveParams {
            slip_sd: 0.1,
            start_sd_m: 0.01,
            seed,
            ..StepperDriveParams::default()
        };
        let run = |seed| drive(noisy(seed), (0..500).map(|_| (1, 1)));
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
        let starts: std::vec::Vec<f64> = (0..2000)
            .map(|seed| StepperDrive::new(BODY, noisy(seed), WorldPose::default()).pose.x_m)
            .collect();
        let mean = starts.iter().sum::<f64>() / 2000.0;
        let sd = libm::sqrt(starts.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 1999.0);
        assert!(mean.abs() < 0.001 && (sd - 0.01).abs() < 0.001, "{mean} {sd}");
    }
}
