//! Choices of a planner.

use crate::check::Border;

/// Choices of a planner.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannerParams {
    /// the robot's radius, metres
    pub radius_m: f64,
    /// picks the samples; the same seed gives the same plan
    pub seed: u64,
    /// samples the roadmap grows to
    pub samples: usize,
    /// samples added at a time; the budget is asked in between
    pub batch: usize,
    /// neighbours a sample is joined to
    pub neighbours: usize,
    /// mean distance of waypoints, metres; the default gives paper 1's 28 on its platform
    pub spacing_m: f64,
    /// what the map's edge is
    pub border: Border,
}

impl Default for PlannerParams {
    fn default() -> Self {
        Self {
            radius_m: 0.037,
            seed: 0,
            samples: 512,
            batch: 56,
            neighbours: 10,
            spacing_m: 0.0525,
            border: Border::Open,
        }
    }
}
