use super::params::HISTORY_TICKS_MAX;
use super::*;
use crate::dead_reckoning::DeadReckoning;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use nalgebra::{Cholesky, Matrix6};
use proptest::prelude::*;
use std::vec::Vec;

const STEP_RAD: f64 = 0.13 / 20.0;

fn setup(ekf: EkfParams) -> EstimatorSetup {
    let chassis = Chassis::Differential(DifferentialParams::default());
    EstimatorSetup { chassis, count_rad: STEP_RAD, start: WorldPose::new(0.2, 0.2, 0.3), ekf }
}

fn ekf_with(params: EkfParams) -> Ekf {
    Ekf::new(&setup(params), params)
}

fn ekf() -> Ekf {
    ekf_with(EkfParams::default())
}

/// Counts of a drive that goes straight, turns both ways, stands and turns in place.
fn counts(tick: Tick) -> PerWheel<i64> {
    let right = tick / 3;
    let left = tick.min(500) / 3 + tick.saturating_sub(500) / 4;
    let spin = tick.saturating_sub(2000) as i64 / 2;
    [right as i64 + spin, left as i64 - spin, 0, 0]
}

/// A fix of the pose that `reckoned` says, off by `off`, taken at `captured_tick` and used at `tick`.
fn fix(reckoned: WorldPose, off: [f64; 3], captured_tick: Tick, tick: Tick) -> PoseFix {
    PoseFix {
        tick,
        captured_tick,
        x_m: reckoned.x_m + off[0],
        y_m: reckoned.y_m + off[1],
        theta_rad: wrap_angle_rad(reckoned.theta_rad + off[2]),
    }
}

/// Poses of a robot without any error, tick by tick.
fn truths(ticks: Tick) -> Vec<WorldPose> {
    let mut blind = ekf();
    (0..=ticks).map(|tick| blind.step(tick, &counts(tick), &[])).collect()
}

fn distance_m(a: WorldPose, b: WorldPose) -> f64 {
    a.position().distance_m(b.position())
}

/// The whole covariance, which is symmetric to the bit.
fn covariance(belief: &Belief) -> Matrix6<f64> {
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&belief.pose_cov);
    whole.fixed_view_mut::<3, 3>(0, 3).copy_from(&belief.cross_cov);
    whole.fixed_view_mut::<3, 3>(3, 0).copy_from(&belief.cross_cov.transpose());
    whole.fixed_view_mut::<3, 3>(3, 3).copy_from(&belief.scale_cov);
    assert_eq!(whole, whole.transpose(), "symmetric");
    whole
}

#[test]
fn without_fixes_it_is_dead_reckoning_along_arcs() {
    let EstimatorSetup { chassis, start, .. } = setup(EkfParams::default());
    let (mut ekf, mut reckoning) = (ekf(), DeadReckoning::new(chassis, STEP_RAD, start));
    for tick in 0..6000 {
        let (a, b) = (ekf.step(tick, &counts(tick), &[]), reckoning.step(tick, &counts(tick)));
        assert!((a.theta_rad - b.theta_rad).abs() < 1e-11);
        // Euler's rule is off by half a step's turn, 1.2 mrad, of the way made while turning.
        assert!(distance_m(a, b) < 1e-4, "tick {tick}: {a:?} {b:?}");
    }
}

#[test]
fn a_late_fix_is_worth_as_much_as_a_prompt_one() {
    const DELAY: Tick = 137;
    let truth = truths(6000);
    let (mut prompt, mut late) = (ekf(), ekf());
    for tick in 0..6000 {
        let taken = |captured: Tick| {
            let phase = captured as f64;
            let off = [1e-3 * libm::sin(phase), 2e-3 * libm::cos(3.0 * phase), 0.004];
            let seen = captured.is_multiple_of(50) && captured + DELAY < 6000;
            seen.then(|| fix(truth[captured as usize], off, captured, tick))
        };
        prompt.step(tick, &counts(tick), taken(tick).as_slice());
        late.step(tick, &counts(tick), tick.checked_sub(DELAY).and_then(taken).as_slice());
    }
    assert_eq!(late.fixes(), FixCounts { used: 118, ..FixCounts::default() });
    assert_eq!(prompt.fixes(), late.fixes());
    assert!((prompt.pose - late.pose).norm() < 1e-11);
    assert!((prompt.present().pose_cov - late.present().pose_cov).norm() < 1e-15);
}

