//! From a goal to a path, with or without a map: what the planner process asks.

use crate::goal::{PathRefusal, check_crab, check_goal, check_path, direct_path};
use crate::{Budget, ClearanceField, FitSettings, Map, Plan, Planner, PlannerSettings, Refusal, fit};
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::{GoalKind, MAX_WAYPOINTS, Waypoint};

/// Answers goals for one robot, on one map if there is one. The roadmap is kept between goals.
#[derive(Debug)]
pub struct Navigator {
    planner: Option<Planner>,
    acceptance_radius_m: f64,
    omnidirectional: bool,
    fit: FitSettings,
    plan: Plan,
}

impl Navigator {
    /// For a robot that takes a waypoint as reached within `acceptance_radius_m`, and can move sideways or
    /// not; paths are fitted by lines and arcs where `fit` asks for it.
    pub fn new(
        map: Option<&Map>,
        settings: &PlannerSettings,
        fit: FitSettings,
        acceptance_radius_m: f64,
        omnidirectional: bool,
    ) -> Self {
        // A fitted path may stray from the planned one, so that much more room is kept.
        let mut params = settings.params();
        params.radius_m += fit.tolerance_m;
        let planner = map.map(|map| Planner::new(ClearanceField::new(map), params));
        Self { planner, acceptance_radius_m, omnidirectional, fit, plan: Plan::default() }
    }

    /// The path from `robot` for a goal, or why there is none: one line for people.
    ///
    /// On a map, a point is reached around obstacles; waypoints to follow are the operator's choice and
    /// are taken as they are.
    pub fn path(
        &mut self,
        kind: GoalKind,
        waypoints: &[Waypoint],
        robot: WorldPoint,
        budget: &mut dyn Budget,
    ) -> Result<Vec<Waypoint>, String> {
        check_crab(waypoints, self.omnidirectional).map_err(|refusal| named(refusal, kind))?;
        let (Some(planner), GoalKind::Point, Some(goal)) = (&mut self.planner, kind, waypoints.first())
        else {
            let path = direct_path(kind, waypoints, robot, self.acceptance_radius_m);
            return self.fitted(path.map_err(|refusal| named(refusal, kind))?);
        };
        check_goal(goal.point(), robot, self.acceptance_radius_m).map_err(|e| e.to_string())?;
        planner
            .plan_into(robot, goal.point(), budget, &mut self.plan)
            .map_err(|refusal| advice(refusal).to_owned())?;
        if self.plan.waypoints.len() > MAX_WAYPOINTS {
            return Err(format!("the path has more than {MAX_WAYPOINTS} waypoints; raise planner.spacing_m"));
        }
        let path: Vec<Waypoint> = self.plan.waypoints.iter().map(|point| Waypoint::from(*point)).collect();
        check_path(&path).map_err(|e| e.to_string())?;
        self.fitted(path)
    }

    /// The path in lines and arcs, if the settings ask for it and it has none of its own; or why that
    /// cannot be: one line for people.
    pub fn fitted(&self, path: Vec<Waypoint>) -> Result<Vec<Waypoint>, String> {
        let drawn = |waypoint: &Waypoint| waypoint.bulge != 0.0 || waypoint.crab_rad != 0.0;
        if self.fit.tolerance_m == 0.0 || path.iter().any(drawn) {
            return Ok(path);
        }
        let points: Vec<WorldPoint> = path.iter().map(|waypoint| waypoint.point()).collect();
        fit(&points, &self.fit).map(|fitted| fitted.waypoints).map_err(|e| format!("planner.fit: {e}"))
    }

    /// The planner, if there is a map, to complete its roadmap.
    pub fn planner_mut(&mut self) -> Option<&mut Planner> {
        self.planner.as_mut()
    }

    /// The planner, if there is a map.
    pub fn planner(&self) -> Option<&Planner> {
        self.planner.as_ref()
    }
}

/// A refusal of a path with the waypoint that it is about, counted from 0; a goal is one point.
fn named(refusal: PathRefusal, kind: GoalKind) -> String {
    match refusal.index() {
        Some(index) if kind == GoalKind::Follow => format!("waypoint {index}: {refusal}"),
        _ => refusal.to_string(),
    }
}

