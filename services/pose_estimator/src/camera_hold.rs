//! The newest fix as it is: late, noisy, and held until the next one comes.
//!
//! What the robots of papers 2 and 3 are controlled by. Only the heading is worked on: it is unwrapped,
//! because the laws' poses are not wrapped.

use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::messages::PoseFix;

/// The estimator.
#[derive(Clone, Debug)]
pub struct CameraHold {
    pose: WorldPose,
}

impl CameraHold {
    /// At `start` until the first fix comes.
    pub const fn new(start: WorldPose) -> Self {
        Self { pose: start }
    }

    /// The pose after these fixes, the oldest first; those that are not finite are passed over.
    pub fn step(&mut self, fixes: &[PoseFix]) -> WorldPose {
        let finite = |fix: &&PoseFix| fix.pose().position().is_finite() && fix.theta_rad.is_finite();
        if let Some(fix) = fixes.iter().rev().find(finite) {
            let turn = wrap_angle_rad(fix.theta_rad - self.pose.theta_rad);
            self.pose = WorldPose::new(fix.x_m, fix.y_m, self.pose.theta_rad + turn);
        }
        self.pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;

    #[test]
    fn it_holds_the_newest_fix_and_unwraps_its_heading() {
        let mut hold = CameraHold::new(WorldPose::new(0.0, 0.0, 3.0));
        assert_eq!(hold.step(&[]), WorldPose::new(0.0, 0.0, 3.0));
        let fix = |x_m, theta_rad| PoseFix { x_m, theta_rad, ..PoseFix::ZERO };
        let pose = hold.step(&[fix(1.0, 3.0), fix(2.0, -3.0), fix(f64::NAN, 0.0)]);
        assert_eq!(pose.x_m, 2.0);
        assert!((pose.theta_rad - (core::f64::consts::TAU - 3.0)).abs() < 1e-12);
        assert_eq!(hold.step(&[]), pose);
    }
}