#[test]
fn a_wrong_start_is_found_and_standing_still_loses_no_certainty() {
    let mut ekf = ekf();
    let truth = WorldPose::new(0.21, 0.19, 0.25);
    for tick in 0..2000 {
        let picture = (tick % 40 == 0).then(|| fix(truth, [0.0; 3], tick, tick));
        ekf.step(tick, &[0; 4], picture.as_slice());
    }
    let settled = *ekf.belief();
    assert!(distance_m(settled.world_pose(), truth) < 1e-5);
    assert!(libm::sqrt(settled.pose_cov[(0, 0)]) < 1.01e-3 / libm::sqrt(50.0));
    for tick in 2000..9000 {
        ekf.step(tick, &[0; 4], &[]);
    }
    assert_eq!(ekf.present(), settled);
}

#[test]
fn what_cannot_be_used_is_refused_and_counted() {
    let truth = truths(5000);
    let mut ekf = ekf();
    for tick in 0..=3000 {
        ekf.step(tick, &counts(tick), &[]);
    }
    let before = ekf.step(3000, &counts(3000), &[]);
    let good = |captured: Tick, tick: Tick| fix(truth[captured as usize], [1e-3; 3], captured, tick);
    let refused = [
        PoseFix { x_m: f64::NAN, ..good(2990, 3000) },
        PoseFix { y_m: f64::INFINITY, ..good(2990, 3000) },
        PoseFix { theta_rad: f64::NAN, ..good(2990, 3000) },
        PoseFix { x_m: 1e200, ..good(2990, 3000) },
        good(3001, 3000),
        good(2990, 3001),
        good(3000 - 2048 - 1, 3000),
    ];
    assert_eq!(ekf.step(3000, &counts(3000), &refused), before);
    assert_eq!(ekf.fixes(), FixCounts { invalid: 4, early: 2, late: 1, ..FixCounts::default() });
    let taken = ekf.step(3000, &counts(3000), &[good(2900, 3000)]);
    assert_ne!(taken, before);
    assert_eq!(ekf.step(3000, &counts(3000), &[good(2900, 3000), good(2800, 3000)]), taken);
    assert_eq!(ekf.fixes(), FixCounts { used: 1, invalid: 4, early: 2, late: 3, ..FixCounts::default() });
}

#[test]
fn a_history_that_runs_over_forgets_no_way() {
    let truth = truths(6000);
    let short = EkfParams { history_ticks: 100, ..EkfParams::default() };
    let (mut short, mut long) =
        (ekf_with(short), ekf_with(EkfParams { history_ticks: HISTORY_TICKS_MAX, ..short }));
    for tick in 0..=6000 {
        let picture = (tick == 5990).then(|| fix(truth[5930], [2e-3, 1e-3, 0.01], 5930, tick));
        let pair = (
            short.step(tick, &counts(tick), picture.as_slice()),
            long.step(tick, &counts(tick), picture.as_slice()),
        );
        assert_eq!(pair.0, pair.1);
    }
    assert_eq!((short.fixes().used, long.fixes().used), (1, 1));
}

