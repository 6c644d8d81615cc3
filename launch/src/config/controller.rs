//! Which law drives, and the parameters of every law.

use super::group::Group;
use hilare_controller::{LAWS, LawSpec};
use std::fmt;

/// The chosen law and the parameters of all of them, so that a swap finds its values in the file too.
#[derive(Clone)]
pub struct ControllerConfig {
    /// The law that drives.
    pub law: &'static LawSpec,
    pub(super) laws: Vec<LawValues>,
}

impl ControllerConfig {
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
        Self { law: &LAWS[0], laws: LAWS.iter().map(LawValues::new).collect() }
    }
}

impl PartialEq for ControllerConfig {
    fn eq(&self, other: &Self) -> bool {
        self.law.name == other.law.name && self.laws == other.laws
    }
}

impl fmt::Debug for ControllerConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ControllerConfig").field("law", &self.law.name).field("laws", &self.laws).finish()
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
