//! What a message may say and still make sense: looked at where it is read, because the other end may be
//! any program. What is outside is not computed with; it may not be a number at all.

use super::{PREVIEW, Pose, PoseFix, Reference, Steps, Truth, Waypoint};
use crate::geometry::{BodyTwist, WorldPose};

/// Farthest from the origin a place may be along each axis, m: the size of the earth.
pub const PLACE_MAX_M: f64 = 1e7;
/// Greatest heading, not wrapped, rad: a robot that has turned for years.
pub const HEADING_MAX_RAD: f64 = 1e9;
/// Greatest speed, m/s, and yaw rate, rad/s: no robot goes there.
pub const SPEED_MAX_MPS: f64 = 1e3;
/// Greatest |bulge|: an arc within a thousandth of the full circle. 0 is a line.
pub const BULGE_MAX: f64 = 1e3;
/// Least |bulge| of an arc: a millimetre off a line that leads round the earth.
pub const BULGE_MIN: f64 = 1e-10;
/// Greatest |crab angle|, rad: a full turn.
pub const CRAB_MAX_RAD: f64 = core::f64::consts::TAU;

/// Latest tick: beyond, not every tick has an f64 of its own.
pub const TICK_MAX: u64 = 1 << 53;

/// True unless a number is greater than `most`, or none.
const fn within(value: f64, most: f64) -> bool {
    value.abs() <= most
}

impl Waypoint {
    /// A place on earth, a segment to it that is a line or an arc, and a crab angle.
    pub const fn makes_sense(&self) -> bool {
        // Without branches: a path has many.
        within(self.x_m, PLACE_MAX_M)
            & within(self.y_m, PLACE_MAX_M)
            & within(self.bulge, BULGE_MAX)
            & ((self.bulge == 0.0) | (self.bulge.abs() >= BULGE_MIN))
            & within(self.crab_rad, CRAB_MAX_RAD)
    }
}

impl WorldPose {
    /// A place on earth, and a heading.
    pub const fn makes_sense(&self) -> bool {
        within(self.x_m, PLACE_MAX_M)
            && within(self.y_m, PLACE_MAX_M)
            && within(self.theta_rad, HEADING_MAX_RAD)
    }
}

impl BodyTwist {
    /// Speeds of a robot.
    pub const fn makes_sense(&self) -> bool {
        within(self.vx_mps, SPEED_MAX_MPS)
            && within(self.vy_mps, SPEED_MAX_MPS)
            && within(self.omega_radps, SPEED_MAX_MPS)
    }
}

impl Pose {
    /// Its pose does.
    pub const fn makes_sense(&self) -> bool {
        self.pose().makes_sense()
    }
}

impl PoseFix {
    /// Its pose does.
    pub const fn makes_sense(&self) -> bool {
        self.pose().makes_sense()
    }
}

impl Truth {
    /// Its pose does.
    pub const fn makes_sense(&self) -> bool {
        self.pose().makes_sense()
    }
}

impl Reference {
    /// All the waypoints it has do, and its speed.
    pub fn makes_sense(&self) -> bool {
        self.preview_len <= PREVIEW as u64
            && within(self.speed_mps, SPEED_MAX_MPS)
            && self.last.makes_sense()
            && self.ahead().fold(true, |all, waypoint| all & waypoint.makes_sense())
    }
}

impl Steps {
    /// Its twist does; wheel speeds are for the drives to judge.
    pub const fn makes_sense(&self) -> bool {
        self.commanded_twist().makes_sense()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::WireField;

    #[test]
    fn what_is_no_number_or_no_place_makes_no_sense() {
        let at = |x_m| Pose { x_m, ..Pose::ZERO };
        for (x_m, sense) in [
            (0.0, true),
            (-1e7, true),
            (f64::MIN_POSITIVE / 2.0, true),
            (1.1e7, false),
            (f64::NAN, false),
            (f64::NEG_INFINITY, false),
        ] {
            assert_eq!(at(x_m).makes_sense(), sense, "{x_m}");
        }
        assert!(!Pose { theta_rad: 1e10, ..Pose::ZERO }.makes_sense());
        let bulge = |bulge| Waypoint { bulge, ..Waypoint::ZERO }.makes_sense();
        assert!(bulge(0.0) && bulge(-2.4) && !bulge(1e-300) && !bulge(f64::INFINITY));
    }

    #[test]
    fn a_reference_is_judged_by_the_waypoints_it_has() {
        let mut reference = Reference::ZERO;
        reference.preview[1].y_m = f64::NAN;
        reference.preview_len = 1;
        assert!(reference.makes_sense(), "what lies beyond its preview is nothing");
        reference.preview_len = 2;
        assert!(!reference.makes_sense());
        assert!(!Reference { preview_len: u64::MAX, ..Reference::ZERO }.makes_sense());
        assert!(!Reference { speed_mps: f64::NAN, ..Reference::ZERO }.makes_sense());
    }
}
