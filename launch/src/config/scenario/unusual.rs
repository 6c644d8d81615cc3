//! What is allowed in a scenario and hardly meant: a path in millimetres, a start far from it.

use super::expected::Figure;
use super::{Scenario, Task};
use crate::config::System;
use crate::config::unusual::{Beside, line, short, size_m};
use hilare_interfaces::messages::Waypoint;

/// A leg of so many times the robot's size is not in its unit. The longest of the built-in scenarios is of 25.
const LEG_SIZES: f64 = 300.0;
/// A start so many acceptance radii away from the path's is not where the path begins.
const START_RADII: f64 = 8.0;

const ORIGIN: Waypoint = Waypoint::straight(0.0, 0.0);

/// A line for each value of robot and job that is unusual.
pub(super) fn warnings(scenario: &Scenario) -> Vec<String> {
    let system = &scenario.system;
    let at = Waypoint::straight(system.start.x_m, system.start.y_m);
    let mut said = system.warnings();
    said.extend(scenario.said.iter().cloned());
    match &scenario.task {
        Task::Follow(waypoints) => {
            said.extend(path(system, &scenario.place, waypoints));
            said.extend(waypoints.first().and_then(|first| start(system, at, *first)));
        }
        Task::Reach(goal) => {
            let goal = Waypoint::straight(goal.x_m, goal.y_m);
            // Of the two, the one that is farther out.
            let start =
                start_key(system, at, goal).filter(|_| distance_m(at, ORIGIN) > distance_m(goal, ORIGIN));
            said.extend(path(system, start.as_deref().unwrap_or(&scenario.place), &[at, goal]));
        }
    }
    said
}

fn distance_m(one: Waypoint, other: Waypoint) -> f64 {
    (other.x_m - one.x_m).hypot(other.y_m - one.y_m)
}

/// How long the drive takes is said by who drives.
fn path(system: &System, place: &str, waypoints: &[Waypoint]) -> Option<String> {
    let legs = waypoints.windows(2).map(|pair| distance_m(pair[0], pair[1]));
    let (longest_m, size_m) = (legs.fold(0.0, f64::max), size_m(system));
    (longest_m > LEG_SIZES * size_m).then(|| {
        let longest_m = short(longest_m);
        format!(
            "{place}: {longest_m} m from one point to the next are unusual for wheels {size_m} m apart; are the \
             coordinates in metres?"
        )
    })
}

/// Place and name of the coordinate of the start that is farther from a point's, if it was written: without one, `--path`
/// begins where its path does.
fn start_key(system: &System, at: Waypoint, from: Waypoint) -> Option<String> {
    let sideways = (at.y_m - from.y_m).abs() > (at.x_m - from.x_m).abs();
    let key = if sideways { "start.y_m" } else { "start.x_m" };
    system.places.of(key).map(|place| format!("{place}: {key}"))
}

fn start(system: &System, at: Waypoint, first: Waypoint) -> Option<String> {
    let place = start_key(system, at, first)?;
    let (off_m, radius_m) = (distance_m(at, first), system.tracking.acceptance_radius_m);
    (off_m > START_RADII * radius_m).then(|| {
        let off_m = short(off_m);
        format!(
            "{place}: the start is {off_m} m from the first waypoint, unusual beside \
             tracking.acceptance_radius_m = {radius_m} m; is it in metres?"
        )
    })
}

/// A line for each figure of `[correction]` and `[[published]]` that is unusual.
pub(super) fn of_figures(system: &System, figures: &[Figure]) -> Vec<String> {
    let radius_m = system.tracking.acceptance_radius_m;
    let beside_radius = Beside::Key("tracking.acceptance_radius_m", radius_m, "m");
    let of = |figure: &Figure| {
        let (most, beside) = match (figure.section, figure.spec.name) {
            ("correction", "cross_track_m") => (radius_m, beside_radius),
            (_, "heading_rad") => (0.5, Beside::Nothing),
            (_, "cross_track_mean_m" | "steady_cross_track_m") => (1.5 * radius_m, beside_radius),
            (_, "speed_error_mean_mps") => {
                let speed = system.tracking.speed_mps;
                (speed, Beside::Key("tracking.speed_mps", speed, "m/s"))
            }
            (_, "correction_time_s") => (60.0, Beside::Nothing),
            (_, "correction_travel_m") => (100.0 * size_m(system), Beside::Size(size_m(system))),
            _ => return None,
        };
        let key = format!("{}.{}", figure.section, figure.spec.name);
        line(&figure.place, &key, figure.spec.unit, figure.value, 0.0, most, beside)
    };
    figures.iter().filter_map(of).collect()
}
