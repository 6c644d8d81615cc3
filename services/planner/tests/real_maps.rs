//! 200 queries on every shared map, judged by brute force and by a flood fill of their own.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have files, clocks, output and an environment"
)]

mod common;

use common::{Oracle, Random, shared_data};
use hilare_planner::map::moving_ai::load_scenarios;
use hilare_planner::{
    ClearanceField, LoadOptions, Map, Planner, PlannerParams, Refusal, Unlimited, WorldPoint,
};

const QUERIES: usize = 200;

fn query_map(name: &str, radius_m: f64, spacing_m: f64) {
    let Some(data) = shared_data() else { return };
    let map = Map::load(data.join(name), &LoadOptions::default()).unwrap();
    let oracle = Oracle::new(&map);
    let components = oracle.components(radius_m);
    let frame = map.frame().clone();
    let width = frame.width_cells();
    let free: Vec<usize> = (0..components.len()).filter(|&cell| components[cell] != 0).collect();
    let mut planner =
        Planner::new(ClearanceField::new(&map), PlannerParams { radius_m, spacing_m, ..Default::default() });
    let mut random = Random(7);
    let (mut solved, mut refused) = (0, 0);
    for _ in 0..QUERIES {
        let (a, b) = (free[random.below(free.len())], free[random.below(free.len())]);
        let (start, goal) =
            (frame.cell_centre(a % width, a / width), frame.cell_centre(b % width, b / width));
        match planner.plan(start, goal, &mut Unlimited) {
            Ok(plan) => {
                oracle.judge(&plan, start, goal, radius_m);
                solved += 1;
            }
            Err(Refusal::NoWay) => {
                assert_ne!(components[a], components[b], "{name}: wrongly refused {start:?} to {goal:?}");
                refused += 1;
            }
            Err(other) => panic!("{name}: {start:?} to {goal:?}: {other}"),
        }
    }
    eprintln!("{name}: {solved} solved, {refused} rightly refused");
}

#[test]
fn tb3_sandbox() {
    query_map("maps/tb3_sandbox.yaml", 0.22, 0.25);
}

#[test]
fn depot() {
    query_map("maps/depot.yaml", 0.22, 0.25);
}

#[test]
fn depot_keepout() {
    query_map("maps/depot_keepout.yaml", 0.22, 0.25);
}

#[test]
fn smoothers_world() {
    query_map("maps/smoothers_world.yaml", 0.15, 0.25);
}

#[test]
fn rooms_with_one_cell_doors() {
    query_map("maps/32room_000.map", 0.3, 1.0);
    query_map("maps/32room_000.map", 0.49, 1.0);
}

#[test]
fn barn() {
    query_map("maps/barn_world_0_cylinders.csv", 0.1, 0.2);
    query_map("maps/barn_world_50_cylinders.csv", 0.3, 0.2);
}

#[test]
fn platform_random() {
    query_map("platform.json", 0.037, 0.05);
}

/// Every 10th query of the benchmark's own list; a disc that fits the doors is never slower than octile
/// moves through cell centres by more than the doors' corners cost.
#[test]
fn moving_ai_scenarios() {
    let Some(data) = shared_data() else { return };
    let map = Map::load(data.join("maps/32room_000.map"), &LoadOptions::default()).unwrap();
    let scenarios = load_scenarios(data.join("maps/32room_000.map.scen")).unwrap();
    let oracle = Oracle::new(&map);
    let params = PlannerParams { radius_m: 0.3, spacing_m: 1.0, ..Default::default() };
    let mut planner = Planner::new(ClearanceField::new(&map), params);
    for scenario in scenarios.iter().step_by(10) {
        let centre = |(column, row)| map.frame().cell_centre(column, row);
        let (start, goal) = (centre(scenario.start), centre(scenario.goal));
        let plan = planner.plan(start, goal, &mut Unlimited).unwrap();
        oracle.judge(&plan, start, goal, 0.3);
        let octile = scenario.octile_length_cells;
        assert!(plan.length_m < 1.35 * octile + 4.0, "{} for octile {octile}", plan.length_m);
    }
}

/// Experiment 1 of paper 1: solved for every seed, near the best known length, 28 waypoints.
#[test]
fn platform_job() {
    let Some(data) = shared_data() else { return };
    let map = Map::load(data.join("platform.json"), &LoadOptions::default()).unwrap();
    let job = map.job().unwrap().clone();
    let (start, goal) = (job.start.unwrap(), job.goal.unwrap());
    assert_eq!((start, goal), (WorldPoint::new(0.2, 0.2), WorldPoint::new(0.7, 1.4)));
    let radius_m = job.robot_radius_m.unwrap();
    let oracle = Oracle::new(&map);
    let mut planner =
        Planner::new(ClearanceField::new(&map), PlannerParams { radius_m, ..Default::default() });
    for seed in 0..200 {
        planner.reset(seed);
        let plan = planner.plan(start, goal, &mut Unlimited).unwrap();
        oracle.judge(&plan, start, goal, radius_m);
        let best = job.best_known_length_m.unwrap();
        assert!(plan.length_m <= 1.01 * best, "seed {seed}: {} m", plan.length_m);
        assert_eq!(plan.waypoints.len(), 28, "seed {seed}");
    }
}
