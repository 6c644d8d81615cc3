//! What the contract suite (`../tests.rs`) does not ask: the model, the solver, the promises.

use super::*;
use crate::law;
use hilare_interfaces::chassis::DifferentialParams;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Waypoint};
use proptest::prelude::*;
use rollout::STAGES;

const LIMITS: TwistLimits = TwistLimits { v_min_mps: 0.0, v_max_mps: 0.041, omega_max_radps: 0.747 };

fn qp(limits: TwistLimits, bisector: bool, params: QpParams) -> Qp {
    let chassis = Chassis::Differential(DifferentialParams::default());
    let setup = LawSetup {
        chassis: &chassis,
        limits,
        acceptance_radius_m: 0.027,
        acceptance: if bisector { Acceptance::Bisector } else { Acceptance::Rim },
        period_ticks: 5,
        values: &[],
    };
    Qp::new(&setup, params)
}

fn path(points: &[(f64, f64)]) -> Reference {
    let waypoint = |(x_m, y_m): (f64, f64)| Waypoint::straight(x_m, y_m);
    let mut reference = Reference {
        state: ReferenceState::Tracking.code(),
        path_id: 1,
        index: 1,
        total: points.len() as u64,
        speed_mps: 0.04,
        last: waypoint(points[0]),
        current: waypoint(points[1]),
        preview_len: points.len() as u64 - 2,
        ..Reference::ZERO
    };
    for (to, from) in reference.preview.iter_mut().zip(&points[2..]) {
        *to = waypoint(*from);
    }
    reference
}

/// Drives `law` as a perfect unicycle; the selector's part is left out (the reference stays).
fn drive(law: &mut Qp, reference: &Reference, pose: &mut WorldPose, acting: &mut BodyTwist, periods: usize) {
    for _ in 0..periods {
        let output = law.step(LawInputs { pose: *pose, reference, acting: *acting });
        *pose = moved(*pose, *acting, law.period_s);
        *acting = output.twist;
    }
}

/// A law that has seen a corner for a while, its last problem still in it.
fn before_a_corner(bisector: bool) -> (Qp, Weights) {
    let mut law = qp(LIMITS, bisector, QpParams::default());
    let corner = path(&[(0.0, 0.0), (0.4, 0.0), (0.4, 0.4), (0.0, 0.4)]);
    let (mut pose, mut acting) = (WorldPose::new(0.28, 0.004, -0.1), BodyTwist::new(0.04, 0.0, 0.0));
    drive(&mut law, &corner, &mut pose, &mut acting, 40);
    let weights = Weights::new(&law.params, &law.scale.expect("it has stepped"));
    (law, weights)
}

#[test]
fn the_model_has_the_slope_of_the_cost() {
    for bisector in [false, true] {
        let (mut law, weights) = before_a_corner(bisector);
        law.rollout.follow(&law.plan, &law.grid, &law.track);
        law.model.build(&law.plan, &law.rollout, &law.grid, &law.track, &weights);
        let mut rollout = Rollout::new();
        let mut cost = |plan: &Plan| {
            rollout.follow(plan, &law.grid, &law.track);
            rollout.cost(plan, &law.grid, &law.track, &weights)
        };
        let mut worst: f64 = 0.0;
        let mut size: f64 = 0.0;
        for j in 0..STAGES {
            let slope = law.model.slope(&law.plan, j);
            let (mut more, mut less) = (law.plan, law.plan);
            more.curvature[j] += 1e-6;
            less.curvature[j] -= 1e-6;
            let measured = (cost(&more) - cost(&less)) / 2e-6;
            worst = worst.max((slope - measured).abs());
            size = size.max(measured.abs());
        }
        // The model turns a stage about its chord's middle and measures pieces by chords.
        assert!(worst < 0.03 * size.max(0.05), "bisector {bisector}: {worst} of {size}");
    }
}

