//! The pose estimator: where the robot thinks it is, once a tick.
//!
//! * [`dead_reckoning`]: from steps or encoder counts alone, paper 1 eq. (30), (31),
//! * [`camera_hold`]: the newest pose measured from outside, as it is, as in papers 2 and 3,
//! * [`ekf`]: both fused by an extended Kalman filter, which no paper here has.
//!
//! Odometry comes as cumulative counts, so a lost message loses no way; fixes carry the tick of their
//! picture.
#![no_std]

extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod camera_hold;
pub mod dead_reckoning;
pub mod ekf;
mod guard;

use alloc::boxed::Box;
use camera_hold::CameraHold;
use dead_reckoning::DeadReckoning;
use ekf::params::EkfParams;
use ekf::{Ekf, FixCounts};
use guard::{Guard, Worth};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::chassis::{Chassis, PerWheel};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::{Pose, PoseFix};
use hilare_interfaces::state::{StateWords, Stateful};

/// What a tick reads.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorInputs<'a> {
    /// Cumulative steps or encoder counts after the tick.
    pub counts: &'a PerWheel<i64>,
    /// Fixes to be used from this tick on, the oldest first; empty where there is no camera.
    pub fixes: &'a [PoseFix],
}

/// An estimator that can be chosen by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EstimatorKind {
    /// [`DeadReckoning`].
    DeadReckoning,
    /// [`CameraHold`].
    Camera,
    /// [`Ekf`].
    Ekf,
}

impl EstimatorKind {
    /// All of them; the first is the default.
    pub const ALL: [Self; 3] = [Self::DeadReckoning, Self::Camera, Self::Ekf];

    /// Name in system files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DeadReckoning => "dead-reckoning",
            Self::Camera => "camera",
            Self::Ekf => "ekf",
        }
    }

    /// The estimator of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// True if it uses fixes: the robot then needs a camera that watches it.
    pub const fn needs_fixes(self) -> bool {
        !matches!(self, Self::DeadReckoning)
    }
}

/// What an estimator is built from.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorSetup {
    /// The robot.
    pub chassis: Chassis,
    /// Wheel angle of one count, rad.
    pub count_rad: f64,
    /// Pose the robot is assumed to start at.
    pub start: WorldPose,
    /// For [`EstimatorKind::Ekf`].
    pub ekf: EkfParams,
}

/// The ways to estimate.
#[derive(Clone, Debug)]
enum Estimator {
    DeadReckoning(DeadReckoning),
    Camera(CameraHold),
    Ekf(Box<Ekf>),
}

/// The box.
#[derive(Clone, Debug)]
pub struct PoseEstimator {
    guard: Guard,
    estimator: Estimator,
    /// What was answered last.
    pose: Pose,
}

impl PoseEstimator {
    /// At the assumed start, with nothing counted.
    pub fn new(kind: EstimatorKind, setup: EstimatorSetup) -> Self {
        let estimator = match kind {
            EstimatorKind::DeadReckoning => {
                Estimator::DeadReckoning(DeadReckoning::new(setup.chassis, setup.count_rad, setup.start))
            }
            EstimatorKind::Camera => Estimator::Camera(CameraHold::new(setup.start)),
            EstimatorKind::Ekf => Estimator::Ekf(Box::new(Ekf::new(&setup, setup.ekf))),
        };
        let guard = Guard::new(&setup.chassis, setup.count_rad, kind != EstimatorKind::Camera);
        Self { guard, estimator, pose: Pose::at(0, setup.start) }
    }

    /// Goes on from where `before` is, which has been built of other filter parameters and else alike. Allocates
    /// nothing; `before` is of no use afterwards.
    pub fn take_over(&mut self, before: &mut Self) {
        (self.guard, self.pose) = (before.guard, before.pose);
        match (&mut self.estimator, &mut before.estimator) {
            (Estimator::Ekf(new), Estimator::Ekf(old)) => new.take_over(old),
            // Without parameters that can change.
            (new, old) => core::mem::swap(new, old),
        }
    }

    /// Messages passed over, because no wheel or no clock can have made them.
    pub const fn refused(&self) -> u64 {
        self.guard.refused()
    }

    /// What became of the fixes so far; none where no filter looks at them.
    pub fn fixes(&self) -> Option<FixCounts> {
        match &self.estimator {
            Estimator::Ekf(ekf) => Some(ekf.fixes()),
            Estimator::DeadReckoning(_) | Estimator::Camera(_) => None,
        }
    }
}

impl Stateful for PoseEstimator {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.guard.visit_state(words);
        words.word(&mut self.pose.tick);
        words.word(&mut self.pose.measured_tick);
        let mut pose = self.pose.pose();
        words.pose(&mut pose);
        self.pose = Pose { x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad, ..self.pose };
        match &mut self.estimator {
            Estimator::DeadReckoning(estimator) => estimator.visit_state(words),
            Estimator::Camera(estimator) => estimator.visit_state(words),
            Estimator::Ekf(estimator) => estimator.visit_state(words),
        }
    }
}

impl Block for PoseEstimator {
    type Inputs<'a> = EstimatorInputs<'a>;
    type Output = Pose;

    /// The pose of a tick. Counts that cannot be leave the pose where it was, as old as it then is; a tick
    /// that cannot be is answered by the last pose again.
    #[inline]
    fn step(&mut self, tick: Tick, inputs: EstimatorInputs<'_>) -> Pose {
        match self.guard.look(tick, inputs.counts) {
            Worth::Sound => {
                self.pose = match &mut self.estimator {
                    Estimator::DeadReckoning(estimator) => {
                        Pose::at(tick, estimator.step(tick, inputs.counts))
                    }
                    Estimator::Camera(estimator) => estimator.step(tick, inputs.fixes),
                    Estimator::Ekf(estimator) => {
                        Pose::at(tick, estimator.step(tick, inputs.counts, inputs.fixes))
                    }
                };
            }
            Worth::CountsImpossible => self.pose.tick = tick,
            Worth::TickImpossible => {}
        }
        self.pose
    }
}
