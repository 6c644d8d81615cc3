//! Whatever bits a goal has, the answer is a path that can be followed, or one line that says why there is none.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have files, clocks, output and an environment"
)]

use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::hostile::{cases, message, number, some};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{GoalKind, MAX_WAYPOINTS, Waypoint};
use hilare_planner::goal::check_path;
use hilare_planner::map::{MapFrame, Unknown};
use hilare_planner::{Budget, FitSettings, Map, Navigator, PlannerSettings};
use proptest::prelude::*;

/// Looks at the budget that a goal may have here.
const PATIENCE: u32 = 400;

struct Looks(u32);

impl Budget for Looks {
    fn exhausted(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 == 0
    }
}

/// 4 m × 4 m with a wall that leaves a gap at the top.
fn walled() -> Map {
    let frame = MapFrame::new("map", WorldPoint::new(0.0, 0.0), 0.0, 0.1, 40, 40).expect("a frame");
    let cells = (0..1600).map(|cell| if cell % 40 == 20 && cell / 40 < 30 { 100 } else { 0 }).collect();
    Map::from_cells(frame, cells, Unknown::Blocked).expect("a map")
}

fn navigators() -> Vec<Navigator> {
    let settings = PlannerSettings { robot_radius_m: 0.2, spacing_m: 0.3, ..PlannerSettings::default() };
    let fitted = FitSettings { tolerance_m: 0.01, ..FitSettings::default() };
    let map = walled();
    let mut navigators = Vec::new();
    for map in [None, Some(&map)] {
        for fit in [FitSettings::default(), fitted] {
            for omnidirectional in [false, true] {
                navigators.push(Navigator::new(map, &settings, fit, 0.05, omnidirectional));
            }
        }
    }
    navigators
}

fn waypoint() -> impl Strategy<Value = Waypoint> {
    let sensible =
        (0.0..4.0f64, 0.0..4.0f64, -1.5..1.5f64, any::<bool>()).prop_map(|(x_m, y_m, bulge, line)| {
            Waypoint { x_m, y_m, bulge: if line { 0.0 } else { bulge }, crab_rad: 0.0 }
        });
    prop_oneof![3 => sensible.clone(), 1 => message(sensible)]
}

fn waypoints() -> impl Strategy<Value = Vec<Waypoint>> {
    let straight = (0.0..4.0f64, 0.0..4.0f64).prop_map(|(x, y)| Waypoint::straight(x, y));
    prop_oneof![
        4 => some(waypoint(), 12),
        4 => some(straight, 40),
        1 => Just(Vec::new()),
        1 => Just(vec![Waypoint::ZERO; MAX_WAYPOINTS + 2]),
    ]
}

fn robot() -> impl Strategy<Value = WorldPoint> {
    let inside = (0.3..3.7f64, 0.3..3.7f64).prop_map(|(x, y)| WorldPoint::new(x, y));
    let anywhere = (number(), number()).prop_map(|(x, y)| WorldPoint::new(x, y));
    prop_oneof![3 => inside, 1 => anywhere]
}

proptest! {
    #![proptest_config(cases(150))]

    #[test]
    fn any_goal_has_a_path_or_a_reason(goals in some((any::<bool>(), waypoints(), robot()), 3)) {
        for mut navigator in navigators() {
            for (follow, waypoints, robot) in &goals {
                let kind = if *follow { GoalKind::Follow } else { GoalKind::Point };
                match navigator.path(kind, waypoints, *robot, &mut Looks(PATIENCE)) {
                    Ok(path) => prop_assert_eq!(check_path(&path), Ok(()), "{:?}", path),
                    Err(why) => prop_assert!(!why.is_empty() && !why.contains('\n'), "{why:?}"),
                }
            }
        }
    }
}
