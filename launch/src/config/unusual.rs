//! Values within their bounds that hardly anybody means.
//!
//! Bounds are absolute: they have to let the e-puck through and a warehouse AGV, and a length in centimetres often
//! passes between them. What is usual is relative: an acceptance radius goes with the size of the robot, a speed with what
//! its wheels can do, a camera's noise with the acceptance radius. A value beyond that is driven with, and said.
//! Only what was written is judged, never a default.

use super::assign::split_key;
use super::keys::{Form, Section};
use super::{System, units};
use hilare_interfaces::chassis::Chassis;
use std::f64::consts::PI;
use std::fmt;

/// A little above 1, for rounding and for a limit set just above what it limits.
const HARDLY_MORE: f64 = 1.05;

/// Greatest acceleration of a tyre's contact point that floors allow, m/s^2: above 3 g.
const GRIP_MPS2: f64 = 30.0;

/// What a range goes with.
#[derive(Clone, Copy)]
pub(super) enum Beside {
    /// Nothing: it holds for every robot.
    Nothing,
    /// The distance between its wheels, m.
    Size(f64),
    /// What its wheels can do straight on, m/s.
    Reach(f64),
    /// What its wheels can do in place, rad/s.
    Turn(f64),
    /// Another key.
    Key(&'static str, f64, &'static str),
}

impl fmt::Display for Beside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => Ok(()),
            Self::Size(size) => write!(f, " for wheels {} m apart", short(*size)),
            Self::Reach(reach) => write!(f, " for wheels that reach {} m/s", short(*reach)),
            Self::Turn(turn) => write!(f, " for wheels that turn the robot at {} rad/s", short(*turn)),
            Self::Key(key, value, unit) => write!(f, " beside {key} = {} {unit}", short(*value)),
        }
    }
}

