//! `cargo bench -p hilare-pose-estimator`: what a tick costs, on one core, with and without a fix; and what
//! saving the state after it costs, and loading it.
//!
//! The medians of rounds. The dearest step there is: the first fix after a whole history without any, of a
//! picture that was taken just now.
#![allow(
    missing_docs,
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have clocks and output"
)]

use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::PoseFix;
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use hilare_pose_estimator::ekf::params::EkfParams;
use hilare_pose_estimator::{EstimatorInputs, EstimatorKind, EstimatorSetup, PoseEstimator};
use std::hint::black_box;
use std::time::Instant;

const ROUNDS: usize = 41;

/// Every wheel moves in every tick, which no stepper at 40 mm/s does: the dear case.
fn counts(tick: Tick) -> [i64; 4] {
    [tick as i64, 2 * tick as i64, tick as i64, 2 * tick as i64]
}

/// ns of the median round of `steps` steps from `first` on.
fn cost_ns(
    kind: EstimatorKind,
    setup: EstimatorSetup,
    first: Tick,
    steps: Tick,
    fix: impl Fn(Tick, WorldPose) -> Option<PoseFix>,
) -> f64 {
    let mut rounds: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let mut estimator = PoseEstimator::new(kind, setup);
            let mut poses = Vec::new();
            for tick in 0..first {
                let inputs = EstimatorInputs { counts: &counts(tick), fixes: &[] };
                poses.push(estimator.step(tick, inputs).pose());
            }
            let fixes: Vec<_> =
                (first..first + steps).map(|tick| fix(tick, *poses.last().expect("some"))).collect();
            let start = Instant::now();
            for (tick, fix) in (first..).zip(&fixes) {
                let inputs = EstimatorInputs { counts: &counts(tick), fixes: fix.as_slice() };
                black_box(estimator.step(black_box(tick), inputs));
            }
            start.elapsed().as_nanos() as f64 / steps as f64
        })
        .collect();
    rounds.sort_by(f64::total_cmp);
    rounds[ROUNDS / 2]
}

/// Words of a state whose last fix is of a picture `age` ticks ago; ns of saving and of loading it.
fn state_cost_ns(kind: EstimatorKind, setup: EstimatorSetup, age: Tick) -> (usize, f64, f64) {
    let (mut estimator, mut next) = (PoseEstimator::new(kind, setup), PoseEstimator::new(kind, setup));
    let mut pose = WorldPose::default();
    for tick in 0..=10 + age {
        let taken = taken(tick, tick, pose);
        let fixes = if tick == 10 { &[taken][..] } else { &[] };
        pose = estimator.step(tick, EstimatorInputs { counts: &counts(tick), fixes }).pose();
    }
    let mut room = [0; STATE_WORDS];
    let words = estimator.save_state(&mut room).expect("room");
    let median = |call: &mut dyn FnMut()| {
        let mut rounds = [(); ROUNDS].map(|()| {
            let start = Instant::now();
            (0..1000).for_each(|_| call());
            start.elapsed().as_nanos() as f64 / 1e3
        });
        rounds.sort_by(f64::total_cmp);
        rounds[ROUNDS / 2]
    };
    let save = median(&mut || {
        black_box(estimator.save_state(black_box(&mut room)));
    });
    let load = median(&mut || assert!(next.load_state(black_box(&room[..words]))));
    (words, save, load)
}

/// A fix of `pose`.
fn taken(captured_tick: Tick, tick: Tick, pose: WorldPose) -> PoseFix {
    PoseFix { tick, captured_tick, x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad }
}

fn main() {
    let params = EkfParams::default();
    // So that any fix is inside the gate.
    let open = EkfParams { gate_sd: 100.0, camera_sd_m: 1.0, camera_sd_rad: 1.0, ..params };
    for chassis in
        [Chassis::Differential(DifferentialParams::default()), Chassis::Mecanum(MecanumParams::default())]
    {
        let start = WorldPose::default();
        let setup = EstimatorSetup { chassis, count_rad: 1e-5, start, ekf: open };
        println!("{}", chassis.name());
        for kind in EstimatorKind::ALL {
            let ns = cost_ns(kind, setup, 10, 1900, |_, _| None);
            println!("  {:<15} {ns:8.0} ns a tick without a fix", kind.name());
        }
        let full = cost_ns(EstimatorKind::Ekf, setup, 5000, 5000, |_, _| None);
        println!("  ekf             {full:8.0} ns a tick when there was none for 2048 ticks");
        let usual = cost_ns(EstimatorKind::Ekf, setup, 5000, 4000, |tick, pose| {
            (tick % 40 == 0).then(|| taken(tick - 60, tick, pose))
        });
        let none = cost_ns(EstimatorKind::Ekf, setup, 5000, 4000, |_, _| None);
        println!("  ekf             {:8.2} us a fix, 60 ticks late, every 40", 40.0 * (usual - none) / 1e3);
        let oldest = cost_ns(EstimatorKind::Ekf, setup, 5000, 1, |tick, pose| {
            Some(taken(tick - params.history_ticks, tick, pose))
        });
        let newest = cost_ns(EstimatorKind::Ekf, setup, 5000, 1, |tick, pose| Some(taken(tick, tick, pose)));
        println!("  ekf             {:8.2} us a fix as old as the history of 2048", oldest / 1e3);
        println!("  ekf             {:8.2} us a fix of now, the first in 2048 ticks", newest / 1e3);
        for kind in EstimatorKind::ALL {
            for age in if kind == EstimatorKind::Ekf { &[60, 100, 2048][..] } else { &[100] } {
                let (words, save, load) = state_cost_ns(kind, setup, *age);
                let fix = if kind.needs_fixes() { format!(", a fix {age} ticks ago") } else { String::new() };
                println!("  {:<15} {save:8.0} ns to save {words} words{fix}; {load:.0} to load", kind.name());
            }
        }
    }
}
