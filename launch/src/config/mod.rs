//! System and scenario files: TOML in, a checked [`System`] or [`Scenario`] out.
//!
//! ```text
//! robot.toml ──document──▶ entries (section, key, value, place) ──assign──▶ System ──conflict──▶ checked
//! --set KEY=VALUE ────────────────────────────────────────────────▲
//! ```
//!
//! There is no second list of keys: sections are the parameter groups of the boxes ([`keys`]), and a
//! file, `--set`, [`System::to_toml`] and the documentation all walk the same table. A file says only
//! what differs from the defaults; what it says is never ignored: an unknown key, a wrong type, a value
//! out of bounds or two values that contradict each other is an error of one line with its place.

mod assign;
mod conflict;
mod controller;
mod document;
mod error;
mod group;
mod keys;
mod live;
mod manual;
mod maps;
mod places;
mod realtime;
mod scenario;
mod schema;
mod suggest;
mod texts;
mod units;
mod unusual;
mod write;

pub use controller::{ControllerConfig, Driver, short_name};
pub use error::ConfigError;
pub use keys::{Condition, Form, Key, keys};
pub use live::{Liveness, key_of};
pub use manual::manual;
pub use realtime::Realtime;
pub use scenario::{Published, Scenario, Task};
pub use schema::{scenario_schema, system_schema};
pub use texts::TextSpec;

use crate::recording::RecordingParams;
use document::Document;
use hilare_controller::prediction::PredictionParams;
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::motors::{Motors, ServoParams, StepperParams};
use hilare_interfaces::param_group;
use hilare_interfaces::wires::Role;
use hilare_planner::{FitSettings, Map, PlannerSettings};
use hilare_plant::camera::CameraParams;
use hilare_plant::dc_servo::DcServoParams;
use hilare_plant::mecanum::MecanumPlantParams;
use hilare_plant::stepper_drive::StepperDriveParams;
use hilare_pose_estimator::EstimatorKind;
use hilare_pose_estimator::ekf::params::EkfParams;
use hilare_step_generator::authority::GateParams;
use hilare_step_generator::limits::Limits;
use hilare_waypoint_selector::Tracking;
use places::Places;
use std::path::Path;

param_group! {
    /// What launch does when a worker dies.
    Supervision {
        /// Restarts of one worker within the window after which launch gives up.
        restart_budget: u64 = 5, "", 0, 10000;
        /// Window in which restarts are counted.
        restart_window_s: f64 = 10.0, "s", 0.1, 3600.0;
        /// Time without a sign of life after which a worker is taken for hung and replaced; 0 never.
        hung_after_s: f64 = 0.3, "s", 0.0, 60.0;
        /// Control cycles in a row a controller on trial has to answer in time before it takes charge.
        trial_cycles: u64 = 10, "", 1, 10000;
        /// Time it has for that.
        trial_timeout_s: f64 = 2.0, "s", 0.1, 8.0;
        /// After an outage of the only controller, drive on only when the operator arms again.
        resume_by_operator: bool = false, "", 0, 1;
        /// Let workers that crash leave a core file; writing it delays their successor.
        core_files: bool = false, "", 0, 1;
        /// Arm the robot as soon as it is up, without being asked.
        arm_on_start: bool = false, "", 0, 1;
    }
}

param_group! {
    /// What is done so that processes wake in time. Spinning and keeping awake cost processor time.
    WakeUp {
        /// The clock wakes this much before its tick and spins until then; the kernel's budget for real time is far.
        spin_us: u64 = 0, "us", 0, 200;
        /// A thread that runs only when nothing else does keeps the clock's processor from sleeping.
        keep_awake: bool = false, "", 0, 1;
        /// The pose estimator looks for steps so long after each tick; 0: the steps wake it.
        pose_estimator_us: u64 = 0, "us", 0, 999;
        /// The waypoint selector looks for a pose so long after each tick; 0: the pose wakes it.
        waypoint_selector_us: u64 = 0, "us", 0, 999;
        /// The controller looks for a reference so long after each tick; 0: the reference wakes it.
        controller_us: u64 = 0, "us", 0, 999;
    }
}

/// Systems that can be named without a file.
const BUILT_IN: &[(&str, &str)] = &[
    ("epuck", include_str!("../../systems/epuck.toml")),
    ("cart", include_str!("../../systems/cart.toml")),
    ("agv", include_str!("../../systems/agv.toml")),
];

