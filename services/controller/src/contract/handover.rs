//! A controller that takes over departs from what acts no faster than it may, and not for long.

use super::drives::{Robot, paths};
use super::*;

/// Those of the step generator's stop.
const HANDOVER: HandoverLimits = HandoverLimits { accel_mps2: 2.0, accel_radps2: 40.0 };
/// Control period, s.
const PERIOD_S: f64 = PERIOD as f64 * TICK_S;

/// Periods it takes to cross the whole range of what is let through, and as many again because the law's
/// own command moves meanwhile.
fn most_periods() -> u64 {
    let linear = (LIMITS.v_max_mps - LIMITS.v_min_mps) / (HANDOVER.accel_mps2 * PERIOD_S);
    let turning = 2.0 * LIMITS.omega_max_radps / (HANDOVER.accel_radps2 * PERIOD_S);
    2 * linear.max(turning).ceil() as u64
}

/// Has `to` take over the robot from `acting`; periods until its own command is reached.
fn take_over(mut robot: Robot, mut acting: BodyTwist, to: Case, pair: &str) -> u64 {
    let start = robot.periods;
    let mut controller = to.controller(2);
    controller.take_over(acting, HANDOVER);
    while controller.handover.is_some() {
        let command = robot.period(&mut controller).expect("under way");
        let command = LIMITS.carried_out(&robot.chassis, command);
        let linear = libm::hypot(command.vx_mps - acting.vx_mps, command.vy_mps - acting.vy_mps);
        let turning = (command.omega_radps - acting.omega_radps).abs();
        assert!(linear <= HANDOVER.accel_mps2 * PERIOD_S * (1.0 + 1e-9), "{pair}: {acting:?} {command:?}");
        assert!(turning <= HANDOVER.accel_radps2 * PERIOD_S * (1.0 + 1e-9), "{pair}: {acting:?} {command:?}");
        assert!(robot.periods - start <= most_periods(), "{pair}: own command not reached");
        acting = command;
    }
    robot.periods - start
}

#[test]
fn every_law_takes_over_from_every_other() {
    let [(_, trapezoid), ..] = paths();
    let mut longest = 0;
    for from in every_case() {
        let (name, chassis) = (from.name(), from.chassis);
        let mut robot = Robot::new(&from, &trapezoid);
        let mut controller = from.controller(1);
        // From rest, on the line, in its corner and behind it.
        for after in [1, 1000, 2900, 3000, 3050, 3200] {
            let mut acting = BodyTwist::ZERO;
            while robot.periods < after {
                let command = robot.period(&mut controller).expect("under way");
                acting = LIMITS.carried_out(&robot.chassis, command);
            }
            for to in every_case().filter(|to| to.chassis == chassis) {
                let pair = format!("{name} to {}", to.name());
                longest = longest.max(take_over(robot.clone(), acting, to, &pair));
            }
        }
    }
    assert!(longest > 1, "no pair differs: nothing was seen");
}
