//! What the contract suite does not ask: the paper's equation, where the goal is, a larger robot.

use super::*;
use crate::cart::{CAMERA, Cart, DEGREE, EXACT, X_AXIS, circle, drive, largest_from, law};
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{ReferenceState, Waypoint};
use proptest::prelude::*;

/// A lookahead of 0.1 m at 0.1 m/s, no matter what else.
const LAW: PurePursuit = PurePursuit {
    params: PurePursuitParams { lookahead_s: 1.0, lookahead_bends: 0.0 },
    limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 0.2, omega_max_radps: 1.0 },
    acceptance_m: 0.03,
};

fn reference(waypoints: &[Waypoint]) -> Reference {
    let mut reference = Reference {
        state: ReferenceState::Tracking.code(),
        speed_mps: 0.1,
        last: waypoints[0],
        current: waypoints[1],
        preview_len: waypoints.len() as u64 - 2,
        ..Reference::ZERO
    };
    reference.preview[..waypoints.len() - 2].copy_from_slice(&waypoints[2..]);
    reference
}

fn lines(points: &[(f64, f64)]) -> Reference {
    reference(&points.iter().map(|(x, y)| Waypoint::straight(*x, *y)).collect::<Vec<_>>())
}

fn aim(reference: &Reference, x: f64, y: f64) -> (f64, f64) {
    let point = LAW.aim(reference, WorldPose::new(x, y, 0.0));
    (point.x_m, point.y_m)
}

fn near(a: (f64, f64), b: (f64, f64)) -> bool {
    libm::hypot(a.0 - b.0, a.1 - b.1) < 1e-9
}

#[test]
fn the_published_equation_by_hand() {
    // 6 cm left of the x axis, 10 cm of lookahead: the goal is 8 cm ahead and 6 cm to the right,
    // κ = 2 · (−0.06)/0.01 = −12 /m. That is 1.2 rad/s at 0.1 m/s and more than there is: ω_max, and slower.
    let (mut law, line) = (LAW, lines(&[(0.0, 0.0), (5.0, 0.0)]));
    let mut step = |y| {
        let pose = WorldPose::new(1.0, y, 0.0);
        law.step(LawInputs { pose, reference: &line, acting: BodyTwist::ZERO }).twist
    };
    let twist = step(0.06);
    assert!((twist.omega_radps + 1.0).abs() < 1e-9 && (twist.vx_mps - 1.0 / 12.0).abs() < 1e-9, "{twist:?}");
    let twist = step(0.028);
    assert!((twist.omega_radps + 0.56).abs() < 1e-9 && (twist.vx_mps - 0.1).abs() < 1e-9, "{twist:?}");
}

#[test]
fn the_goal_runs_along_the_path_and_on_as_it_ends() {
    let bent = lines(&[(0.0, 0.0), (1.0, 0.0), (1.5, 0.5)]);
    assert!(near(aim(&bent, 0.3, 0.0), (0.4, 0.0)));
    // Round the corner: on the second line, 0.1 m away from (0.95, 0).
    let (x, y) = aim(&bent, 0.95, 0.0);
    assert!(
        (libm::hypot(x - 0.95, y) - 0.1).abs() < 1e-9 && (x - 1.0 - y).abs() < 1e-9 && y > 0.0,
        "{x} {y}"
    );
    let end = lines(&[(0.0, 0.0), (1.0, 0.0)]);
    assert!(near(aim(&end, 0.97, 0.0), (1.07, 0.0)));
    // Half a circle of R = 0.5 m that ends in (0, 1): it goes on round.
    let arc = reference(&[Waypoint::ZERO, Waypoint { bulge: 1.0, ..Waypoint::straight(0.0, 1.0) }]);
    let (x, y) = aim(&arc, 0.0, 1.0);
    assert!((libm::hypot(x, y - 0.5) - 0.5).abs() < 1e-9 && (libm::hypot(x, y - 1.0) - 0.1).abs() < 1e-9);
    assert!(x < 0.0);
}

