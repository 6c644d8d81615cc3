//! How near the search comes to fronts that are known.
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "tests have files and output")]

mod problems;

use hilare_tuner::{Budget, Mopso, Settings, hypervolume};
use problems::{PROBLEMS, Problem};
use std::sync::atomic::AtomicBool;

fn volume_found(problem: &Problem, seed: u64) -> f64 {
    let mut search = Mopso::new(problem.space(), Settings::new(problem.objectives, seed)).expect("settings");
    let objective = |values: &[f64], objectives: &mut [f64]| {
        (problem.evaluate)(values, objectives);
        0.0
    };
    let budget = Budget { evaluations: 20_000, threads: 1 };
    search.run(&objective, budget, None, &AtomicBool::new(false), |_, _| {}).expect("no log");
    assert_eq!(search.archive().len(), 100);
    hypervolume(search.archive().members().map(|member| member.objectives), &vec![1.1; problem.objectives])
}

#[test]
fn the_worst_of_ten_seeds_reaches_the_known_fronts() {
    for problem in &PROBLEMS {
        for seed in 1..=10 {
            let volume = volume_found(problem, seed);
            assert!(volume >= problem.hypervolume, "{} seed {seed}: {volume}", problem.name);
        }
    }
}

/// The most that `count` points on y = f(x), 0 ≤ x ≤ 1, can dominate below (1.1, 1.1): every point in turn is put
/// where it adds the most between its neighbours, until none moves. Independent of archive and swarm.
fn most(count: usize, f: fn(f64) -> f64) -> f64 {
    let mut x: Vec<f64> = (0..count).map(|n| n as f64 / (count - 1) as f64).collect();
    for _ in 0..4_000 {
        for n in 0..count {
            let before = if n == 0 { (0.0, 1.1) } else { (x[n - 1], f(x[n - 1])) };
            let (next, border) = x.get(n + 1).map_or((1.1, 1.0), |next| (*next, *next));
            let gain = |x: f64| (next - x) * (before.1 - f(x));
            // The gain has one peak: golden section.
            let (mut low, mut high) = (before.0, border);
            for _ in 0..40 {
                let third = (high - low) * 0.381_966;
                if gain(low + third) < gain(high - third) { low += third } else { high -= third }
            }
            // Or at a border, which a section only comes near to.
            let best = [low, before.0, border].into_iter().max_by(|a, b| gain(*a).total_cmp(&gain(*b)));
            x[n] = best.expect("three");
        }
    }
    let points: Vec<[f64; 2]> = x.iter().map(|x| [*x, f(*x)]).collect();
    hypervolume(points.iter().map(<[f64; 2]>::as_slice), &[1.1, 1.1])
}

#[test]
fn a_hundred_points_can_hardly_be_placed_better() {
    let fronts: [fn(f64) -> f64; 2] = [|x| 1.0 - x.sqrt(), |x| 1.0 - x * x];
    for (problem, front) in PROBLEMS.iter().zip(fronts) {
        let most = most(100, front);
        let found = volume_found(problem, 3);
        assert!(found <= most + 1e-6, "{}: {found}, more than {most}", problem.name);
        assert!(found > most - 1e-4, "{}: {found} of {most}", problem.name);
        println!("{}: {found:.5} of {most:.5}", problem.name);
    }
    let most = most(100, fronts[1]);
    assert!((0.5388..0.539).contains(&most), "{most}");
}
