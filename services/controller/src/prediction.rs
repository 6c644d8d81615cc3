//! Where the robot is by now, from a pose that is old.
//!
//! ```text
//!   measured                      now k      command of this step acts
//!  ────●────────────────────────────┼───────────┼──────▶ t
//!      │◀───── age of the pose ────▶│◀─ period ─▶│
//!  ◀τ─▶│                            │           the laws' own part
//!  └── what was commanded since ────┘
//! ```
//!
//! A camera's pose is as old as its processing takes, and held until the next picture; the estimator says
//! how old ([`Pose::measured_tick`]). It is moved on by what was commanded since. A servo of first order is
//! as good as a delay of its time constant τ, so the commands of τ more belong to it. Pose estimators that
//! work with odometry leave nothing to do here, and steppers have no τ: then the pose is passed on as it
//! is, to the bit.

use crate::{LawSetup, TwistLimits};
use hilare_interfaces::block::{TICK_S, Tick};
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::{BodyTwist, WorldPose};
use hilare_interfaces::messages::Pose;
use hilare_interfaces::param_group;
use hilare_interfaces::state::{STATE_WORDS, StateWords, Stateful};

param_group! {
    /// What every law is spared.
    PredictionParams {
        /// Move a pose that is old when it comes on to the present, by what was commanded since.
        predict: bool = true, "", 0, 1;
        /// Time constant of the drives, how long the robot takes to do what it is told: the pose is moved
        /// on by that much more. For a stepper 0.
        drive_lag_s: f64 = 0.0, "s", 0.0, 0.5;
    }
}

/// Oldest pose that is moved on by its whole age; an older one is of a camera that has gone blind.
const AGE_MAX_S: f64 = 1.0;
/// Most periods that are remembered; what acted before them is taken to be as in the oldest. A twelfth of
/// the state's words is left for the rest of a controller. With periods of a tick it is 1.25 s.
const PERIODS_MAX: usize = STATE_WORDS * 11 / 12 / 3;

/// What the robot was told, and can do.
#[derive(Clone, Debug)]
pub struct Prediction {
    params: PredictionParams,
    chassis: Chassis,
    limits: TwistLimits,
    period_ticks: u64,
    /// What acted in each of the last periods, the newest at `newest`; a ring.
    twists: Vec<BodyTwist>,
    newest: usize,
}

impl Prediction {
    /// For the robot of `setup`, which stands. Allocates for the oldest pose.
    pub fn new(params: PredictionParams, setup: &LawSetup<'_>) -> Self {
        let period_ticks = setup.period_ticks;
        let longest = (AGE_MAX_S + params.drive_lag_s) / (period_ticks as f64 * TICK_S);
        Self {
            params,
            chassis: *setup.chassis,
            limits: setup.limits,
            period_ticks,
            twists: vec![BodyTwist::ZERO; (libm::ceil(longest) as usize + 1).min(PERIODS_MAX)],
            newest: 0,
        }
    }

    /// Goes on with what `before` was told, as far back as this one reaches.
    pub fn take_over(&mut self, before: &Self) {
        let (len, old) = (self.twists.len(), before.twists.len());
        for age in 0..len {
            // As ever, what acted before the oldest is taken to be as that one.
            let twist = before.twists[(before.newest + old - age.min(old - 1)) % old];
            self.twists[len - 1 - age] = twist;
        }
        self.newest = len - 1;
    }

    /// A period has passed in which `twist` acted, as far as the input constraints let it.
    pub fn note(&mut self, twist: BodyTwist) {
        self.newest = (self.newest + 1) % self.twists.len();
        self.twists[self.newest] = self.carried_out(twist);
    }

    /// What the input constraints let through of a command.
    fn carried_out(&self, twist: BodyTwist) -> BodyTwist {
        if !twist.is_finite() {
            return BodyTwist::ZERO;
        }
        self.limits.carried_out(&self.chassis, twist)
    }

    /// `pose` at tick `now`.
    pub fn present(&self, pose: &Pose, now: Tick) -> WorldPose {
        let age_s = (now.saturating_sub(pose.measured_tick) as f64 * TICK_S).min(AGE_MAX_S);
        let age_s = if self.params.predict { age_s } else { 0.0 };
        let periods = (age_s + self.params.drive_lag_s) / (self.period_ticks as f64 * TICK_S);
        let mut moving = pose.pose();
        if periods <= 0.0 {
            return moving;
        }
        let (len, period_s) = (self.twists.len(), self.period_ticks as f64 * TICK_S);
        let whole = libm::floor(periods + 1e-9) as usize;
        let mut go = |age: usize, time_s: f64| {
            moving = moved(moving, self.twists[(self.newest + len - age.min(len - 1)) % len], time_s);
        };
        let part = periods - whole as f64;
        if part > 0.0 {
            go(whole, part * period_s);
        }
        (0..whole).rev().for_each(|age| go(age, period_s));
        moving
    }
}

impl Stateful for Prediction {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.index(&mut self.newest, self.twists.len());
        self.twists.iter_mut().for_each(|twist| words.twist(twist));
    }
}