#[test]
fn from_afar_the_path_is_approached_at_45_degrees() {
    let line = lines(&[(0.0, 0.0), (5.0, 0.0)]);
    assert!(near(aim(&line, 1.0, 0.8), (1.8, 0.0)));
    assert!(near(aim(&line, 1.0, -2.0), (3.0, 0.0)));
    // Far inside a small circle, and beyond the end of it, there is a goal as well.
    let arc = reference(&[Waypoint::ZERO, Waypoint { bulge: 1.0, ..Waypoint::straight(0.0, 0.02) }]);
    for (x, y) in [(0.0, 0.01), (0.01, 0.01), (3.0, -2.0)] {
        let (gx, gy) = aim(&arc, x, y);
        assert!(libm::hypot(gx - x, gy - y) > 0.05, "{gx} {gy}");
    }
}

#[test]
fn where_the_path_turns_back_the_goal_waits_at_the_waypoint() {
    // By 90° and by 124°: 0.7 · 30 mm behind the waypoint, until that is accepted.
    assert!(near(aim(&lines(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]), 0.98, 0.0), (1.0, 0.021)));
    let (x, y) = aim(&lines(&[(0.0, 0.0), (0.6, 0.0), (0.4, 0.3)]), 0.58, 0.0);
    assert!((libm::hypot(x - 0.6, y) - 0.021).abs() < 1e-9 && y > 0.0);
}

#[test]
fn the_goal_does_not_run_ahead_onto_another_course() {
    let mut path = [(0.0, 0.0), (1.0, 0.0), (1.5, 0.5)].map(|(x, y)| Waypoint::straight(x, y));
    path[2].crab_rad = 45.0 * DEGREE;
    assert!(near(aim(&reference(&path), 0.95, 0.0), (1.05, 0.0)));
}

proptest! {
    /// Against a walk along the path in small strides.
    #[test]
    fn the_goal_is_where_the_path_first_leaves_the_circle(
        bulge in -1.5..1.5f64, next in -1.5..1.5f64, turn in -1.0..1.0f64,
        along in 0.0..1.0f64, off in -0.06..0.06f64,
    ) {
        let (sin, cos) = libm::sincos(turn);
        let path = reference(&[
            Waypoint::ZERO,
            Waypoint { bulge, ..Waypoint::straight(0.3, 0.0) },
            Waypoint { bulge: next, ..Waypoint::straight(0.3 + 0.4 * cos, 0.4 * sin) },
        ]);
        let on = path.segment().nearest(path.segment().point_at(along));
        let (sin, cos) = libm::sincos(on.heading_rad);
        let robot = WorldPoint::new(on.point.x_m - off * sin, on.point.y_m + off * cos);
        let radius = LAW.lookahead_m(path.speed_mps);
        let goal = goal(&path, (0, along), robot, radius).point;
        prop_assert!((goal.distance_m(robot) - radius).abs() < 1e-9);
        let second = path.preview[0].segment_from(path.current);
        let walk = (0..20_000).map(|n| along + f64::from(n) * 1e-4);
        let points = walk.map(|s| if s < 1.0 { path.segment().point_at(s) } else { second.point_at(s - 1.0) });
        let walked = points.take(((2.0 - along) * 1e4) as usize).find(|point| point.distance_m(robot) >= radius);
        if let Some(walked) = walked {
            // A stride is 0.1 mm at most, and nearly tangential to the circle it leaves it slowly.
            prop_assert!(walked.distance_m(goal) < 0.005, "{:?} {:?}", walked, goal);
        }
    }
}

#[test]
fn the_defaults_drive_a_cart_at_1_5_m_s_as_well() {
    for (positioning, band) in [(EXACT, 0.005), (CAMERA, 0.010)] {
        for seed in 1..11 {
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 21.0 * DEGREE), 1.5, seed);
            let line = drive(&mut *law("pure-pursuit", &[]), &mut cart, X_AXIS, 1.5, positioning);
            assert!(largest_from(&line, 2.0) < band, "seed {seed}: {}", largest_from(&line, 2.0));
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 90.0 * DEGREE), 0.0, seed);
            let arc = drive(&mut *law("pure-pursuit", &[]), &mut cart, circle(), 1.5, positioning);
            assert!(largest_from(&arc, 1.07) < band, "seed {seed}: {}", largest_from(&arc, 1.07));
        }
    }
}
