//! The predictive law in a closed loop.

mod ideal;

use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::messages::Waypoint;
use ideal::{Course, Disturbance, RECTANGLE, Run, TRAPEZOID, points_of, polyline};

fn qp(course: &Course) -> Run {
    course.run(course.law("qp", &[]), Disturbance::NONE)
}

/// Spec 4: the offline optimum at the same limits is 1.01, 0.81 and 0.24 mm at 0.3 mm/s.
#[test]
fn the_published_trajectories_within_reach_of_the_offline_optimum() {
    let so = points_of(include_str!("../../../launch/scenarios/so.csv"));
    for (points, bound_mm) in [(&TRAPEZOID[..], 1.3), (&RECTANGLE[..], 1.05), (&so, 0.5)] {
        let run = qp(&Course::epuck(points));
        assert!(run.arrived && run.fallbacks == 0, "{run:?}");
        assert!(run.cross_track_mean_m < bound_mm * 1e-3, "{run:?}");
        assert!(run.speed_error_mean_mps < 0.3e-3, "{run:?}");
    }
}

fn arc(x_m: f64, y_m: f64, bulge: f64) -> Waypoint {
    Waypoint { bulge, ..Waypoint::straight(x_m, y_m) }
}

#[test]
fn arcs_that_go_on_smoothly_are_followed_to_a_fiftieth_of_a_millimetre() {
    // Along x, half a circle of 100 mm to the left, back, half a circle to the right, on.
    let mut course = Course::epuck(&[(0.0, 0.0), (0.3, 0.0)]);
    course.waypoints.extend([
        arc(0.3, 0.2, 1.0),
        Waypoint::straight(0.1, 0.2),
        arc(0.1, 0.4, -1.0),
        Waypoint::straight(0.4, 0.4),
    ]);
    let run = qp(&course);
    assert!(run.arrived && run.fallbacks == 0, "{run:?}");
    assert!(run.cross_track_mean_m < 0.02e-3 && run.speed_error_mean_mps < 0.02e-3, "{run:?}");
}

#[test]
fn mirrored_arcs_are_driven_alike_and_tight_ones_arrive() {
    for (radius, bulge) in [(0.045, 1.8), (0.03, 1.0)] {
        let side = |sign: f64| {
            let mut course = Course::epuck(&[(0.0, 0.0), (0.2, 0.0)]);
            course.waypoints.push(arc(0.2, 2.0 * radius * sign, bulge * sign));
            course.waypoints.push(Waypoint::straight(0.0, 2.0 * radius * sign));
            qp(&course)
        };
        let (left, right) = (side(1.0), side(-1.0));
        assert!(left.arrived && right.arrived, "{left:?} {right:?}");
        assert!((left.cross_track_mean_m - right.cross_track_mean_m).abs() < 0.02e-3, "{left:?} {right:?}");
    }
}

/// Our law and Kanayama's, each with the rule it is made for, under the same disturbance.
fn against_kanayama(course: &Course, disturbance: Disturbance) -> (Run, Run) {
    let ours = course.run(course.law("qp", &[]), disturbance);
    let rim = Course { acceptance: Acceptance::Rim, ..course.clone() };
    (ours, rim.run(rim.law("kanayama", &[]), disturbance))
}

#[test]
fn on_any_polyline_it_arrives_and_leads_with_a_pose_that_jumps() {
    for seed in 0..20 {
        let course = Course::epuck(&polyline(seed, 6));
        // 25 corrections a second, 0.5 mm and 0.2°.
        let (ours, theirs) =
            against_kanayama(&course, Disturbance::jumping(0.5e-3, 0.2_f64.to_radians(), seed));
        assert!(ours.arrived && ours.fallbacks == 0, "seed {seed}: {ours:?}");
        assert!(ours.cross_track_mean_m < theirs.cross_track_mean_m, "seed {seed}: {ours:?} {theirs:?}");
        assert!(ours.speed_error_mean_mps < theirs.speed_error_mean_mps, "seed {seed}: {ours:?} {theirs:?}");
        // It does not answer every jump at full lock.
        assert!(4.0 * ours.yaw_travel_radps < theirs.yaw_travel_radps, "seed {seed}: {ours:?} {theirs:?}");
    }
}

#[test]
fn unequal_wheels_slip_and_a_wrong_start_leave_the_lead_where_it_is() {
    let cases = [
        (Disturbance { slip: [0.01, 0.0], ..Disturbance::NONE }, (0.0, 0.0)),
        (Disturbance { slip: [0.04, 0.05], ..Disturbance::NONE }, (0.0, 0.0)),
        (Disturbance::NONE, (0.02, 0.5)),
        (Disturbance { slip: [0.0, 0.01], ..Disturbance::jumping(0.5e-3, 0.003, 3) }, (-0.02, -0.5)),
    ];
    for (disturbance, (y, heading)) in cases {
        for points in [&TRAPEZOID[..], &RECTANGLE[..]] {
            let mut course = Course::epuck(points);
            course.start.y_m += y;
            course.start.theta_rad += heading;
            let (ours, theirs) = against_kanayama(&course, disturbance);
            assert!(ours.arrived && ours.fallbacks == 0, "{disturbance:?}: {ours:?}");
            assert!(
                ours.cross_track_mean_m < 0.7 * theirs.cross_track_mean_m,
                "{disturbance:?}: {ours:?} {theirs:?}"
            );
        }
    }
}
