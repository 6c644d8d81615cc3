//! Values by name, whatever they are part of.

use super::keys::StartParams;
use super::{Realtime, Supervision, WakeUp};
use crate::recording::RecordingParams;
use hilare_controller::prediction::PredictionParams;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::motors::{Motors, ServoParams, StepperParams};
use hilare_interfaces::params::ParamGroup;
use hilare_planner::{FitSettings, PlannerSettings};
use hilare_plant::camera::CameraParams;
use hilare_plant::dc_servo::DcServoParams;
use hilare_plant::mecanum::MecanumPlantParams;
use hilare_plant::stepper_drive::StepperDriveParams;
use hilare_pose_estimator::ekf::params::EkfParams;
use hilare_step_generator::authority::GateParams;
use hilare_step_generator::limits::Limits;
use hilare_waypoint_selector::Tracking;

/// Values by name; whoever puts one has checked it and knows that it is there.
pub(super) trait Group {
    fn value(&self, name: &str) -> Option<f64>;
    fn put(&mut self, name: &str, value: f64);
}

macro_rules! param_groups_are_groups {
    ($($group:ty),*) => {
        $(impl Group for $group {
            fn value(&self, name: &str) -> Option<f64> {
                self.get(name)
            }

            fn put(&mut self, name: &str, value: f64) {
                let done = self.set(name, value);
                debug_assert_eq!(done, Ok(()), "{name}");
            }
        })*
    };
}

param_groups_are_groups!(
    DifferentialParams,
    MecanumParams,
    StepperParams,
    ServoParams,
    Limits,
    GateParams,
    Tracking,
    PlannerSettings,
    FitSettings,
    StepperDriveParams,
    DcServoParams,
    MecanumPlantParams,
    CameraParams,
    EkfParams,
    PredictionParams,
    Supervision,
    WakeUp,
    RecordingParams
);

impl Group for Chassis {
    fn value(&self, name: &str) -> Option<f64> {
        match self {
            Self::Differential(params) => params.value(name),
            Self::Mecanum(params) => params.value(name),
        }
    }

    fn put(&mut self, name: &str, value: f64) {
        match self {
            Self::Differential(params) => params.put(name, value),
            Self::Mecanum(params) => params.put(name, value),
        }
    }
}

impl Group for Motors {
    fn value(&self, name: &str) -> Option<f64> {
        match self {
            Self::Stepper(params) => params.value(name),
            Self::Servo(params) => params.value(name),
        }
    }

    fn put(&mut self, name: &str, value: f64) {
        match self {
            Self::Stepper(params) => params.put(name, value),
            Self::Servo(params) => params.put(name, value),
        }
    }
}

impl Group for WorldPose {
    fn value(&self, name: &str) -> Option<f64> {
        StartParams { x_m: self.x_m, y_m: self.y_m, theta_rad: self.theta_rad }.get(name)
    }

    fn put(&mut self, name: &str, value: f64) {
        match name {
            "x_m" => self.x_m = value,
            "y_m" => self.y_m = value,
            "theta_rad" => self.theta_rad = value,
            _ => debug_assert!(false, "{name}"),
        }
    }
}

impl Group for Realtime {
    fn value(&self, name: &str) -> Option<f64> {
        match name {
            "cpu" => Some(self.cpu as f64),
            "priority" => Some(self.priority as f64),
            _ => None,
        }
    }

    fn put(&mut self, name: &str, value: f64) {
        match name {
            "cpu" => self.cpu = value as i64,
            "priority" => self.priority = value as u64,
            _ => debug_assert!(false, "{name}"),
        }
    }
}
