//! The predictive law on an ideal Mecanum drive.

mod ideal;

use hilare_controller::{ControlLaw, LawInputs, LawOutput};
use hilare_interfaces::geometry::{BodyTwist, wrap_angle_rad};
use hilare_interfaces::messages::Waypoint;
use ideal::{Course, Disturbance, PERIOD_S, Run};
use std::f64::consts::FRAC_PI_2;

fn to(x_m: f64, y_m: f64, bulge: f64, crab_rad: f64) -> Waypoint {
    Waypoint { x_m, y_m, bulge, crab_rad }
}

const ORIGIN: Waypoint = Waypoint::straight(0.0, 0.0);

/// Runs the law; every command must be inside the limits, and no farther from the one before than the
/// accelerations allow.
fn qp(course: &Course) -> Run {
    let mut before = BodyTwist::ZERO;
    let run = course.run_watched(course.law("qp", &[]), Disturbance::NONE, |reference, _, twist| {
        let change = libm::hypot(twist.vx_mps - before.vx_mps, twist.vy_mps - before.vy_mps);
        assert!(change <= 2.0 * PERIOD_S + 1e-9, "{before:?} {twist:?} at {}", reference.index);
        assert!((twist.omega_radps - before.omega_radps).abs() <= 40.0 * PERIOD_S + 1e-9);
        assert!(twist.omega_radps.abs() <= course.limits.omega_max_radps + 1e-9);
        before = twist;
    });
    assert!(run.arrived && run.fallbacks == 0, "{run:?}");
    assert!(run.motor_use_max <= 1.0 + 1e-9 && run.speed_use_max <= 1.0 + 1e-9, "{run:?}");
    run
}

#[test]
fn a_line_and_arcs_of_both_senses_are_kept_to_a_hundredth_of_a_millimetre() {
    for side in [1.0, -1.0] {
        let waypoints = [ORIGIN, to(0.6, 0.0, 0.0, 0.0), to(0.6, side, side, 0.0), to(0.2, side, 0.0, 0.0)];
        let run = qp(&Course::mecanum(&waypoints));
        assert!(run.cross_track_max_m < 0.01e-3 && run.heading_error_mean_rad < 0.001, "{run:?}");
        // Speeding up to 0.3 m/s at √2 m/s² an axis is a mean of 5 mm/s over these seven seconds.
        assert!(run.speed_error_mean_mps < 6e-3, "{run:?}");
    }
}

#[test]
fn corners_are_turned_on_the_spot_of_the_path_and_alike_on_both_sides() {
    for turn in [40.0_f64, 90.0, 150.0] {
        let (sin, cos) = libm::sincos(turn.to_radians());
        let corner = |side: f64| {
            qp(&Course::mecanum(&[
                ORIGIN,
                to(0.8, 0.0, 0.0, 0.0),
                to(0.8 + 0.8 * cos, side * 0.8 * sin, 0.0, 0.0),
            ]))
        };
        let (left, right) = (corner(1.0), corner(-1.0));
        assert!(left.cross_track_mean_m < 0.3e-3 && left.cross_track_max_m < 10e-3, "{turn}: {left:?}");
        assert!((left.cross_track_mean_m - right.cross_track_mean_m).abs() < 0.01e-3, "{left:?} {right:?}");
        assert!((left.end.y_m + right.end.y_m).abs() < 1e-4, "{left:?} {right:?}");
    }
}

#[test]
fn a_crab_angle_is_driven_sideways_without_turning() {
    // Ahead, then to the left and back to the right with the nose where it was.
    for crab in [FRAC_PI_2, -FRAC_PI_2] {
        let y = 0.5_f64.copysign(crab);
        let course =
            Course::mecanum(&[ORIGIN, to(0.5, 0.0, 0.0, 0.0), to(0.5, y, 0.0, crab), to(1.0, y, 0.0, 0.0)]);
        let mut turned: f64 = 0.0;
        course.run_watched(course.law("qp", &[]), Disturbance::NONE, |_, pose, _| {
            turned = turned.max(pose.theta_rad.abs());
        });
        assert!(turned < 1e-6, "{turned}");
        // Two corners in 1.5 m, each as above.
        assert!(qp(&course).cross_track_mean_m < 0.45e-3);
    }
}