#[test]
fn a_wild_fix_does_nothing_and_a_robot_carried_away_is_found() {
    const CARRIED: Tick = 3000;
    let mut truth = truths(6000);
    // Taken up, turned by 2 rad, and set down elsewhere; from there it drives on.
    let up = truth[CARRIED as usize];
    let (sin, cos) = libm::sincos(2.0);
    for pose in &mut truth[CARRIED as usize..] {
        let (dx, dy) = (pose.x_m - up.x_m, pose.y_m - up.y_m);
        *pose = WorldPose::new(0.5 + cos * dx - sin * dy, -0.2 + sin * dx + cos * dy, pose.theta_rad + 2.0);
    }
    let mut ekf = ekf();
    let mut lost_ticks = 0;
    for tick in 60..6000 {
        let captured = tick - 60;
        let off = match captured {
            1000 => [0.5, 0.0, 0.0],
            // Many in a row, each elsewhere.
            2000..2600 => [0.1 * (captured % 7) as f64 + 0.1, 0.2, 3.0],
            _ => [0.0; 3],
        };
        let picture = (tick % 40 == 20).then(|| fix(truth[captured as usize], off, captured, tick));
        let pose = ekf.step(tick, &counts(tick), picture.as_slice());
        if tick >= CARRIED && ekf.fixes().restarts == 0 {
            lost_ticks += 1;
        } else {
            assert!(distance_m(pose, truth[tick as usize]) < 1e-3, "tick {tick}: {pose:?}");
            assert!((pose.theta_rad - truth[tick as usize].theta_rad).abs() < 0.01, "tick {tick}: {pose:?}");
        }
    }
    assert_eq!(ekf.fixes().outliers, 1 + 15 + 5);
    assert!(lost_ticks <= 5 * 40 + 60, "{lost_ticks}");
}

#[test]
fn the_heading_goes_on_turning_while_fixes_are_wrapped() {
    let mut ekf = ekf();
    let mut truth = WorldPose::new(0.2, 0.2, 0.3);
    for tick in 1..20_000 {
        let n = tick as i64;
        let moved = ekf.step(tick, &[n, -n, 0, 0], &[]);
        truth.theta_rad += 2.0 * 0.13e-3 / 0.054;
        assert!((moved.theta_rad - truth.theta_rad).abs() < 0.01);
        if tick % 40 == 0 {
            ekf.step(tick, &[n, -n, 0, 0], &[fix(truth, [0.0; 3], tick, tick)]);
        }
    }
    assert!(truth.theta_rad > 80.0 && ekf.fixes().used == 499, "{:?}", ekf.fixes());
}

#[test]
fn a_mecanum_platform_learns_that_it_slips_sideways() {
    let chassis = Chassis::Mecanum(MecanumParams::default());
    let params = EkfParams::default();
    let setup = EstimatorSetup { chassis, count_rad: 0.001, start: WorldPose::default(), ekf: params };
    let mut ekf = Ekf::new(&setup, params);
    for tick in 0..=3000 {
        let n = 2 * tick as i64;
        // One count of each wheel is 0.05 mm to the left, of which 0.045 mm are made.
        let truth = WorldPose::new(0.0, n as f64 * 0.045e-3, 0.0);
        let picture = (tick % 40 == 0).then(|| fix(truth, [0.0; 3], tick, tick));
        ekf.step(tick, &[-n, n, n, -n], picture.as_slice());
    }
    let scale = ekf.belief().scale;
    assert!((scale.y + 0.1).abs() < 0.002 && scale.x.abs() < 1e-3 && scale.z.abs() < 1e-3, "{scale:?}");
}

#[test]
fn derivatives_of_an_arc_are_its_differences() {
    let pose = Vector3::new(0.3, -0.2, 0.7);
    for d in [Vector3::new(1e-4, 2e-5, 1e-3), Vector3::new(0.2, -0.1, 1.3), Vector3::new(0.1, 0.05, 0.0399)] {
        let (by_pose, by_d) = (arc(&pose, &d).by_pose(), arc(&pose, &d).by_displacement());
        for axis in 0..3 {
            let mut h = Vector3::zeros();
            h[axis] = 1e-6;
            let end = |pose: Vector3<f64>, d: Vector3<f64>| pose + arc(&pose, &d).way;
            let pose_slope = (end(pose + h, d) - end(pose - h, d)) / 2e-6;
            let d_slope = (end(pose, d + h) - end(pose, d - h)) / 2e-6;
            assert!((pose_slope - by_pose.column(axis)).norm() < 1e-9);
            assert!((d_slope - by_d.column(axis)).norm() < 1e-9);
        }
    }
}

/// Any `f64`, NaN and infinities among them, or one near what is likely.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>(), -1.0..1.0f64]
}

