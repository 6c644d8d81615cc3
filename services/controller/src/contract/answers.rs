//! Single answers: feed-forward without an error, a number for every input.

use super::*;
use core::f64::consts::PI;
use proptest::prelude::*;

#[test]
fn on_a_line_no_error_gives_the_reference_speed() {
    let ahead = (0..10).map(|n| (f64::from(n), 0.0)).collect::<Vec<_>>();
    for mut case in every_case() {
        // On the waypoint, since some laws count the way to it, and the path going on straight for long.
        let twist = case.answer(WorldPose::new(1.0, 0.0, 0.0), &lines(&ahead));
        assert!((twist.vx_mps - SPEED).abs() < ALIKE, "{}: {twist:?}", case.name());
        assert!(twist.vy_mps.abs() < ALIKE && twist.omega_radps.abs() < ALIKE, "{}: {twist:?}", case.name());
    }
}

#[test]
fn on_an_arc_no_error_gives_the_reference_speed_and_its_yaw_rate() {
    for mut case in every_case() {
        for bulge in [1.0, -1.0] {
            // A full circle of R = 0.5 m in two halves.
            let half = |x_m| Waypoint { x_m, bulge, ..Waypoint::ZERO };
            let circle = reference(&[half(0.0), half(1.0), half(0.0)]);
            let omega = bulge * SPEED / 0.5;
            for degrees in [10.0, 80.0, 170.0] {
                // [LM12] (19); seen from the centre the robot has turned by `angle`.
                let angle = bulge * degrees * PI / 180.0;
                let (sin, cos) = libm::sincos(angle);
                let pose = WorldPose::new(0.5 - 0.5 * cos, -0.5 * sin, angle - bulge * PI / 2.0);
                case.law.reset();
                let twist = case.step(pose, &circle, BodyTwist::new(SPEED, 0.0, omega));
                assert!((twist.vx_mps - SPEED).abs() < ALIKE, "{} {bulge}: {twist:?}", case.name());
                assert!(twist.vy_mps.abs() < ALIKE, "{} {bulge}: {twist:?}", case.name());
                assert!((twist.omega_radps - omega).abs() < ALIKE, "{} {bulge}: {twist:?}", case.name());
            }
        }
    }
}

#[test]
fn a_waypoint_straight_behind_is_turned_to() {
    for mut case in every_case() {
        let twist = case.answer(WorldPose::default(), &lines(&[(0.0, 0.0), (-0.3, 0.0)]));
        let backs = case.chassis.is_omnidirectional() && twist.vx_mps < -0.1 * SPEED;
        assert!(backs || twist.omega_radps.abs() > 0.1, "{}: {twist:?}", case.name());
    }
}

#[test]
fn the_published_equations_by_hand() {
    // [MH18] (5), (7) in the paper's millimetres, worked out apart from the code: pose (0, 10, 0),
    // waypoint (100, 0), segment along x: x_e = 100, y_e = −10, θ_e = 0.
    let mut case = every_case().find(|case| case.spec.name == "kanayama").expect("kanayama");
    let twist = case.answer(WorldPose::new(0.0, 0.010, 0.0), &lines(&[(-0.1, 0.0), (0.1, 0.0)]));
    assert!((twist.vx_mps * 1e3 - (40.0 + 0.0247 * 100.0)).abs() < 1e-9);
    assert!((twist.omega_radps - 40.0 * (2.9671 * -10.0)).abs() < 1e-6);
}

/// Lengths from nothing over the robot's own to astronomical.
fn length() -> impl Strategy<Value = f64> {
    let sizes = vec![0.0, 1e-300, 1e-12, 1e-6, 0.01, 0.1, 1.0, 1e3, 1e6, 1e9, 1e200];
    (proptest::sample::select(sizes), -1.0..1.0f64, any::<bool>())
        .prop_map(|(size, share, round)| if round { size * share.signum() } else { size * share })
}

