//! Waypoints that can be followed, and goals that give them directly: `follow` is checked and taken as
//! it is, `point` without a map becomes the straight line from the robot.

use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::{GoalKind, MAX_WAYPOINTS};
use std::fmt;

/// Waypoints closer than this have no direction between them, m.
pub const MIN_SPACING_M: f64 = 1e-6;
/// Waypoints lie within this distance of the origin, m: 100 km is a typing error or a map in the
/// wrong unit.
pub const MAX_COORDINATE_M: f64 = 1e5;

/// Why a goal has no path. `index` counts waypoints from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathRefusal {
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
}

impl PathRefusal {
    /// The waypoint it is about.
    pub fn index(&self) -> Option<usize> {
        match self {
            Self::NotFinite(index) | Self::TooFar(index) | Self::Repeated(index) => Some(*index),
            _ => None,
        }
    }
}

impl fmt::Display for PathRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFew(0) => write!(f, "no waypoint; a path needs at least two"),
            Self::TooFew(_) => write!(f, "only one waypoint; a path needs at least two"),
            Self::TooMany(n) => write!(f, "more than {MAX_WAYPOINTS} waypoints ({n}); thin the path out"),
            Self::NotFinite(_) => write!(f, "coordinates must be finite numbers"),
            Self::TooFar(_) => write!(f, "coordinates beyond {MAX_COORDINATE_M} m; are they in metres?"),
            Self::Repeated(_) => write!(f, "the same place as the waypoint before; delete one of them"),
            Self::AlreadyThere => write!(f, "the robot is already there"),
        }
    }
}

impl std::error::Error for PathRefusal {}

/// Checks that waypoints can be followed.
pub fn check_path(waypoints: &[WorldPoint]) -> Result<(), PathRefusal> {
    if waypoints.len() < 2 {
        return Err(PathRefusal::TooFew(waypoints.len()));
    }
    if waypoints.len() > MAX_WAYPOINTS {
        return Err(PathRefusal::TooMany(waypoints.len()));
    }
    for (index, point) in waypoints.iter().enumerate() {
        if !point.is_finite() {
            return Err(PathRefusal::NotFinite(index));
        }
        if point.x_m.abs().max(point.y_m.abs()) > MAX_COORDINATE_M {
            return Err(PathRefusal::TooFar(index));
        }
        if index > 0 && point.distance_m(waypoints[index - 1]) < MIN_SPACING_M {
            return Err(PathRefusal::Repeated(index));
        }
    }
    Ok(())
}

/// The path for a goal that needs no search, from where the robot is.
///
/// `Follow`: the waypoints themselves; if the robot is farther than `acceptance_radius_m` from the
/// first one, it drives there first. `Point`: the straight line from the robot to the only waypoint.
pub fn direct_path(
    kind: GoalKind,
    waypoints: &[WorldPoint],
    robot: WorldPoint,
    acceptance_radius_m: f64,
) -> Result<Vec<WorldPoint>, PathRefusal> {
    let mut path = Vec::with_capacity(waypoints.len() + 1);
    let first = *waypoints.first().ok_or(PathRefusal::TooFew(0))?;
    match kind {
        GoalKind::Follow => {
            // The file's own mistakes keep the file's own numbers.
            check_path(waypoints)?;
            if robot.distance_m(first) > acceptance_radius_m {
                path.push(robot);
            }
            path.extend_from_slice(waypoints);
        }
        GoalKind::Point => {
            check_goal(first, robot, acceptance_radius_m)?;
            path.extend([robot, first]);
        }
    }
    check_path(&path)?;
    Ok(path)
}

/// Checks that a point is somewhere to go to.
pub fn check_goal(goal: WorldPoint, robot: WorldPoint, acceptance_radius_m: f64) -> Result<(), PathRefusal> {
    if !goal.is_finite() {
        return Err(PathRefusal::NotFinite(0));
    }
    if robot.distance_m(goal) <= acceptance_radius_m {
        return Err(PathRefusal::AlreadyThere);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: WorldPoint = WorldPoint::new(0.0, 0.0);
    const B: WorldPoint = WorldPoint::new(1.0, 0.0);

    #[test]
    fn paths_that_cannot_be_followed_are_refused_with_the_waypoint() {
        assert_eq!(check_path(&[]), Err(PathRefusal::TooFew(0)));
        assert_eq!(check_path(&[A]), Err(PathRefusal::TooFew(1)));
        assert_eq!(check_path(&[A, B, B]), Err(PathRefusal::Repeated(2)));
        assert_eq!(check_path(&[A, WorldPoint::new(f64::NAN, 0.0)]), Err(PathRefusal::NotFinite(1)));
        assert_eq!(check_path(&[A, WorldPoint::new(2e5, 0.0)]), Err(PathRefusal::TooFar(1)));
        let long = vec![A; MAX_WAYPOINTS + 1];
        assert_eq!(check_path(&long), Err(PathRefusal::TooMany(MAX_WAYPOINTS + 1)));
        assert_eq!(check_path(&[A, B, A]), Ok(()), "closing a path is fine");
    }

    #[test]
    fn following_starts_with_the_way_there() {
        let far = WorldPoint::new(0.0, 1.0);
        assert_eq!(direct_path(GoalKind::Follow, &[A, B], far, 0.027).unwrap(), [far, A, B]);
        let near = WorldPoint::new(0.01, 0.0);
        assert_eq!(direct_path(GoalKind::Follow, &[A, B], near, 0.027).unwrap(), [A, B]);
        assert_eq!(direct_path(GoalKind::Follow, &[A], near, 0.027), Err(PathRefusal::TooFew(1)));
    }

    #[test]
    fn a_point_is_driven_to_in_a_straight_line() {
        let there = WorldPoint::new(0.99, 0.0);
        assert_eq!(direct_path(GoalKind::Point, &[B], there, 0.027), Err(PathRefusal::AlreadyThere));
        assert_eq!(direct_path(GoalKind::Point, &[B], A, 0.027).unwrap(), [A, B]);
        let nowhere = WorldPoint::new(f64::NAN, 0.0);
        assert_eq!(direct_path(GoalKind::Point, &[nowhere], A, 0.027), Err(PathRefusal::NotFinite(0)));
    }
}
