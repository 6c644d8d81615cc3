//! What the contract suite does not ask: the paper's equation, its rate of convergence, a larger robot.

use super::*;
use crate::cart::{CAMERA, Cart, DEGREE, EXACT, HALF_TRACK_M, X_AXIS, circle, drive, largest_from, law};
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Waypoint};

/// b of the cart with the default of 0.6 tracks, m.
const WHEELBASE_M: f64 = 0.6 * 2.0 * HALF_TRACK_M;

/// One step along the x axis at 1 m/s.
fn step(law: &mut dyn ControlLaw, pose: WorldPose) -> BodyTwist {
    let reference = Reference {
        state: ReferenceState::Tracking.code(),
        speed_mps: 1.0,
        last: Waypoint::straight(-1.0, 0.0),
        current: Waypoint::straight(50.0, 0.0),
        ..Reference::ZERO
    };
    law.step(LawInputs { pose, reference: &reference, acting: BodyTwist::ZERO }).twist
}

#[test]
fn the_published_equation_by_hand() {
    // Midpoint 4 cm right of the path, heading 0.1 rad to the left: the front wheel, 0.24 m ahead, is at
    // y = −0.04 + 0.24 sin 0.1 = −0.016040, so e = 0.016040 to the left; k e/(k_s + v) = 0.031762;
    // δ = −0.1 + 0.031752 = −0.068248; ω = tan δ / 0.24 = −0.284813.
    let twist = step(&mut *law("stanley", &[]), WorldPose::new(0.0, -0.04, 0.1));
    assert!((twist.omega_radps + 0.284_813).abs() < 1e-5 && twist.vx_mps == 1.0, "{twist:?}");
}

#[test]
fn the_front_wheel_comes_in_at_the_published_rate() {
    // Hoffmann et al.: near the path e falls as exp(−k t); with k_s and v = 1 m/s, k = 2/1.01 a second.
    let mut law = law("stanley", &[]);
    let mut pose = WorldPose::new(0.0, 0.005, 0.0);
    let front = |pose: WorldPose| pose.y_m + WHEELBASE_M * libm::sin(pose.theta_rad);
    // A fine Euler integration; past the first fifth of a second the front wheel points along its course.
    let mut at = [0.0; 2];
    for n in 0..12_000 {
        if n == 2_000 {
            at[0] = front(pose);
        }
        let twist = step(&mut *law, pose);
        let (sin, cos) = libm::sincos(pose.theta_rad);
        pose = WorldPose::new(
            pose.x_m + 1e-4 * cos,
            pose.y_m + 1e-4 * sin,
            pose.theta_rad + 1e-4 * twist.omega_radps,
        );
        at[1] = front(pose);
    }
    let rate = -libm::log(at[1] / at[0]);
    assert!((rate - 2.0 / 1.01).abs() < 0.02, "{rate}");
}

#[test]
fn facing_the_wrong_way_it_turns_the_short_way_whatever_the_offset() {
    for degrees in [100.0, 130.0, 170.0] {
        for y in [-0.5, 0.5] {
            let mut law = law("stanley", &[]);
            assert!(
                step(&mut *law, WorldPose::new(0.0, y, degrees * DEGREE)).omega_radps < -1.0,
                "{degrees} {y}"
            );
            assert!(
                step(&mut *law, WorldPose::new(0.0, y, -degrees * DEGREE)).omega_radps > 1.0,
                "{degrees} {y}"
            );
        }
    }
}

#[test]
fn the_defaults_drive_a_cart_at_1_5_m_s_as_well() {
    for (positioning, band) in [(EXACT, 0.005), (CAMERA, 0.010)] {
        for seed in 1..11 {
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 21.0 * DEGREE), 1.5, seed);
            let line = drive(&mut *law("stanley", &[]), &mut cart, X_AXIS, 1.5, positioning);
            assert!(largest_from(&line, 3.0) < band, "seed {seed}: {}", largest_from(&line, 3.0));
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 90.0 * DEGREE), 0.0, seed);
            let arc = drive(&mut *law("stanley", &[]), &mut cart, circle(), 1.5, positioning);
            assert!(largest_from(&arc, 1.07) < band, "seed {seed}: {}", largest_from(&arc, 1.07));
        }
    }
}
