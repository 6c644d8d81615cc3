//! How near the search comes to known fronts, and what it costs beside the objective: JSON on standard output, a
//! line a problem. `benches/fronts/run` puts other libraries beside it.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "a benchmark has a clock and output"
)]

#[path = "../../tests/problems/mod.rs"]
mod problems;

use hilare_tuner::{Budget, Mopso, Settings, hypervolume};
use problems::{PROBLEMS, Problem};
use rustix::time::{ClockId, clock_gettime};
use std::hint::black_box;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

const EVALUATIONS: u64 = 20_000;
const SEEDS: u64 = 10;

fn search<F: Fn(&[f64], &mut [f64]) -> f64 + Sync>(problem: &Problem, seed: u64, objective: &F) -> Mopso {
    let settings = Settings::new(problem.objectives, seed);
    let mut search = Mopso::new(problem.space(), settings).expect("sound settings");
    let budget = Budget { evaluations: EVALUATIONS, threads: 1 };
    search.run(objective, budget, None, &AtomicBool::new(false), |_, _| {}).expect("no log");
    search
}

/// Processor time a search takes beyond that of the objective on the same candidates, ns an evaluation.
fn overhead_ns(problem: &Problem, seed: u64) -> f64 {
    let candidates = Mutex::new(Vec::new());
    search(problem, seed, &|values: &[f64], objectives: &mut [f64]| {
        candidates.lock().expect("one thread").extend_from_slice(values);
        (problem.evaluate)(values, objectives);
        0.0
    });
    let start = cpu_ns();
    black_box(search(problem, seed, &|values: &[f64], objectives: &mut [f64]| {
        (problem.evaluate)(values, objectives);
        0.0
    }));
    let whole = cpu_ns() - start;
    let mut objectives = vec![0.0; problem.objectives];
    let start = cpu_ns();
    for values in candidates.into_inner().expect("one thread").chunks(problem.variables) {
        (problem.evaluate)(black_box(values), black_box(&mut objectives));
    }
    let own = cpu_ns() - start;
    (whole as f64 - own as f64) / EVALUATIONS as f64
}

/// What this process has used of a processor, ns.
fn cpu_ns() -> u64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_by(f64::total_cmp);
    (numbers[(numbers.len() - 1) / 2] + numbers[numbers.len() / 2]) / 2.0
}

fn main() {
    for problem in &PROBLEMS {
        let mut volumes: Vec<f64> = (1..=SEEDS)
            .map(|seed| {
                let search = search(problem, seed, &|values: &[f64], objectives: &mut [f64]| {
                    (problem.evaluate)(values, objectives);
                    0.0
                });
                let front = search.archive().members().map(|member| member.objectives);
                hypervolume(front, &vec![1.1; problem.objectives])
            })
            .collect();
        let mut overheads: Vec<f64> = (1..=SEEDS).map(|seed| overhead_ns(problem, seed)).collect();
        let (volume, overhead) = (median(&mut volumes), median(&mut overheads));
        println!(
            "{{\"problem\": \"{}\", \"wanted\": {}, \"hypervolume_worst\": {:.5}, \"hypervolume_median\": {volume:.5}, \
             \"overhead_us\": {:.4}}}",
            problem.name,
            problem.hypervolume,
            volumes[0],
            overhead / 1e3
        );
    }
}