#[test]
fn the_first_input_is_that_of_a_reference_solution() {
    let mut reference = Solver::with_tolerance(true, 200, 1e-10).expect("a solver");
    let mut worst: f64 = 0.0;
    for y in [-0.03, -0.004, 0.0, 0.002, 0.02] {
        for x in [0.05, 0.25, 0.31, 0.36] {
            let mut law = qp(LIMITS, true, QpParams::default());
            let corner = path(&[(0.0, 0.0), (0.4, 0.0), (0.4, 0.4), (0.0, 0.4)]);
            let (mut pose, mut acting) = (WorldPose::new(x, y, 0.1), BodyTwist::new(0.04, 0.0, 0.0));
            drive(&mut law, &corner, &mut pose, &mut acting, 10);
            let scale = law.scale.expect("it has stepped");
            let weights = Weights::new(&law.params, &scale);
            let bounds = law.bounds(&scale, acting);
            law.rollout.follow(&law.plan, &law.grid, &law.track);
            law.model.build(&law.plan, &law.rollout, &law.grid, &law.track, &weights);
            let (mut ours, mut exact) = (law.plan, law.plan);
            let outcome = law.solver.as_mut().expect("a solver").solve(&law.model, &bounds, &mut ours);
            assert_eq!(outcome.fallback, Fallback::None);
            assert_eq!(reference.solve(&law.model, &bounds, &mut exact).fallback, Fallback::None);
            let input = |plan: &Plan| (1.0 / plan.slowness[0], plan.curvature[0] / plan.slowness[0]);
            let ((v, w), (v_exact, w_exact)) = (input(&ours), input(&exact));
            // As shares of the ranges 0 … v_hi and −ω_max … ω_max.
            worst = worst.max((v - v_exact).abs()).max((w - w_exact).abs() / 2.0);
        }
    }
    assert!(worst < 1e-4, "{worst} of the range");
}

#[test]
fn at_the_iteration_cap_it_is_degraded_and_still_inside_its_limits() {
    let mut law = qp(LIMITS, false, QpParams { max_iterations: 1, ..QpParams::default() });
    let corner = path(&[(0.0, 0.0), (0.1, 0.0), (0.0, 0.1)]);
    let (mut pose, mut acting) = (WorldPose::new(0.0, 0.01, 0.3), BodyTwist::ZERO);
    for _ in 0..400 {
        let output = law.step(LawInputs { pose, reference: &corner, acting });
        assert_eq!(output.fallback, Fallback::IterationCap);
        pose = moved(pose, acting, law.period_s);
        acting = output.twist;
        assert!((0.0..=0.041).contains(&acting.vx_mps) && acting.omega_radps.abs() <= 0.747);
    }
    // The helmsman that is left still gets there.
    assert!(pose.y_m.abs() < 0.01, "{pose:?}");
}

#[test]
fn health_says_what_the_solver_met() {
    use clarabel::solver::SolverStatus;
    let (some, none) = ([1.0, -2.0], [1.0, f64::NAN]);
    assert_eq!(solver::meaning(SolverStatus::Solved, &some), Fallback::None);
    assert_eq!(solver::meaning(SolverStatus::MaxIterations, &some), Fallback::IterationCap);
    for status in
        [SolverStatus::NumericalError, SolverStatus::PrimalInfeasible, SolverStatus::InsufficientProgress]
    {
        assert_eq!(solver::meaning(status, &some), Fallback::Unsolved);
    }
    assert_eq!(solver::meaning(SolverStatus::Solved, &none), Fallback::Unsolved);
    // No answer at all: the helmsman's plan, inside the limits, and still under way.
    let mut law = qp(LIMITS, false, QpParams::default());
    law.solver = None;
    let corner = path(&[(0.0, 0.0), (0.1, 0.0), (0.0, 0.1)]);
    let inputs = LawInputs {
        pose: WorldPose::new(0.0, 0.01, 0.3),
        reference: &corner,
        acting: BodyTwist::new(0.04, 0.0, 0.0),
    };
    let output = law.step(inputs);
    assert_eq!(output.fallback, Fallback::Unsolved);
    assert!(output.twist.vx_mps > 0.03 && output.twist.omega_radps < 0.0);
}

#[test]
fn it_turns_round_when_it_faces_the_wrong_way_and_goes_back_for_a_missed_waypoint() {
    for (start, aim) in [((0.0, 0.0, 3.0), (0.6, 0.0)), ((0.6, 0.1, 0.0), (0.3, 0.0))] {
        let mut law = qp(LIMITS, false, QpParams::default());
        let line = path(&[(0.0, 0.0), aim]);
        let (mut pose, mut acting) = (WorldPose::new(start.0, start.1, start.2), BodyTwist::ZERO);
        let mut nearest = f64::INFINITY;
        for _ in 0..6000 {
            drive(&mut law, &line, &mut pose, &mut acting, 1);
            nearest = nearest.min(libm::hypot(pose.x_m - aim.0, pose.y_m - aim.1));
        }
        assert!(nearest < 0.027, "from {start:?}: {nearest}");
    }
}

