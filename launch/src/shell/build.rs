//! Boxes from a system file: the one place where parameters become boxes, for every clock.

use super::ClockKind;
use crate::config::System;
use hilare_controller::prediction::Prediction;
use hilare_controller::{Built, Controller, Identity, LawSetup, LawSpec, TwistLimits};
use hilare_interfaces::chassis::{Chassis, DifferentialParams};
use hilare_interfaces::motors::{Motors, StepperParams};
use hilare_planner::{Map, Navigator};
use hilare_plant::camera::Camera;
use hilare_plant::dc_servo::{self, DcServo};
use hilare_plant::mecanum::{self, Mecanum};
use hilare_plant::stepper_drive::{self, StepperDrive};
use hilare_plant::{Plant, Robot};
use hilare_pose_estimator::{EstimatorSetup, PoseEstimator};
use hilare_step_generator::StepGenerator;
use hilare_step_generator::authority::GateParams;
use hilare_waypoint_selector::WaypointSelector;

/// The step generator. Only the real clock has a lease and a pause limit: virtual time does not
/// pass while launch or the machine is busy.
pub fn step_generator(system: &System, clock: ClockKind) -> StepGenerator {
    let gate = match clock {
        ClockKind::Real => system.timing,
        ClockKind::Lockstep | ClockKind::InProcess => {
            GateParams { lease_ticks: 0, pause_stop_ticks: 0, ..system.timing }
        }
    };
    StepGenerator::new(system.chassis, system.motors, system.limits, gate)
}

/// The pose estimator, at the system's start pose.
pub fn pose_estimator(system: &System) -> PoseEstimator {
    let setup = EstimatorSetup {
        chassis: system.chassis,
        count_rad: system.count_rad(),
        start: system.start,
        ekf: system.ekf,
    };
    PoseEstimator::new(system.estimator, setup)
}

/// The waypoint selector.
pub fn waypoint_selector(system: &System) -> WaypointSelector {
    WaypointSelector::new(system.tracking, system.acceptance())
}

/// Makes something of what a law is built from.
pub(crate) fn with_setup<T>(system: &System, law: &LawSpec, make: impl FnOnce(&LawSetup<'_>) -> T) -> T {
    make(&LawSetup {
        chassis: &system.chassis,
        limits: TwistLimits {
            v_min_mps: system.limits.v_min_mps,
            v_max_mps: system.limits.v_max_mps,
            omega_max_radps: system.limits.omega_max_radps,
        },
        acceptance_radius_m: system.tracking.acceptance_radius_m,
        acceptance: system.acceptance(),
        period_ticks: system.timing.period_ticks,
        values: &system.controller.values_of(law.name),
    })
}

/// The system's law, or which of its parameters is wrong.
pub fn law(system: &System) -> Built {
    law_of(system, system.controller.law)
}

/// Any law with the parameters the system has for it.
pub fn law_of(system: &System, law: &LawSpec) -> Built {
    with_setup(system, law, law.build)
}

/// A controller with one of the laws.
pub fn controller(system: &System, law: &LawSpec, identity: Identity) -> Result<Controller, String> {
    let built =
        law_of(system, law).map_err(|(key, error)| format!("controller.{}.{key}: {error}", law.name))?;
    let prediction = with_setup(system, law, |setup| Prediction::new(system.prediction, setup));
    Ok(Controller::new(built, identity, system.timing.period_ticks, prediction))
}

/// The planner, with the system's map if it has one.
pub fn navigator(system: &System) -> Result<Navigator, String> {
    let map = system.load_map().map_err(|error| error.to_string())?;
    Ok(navigator_on(map.as_ref(), system))
}

/// The planner on a map that is loaded already.
pub fn navigator_on(map: Option<&Map>, system: &System) -> Navigator {
    let radius_m = system.tracking.acceptance_radius_m;
    Navigator::new(map, &system.planner, system.fit, radius_m, system.chassis.is_omnidirectional())
}

/// The simulated robot on two wheels and steppers.
pub fn stepper_drive(system: &System, wheels: &DifferentialParams, stepper: &StepperParams) -> StepperDrive {
    let body = stepper_drive::Body { track_m: wheels.track_m, step_length_m: stepper.pulse_travel_m() };
    StepperDrive::new(body, system.plant.stepper_drive, system.start)
}

/// The simulated robot.
pub fn plant(system: &System) -> Result<Plant, String> {
    let robot = match (&system.chassis, &system.motors) {
        (Chassis::Differential(wheels), Motors::Stepper(stepper)) => {
            Robot::StepperDrive(stepper_drive(system, wheels, stepper))
        }
        (Chassis::Differential(wheels), Motors::Servo(servo)) => {
            let body = dc_servo::Body {
                track_m: wheels.track_m,
                wheel_diameter_m: wheels.wheel_diameter_m,
                counts_per_turn: servo.counts_per_turn,
            };
            Robot::DcServo(DcServo::new(body, system.plant.dc_servo, system.start))
        }
        (Chassis::Mecanum(wheels), Motors::Servo(servo)) => {
            let body = mecanum::Body {
                half_wheelbase_m: wheels.half_wheelbase_m,
                half_track_m: wheels.half_track_m,
                wheel_radius_m: wheels.wheel_radius_m,
                counts_per_turn: servo.counts_per_turn,
            };
            Robot::Mecanum(Mecanum::new(body, system.plant.mecanum, system.start))
        }
        (Chassis::Mecanum(_), Motors::Stepper(_)) => {
            return Err("there is no simulated robot with Mecanum wheels on steppers".to_owned());
        }
    };
    let camera = system.estimator.needs_fixes().then(|| Camera::new(system.camera));
    Ok(Plant::new(robot, camera))
}