/// Where a constant twist leads in `time_s`: exact, on an arc.
pub fn moved(pose: WorldPose, twist: BodyTwist, time_s: f64) -> WorldPose {
    let turn = twist.omega_radps * time_s;
    let half = turn / 2.0;
    // Chord over arc.
    let short = if half.abs() < 1e-4 { 1.0 - half * half / 6.0 } else { libm::sin(half) / half };
    let (sin, cos) = libm::sincos(pose.theta_rad + half);
    let (x, y) = (twist.vx_mps * short * time_s, twist.vy_mps * short * time_s);
    WorldPose::new(pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y, pose.theta_rad + turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::acceptance::Acceptance;
    use hilare_interfaces::chassis::MecanumParams;

    const PERIOD: u64 = 10;

    /// Has been told `twist` for longer than anything here reaches back.
    fn used_to(twist: BodyTwist, mut prediction: Prediction) -> Prediction {
        (0..prediction.twists.len()).for_each(|_| prediction.note(twist));
        prediction
    }

    fn prediction(drive_lag_s: f64) -> Prediction {
        let setup = LawSetup {
            chassis: &Chassis::Mecanum(MecanumParams::default()),
            limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 1.0, omega_max_radps: 2.0 },
            acceptance_radius_m: 0.1,
            acceptance: Acceptance::Passed,
            period_ticks: PERIOD,
            values: &[],
        };
        Prediction::new(PredictionParams { drive_lag_s, ..PredictionParams::default() }, &setup)
    }

    /// A robot that does exactly what it is told, `lag` ticks later; its pose is seen `delay` ticks late
    /// and held for `picture` ticks.
    fn worst_error_m(delay: u64, picture: u64, lag: u64) -> f64 {
        let twist = |tick: u64| {
            let phase = 0.005 * (tick / PERIOD * PERIOD) as f64;
            BodyTwist::new(0.3, 0.05 * libm::sin(phase), 0.4 * libm::cos(0.7 * phase))
        };
        let mut truth = vec![WorldPose::new(0.2, -0.1, 0.3)];
        for tick in 0..3000 {
            let told = if tick < lag { BodyTwist::ZERO } else { twist(tick - lag) };
            truth.push(moved(truth[tick as usize], told, TICK_S));
        }
        let mut prediction = prediction(lag as f64 * TICK_S);
        let mut worst: f64 = 0.0;
        for now in (0..2900).step_by(PERIOD as usize) {
            if now > 0 {
                prediction.note(twist(now - PERIOD));
            }
            let measured_tick = now.saturating_sub(delay) / picture * picture;
            let seen = Pose { measured_tick, ..Pose::at(now, truth[measured_tick as usize]) };
            let present = prediction.present(&seen, now);
            if now > 1000 {
                // Where the robot will be when it has done what it has been told by now.
                let wanted = truth[(now + lag) as usize];
                worst = worst.max(present.position().distance_m(wanted.position()));
                worst = worst.max((present.theta_rad - wanted.theta_rad).abs());
            }
        }
        worst
    }

    #[test]
    fn a_late_and_held_pose_of_a_lagging_robot_is_moved_on_to_where_it_is() {
        for (delay, picture, lag) in
            [(0, 1, 0), (80, 1, 0), (84, 1, 0), (80, 100, 0), (35, 40, 50), (0, 1, 37)]
        {
            let error = worst_error_m(delay, picture, lag);
            assert!(error < 1e-12, "{delay} {picture} {lag}: {error}");
        }
    }

    #[test]
    fn a_fresh_pose_is_passed_on_to_the_bit_and_a_blind_camera_is_not_trusted_for_ever() {
        let prediction = used_to(BodyTwist::new(0.3, 0.0, 0.1), prediction(0.0));
        let pose = WorldPose::new(0.1, 0.2, 0.3);
        assert_eq!(prediction.present(&Pose::at(7000, pose), 7000), pose);
        let old = Pose { measured_tick: 0, ..Pose::at(7000, WorldPose::default()) };
        let present = prediction.present(&old, 7000);
        assert!(present.position().distance_m(WorldPose::default().position()) <= 0.3 * AGE_MAX_S + 1e-12);
        let raw = Prediction { params: PredictionParams { predict: false, drive_lag_s: 0.0 }, ..prediction };
        assert_eq!(raw.present(&old, 7000), WorldPose::default());
    }

    #[test]
    fn what_no_robot_can_do_is_not_reckoned_with() {
        let mut prediction = used_to(BodyTwist::new(5.0, 0.0, 1e9), prediction(0.0));
        let old = Pose { measured_tick: 900, ..Pose::at(1000, WorldPose::default()) };
        let present = prediction.present(&old, 1000);
        assert!(present.theta_rad <= 0.2 + 1e-9 && present.x_m <= 0.1, "{present:?}");
        prediction.note(BodyTwist::new(f64::NAN, 0.0, 0.0));
        assert!(prediction.present(&old, 1000).theta_rad.is_finite());
    }
}
