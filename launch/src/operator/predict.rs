//! What the robot would make of a path: a run in this process, from where it stands now.

use crate::cli::run::limit_of_length;
use crate::config::{Driver, System};
use crate::shell::build;
use crate::shell::in_process::InProcess;
use hilare_interfaces::block::{TICK_S, Tick};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::{GoalKind, ReferenceState, Waypoint};
use hilare_planner::{ClearanceField, Unlimited};
use hilare_recorder::statistics::RunStatistics;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest drive that is looked at.
const TICKS_MAX: Tick = 1_800_000;
/// Longest time it may take here.
const PATIENCE: Duration = Duration::from_secs(4);
/// Ticks between two looks at the time.
const LOOK: Tick = 512;
/// Ticks between two looks at the obstacles: the robot goes a millimetre or two.
const FEEL: Tick = 32;

/// What would come of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prediction {
    /// The last waypoint would be accepted.
    pub reached: bool,
    /// Time until then, or until it was looked at no longer, s.
    pub duration_s: f64,
    /// Mean distance of the truth from the line, m.
    pub mean_m: f64,
    /// Greatest such distance, m.
    pub max_m: f64,
    /// The same of the segment that ends at each waypoint; none of the first, nor of what was not reached.
    pub cross_track_max_m: Vec<Option<f64>>,
    /// Waypoints on the way to which the robot would touch an obstacle.
    pub touched: Vec<usize>,
}

/// The system with what is in charge now, if that is a law.
pub fn with_law(mut system: System, law: Option<&str>) -> Result<System, String> {
    match law.map(Driver::of) {
        Some(Some(Driver::Law(law))) => {
            system.set_all(&Driver::keys(law)).map_err(|error| error.to_string())?;
            Ok(system)
        }
        None if system.controller.exec.is_empty() => Ok(system),
        _ => Err("a program of its own drives: what it would do cannot be predicted".to_owned()),
    }
}

