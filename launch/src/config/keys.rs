//! The table of keys: sections, and which parameter group each of them is.

use super::group::Group;
use super::texts::{
    ACCEPTANCE, CHASSIS, ESTIMATOR, EXEC, FOXGLOVE, FOXGLOVE_ORIGINS, LAW, LISTEN, MAP, MOTORS, ON_LOST,
    ROBOT, STANDBY, TextSpec,
};
use super::{Supervision, System, WakeUp, realtime};
use crate::recording::RecordingParams;
use hilare_controller::LAWS;
use hilare_controller::prediction::PredictionParams;
use hilare_interfaces::chassis::{DifferentialParams, MecanumParams};
use hilare_interfaces::motors::{ServoParams, StepperParams};
use hilare_interfaces::param_group;
use hilare_interfaces::params::{ParamGroup, ParamSpec};
use hilare_interfaces::wires::Role;
use hilare_planner::{FitSettings, MAX_COORDINATE_M, PlannerSettings};
use hilare_plant::camera::CameraParams;
use hilare_plant::dc_servo::DcServoParams;
use hilare_plant::mecanum::MecanumPlantParams;
use hilare_plant::stepper_drive::StepperDriveParams;
use hilare_pose_estimator::ekf::params::EkfParams;
use hilare_step_generator::authority::GateParams;
use hilare_step_generator::limits::Limits;
use hilare_waypoint_selector::Tracking;
use std::fmt;

param_group! {
    /// The table behind `[start]`; the values live in a `WorldPose`.
    StartParams {
        /// World x the robot is assumed to start at.
        x_m: f64 = 0.0, "m", -MAX_COORDINATE_M, MAX_COORDINATE_M;
        /// World y.
        y_m: f64 = 0.0, "m", -MAX_COORDINATE_M, MAX_COORDINATE_M;
        /// Heading, counter-clockwise from world x; a turn either way, so that degrees stand out.
        theta_rad: f64 = 0.0, "rad", -6.3, 6.3;
    }
}

/// What a key takes.
#[derive(Clone, Copy, Debug)]
pub enum Form {
    /// A number or a switch.
    Number(&'static ParamSpec),
    /// Text.
    Text(&'static TextSpec),
}

/// A key of the system file.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    pub(super) section: Section,
    /// Name within its section.
    pub name: &'static str,
    /// What it takes.
    pub form: Form,
}

impl Key {
    /// Section, `controller.kanayama`; empty at the top of the file.
    pub fn section(&self) -> String {
        self.section.path()
    }

    /// Section and name, as `--set` takes them: `controller.kanayama.k1_per_s`.
    pub fn path(&self) -> String {
        join(&self.section.path(), self.name)
    }

    /// What a system must be to have this key; empty if every system has it.
    pub fn only_for(&self) -> &'static [Condition] {
        self.section.only_for()
    }

    /// What it is.
    pub fn doc(&self) -> &'static str {
        match self.form {
            Form::Number(spec) => spec.doc.trim(),
            Form::Text(spec) => spec.doc,
        }
    }
}

/// Every key of a system file, in the file's order.
pub fn keys() -> impl Iterator<Item = Key> {
    Section::all().flat_map(Section::keys)
}

/// A key whose value decides which others there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// `chassis.kind` has this value.
    Chassis(&'static str),
    /// `motors.kind` has this value.
    Motors(&'static str),
}

impl Condition {
    fn holds(self, system: &System) -> bool {
        match self {
            Self::Chassis(kind) => system.chassis.name() == kind,
            Self::Motors(kind) => system.motors.name() == kind,
        }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chassis(kind) => write!(f, "chassis.kind = {kind:?}"),
            Self::Motors(kind) => write!(f, "motors.kind = {kind:?}"),
        }
    }
}

/// A section of the system file. Sections that share a path exclude each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Section {
    Top,
    Differential,
    Mecanum,
    Stepper,
    Servo,
    Limits,
    Timing,
    Tracking,
    Controller,
    /// Parameters of a law, by its place in [`LAWS`].
    Law(usize),
    Estimator,
    Planner,
    Fit,
    StepperDrive,
    DcServo,
    MecanumServo,
    Camera,
    Start,
    Supervision,
    Operator,
    WakeUp,
    Recording,
    Realtime(Role),
}

