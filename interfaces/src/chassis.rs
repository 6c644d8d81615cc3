//! Kinematics of the supported chassis and how far a twist lies inside what the motors can do.
//!
//! Differential drive: paper 1, eq. (3), (4). Mecanum: paper 3, eq. (1), and as its inverse the
//! least-squares one, because the printed eq. (2) is misprinted (spec 3).

use crate::geometry::BodyTwist;
use crate::param_group;

/// Most wheels a chassis can have; shorter chassis leave the rest at zero.
pub const MAX_WHEELS: usize = 4;

/// A value a wheel; differential: `[right, left, 0, 0]`.
pub type PerWheel<T> = [T; MAX_WHEELS];

param_group! {
    /// Differential drive (Hilare type): two driven wheels on one axle.
    DifferentialParams {
        /// Distance between the wheels' contact points, w_T.
        track_m: f64 = 0.054, "m", 0.005, 5.0;
        /// Wheel diameter, d_w.
        wheel_diameter_m: f64 = 0.040, "m", 0.002, 2.0;
        /// Highest speed of the right wheel, ω1max.
        wheel_speed_max_right_radps: f64 = 3.25, "rad/s", 0.01, 1000.0;
        /// Highest speed of the left wheel, ω2max.
        wheel_speed_max_left_radps: f64 = 3.25, "rad/s", 0.01, 1000.0;
    }
}

param_group! {
    /// Four Mecanum wheels, rollers at 45°.
    MecanumParams {
        /// Half the wheelbase, L1.
        half_wheelbase_m: f64 = 0.2, "m", 0.005, 5.0;
        /// Half the track, L2.
        half_track_m: f64 = 0.15, "m", 0.005, 5.0;
        /// Wheel radius, r.
        wheel_radius_m: f64 = 0.05, "m", 0.002, 2.0;
        /// Highest speed of each wheel.
        wheel_speed_max_radps: f64 = 20.0, "rad/s", 0.01, 1000.0;
    }
}

impl DifferentialParams {
    /// Speeds of the right and the left wheel, rad/s, that give the body `vx_mps` and `omega_radps`.
    #[inline]
    pub fn wheel_speeds(&self, vx_mps: f64, omega_radps: f64) -> [f64; 2] {
        // [MH18] (4)
        let turn = self.track_m * omega_radps;
        [(2.0 * vx_mps + turn) / self.wheel_diameter_m, (2.0 * vx_mps - turn) / self.wheel_diameter_m]
    }

    /// [`Chassis::motor_use`] of a forward speed and a yaw rate.
    #[inline]
    pub fn motor_use(&self, vx_mps: f64, omega_radps: f64) -> f64 {
        // [MH18] (17)–(22): |v|/a + |ω| w_T/(2a), a the top linear speed.
        let a = self.wheel_diameter_m / 4.0
            * (self.wheel_speed_max_right_radps + self.wheel_speed_max_left_radps);
        vx_mps.abs() / a + omega_radps.abs() * self.track_m / (2.0 * a)
    }
}

/// A chassis: how body motion and wheel motion belong together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Chassis {
    /// Two wheels: right, left.
    Differential(DifferentialParams),
    /// Four wheels: front left, front right, rear left, rear right.
    Mecanum(MecanumParams),
}

