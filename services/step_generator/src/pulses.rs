//! Wheel speeds into step pulses, paper 1 eq. (25)–(29), both directions, at a driver's pace.
//!
//! The angle owed to each wheel grows by ω·Δt a tick; when it reaches a step, the step is made and
//! subtracted. A remainder is never thrown away, so speeds average out exactly, and there is at
//! most one step a tick and wheel, so a pulse rate above the tick rate cannot occur.
//!
//! A driver has to be given time ([`PulseTicks`]): between pulses, and between a pulse and a change of its DIR
//! input either way. What has to wait stays owed and is made up for at no more than the highest rate:
//!
//! ```text
//! ω          ++++++++++++++------------------------------------
//! pulse      _|___|___|___|______|___|___|___|___|___|___|___|_    interval 4
//! DIR        ‾‾‾‾‾‾‾‾‾‾‾‾‾‾‾‾‾\________________________________    4 of hold after the last +, 3 of set-up before the first −
//! ```
//!
//! DIR turns as late as it may, so it does not swing with every change of sign of a slow wheel. More than the pulses
//! can carry is never owed: speeds above are scaled, all wheels alike, so that the curvature is kept. And a
//! robot that is to stand makes no pulse, whatever is owed.
//!
//! Servo motors get wheel speeds, not pulses. Their counts are the same sum in encoder counts, as
//! many a tick as there are: where the wheels should be.

use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::{Chassis, MAX_WHEELS, PerWheel};
use hilare_interfaces::motors::{Motors, PulseTicks};
use hilare_interfaces::state::{StateWords, Stateful};

/// Steps a wheel is never in arrears by: a state that says so is not one. A wait is of at most some hundred ticks.
const OWED_STEPS_MAX: f64 = 1e6;

/// Wheel speeds of which none is above `most_radps`: all scaled alike.
#[inline]
pub fn within<const WHEELS: usize>(most_radps: f64, speeds_radps: [f64; WHEELS]) -> [f64; WHEELS] {
    let fastest_radps = speeds_radps.iter().fold(0.0, |most: f64, speed| most.max(speed.abs()));
    let scale = most_radps / fastest_radps;
    speeds_radps.map(|speed| if fastest_radps > most_radps { speed * scale } else { speed })
}

/// Pulses of all wheels.
#[derive(Clone, Debug)]
pub struct PulseTrain {
    step_rad: f64,
    wheels: usize,
    /// Pulses of steppers, and their pace; without it, counts of servos, as many a tick as there are.
    pace: Option<PulseTicks>,
    /// Level of DIR that means forward.
    forward_level: PerWheel<bool>,
    per_tick_rad: PerWheel<f64>,
    /// What the set-up time of DIR lets come beforehand.
    ahead_rad: PerWheel<f64>,
    /// Owed angles from which on there is something to be done; none where the robot is to stand.
    act_from_rad: [PerWheel<f64>; 2],
    owed_rad: PerWheel<f64>,
    counts: PerWheel<i64>,
    forward: PerWheel<bool>,
    dir_levels: PerWheel<u64>,
    /// Ticks done, and the first in which a pulse may begin and DIR may turn.
    now: u64,
    pulse_from: PerWheel<u64>,
    turn_from: PerWheel<u64>,
}

impl PulseTrain {
    /// No angle owed, no step counted, DIR forward: told in the message before the first tick.
    pub fn new(motors: &Motors, chassis: &Chassis) -> Self {
        let (pace, forward_level) = match motors {
            Motors::Stepper(stepper) => (Some(stepper.pulse_ticks()), stepper.forward_level()),
            Motors::Servo(_) => (None, [false; MAX_WHEELS]),
        };
        let mut train = Self {
            step_rad: motors.count_rad(chassis),
            wheels: chassis.wheels(),
            pace,
            forward_level,
            per_tick_rad: [0.0; 4],
            ahead_rad: [0.0; 4],
            act_from_rad: [[f64::NEG_INFINITY; 4], [f64::INFINITY; 4]],
            owed_rad: [0.0; 4],
            counts: [0; 4],
            forward: [true; 4],
            dir_levels: [0; 4],
            now: 0,
            pulse_from: [0; 4],
            turn_from: [0; 4],
        };
        train.resume();
        train
    }

