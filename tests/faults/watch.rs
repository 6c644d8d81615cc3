//! What holds at every tick, whatever goes wrong. Nothing here is taken from the step generator but what it
//! publishes and the limits it was given.

use super::judge::{Judge, Line, Times};
use hilare::config::System;
use hilare_interfaces::block::{TICK_S, Tick};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Drive, Mode, Pose, Steps};
use hilare_interfaces::motors::Motors;
use std::collections::VecDeque;

/// Rounding of sums and products of a few numbers.
const EPS: f64 = 1e-9;
/// Window in which steps are counted, ticks.
const WINDOW: usize = 20;

/// Control cycles for which a command was due, by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cycles {
    /// Driven by the command of the controller in charge.
    pub own: u64,
    /// Driven by the standby's.
    pub borrowed: u64,
    /// Without one: held, ramped, or held back for want of a lease.
    pub without: u64,
    /// Cut by a change of mode.
    pub cut: u64,
}

/// The watch over one run.
pub struct Watch {
    system: System,
    /// Counts of a wheel a tick at top speed.
    rate: f64,
    mode: Mode,
    seq: u64,
    /// First cycle for which a command is due.
    due_from: Tick,
    /// The present cycle has seen another mode.
    cut: bool,
    prev: Steps,
    /// State before the present cycle, and after its first tick.
    before: Steps,
    opened: Steps,
    counts: VecDeque<[i64; 4]>,
    judges: Vec<Judge>,
    cycles: Cycles,
}

impl Watch {
    /// Over a robot that has just been started.
    pub fn new(system: &System) -> Self {
        let fastest = system.chassis.wheel_speed_max_radps().into_iter().fold(0.0, f64::max);
        Self {
            rate: fastest * TICK_S / system.count_rad(),
            system: system.clone(),
            mode: Mode::Disarmed,
            seq: 0,
            due_from: Tick::MAX,
            cut: false,
            prev: Steps::ZERO,
            before: Steps::ZERO,
            opened: Steps::ZERO,
            counts: VecDeque::from([[0; 4]]),
            judges: judges(system),
            cycles: Cycles::default(),
        }
    }

    /// What became of the cycles.
    pub fn cycles(&self) -> Cycles {
        self.cycles
    }

    /// An authority message has come before tick `tick`.
    pub fn told(&mut self, tick: Tick, authority: &Authority) {
        if authority.seq <= self.seq {
            return;
        }
        self.seq = authority.seq;
        let wanted = Mode::from_code(authority.mode).unwrap_or(Mode::Stop);
        let mode = if self.mode == Mode::EStop && wanted != Mode::Disarmed { Mode::EStop } else { wanted };
        if mode == self.mode {
            return;
        }
        self.cut = true;
        self.mode = mode;
        let period = self.system.timing.period_ticks;
        self.due_from = if mode == Mode::Armed { (tick.div_ceil(period) + 1) * period } else { Tick::MAX };
    }

    /// Another process counts the ticks: it stands still, disarmed.
    pub fn restarted(&mut self) {
        (self.mode, self.seq, self.due_from, self.cut) = (Mode::Disarmed, 0, Tick::MAX, true);
    }

    /// A pose was estimated.
    pub fn pose(&self, pose: &Pose) {
        let finite = [pose.x_m, pose.y_m, pose.theta_rad].iter().all(|number| number.is_finite());
        assert!(finite, "a pose that is none: {pose:?}");
    }

    /// A tick was executed.
    pub fn tick(&mut self, steps: &Steps) {
        assert_eq!(steps.tick, self.prev.tick + 1, "ticks are counted one by one");
        self.within_limits(steps);
        self.no_jump(steps);
        self.no_burst(steps);
        judge(&mut self.judges, steps);
        self.counters(steps);
        self.close_cycle(steps);
        self.prev = *steps;
    }

