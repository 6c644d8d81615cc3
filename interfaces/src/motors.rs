//! What turns the wheels, and what one count of a wheel is.

use crate::block::TICK_S;
use crate::chassis::{Chassis, PerWheel};
use crate::param_group;
use core::f64::consts::TAU;

param_group! {
    /// Stepper motors: a wheel turns by whole pulses, and needs no encoder.
    ///
    /// Times are those of a driver's data sheet. What the step generator sees to is seen to in whole ticks,
    /// rounded up:
    ///
    /// ```text
    ///       ___________________________________
    /// DIR  /                                   \____
    ///      |<-set-up->|                |<-hold->|
    ///                 |<-length->|     .        |
    ///                  __________               .
    /// STEP  __________/          \__space__/‾‾ (not before)
    /// ```
    StepperParams {
        /// Rim travel of one full step; with the wheel's radius and `microsteps` it gives the angle of a pulse, β.
        step_length_m: f64 = 0.000_13, "m", 1e-7, 0.1;
        /// Pulses of one full step, as the driver is set.
        microsteps: u64 = 1, "", 1, 256;
        /// Least time STEP is active.
        pulse_length_s: f64 = 0.0, "s", 0.0, 0.1;
        /// Least time STEP is idle between two pulses.
        pulse_space_s: f64 = 0.0, "s", 0.0, 0.1;
        /// Least time DIR stands before a pulse begins; 0 leaves it to the drive, which sets DIR before STEP.
        direction_setup_s: f64 = 0.0, "s", 0.0, 0.1;
        /// Least time DIR stands after a pulse has ended.
        direction_hold_s: f64 = 0.0, "s", 0.0, 0.1;
        /// How much sooner than after a tick the next one may come at the drive; on top of each of these times.
        tick_jitter_s: f64 = 0.0, "s", 0.0, 0.001;
        /// Most pulses a second of a wheel: no two are closer than that in ticks, of which each has one at most.
        pulse_rate_max_hz: f64 = 1000.0, "Hz", 1.0, 1000.0;
        /// Forward is a low DIR of the right wheel.
        invert_right: bool = false, "", 0, 1;
        /// Forward is a low DIR of the left wheel.
        invert_left: bool = false, "", 0, 1;
    }
}

/// The times of a stepper in ticks, and at least these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseTicks {
    /// From a pulse to the next, 1 or more.
    pub interval: u64,
    /// From a change of DIR to a pulse; 0: both may come in the same tick.
    pub setup: u64,
    /// From a pulse to a change of DIR, 1 or more.
    pub hold: u64,
}

impl StepperParams {
    /// Rim travel of one pulse, m.
    pub const fn pulse_travel_m(&self) -> f64 {
        self.step_length_m / self.microsteps as f64
    }

    /// What the times are in ticks.
    pub fn pulse_ticks(&self) -> PulseTicks {
        // Whole ticks are whole, whatever the last bit of a sum or division says.
        let ticks = |time_s: f64| libm::ceil(time_s / TICK_S - 1e-9) as u64;
        let on_top = |time_s: f64| ticks(time_s + self.tick_jitter_s);
        let apart = on_top(self.pulse_length_s + self.pulse_space_s);
        PulseTicks {
            interval: apart.max(ticks(1.0 / self.pulse_rate_max_hz)).max(1),
            setup: if self.direction_setup_s > 0.0 { on_top(self.direction_setup_s) } else { 0 },
            hold: on_top(self.pulse_length_s + self.direction_hold_s).max(1),
        }
    }

    /// Level of DIR that means forward, a wheel, right first.
    pub const fn forward_level(&self) -> PerWheel<bool> {
        [!self.invert_right, !self.invert_left, true, true]
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

    /// Wheel angle of one count, rad: of a pulse, β, or an encoder's.
    pub fn count_rad(&self, chassis: &Chassis) -> f64 {
        match self {
            Self::Stepper(stepper) => stepper.pulse_travel_m() / chassis.wheel_radius_m(),
            Self::Servo(servo) => TAU / servo.counts_per_turn as f64,
        }
    }

    /// True if the wheels have encoders, whose counts then are the odometry.
    pub const fn has_encoders(&self) -> bool {
        matches!(self, Self::Servo(_))
    }

    /// Highest wheel speed the pulses can carry, rad/s; `None` where there is no such limit.
    pub fn pulse_speed_max_radps(&self, chassis: &Chassis) -> Option<f64> {
        match self {
            Self::Stepper(stepper) => {
                Some(self.count_rad(chassis) / (stepper.pulse_ticks().interval as f64 * TICK_S))
            }
            Self::Servo(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chassis::DifferentialParams;

    #[test]
    fn times_are_rounded_up_to_ticks() {
        let plain = StepperParams::default();
        assert_eq!(plain.pulse_ticks(), PulseTicks { interval: 1, setup: 0, hold: 1 });
        let whole = StepperParams {
            pulse_length_s: 0.000_7,
            pulse_space_s: 0.000_3,
            direction_setup_s: 0.003,
            direction_hold_s: 0.001_3,
            ..plain
        };
        assert_eq!(whole.pulse_ticks(), PulseTicks { interval: 1, setup: 3, hold: 2 });
        let jittery = StepperParams { tick_jitter_s: 1e-6, ..whole };
        assert_eq!(jittery.pulse_ticks(), PulseTicks { interval: 2, setup: 4, hold: 3 });
        // A driver that is much faster than the ticks, but at the mercy of their jitter.
        let quick =
            StepperParams { pulse_length_s: 1e-7, pulse_space_s: 1e-7, tick_jitter_s: 0.001, ..plain };
        assert_eq!(quick.pulse_ticks(), PulseTicks { interval: 2, setup: 0, hold: 2 });
        for (rate_hz, interval) in [(1000.0, 1), (999.9, 2), (500.0, 2), (333.0, 4), (1.0, 1000)] {
            let slow = StepperParams { pulse_rate_max_hz: rate_hz, ..plain };
            assert_eq!(slow.pulse_ticks().interval, interval, "{rate_hz} Hz");
        }
    }

    #[test]
    fn microsteps_divide_the_step_and_intervals_the_speed() {
        let chassis = Chassis::Differential(DifferentialParams::default());
        let full = StepperParams { step_length_m: 0.000_4, ..StepperParams::default() };
        let fine = Motors::Stepper(StepperParams { microsteps: 16, ..full });
        assert!((fine.count_rad(&chassis) - 0.000_025 / 0.02).abs() < 1e-15);
        let slow = Motors::Stepper(StepperParams { pulse_rate_max_hz: 250.0, ..full });
        let top_radps = slow.pulse_speed_max_radps(&chassis).unwrap();
        assert!((top_radps - 250.0 * 0.000_4 / 0.02).abs() < 1e-12, "{top_radps}");
    }
}
