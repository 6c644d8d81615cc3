//! Wheel speeds into step pulses, paper 1 eq. (25)–(29), both directions.
//!
//! The angle owed to each wheel grows by ω·Δt a tick; when it reaches a step, the step is made and
//! subtracted. A remainder is never thrown away, so speeds average out exactly, and there is at
//! most one step a tick and wheel, so a pulse rate above the tick rate cannot occur.
//!
//! Servo motors get wheel speeds, not pulses. Their counts are the same sum in encoder counts, as
//! many a tick as there are: where the wheels should be.

use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::{Chassis, PerWheel};
use hilare_interfaces::motors::Motors;
use hilare_interfaces::state::{StateWords, Stateful};

/// Pulses of all wheels.
#[derive(Clone, Debug)]
pub struct PulseTrain {
    step_rad: f64,
    wheels: usize,
    /// At most one count a tick: pulses of a stepper.
    one_a_tick: bool,
    per_tick_rad: PerWheel<f64>,
    owed_rad: PerWheel<f64>,
    counts: PerWheel<i64>,
}

impl PulseTrain {
    /// No angle owed, no step counted.
    pub fn new(motors: &Motors, chassis: &Chassis) -> Self {
        Self {
            step_rad: motors.count_rad(chassis),
            wheels: chassis.wheels(),
            one_a_tick: matches!(motors, Motors::Stepper(_)),
            per_tick_rad: [0.0; 4],
            owed_rad: [0.0; 4],
            counts: [0; 4],
        }
    }

    /// Wheel speeds for the ticks to come, rad/s.
    pub fn set_speeds(&mut self, speeds_radps: PerWheel<f64>) {
        // [MH18] (26)
        self.per_tick_rad = speeds_radps.map(|speed| speed * TICK_S);
    }

    /// One tick.
    #[inline]
    pub fn tick(&mut self) {
        if !self.one_a_tick {
            return self.count_whole();
        }
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

    fn count_whole(&mut self) {
        for wheel in 0..self.wheels {
            let owed = self.owed_rad[wheel] + self.per_tick_rad[wheel];
            let whole = libm::trunc(owed / self.step_rad);
            self.counts[wheel] += whole as i64;
            self.owed_rad[wheel] = owed - whole * self.step_rad;
        }
    }

    /// Cumulative signed steps or counts.
    pub fn counts(&self) -> PerWheel<i64> {
        self.counts
    }
}

/// Counts and owed angles; at rest.
impl Stateful for PulseTrain {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.counts.iter_mut().for_each(|count| words.signed(count));
        words.finite(&mut self.owed_rad);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::chassis::DifferentialParams;
    use hilare_interfaces::motors::{ServoParams, StepperParams};
    use proptest::prelude::*;

    const STEP_RAD: f64 = 0.13 / 20.0;

    fn train(motors: Motors) -> PulseTrain {
        PulseTrain::new(&motors, &Chassis::Differential(DifferentialParams::default()))
    }

    #[test]
    fn a_servos_counts_follow_any_speed() {
        let mut train = train(Motors::Servo(ServoParams { counts_per_turn: 4000 }));
        train.set_speeds([50.0, -50.0, 0.0, 0.0]);
        (0..1000).for_each(|_| train.tick());
        let expected = 50.0 / core::f64::consts::TAU * 4000.0;
        assert!((train.counts()[0] as f64 - expected).abs() <= 1.0);
        assert_eq!(train.counts()[0], -train.counts()[1]);
    }

    proptest! {
        #[test]
        fn steps_follow_the_commanded_angle_and_never_bunch(
            speeds in proptest::collection::vec((-3.25..3.25f64, 1usize..400), 1..12),
        ) {
            let mut train = train(Motors::Stepper(StepperParams::default()));
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