/// Lines, arcs, corners and crab angles in one.
fn mixed() -> Vec<Waypoint> {
    vec![
        ORIGIN,
        to(0.8, 0.0, 0.0, 0.0),
        to(0.8, 0.8, 1.0, 0.0),
        to(0.2, 0.8, 0.0, 0.4),
        to(0.2, 1.4, 0.0, FRAC_PI_2),
        to(1.0, 1.4, -0.5, 0.0),
        to(0.6, 0.7, 0.0, -FRAC_PI_2),
    ]
}

#[test]
fn a_course_of_them_is_driven_better_than_by_feedback_alone() {
    let course = Course::mecanum(&mixed());
    let (ours, simple) =
        (qp(&course), course.run(Box::new(Proportional { course: course.clone() }), Disturbance::NONE));
    assert!(simple.arrived && ours.cross_track_mean_m < 0.5e-3, "{ours:?}");
    assert!(3.0 * ours.cross_track_mean_m < simple.cross_track_mean_m, "{ours:?} {simple:?}");
    assert!(ours.heading_error_mean_rad < simple.heading_error_mean_rad, "{ours:?} {simple:?}");
}

#[test]
fn where_the_wheels_cannot_do_it_all_it_slows_down() {
    // Straight on 0.7 m/s is 70 % of the wheels; turning with the arc at 1.4 rad/s takes another 49 %.
    let mut course =
        Course::mecanum(&[ORIGIN, to(1.0, 0.0, 0.0, 0.0), to(1.0, 1.0, 1.0, 0.0), to(0.0, 1.0, 0.0, 0.0)]);
    (course.speed_mps, course.limits.v_max_mps, course.limits.omega_max_radps) = (0.7, 1.0, 3.0);
    let run = qp(&course);
    assert!(run.motor_use_max > 0.999, "{run:?}");
    assert!(run.cross_track_mean_m < 1e-3 && run.heading_error_mean_rad < 0.05, "{run:?}");
}

#[test]
fn a_wrong_start_pose_is_recovered_from_and_a_missed_waypoint_returned_to() {
    for (y, heading) in [(0.3, 2.0), (-0.2, -3.0), (0.1, 3.1), (0.0, -1.5)] {
        let mut course = Course::mecanum(&[ORIGIN, to(1.5, 0.0, 0.0, 0.0)]);
        (course.start.y_m, course.start.theta_rad) = (y, heading);
        let run = qp(&course);
        assert!(run.end.y_m.abs() < 1e-3 && wrap_angle_rad(run.end.theta_rad).abs() < 0.02, "{run:?}");
    }
    // Behind the first waypoint and beside it.
    let mut course = Course::mecanum(&[ORIGIN, to(0.5, 0.0, 0.0, 0.0), to(0.5, 1.0, 0.0, 0.0)]);
    (course.start.x_m, course.start.y_m) = (0.65, -0.1);
    qp(&course);
}

#[test]
fn a_pose_that_jumps_is_ridden_out() {
    let course = Course::mecanum(&mixed());
    for seed in 1..4 {
        let run = course.run(course.law("qp", &[]), Disturbance::jumping(0.5e-3, 0.2_f64.to_radians(), seed));
        assert!(run.arrived && run.fallbacks == 0, "{run:?}");
        assert!(run.cross_track_mean_m < 1e-3, "{run:?}");
    }
}

/// The yardstick: along the path at v_r, across it and in heading by feedback, nothing foreseen.
struct Proportional {
    course: Course,
}

impl ControlLaw for Proportional {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let station = inputs.reference.segment().nearest(inputs.pose.position());
        let heading = wrap_angle_rad(station.heading_rad - inputs.pose.theta_rad);
        let v = inputs.reference.speed_mps;
        let along = BodyTwist::new(v, -4.0 * station.cross_track_m, 0.0).turned(heading);
        let omega = 4.0 * heading + v * inputs.reference.segment().curvature_per_m();
        LawOutput::sound(self.course.constrain(BodyTwist::new(along.vx_mps, along.vy_mps, omega)))
    }

    fn reset(&mut self) {}
}
