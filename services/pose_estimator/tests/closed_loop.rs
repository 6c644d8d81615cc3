//! The estimate fed back: Kanayama's law round the paper's rectangle, with and without fixes.
#![allow(clippy::disallowed_macros, reason = "what a test has measured is worth seeing")]

mod support;

use hilare_pose_estimator::EstimatorKind;
use hilare_pose_estimator::ekf::params::EkfParams;
use support::rectangle::{Driven, drive, drive_under};
use support::{Camera, Noise, Wrong, differential};

const SEEDS: u64 = 20;
/// 5 % of slip, 1 % of wheel difference, 10 mm off in x and y, 3° off in heading.
const SLIPPING: Wrong =
    Wrong { scale: [-0.05, 0.01, 0.0], slip_noise: 0.0, scale_drift: 0.0, start: [0.01, 0.01, 0.052_36] };

/// Means over the seeds.
#[derive(Debug)]
struct Means {
    cross_track_mm: f64,
    estimate_rms_mm: f64,
    jump_rms_mm: f64,
    seconds: f64,
}

fn means(name: &str, drives: impl Fn(u64) -> Driven) -> Means {
    let all: Vec<Driven> = (0..SEEDS).map(drives).collect();
    assert!(all.iter().all(|driven| driven.arrived), "{name}: arrives with every seed");
    let mean = |value: fn(&Driven) -> f64| all.iter().map(value).sum::<f64>() / SEEDS as f64;
    let means = Means {
        cross_track_mm: 1e3 * mean(|driven| driven.cross_track_mean_m),
        estimate_rms_mm: 1e3 * mean(|driven| driven.estimate_rms_m),
        jump_rms_mm: 1e3 * mean(|driven| driven.jump_rms_m),
        seconds: 1e-3 * mean(|driven| driven.ticks as f64),
    };
    println!("{name}: {means:.3?}");
    means
}

/// With the true pose at every tick.
fn knowing(wrong: Wrong) -> Means {
    let setup = differential(EkfParams::default());
    means("true pose", |seed| {
        let perfect = Camera::new(1, 0, (0.0, 0.0), Noise::new(seed));
        drive_under(perfect, EstimatorKind::Camera, setup, wrong, seed)
    })
}

fn with(kind: EstimatorKind, wrong: Wrong) -> Means {
    let setup = differential(EkfParams::default());
    means(kind.name(), |seed| drive(kind, setup, wrong, seed))
}

#[test]
fn the_small_world_is_that_of_the_papers_reference() {
    let setup = differential(EkfParams::default());
    let driven = drive(EstimatorKind::DeadReckoning, setup, Wrong::default(), 0);
    assert_eq!(driven.ticks, 34_390);
    assert_eq!(driven.steps, [11_259, 9_294]);
    assert!((driven.cross_track_mean_m - 3.7897e-3).abs() < 0.005 * 3.7897e-3, "{driven:?}");
}

#[test]
fn slip_unequal_wheels_and_a_wrong_start_hardly_show() {
    let blind = with(EstimatorKind::DeadReckoning, SLIPPING);
    let fused = with(EstimatorKind::Ekf, SLIPPING);
    let knowing = knowing(SLIPPING);
    assert!(3.0 * fused.cross_track_mm < blind.cross_track_mm);
    assert!(fused.cross_track_mm < 1.05 * knowing.cross_track_mm, "as good as knowing the pose");
    assert!(fused.estimate_rms_mm < 0.3);
}

#[test]
fn slip_from_step_to_step_and_scales_that_wander_change_little() {
    let wrong = Wrong { slip_noise: 0.001, scale_drift: 0.02, ..SLIPPING };
    let blind = with(EstimatorKind::DeadReckoning, wrong);
    let fused = with(EstimatorKind::Ekf, wrong);
    assert!(3.0 * fused.cross_track_mm < blind.cross_track_mm);
}

#[test]
fn a_rare_and_very_late_camera_is_enough() {
    // Five fixes a second, half a second old: 20 mm behind; the track is 3 % off as well.
    let wrong = Wrong { scale: [-0.05, 0.01, 0.03], ..SLIPPING };
    let setup = differential(EkfParams::default());
    let under = |kind: EstimatorKind| {
        means(kind.name(), |seed| {
            let camera = Camera::new(200, 500, (0.001, 0.005), Noise::new(2 * seed + 1));
            drive_under(camera, kind, setup, wrong, seed)
        })
    };
    let fused = under(EstimatorKind::Ekf);
    let knowing = knowing(wrong);
    assert!(fused.cross_track_mm < 1.1 * knowing.cross_track_mm);
    assert!(fused.estimate_rms_mm < 0.6);
}

#[test]
fn where_nothing_is_wrong_the_camera_does_no_harm() {
    let blind = with(EstimatorKind::DeadReckoning, Wrong::default());
    let fused = with(EstimatorKind::Ekf, Wrong::default());
    assert!(fused.cross_track_mm < 1.02 * blind.cross_track_mm);
    assert!(fused.seconds < 1.01 * blind.seconds);
    assert!(fused.estimate_rms_mm < 0.25, "of a camera of 1.4 mm");
    assert!(fused.jump_rms_mm < 0.05, "what the law sees of a fix");
}