    fn within_limits(&self, steps: &Steps) {
        let (system, at) = (&self.system, steps.tick);
        let fastest = system.chassis.wheel_speed_max_radps();
        for (speed, limit) in steps.wheel_speed_radps.iter().zip(fastest) {
            assert!(speed.abs() <= limit + EPS, "tick {at}: a wheel at {speed} rad/s, {limit} at most");
        }
        let (limits, [vx, vy, omega]) = (&system.limits, steps.twist);
        let speed = vx.hypot(vy);
        // Only a differential drive has a least speed.
        let least = if system.chassis.is_omnidirectional() { -limits.v_max_mps } else { limits.v_min_mps };
        assert!(speed <= limits.v_max_mps + EPS && vx >= least - EPS, "tick {at}: {vx}, {vy} m/s");
        assert!(omega.abs() <= limits.omega_max_radps + EPS, "tick {at}: {omega} rad/s");
    }

    /// What moves changes no faster than the limits for driving, or for stopping, allow.
    fn no_jump(&self, steps: &Steps) {
        let (limits, at, was, is) = (&self.system.limits, steps.tick, self.prev.twist, steps.twist);
        let (linear, angular) = match drive(steps) {
            Drive::Disarmed | Drive::EStop => {
                assert_eq!(is, [0.0; 3], "tick {at}: it moves");
                return;
            }
            Drive::Command | Drive::Hold => (limits.accel_mps2, limits.accel_radps2),
            Drive::Ramp | Drive::Stop | Drive::LeaseLost | Drive::PauseStop => {
                let slower = is.iter().zip(was).all(|(is, was)| is * was >= 0.0 && is.abs() <= was.abs());
                assert!(slower, "tick {at}: a stop that speeds up, {was:?} to {is:?}");
                (limits.stop_decel_mps2, limits.stop_decel_radps2)
            }
        };
        let change = (is[0] - was[0]).hypot(is[1] - was[1]);
        assert!(linear == 0.0 || change <= linear * TICK_S + EPS, "tick {at}: {was:?} to {is:?}");
        let turn = (is[2] - was[2]).abs();
        assert!(angular == 0.0 || turn <= angular * TICK_S + EPS, "tick {at}: {was:?} to {is:?}");
    }

    /// At most one step a tick, and over some ticks not more than at top speed.
    fn no_burst(&mut self, steps: &Steps) {
        let a_tick = if self.system.motors.has_encoders() { self.rate + 1.0 } else { 1.0 };
        for (wheel, count) in steps.counts.iter().enumerate() {
            let made = |since: i64| count.abs_diff(since) as f64;
            let step = made(self.prev.counts[wheel]);
            assert!(step <= a_tick, "tick {}: {step} counts of wheel {wheel} in a tick", steps.tick);
            let ticks = self.counts.len();
            let burst = made(self.counts[0][wheel]);
            let most = self.rate * ticks as f64 + 1.0 + EPS;
            assert!(burst <= most, "tick {}: {burst} counts of wheel {wheel} in {ticks}", steps.tick);
        }
        self.counts.push_back(steps.counts);
        if self.counts.len() > WINDOW {
            self.counts.pop_front();
        }
    }

    fn counters(&self, steps: &Steps) {
        let of = |steps: &Steps| {
            [
                steps.term,
                steps.commands_late,
                steps.commands_rejected,
                steps.cycles_without_command,
                steps.commands_borrowed,
                steps.promotions,
                steps.ticks_late,
                steps.paused_ticks,
                steps.paused_max_ticks,
            ]
        };
        let grow = of(steps).iter().zip(of(&self.prev)).all(|(is, was)| *is >= was);
        assert!(grow, "tick {}: a counter goes back: {steps:?}", steps.tick);
        let fits = match self.mode {
            Mode::Disarmed => drive(steps) == Drive::Disarmed,
            Mode::EStop => drive(steps) == Drive::EStop,
            Mode::Stop => drive(steps) == Drive::Stop,
            Mode::Armed => !matches!(drive(steps), Drive::Disarmed | Drive::EStop | Drive::Stop),
        };
        assert!(fits, "tick {}: {:?}, but told {:?}", steps.tick, drive(steps), self.mode);
    }

