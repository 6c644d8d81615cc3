//! What every law of the registry must do.

use super::*;
use hilare_interfaces::chassis::{DifferentialParams, MecanumParams};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::Waypoint;
use proptest::prelude::*;

fn chassis(name: &str) -> Chassis {
    match name {
        "mecanum" => Chassis::Mecanum(MecanumParams::default()),
        _ => Chassis::Differential(DifferentialParams::default()),
    }
}

/// Every law on every chassis it allows.
fn every_law() -> impl Iterator<Item = (&'static str, Box<dyn ControlLaw>)> {
    LAWS.iter().flat_map(|spec| {
        spec.chassis.iter().map(|name| {
            let setup = LawSetup {
                chassis: &chassis(name),
                limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 0.041, omega_max_radps: 0.747 },
                acceptance_radius_m: 0.027,
                acceptance: Acceptance::Rim,
                period_ticks: 5,
                values: &[],
            };
            (spec.name, (spec.build)(&setup).expect("defaults build"))
        })
    })
}

/// What acts while a law thinks: v_r, straight on.
const ACTING: BodyTwist = BodyTwist::new(0.04, 0.0, 0.0);
/// How alike answers must be that differ by rounding only, m/s and rad/s. A predictive law iterates
/// until its optimum is this well known, and no further.
const ALIKE: f64 = 1e-6;

fn reference(last: (f64, f64), current: (f64, f64)) -> Reference {
    Reference {
        state: ReferenceState::Tracking.code(),
        path_id: 1,
        index: 1,
        total: 2,
        speed_mps: 0.04,
        last: Waypoint::straight(last.0, last.1),
        current: Waypoint::straight(current.0, current.1),
        ..Reference::ZERO
    }
}

fn turned(point: (f64, f64), angle: f64) -> (f64, f64) {
    let (sin, cos) = libm::sincos(angle);
    (cos * point.0 - sin * point.1, sin * point.0 + cos * point.1)
}

fn answer(law: &mut dyn ControlLaw, pose: WorldPose, last: (f64, f64), current: (f64, f64)) -> BodyTwist {
    law.reset();
    law.step(LawInputs { pose, reference: &reference(last, current), acting: ACTING }).twist
}

#[test]
fn zero_error_gives_feed_forward() {
    for (name, mut law) in every_law() {
        // On the waypoint, heading along the segment, the path going on straight for long: no error
        // left and none to come, only v_r.
        let mut reference = reference((0.0, 0.0), (1.0, 0.0));
        reference.preview_len = 8;
        for (n, waypoint) in reference.preview.iter_mut().enumerate() {
            waypoint.x_m = 2.0 + n as f64;
        }
        let pose = WorldPose::new(1.0, 0.0, 0.0);
        let twist = law.step(LawInputs { pose, reference: &reference, acting: ACTING }).twist;
        assert!((twist.vx_mps - 0.04).abs() < ALIKE, "{name}: {twist:?}");
        assert!(twist.vy_mps.abs() < ALIKE && twist.omega_radps.abs() < ALIKE, "{name}: {twist:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_mirrored_world_gives_mirrored_commands(
        x in -0.5..0.5f64, y in -0.2..0.2f64, th in -1.5..1.5f64, cx in 0.1..1.0f64, cy in -0.5..0.5f64,
    ) {
        for (name, mut law) in every_law() {
            let a = answer(&mut *law, WorldPose::new(x, y, th), (0.0, 0.0), (cx, cy));
            let b = answer(&mut *law, WorldPose::new(x, -y, -th), (0.0, 0.0), (cx, -cy));
            prop_assert!((a.vx_mps - b.vx_mps).abs() < ALIKE, "{}", name);
            prop_assert!((a.vy_mps + b.vy_mps).abs() < ALIKE, "{}", name);
            prop_assert!((a.omega_radps + b.omega_radps).abs() < ALIKE * a.omega_radps.abs().max(1.0), "{}", name);
        }
    }

    #[test]
    fn a_turned_world_gives_the_same_commands(
        x in -0.5..0.5f64, y in -0.2..0.2f64, th in -1.5..1.5f64, cx in 0.1..1.0f64, turn in -3.0..3.0f64,
    ) {
        for (name, mut law) in every_law() {
            let a = answer(&mut *law, WorldPose::new(x, y, th), (0.0, 0.0), (cx, 0.0));
            let (tx, ty) = turned((x, y), turn);
            let b = answer(&mut *law, WorldPose::new(tx, ty, th + turn), (0.0, 0.0), turned((cx, 0.0), turn));
            prop_assert!((a.vx_mps - b.vx_mps).abs() < ALIKE, "{}", name);
            prop_assert!((a.omega_radps - b.omega_radps).abs() < ALIKE * a.omega_radps.abs().max(1.0), "{}", name);
        }
    }

    #[test]
    fn finite_inputs_give_finite_commands_and_reset_is_fresh(
        poses in proptest::collection::vec((-1e3..1e3f64, -1e3..1e3f64, -1e3..1e3f64), 1..20),
    ) {
        for (name, mut law) in every_law() {
            let fresh = answer(&mut *law, WorldPose::new(0.1, 0.01, 0.2), (0.0, 0.0), (1.0, 0.0));
            for (x, y, th) in &poses {
                let inputs = LawInputs { pose: WorldPose::new(*x, *y, *th), reference: &reference((0.0, 0.0), (1.0, 0.0)), acting: ACTING };
                prop_assert!(law.step(inputs).twist.is_finite(), "{}", name);
            }
            let again = answer(&mut *law, WorldPose::new(0.1, 0.01, 0.2), (0.0, 0.0), (1.0, 0.0));
            prop_assert_eq!(fresh, again, "{}", name);
        }
    }
}

#[test]
fn commands_are_stamped_and_stand_still_without_a_path() {
    let (_, law) = every_law().next().expect("a law");
    let mut controller = Controller::new(law, Identity { source: 2, epoch: 9 }, 5);
    let pose = Pose::at(20, WorldPose::new(0.0, 0.0, 0.0));
    let idle = controller.step(20, ControllerInputs { reference: &Reference::ZERO, pose: &pose });
    assert_eq!((idle.source, idle.epoch, idle.seq, idle.pose_tick, idle.effective_tick), (2, 9, 1, 20, 25));
    assert_eq!(idle.twist(), Some(BodyTwist::ZERO));
    let reference = reference((0.0, 0.0), (1.0, 0.0));
    let moving = controller.step(25, ControllerInputs { reference: &reference, pose: &pose });
    assert!(moving.vx_mps > 0.03 && moving.seq == 2);
}

#[test]
fn the_published_equations_by_hand() {
    // [MH18] (5), (7) in the paper's millimetres, worked out apart from the code: pose (0, 10, 0),
    // waypoint (100, 0), segment along x: x_e = 100, y_e = −10, θ_e = 0.
    let (_, mut law) = every_law().next().expect("kanayama");
    let twist = answer(&mut *law, WorldPose::new(0.0, 0.010, 0.0), (-0.1, 0.0), (0.1, 0.0));
    assert!((twist.vx_mps * 1e3 - (40.0 + 0.0247 * 100.0)).abs() < 1e-9);
    assert!((twist.omega_radps - 40.0 * (2.9671 * -10.0)).abs() < 1e-6);
}

#[test]
fn a_waypoint_straight_behind_is_turned_to() {
    for (name, mut law) in every_law() {
        let twist = answer(&mut *law, WorldPose::new(0.0, 0.0, 0.0), (0.0, 0.0), (-0.3, 0.0));
        assert!(twist.omega_radps.abs() > 0.1, "{name}: {twist:?}");
    }
}
