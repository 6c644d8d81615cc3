//! Which keys can be changed while a robot is up, and which boxes read them.

use super::keys::{Form, Key, Section, keys};
use super::texts::{ACCEPTANCE, ESTIMATOR, EXEC, LAW, STANDBY};
use super::{System, assign, suggest};
use hilare_controller::LAWS;
use hilare_interfaces::params::ParamKind;
use hilare_interfaces::wires::Role;
use hilare_pose_estimator::EstimatorKind;
use serde_json::{Value, json};

/// What a change of a key takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Liveness {
    /// It can be made while the robot drives; these boxes read it.
    Live(&'static [Role]),
    /// It cannot; what to do instead.
    Fixed(&'static str),
}

const DOWN_UP: &str = "it is what the robot is built of; hilare down, then up with it";
const AT_THE_START: &str = "it is read when the robot starts; hilare down, then up with it";
const SWAP: &str = "hilare swap controller LAW puts another one in charge";

use Role::{Controller, Planner, Plant, PoseEstimator, StepGenerator, WaypointSelector};

impl Key {
    /// What a change of it takes. Exhaustive, so that a new section has to say.
    pub fn liveness(&self) -> Liveness {
        use Liveness::{Fixed, Live};
        match (self.section, self.name) {
            (Section::Top, _) => {
                Fixed("it is the name the robot is up under; hilare down, then up --robot NAME")
            }
            (Section::Differential | Section::Mecanum | Section::Stepper | Section::Servo, _) => {
                Fixed(DOWN_UP)
            }
            (Section::Limits, "v_min_mps" | "v_max_mps" | "omega_max_radps") => {
                Live(&[Controller, StepGenerator])
            }
            (Section::Limits, _) => Live(&[StepGenerator]),
            (Section::Tracking, "acceptance_radius_m") => Live(&[Planner, WaypointSelector, Controller]),
            (Section::Tracking, name) if name == ACCEPTANCE.name => Live(&[WaypointSelector, Controller]),
            (Section::Tracking, _) => Live(&[WaypointSelector]),
            (Section::Controller, name) if name == LAW.name || name == EXEC.name => Fixed(SWAP),
            (Section::Controller, name) if name == STANDBY.name => {
                Fixed("hilare down, then up --standby LAW")
            }
            (Section::Controller | Section::Law(_), _) => Live(&[Controller]),
            (Section::Estimator, "start_sd_m" | "start_sd_rad") => Fixed(AT_THE_START),
            (Section::Estimator, name) if name == ESTIMATOR.name => Fixed(DOWN_UP),
            (Section::Estimator, _) => Live(&[PoseEstimator]),
            (Section::Planner | Section::Fit, _) => Live(&[Planner]),
            (Section::StepperDrive | Section::DcServo | Section::MecanumServo | Section::Camera, name)
                if name == "seed" || name.starts_with("start_") || name == "caster_start_rad" =>
            {
                Fixed(AT_THE_START)
            }
            (Section::StepperDrive | Section::DcServo | Section::MecanumServo | Section::Camera, _) => {
                Live(&[Plant])
            }
            (Section::Timing | Section::Start | Section::Supervision, _) => Fixed(AT_THE_START),
            (Section::Operator | Section::WakeUp | Section::Recording | Section::Realtime(_), _) => {
                Fixed(AT_THE_START)
            }
        }
    }

    /// The boxes of a system that would have to take a change on now; none if nobody reads it in that system.
    pub fn readers(&self, system: &System) -> &'static [Role] {
        let unread = match self.section {
            Section::Camera => !system.estimator.needs_fixes(),
            Section::Estimator => system.estimator != EstimatorKind::Ekf,
            _ => false,
        };
        match self.liveness() {
            Liveness::Live(roles) if !unread => roles,
            _ => &[],
        }
    }

    /// The law whose parameter it is, if it is one's.
    pub fn law(&self) -> Option<&'static str> {
        match self.section {
            Section::Law(index) => Some(LAWS[index].name),
            _ => None,
        }
    }

    /// Its unit; empty for a pure number and for text.
    pub fn unit(&self) -> &'static str {
        match self.form {
            Form::Number(spec) => spec.unit,
            Form::Text(_) => "",
        }
    }

    /// What it allows, in words: bounds or choices.
    pub fn allowed(&self) -> String {
        match self.form {
            Form::Number(spec) if spec.kind == ParamKind::Switch => "true or false".to_owned(),
            Form::Number(spec) => format!("{} to {}", spec.min, spec.max),
            Form::Text(spec) => (spec.choices)().join(", "),
        }
    }

    /// Its default, as it is written without quotes.
    pub fn default_text(&self) -> String {
        match self.form {
            Form::Number(spec) => number_text(spec.kind, spec.default),
            Form::Text(spec) => spec.default.to_owned(),
        }
    }

    /// Its value in a system, as it is written without quotes.
    pub fn value_text(&self, system: &System) -> String {
        match self.form {
            Form::Number(spec) => {
                number_text(spec.kind, self.section.get(system, self.name).unwrap_or(spec.default))
            }
            Form::Text(spec) => assign::text_value(system, self.section, spec).to_owned(),
        }
    }

    /// Everything there is to say of it, for programs.
    pub fn to_json(&self, system: &System) -> Value {
        let mut about = json!({ "key": self.path(), "doc": self.doc() });
        match self.form {
            Form::Number(spec) => {
                let value = self.section.get(system, self.name).unwrap_or(spec.default);
                about["value"] = number_json(spec.kind, value);
                about["default"] = number_json(spec.kind, spec.default);
                about["unit"] = spec.unit.into();
                if spec.kind != ParamKind::Switch {
                    about["min"] = number_json(spec.kind, spec.min);
                    about["max"] = number_json(spec.kind, spec.max);
                }
            }
            Form::Text(spec) => {
                about["value"] = self.value_text(system).into();
                about["default"] = spec.default.into();
                let choices = (spec.choices)();
                if !choices.is_empty() {
                    about["choices"] = choices.into();
                }
            }
        }
        match self.liveness() {
            Liveness::Live(_) => {
                about["live"] = true.into();
                about["boxes"] =
                    self.readers(system).iter().map(|role| role.name()).collect::<Vec<_>>().into();
            }
            Liveness::Fixed(instead) => {
                about["live"] = false.into();
                about["instead"] = instead.into();
            }
        }
        about
    }
}