fn waypoint() -> impl Strategy<Value = Waypoint> {
    let bulges = vec![0.0, 0.0, 1e-9, 0.2, -0.4, 1.0, -1.0, 2.4, -2.4];
    (length(), length(), proptest::sample::select(bulges)).prop_map(|(x_m, y_m, bulge)| Waypoint {
        x_m,
        y_m,
        bulge,
        crab_rad: 0.0,
    })
}

/// Two waypoints and more, now and then one twice.
fn waypoints() -> impl Strategy<Value = Vec<Waypoint>> {
    proptest::collection::vec((waypoint(), 0..4u8), 2..12).prop_map(|drawn| {
        let mut path: Vec<Waypoint> = vec![];
        for (waypoint, twice) in drawn {
            let again = path.last().filter(|_| twice == 0).map(|last| (last.x_m, last.y_m));
            let (x_m, y_m) = again.unwrap_or((waypoint.x_m, waypoint.y_m));
            path.push(Waypoint { x_m, y_m, ..waypoint });
        }
        path
    })
}

fn poses() -> impl Strategy<Value = Vec<WorldPose>> {
    let pose = (length(), length(), -1e3..1e3f64).prop_map(|(x, y, theta)| WorldPose::new(x, y, theta));
    proptest::collection::vec(pose, 1..6)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn every_input_has_a_finite_answer_and_no_chassis_is_asked_for_what_it_cannot(
        waypoints in waypoints(), poses in poses(),
        speed in proptest::sample::select(vec![0.0, 1e-9, 0.02, SPEED, 1.0, 10.0]),
        v in -0.041..0.041f64, omega in -0.747..0.747f64,
    ) {
        let reference = Reference { speed_mps: speed, ..reference(&waypoints) };
        let acting = BodyTwist::new(v, 0.0, omega);
        for mut case in every_case() {
            for pose in &poses {
                let twist = case.step(*pose, &reference, acting);
                prop_assert!(twist.is_finite(), "{}: {:?}", case.name(), twist);
                let sideways = case.chassis.is_omnidirectional() || twist.vy_mps == 0.0;
                prop_assert!(sideways, "{}: {:?}", case.name(), twist);
                if case.spec.keeps_limits {
                    // v_min is of a chassis that can only go ahead or back.
                    let least = if case.chassis.is_omnidirectional() { -LIMITS.v_max_mps } else { LIMITS.v_min_mps };
                    prop_assert!(twist.speed_mps() >= least - 1e-9, "{}: {:?}", case.name(), twist);
                    prop_assert!(twist.speed_mps() <= LIMITS.v_max_mps + 1e-9, "{}: {:?}", case.name(), twist);
                    prop_assert!(twist.omega_radps.abs() <= LIMITS.omega_max_radps + 1e-9, "{}: {:?}", case.name(), twist);
                    prop_assert!(case.chassis.motor_use(twist) <= 1.0 + 1e-9, "{}: {:?}", case.name(), twist);
                }
            }
        }
    }

    #[test]
    fn reset_is_fresh(waypoints in waypoints(), poses in poses(), v in 0.0..0.041f64, omega in -0.7..0.7f64) {
        let (acting, asked) = (BodyTwist::new(v, 0.0, omega), lines(&[(0.0, 0.0), (0.3, 0.0), (0.3, 0.3)]));
        let poses_asked = [WorldPose::new(0.1, 0.01, 0.2), WorldPose::new(0.12, 0.012, 0.1)];
        for mut case in every_case() {
            let fresh = poses_asked.map(|pose| case.step(pose, &asked, ACTING));
            for pose in &poses {
                case.step(*pose, &reference(&waypoints), acting);
            }
            case.law.reset();
            let again = poses_asked.map(|pose| case.step(pose, &asked, ACTING));
            prop_assert_eq!(fresh, again, "{}", case.name());
        }
    }
}
