//! Which robots and paths the fast path knows.

use super::lanes::truth::tan_share;
use super::{FastPath, Leg};
use crate::config::{Driver, System};
use crate::shell::build;
use hilare_controller::kanayama;
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::chassis::{Chassis, DifferentialParams};
use hilare_interfaces::messages::{MAX_WAYPOINTS, Waypoint};
use hilare_interfaces::motors::{Motors, PulseTicks};
use hilare_plant::stepper_drive::Steady;
use hilare_pose_estimator::EstimatorKind;
use hilare_pose_estimator::dead_reckoning::DeadReckoning;
use hilare_recorder::statistics::Line;

/// A driver that keeps up with one pulse a tick, and never waits.
const PROMPT: PulseTicks = PulseTicks { interval: 1, setup: 0, hold: 1 };
/// Half the angle the axle turns by in a tick at most, rad: beyond, the series of [`super::lanes`] are too short.
const HALF_TURN_MAX_RAD: f64 = 1e-2;

impl FastPath {
    /// Ready for the path of a system, from its start; or why only the in-process run can drive it.
    pub fn of(system: &System, waypoints: &[Waypoint]) -> Result<Self, &'static str> {
        let (Chassis::Differential(chassis), Motors::Stepper(stepper)) = (system.chassis, system.motors)
        else {
            return Err("it has other wheels than two on steppers");
        };
        if stepper.pulse_ticks() != PROMPT {
            return Err("its motor drivers need more time than a tick");
        }
        if system.controller.driver() != Driver::Law(kanayama::SPEC.name) {
            return Err("its law is not Kanayama's");
        }
        if system.estimator != EstimatorKind::DeadReckoning || system.prediction.drive_lag_s > 0.0 {
            return Err("its controller is not told the dead-reckoned pose");
        }
        if system.acceptance() != Acceptance::Rim {
            return Err("waypoints are not accepted at the rim of their circle");
        }
        if system.limits.accel_mps2 > 0.0 || system.limits.accel_radps2 > 0.0 {
            return Err("its accelerations are limited");
        }
        if !(2..=MAX_WAYPOINTS).contains(&waypoints.len()) || !waypoints.iter().all(Waypoint::makes_sense) {
            return Err("the path is none");
        }
        if waypoints[1..].iter().any(|waypoint| waypoint.bulge != 0.0 || waypoint.crab_rad != 0.0) {
            return Err("the path has arcs or is driven sideways");
        }
        let Some(robot) = build::stepper_drive(system, &chassis, &stepper).steady() else {
            return Err("its slip varies from step to step");
        };
        let [right, left] = robot.rolled_m.map(f64::abs);
        if (right + left) / 2.0 / robot.track_m >= HALF_TURN_MAX_RAD {
            return Err("its steps are large for its track");
        }
        let step_rad = system.count_rad();
        let legs = waypoints.windows(2).map(|ends| leg(ends[0], ends[1])).collect();
        Ok(Self {
            period_ticks: system.timing.period_ticks,
            chassis,
            limits: system.limits,
            tracking: system.tracking,
            reckoning: DeadReckoning::new(system.chassis, step_rad, system.start),
            start: system.start,
            step_rad,
            pulse_speed_max_radps: pulse_speed_max_radps(&chassis, &system.motors),
            robot,
            share_m: share_m(system, &chassis, &robot),
            legs,
        })
    }
}

fn leg(from: Waypoint, to: Waypoint) -> Leg {
    let segment = to.segment_from(from);
    Leg { target: to.point(), heading_rad: segment.heading_rad(), line: Line::of(segment) }
}

/// The highest wheel speed the pulses can carry, rad/s; `None` if the motor diamond lets no higher one through.
fn pulse_speed_max_radps(chassis: &DifferentialParams, motors: &Motors) -> Option<f64> {
    let most_radps = motors.pulse_speed_max_radps(&Chassis::Differential(*chassis))?;
    // [MH18] (17), (18): no wheel is faster than the mean of both tops.
    let top_radps = (chassis.wheel_speed_max_right_radps + chassis.wheel_speed_max_left_radps) / 2.0;
    (most_radps < top_radps * (1.0 + 1e-9)).then_some(most_radps)
}

/// How far steps lead a robot that starts, rolls and turns as the estimator believes; `None` for another. Of one step
/// the turn is always the same, of two it is none.
fn share_m(system: &System, chassis: &DifferentialParams, robot: &Steady) -> Option<[f64; 2]> {
    let Motors::Stepper(stepper) = &system.motors else { return None };
    let step_m = stepper.pulse_travel_m();
    let believed = Steady { rolled_m: [step_m; 2], track_m: chassis.track_m, pose: system.start };
    let turn = step_m / chassis.track_m;
    let (one, two) = (step_m * tan_share(turn * turn), 2.0 * step_m * tan_share(0.0));
    let thrice = (two - 2.0 * one) / 6.0;
    (*robot == believed).then_some([one - thrice, thrice])
}
