//! The published runs of paper 2, and what the mended points promise.

use super::*;
use crate::cart::{
    CAMERA, Cart, DEGREE, EXACT, HALF_TRACK_M, X_AXIS, circle, drive, largest_from, sign_changes,
};
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Waypoint};

fn law(values: &[(&'static str, f64)]) -> Box<dyn ControlLaw> {
    crate::cart::law(SPEC.name, values)
}

/// Seeds of the noisy runs.
const SEEDS: core::ops::Range<u64> = 1..21;

#[test]
fn turned_by_21_degrees_it_is_back_within_2_m() {
    for (speed_mps, lag_s) in [(0.5, 0.03), (0.5, 0.06), (1.0, 0.045), (1.5, 0.03), (1.5, 0.06)] {
        let run = |positioning, seed| {
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 21.0 * DEGREE), speed_mps, seed);
            cart.lag_s = lag_s;
            drive(&mut *law(&[]), &mut cart, X_AXIS, speed_mps, positioning)
        };
        let exact = run(EXACT, 1);
        assert!(largest_from(&exact, 0.0) > 0.05, "the disturbance is none");
        assert!(
            largest_from(&exact, 2.0) < 0.002,
            "{speed_mps} m/s, {lag_s} s: {}",
            largest_from(&exact, 2.0)
        );
        assert!(largest_from(&exact, 3.5) < 0.001);
        for seed in SEEDS {
            let noisy = largest_from(&run(CAMERA, seed), 2.0);
            assert!(noisy < 0.010, "{speed_mps} m/s, {lag_s} s, seed {seed}: {noisy}");
        }
    }
}

#[test]
fn the_published_circle_has_one_overshoot_and_is_settled_within_60_degrees() {
    // 60° of R = 1.02 m.
    let way_m = 1.02 * 60.0 * DEGREE;
    for lag_s in [0.03, 0.045, 0.06] {
        let run = |positioning, seed| {
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 90.0 * DEGREE), 0.0, seed);
            cart.lag_s = lag_s;
            drive(&mut *law(&[]), &mut cart, circle(), 1.5, positioning)
        };
        let exact = run(EXACT, 1);
        assert!((exact[0].1 - 0.01).abs() < 1e-3, "it starts 1 cm outside, to the left");
        assert_eq!(sign_changes(&exact, 1e-4), 1, "{lag_s} s");
        assert!(largest_from(&exact, way_m) < 0.001 && largest_from(&exact, 2.5) < 1e-4, "{lag_s} s");
        for seed in SEEDS {
            let noisy = largest_from(&run(CAMERA, seed), way_m);
            assert!(noisy < 0.010, "{lag_s} s, seed {seed}: {noisy}");
        }
    }
}

#[test]
fn the_integral_learns_unequal_wheels() {
    let long = Segment::line(WorldPoint::new(0.0, 0.0), WorldPoint::new(30.0, 0.0));
    let run = |values| {
        let mut cart = Cart::new(WorldPose::default(), 1.0, 1);
        cart.left = 0.98;
        largest_from(&drive(&mut *law(values), &mut cart, long, 1.0, EXACT), 25.0)
    };
    assert!(run(&[("integral_max_rad", 0.0)]) > 0.004);
    assert!(run(&[]) < 1e-4);
}

/// One step at 1 m/s.
fn step(law: &mut dyn ControlLaw, pose: WorldPose, from: (f64, f64), to: (f64, f64)) -> BodyTwist {
    let reference = Reference {
        state: ReferenceState::Tracking.code(),
        speed_mps: 1.0,
        last: Waypoint::straight(from.0, from.1),
        current: Waypoint::straight(to.0, to.1),
        ..Reference::ZERO
    };
    law.step(LawInputs { pose, reference: &reference, acting: BodyTwist::ZERO }).twist
}

#[test]
fn the_wheels_of_the_published_equations() {
    // 12 cm left of the x axis, heading 0.1 rad to the left of it: asin(0.12/0.48) = 0.252680, γ = 0.352680,
    // u = 0.9 · γ m/s: to the right, the left wheel faster by 2u.
    let twist = step(&mut *law(&[]), WorldPose::new(0.0, 0.12, 0.1), (-1.0, 0.0), (5.0, 0.0));
    let (left, right) = (1.0 + 0.317_412, 1.0 - 0.317_412);
    assert!((twist.vx_mps - 0.5 * (left + right)).abs() < 1e-9);
    assert!((twist.omega_radps - (right - left) / 0.4).abs() < 1e-5, "{twist:?}");
    // From outside the circle: straight at the path, and heading there already, no more turning.
    let twist = step(&mut *law(&[]), WorldPose::new(0.0, -3.0, 90.0 * DEGREE), (-1.0, 0.0), (5.0, 0.0));
    assert!(twist.omega_radps.abs() < 1e-9, "{twist:?}");
}

#[test]
fn a_new_segment_does_not_kick_the_derivative() {
    let (mut with, mut without) = (law(&[]), law(&[("derivative_s", 0.0)]));
    for law in [&mut with, &mut without] {
        step(&mut **law, WorldPose::new(0.99, 0.0, 0.0), (0.0, 0.0), (1.0, 0.0));
    }
    // A pure turn of the path by 90°, the robot going straight on: γ jumps, the robot has not turned.
    let corner = |law: &mut dyn ControlLaw| step(law, WorldPose::new(1.0, 0.0, 0.0), (1.0, 0.0), (1.0, 1.0));
    let (a, b) = (corner(&mut *with), corner(&mut *without));
    assert!(b.omega_radps > 5.0);
    // What is left: on the new line the centimetre driven is one of H, seen through the filter.
    let moved = 0.9 / HALF_TRACK_M * 0.05 * (0.01 / 0.48 / 0.01) * (10.0 / 60.0);
    assert!((a.omega_radps - b.omega_radps - moved).abs() < 1e-3, "{a:?} {b:?}");
}

#[test]
fn nothing_winds_up_while_it_cannot_help() {
    let fresh = step(&mut *law(&[]), WorldPose::default(), (-1.0, 0.0), (5.0, 0.0));
    // Held far outside the circle, then turned away, and a little wrong for very long.
    for (pose, most) in [
        (WorldPose::new(0.0, 3.0, -90.0 * DEGREE), 0.0),
        (WorldPose::new(0.0, 0.0, 2.0), 0.0),
        (WorldPose::new(0.0, 0.0, 0.05), 0.1),
    ] {
        let mut law = law(&[("derivative_s", 0.0)]);
        for _ in 0..10_000 {
            step(&mut *law, pose, (-1.0, 0.0), (5.0, 0.0));
        }
        let after = step(&mut *law, WorldPose::default(), (-1.0, 0.0), (5.0, 0.0));
        let learnt = (after.omega_radps - fresh.omega_radps).abs() / (0.9 / HALF_TRACK_M);
        assert!((learnt - most).abs() < 1e-9, "{pose:?}: {learnt}");
    }
}
