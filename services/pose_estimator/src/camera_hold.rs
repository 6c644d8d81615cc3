//! The newest fix as it is: late, noisy, and held until the next one comes.
//!
//! What the robots of papers 2 and 3 are controlled by. Only the heading is worked on: it is unwrapped,
//! because the laws' poses are not wrapped.

use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::messages::{Pose, PoseFix};
use hilare_interfaces::state::{StateWords, Stateful};

/// The estimator.
#[derive(Clone, Debug)]
pub struct CameraHold {
    pose: WorldPose,
    measured_tick: Tick,
}

impl CameraHold {
    /// At `start` until the first fix comes.
    pub const fn new(start: WorldPose) -> Self {
        Self { pose: start, measured_tick: 0 }
    }

    /// The pose after these fixes, the oldest first; those that make no sense are passed over.
    pub fn step(&mut self, tick: Tick, fixes: &[PoseFix]) -> Pose {
        if let Some(fix) = fixes.iter().rev().find(|fix| fix.makes_sense()) {
            let turn = wrap_angle_rad(fix.theta_rad - self.pose.theta_rad);
            self.pose = WorldPose::new(fix.x_m, fix.y_m, self.pose.theta_rad + turn);
            self.measured_tick = fix.captured_tick;
        }
        Pose { measured_tick: self.measured_tick.min(tick), ..Pose::at(tick, self.pose) }
    }
}

impl Stateful for CameraHold {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.measured_tick);
        words.pose(&mut self.pose);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;

    #[test]
    fn it_holds_the_newest_fix_and_unwraps_its_heading() {
        let mut hold = CameraHold::new(WorldPose::new(0.0, 0.0, 3.0));
        let start = hold.step(5, &[]);
        assert_eq!((start.pose(), start.tick, start.measured_tick), (WorldPose::new(0.0, 0.0, 3.0), 5, 0));
        let fix = |x_m, theta_rad| PoseFix { x_m, theta_rad, captured_tick: 7, ..PoseFix::ZERO };
        let pose = hold.step(20, &[fix(1.0, 3.0), fix(2.0, -3.0), fix(f64::NAN, 0.0)]);
        assert_eq!((pose.x_m, pose.measured_tick), (2.0, 7));
        assert!((pose.theta_rad - (core::f64::consts::TAU - 3.0)).abs() < 1e-12);
        assert_eq!(hold.step(21, &[]), Pose { tick: 21, ..pose });
    }
}
