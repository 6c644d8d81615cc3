//! `cargo bench -p hilare-controller --bench state`: how many words the state of a controller is, and what it
//! costs to save and to load them, which is done once a control period and once a process. Medians of rounds.
#![allow(missing_docs, clippy::disallowed_methods, clippy::disallowed_macros)]

use hilare_controller::prediction::{Prediction, PredictionParams};
use hilare_controller::{Controller, ControllerInputs, Identity, LAWS, LawSetup, LawSpec, TwistLimits};
use hilare_interfaces::block::Block;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Pose, Reference, ReferenceState, Waypoint};
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use std::hint::black_box;
use std::time::Instant;

const ROUNDS: usize = 41;
const REPEATS: u32 = 1000;
const PERIOD: u64 = 5;

/// ns of the median round of one call.
fn cost_ns(mut call: impl FnMut()) -> f64 {
    let mut rounds: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            (0..REPEATS).for_each(|_| call());
            start.elapsed().as_nanos() as f64 / f64::from(REPEATS)
        })
        .collect();
    rounds.sort_by(f64::total_cmp);
    rounds[ROUNDS / 2]
}

fn controller(spec: &LawSpec, chassis: &Chassis) -> Controller {
    let setup = LawSetup {
        chassis,
        limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 0.041, omega_max_radps: 0.747 },
        acceptance_radius_m: 0.027,
        acceptance: spec.acceptance,
        period_ticks: PERIOD,
        values: &[],
    };
    let prediction = Prediction::new(PredictionParams::default(), &setup);
    let law = (spec.build)(&setup).expect("defaults build");
    Controller::new(law, Identity { source: 1, epoch: 1 }, PERIOD, prediction)
}

fn main() {
    let reference = Reference {
        state: ReferenceState::Tracking.code(),
        path_id: 1,
        index: 1,
        total: 2,
        speed_mps: 0.04,
        current: Waypoint::straight(1.0, 0.0),
        ..Reference::ZERO
    };
    println!("{:<30} {:>6} {:>8} {:>8}", "", "words", "save ns", "load ns");
    for chassis in
        [Chassis::Differential(DifferentialParams::default()), Chassis::Mecanum(MecanumParams::default())]
    {
        for spec in LAWS.iter().filter(|spec| spec.chassis.contains(&chassis.name())) {
            let (mut old, mut new) = (controller(spec, &chassis), controller(spec, &chassis));
            for period in 0..100 {
                let pose = Pose::at(PERIOD * period, WorldPose::new(2e-4 * period as f64, 0.002, 0.1));
                old.step(pose.tick, ControllerInputs { reference: &reference, pose: &pose });
            }
            let mut room = [0; STATE_WORDS];
            let words = old.save_state(&mut room).expect("room");
            let save = cost_ns(|| {
                black_box(old.save_state(black_box(&mut room)));
            });
            let load = cost_ns(|| assert!(new.load_state(black_box(&room[..words]))));
            let name = format!("{} on {}", spec.name, chassis.name());
            println!("{name:<30} {words:>6} {save:>8.0} {load:>8.0}");
        }
    }
}