#[test]
fn standing_orders_are_answered() {
    // No speed, no turning: nothing to optimise, and it says so.
    let still = Reference { speed_mps: 0.0, ..path(&[(0.0, 0.0), (1.0, 0.0)]) };
    let output = qp(LIMITS, false, QpParams::default()).step(LawInputs {
        pose: WorldPose::default(),
        reference: &still,
        acting: BodyTwist::ZERO,
    });
    assert_eq!((output.twist, output.fallback), (BodyTwist::ZERO, Fallback::NoMotion));
    assert!(law("qp").is_some());
}

proptest! {
    #[test]
    fn legs_measure_as_segments_do(
        px in -0.3..0.3f64, py in -0.3..0.3f64, x in -0.4..0.4f64, y in -0.4..0.4f64,
        bulge in -2.0..2.0f64, line: bool, theta in -3.0..3.0f64,
    ) {
        prop_assume!(libm::hypot(x, y) > 0.02 && bulge.abs() > 0.01);
        let mut reference = path(&[(0.0, 0.0), (x, y)]);
        reference.current.bulge = if line { 0.0 } else { bulge };
        // The robot is put at the place to be measured, so the point is the origin of the plan.
        let pose = WorldPose::new(px, py, theta);
        let segment = reference.segment();
        let station = segment.nearest(pose.position());
        prop_assume!((station.along - 1.0) * segment.length_m() < 0.02);
        prop_assume!(segment.centre().is_none_or(|centre| centre.distance_m(pose.position()) > 1e-3));
        let scale = Scale::new(0.04, &LIMITS).expect("it can move");
        let mut track = Track::new(true);
        track.look(&reference, pose, &scale, 0.027);
        let leg = &track.legs()[0];
        let here = frame::Vector::default();
        prop_assert!((leg.cross_track(here) * scale.radius_m - station.cross_track_m).abs() < 1e-9);
        let tangent = leg.tangent_at(here);
        let heading = libm::atan2(tangent.y, tangent.x) + theta - station.heading_rad;
        prop_assert!(hilare_interfaces::geometry::wrap_angle_rad(heading).abs() < 1e-9);
        prop_assert!((leg.normal_at(here).dot(tangent)).abs() < 1e-12);
        prop_assert!((leg.curvature / scale.radius_m - segment.curvature_per_m()).abs() < 1e-9 || line);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Any pose, any path, any twist in action: inside every limit and within reach of what acts.
    #[test]
    fn every_limit_holds_for_every_input(
        v_max in 0.01..0.064f64, omega_max in 0.05..2.4f64, v_min in 0.0..0.005f64, bisector: bool,
        poses in proptest::collection::vec((-0.5..0.5f64, -0.5..0.5f64, -4.0..4.0f64), 1..6),
        points in proptest::collection::vec((-0.5..0.5f64, -0.5..0.5f64), 2..30),
    ) {
        let limits = TwistLimits { v_min_mps: v_min, v_max_mps: v_max, omega_max_radps: omega_max };
        let mut law = qp(limits, bisector, QpParams::default());
        let reference = path(&points);
        let mut acting = BodyTwist::new(v_min, 0.0, 0.0);
        for (x, y, theta) in poses {
            for _ in 0..3 {
                let pose = WorldPose::new(x, y, theta);
                let twist = law.step(LawInputs { pose, reference: &reference, acting }).twist;
                prop_assert!(law.iterations() <= 20);
                prop_assert!(law.chassis.motor_use(twist) <= 1.0 + 1e-12);
                prop_assert!((v_min - 1e-9..=v_max + 1e-9).contains(&twist.vx_mps), "{:?}", twist);
                prop_assert!(twist.omega_radps.abs() <= omega_max + 1e-9);
                let (dv, dw) = (law.params.accel_mps2 * 0.005, law.params.accel_radps2 * 0.005);
                prop_assert!((twist.vx_mps - acting.vx_mps).abs() <= dv + 1e-9, "{acting:?} {twist:?}");
                prop_assert!((twist.omega_radps - acting.omega_radps).abs() <= dw + 1e-9, "{acting:?} {twist:?}");
                acting = twist;
            }
        }
    }
}
