//! The filter's covariance is honest: normalised estimation error squared (NEES) over seeded runs.
//!
//! Everything wrong with the robot is drawn from what the filter is told. Then the NEES of the pose,
//! (p̂ − p)ᵀ P⁻¹ (p̂ − p), averaged over N runs, is χ² of 3 N degrees of freedom over N (Bar-Shalom, Li,
//! Kirubarajan 2001, 5.4.2).
#![allow(clippy::disallowed_macros, reason = "what a test has measured is worth seeing")]

mod support;

use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::{BodyTwist, WorldPose, wrap_angle_rad};
use hilare_pose_estimator::EstimatorSetup;
use hilare_pose_estimator::ekf::Ekf;
use hilare_pose_estimator::ekf::filter::Belief;
use hilare_pose_estimator::ekf::params::EkfParams;
use nalgebra::{Cholesky, Vector3};
use support::{Camera, Noise, Pulses, Robot, Wrong, differential, mecanum};

const RUNS: u64 = 400;
const TICKS: u64 = 12_000;
/// Two-sided 99 % band of χ² of 1200 degrees of freedom over 400 (Wilson–Hilferty).
const BAND: (f64, f64) = (2.694, 3.325);

/// Speeds of a drive with straights, arcs, turns in place and a pause.
fn twist(chassis: &Chassis, tick: u64) -> BodyTwist {
    let t = tick as f64 * 1e-3;
    match (chassis, tick / 1500) {
        (Chassis::Differential(_), 0 | 5) => BodyTwist::new(0.04, 0.0, 0.0),
        (Chassis::Differential(_), 2) => BodyTwist::new(0.0, 0.0, 0.7),
        (Chassis::Differential(_), _) => BodyTwist::new(0.03, 0.0, 0.6 * libm::sin(1.1 * t)),
        (Chassis::Mecanum(_), 0) => BodyTwist::new(0.3, 0.0, 0.0),
        (Chassis::Mecanum(_), 2) => BodyTwist::new(0.0, 0.3, 0.0),
        (Chassis::Mecanum(_), 5) => BodyTwist::new(0.0, 0.0, 0.8),
        (Chassis::Mecanum(_), _) => {
            BodyTwist::new(0.3 * libm::cos(0.9 * t), 0.2 * libm::sin(1.3 * t), 0.5 * libm::sin(0.7 * t))
        }
    }
}

fn nees(belief: &Belief, truth: WorldPose) -> f64 {
    let mut off = belief.pose - Vector3::new(truth.x_m, truth.y_m, truth.theta_rad);
    off.z = wrap_angle_rad(off.z);
    off.dot(&Cholesky::new(belief.pose_cov).expect("positive definite").solve(&off))
}

/// Mean over the runs.
struct Averages {
    /// NEES at the picture, a value a fix.
    filtered: Vec<f64>,
    /// NEES of the present when the fix is used.
    present: Vec<f64>,
    /// Forward scale error believed in the end.
    forward_scale: f64,
}

fn averages(setup: EstimatorSetup, wrong: impl Fn(&mut Noise) -> Wrong) -> Averages {
    let fixes = (TICKS - 60) as usize / 40 + 1;
    let mut sums = Averages { filtered: vec![0.0; fixes], present: vec![0.0; fixes], forward_scale: 0.0 };
    for seed in 0..RUNS {
        let mut noise = Noise::new(3 * seed);
        let mut robot = Robot::new(&setup, wrong(&mut noise), Noise::new(3 * seed + 1));
        let mut camera = Camera::usual(Noise::new(3 * seed + 2));
        let mut ekf = Ekf::new(&setup, setup.ekf);
        let mut pulses = Pulses::default();
        let mut truths = Vec::new();
        let mut next = 0;
        for tick in 0..=TICKS {
            let paused = (7000..8000).contains(&tick);
            let speeds = setup.chassis.wheel_speeds(twist(&setup.chassis, tick));
            robot.turn(if paused || tick == 0 { [0; 4] } else { pulses.tick(&setup, speeds) });
            truths.push(robot.pose);
            let fix = camera.watch(tick, robot.pose);
            let pose = ekf.step(tick, &robot.counts, fix.as_slice());
            if let Some(fix) = fix {
                sums.filtered[next] += nees(ekf.belief(), truths[fix.captured_tick as usize]);
                let present = ekf.present();
                sums.present[next] += nees(&present, robot.pose);
                assert!((present.pose.x - pose.x_m).abs() < 1e-12, "one present, two ways");
                next += 1;
            }
        }
        let counts = ekf.fixes();
        assert!(counts.used + 1 >= fixes as u64, "seed {seed}: {counts:?}");
        assert_eq!(next, fixes);
        sums.forward_scale += ekf.belief().scale.x / RUNS as f64;
    }
    for sum in sums.filtered.iter_mut().chain(&mut sums.present) {
        *sum /= RUNS as f64;
    }
    sums
}

/// Mean over all times and the share of times in the band.
fn summary(averages: &[f64]) -> (f64, f64) {
    let inside = averages.iter().filter(|mean| (BAND.0..=BAND.1).contains(*mean)).count();
    (averages.iter().sum::<f64>() / averages.len() as f64, inside as f64 / averages.len() as f64)
}

#[test]
fn the_covariance_is_that_of_the_errors() {
    let params = EkfParams::default();
    for (name, setup) in [("differential", differential(params)), ("Mecanum", mecanum(params))] {
        let averages = averages(setup, |noise| Wrong::drawn(&params, &setup, noise));
        for (what, values) in [("at the picture", &averages.filtered), ("at present", &averages.present)] {
            let (mean, inside) = summary(values);
            println!("{name}, {what}: mean NEES {mean:.3}, {:.1} % of the times inside", 100.0 * inside);
            assert!((BAND.0..=BAND.1).contains(&mean), "{name}, {what}: {mean}");
            assert!(inside >= 0.95, "{name}, {what}: {inside}");
        }
    }
}

#[test]
fn slip_and_unequal_wheels_are_inside_the_covariance_and_learnt() {
    let params = EkfParams::default();
    let setup = differential(params);
    let wrong = |_: &mut Noise| Wrong { scale: [-0.05, 0.01, 0.0], ..Wrong::default() };
    let averages = averages(setup, wrong);
    for (what, values) in [("at the picture", &averages.filtered), ("at present", &averages.present)] {
        let (mean, inside) = summary(values);
        println!("slip, {what}: mean NEES {mean:.3}, {:.1} % of the times inside", 100.0 * inside);
        // The errors neither wander nor spread here, as the filter has to reckon with: it may only
        // err on the safe side.
        assert!(mean < BAND.1, "{what}: {mean}");
    }
    println!("forward scale error, true -0.05: {:.5}", averages.forward_scale);
    assert!((averages.forward_scale + 0.05).abs() < 0.001);
}