    /// Wheel speeds for the ticks to come, rad/s; what the pulses can carry of them.
    pub fn set_speeds(&mut self, mut speeds_radps: PerWheel<f64>) -> PerWheel<f64> {
        if let Some(pace) = self.pace {
            let most_radps = self.step_rad / (pace.interval as f64 * TICK_S);
            speeds_radps = within(most_radps, speeds_radps);
            self.ahead_rad = speeds_radps.map(|speed| speed * (pace.setup as f64 * TICK_S));
        }
        // [MH18] (26)
        self.per_tick_rad = speeds_radps.map(|speed| speed * TICK_S);
        let standing = speeds_radps == [0.0; 4];
        let step_rad = if standing { f64::INFINITY } else { self.step_rad };
        self.act_from_rad = [
            self.ahead_rad.map(|ahead| -step_rad - ahead.min(0.0)),
            self.ahead_rad.map(|ahead| step_rad - ahead.max(0.0)),
        ];
        speeds_radps
    }

    /// One tick.
    #[inline]
    pub fn tick(&mut self) {
        let Some(pace) = self.pace else {
            return self.count_whole();
        };
        self.now += 1;
        for wheel in 0..self.wheels {
            // [MH18] (27)
            let owed = self.owed_rad[wheel] + self.per_tick_rad[wheel];
            self.owed_rad[wheel] = owed;
            if owed >= self.act_from_rad[1][wheel] || owed <= self.act_from_rad[0][wheel] {
                self.turn_and_step(wheel, pace);
            }
        }
    }

    /// A step is due, or will be when DIR has been set up for it.
    fn turn_and_step(&mut self, wheel: usize, pace: PulseTicks) {
        let (now, owed) = (self.now, self.owed_rad[wheel]);
        let due = owed.abs() >= self.step_rad;
        let forward = if due { owed > 0.0 } else { self.ahead_rad[wheel] > 0.0 };
        if forward != self.forward[wheel] && now >= self.turn_from[wheel] {
            self.turn(wheel, forward);
            self.pulse_from[wheel] = self.pulse_from[wheel].max(now + pace.setup);
        }
        if !due || forward != self.forward[wheel] || now < self.pulse_from[wheel] {
            return;
        }
        // [MH18] (28), (29); the paper moves forward only.
        if forward {
            self.owed_rad[wheel] = owed - self.step_rad;
            self.counts[wheel] += 1;
        } else {
            self.owed_rad[wheel] = owed + self.step_rad;
            self.counts[wheel] -= 1;
        }
        self.pulse_from[wheel] = now + pace.interval;
        self.turn_from[wheel] = now + pace.hold;
    }

    fn count_whole(&mut self) {
        for wheel in 0..self.wheels {
            let owed = self.owed_rad[wheel] + self.per_tick_rad[wheel];
            let whole = libm::trunc(owed / self.step_rad);
            self.counts[wheel] += whole as i64;
            self.owed_rad[wheel] = owed - whole * self.step_rad;
        }
    }

    fn turn(&mut self, wheel: usize, forward: bool) {
        self.forward[wheel] = forward;
        self.dir_levels[wheel] = u64::from(forward == self.forward_level[wheel]);
    }

    /// As if every wheel had just had both a pulse and a change of DIR.
    fn resume(&mut self) {
        let Some(pace) = self.pace else { return };
        (0..self.wheels).for_each(|wheel| self.turn(wheel, self.forward[wheel]));
        self.pulse_from = [self.now + pace.interval.max(pace.setup); 4];
        self.turn_from = [self.now + pace.hold; 4];
    }

    /// Cumulative signed steps or counts.
    pub fn counts(&self) -> PerWheel<i64> {
        self.counts
    }

    /// Levels of the DIR inputs; 0 where there are none.
    pub fn dir_levels(&self) -> PerWheel<u64> {
        self.dir_levels
    }
}

impl PulseTrain {
    /// What each wheel waits for, beside its state; `below`: no tick gets as far.
    pub(crate) fn visit_waits(&mut self, words: &mut StateWords<'_>, below: u64) {
        words.count(&mut self.now, below);
        let waits = self.pulse_from.iter_mut().chain(&mut self.turn_from);
        waits.for_each(|tick| words.count(tick, below));
    }
}

/// Counts, owed angles and directions; at rest. What a predecessor did last may have been in this very tick, so a
/// successor waits as long as there is to wait.
impl Stateful for PulseTrain {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.counts.iter_mut().for_each(|count| words.signed(count));
        words.finite(&mut self.owed_rad);
        self.forward.iter_mut().for_each(|forward| words.flag(forward));
        let most_rad = OWED_STEPS_MAX * self.step_rad;
        words.require(self.owed_rad.iter().all(|owed| owed.abs() <= most_rad));
        if words.is_loading() {
            self.resume();
        }
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
