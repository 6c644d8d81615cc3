//! The planner: goals into waypoint paths.
//!
//! A `follow` goal is checked and taken as it is; a `point` goal becomes the straight line from the
//! robot. Waypoint files are read here, so that every door (scenario, `--path`, `follow`) refuses the
//! same things with the same words.

pub mod waypoint_file;

use hilare_interfaces::geometry::{WorldPoint, WorldPose};
use hilare_interfaces::messages::{GoalKind, MAX_WAYPOINTS};
use std::fmt;

/// Waypoints closer than this have no direction between them, m.
pub const MIN_SPACING_M: f64 = 1e-6;
/// Waypoints lie within this distance of the origin, m: 100 km is a typing error or a map in the
/// wrong unit.
pub const MAX_COORDINATE_M: f64 = 1e5;

/// Why a goal has no path. `index` counts waypoints from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Fewer than two waypoints.
    TooFew(usize),
    /// More than [`MAX_WAYPOINTS`].
    TooMany(usize),
    /// NaN or infinite coordinates.
    NotFinite(usize),
    /// Coordinates beyond [`MAX_COORDINATE_M`].
    TooFar(usize),
    /// The same place as the waypoint before.
    Repeated(usize),
    /// The robot is already there.
    AlreadyThere,
    /// The robot's pose is not known yet.
    NoPose,
}

impl Refusal {
    /// The waypoint it is about.
    pub fn index(&self) -> Option<usize> {
        match self {
            Self::NotFinite(index) | Self::TooFar(index) | Self::Repeated(index) => Some(*index),
            _ => None,
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFew(0) => write!(f, "no waypoint; a path needs at least two"),
            Self::TooFew(_) => write!(f, "only one waypoint; a path needs at least two"),
            Self::TooMany(n) => write!(f, "more than {MAX_WAYPOINTS} waypoints ({n}); thin the path out"),
            Self::NotFinite(_) => write!(f, "coordinates must be finite numbers"),
            Self::TooFar(_) => write!(f, "coordinates beyond {MAX_COORDINATE_M} m; are they in metres?"),
            Self::Repeated(_) => write!(f, "the same place as the waypoint before; delete one of them"),
            Self::AlreadyThere => write!(f, "the robot is already there"),
            Self::NoPose => write!(f, "the robot's pose is not known yet; arm the robot first"),
        }
    }
}

impl std::error::Error for Refusal {}

/// Checks that waypoints can be followed.
pub fn check_path(waypoints: &[WorldPoint]) -> Result<(), Refusal> {
    if waypoints.len() < 2 {
        return Err(Refusal::TooFew(waypoints.len()));
    }
    if waypoints.len() > MAX_WAYPOINTS {
        return Err(Refusal::TooMany(waypoints.len()));
    }
    for (index, point) in waypoints.iter().enumerate() {
        if !point.is_finite() {
            return Err(Refusal::NotFinite(index));
        }
        if point.x_m.abs().max(point.y_m.abs()) > MAX_COORDINATE_M {
            return Err(Refusal::TooFar(index));
        }
        if index > 0 && point.distance_m(waypoints[index - 1]) < MIN_SPACING_M {
            return Err(Refusal::Repeated(index));
        }
    }
    Ok(())
}

/// The path for a goal.
///
/// `Follow`: the waypoints themselves; if the robot is farther than `acceptance_radius_m` from the
/// first one, it drives there first. `Point`: the straight line from the robot to the only waypoint.
pub fn plan(
    kind: GoalKind,
    waypoints: &[WorldPoint],
    robot: Option<WorldPose>,
    acceptance_radius_m: f64,
) -> Result<Vec<WorldPoint>, Refusal> {
    let robot = robot.map(WorldPose::position);
    let mut path = Vec::with_capacity(waypoints.len() + 1);
    match kind {
        GoalKind::Follow => {
            let first = waypoints.first().ok_or(Refusal::TooFew(0))?;
            path.extend(robot.filter(|robot| robot.distance_m(*first) > acceptance_radius_m));
            // The file's own mistakes keep the file's own numbers.
            check_path(waypoints)?;
        }
        GoalKind::Point => {
            let goal = waypoints.first().ok_or(Refusal::TooFew(0))?;
            if !goal.is_finite() {
                return Err(Refusal::NotFinite(0));
            }
            let robot = robot.ok_or(Refusal::NoPose)?;
            if robot.distance_m(*goal) <= acceptance_radius_m {
                return Err(Refusal::AlreadyThere);
            }
            path.push(robot);
        }
    }
    path.extend_from_slice(waypoints);
    check_path(&path)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: WorldPoint = WorldPoint::new(0.0, 0.0);
    const B: WorldPoint = WorldPoint::new(1.0, 0.0);

    #[test]
    fn paths_that_cannot_be_followed_are_refused_with_the_waypoint() {
        assert_eq!(check_path(&[]), Err(Refusal::TooFew(0)));
        assert_eq!(check_path(&[A]), Err(Refusal::TooFew(1)));
        assert_eq!(check_path(&[A, B, B]), Err(Refusal::Repeated(2)));
        assert_eq!(check_path(&[A, WorldPoint::new(f64::NAN, 0.0)]), Err(Refusal::NotFinite(1)));
        assert_eq!(check_path(&[A, WorldPoint::new(2e5, 0.0)]), Err(Refusal::TooFar(1)));
        let long = vec![A; MAX_WAYPOINTS + 1];
        assert_eq!(check_path(&long), Err(Refusal::TooMany(MAX_WAYPOINTS + 1)));
        assert_eq!(check_path(&[A, B, A]), Ok(()), "closing a path is fine");
    }

    #[test]
    fn following_starts_with_the_way_there() {
        let far = Some(WorldPose::new(0.0, 1.0, 0.0));
        let path = plan(GoalKind::Follow, &[A, B], far, 0.027).unwrap();
        assert_eq!(path, [WorldPoint::new(0.0, 1.0), A, B]);
        let near = Some(WorldPose::new(0.01, 0.0, 0.0));
        assert_eq!(plan(GoalKind::Follow, &[A, B], near, 0.027).unwrap(), [A, B]);
        assert_eq!(plan(GoalKind::Follow, &[A, B], None, 0.027).unwrap(), [A, B]);
    }

    #[test]
    fn a_point_needs_to_know_where_the_robot_is() {
        assert_eq!(plan(GoalKind::Point, &[B], None, 0.027), Err(Refusal::NoPose));
        let there = Some(WorldPose::new(0.99, 0.0, 0.0));
        assert_eq!(plan(GoalKind::Point, &[B], there, 0.027), Err(Refusal::AlreadyThere));
        let path = plan(GoalKind::Point, &[B], Some(WorldPose::default()), 0.027).unwrap();
        assert_eq!(path, [A, B]);
    }
}
