//! Dead reckoning from cumulative counts, paper 1 eq. (30), (31).
//!
//! Position is summed by Euler's rule with the heading before the tick, as the paper does. The
//! heading is not summed but computed from the counts, which makes it free of rounding drift and
//! independent of lost messages. If messages were lost, the missing steps are still in the counts;
//! they are then taken as one arc.
use hilare_interfaces::block::Tick;
use hilare_interfaces::chassis::{Chassis, PerWheel};
use hilare_interfaces::geometry::{BodyTwist, WorldPose};
use hilare_interfaces::state::{StateWords, Stateful};

/// The estimator.
#[derive(Clone, Debug)]
pub struct DeadReckoning {
    chassis: Chassis,
    count_rad: f64,
    /// Heading gained by one count of each wheel, rad.
    heading_per_count_rad: PerWheel<f64>,
    start_heading_rad: f64,
    pose: WorldPose,
    cos_sin: (f64, f64),
    counts: PerWheel<i64>,
    tick: Tick,
}

impl DeadReckoning {
    /// Starts at `start` with no steps counted. `count_rad` is the wheel angle of one count, for a stepper β.
    pub fn new(chassis: Chassis, count_rad: f64, start: WorldPose) -> Self {
        let mut heading_per_count_rad = [0.0; 4];
        for (wheel, gain) in heading_per_count_rad.iter_mut().enumerate() {
            let mut one = [0.0; 4];
            one[wheel] = count_rad;
            *gain = chassis.twist(one).omega_radps;
        }
        let (sin, cos) = libm::sincos(start.theta_rad);
        Self {
            chassis,
            count_rad,
            heading_per_count_rad,
            start_heading_rad: start.theta_rad,
            pose: start,
            cos_sin: (cos, sin),
            counts: [0; 4],
            tick: 0,
        }
    }

    /// The heading after these cumulative counts, rad, not wrapped; wheels that are left out have counted nothing.
    #[inline]
    pub fn heading_rad<const WHEELS: usize>(&self, counts: [f64; WHEELS]) -> f64 {
        let turned: f64 = counts.iter().zip(self.heading_per_count_rad).map(|(n, gain)| n * gain).sum();
        self.start_heading_rad + turned
    }

    /// What the body moves by in its own frame while the wheels count so much, m and rad: [MH18] (30), (3).
    #[inline]
    pub fn moved(&self, counts: PerWheel<f64>) -> BodyTwist {
        self.chassis.twist(counts.map(|count| self.count_rad * count))
    }

    fn advance(&mut self, tick: Tick, counts: &PerWheel<i64>) {
        let mut since = [0.0; 4];
        for (wheel, since) in since.iter_mut().enumerate() {
            *since = counts[wheel].wrapping_sub(self.counts[wheel]) as f64;
        }
        let moved = self.moved(since);
        let heading_rad = self.heading_rad(counts.map(|count| count as f64));
        if tick != self.tick.wrapping_add(1) {
            // Messages were lost: the chord of an arc points along the mean heading.
            let (sin, cos) = libm::sincos((self.pose.theta_rad + heading_rad) / 2.0);
            self.cos_sin = (cos, sin);
        }
        // [MH18] (31), (2)
        let (cos, sin) = self.cos_sin;
        self.pose.x_m += moved.vx_mps * cos - moved.vy_mps * sin;
        self.pose.y_m += moved.vx_mps * sin + moved.vy_mps * cos;
        self.pose.theta_rad = heading_rad;
        let (sin, cos) = libm::sincos(heading_rad);
        self.cos_sin = (cos, sin);
        self.counts = *counts;
    }
}

impl DeadReckoning {
    /// The pose after the counts of tick `tick`; a repeated or older tick changes nothing.
    #[inline]
    pub fn step(&mut self, tick: Tick, counts: &PerWheel<i64>) -> WorldPose {
        if tick >= self.tick {
            if *counts != self.counts {
                self.advance(tick, counts);
            }
            self.tick = tick;
        }
        self.pose
    }
}

impl Stateful for DeadReckoning {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.tick);
        self.counts.iter_mut().for_each(|count| words.signed(count));
        words.pose(&mut self.pose);
        let mut cos_sin = [self.cos_sin.0, self.cos_sin.1];
        words.finite(&mut cos_sin);
        self.cos_sin = (cos_sin[0], cos_sin[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::chassis::{DifferentialParams, MecanumParams};
    use proptest::prelude::*;

    const STEP_RAD: f64 = 0.13 / 20.0;

    fn estimator() -> DeadReckoning {
        let chassis = Chassis::Differential(DifferentialParams::default());
        DeadReckoning::new(chassis, STEP_RAD, WorldPose::new(0.2, 0.2, 0.0))
    }

    fn counts(right: i64, left: i64) -> PerWheel<i64> {
        [right, left, 0, 0]
    }

    #[test]
    fn straight_ahead_is_the_step_length() {
        let mut estimator = estimator();
        let mut pose = WorldPose::default();
        for n in 0..=1000 {
            pose = estimator.step(n, &counts(n as i64, n as i64));
        }
        assert!((pose.x_m - (0.2 + 0.13)).abs() < 1e-12);
        assert_eq!((pose.y_m, pose.theta_rad), (0.2, 0.0));
    }

    #[test]
    fn sideways_mecanum_steps_move_it_sideways() {
        let chassis = Chassis::Mecanum(MecanumParams::default());
        let mut estimator =
            DeadReckoning::new(chassis, 0.01, WorldPose::new(0.0, 0.0, core::f64::consts::FRAC_PI_2));
        let pose = estimator.step(1, &[-10, 10, 10, -10]);
        assert!((pose.x_m + 10.0 * 0.01 * 0.05).abs() < 1e-12 && pose.y_m.abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn lost_messages_lose_no_step(
            moves in proptest::collection::vec((-1i64..=1, -1i64..=1), 50..400),
            lost in proptest::collection::vec(any::<bool>(), 400),
        ) {
            let (mut whole, mut holes) = (estimator(), estimator());
            let (mut right, mut left) = (0, 0);
            let mut pair = (WorldPose::default(), WorldPose::default());
            for (n, (r, l)) in moves.iter().enumerate() {
                right += r;
                left += l;
                let tick = n as u64 + 1;
                pair.0 = whole.step(tick, &counts(right, left));
                if !lost[n] || n + 1 == moves.len() {
                    pair.1 = holes.step(tick, &counts(right, left));
                }
            }
            let (a, b) = pair;
            prop_assert_eq!(a.theta_rad, b.theta_rad, "the heading is exact");
            // A step is 0.13 mm and turns it by 2.4 mrad; arcs of lost stretches differ in second order.
            prop_assert!(libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m) < 2e-4 * moves.len() as f64 / 10.0);
        }

        #[test]
        fn old_messages_change_nothing(right in 0i64..50, left in 0i64..50) {
            let mut estimator = estimator();
            let pose = estimator.step(9, &counts(right, left));
            prop_assert_eq!(estimator.step(4, &counts(1, 0)), pose);
        }
    }
}
