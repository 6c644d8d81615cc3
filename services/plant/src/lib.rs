//! The simulated robots, and the camera that watches them.
//!
//! The plant is the judge: it computes where the wheels' contact points go and shares no kinematics
//! with the boxes it judges. What the control path believes (wheel size, no slip, where it started)
//! is wrong here as far as the parameters say; all such errors are 0 by default. Mass, motors and
//! tyres of the servo-driven robots have the values of a believable robot.
#![no_std]

extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod camera;
mod contact;
pub mod dc_servo;
pub mod mecanum;
pub mod noise;
mod slip;
pub mod start;
pub mod stepper_drive;

use camera::Camera;
use dc_servo::DcServo;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::{PoseFix, Steps, Truth, Wheels};
use hilare_interfaces::state::{StateWords, Stateful};
use mecanum::Mecanum;
use stepper_drive::StepperDrive;

/// A simulated robot.
#[derive(Clone, Debug)]
pub enum Robot {
    /// Two wheels on stepper motors.
    StepperDrive(StepperDrive),
    /// A cart on two DC servos, two casters in front.
    DcServo(DcServo),
    /// Four Mecanum wheels on servos.
    Mecanum(Mecanum),
}

impl Robot {
    /// The true pose after a tick.
    #[inline]
    fn step(&mut self, steps: &Steps) -> WorldPose {
        match self {
            Self::StepperDrive(robot) => robot.step(steps),
            Self::DcServo(robot) => robot.step(steps),
            Self::Mecanum(robot) => robot.step(steps),
        }
    }

    /// Encoder counts; zero where there are no encoders.
    fn counts(&self) -> [i64; 4] {
        match self {
            Self::StepperDrive(_) => [0; 4],
            Self::DcServo(robot) => robot.counts(),
            Self::Mecanum(robot) => robot.counts(),
        }
    }
}

/// What a tick shows of the robot.
#[derive(Clone, Copy, Debug)]
pub struct Observed {
    /// Where it is.
    pub truth: Truth,
    /// What its encoders say.
    pub wheels: Wheels,
    /// What the camera says, if a picture has come through.
    pub fix: Option<PoseFix>,
}

/// The box: a robot, and a camera if one watches it.
#[derive(Clone, Debug)]
pub struct Plant {
    robot: Robot,
    camera: Option<Camera>,
}

impl Plant {
    /// A robot at its start.
    pub fn new(robot: Robot, camera: Option<Camera>) -> Self {
        Self { robot, camera }
    }
}

impl Plant {
    /// Goes on where `before` is, a robot of the same kind that is a little different. Allocates nothing;
    /// `before` is of no use afterwards.
    pub fn take_over(&mut self, before: &mut Self) {
        match (&mut self.robot, &before.robot) {
            (Robot::StepperDrive(new), Robot::StepperDrive(old)) => new.take_over(old),
            (Robot::DcServo(new), Robot::DcServo(old)) => new.take_over(old),
            (Robot::Mecanum(new), Robot::Mecanum(old)) => new.take_over(old),
            // Of another kind: then it stays what it was.
            _ => core::mem::swap(&mut self.robot, &mut before.robot),
        }
        if let (Some(new), Some(old)) = (&mut self.camera, &mut before.camera) {
            new.take_over(old);
        }
    }
}

/// All that a later step hangs on and that is no parameter. A simulated robot has no successor: it is for whoever drives
/// it again from the middle of a drive.
impl Stateful for Plant {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        match &mut self.robot {
            Robot::StepperDrive(robot) => robot.visit_state(words),
            Robot::DcServo(robot) => robot.visit_state(words),
            Robot::Mecanum(robot) => robot.visit_state(words),
        }
        if let Some(camera) = &mut self.camera {
            camera.visit_state(words);
        }
    }
}

impl Block for Plant {
    type Inputs<'a> = &'a Steps;
    type Output = Observed;

    #[inline]
    fn step(&mut self, tick: Tick, steps: &Steps) -> Observed {
        let pose = self.robot.step(steps);
        Observed {
            truth: Truth::at(tick, pose),
            wheels: Wheels { tick, counts: self.robot.counts() },
            fix: self.camera.as_mut().and_then(|camera| camera.watch(tick, pose)),
        }
    }
}
