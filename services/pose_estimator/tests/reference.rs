//! The filter beside a batch maximum-a-posteriori estimate of the same drive, which shares no formula
//! with it: tests/python/ekf_reference.py.
#![allow(clippy::disallowed_macros, reason = "what a test has measured is worth seeing")]

mod support;

use hilare_interfaces::messages::PoseFix;
use hilare_pose_estimator::ekf::Ekf;
use hilare_pose_estimator::ekf::params::EkfParams;
use support::differential;

/// Of the posterior standard deviation: what the linearisation may cost an estimate.
const OFF_MAX_SD: f64 = 0.003;
/// Relative, of the standard deviations themselves.
const SD_OFF_MAX: f64 = 3e-4;

#[test]
fn the_filter_finds_what_a_batch_estimate_finds() {
    let params = EkfParams {
        camera_sd_m: 0.001,
        camera_sd_rad: 0.005,
        start_sd_m: 0.02,
        start_sd_rad: 0.1,
        forward_scale_sd: 0.05,
        wheel_difference_sd: 0.01,
        yaw_scale_sd: 0.03,
        scale_drift: 0.002,
        slip_noise: 0.0003,
        ..EkfParams::default()
    };
    let setup = differential(params);
    let rows: Vec<(&str, u64, Vec<f64>)> = include_str!("data/ekf_reference.csv")
        .lines()
        .map(|line| {
            let mut cells = line.split(',');
            let (kind, tick) = (cells.next().expect("a kind"), cells.next().expect("a tick"));
            let values = cells.map(|cell| cell.parse().expect("a number")).collect();
            (kind, tick.parse().expect("a tick"), values)
        })
        .collect();
    let at = |kind: &str, tick: u64| rows.iter().find(|row| row.0 == kind && row.1 == tick).map(|row| &row.2);
    let mut ekf = Ekf::new(&setup, params);
    let mut compared = 0;
    for tick in 0..=800 {
        let counts = at("c", tick).map_or([0; 4], |n| [n[0] as i64, n[1] as i64, 0, 0]);
        let fix = at("f", tick).map(|f| PoseFix {
            tick,
            captured_tick: tick,
            x_m: f[0],
            y_m: f[1],
            theta_rad: f[2],
        });
        ekf.step(tick, &counts, fix.as_slice());
        let Some(batch) = at("r", tick) else { continue };
        compared += 1;
        let belief = ekf.belief();
        let found: Vec<f64> = belief.pose.iter().chain(&belief.scale).copied().collect();
        let variance: Vec<f64> =
            belief.pose_cov.diagonal().iter().chain(&belief.scale_cov.diagonal()).copied().collect();
        for (n, (value, batch_sd)) in batch[..6].iter().zip(&batch[6..]).enumerate() {
            let off = (found[n] - value) / batch_sd;
            let sd_off = libm::sqrt(variance[n]) / batch_sd - 1.0;
            println!("tick {tick}, state {n}: off by {off:.1e} sd, sd by {sd_off:.1e}");
            assert!(off.abs() < OFF_MAX_SD, "tick {tick}, state {n}: {off}");
            assert!(sd_off.abs() < SD_OFF_MAX, "tick {tick}, state {n}: {sd_off}");
        }
    }
    assert_eq!(compared, 5);
}
