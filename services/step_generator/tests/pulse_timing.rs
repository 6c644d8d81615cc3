//! Whatever is commanded, and whatever happens meanwhile, no driver is asked for more than it can do.
//!
//! Random drivers, robots and drives: reversals, stops, emergency stops, pauses of 1 to 100 ms, successors that go on
//! with the state their predecessor left. `HILARE_PULSE_TICKS` is how many ticks (10⁹ are some minutes in release),
//! `HILARE_PULSE_SEED` the first seed. A failure names the seed of its drive.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "a test is told how long it runs, and what it has seen is worth seeing"
)]

mod judge;

use hilare_interfaces::block::{Block, TICK_S};
use hilare_interfaces::chassis::{Chassis, DifferentialParams};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Command, Drive, Mode, Steps};
use hilare_interfaces::motors::{Motors, StepperParams};
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use hilare_step_generator::authority::GateParams;
use hilare_step_generator::limits::Limits;
use hilare_step_generator::{StepGenerator, StepInputs};
use judge::{Judge, Line, Times, Violation};

/// Steele, Lea & Flood 2014.
struct Random(u64);

impl Random {
    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        word ^ (word >> 31)
    }

    /// From `low` to `high`, both included.
    fn whole(&mut self, low: u64, high: u64) -> u64 {
        low + self.word() % (high - low + 1)
    }

    fn real(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.word() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn one_in(&mut self, times: u64) -> bool {
        self.word().is_multiple_of(times)
    }

    /// A time of a driver: none, that of a chip, some ticks to the nanosecond, or up to the most there is.
    fn time_ns(&mut self) -> u64 {
        match self.whole(0, 9) {
            0 | 1 => 0,
            2 | 3 => self.whole(20, 5_000),
            4 | 5 => 1_000_000 * self.whole(1, 4),
            6 | 7 => 1_000_000 * self.whole(1, 4) + self.whole(0, 2) - 1,
            8 => self.whole(0, 12_000_000),
            _ => self.whole(0, 100_000_000),
        }
    }
}

/// A drive of one robot.
struct Ride {
    random: Random,
    step_rad: f64,
    /// Most that a wheel may be in arrears by from one wait, steps.
    wait_steps: f64,
    build: Box<dyn Fn() -> StepGenerator>,
    generator: StepGenerator,
    judges: [Judge; 2],
    authority: Authority,
    command_seq: u64,
    wanted: [f64; 2],
    top: [f64; 2],
    last: Steps,
    angle_rad: [f64; 2],
    mortal: bool,
    restarts: u64,
    arm_at_once: bool,
    /// Pulses, changes of DIR, ticks lost.
    seen: [u64; 3],
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

fn lines(steps: &Steps) -> [Line; 2] {
    [0, 1].map(|wheel| Line { count: steps.counts[wheel], level: steps.dir_level[wheel] })
}

impl Ride {
    fn new(seed: u64) -> Self {
        let mut random = Random(seed);
        let mut times = Times {
            length_ns: random.time_ns(),
            space_ns: random.time_ns(),
            setup_ns: random.time_ns(),
            hold_ns: random.time_ns(),
            jitter_ns: if random.one_in(2) { random.whole(0, 1_000_000) } else { 0 },
            period_ns: 0,
        };
        let rate_max_hz = if random.one_in(2) { random.whole(60, 1000) } else { 1000 };
        times.period_ns = 1_000_000_000_u64.div_ceil(rate_max_hz);
        let inverted = [random.one_in(2), random.one_in(2)];
        let stepper = StepperParams {
            step_length_m: random.real(1e-4, 2e-3),
            microsteps: random.whole(1, 16),
            pulse_length_s: seconds(times.length_ns),
            pulse_space_s: seconds(times.space_ns),
            direction_setup_s: seconds(times.setup_ns),
            direction_hold_s: seconds(times.hold_ns),
            tick_jitter_s: seconds(times.jitter_ns),
            pulse_rate_max_hz: rate_max_hz as f64,
            invert_right: inverted[0],
            invert_left: inverted[1],
        };
        let radius_m = DifferentialParams::default().wheel_diameter_m / 2.0;
        let step_rad = stepper.step_length_m / stepper.microsteps as f64 / radius_m;
        let apart_ns =
            (times.length_ns + times.space_ns + times.jitter_ns).max(times.period_ns).max(1_000_000);
        let interval = apart_ns.div_ceil(1_000_000);
        // Up to all that the pulses can carry, and beyond: nothing forbids it but the configuration.
        let wheel_radps = step_rad / (interval as f64 * TICK_S) * random.real(0.1, 1.2);
        let chassis = Chassis::Differential(DifferentialParams {
            wheel_speed_max_right_radps: wheel_radps,
            wheel_speed_max_left_radps: wheel_radps * random.real(0.5, 1.0),
            ..DifferentialParams::default()
        });
        let top = [wheel_radps * radius_m, 2.0 * wheel_radps * radius_m / 0.054];
        let limits = Limits {
            v_min_mps: -top[0],
            v_max_mps: top[0] * random.real(0.2, 1.5),
            omega_max_radps: top[1] * random.real(0.2, 1.5),
            accel_mps2: if random.one_in(2) { top[0] * random.real(1.0, 100.0) } else { 0.0 },
            accel_radps2: if random.one_in(2) { top[1] * random.real(1.0, 100.0) } else { 0.0 },
            stop_decel_mps2: top[0] * random.real(1.0, 100.0),
            stop_decel_radps2: top[1] * random.real(1.0, 100.0),
            ..Limits::default()
        };
        let build =
            move || StepGenerator::new(chassis, Motors::Stepper(stepper), limits, GateParams::default());
        let generator = build();
        let first = lines(generator.state());
        let waits_ns = apart_ns + times.setup_ns + times.length_ns + times.hold_ns + 3 * times.jitter_ns;
        Self {
            random,
            step_rad,
            wait_steps: (waits_ns as f64 / 1e6 + 4.0) / interval as f64,
            judges: [0, 1].map(|wheel| Judge::new(times, inverted[wheel], first[wheel])),
            last: *generator.state(),
            generator,
            build: Box::new(build),
            authority: Authority { source: 1, epoch: 1, term: 1, ..Authority::ZERO },
            command_seq: 0,
            wanted: [0.0; 2],
            top,
            angle_rad: [0.0; 2],
            mortal: seed.is_multiple_of(2),
            restarts: 0,
            arm_at_once: true,
            seen: [0; 3],
        }
    }

