//! Points, poses and twists, world and body kept apart by type (REP-103, REP-105 `map` and
//! `base_link`).
//!
//! Transcendental functions come from the `libm` crate, not from the system's C library, so that a
//! recording made on a robot replays to the same bits on another machine.

use core::f64::consts::{PI, TAU};

/// A point in the world frame, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WorldPoint {
    /// World x, metres.
    pub x_m: f64,
    /// World y, metres.
    pub y_m: f64,
}

impl WorldPoint {
    /// A point from its coordinates in metres.
    pub const fn new(x_m: f64, y_m: f64) -> Self {
        Self { x_m, y_m }
    }

    /// Euclidean distance to `other`, metres.
    pub fn distance_m(self, other: Self) -> f64 {
        libm::hypot(other.x_m - self.x_m, other.y_m - self.y_m)
    }

    /// True when both coordinates are finite.
    pub fn is_finite(self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite()
    }
}

/// Position and heading of the robot's midpoint in the world frame (paper 1, eq. 1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WorldPose {
    /// World x, metres.
    pub x_m: f64,
    /// World y, metres.
    pub y_m: f64,
    /// Heading, radians, counter-clockwise from world x; not wrapped.
    pub theta_rad: f64,
}

impl WorldPose {
    /// A pose from metres and radians.
    pub const fn new(x_m: f64, y_m: f64, theta_rad: f64) -> Self {
        Self { x_m, y_m, theta_rad }
    }

    /// The position alone.
    pub const fn position(self) -> WorldPoint {
        WorldPoint::new(self.x_m, self.y_m)
    }
}

/// Velocity of the robot in its own frame (REP-103 `base_link`: x forward, y left).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyTwist {
    /// Forward speed, m/s.
    pub vx_mps: f64,
    /// Sideways speed to the left, m/s; 0 for a differential drive.
    pub vy_mps: f64,
    /// Yaw rate, rad/s, counter-clockwise.
    pub omega_radps: f64,
}

impl BodyTwist {
    /// Standing still.
    pub const ZERO: Self = Self { vx_mps: 0.0, vy_mps: 0.0, omega_radps: 0.0 };

    /// A twist from m/s, m/s and rad/s.
    pub const fn new(vx_mps: f64, vy_mps: f64, omega_radps: f64) -> Self {
        Self { vx_mps, vy_mps, omega_radps }
    }

    /// Every component times `factor`: the same path at another speed (curvature is kept).
    pub fn scaled(self, factor: f64) -> Self {
        Self::new(self.vx_mps * factor, self.vy_mps * factor, self.omega_radps * factor)
    }

    /// The same motion seen from a frame turned by −`angle_rad`: its linear part turns by `angle_rad`.
    pub fn turned(self, angle_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(angle_rad);
        Self::new(
            cos * self.vx_mps - sin * self.vy_mps,
            sin * self.vx_mps + cos * self.vy_mps,
            self.omega_radps,
        )
    }

    /// Linear speed, m/s, signed by the forward component when there is no sideways one.
    pub fn speed_mps(self) -> f64 {
        if self.vy_mps == 0.0 { self.vx_mps } else { libm::hypot(self.vx_mps, self.vy_mps) }
    }

    /// True when all components are finite.
    pub fn is_finite(self) -> bool {
        self.vx_mps.is_finite() && self.vy_mps.is_finite() && self.omega_radps.is_finite()
    }
}

/// Error of a pose against a target, in the robot's own frame (paper 1, eq. 5).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyError {
    /// Along the robot's x axis, metres.
    pub x_m: f64,
    /// Along the robot's y axis, metres.
    pub y_m: f64,
    /// Heading error, radians, in (−π, π].
    pub theta_rad: f64,
}

impl BodyError {
    /// Target minus pose, turned into the robot's frame: `// [MH18] (5)`.
    pub fn between(pose: WorldPose, target: WorldPose) -> Self {
        let (x_m, y_m) = seen_along(libm::sincos(pose.theta_rad), pose.position(), target.position());
        Self { x_m, y_m, theta_rad: wrap_angle_rad(target.theta_rad - pose.theta_rad) }
    }
}

