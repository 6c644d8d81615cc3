//! The planner's section of a system file.

use crate::PlannerParams;
use crate::map::{LoadOptions, Unknown};
use hilare_interfaces::param_group;

param_group! {
    /// How paths around obstacles are planned; without a map, goals are driven to in a straight line.
    PlannerSettings {
        /// Radius of the robot about its midpoint.
        robot_radius_m: f64 = 0.037, "m", 0.0, 10.0;
        /// Distance kept beyond the radius, for what the robot strays from its path.
        margin_m: f64 = 0.0, "m", 0.0, 10.0;
        /// Mean distance of the waypoints of a planned path; 0 gives its corners alone.
        spacing_m: f64 = 0.0525, "m", 0.0, 100.0;
        /// Samples the roadmap grows to.
        samples: u64 = 512, "", 0, 100_000;
        /// Seed of the samples; the same seed gives the same path.
        seed: u64 = 1, "", 0, 9007199254740991u64;
        /// Time a plan may take; 0 until all samples are used, which does not depend on the machine.
        deadline_ms: u64 = 0, "ms", 0, 600_000;
        /// Unknown space of a map is free instead of blocked.
        unknown_is_free: bool = false, "", 0, 1;
    }
}

impl PlannerSettings {
    /// Choices of the planner itself.
    pub fn params(&self) -> PlannerParams {
        PlannerParams {
            radius_m: self.robot_radius_m + self.margin_m,
            seed: self.seed,
            samples: self.samples as usize,
            spacing_m: self.spacing_m,
            ..PlannerParams::default()
        }
    }

    /// Choices a map file does not carry.
    pub fn load_options(&self) -> LoadOptions {
        let unknown = if self.unknown_is_free { Unknown::Free } else { Unknown::Blocked };
        LoadOptions { unknown, ..LoadOptions::default() }
    }
}