    /// What the operator does, now and then.
    fn tell(&mut self) -> Option<Authority> {
        let draw = if std::mem::take(&mut self.arm_at_once) { 200 } else { self.random.word() % 4000 };
        let mode = match draw {
            0 => Mode::EStop,
            1..=3 => Mode::Stop,
            4 => Mode::Disarmed,
            5..=200 => Mode::Armed,
            _ => return None,
        };
        // An emergency stop is left by a reset only.
        let latched = self.authority.mode == Mode::EStop.code();
        let mode = if latched && mode != Mode::EStop { Mode::Disarmed } else { mode };
        self.authority.mode = mode.code();
        self.authority.seq += 1;
        Some(self.authority)
    }

    fn command(&mut self) -> Option<Command> {
        let random = &mut self.random;
        if random.one_in(8) {
            let mut part = |top: f64| match random.whole(0, 5) {
                0 => 0.0,
                1 => top,
                2 => -top,
                3 => random.real(-1e-3, 1e-3) * top,
                _ => random.real(-1.5, 1.5) * top,
            };
            self.wanted = self.top.map(&mut part);
        } else if random.one_in(12) {
            self.wanted = self.wanted.map(|part| -part);
        }
        if random.one_in(100) {
            return None;
        }
        self.command_seq += 1;
        Some(Command {
            source: 1,
            epoch: self.authority.epoch,
            seq: self.command_seq,
            pose_tick: self.last.tick,
            effective_tick: self.last.tick + 5,
            vx_mps: self.wanted[0],
            omega_radps: self.wanted[1],
            ..Command::ZERO
        })
    }

    /// Another process, with what this one has left.
    fn restart(&mut self) -> Result<(), Violation> {
        let mut room = [0; STATE_WORDS];
        let used = self.generator.save_state(&mut room).expect("a state");
        self.generator = (self.build)();
        assert!(self.generator.load_state(&room[..used]), "its own state is refused");
        self.last = *self.generator.state();
        self.restarts += 1;
        // Nothing acts of what was decided before.
        self.authority.mode = Mode::Disarmed.code();
        self.authority.seq += 1;
        self.arm_at_once = self.random.one_in(2);
        for (judge, line) in self.judges.iter_mut().zip(lines(&self.last)) {
            judge.sees_again(self.last.tick, line)?;
        }
        Ok(())
    }