/// Drives `waypoints` from a pose, the start pose if it has none, on the system's map, if there is one; or says why
/// the robot would not.
pub fn predict(
    system: &System,
    map: Option<&ClearanceField>,
    waypoints: &[Waypoint],
    pose: Option<WorldPose>,
    cancelled: &AtomicBool,
) -> Result<Prediction, String> {
    let mut system = system.clone();
    system.start = pose.unwrap_or(system.start);
    let navigator = &mut build::navigator_on(None, &system);
    let path = navigator.path(GoalKind::Follow, waypoints, system.start.position(), &mut Unlimited)?;
    // Where the robot is not on the path it drives there first. A path that was fitted has other waypoints.
    let before = path.len().checked_sub(waypoints.len()).filter(|before| *before <= 1);
    let length_m: f64 = path.windows(2).map(|pair| pair[1].segment_from(pair[0]).length_m()).sum();
    let limit = limit_of_length(&system, length_m).min(TICKS_MAX);
    let mut told = Prediction { cross_track_max_m: vec![None; waypoints.len()], ..Prediction::default() };
    let mut robot = InProcess::new(&system, &path)?;
    let mut statistics = RunStatistics::default();
    let deadline = Instant::now() + PATIENCE;
    robot.run_watched(limit, |tick| {
        let reference = tick.reference;
        if reference.state == ReferenceState::Tracking.code() {
            let at = tick.truth.pose().position();
            let segment = reference.segment();
            let aside_m =
                if segment.is_line() { segment.cross_track_m(at) } else { segment.nearest(at).cross_track_m };
            let place = before.and_then(|before| (reference.index as usize).checked_sub(before));
            if let (Some(map), Some(place)) = (map.filter(|_| tick.steps.tick.is_multiple_of(FEEL)), place)
                && map.clearance_m(at).is_some_and(|free_m| free_m < system.planner.robot_radius_m)
                && told.touched.last() != Some(&place)
            {
                told.touched.push(place);
            }
            // On the way to the first waypoint it follows no segment of this path.
            let place = place.filter(|place| *place > 0);
            if let Some(most_m) = place.and_then(|place| told.cross_track_max_m.get_mut(place)) {
                *most_m = Some(most_m.unwrap_or(0.0).max(aside_m.abs()));
            }
        }
        let now = tick.steps.tick;
        statistics.push(tick);
        !now.is_multiple_of(LOOK) || (!cancelled.load(Ordering::Relaxed) && Instant::now() < deadline)
    });
    if robot.arrived() {
        statistics.note_arrival();
    }
    let figures = statistics.figures();
    told.reached = figures.reached;
    told.duration_s = figures.ticks as f64 * TICK_S;
    (told.mean_m, told.max_m) = (figures.cross_track_mean_m, figures.cross_track_max_m);
    Ok(told)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Scenario, Task};

    static GO_ON: AtomicBool = AtomicBool::new(false);

    #[test]
    fn a_prediction_is_what_a_run_of_the_same_path_comes_to() {
        let scenario = Scenario::load("so").expect("built in");
        let Task::Follow(waypoints) = &scenario.task else { panic!("it has a path") };
        let told = predict(&scenario.system, None, waypoints, None, &GO_ON).expect("it can be driven");
        let figures =
            InProcess::new(&scenario.system, waypoints).expect("a robot").run(500_000).statistics.figures();
        assert!(told.reached && figures.reached);
        assert_eq!((told.mean_m, told.max_m), (figures.cross_track_mean_m, figures.cross_track_max_m));
        assert_eq!(told.cross_track_max_m.len(), waypoints.len());
        assert_eq!(told.cross_track_max_m[0], None);
        let most_m = told.cross_track_max_m.iter().flatten().fold(0.0_f64, |most, one| most.max(*one));
        assert!((most_m - told.max_m).abs() < 1e-9, "{most_m} {}", told.max_m);
        assert!(told.cross_track_max_m[1..].iter().all(Option::is_some));
    }

    #[test]
    fn a_sharp_corner_shows_where_it_is_and_the_way_to_the_path_does_not_count() {
        let system = System::default();
        let corner = [[0.5, 0.0], [1.0, 0.0], [0.5, 0.05], [1.0, 0.1]].map(|[x, y]| Waypoint::straight(x, y));
        let told = predict(&system, None, &corner, None, &GO_ON).expect("it can be driven");
        let of = |place: usize| told.cross_track_max_m[place].expect("it was reached");
        assert!(told.reached && told.cross_track_max_m[0].is_none());
        assert!(of(1) < 0.005 && of(2) > 3.0 * of(1), "{:?}", told.cross_track_max_m);
        let there = WorldPose { x_m: 0.5, y_m: 0.0, theta_rad: 0.0 };
        let from_there = predict(&system, None, &corner, Some(there), &GO_ON).expect("it can be driven");
        assert!(from_there.duration_s < told.duration_s - 5.0);
    }

    #[test]
    fn obstacles_are_felt_where_they_are() {
        let mut system = System::default();
        system.set("planner.map=platform").expect("built in");
        let map = ClearanceField::new(&system.load_map().expect("it can be read").expect("a map"));
        let start = WorldPose { x_m: 0.2, y_m: 0.2, theta_rad: 0.0 };
        let of = |points: &[[f64; 2]]| {
            let points: Vec<Waypoint> = points.iter().map(|&[x, y]| Waypoint::straight(x, y)).collect();
            predict(&system, Some(&map), &points, Some(start), &GO_ON).expect("it can be driven").touched
        };
        // A disc of 50 mm lies at 0.52, 0.2.
        assert_eq!(of(&[[0.2, 0.2], [0.35, 0.2], [0.7, 0.2], [0.8, 0.2]]), [2]);
        assert_eq!(of(&[[0.2, 0.2], [0.4, 0.2], [0.4, 0.1]]), [0_usize; 0]);
    }

    #[test]
    fn what_the_robot_would_refuse_is_refused_and_what_is_cancelled_ends() {
        let system = System::default();
        let refused =
            |points: &[Waypoint]| predict(&system, None, points, None, &GO_ON).expect_err("refused");
        let sideways = Waypoint { crab_rad: 0.5, ..Waypoint::straight(1.0, 0.0) };
        assert!(
            refused(&[Waypoint::straight(0.0, 0.0), sideways]).contains("sideways"),
            "{}",
            refused(&[Waypoint::straight(0.0, 0.0), sideways])
        );
        assert!(!refused(&[]).is_empty());
        let far = [Waypoint::straight(0.0, 0.0), Waypoint::straight(5000.0, 0.0)];
        let told = predict(&system, None, &far, None, &AtomicBool::new(true)).expect("it ends");
        assert!(!told.reached && told.duration_s < 2.0, "{told:?}");
        assert!(with_law(system.clone(), Some("./mine.py")).is_err());
        assert_eq!(with_law(system, Some("qp")).expect("a law").controller.law.name, "qp");
    }
}