    /// Every cycle for which a command was due is accounted for, and drove as it is accounted for.
    fn close_cycle(&mut self, steps: &Steps) {
        let (tick, period) = (self.prev.tick, self.system.timing.period_ticks);
        if !tick.is_multiple_of(period) {
            return;
        }
        let begun = tick.checked_sub(period);
        if self.mode == Mode::Armed && begun.is_some_and(|begun| begun >= self.due_from) {
            if self.cut {
                self.cycles.cut += 1;
            } else {
                self.account(steps);
            }
        }
        self.cut = false;
        (self.before, self.opened) = (self.prev, *steps);
    }

    fn account(&mut self, steps: &Steps) {
        let without = steps.cycles_without_command - self.opened.cycles_without_command;
        let borrowed = self.prev.commands_borrowed - self.before.commands_borrowed;
        let last = &self.prev;
        let what = format!("cycle before tick {}: without {without}, borrowed {borrowed}", last.tick);
        assert!(without <= 1 && borrowed <= 1, "{what}: counted twice");
        let held_back = |steps: &Steps| matches!(drive(steps), Drive::LeaseLost | Drive::PauseStop);
        match drive(last) {
            Drive::Hold | Drive::Ramp => assert_eq!((without, borrowed), (1, 0), "{what}: it held or ramped"),
            _ if held_back(steps) => assert_eq!(without, 1, "{what}: it was held back"),
            // The lease has come back at this very tick; whether there was a command does not show.
            _ if held_back(last) => {}
            _ => assert_eq!(without, 0, "{what}: it drove"),
        }
        // Whoever came into charge within the cycle may have had a command for it or not.
        let stayed = (last.term, last.in_charge) == (self.opened.term, self.opened.in_charge);
        if (without, borrowed) == (0, 0) && stayed && !held_back(last) {
            assert_eq!(last.source, last.in_charge, "{what}: driven by somebody else");
        }
        match (without, borrowed) {
            (1, _) => self.cycles.without += 1,
            (_, 1) => self.cycles.borrowed += 1,
            _ => self.cycles.own += 1,
        }
    }
}

/// One for each wheel with a stepper, of a robot that has just been started: every DIR forward.
pub fn judges(system: &System) -> Vec<Judge> {
    let Motors::Stepper(stepper) = &system.motors else { return Vec::new() };
    let ns = |time_s: f64| (time_s * 1e9).round() as u64;
    let times = Times {
        length_ns: ns(stepper.pulse_length_s),
        space_ns: ns(stepper.pulse_space_s),
        setup_ns: ns(stepper.direction_setup_s),
        hold_ns: ns(stepper.direction_hold_s),
        jitter_ns: ns(stepper.tick_jitter_s),
        period_ns: ns(1.0 / stepper.pulse_rate_max_hz),
    };
    let of = |inverted: bool| Judge::new(times, inverted, Line { count: 0, level: u64::from(!inverted) });
    vec![of(stepper.invert_right), of(stepper.invert_left)]
}

/// Lets them see the next tick.
#[track_caller]
pub fn judge(judges: &mut [Judge], steps: &Steps) {
    let standing = steps.twist == [0.0; 3];
    for (wheel, judge) in judges.iter_mut().enumerate() {
        let line = Line { count: steps.counts[wheel], level: steps.dir_level[wheel] };
        if let Err(violation) = judge.sees(steps.tick, line, standing) {
            panic!("tick {}: wheel {wheel}: {violation}: {steps:?}", steps.tick);
        }
    }
}

/// Why the wheels turn as they do.
pub fn drive(steps: &Steps) -> Drive {
    Drive::from_code(steps.drive).unwrap_or_else(|| panic!("no meaning: drive {}", steps.drive))
}