/// Four digits.
pub(super) fn short(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// What a key usually is.
struct Usual {
    key: &'static str,
    least: f64,
    most: f64,
    beside: Beside,
}

/// A line for each value that was written and is unusual.
pub(super) fn warnings(system: &System) -> Vec<String> {
    let lines = usual(system).into_iter().filter_map(|usual| {
        let place = system.places.of(usual.key)?;
        let (section, name) = split_key(usual.key);
        let key = Section::of(section, system)?.keys().find(|key| key.name == name)?;
        let Form::Number(spec) = key.form else { return None };
        let value = system.get(usual.key)?;
        if value == spec.default {
            return None;
        }
        // What is meant keeps to the bounds, too.
        let most = if usual.most.is_finite() { usual.most } else { spec.max };
        line(place, usual.key, spec.unit, value, usual.least, most, usual.beside)
    });
    lines.chain(too_small(system)).collect()
}

/// The one default that is judged: of a planner that takes a robot for an e-puck.
fn too_small(system: &System) -> Option<String> {
    let (radius_m, wheels_m) = (system.planner.robot_radius_m, wheels_m(system));
    let place = system.places.of("planner.robot_radius_m").or_else(|| system.places.of("planner.map"))?;
    (!system.map.is_empty() && radius_m < wheels_m).then(|| {
        format!(
            "{place}: planner.robot_radius_m = {radius_m} m is less than the robot's wheels take, {} m from its middle: \
             what is near a wall or an obstacle is taken for free",
            short(wheels_m)
        )
    })
}

/// From the middle to the contacts of the wheels, m.
fn wheels_m(system: &System) -> f64 {
    match &system.chassis {
        Chassis::Differential(p) => 0.5 * p.track_m,
        Chassis::Mecanum(p) => p.half_wheelbase_m.hypot(p.half_track_m),
    }
}

/// The line about a value, if it is unusual. Zero stands for "none" wherever it is allowed.
pub(super) fn line(
    place: &str,
    key: &str,
    unit: &str,
    value: f64,
    least: f64,
    most: f64,
    beside: Beside,
) -> Option<String> {
    if value == 0.0 || (least..=most).contains(&value.abs()) {
        return None;
    }
    let (bound, limit, meant) = if value.abs() > most {
        ("at most", most, units::meant_barely(unit, value.abs(), least..=most))
    } else {
        ("at least", least, units::meant(unit, value.abs(), least..=most))
    };
    let hint = meant.unwrap_or_else(|| "; is it in another unit?".to_owned());
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let limit = short(limit);
    Some(format!("{place}: {key} = {value}{unit} is unusual{beside}: {bound} {limit}{unit}{hint}"))
}

/// Distance between the wheels, and between contact and midpoint in turning, m.
fn size(system: &System) -> (f64, f64) {
    match &system.chassis {
        Chassis::Differential(p) => (p.track_m, 0.5 * p.track_m),
        Chassis::Mecanum(p) => (p.half_wheelbase_m + p.half_track_m, p.half_wheelbase_m + p.half_track_m),
    }
}

/// Distance between the wheels of a robot, m.
pub(super) fn size_m(system: &System) -> f64 {
    size(system).0
}

/// What is usual for a robot like this one. The ranges are wide: the three built-in robots lie at least a factor of
/// about two inside, and the tests see to it that a wrong unit does not.
fn usual(system: &System) -> Vec<Usual> {
    let (size, lever) = size(system);
    let radius = system.chassis.wheel_radius_m();
    let driven = system.chassis.wheel_speed_max_radps().into_iter().filter(|speed| *speed > 0.0);
    let reach = driven.fold(f64::INFINITY, f64::min) * radius;
    let turn = reach / lever;
    let (limits, tracking) = (&system.limits, &system.tracking);
    let accepts = tracking.acceptance_radius_m;
    let fastest = if limits.v_max_mps > 0.0 { limits.v_max_mps } else { reach };
    let beside_fastest = Beside::Key("limits.v_max_mps", fastest, "m/s");
    let beside_radius = Beside::Key("tracking.acceptance_radius_m", accepts, "m");
    let accel_mps2 = if limits.accel_mps2 > 0.0 { limits.accel_mps2 } else { 20.0 };
    let by_size = |key, least: f64, most: f64| Usual {
        key,
        least: least * size,
        most: most * size,
        beside: Beside::Size(size),
    };
    let by_radius = |key, most: f64| Usual { key, least: 0.0, most: most * accepts, beside: beside_radius };
    let plain = |key, least: f64, most: f64| Usual { key, least, most, beside: Beside::Nothing };
    let at_most = |key, most: f64, beside| Usual { key, least: 0.0, most, beside };
    let wheel_speed = |key| at_most(key, 10.0 * fastest / radius, beside_fastest);
    // A wheel that accelerates as this turn of the robot asks.
    let swing = |key| at_most(key, GRIP_MPS2 / lever, Beside::Size(size));
    let kanayama = |key| system.get(key).unwrap_or(0.0);
    vec![
        by_size("chassis.wheel_diameter_m", 0.05, 3.0),
        by_size("chassis.wheel_radius_m", 0.02, 1.5),
        wheel_speed("chassis.wheel_speed_max_right_radps"),
        wheel_speed("chassis.wheel_speed_max_left_radps"),
        wheel_speed("chassis.wheel_speed_max_radps"),
        // 20 to 100 000 full steps a turn.
        Usual {
            key: "motors.step_length_m",
            least: PI * 2.0 * radius / 1e5,
            most: PI * 2.0 * radius / 20.0,
            beside: Beside::Key("wheel diameter", 2.0 * radius, "m"),
        },
        plain("motors.pulse_length_s", 0.0, 5e-4),
        plain("motors.pulse_space_s", 0.0, 5e-4),
        plain("motors.direction_setup_s", 0.0, 5e-4),
        plain("motors.direction_hold_s", 0.0, 5e-4),
        at_most("limits.v_min_mps", HARDLY_MORE * reach, Beside::Reach(reach)),
        at_most("limits.v_max_mps", HARDLY_MORE * reach, Beside::Reach(reach)),
        at_most("limits.omega_min_radps", HARDLY_MORE * turn, Beside::Turn(turn)),
        at_most("limits.omega_max_radps", HARDLY_MORE * turn, Beside::Turn(turn)),
        plain("limits.accel_mps2", 0.0, 20.0),
        plain("limits.stop_decel_mps2", 0.0, 20.0),
        swing("limits.accel_radps2"),
        swing("limits.stop_decel_radps2"),
        plain("timing.lease_ticks", 0.0, 5000.0),
        plain("timing.pause_stop_ticks", 0.0, 5000.0),
        at_most("tracking.speed_mps", fastest.min(reach) * HARDLY_MORE, beside_fastest),
        by_size("tracking.acceptance_radius_m", 0.02, 10.0),
        plain("controller.kanayama.k1_per_s", 1e-3, f64::INFINITY),
        // A deviation fades along k3/k2 m, a wrong heading along 2/k3 m.
        Usual {
            key: "controller.kanayama.k2_per_m2",
            least: kanayama("controller.kanayama.k3_per_m") / (50.0 * accepts),
            most: f64::INFINITY,
            beside: beside_radius,
        },
        Usual {
            key: "controller.kanayama.k3_per_m",
            least: 0.2 / accepts,
            most: f64::INFINITY,
            beside: beside_radius,
        },
        plain("controller.navigation-circle.circle_tracks", 0.05, 10.0),
        plain("controller.navigation-circle.proportional_per_rad", 0.1, 50.0),
        plain("controller.pure-pursuit.lookahead_bends", 0.0, 20.0),
        plain("controller.stanley.gain_per_s", 0.05, 100.0),
        at_most("controller.stanley.soft_speed_mps", reach, Beside::Reach(reach)),
        by_radius("controller.qp.knee_m", 0.5),
        plain("controller.qp.end_off", 0.0, 20.0),
        plain("controller.qp.end_heading", 0.0, 50.0),
        plain("controller.qp.pace_price_s", 0.0, 10.0),
        by_size("controller.qp.heading_price_m", 0.0, 20.0),
        plain("controller.qp.accel_mps2", 0.0, 20.0),
        swing("controller.qp.accel_radps2"),
        at_most("controller.finite-step.sideways_max_mps", HARDLY_MORE * reach, Beside::Reach(reach)),
        at_most(
            "controller.finite-step.accel_max_mps2",
            accel_mps2,
            Beside::Key("limits.accel_mps2", accel_mps2, "m/s^2"),
        ),
        by_radius("estimator.camera_sd_m", 0.3),
        plain("estimator.camera_sd_rad", 0.0, 0.05),
        by_size("estimator.start_sd_m", 0.0, 3.0),
        plain("estimator.scale_drift", 0.0, 0.05),
        plain("estimator.slip_noise", 0.0, 0.01),
        by_size("planner.robot_radius_m", 0.3, 5.0),
        by_size("planner.margin_m", 0.0, 3.0),
        by_radius("planner.spacing_m", 20.0),
        plain("planner.deadline_ms", 0.0, 60_000.0),
        by_radius("planner.fit.tolerance_m", 2.0),
        by_size("planner.fit.radius_min_m", 0.0, 10.0),
        plain("planner.fit.radius_max_m", 0.0, 10_000.0),
        by_size("plant.start_error_x_m", 0.0, 3.0),
        by_size("plant.start_error_y_m", 0.0, 3.0),
        by_size("plant.start_sd_m", 0.0, 3.0),
        plain("plant.start_error_theta_rad", 0.0, 1.6),
        plain("plant.start_sd_rad", 0.0, 0.5),
        by_radius("camera.sd_m", 0.2),
        plain("camera.sd_rad", 0.0, 0.05),
        plain("start.theta_rad", 0.0, 3.2),
    ]
}