/// Where `target` is seen from `from` by one who looks along a heading of this sine and cosine: how far ahead and
/// how far to the left, metres: `// [MH18] (5)`.
#[inline]
pub fn seen_along((sin, cos): (f64, f64), from: WorldPoint, target: WorldPoint) -> (f64, f64) {
    let (dx, dy) = (target.x_m - from.x_m, target.y_m - from.y_m);
    (cos * dx + sin * dy, -sin * dx + cos * dy)
}

/// Below this size, 3π rad, [`wrap_once_rad`] is [`wrap_angle_rad`].
pub const WRAPPED_ONCE_RAD: f64 = 3.0 * PI;

/// A turn less or more for an angle outside (−π, π]. Nothing is rounded: from π to 4π the difference to a turn is a
/// number of its own. (The zero of a whole turn may have the other sign.)
#[inline]
pub fn wrap_once_rad(angle_rad: f64) -> f64 {
    if angle_rad > PI {
        angle_rad - TAU
    } else if angle_rad <= -PI {
        angle_rad + TAU
    } else {
        angle_rad
    }
}

/// The same angle in (−π, π].
pub fn wrap_angle_rad(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    // IEEE remainder rounds to nearest, so it lands in [−π, π]; −π is the same direction as π.
    let wrapped = libm::remainder(angle_rad, TAU);
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn wrapping_keeps_the_direction(angle in -1e4..1e4f64) {
            let wrapped = wrap_angle_rad(angle);
            prop_assert!(wrapped > -PI - 1e-12 && wrapped <= PI + 1e-12);
            prop_assert!((libm::sin(wrapped) - libm::sin(angle)).abs() < 1e-9);
            prop_assert!((libm::cos(wrapped) - libm::cos(angle)).abs() < 1e-9);
        }

        #[test]
        fn body_error_does_not_depend_on_where_the_world_is(
            x in -5.0..5.0f64, y in -5.0..5.0f64, th in -3.0..3.0f64,
            tx in -5.0..5.0f64, ty in -5.0..5.0f64, tth in -3.0..3.0f64, turn in -3.0..3.0f64,
        ) {
            let rotate = |p: WorldPose| {
                let (s, c) = libm::sincos(turn);
                WorldPose::new(c * p.x_m - s * p.y_m, s * p.x_m + c * p.y_m, p.theta_rad + turn)
            };
            let (a, b) = (WorldPose::new(x, y, th), WorldPose::new(tx, ty, tth));
            let here = BodyError::between(a, b);
            let there = BodyError::between(rotate(a), rotate(b));
            prop_assert!((here.x_m - there.x_m).abs() < 1e-9);
            prop_assert!((here.y_m - there.y_m).abs() < 1e-9);
            prop_assert!(wrap_angle_rad(here.theta_rad - there.theta_rad).abs() < 1e-9);
        }
    }

    #[test]
    fn wrapping_once_is_wrapping_below_three_half_turns() {
        let mut angle = -WRAPPED_ONCE_RAD;
        while angle < WRAPPED_ONCE_RAD {
            angle += 0.000_917;
            for near in [angle, PI, TAU, 3.0 * PI].map(|at| at + angle * 1e-15) {
                for angle in [near, -near, near.next_up(), near.next_down()] {
                    let (once, wrapped) = (wrap_once_rad(angle), wrap_angle_rad(angle));
                    assert!(once == wrapped || angle.abs() >= WRAPPED_ONCE_RAD, "{angle} {once} {wrapped}");
                }
            }
        }
    }

    #[test]
    fn half_turns_wrap_to_plus_pi() {
        assert_eq!(wrap_angle_rad(PI), PI);
        assert!((wrap_angle_rad(-PI) - PI).abs() < 1e-15);
        assert!((wrap_angle_rad(3.0 * PI).abs() - PI).abs() < 1e-12);
    }
}
