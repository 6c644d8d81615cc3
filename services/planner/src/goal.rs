//! Waypoints that can be followed, and goals that give them directly: `follow` is checked and taken as
//! it is, `point` without a map becomes the straight line from the robot.

use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::{GoalKind, MAX_WAYPOINTS, Waypoint};
use hilare_interfaces::segment::Segment;
use std::f64::consts::PI;
use std::fmt;

/// Waypoints closer than this have no direction between them, m.
pub const MIN_SPACING_M: f64 = 1e-6;
/// Waypoints lie within this distance of the origin, m: 100 km is a typing error or a map in the
/// wrong unit.
pub const MAX_COORDINATE_M: f64 = 1e5;
/// Greatest |bulge|: an arc of 270°. A rounder one is two arcs.
pub const MAX_BULGE: f64 = 2.414_213_562_373_096;
/// Radii of arcs lie between this and [`MAX_COORDINATE_M`], m.
pub const MIN_RADIUS_M: f64 = 1e-3;

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
    /// An arc of more than 270°.
    TooRound(usize),
    /// An arc of a radius below [`MIN_RADIUS_M`].
    TooTight(usize),
    /// An arc of a radius above [`MAX_COORDINATE_M`].
    TooFlat(usize),
    /// A crab angle beyond half a turn.
    NoAngle(usize),
    /// A crab angle for a chassis that cannot move sideways.
    NoCrab(usize),
    /// The robot is already there.
    AlreadyThere,
}

impl PathRefusal {
    /// The waypoint it is about.
    pub fn index(&self) -> Option<usize> {
        match self {
            Self::TooFew(_) | Self::TooMany(_) | Self::AlreadyThere => None,
            Self::NotFinite(index)
            | Self::TooFar(index)
            | Self::Repeated(index)
            | Self::TooRound(index)
            | Self::TooTight(index)
            | Self::TooFlat(index)
            | Self::NoAngle(index)
            | Self::NoCrab(index) => Some(*index),
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
            Self::TooRound(_) => write!(f, "an arc of more than 270° (|bulge| > 2.414); divide it into two"),
            Self::TooTight(_) => write!(f, "an arc of a radius below {MIN_RADIUS_M} m; leave it away"),
            Self::TooFlat(_) => {
                write!(f, "an arc of a radius above {MAX_COORDINATE_M} m; write bulge 0 for a line")
            }
            Self::NoAngle(_) => write!(f, "a crab angle beyond ±π rad; is it in radians?"),
            Self::NoCrab(_) => {
                write!(f, "a crab angle, but the chassis cannot move sideways; write 0 or take a mecanum")
            }
            Self::AlreadyThere => write!(f, "the robot is already there"),
        }
    }
}

impl std::error::Error for PathRefusal {}

/// Checks that waypoints can be followed.
pub fn check_path(waypoints: &[Waypoint]) -> Result<(), PathRefusal> {
    if waypoints.len() < 2 {
        return Err(PathRefusal::TooFew(waypoints.len()));
    }
    if waypoints.len() > MAX_WAYPOINTS {
        return Err(PathRefusal::TooMany(waypoints.len()));
    }
    for (index, waypoint) in waypoints.iter().enumerate() {
        let point = waypoint.point();
        if !waypoint.is_finite() {
            return Err(PathRefusal::NotFinite(index));
        }
        if point.x_m.abs().max(point.y_m.abs()) > MAX_COORDINATE_M {
            return Err(PathRefusal::TooFar(index));
        }
        if waypoint.crab_rad.abs() > PI {
            return Err(PathRefusal::NoAngle(index));
        }
        if index > 0 {
            check_segment(waypoint.segment_from(waypoints[index - 1]), index)?;
        }
    }
    Ok(())
}

fn check_segment(segment: Segment, index: usize) -> Result<(), PathRefusal> {
    if segment.chord_m() < MIN_SPACING_M {
        return Err(PathRefusal::Repeated(index));
    }
    let curvature_per_m = segment.curvature_per_m().abs();
    match segment.is_line() {
        true => Ok(()),
        _ if segment.bulge.abs() > MAX_BULGE => Err(PathRefusal::TooRound(index)),
        _ if curvature_per_m * MIN_RADIUS_M > 1.0 => Err(PathRefusal::TooTight(index)),
        _ if curvature_per_m * MAX_COORDINATE_M < 1.0 => Err(PathRefusal::TooFlat(index)),
        _ => Ok(()),
    }
}

/// Checks that a path asks no chassis to move sideways that cannot.
pub fn check_crab(waypoints: &[Waypoint], omnidirectional: bool) -> Result<(), PathRefusal> {
    match waypoints.iter().position(|waypoint| waypoint.crab_rad != 0.0) {
        Some(index) if !omnidirectional => Err(PathRefusal::NoCrab(index)),
        _ => Ok(()),
    }
}

