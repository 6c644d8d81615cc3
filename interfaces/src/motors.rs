//! What turns the wheels, and what one count of a wheel is.

use crate::block::TICK_S;
use crate::chassis::Chassis;
use crate::param_group;
use core::f64::consts::TAU;

param_group! {
    /// Stepper motors: a wheel turns by whole steps, one pulse each, and needs no encoder.
    StepperParams {
        /// Rim travel of one step; with the wheel's radius it gives the step angle β.
        step_length_m: f64 = 0.000_13, "m", 1e-7, 0.1;
    }
}

param_group! {
    /// Servo motors: a drive closes a velocity loop round each wheel, and its encoder counts.
    ServoParams {
        /// Encoder counts of one turn of the wheel, all edges.
        counts_per_turn: u64 = 4096, "", 4, 100000000;
    }
}

/// The motors of all wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motors {
    /// Driven by pulses; counts are the steps made.
    Stepper(StepperParams),
    /// Driven by wheel speeds; counts are the encoders'.
    Servo(ServoParams),
}

impl Motors {
    /// Name used in system files.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Stepper(_) => "stepper",
            Self::Servo(_) => "servo",
        }
    }

    /// Wheel angle of one count, rad: the step angle β, or an encoder's.
    pub fn count_rad(&self, chassis: &Chassis) -> f64 {
        match self {
            Self::Stepper(stepper) => stepper.step_length_m / chassis.wheel_radius_m(),
            Self::Servo(servo) => TAU / servo.counts_per_turn as f64,
        }
    }

    /// True if the wheels have encoders, whose counts then are the odometry.
    pub const fn has_encoders(&self) -> bool {
        matches!(self, Self::Servo(_))
    }

    /// Highest wheel speed the pulses can carry, rad/s: one step a tick; `None` where there is no such
    /// limit.
    pub fn pulse_speed_max_radps(&self, chassis: &Chassis) -> Option<f64> {
        match self {
            Self::Stepper(_) => Some(self.count_rad(chassis) / TICK_S),
            Self::Servo(_) => None,
        }
    }
}