/// A refusal with what to do about it.
fn advice(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::NotFinite => "start or goal is not a finite point",
        Refusal::StartOutsideMap => "the robot is outside the map; is its frame that of the pose?",
        Refusal::GoalOutsideMap => "the goal is outside the map",
        Refusal::StartInObstacle => "the robot (radius and margin) touches an obstacle where it stands",
        Refusal::GoalInObstacle => "the robot (radius and margin) would touch an obstacle at the goal",
        Refusal::NoWay => "no way leads there for a robot of this radius and margin",
        Refusal::OutOfTime => {
            "the deadline passed before a way was found or excluded; raise planner.deadline_ms"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Unlimited;
    use crate::map::{MapFrame, Unknown};

    /// 4 m x 4 m with a wall at x = 2 m that leaves a gap at the top.
    fn walled() -> Map {
        let frame = MapFrame::new("map", WorldPoint::new(0.0, 0.0), 0.0, 0.1, 40, 40).unwrap();
        let cells = (0..1600).map(|c| if c % 40 == 20 && c / 40 < 30 { 100 } else { 0 }).collect();
        Map::from_cells(frame, cells, Unknown::Blocked).unwrap()
    }

    #[test]
    fn a_point_behind_a_wall_is_reached_around_it_and_followed_waypoints_are_not_second_guessed() {
        let settings = PlannerSettings { robot_radius_m: 0.2, spacing_m: 0.3, ..PlannerSettings::default() };
        let mut navigator = Navigator::new(Some(&walled()), &settings, FitSettings::default(), 0.05, false);
        let (robot, goal) = (WorldPoint::new(1.0, 1.0), WorldPoint::new(3.0, 1.0));
        let path = navigator.path(GoalKind::Point, &[goal.into()], robot, &mut Unlimited).unwrap();
        assert!(path.len() > 5 && path[0].point() == robot && path[path.len() - 1].point() == goal);
        assert!(path.iter().any(|point| point.y_m > 3.0));
        let straight =
            navigator.path(GoalKind::Follow, &[robot.into(), goal.into()], robot, &mut Unlimited).unwrap();
        assert_eq!(straight, [robot.into(), goal.into()]);
        let inside = WorldPoint::new(2.05, 1.0);
        let refused = navigator.path(GoalKind::Point, &[inside.into()], robot, &mut Unlimited).unwrap_err();
        assert!(refused.contains("would touch an obstacle at the goal"), "{refused}");
    }

    #[test]
    fn without_a_map_a_point_is_a_straight_line() {
        let mut navigator =
            Navigator::new(None, &PlannerSettings::default(), FitSettings::default(), 0.05, false);
        let (robot, goal) = (WorldPoint::new(1.0, 1.0), WorldPoint::new(3.0, 1.0));
        assert_eq!(
            navigator.path(GoalKind::Point, &[goal.into()], robot, &mut Unlimited).unwrap(),
            [robot.into(), goal.into()]
        );
    }

    #[test]
    fn where_asked_for_paths_come_in_lines_and_arcs_and_drawn_ones_stay() {
        let settings = FitSettings { tolerance_m: 0.002, ..FitSettings::default() };
        let mut navigator = Navigator::new(None, &PlannerSettings::default(), settings, 0.05, false);
        let circle: Vec<Waypoint> = (0..=60)
            .map(|n| Waypoint::straight(libm::cos(f64::from(n) * 0.1), libm::sin(f64::from(n) * 0.1)))
            .collect();
        let start = circle[0].point();
        let fitted = navigator.path(GoalKind::Follow, &circle, start, &mut Unlimited).unwrap();
        assert!(fitted.len() <= 4 && fitted[1].bulge > 0.0, "{fitted:?}");
        let drawn = [circle[0], Waypoint { bulge: 0.5, ..circle[9] }, circle[20], circle[21]];
        assert_eq!(navigator.path(GoalKind::Follow, &drawn, start, &mut Unlimited).unwrap(), drawn);
    }
}
