//! Answers: plans and refusals.

use hilare_interfaces::geometry::WorldPoint;
use std::fmt;

/// What found the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// the straight line is free
    Straight,
    /// samples joined by straight edges
    Prm,
    /// the roadmap with its nodes linked over the grid
    LinkedPrm,
    /// the flood over half cells
    FineGrid,
}

impl Method {
    /// Short name for tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::Prm => "prm",
            Self::LinkedPrm => "prm+grid",
            Self::FineGrid => "grid",
        }
    }
}

/// Time spent in the stages of one query, from the caller's clock, nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// until the first way was known
    pub first_solution_ns: u64,
    /// adding samples and searching again
    pub improvement_ns: u64,
    /// making the best way shorter and dividing it into waypoints
    pub smoothing_ns: u64,
}

/// A way from start to goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// start first, goal last, world frame
    pub waypoints: Vec<WorldPoint>,
    /// length over the waypoints, metres
    pub length_m: f64,
    /// least distance from the robot's midpoint to an obstacle anywhere on the way, metres
    pub clearance_min_m: f64,
    /// length of the first way found, before smoothing, metres
    pub first_length_m: f64,
    /// what found it
    pub method: Method,
    /// samples in the roadmap, this query's included
    pub samples: usize,
    /// where the time went
    pub times: StageTimes,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            waypoints: Vec::new(),
            length_m: 0.0,
            clearance_min_m: f64::INFINITY,
            first_length_m: 0.0,
            method: Method::Straight,
            samples: 0,
            times: StageTimes::default(),
        }
    }
}

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// a coordinate is NaN or infinite
    NotFinite,
    /// the start is not on the map (with [`crate::Border::Wall`]: nearer to its edge than the radius)
    StartOutsideMap,
    /// the goal is not on the map
    GoalOutsideMap,
    /// the robot's disc at the start touches an obstacle
    StartInObstacle,
    /// the robot's disc at the goal touches an obstacle
    GoalInObstacle,
    /// both ends are free and no way joins them
    NoWay,
    /// the budget ended before a way was found or excluded
    OutOfTime,
}

impl Refusal {
    /// Short name for JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotFinite => "not_finite",
            Self::StartOutsideMap => "start_outside_map",
            Self::GoalOutsideMap => "goal_outside_map",
            Self::StartInObstacle => "start_in_obstacle",
            Self::GoalInObstacle => "goal_in_obstacle",
            Self::NoWay => "no_way",
            Self::OutOfTime => "out_of_time",
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "start or goal is not a finite point",
            Self::StartOutsideMap => "the start is outside the map",
            Self::GoalOutsideMap => "the goal is outside the map",
            Self::StartInObstacle => "the robot at the start touches an obstacle",
            Self::GoalInObstacle => "the robot at the goal touches an obstacle",
            Self::NoWay => "no way joins start and goal for this radius",
            Self::OutOfTime => "time ran out before a way was found or excluded",
        })
    }
}

impl std::error::Error for Refusal {}
