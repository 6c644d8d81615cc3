//! Where the robot will be when a command begins to act, from a pose that is old.
//!
//! ```text
//!   picture       used, held            now       command of this step acts
//!  ────●────────────┼─ ─ ─ ─ ─ ─ ─ ─ ─ ─ ┼───────────┼──────▶ t
//!      │◀── lag ──▶│◀─ held: pose as it was ─▶│◀ a period ▶│
//!      └───────── own past commands ─────────┴── acting ──┘
//! ```
//!
//! The pose is moved on by what was commanded since it held. That it is held (a camera takes pictures
//! more seldom than a law is called) is seen by its standing still. A servo of first order is as good as
//! a delay of its time constant; it counts into the lag.

use hilare_interfaces::geometry::{BodyTwist, WorldPose};

/// Longest time a pose is taken to be held; from then on it is taken for a robot that stands.
const HELD_MAX_S: f64 = 0.5;

/// The past commands.
#[derive(Clone, Debug)]
pub struct History {
    /// What acted in each of the last periods, in the robot's frame; a ring.
    twists: Vec<BodyTwist>,
    newest: usize,
    period_s: f64,
    /// Whole periods of the lag and the part of one that is left.
    lag_periods: usize,
    lag_part: f64,
    held: usize,
    held_max: usize,
    /// The pose of the call before and its crab angle.
    seen: Option<(WorldPose, f64)>,
}

impl History {
    /// For commands `period_s` apart and poses that are `lag_s` old when they come. Allocates.
    pub fn new(period_s: f64, lag_s: f64) -> Self {
        let lag = lag_s / period_s;
        let lag_periods = libm::floor(lag + 1e-9) as usize;
        let held_max = libm::floor(HELD_MAX_S / period_s) as usize;
        Self {
            twists: vec![BodyTwist::ZERO; lag_periods + held_max + 2],
            newest: 0,
            period_s,
            lag_periods,
            lag_part: (lag - lag_periods as f64).max(0.0),
            held: 0,
            held_max,
            seen: None,
        }
    }

    /// Forgets; the next call's `acting` then counts as having acted for ever.
    pub fn clear(&mut self) {
        self.seen = None;
    }

    /// Takes in the pose and the twist that acts from now on for a period, both in the course frame of
    /// this crab angle.
    pub fn see(&mut self, pose: WorldPose, acting: BodyTwist, crab_rad: f64) {
        let own = acting.turned(crab_rad);
        self.newest = (self.newest + 1) % self.twists.len();
        match self.seen {
            None => {
                self.twists.fill(own);
                self.held = 0;
            }
            Some((before, crab)) => {
                let place = (before.x_m, before.y_m) == (pose.x_m, pose.y_m);
                let held = place && (before.theta_rad == pose.theta_rad || crab != crab_rad);
                self.held = if held { (self.held + 1).min(self.held_max) } else { 0 };
                self.twists[self.newest] = own;
            }
        }
        self.seen = Some((pose, crab_rad));
    }

    /// The pose seen last, at the moment from which this step's command acts.
    pub fn predict(&self) -> Option<WorldPose> {
        let (mut pose, crab_rad) = self.seen?;
        let len = self.twists.len();
        let mut go = |age: usize, time_s: f64| {
            let twist = self.twists[(self.newest + len - age) % len];
            pose = moved(pose, twist.turned(-crab_rad), time_s);
        };
        let whole = self.lag_periods + self.held + 1;
        if self.lag_part > 0.0 {
            go(whole, self.lag_part * self.period_s);
        }
        for age in (0..whole).rev() {
            go(age, self.period_s);
        }
        Some(pose)
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

    /// A robot that does exactly what is commanded; its pose is seen `lag` periods late and held.
    fn worst_error_m(lag_periods: usize, part: f64, picture_periods: usize, crab_rad: f64) -> f64 {
        let (period_s, calls) = (0.01, 300);
        let twist = |n: usize| {
            let phase = 0.05 * n as f64;
            BodyTwist::new(0.3, 0.05 * libm::sin(phase), 0.4 * libm::cos(0.7 * phase))
        };
        let mut truth = vec![WorldPose::new(0.2, -0.1, 0.3)];
        (0..calls).for_each(|n| truth.push(moved(truth[n], twist(n), period_s)));
        let mut history = History::new(period_s, (lag_periods as f64 + part) * period_s);
        let mut worst: f64 = 0.0;
        for n in 100..calls {
            let picture = (n - lag_periods) / picture_periods * picture_periods;
            let mut pose = truth[picture];
            if part > 0.0 {
                pose = moved(truth[picture - 1], twist(picture - 1), (1.0 - part) * period_s);
            }
            pose.theta_rad += crab_rad;
            history.see(pose, twist(n).turned(-crab_rad), crab_rad);
            let predicted = history.predict().expect("it has seen one");
            if n > 200 {
                worst = worst.max(predicted.position().distance_m(truth[n + 1].position()));
                worst = worst.max((predicted.theta_rad - crab_rad - truth[n + 1].theta_rad).abs());
            }
        }
        worst
    }

    #[test]
    fn a_late_and_held_pose_is_moved_on_to_where_the_robot_is() {
        for (lag, part, picture, crab) in
            [(0, 0.0, 1, 0.0), (8, 0.0, 1, 0.0), (8, 0.4, 1, 0.0), (8, 0.0, 10, 0.0), (5, 0.5, 7, 1.2)]
        {
            let error = worst_error_m(lag, part, picture, crab);
            assert!(error < 1e-12, "{lag} {part} {picture} {crab}: {error}");
        }
    }

    #[test]
    fn a_robot_that_stands_is_not_run_away_from() {
        let mut history = History::new(0.005, 0.0);
        for _ in 0..10_000 {
            history.see(WorldPose::default(), BodyTwist::new(0.3, 0.0, 0.0), 0.0);
        }
        let predicted = history.predict().expect("it has seen one");
        assert!(predicted.x_m <= 0.3 * (HELD_MAX_S + 0.005) + 1e-12, "{predicted:?}");
        history.clear();
        assert_eq!(history.predict(), None);
    }
}