proptest! {
    #[test]
    fn whatever_comes_the_pose_is_finite(
        messages in proptest::collection::vec(
            (any::<(u64, [i64; 4])>(), 0u64..300, any::<bool>(), 0u64..200, (number(), number(), number())),
            1..60,
        ),
    ) {
        let mut ekf = ekf_with(EkfParams { history_ticks: 64, ..EkfParams::default() });
        let mut now = 0;
        for ((any_tick, any_counts), further, wild, delay, (x_m, y_m, theta_rad)) in messages {
            now = if wild { any_tick } else { now.saturating_add(further) };
            let counts = if wild { any_counts } else { counts(further) };
            let late = PoseFix { tick: now, captured_tick: now.saturating_sub(delay), x_m, y_m, theta_rad };
            let twice = [late, PoseFix { captured_tick: any_tick, ..late }];
            let pose = ekf.step(now, &counts, &twice);
            prop_assert!(pose.position().is_finite() && pose.theta_rad.is_finite(), "{pose:?}");
            let whole = covariance(ekf.belief());
            prop_assert!(whole.iter().all(|value| value.is_finite()), "{whole}");
        }
    }

    #[test]
    fn the_covariance_stays_symmetric_and_positive_and_the_bits_repeat(
        moves in proptest::collection::vec((-1i64..=1, -1i64..=1), 200..1500),
        period in 1u64..80, delay in 0u64..150,
        off in proptest::array::uniform3(-5e-3..5e-3f64),
        camera_sd_m in 1e-6..0.1f64, camera_sd_rad in 1e-6..0.5f64,
    ) {
        let params = EkfParams { camera_sd_m, camera_sd_rad, ..EkfParams::default() };
        let drive = || {
            let mut ekf = ekf_with(params);
            let mut counts = [0; 4];
            let mut poses = std::vec![WorldPose::new(0.2, 0.2, 0.3)];
            for (tick, (right, left)) in (1..).zip(&moves) {
                counts[0] += right;
                counts[1] += left;
                let picture = (tick > delay && tick % period == 0)
                    .then(|| fix(poses[(tick - delay) as usize - 1], off, tick - delay, tick));
                poses.push(ekf.step(tick, &counts, picture.as_slice()));
            }
            (ekf, poses)
        };
        let (ekf, poses) = drive();
        prop_assert!(Cholesky::new(covariance(ekf.belief())).is_some());
        prop_assert!(Cholesky::new(covariance(&ekf.present())).is_some());
        prop_assert_eq!(drive().1, poses);
    }

    #[test]
    fn lost_messages_lose_no_way(gaps in proptest::collection::vec(1..16u64, 3000)) {
        // Where a picture's message was lost, the counts of its tick are put between those that came: each wheel's are
        // at most one off, and the heading by what two of them turn. A fix counts with a weight, and all weights
        // together are no more than one. What is learnt of the wheels' scale differs too, and turns the way since then
        // by half as much at most.
        const COUNT_M: f64 = 0.13e-3;
        const TRACK_M: f64 = 0.054;
        let truth = truths(3000);
        let (mut whole, mut holes) = (ekf(), ekf());
        let mut pair = (WorldPose::default(), WorldPose::default());
        let mut gaps = gaps.into_iter();
        let mut next = 0;
        for tick in 0..=3000 {
            let picture = (tick >= 60 && tick % 40 == 0)
                .then(|| fix(truth[tick as usize - 60], [1e-3, -1e-3, 5e-3], tick - 60, tick));
            pair.0 = whole.step(tick, &counts(tick), picture.as_slice());
            if tick == next || tick == 3000 || picture.is_some() {
                pair.1 = holes.step(tick, &counts(tick), picture.as_slice());
                prop_assert!(distance_m(pair.0, pair.1) < 1.2 * COUNT_M, "tick {tick}: {pair:?}");
                let heading = (pair.0.theta_rad - pair.1.theta_rad).abs();
                prop_assert!(heading < 3.0 * COUNT_M / TRACK_M, "tick {tick}: {pair:?}");
            }
            if tick == next {
                next += gaps.next().unwrap_or(1);
            }
        }
        prop_assert_eq!(whole.fixes(), holes.fixes());
    }
}
