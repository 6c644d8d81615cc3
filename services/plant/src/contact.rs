//! Contact with the floor, and what all servo-driven robots share.
//!
//! A contact pushes against sliding with Coulomb's force, made smooth near zero:
//! `F = −μN · s / (|s| + s₀)`, s the sliding speed. The integrators take the factor of s
//! ([`drag_nspm`]) from the speed before a sub-step and s itself from after it (a secant, backward
//! Euler). That is a linear system whose matrix only ever takes energy out, so it is stable for every
//! step length, mass and coefficient.

use core::f64::consts::TAU;
use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::WorldPose;

/// Sliding speed at which a contact carries half its limit, s₀, m/s: the creep of rubber.
pub const CREEP_MPS: f64 = 0.005;
/// Standard gravity, m/s².
pub const GRAVITY_MPS2: f64 = 9.806_65;
/// Ticks made up at most when messages were lost; a longer silence is not driven through.
pub const MISSED_TICKS_MAX: u64 = 100;
/// Set points beyond this are cut, rad/s; no wheel comes near it.
const SET_POINT_MAX_RADPS: f64 = 1e9;

/// Force of a contact per sliding speed, N·s/m: at most `limit_n` in all. With torques and yaw rates
/// (N·m, rad/s) it is a dry bearing's.
#[inline]
pub fn drag_nspm(limit_n: f64, sliding_mps: f64, soft_mps: f64) -> f64 {
    limit_n / (sliding_mps.abs() + soft_mps)
}

/// A vector turned by 2·atan(`half`): by the angle 2·`half` if that is small, and never longer or
/// shorter.
#[inline]
pub fn turned([x, y]: [f64; 2], half: f64) -> [f64; 2] {
    let scale = 1.0 / (1.0 + half * half);
    let (cos, sin) = ((1.0 - half * half) * scale, 2.0 * half * scale);
    [cos * x - sin * y, sin * x + cos * y]
}

/// Moves a pose by a body velocity (m/s, m/s, rad/s), along the heading half-way.
#[inline]
pub fn advance(pose: &mut WorldPose, [vx, vy, omega]: [f64; 3], dt_s: f64) {
    let turn = omega * dt_s;
    let (sin, cos) = libm::sincos(pose.theta_rad + turn / 2.0);
    pose.x_m += dt_s * (cos * vx - sin * vy);
    pose.y_m += dt_s * (sin * vx + cos * vy);
    pose.theta_rad += turn;
}

/// Ticks to make up for a message: 0 for a repeated or older one.
#[inline]
pub fn ticks_due(last: Tick, now: Tick) -> u64 {
    now.saturating_sub(last).min(MISSED_TICKS_MAX)
}

/// A wheel speed a drive accepts; it takes what is no number for 0.
#[inline]
pub fn set_point(radps: f64) -> f64 {
    if radps.is_nan() { 0.0 } else { radps.clamp(-SET_POINT_MAX_RADPS, SET_POINT_MAX_RADPS) }
}

/// What an encoder shows at a wheel angle.
#[inline]
pub fn encoder_counts(angle_rad: f64, counts_per_turn: f64) -> i64 {
    libm::floor(angle_rad * (counts_per_turn / TAU) + 0.5) as i64
}
