//! The planner of paper 1's block diagram: a collision-free waypoint path through a known map.
//!
//! A pure library: no process, no transport, no log, no clock of its own (see [`Budget`]), no state outside
//! its values. Files are read in [`map`] only.
//!
//! ```text
//!     Map ──▶ ClearanceField ──▶ Planner ──plan(start, goal, budget)──▶ Plan or Refusal
//!     file      exact distances    roadmap, kept
//! ```
//!
//! The life of a query, each stage a file:
//!
//! 1. `planner.rs` checks both ends, then the straight line.
//! 2. `prm/`: samples are added in batches and A* searches the roadmap, checking edges as it needs them,
//!    until start and goal are joined. What departs from Kavraki 1996 is listed there.
//! 3. `links.rs`: if they are not, a wave over the grid links the roadmap's nodes once and for all, which
//!    makes it as connected as the grid; `fine.rs` has the last word before [`Refusal::NoWay`].
//! 4. `smooth.rs`: shortcuts, corners pulled and cut, clearance kept at every step.
//! 5. While the [`Budget`] lasts and the roadmap is not full: more samples, another search; the shortest wins.
//! 6. `waypoints.rs` divides the best path, every corner a waypoint.
//!
//! Beside it, [`goal`] checks waypoints that somebody else chose, and [`waypoint_file`] reads and writes them.
//!
//! Same map, parameters, queries in order and answers of the budget: the same bits, whatever the machine or
//! the number of threads. Only + − × ÷ and √ are used, which IEEE 754 defines to the bit, and `libm`'s sine
//! and cosine for a map's yaw. Under a wall-clock deadline the number of batches may differ, and only that.
//!
//! What is absent: nothing here allocates on a repeated query ([`Planner::plan_into`]); no cell index leaves
//! the crate unnamed; no check trusts the raster of an obstacle list, its shapes are measured.
//!
//! ```
//! use hilare_planner::map::{MapFrame, Unknown};
//! use hilare_planner::{ClearanceField, Map, Planner, PlannerParams, Unlimited, WorldPoint};
//!
//! // 4 m x 4 m with a wall that leaves a gap at the top
//! let frame = MapFrame::new("map", WorldPoint::new(0.0, 0.0), 0.0, 0.1, 40, 40).unwrap();
//! let cells = (0..1600).map(|c| if c % 40 == 20 && c / 40 < 30 { 100 } else { 0 }).collect();
//! let map = Map::from_cells(frame, cells, Unknown::Blocked)?;
//! let params = PlannerParams { radius_m: 0.2, spacing_m: 0.25, ..Default::default() };
//! let mut planner = Planner::new(ClearanceField::new(&map), params);
//! let plan = planner.plan(WorldPoint::new(1.0, 1.0), WorldPoint::new(3.0, 1.0), &mut Unlimited).unwrap();
//! assert!(plan.length_m > 4.0 && plan.clearance_min_m >= 0.2);
//! # Ok::<(), hilare_planner::MapError>(())
//! ```
#![forbid(unsafe_code)]

mod budget;
mod check;
pub mod clearance;
mod fine;
pub mod fit;
pub mod goal;
mod links;
pub mod map;
mod navigator;
mod params;
mod plan;
mod planner;
mod prm;
mod settings;
mod smooth;
pub mod waypoint_file;
mod waypoints;

pub use budget::{Budget, Deadline, Unlimited};
pub use check::Border;
pub use clearance::ClearanceField;
pub use fit::{Fit, FitError, FitSettings, fit};
pub use goal::{
    MAX_COORDINATE_M, MIN_SPACING_M, PathRefusal, check_crab, check_goal, check_path, direct_path,
};
pub use hilare_interfaces::geometry::WorldPoint;
pub use map::{LoadOptions, Map, MapError};
pub use navigator::Navigator;
pub use params::PlannerParams;
pub use plan::{Method, Plan, Refusal, StageTimes};
pub use planner::Planner;
pub use settings::PlannerSettings;
