//! Boxes from a system file: the one place where parameters become boxes, for every clock.

use super::ClockKind;
use crate::config::System;
use hilare_controller::{Controller, Identity, LawSetup, TwistLimits};
use hilare_interfaces::chassis::Chassis;
use hilare_planner::Navigator;
use hilare_plant::StepperDrive;
use hilare_plant::stepper_drive::Body;
use hilare_pose_estimator::PoseEstimator;
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
    StepGenerator::new(system.chassis, system.limits, system.step_rad(), gate)
}

/// The pose estimator, at the system's start pose.
pub fn pose_estimator(system: &System) -> PoseEstimator {
    PoseEstimator::new(system.chassis, system.step_rad(), system.start)
}

/// The waypoint selector.
pub fn waypoint_selector(system: &System) -> WaypointSelector {
    WaypointSelector::new(system.tracking)
}

/// The controller with the system's law.
pub fn controller(system: &System, identity: Identity) -> Result<Controller, String> {
    let law = system.controller.law;
    let values = system.controller.values();
    let setup = LawSetup {
        chassis: &system.chassis,
        limits: TwistLimits {
            v_min_mps: system.limits.v_min_mps,
            v_max_mps: system.limits.v_max_mps,
            omega_max_radps: system.limits.omega_max_radps,
        },
        acceptance_radius_m: system.tracking.acceptance_radius_m,
        accept_at_bisector: system.tracking.accept_at_bisector,
        period_ticks: system.timing.period_ticks,
        values: &values,
    };
    let built =
        (law.build)(&setup).map_err(|(key, error)| format!("controller.{}.{key}: {error}", law.name))?;
    Ok(Controller::new(built, identity, system.timing.period_ticks))
}

/// The planner, with the system's map if it has one.
pub fn navigator(system: &System) -> Result<Navigator, String> {
    let map = system.load_map().map_err(|error| error.to_string())?;
    Ok(Navigator::new(map.as_ref(), &system.planner, system.tracking.acceptance_radius_m))
}

/// The simulated robot.
pub fn plant(system: &System) -> Result<StepperDrive, String> {
    match system.chassis {
        Chassis::Differential(wheels) => {
            let body = Body { track_m: wheels.track_m, step_length_m: system.stepper.step_length_m };
            Ok(StepperDrive::new(body, system.plant, system.start))
        }
        Chassis::Mecanum(_) => Err("chassis.kind: there is no mecanum plant; use differential".to_owned()),
    }
}
