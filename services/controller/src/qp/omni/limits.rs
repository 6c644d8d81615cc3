//! What a Mecanum robot's inputs may be, as pure numbers (speeds in v_hi, yaw rates in ω_max).

use crate::TwistLimits;
use crate::qp::frame::Scale;
use hilare_interfaces::chassis::MecanumParams;
use hilare_interfaces::geometry::BodyTwist;

/// Hard limits; twists are the body's own, in v_hi and ω_max.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Greatest speed, v_max/v_hi.
    pub speed: f64,
    /// Greatest wheel speed as the speed of its rim, r ω_i max/v_hi.
    pub wheel: f64,
    /// (L1 + L2) ω_max/v_hi: speed at a wheel of turning at ω_max.
    pub arm: f64,
    /// Greatest acceleration along x and y, in v_hi ω_max. Both together are a_max.
    pub accel: f64,
    /// Greatest yaw acceleration, in ω_max².
    pub yaw_accel: f64,
}

impl Limits {
    /// In the measures of `scale`.
    pub fn new(robot: &MecanumParams, limits: &TwistLimits, accel: (f64, f64), scale: &Scale) -> Self {
        let (v, w) = (scale.speed_mps, scale.omega_radps);
        Self {
            speed: limits.v_max_mps / v,
            wheel: robot.wheel_radius_m * robot.wheel_speed_max_radps / v,
            arm: (robot.half_wheelbase_m + robot.half_track_m) * w / v,
            accel: accel.0 / (core::f64::consts::SQRT_2 * v * w),
            yaw_accel: accel.1 / (w * w),
        }
    }

    /// Greatest |x| + |y| + arm |ω|, over the wheels' limit: `// [Qian18] (1)`.
    pub fn wheel_use(&self, twist: BodyTwist) -> f64 {
        (twist.vx_mps.abs() + twist.vy_mps.abs() + self.arm * twist.omega_radps.abs()) / self.wheel
    }

    /// A twist inside speed, yaw rate and wheel limits: its parts shortened as they must be.
    pub fn inside(&self, twist: BodyTwist) -> BodyTwist {
        let speed = libm::hypot(twist.vx_mps, twist.vy_mps);
        let shorten = if speed > self.speed { self.speed / speed } else { 1.0 };
        let omega = twist.omega_radps.clamp(-1.0, 1.0);
        let clamped = BodyTwist::new(twist.vx_mps * shorten, twist.vy_mps * shorten, omega);
        let wheel_use = self.wheel_use(clamped);
        if wheel_use > 1.0 { clamped.scaled(1.0 / wheel_use) } else { clamped }
    }

    /// The twist nearest to `wanted` on the way from `acting` (inside its limits) that can be reached in
    /// `time` and is inside every limit. Each set is convex and holds `acting`, and drawing a speed back
    /// to the disc brings it no farther from one on the disc, so none undoes what the others did.
    pub fn reach(&self, acting: BodyTwist, wanted: BodyTwist, time: f64) -> BodyTwist {
        let most = core::f64::consts::SQRT_2 * self.accel * time;
        let (dx, dy) = (wanted.vx_mps - acting.vx_mps, wanted.vy_mps - acting.vy_mps);
        let change = libm::hypot(dx, dy);
        let share = if change > most { most / change } else { 1.0 };
        let (x, y) = (acting.vx_mps + share * dx, acting.vy_mps + share * dy);
        let speed = libm::hypot(x, y);
        let shorten = if speed > self.speed { self.speed / speed } else { 1.0 };
        let turn = self.yaw_accel * time;
        let omega = wanted.omega_radps.clamp(acting.omega_radps - turn, acting.omega_radps + turn);
        let near = BodyTwist::new(x * shorten, y * shorten, omega.clamp(-1.0, 1.0));
        self.back_to_wheels(acting, near)
    }

    /// As far from `acting` towards `near` as the wheels allow.
    fn back_to_wheels(&self, acting: BodyTwist, near: BodyTwist) -> BodyTwist {
        let mut share: f64 = 1.0;
        for (sx, sy, sw) in SIGNS {
            let load = |t: BodyTwist| sx * t.vx_mps + sy * t.vy_mps + sw * self.arm * t.omega_radps;
            let (from, to) = (load(acting), load(near));
            if to > self.wheel && to > from {
                share = share.min(((self.wheel - from) / (to - from)).max(0.0));
            }
        }
        let mix = |a: f64, b: f64| a + share * (b - a);
        BodyTwist::new(
            mix(acting.vx_mps, near.vx_mps),
            mix(acting.vy_mps, near.vy_mps),
            mix(acting.omega_radps, near.omega_radps),
        )
    }
}

/// Signs of x, y and ω in the four wheels' limits, both directions of each: `// [Qian18] (1)`.
pub const SIGNS: [(f64, f64, f64); 8] = [
    (1.0, -1.0, -1.0),
    (1.0, 1.0, 1.0),
    (1.0, 1.0, -1.0),
    (1.0, -1.0, 1.0),
    (-1.0, 1.0, 1.0),
    (-1.0, -1.0, -1.0),
    (-1.0, -1.0, 1.0),
    (-1.0, 1.0, -1.0),
];