impl Chassis {
    /// Name used in system files.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Differential(_) => "differential",
            Self::Mecanum(_) => "mecanum",
        }
    }

    /// Number of driven wheels.
    pub const fn wheels(&self) -> usize {
        match self {
            Self::Differential(_) => 2,
            Self::Mecanum(_) => 4,
        }
    }

    /// Radius of the wheels, m.
    pub const fn wheel_radius_m(&self) -> f64 {
        match self {
            Self::Differential(p) => p.wheel_diameter_m / 2.0,
            Self::Mecanum(p) => p.wheel_radius_m,
        }
    }

    /// True if it can move sideways.
    pub const fn is_omnidirectional(&self) -> bool {
        matches!(self, Self::Mecanum(_))
    }

    /// Highest speed of each wheel, rad/s.
    pub const fn wheel_speed_max_radps(&self) -> PerWheel<f64> {
        match self {
            Self::Differential(p) => [p.wheel_speed_max_right_radps, p.wheel_speed_max_left_radps, 0.0, 0.0],
            Self::Mecanum(p) => [p.wheel_speed_max_radps; MAX_WHEELS],
        }
    }

    /// Wheel speeds (rad/s) that give the body `twist`.
    pub fn wheel_speeds(&self, twist: BodyTwist) -> PerWheel<f64> {
        match self {
            Self::Differential(p) => {
                let [right, left] = p.wheel_speeds(twist.vx_mps, twist.omega_radps);
                [right, left, 0.0, 0.0]
            }
            Self::Mecanum(p) => {
                // [Qian18] (1)
                let turn = (p.half_wheelbase_m + p.half_track_m) * twist.omega_radps;
                let (x, y, r) = (twist.vx_mps, twist.vy_mps, p.wheel_radius_m);
                [(x - y - turn) / r, (x + y + turn) / r, (x + y - turn) / r, (x - y + turn) / r]
            }
        }
    }

    /// Body twist that `wheels` (rad/s) give; for Mecanum the least-squares one. Linear, so wheel
    /// angles (rad) give a body displacement (m, m, rad) as well.
    pub fn twist(&self, wheels: PerWheel<f64>) -> BodyTwist {
        match self {
            Self::Differential(p) => {
                // [MH18] (3)
                let quarter = p.wheel_diameter_m / 4.0;
                BodyTwist::new(
                    quarter * (wheels[0] + wheels[1]),
                    0.0,
                    2.0 * quarter / p.track_m * (wheels[0] - wheels[1]),
                )
            }
            Self::Mecanum(p) => {
                let [a, b, c, d] = wheels;
                let quarter = p.wheel_radius_m / 4.0;
                let arm = p.half_wheelbase_m + p.half_track_m;
                BodyTwist::new(
                    quarter * (a + b + c + d),
                    quarter * (-a + b + c - d),
                    quarter / arm * (-a + b - c + d),
                )
            }
        }
    }

    /// How much of the motors' range a twist uses: at most 1 inside the motor diamond, above 1
    /// outside. Dividing the twist by it keeps the curvature.
    pub fn motor_use(&self, twist: BodyTwist) -> f64 {
        match self {
            Self::Differential(p) => p.motor_use(twist.vx_mps, twist.omega_radps),
            Self::Mecanum(p) => {
                let fastest = self.wheel_speeds(twist).into_iter().fold(0.0, |top: f64, w| top.max(w.abs()));
                fastest / p.wheel_speed_max_radps
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn both() -> [Chassis; 2] {
        [Chassis::Differential(DifferentialParams::default()), Chassis::Mecanum(MecanumParams::default())]
    }

    proptest! {
        #[test]
        fn forward_undoes_inverse(vx in -1.0..1.0f64, vy in -1.0..1.0f64, omega in -3.0..3.0f64) {
            for chassis in both() {
                let vy = if chassis.wheels() == 2 { 0.0 } else { vy };
                let back = chassis.twist(chassis.wheel_speeds(BodyTwist::new(vx, vy, omega)));
                prop_assert!((back.vx_mps - vx).abs() < 1e-12);
                prop_assert!((back.vy_mps - vy).abs() < 1e-12);
                prop_assert!((back.omega_radps - omega).abs() < 1e-12);
            }
        }

        #[test]
        fn the_motor_diamond_is_where_the_faster_wheel_meets_its_limit(
            vx in -1.0..1.0f64, vy in -1.0..1.0f64, omega in -10.0..10.0f64,
        ) {
            for chassis in both() {
                let vy = if chassis.wheels() == 2 { 0.0 } else { vy };
                let twist = BodyTwist::new(vx, vy, omega);
                let limit = chassis.wheel_speed_max_radps();
                let fastest = chassis.wheel_speeds(twist).iter().zip(limit)
                    .filter(|(_, limit)| *limit > 0.0)
                    .map(|(w, limit)| w.abs() / limit)
                    .fold(0.0, f64::max);
                prop_assert!((chassis.motor_use(twist) - fastest).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn mecanum_null_space_is_wheel_slip() {
        let chassis = Chassis::Mecanum(MecanumParams::default());
        // Orthogonal to the three columns of (1): the wheels work against each other.
        let twist = chassis.twist([1.0, 1.0, -1.0, -1.0]);
        assert_eq!(twist, BodyTwist::ZERO);
    }

    #[test]
    fn sideways_mecanum_turns_its_diagonals_against_each_other() {
        let chassis = Chassis::Mecanum(MecanumParams::default());
        let [fl, fr, rl, rr] = chassis.wheel_speeds(BodyTwist::new(0.0, 0.1, 0.0));
        assert!(fl < 0.0 && fr > 0.0 && rl > 0.0 && rr < 0.0);
    }
}