/// One robot: what it is, how it is driven, how its processes run.
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    /// Name of the robot; one domain of shared memory a robot.
    pub robot: String,
    /// Wheels and where they sit.
    pub chassis: Chassis,
    /// What turns them.
    pub motors: Motors,
    /// Input constraints and stop ramps.
    pub limits: Limits,
    /// Control period, hold, lease and pause.
    pub timing: GateParams,
    /// Reference speed and acceptance radius.
    pub tracking: Tracking,
    /// When a waypoint is accepted; `None` as the law asks.
    pub acceptance: Option<Acceptance>,
    /// Control law and its gains.
    pub controller: ControllerConfig,
    /// How poses that come late are moved on.
    pub prediction: PredictionParams,
    /// Where the pose comes from.
    pub estimator: EstimatorKind,
    /// What the Kalman filter assumes, if it is the estimator.
    pub ekf: EkfParams,
    /// How goals become paths.
    pub planner: PlannerSettings,
    /// How paths become lines and arcs.
    pub fit: FitSettings,
    /// Map to plan on: a built-in name or a file; empty for none.
    pub map: String,
    /// The simulated robots; [`Self::chassis`] and [`Self::motors`] say which one it is.
    pub plant: PlantParams,
    /// What watches the robot from outside, if the estimator needs it.
    pub camera: CameraParams,
    /// Pose the robot is assumed to start at.
    pub start: WorldPose,
    /// Restarts and arming.
    pub supervision: Supervision,
    /// Where the operator's page listens; empty for none.
    pub listen: String,
    /// Where the live view for Foxglove and Lichtblick listens; empty for none.
    pub foxglove: String,
    /// Web pages that may look at it, by their origins, apart by spaces.
    pub foxglove_origins: String,
    /// The robot stops when the last page that gave orders is lost.
    pub stop_when_lost: bool,
    /// How the clock wakes.
    pub wake_up: WakeUp,
    /// How recordings are written.
    pub recording: RecordingParams,
    realtime: [Realtime; Role::WORKERS.len()],
    /// Where its values were written; of no account when two systems are compared.
    places: Places,
}

/// What the control path does not know, for each of the simulated robots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlantParams {
    /// Two wheels on steppers.
    pub stepper_drive: StepperDriveParams,
    /// A cart with two DC servo wheels and casters.
    pub dc_servo: DcServoParams,
    /// Four Mecanum wheels on servos.
    pub mecanum: MecanumPlantParams,
}

impl Default for System {
    fn default() -> Self {
        Self {
            robot: texts::ROBOT.default.to_owned(),
            chassis: Chassis::Differential(DifferentialParams::default()),
            motors: Motors::Stepper(StepperParams::default()),
            limits: Limits::default(),
            timing: GateParams::default(),
            tracking: Tracking::default(),
            acceptance: None,
            controller: ControllerConfig::default(),
            prediction: PredictionParams::default(),
            estimator: EstimatorKind::ALL[0],
            ekf: EkfParams::default(),
            planner: PlannerSettings::default(),
            fit: FitSettings::default(),
            map: texts::MAP.default.to_owned(),
            plant: PlantParams::default(),
            camera: CameraParams::default(),
            start: WorldPose::default(),
            supervision: Supervision::default(),
            listen: texts::LISTEN.default.to_owned(),
            foxglove: texts::FOXGLOVE.default.to_owned(),
            foxglove_origins: texts::FOXGLOVE_ORIGINS.default.to_owned(),
            stop_when_lost: false,
            wake_up: WakeUp::default(),
            recording: RecordingParams::default(),
            realtime: Role::WORKERS.map(Realtime::default_of),
            places: Places::default(),
        }
    }
}

impl System {
    /// Names of the built-in systems.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// True if somebody wants to see the robot: then it has an operator's process.
    pub fn has_operator(&self) -> bool {
        !self.listen.is_empty() || !self.foxglove.is_empty()
    }

    /// Reads a built-in system by name, or a file by a path that ends in `.toml`.
    pub fn load(name_or_path: &str) -> Result<Self, ConfigError> {
        if is_path(name_or_path) {
            let path = Path::new(name_or_path);
            let mut system = Self::parse(name_or_path, &error::read_text(path)?)?;
            system.find_files(path.parent().unwrap_or(Path::new("")));
            if let Some(conflict) = conflict::programs(&system) {
                return Err(ConfigError::new(name_or_path, conflict.what));
            }
            return Ok(system);
        }
        Self::built_in(name_or_path).map_err(ConfigError::bare)
    }

    /// A robot of these kinds, everything else as it is by default; what is no kind stays the default.
    fn of_kinds(chassis: &str, motors: &str) -> Self {
        let mut system = Self::default();
        if chassis == "mecanum" {
            system.chassis = Chassis::Mecanum(MecanumParams::default());
        }
        if motors == "servo" {
            system.motors = Motors::Servo(ServoParams::default());
        }
        system
    }

    /// A built-in system, or what is wrong with the name.
    fn built_in(name: &str) -> Result<Self, String> {
        let (name, text) = find_built_in("system", BUILT_IN, name)?;
        Self::parse(&format!("{name}.toml (built-in)"), text).map_err(|error| error.to_string())
    }

