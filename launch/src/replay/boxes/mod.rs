//! Each box, stepped with what the recording says it took, by the same code as its process.

pub mod controller;
pub mod planner;
pub mod plant;
pub mod pose_estimator;
pub mod step_generator;
pub mod waypoint_selector;

use super::ledger::Tally;
use super::lives::Life;
use hilare_interfaces::wires::Role;
use serde::Serialize;

/// What the replay of a box came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoxReport {
    /// Its name; a controller has its source, epoch and law after it.
    #[serde(rename = "box")]
    pub name: String,
    /// Wire by wire.
    pub wires: Vec<Tally>,
    /// What could not be replayed, and why.
    pub notes: Vec<String>,
}

impl BoxReport {
    /// Nothing yet.
    pub fn new(role: Role) -> Self {
        Self { name: role.name().to_owned(), wires: Vec::new(), notes: Vec::new() }
    }

    /// Something of a process cannot be replayed.
    pub fn note(&mut self, life: &Life, why: &str) {
        self.notes.push(format!("{}: {why}", life.name()));
    }

    /// Messages that differ.
    pub fn differing(&self) -> u64 {
        self.wires.iter().map(|tally| tally.differing).sum()
    }

    /// Messages that were compared.
    pub fn compared(&self) -> u64 {
        self.wires.iter().map(|tally| tally.compared).sum()
    }
}