    fn tick(&mut self) -> Result<(), Violation> {
        if self.mortal && self.random.one_in(2_000) {
            self.restart()?;
        }
        let paused_ticks = if self.random.one_in(500) { self.random.whole(1, 100) } else { 0 };
        let authority = self.tell();
        let command = if self.last.tick.is_multiple_of(5) { self.command() } else { None };
        let inputs = StepInputs { authority: authority.as_ref(), commands: command.as_slice(), paused_ticks };
        let steps = self.generator.step(self.last.tick, inputs);
        let drive = Drive::from_code(steps.drive);
        let standing =
            steps.twist == [0.0; 3] || matches!(drive, Some(Drive::EStop | Drive::Disarmed) | None);
        let was = lines(&self.last);
        for (wheel, line) in lines(&steps).into_iter().enumerate() {
            self.judges[wheel].sees(steps.tick, line, standing)?;
            self.seen[0] += u64::from(line.count != was[wheel].count);
            self.seen[1] += u64::from(line.level != was[wheel].level);
            self.angle_rad[wheel] += steps.wheel_speed_radps[wheel] * TICK_S;
            let arrears = (self.angle_rad[wheel] - line.count as f64 * self.step_rad).abs() / self.step_rad;
            let most = 1.0 + self.wait_steps * (1 + self.restarts) as f64;
            assert!(arrears <= most, "tick {}: {arrears} steps owed, {most} at most", steps.tick);
        }
        self.seen[2] += paused_ticks;
        self.last = steps;
        Ok(())
    }
}

fn asked(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

#[test]
fn no_driver_is_asked_for_more_than_it_can_do() {
    let (ticks, first) = (asked("HILARE_PULSE_TICKS", 2_000_000), asked("HILARE_PULSE_SEED", 1));
    let (mut done, mut seed, mut restarts, mut seen) = (0, first, 0, [0; 3]);
    while done < ticks {
        let mut ride = Ride::new(seed);
        let length = ride.random.whole(1_000, 40_000).min(ticks - done);
        for tick in 0..length {
            if let Err(violation) = ride.tick() {
                panic!("HILARE_PULSE_SEED={seed}: {violation} at its tick {tick}: {:?}", ride.last);
            }
        }
        done += length;
        seed += 1;
        restarts += ride.restarts;
        seen = [0, 1, 2].map(|which| seen[which] + ride.seen[which]);
    }
    let [pulses, turns, paused] = seen;
    println!(
        "{done} ticks of {} robots: {pulses} pulses, {turns} changes of DIR, {paused} ticks lost, {restarts} \
         successors; no violation",
        seed - first
    );
    assert!(pulses > done / 20 && turns > done / 2_000 && restarts * 10_000 > done && paused > done / 50);
}

/// A wheel's wires tick by tick: the level of DIR, and what is added to the count.
type Course = &'static [(u64, i64)];

/// What a judge says of a course.
fn verdict(times: Times, course: Course) -> Result<(), Violation> {
    let mut line = Line { count: 0, level: 1 };
    let mut judge = Judge::new(times, false, line);
    // Long ago.
    (1..100).try_for_each(|tick| judge.sees(tick, line, false))?;
    course.iter().zip(100..).try_for_each(|((level, step), tick)| {
        line = Line { count: line.count + step, level: *level };
        judge.sees(tick, line, false)
    })
}

#[test]
fn the_judge_sees_each_kind_of_violation() {
    let plain = Times::default();
    let spaced = Times { length_ns: 900_000, space_ns: 200_000, ..plain };
    let slow = Times { period_ns: 2_000_001, ..plain };
    let setup = Times { setup_ns: 1_000_001, ..plain };
    let hold = Times { length_ns: 1_500_000, hold_ns: 500_001, ..plain };
    let jitter = |times: Times| Times { jitter_ns: 999_999, ..times };
    let quick = Times { setup_ns: 20, hold_ns: 20, length_ns: 100, space_ns: 100, ..plain };
    const ON: (u64, i64) = (1, 1);
    const OFF: (u64, i64) = (1, 0);
    const BACK: (u64, i64) = (0, -1);
    let fine: [(Times, Course); 8] = [
        (plain, &[ON, ON, BACK, BACK, ON]),
        (spaced, &[ON, OFF, ON]),
        (slow, &[ON, OFF, OFF, ON]),
        (setup, &[ON, (0, 0), (0, 0), BACK]),
        (hold, &[ON, OFF, OFF, BACK]),
        (quick, &[ON, ON, (0, 0), BACK]),
        (jitter(quick), &[ON, OFF, ON, OFF, (0, 0), (0, 0), BACK]),
        (jitter(plain), &[ON, ON, BACK, ON]),
    ];
    for (times, course) in fine {
        assert_eq!(verdict(times, course), Ok(()), "{times:?} {course:?}");
    }
    let wrong: [(Times, Course, Violation); 11] = [
        (plain, &[ON, (1, 2)], Violation::Burst),
        (plain, &[ON, (1, -1)], Violation::WrongWay),
        (plain, &[(0, 1)], Violation::WrongWay),
        (plain, &[(2, 0)], Violation::Level),
        (spaced, &[ON, ON], Violation::TooSoon),
        (slow, &[ON, OFF, ON], Violation::TooSoon),
        (setup, &[ON, (0, 0), BACK], Violation::Setup),
        (quick, &[ON, BACK], Violation::Setup),
        (hold, &[ON, OFF, (0, 0)], Violation::Hold),
        (jitter(quick), &[ON, ON], Violation::TooSoon),
        (jitter(quick), &[ON, OFF, (0, 0), BACK], Violation::Setup),
    ];
    for (times, course, violation) in wrong {
        assert_eq!(verdict(times, course), Err(violation), "{times:?} {course:?}");
    }
    let line = Line { count: 3, level: 1 };
    let judge = || Judge::new(quick, false, line);
    assert_eq!(judge().sees(2, line, false), Err(Violation::Tick));
    assert_eq!(judge().sees(1, Line { count: 4, ..line }, true), Err(Violation::Standing));
    let first = Judge::new(setup, false, line).sees(1, Line { count: 4, ..line }, false);
    assert_eq!(first, Err(Violation::Setup), "the first message sets DIR");
    assert_eq!(judge().sees_again(0, Line { level: 0, ..line }), Err(Violation::Repeat));
    assert_eq!(judge().sees_again(0, line), Ok(()));
}
