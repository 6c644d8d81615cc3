//! What laws share that drive any chassis as a unicycle: forwards, and by yaw rate.

use crate::TwistLimits;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::BodyTwist;

/// L, m: where the wheels' rims move at v ± Lω. Half the track of a differential drive; for Mecanum
/// `[Qian18] (1)` has L1 + L2 in its place.
pub(crate) fn half_track_m(chassis: &Chassis) -> f64 {
    match chassis {
        Chassis::Differential(p) => p.track_m / 2.0,
        Chassis::Mecanum(p) => p.half_wheelbase_m + p.half_track_m,
    }
}

/// Along a curvature (1/m) at `speed_mps`, or as much slower as the yaw rate limit asks for: a robot of
/// which only the yaw rate was cut would leave the bend.
pub(crate) fn bend(speed_mps: f64, curvature_per_m: f64, limits: &TwistLimits) -> BodyTwist {
    let twist = finite(BodyTwist::new(speed_mps, 0.0, speed_mps * curvature_per_m));
    let excess = twist.omega_radps.abs() / limits.omega_max_radps;
    if excess > 1.0 { twist.scaled(1.0 / excess) } else { twist }
}

/// The twist, or none where it is beyond what a number can hold.
pub(crate) fn finite(twist: BodyTwist) -> BodyTwist {
    if twist.is_finite() { twist } else { BodyTwist::ZERO }
}
