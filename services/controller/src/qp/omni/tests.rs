//! What holds for every input, and what the solver is asked for.

use super::*;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Waypoint};
use proptest::prelude::*;

const ROBOT: MecanumParams = MecanumParams {
    half_wheelbase_m: 0.2,
    half_track_m: 0.15,
    wheel_radius_m: 0.05,
    wheel_speed_max_radps: 20.0,
};

fn omni(limits: TwistLimits, params: QpParams) -> Omni {
    let setup = LawSetup {
        chassis: &Chassis::Mecanum(ROBOT),
        limits,
        acceptance_radius_m: 0.05,
        acceptance: Acceptance::Bisector,
        period_ticks: 5,
        values: &[],
    };
    Omni::new(&setup, ROBOT, params)
}

fn reference(speed_mps: f64, waypoints: &[(f64, f64, f64, f64)]) -> Reference {
    let waypoint = |(x_m, y_m, bulge, crab_rad)| Waypoint { x_m, y_m, bulge, crab_rad };
    let mut reference = Reference {
        state: ReferenceState::Tracking.code(),
        path_id: 1,
        index: 1,
        total: waypoints.len() as u64,
        speed_mps,
        last: waypoint(waypoints[0]),
        current: waypoint(waypoints[1]),
        preview_len: waypoints.len() as u64 - 2,
        ..Reference::ZERO
    };
    for (to, from) in reference.preview.iter_mut().zip(&waypoints[2..]) {
        *to = waypoint(*from);
    }
    reference
}

/// Speed, wheels and the change from what acted, in the body's frame or any turned from it.
fn check(twist: BodyTwist, acting: BodyTwist, crab: f64, limits: &TwistLimits) -> Result<(), TestCaseError> {
    let body = twist.turned(crab);
    let chassis = Chassis::Mecanum(ROBOT);
    prop_assert!(chassis.motor_use(body) <= 1.0 + 1e-9, "{:?}", body);
    prop_assert!(libm::hypot(body.vx_mps, body.vy_mps) <= limits.v_max_mps + 1e-9, "{:?}", body);
    prop_assert!(body.omega_radps.abs() <= limits.omega_max_radps + 1e-9, "{:?}", body);
    let change = libm::hypot(twist.vx_mps - acting.vx_mps, twist.vy_mps - acting.vy_mps);
    prop_assert!(change <= 2.0 * 0.005 + 1e-9, "{acting:?} {twist:?}");
    prop_assert!(
        (twist.omega_radps - acting.omega_radps).abs() <= 40.0 * 0.005 + 1e-9,
        "{acting:?} {twist:?}"
    );
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Any pose, any path, any number of iterations: inside every limit and within reach of what acts.
    #[test]
    fn every_limit_holds_for_every_input(
        v_max in 0.05..1.5f64, omega_max in 0.2..3.5f64, speed in 0.02..1.0f64, cap in 1..20u64,
        poses in proptest::collection::vec((-0.5..0.5f64, -0.5..0.5f64, -4.0..4.0f64), 1..6),
        points in proptest::collection::vec((-0.5..0.5f64, -0.5..0.5f64, -1.5..1.5f64, -3.0..3.0f64), 2..20),
    ) {
        let limits = TwistLimits { v_min_mps: 0.0, v_max_mps: v_max, omega_max_radps: omega_max };
        let mut law = omni(limits, QpParams { max_iterations: cap, ..QpParams::default() });
        let reference = reference(speed, &points);
        let crab = reference.current.crab_rad;
        let mut acting = BodyTwist::ZERO;
        for (x, y, theta) in poses {
            for _ in 0..30 {
                let output = law.step(LawInputs { pose: WorldPose::new(x, y, theta), reference: &reference, acting });
                prop_assert!(u64::from(law.iterations()) <= cap);
                check(output.twist, acting, crab, &limits)?;
                acting = output.twist;
            }
        }
    }
}

#[test]
fn the_cap_and_a_missing_solver_are_told_apart() {
    let limits = TwistLimits { v_min_mps: 0.0, v_max_mps: 0.5, omega_max_radps: 1.5 };
    let corner = reference(0.3, &[(0.0, 0.0, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0), (0.1, 1.0, 0.0, 0.0)]);
    let inputs =
        LawInputs { pose: WorldPose::new(0.0, 0.05, 0.3), reference: &corner, acting: BodyTwist::ZERO };
    let mut capped = omni(limits, QpParams { max_iterations: 2, ..QpParams::default() });
    assert_eq!(capped.step(inputs).fallback, Fallback::IterationCap);
    let mut law = omni(limits, QpParams::default());
    assert_eq!(law.step(inputs).fallback, Fallback::None);
    // Without a solver it goes on with what was planned for this period.
    law.programme = None;
    let output = law.step(inputs);
    assert_eq!(output.fallback, Fallback::Unsolved);
    assert!(output.twist.vx_mps > 0.0, "{output:?}");
    let still = Reference { speed_mps: 0.0, ..corner };
    let output = law.step(LawInputs { reference: &still, ..inputs });
    assert_eq!((output.twist, output.fallback), (BodyTwist::ZERO, Fallback::NoMotion));
}

#[test]
fn the_end_of_the_plan_is_on_the_path_and_aligned_where_that_can_be() {
    // [Qian18] (19): e_d(N) = e_θ(N) = 0, here from 20 mm and 0.3 rad; and for 2 m as near as can be.
    let limits = TwistLimits { v_min_mps: 0.0, v_max_mps: 0.5, omega_max_radps: 1.5 };
    let line = reference(0.3, &[(0.0, 0.0, 0.0, 0.0), (9.0, 0.0, 0.0, 0.0)]);
    let slacks = |y: f64, theta: f64| {
        let mut law = omni(limits, QpParams::default());
        let acting = BodyTwist::new(0.3, 0.0, 0.0);
        let output = law.step(LawInputs { pose: WorldPose::new(0.5, y, theta), reference: &line, acting });
        assert_eq!(output.fallback, Fallback::None);
        let x = law.numbers().expect("a solver").solution.to_vec();
        (x[x.len() - 2], x[x.len() - 1], output.twist)
    };
    let (off, heading, _) = slacks(0.02, 0.3);
    assert!(off.abs() < 1e-6 && heading.abs() < 1e-6, "{off} {heading}");
    let (off, _, twist) = slacks(2.0, 0.0);
    assert!(off > 1.0 && twist.vy_mps < -0.005, "{off} {twist:?}");
}

#[test]
fn the_grid_begins_with_a_period_and_reaches_the_horizon() {
    for first in [0.001, 0.0075, 0.1] {
        let grid = Grid::new(first, HORIZON);
        assert!(grid.time[0] == first && (grid.at[STAGES] - HORIZON).abs() < 1e-9);
        assert!(grid.time.windows(2).all(|pair| pair[1] >= pair[0]));
        // A steady motion looks the same one stage later.
        let moved = grid.advance(&grid.at);
        assert!(moved.iter().zip(&grid.at).all(|(a, b)| (a - b).abs() < 1e-12), "{moved:?}");
    }
}
