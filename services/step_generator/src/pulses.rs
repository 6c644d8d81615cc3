//! Wheel speeds into step pulses, paper 1 eq. (25)–(29), both directions.
//!
//! The angle owed to each wheel grows by ω·Δt a tick; when it reaches a step, the step is made and
//! subtracted. A remainder is never thrown away, so speeds average out exactly, and there is at
//! most one step a tick and wheel, so a pulse rate above the tick rate cannot occur.

use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::PerWheel;
use hilare_interfaces::param_group;

param_group! {
    /// The stepper drive.
    Stepper {
        /// Rim travel of one step; with the wheel's radius it gives the step angle β.
        step_length_m: f64 = 0.000_13, "m", 1e-7, 0.1;
    }
}

/// Pulses of all wheels.
#[derive(Clone, Debug)]
pub struct PulseTrain {
    step_rad: f64,
    wheels: usize,
    per_tick_rad: PerWheel<f64>,
    owed_rad: PerWheel<f64>,
    counts: PerWheel<i64>,
}

impl PulseTrain {
    /// No angle owed, no step counted. `step_rad` is β, the wheel angle of one step.
    pub fn new(step_rad: f64, wheels: usize) -> Self {
        Self { step_rad, wheels, per_tick_rad: [0.0; 4], owed_rad: [0.0; 4], counts: [0; 4] }
    }

    /// Wheel speeds for the ticks to come, rad/s.
    pub fn set_speeds(&mut self, speeds_radps: PerWheel<f64>) {
        // [MH18] (26)
        self.per_tick_rad = speeds_radps.map(|speed| speed * TICK_S);
    }

    /// One tick: at most one step a wheel.
    #[inline]
    pub fn tick(&mut self) {
        for wheel in 0..self.wheels {
            // [MH18] (27)
            let mut owed = self.owed_rad[wheel] + self.per_tick_rad[wheel];
            // [MH18] (28), (29); the paper moves forward only.
            if owed >= self.step_rad {
                owed -= self.step_rad;
                self.counts[wheel] += 1;
            } else if owed <= -self.step_rad {
                owed += self.step_rad;
                self.counts[wheel] -= 1;
            }
            self.owed_rad[wheel] = owed;
        }
    }

    /// Cumulative signed steps.
    pub fn counts(&self) -> PerWheel<i64> {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STEP_RAD: f64 = 0.13 / 20.0;

    proptest! {
        #[test]
        fn steps_follow_the_commanded_angle_and_never_bunch(
            speeds in proptest::collection::vec((-3.25..3.25f64, 1usize..400), 1..12),
        ) {
            let mut train = PulseTrain::new(STEP_RAD, 2);
            let mut angle = 0.0;
            let mut last_step = None::<(usize, i64)>;
            let mut tick = 0;
            for (speed, ticks) in speeds {
                train.set_speeds([speed, -speed, 0.0, 0.0]);
                for _ in 0..ticks {
                    let before = train.counts()[0];
                    train.tick();
                    angle += speed * TICK_S;
                    tick += 1;
                    let step = train.counts()[0] - before;
                    prop_assert!(step.abs() <= 1);
                    prop_assert_eq!(train.counts()[0], -train.counts()[1]);
                    prop_assert!((train.counts()[0] as f64 * STEP_RAD - angle).abs() <= STEP_RAD * 1.000_001);
                    if step != 0 {
                        // Same direction: at 3.25 rad/s a step takes two ticks.
                        if let Some((at, direction)) = last_step.filter(|(_, d)| *d == step) {
                            prop_assert!(tick - at >= 2, "{direction} steps {} ticks apart", tick - at);
                        }
                        last_step = Some((tick, step));
                    }
                }
            }
        }
    }
}
