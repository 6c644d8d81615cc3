//! Which law drives, and the parameters of every law.

use super::group::Group;
use hilare_controller::{LAWS, LawSpec, law};
use std::fmt;
use std::path::{Path, PathBuf};

/// What drives in a controller process.
#[derive(Clone, Debug, PartialEq)]
pub enum Driver {
    /// One of our laws, by its name.
    Law(&'static str),
    /// Any program that speaks the wires.
    Exec(PathBuf),
}

impl Driver {
    /// The driver of a name: with a `/` it is an executable. `None` for a law there is not.
    pub fn of(name: &str) -> Option<Self> {
        if name.contains('/') {
            Some(Self::Exec(name.into()))
        } else {
            law(name).map(|law| Self::Law(law.name))
        }
    }

    /// Name for people.
    pub fn name(&self) -> String {
        match self {
            Self::Law(law) => (*law).to_owned(),
            Self::Exec(program) => program.display().to_string(),
        }
    }

    /// Name for titles and reports: of an executable its file's.
    pub fn short_name(&self) -> String {
        short_name(&self.name())
    }

    /// The assignments that put it in charge.
    pub fn keys(name: &str) -> Vec<String> {
        if name.contains('/') {
            vec![format!("controller.exec={name}")]
        } else {
            vec![format!("controller.law={name}"), "controller.exec=".to_owned()]
        }
    }
}

/// The name of a driver without the directories it lies in.
pub fn short_name(name: &str) -> String {
    let file = Path::new(name).file_name().map(|file| file.to_string_lossy().into_owned());
    file.unwrap_or_else(|| name.to_owned())
}

/// The chosen law and the parameters of all of them, so that a swap finds its values in the file too.
#[derive(Clone)]
pub struct ControllerConfig {
    /// The law that drives.
    pub law: &'static LawSpec,
    /// An executable that drives instead of the law; empty for none.
    pub exec: String,
    /// Law or executable of the standby; empty for none.
    pub standby: String,
    pub(super) laws: Vec<LawValues>,
}

impl ControllerConfig {
    /// What drives.
    pub fn driver(&self) -> Driver {
        if self.exec.is_empty() {
            Driver::Law(self.law.name)
        } else {
            Driver::Exec(PathBuf::from(&self.exec))
        }
    }

    /// What stands by, if anything.
    pub fn standby(&self) -> Option<Driver> {
        if self.standby.is_empty() { None } else { Driver::of(&self.standby) }
    }

    /// Parameter values of the chosen law, in its order.
    pub fn values(&self) -> Vec<(&'static str, f64)> {
        self.values_of(self.law.name)
    }

    /// Parameter values of any law; empty for an unknown one.
    pub fn values_of(&self, law: &str) -> Vec<(&'static str, f64)> {
        let found = self.laws.iter().find(|values| values.spec.name == law);
        found.map_or_else(Vec::new, |values| values.pairs().collect())
    }
}

impl Default for ControllerConfig {
    fn default() -> Self {
        let (exec, standby) = (String::new(), String::new());
        Self { law: &LAWS[0], exec, standby, laws: LAWS.iter().map(LawValues::new).collect() }
    }
}

impl PartialEq for ControllerConfig {
    fn eq(&self, other: &Self) -> bool {
        let names = |config: &Self| (config.law.name, config.exec.clone(), config.standby.clone());
        names(self) == names(other) && self.laws == other.laws
    }
}

impl fmt::Debug for ControllerConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ControllerConfig")
            .field("law", &self.law.name)
            .field("exec", &self.exec)
            .field("standby", &self.standby)
            .field("laws", &self.laws)
            .finish()
    }
}

/// The parameters of one law.
#[derive(Clone)]
pub(super) struct LawValues {
    spec: &'static LawSpec,
    values: Vec<f64>,
}

impl LawValues {
    fn new(spec: &'static LawSpec) -> Self {
        Self { spec, values: spec.params.iter().map(|param| param.default).collect() }
    }

    fn pairs(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.spec.params.iter().map(|param| param.name).zip(self.values.iter().copied())
    }

    fn position(&self, name: &str) -> Option<usize> {
        self.spec.params.iter().position(|param| param.name == name)
    }
}

impl PartialEq for LawValues {
    fn eq(&self, other: &Self) -> bool {
        self.spec.name == other.spec.name && self.values == other.values
    }
}

impl fmt::Debug for LawValues {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ", self.spec.name)?;
        f.debug_map().entries(self.pairs()).finish()
    }
}

impl Group for LawValues {
    fn value(&self, name: &str) -> Option<f64> {
        self.position(name).map(|index| self.values[index])
    }

    fn put(&mut self, name: &str, value: f64) {
        if let Some(index) = self.position(name) {
            self.values[index] = value;
        }
    }
}