    /// Reads the text of a system file; `origin` is its name in errors.
    pub fn parse(origin: &str, text: &str) -> Result<Self, ConfigError> {
        let document = Document::parse(origin, text)?;
        let mut system = Self::default();
        assign::apply(&mut system, &document, document.entries())?;
        Ok(system)
    }

    /// Sets one key, `SECTION.KEY=VALUE`: `plant.slip_mean=0.05`, `controller.law=kanayama`. On an error
    /// nothing changes.
    pub fn set(&mut self, assignment: &str) -> Result<(), ConfigError> {
        self.set_all(&[assignment])
    }

    /// Sets keys that only together make sense, in any order. On an error nothing changes.
    pub fn set_all<S: AsRef<str>>(&mut self, assignments: &[S]) -> Result<(), ConfigError> {
        let mut changed = self.clone();
        assign::apply_assignments(&mut changed, assignments)?;
        // Workers have another working directory.
        changed.find_files(Path::new(""));
        *self = changed;
        Ok(())
    }

    /// Makes names of files that are relative to `folder` independent of where they are read.
    fn find_files(&mut self, folder: &Path) {
        for file in [&mut self.map, &mut self.controller.exec, &mut self.controller.standby] {
            *file = maps::in_folder(file, folder);
        }
    }

    /// Checks every value and that they fit each other; for those who changed fields directly.
    pub fn check(&self) -> Result<(), ConfigError> {
        assign::check_all(self).map_err(|what| ConfigError::new(&self.robot, what))
    }

    /// What is allowed and hardly meant, a line each: values that were written into a file or set, and that a robot of
    /// this size and speed does not have. Most often it is the unit.
    pub fn warnings(&self) -> Vec<String> {
        unusual::warnings(self)
    }

    /// The value of a number or switch (0, 1) by its full key, `limits.v_max_mps`; `None` for an unknown
    /// key and for text.
    pub fn get(&self, key: &str) -> Option<f64> {
        let (section, name) = assign::split_key(key);
        keys::Section::of(section, self)?.get(self, name)
    }

    /// The key of a number or switch that this system has, by its full name; `None` for others.
    pub fn number_key(&self, path: &str) -> Option<Key> {
        let (section, name) = assign::split_key(path);
        let mut keys = keys::Section::of(section, self)?.keys();
        keys.find(|key| key.name == name && matches!(key.form, Form::Number(_)))
    }

    /// Sets a number or switch by its key, without a word of text; its [`Form::Number`] must allow the value.
    /// Whether the values still fit each other, [`Self::check`] tells.
    pub fn put(&mut self, key: &Key, value: f64) {
        key.section.put(self, key.name, value);
    }

    /// The map to plan on, loaded; `None` if the system has none.
    pub fn load_map(&self) -> Result<Option<Map>, ConfigError> {
        maps::load(&self.map, &self.planner.load_options())
    }

    /// The whole system as a commented file; reading it back gives the same bits.
    pub fn to_toml(&self) -> String {
        write::to_toml(self)
    }

    /// When a waypoint is accepted.
    pub fn acceptance(&self) -> Acceptance {
        self.acceptance.unwrap_or(self.controller.law.acceptance)
    }

    /// Wheel angle of one count of the motors, rad; for a stepper β.
    pub fn count_rad(&self) -> f64 {
        self.motors.count_rad(&self.chassis)
    }

    /// True if the pose estimator reads the plant's encoders or its camera, not only the steps.
    pub fn reads_sensors(&self) -> bool {
        self.motors.has_encoders() || self.estimator.needs_fixes()
    }

    /// How the process of a role is scheduled; launch itself is neither pinned nor real-time.
    pub fn realtime(&self, role: Role) -> Realtime {
        realtime::index(role).map_or(Realtime::UNBOUND, |index| self.realtime[index])
    }
}

/// True if an argument names a file rather than something built in.
fn is_path(name_or_path: &str) -> bool {
    name_or_path.ends_with(".toml")
}

/// Looks a name up in a table of built-in files, or says what is wrong with it.
fn find_built_in(
    what: &str,
    table: &[(&'static str, &'static str)],
    name: &str,
) -> Result<(&'static str, &'static str), String> {
    if let Some(found) = table.iter().find(|(known, _)| *known == name) {
        return Ok(*found);
    }
    let names: Vec<&str> = table.iter().map(|(known, _)| *known).collect();
    let choices = suggest::choices(name, "built-in", &names);
    Err(format!("unknown {what} {}{choices}; or a path ending in .toml", error::quoted(name)))
}

#[cfg(test)]
mod property_tests;
#[cfg(test)]
mod tests;