/// The path for a goal that needs no search, from where the robot is.
///
/// `Follow`: the waypoints themselves; if the robot is farther than `acceptance_radius_m` from the
/// first one, it drives straight there first. `Point`: the straight line from the robot to the only
/// waypoint.
pub fn direct_path(
    kind: GoalKind,
    waypoints: &[Waypoint],
    robot: WorldPoint,
    acceptance_radius_m: f64,
) -> Result<Vec<Waypoint>, PathRefusal> {
    let mut path = Vec::with_capacity(waypoints.len() + 1);
    let (first, rest) = waypoints.split_first().ok_or(PathRefusal::TooFew(0))?;
    match kind {
        GoalKind::Follow => {
            // The file's own mistakes keep the file's own numbers.
            check_path(waypoints)?;
            if robot.distance_m(first.point()) > acceptance_radius_m {
                path.push(Waypoint::from(robot));
            }
            path.push(Waypoint::from(first.point()));
            path.extend_from_slice(rest);
        }
        GoalKind::Point => {
            check_goal(first.point(), robot, acceptance_radius_m)?;
            path.extend([Waypoint::from(robot), Waypoint::from(first.point())]);
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

    const A: Waypoint = Waypoint::straight(0.0, 0.0);
    const B: Waypoint = Waypoint::straight(1.0, 0.0);

    fn arc(bulge: f64) -> [Waypoint; 2] {
        [A, Waypoint { bulge, ..B }]
    }

    #[test]
    fn degenerate_arcs_are_refused_with_the_waypoint() {
        for bulge in [1.0, -1.0, 2.4, -0.01] {
            assert_eq!(check_path(&arc(bulge)), Ok(()));
        }
        assert_eq!(check_path(&arc(2.5)), Err(PathRefusal::TooRound(1)));
        assert_eq!(check_path(&arc(-1e-7)), Err(PathRefusal::TooFlat(1)));
        let tiny = Waypoint { x_m: 1e-4, bulge: 1.0, ..A };
        assert_eq!(check_path(&[A, tiny]), Err(PathRefusal::TooTight(1)));
        assert_eq!(check_path(&arc(f64::INFINITY)), Err(PathRefusal::NotFinite(1)));
        assert_eq!(check_path(&[A, Waypoint { bulge: 1.0, ..A }]), Err(PathRefusal::Repeated(1)));
    }

    #[test]
    fn only_an_omnidirectional_chassis_is_asked_to_crab() {
        let sideways = [A, Waypoint { crab_rad: 1.57, ..B }];
        assert_eq!(check_crab(&sideways, true), Ok(()));
        assert_eq!(check_crab(&sideways, false), Err(PathRefusal::NoCrab(1)));
        assert_eq!(check_crab(&arc(1.0), false), Ok(()));
        assert_eq!(check_path(&[A, Waypoint { crab_rad: 90.0, ..B }]), Err(PathRefusal::NoAngle(1)));
    }

    #[test]
    fn paths_that_cannot_be_followed_are_refused_with_the_waypoint() {
        assert_eq!(check_path(&[]), Err(PathRefusal::TooFew(0)));
        assert_eq!(check_path(&[A]), Err(PathRefusal::TooFew(1)));
        assert_eq!(check_path(&[A, B, B]), Err(PathRefusal::Repeated(2)));
        assert_eq!(check_path(&[A, Waypoint::straight(f64::NAN, 0.0)]), Err(PathRefusal::NotFinite(1)));
        assert_eq!(check_path(&[A, Waypoint::straight(2e5, 0.0)]), Err(PathRefusal::TooFar(1)));
        let long = vec![A; MAX_WAYPOINTS + 1];
        assert_eq!(check_path(&long), Err(PathRefusal::TooMany(MAX_WAYPOINTS + 1)));
        assert_eq!(check_path(&[A, B, A]), Ok(()), "closing a path is fine");
    }

    #[test]
    fn following_starts_with_the_way_there() {
        let far = WorldPoint::new(0.0, 1.0);
        assert_eq!(direct_path(GoalKind::Follow, &[A, B], far, 0.027).unwrap(), [Waypoint::from(far), A, B]);
        let near = WorldPoint::new(0.01, 0.0);
        assert_eq!(direct_path(GoalKind::Follow, &[A, B], near, 0.027).unwrap(), [A, B]);
        assert_eq!(direct_path(GoalKind::Follow, &[A], near, 0.027), Err(PathRefusal::TooFew(1)));
    }

    #[test]
    fn a_point_is_driven_to_in_a_straight_line() {
        let there = WorldPoint::new(0.99, 0.0);
        assert_eq!(direct_path(GoalKind::Point, &[B], there, 0.027), Err(PathRefusal::AlreadyThere));
        assert_eq!(direct_path(GoalKind::Point, &[B], A.point(), 0.027).unwrap(), [A, B]);
        let nowhere = Waypoint::straight(f64::NAN, 0.0);
        assert_eq!(
            direct_path(GoalKind::Point, &[nowhere], A.point(), 0.027),
            Err(PathRefusal::NotFinite(0))
        );
    }
}
