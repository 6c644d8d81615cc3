//! The simulated robots.
//!
//! The plant is the judge: it computes where the wheels' contact points go and shares no kinematics
//! with the boxes it judges. What the control path believes (wheel size, no slip, where it started)
//! is wrong here as far as the parameters say; all of them are 0 by default.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod stepper_drive;

pub use stepper_drive::{StepperDrive, StepperDriveParams};
