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

use alloc::boxed::Box;
use camera_hold::CameraHold;
use dead_reckoning::DeadReckoning;
use ekf::Ekf;
use ekf::params::EkfParams;
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

/// The box.
#[derive(Clone, Debug)]
pub enum PoseEstimator {
    /// From counts alone.
    DeadReckoning(DeadReckoning),
    /// From fixes alone.
    Camera(CameraHold),
    /// From both.
    Ekf(Box<Ekf>),
}

impl PoseEstimator {
    /// At the assumed start, with nothing counted.
    pub fn new(kind: EstimatorKind, setup: EstimatorSetup) -> Self {
        match kind {
            EstimatorKind::DeadReckoning => {
                Self::DeadReckoning(DeadReckoning::new(setup.chassis, setup.count_rad, setup.start))
            }
            EstimatorKind::Camera => Self::Camera(CameraHold::new(setup.start)),
            EstimatorKind::Ekf => Self::Ekf(Box::new(Ekf::new(&setup, setup.ekf))),
        }
    }
}

impl Stateful for PoseEstimator {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        match self {
            Self::DeadReckoning(estimator) => estimator.visit_state(words),
            Self::Camera(estimator) => estimator.visit_state(words),
            Self::Ekf(estimator) => estimator.visit_state(words),
        }
    }
}

impl Block for PoseEstimator {
    type Inputs<'a> = EstimatorInputs<'a>;
    type Output = Pose;

    #[inline]
    fn step(&mut self, tick: Tick, inputs: EstimatorInputs<'_>) -> Pose {
        match self {
            Self::DeadReckoning(estimator) => Pose::at(tick, estimator.step(tick, inputs.counts)),
            Self::Camera(estimator) => estimator.step(tick, inputs.fixes),
            Self::Ekf(estimator) => Pose::at(tick, estimator.step(tick, inputs.counts, inputs.fixes)),
        }
    }
}