impl Section {
    /// Every section, in the file's order.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        use Section::*;
        let head = [Top, Differential, Mecanum, Stepper, Servo, Limits, Timing, Tracking, Controller];
        head.into_iter()
            .chain((0..LAWS.len()).map(Law))
            .chain([Estimator, Planner, Fit, StepperDrive, DcServo, MecanumServo, Camera, Start, Supervision])
            .chain([Operator, WakeUp, Recording])
            .chain(Role::WORKERS.map(Realtime))
    }

    /// The section at a path that a system has.
    pub(super) fn of(path: &str, system: &System) -> Option<Self> {
        Self::all().find(|section| section.fits(system) && section.path() == path)
    }

    /// Path of the table `name` within `section`, if sections stand there or below.
    pub(super) fn child(section: &str, name: &str) -> Option<String> {
        // A dot within a quoted key separates nothing.
        if name.is_empty() || name.contains('.') {
            return None;
        }
        let path = join(section, name);
        let leads_to = |known: String| {
            known.strip_prefix(&path).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        Self::all().any(|known| leads_to(known.path())).then_some(path)
    }

    /// Path in the file; empty at the top.
    pub(super) fn path(self) -> String {
        match self {
            Self::Top => String::new(),
            Self::Differential | Self::Mecanum => "chassis".to_owned(),
            Self::Stepper | Self::Servo => "motors".to_owned(),
            Self::Limits => "limits".to_owned(),
            Self::Timing => "timing".to_owned(),
            Self::Tracking => "tracking".to_owned(),
            Self::Controller => "controller".to_owned(),
            Self::Law(index) => format!("controller.{}", LAWS[index].name),
            Self::Estimator => "estimator".to_owned(),
            Self::Planner => "planner".to_owned(),
            Self::Fit => "planner.fit".to_owned(),
            Self::StepperDrive | Self::DcServo | Self::MecanumServo => "plant".to_owned(),
            Self::Camera => "camera".to_owned(),
            Self::Start => "start".to_owned(),
            Self::Supervision => "supervision".to_owned(),
            Self::Operator => "operator".to_owned(),
            Self::WakeUp => "wake_up".to_owned(),
            Self::Recording => "recording".to_owned(),
            Self::Realtime(role) => format!("realtime.{}", role.name()),
        }
    }

    /// What it holds.
    pub(super) fn doc(self) -> &'static str {
        match self {
            Self::Top => "The robot.",
            Self::Differential => "Two driven wheels on an axle.",
            Self::Mecanum => "Four Mecanum wheels.",
            Self::Stepper => "Steppers, driven by pulses.",
            Self::Servo => "Servo motors with encoders: a drive closes a velocity loop round each wheel.",
            Self::Limits => "Input constraints of the step generator, and its ramps to a stop.",
            Self::Timing => "Control period, and what happens when something does not come in time.",
            Self::Tracking => "How fast, and when a waypoint is reached.",
            Self::Controller => "What drives.",
            Self::Law(index) => LAWS[index].title,
            Self::Estimator => "Where the pose comes from, and what the Kalman filter believes if it is one.",
            Self::Planner => {
                "How paths around obstacles are planned; without a map, goals are driven to in a straight line."
            }
            Self::Fit => "How planned paths become lines and arcs.",
            Self::StepperDrive => "The simulated robot on steppers: what the control path does not know.",
            Self::DcServo => "The simulated cart on DC servos: what the control path does not know.",
            Self::MecanumServo => "The simulated Mecanum robot: what the control path does not know.",
            Self::Camera => "What watches the robot from outside, if the estimator needs it.",
            Self::Start => "Pose the robot is assumed to start at.",
            Self::Supervision => "What launch does when a worker dies.",
            Self::Operator => "The operator's page.",
            Self::WakeUp => "What is done so that processes wake in time.",
            Self::Recording => "How what goes over the wires is kept in files.",
            Self::Realtime(_) => "How the process is scheduled.",
        }
    }

    /// What a system must be to have it; empty if every system has it.
    pub(super) fn only_for(self) -> &'static [Condition] {
        use Condition::{Chassis, Motors};
        match self {
            Self::Differential => &[Chassis("differential")],
            Self::Mecanum => &[Chassis("mecanum")],
            Self::Stepper => &[Motors("stepper")],
            Self::Servo => &[Motors("servo")],
            Self::StepperDrive => &[Chassis("differential"), Motors("stepper")],
            Self::DcServo => &[Chassis("differential"), Motors("servo")],
            Self::MecanumServo => &[Chassis("mecanum")],
            _ => &[],
        }
    }

    /// What a system is not and would have to be to have the section.
    pub(super) fn missing_for(self, system: &System) -> Option<&'static Condition> {
        self.only_for().iter().find(|condition| !condition.holds(system))
    }

    /// True if a system has the section.
    pub(super) fn fits(self, system: &System) -> bool {
        self.missing_for(system).is_none()
    }

    /// Its text keys.
    pub(super) fn texts(self) -> impl Iterator<Item = &'static TextSpec> {
        let texts: [Option<&'static TextSpec>; 4] = match self {
            Self::Top => [Some(&ROBOT), None, None, None],
            Self::Differential | Self::Mecanum => [Some(&CHASSIS), None, None, None],
            Self::Stepper | Self::Servo => [Some(&MOTORS), None, None, None],
            Self::Tracking => [Some(&ACCEPTANCE), None, None, None],
            Self::Controller => [Some(&LAW), Some(&EXEC), Some(&STANDBY), None],
            Self::Estimator => [Some(&ESTIMATOR), None, None, None],
            Self::Planner => [Some(&MAP), None, None, None],
            Self::Operator => [Some(&LISTEN), Some(&ON_LOST), Some(&FOXGLOVE), Some(&FOXGLOVE_ORIGINS)],
            _ => [None; 4],
        };
        texts.into_iter().flatten()
    }

    /// Its text key of a name.
    pub(super) fn text(self, name: &str) -> Option<&'static TextSpec> {
        self.texts().find(|spec| spec.name == name)
    }

    /// Its numbers and switches.
    pub(super) fn specs(self) -> &'static [ParamSpec] {
        match self {
            Self::Top | Self::Operator => &[],
            Self::Controller => PredictionParams::SPECS,
            Self::Estimator => EkfParams::SPECS,
            Self::Differential => DifferentialParams::SPECS,
            Self::Mecanum => MecanumParams::SPECS,
            Self::Stepper => StepperParams::SPECS,
            Self::Servo => ServoParams::SPECS,
            Self::Limits => Limits::SPECS,
            Self::Timing => GateParams::SPECS,
            Self::Tracking => Tracking::SPECS,
            Self::Law(index) => LAWS[index].params,
            Self::Planner => PlannerSettings::SPECS,
            Self::Fit => FitSettings::SPECS,
            Self::StepperDrive => StepperDriveParams::SPECS,
            Self::DcServo => DcServoParams::SPECS,
            Self::MecanumServo => MecanumPlantParams::SPECS,
            Self::Camera => CameraParams::SPECS,
            Self::Start => StartParams::SPECS,
            Self::Supervision => Supervision::SPECS,
            Self::WakeUp => WakeUp::SPECS,
            Self::Recording => RecordingParams::SPECS,
            Self::Realtime(role) => realtime::specs(role),
        }
    }

    /// All its keys.
    pub(super) fn keys(self) -> impl Iterator<Item = Key> {
        let texts = self.texts().map(|spec| (spec.name, Form::Text(spec)));
        let numbers = self.specs().iter().map(|spec| (spec.name, Form::Number(spec)));
        texts.chain(numbers).map(move |(name, form)| Key { section: self, name, form })
    }

    fn group(self, system: &System) -> Option<&dyn Group> {
        Some(match self {
            Self::Top | Self::Operator => return None,
            Self::Controller => &system.prediction,
            Self::Estimator => &system.ekf,
            Self::Differential | Self::Mecanum => &system.chassis,
            Self::Stepper | Self::Servo => &system.motors,
            Self::Limits => &system.limits,
            Self::Timing => &system.timing,
            Self::Tracking => &system.tracking,
            Self::Law(index) => &system.controller.laws[index],
            Self::Planner => &system.planner,
            Self::Fit => &system.fit,
            Self::StepperDrive => &system.plant.stepper_drive,
            Self::DcServo => &system.plant.dc_servo,
            Self::MecanumServo => &system.plant.mecanum,
            Self::Camera => &system.camera,
            Self::Start => &system.start,
            Self::Supervision => &system.supervision,
            Self::WakeUp => &system.wake_up,
            Self::Recording => &system.recording,
            Self::Realtime(role) => &system.realtime[realtime::index(role)?],
        })
    }

    fn group_mut(self, system: &mut System) -> Option<&mut dyn Group> {
        Some(match self {
            Self::Top | Self::Operator => return None,
            Self::Controller => &mut system.prediction,
            Self::Estimator => &mut system.ekf,
            Self::Differential | Self::Mecanum => &mut system.chassis,
            Self::Stepper | Self::Servo => &mut system.motors,
            Self::Limits => &mut system.limits,
            Self::Timing => &mut system.timing,
            Self::Tracking => &mut system.tracking,
            Self::Law(index) => &mut system.controller.laws[index],
            Self::Planner => &mut system.planner,
            Self::Fit => &mut system.fit,
            Self::StepperDrive => &mut system.plant.stepper_drive,
            Self::DcServo => &mut system.plant.dc_servo,
            Self::MecanumServo => &mut system.plant.mecanum,
            Self::Camera => &mut system.camera,
            Self::Start => &mut system.start,
            Self::Supervision => &mut system.supervision,
            Self::WakeUp => &mut system.wake_up,
            Self::Recording => &mut system.recording,
            Self::Realtime(role) => &mut system.realtime[realtime::index(role)?],
        })
    }

    /// The value of a number or switch.
    pub(super) fn get(self, system: &System, name: &str) -> Option<f64> {
        self.group(system)?.value(name)
    }

    /// Sets a number or switch that its [`ParamSpec`] has checked.
    pub(super) fn put(self, system: &mut System, name: &str, value: f64) {
        if let Some(group) = self.group_mut(system) {
            group.put(name, value);
        }
    }
}

/// Section and name in one.
pub(super) fn join(section: &str, name: &str) -> String {
    if section.is_empty() { name.to_owned() } else { format!("{section}.{name}") }
}