fn number_text(kind: ParamKind, value: f64) -> String {
    match kind {
        ParamKind::Switch => (value != 0.0).to_string(),
        ParamKind::Integer | ParamKind::Real => value.to_string(),
    }
}

fn number_json(kind: ParamKind, value: f64) -> Value {
    match kind {
        ParamKind::Switch => (value != 0.0).into(),
        ParamKind::Integer => (value as i64).into(),
        ParamKind::Real => value.into(),
    }
}

impl System {
    /// The keys this system has, in the file's order.
    pub fn own_keys(&self) -> impl Iterator<Item = Key> {
        keys().filter(|key| key.section.fits(self))
    }

    /// The key of a full name, text or number; or what is wrong with the name.
    pub fn key(&self, path: &str) -> Result<Key, String> {
        let (section, name) = assign::split_key(path);
        let Some(section) = Section::of(section, self) else {
            return Err(match section {
                "" => suggest::unknown_section("", name),
                _ => suggest::unknown_in_no_section("", section, name),
            });
        };
        let found = section.keys().find(|key| key.name == name);
        found.ok_or_else(|| match Section::child(&section.path(), name) {
            Some(child) => format!("{child} is a section; hilare param list {child}"),
            None => suggest::unknown_key("", section, self, name),
        })
    }

    /// The keys of a section (and of those below it), or those whose name has a word in it; or what is wrong with the
    /// word.
    pub fn keys_like(&self, word: &str) -> Result<Vec<Key>, String> {
        let below = format!("{word}.");
        let of_section = |key: &Key| key.path() == word || key.path().starts_with(&below);
        let mut found: Vec<Key> = self.own_keys().filter(of_section).collect();
        if found.is_empty() {
            found = self.own_keys().filter(|key| key.path().contains(word)).collect();
        }
        if found.is_empty() { Err(suggest::unknown_word(self, word)) } else { Ok(found) }
    }
}

/// Key of an assignment `KEY=VALUE`.
pub fn key_of(assignment: &str) -> &str {
    assignment.split('=').next().unwrap_or_default().trim()
}

#[cfg(test)]
mod tests;
