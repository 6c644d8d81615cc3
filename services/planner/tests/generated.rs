//! Generated mazes, rooms and clutter: solvable ones are solved, unsolvable ones are said to be.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have files, clocks, output and an environment"
)]

mod common;

use common::{Oracle, Random};
use hilare_planner::map::{MapFrame, Unknown};
use hilare_planner::{
    Border, Budget, ClearanceField, Map, Plan, Planner, PlannerParams, Refusal, Unlimited, WorldPoint,
};
use proptest::prelude::*;

fn map_of(width: usize, cells: Vec<u8>) -> Map {
    let height = cells.len() / width;
    let frame = MapFrame::new("map", WorldPoint::new(-1.0, 2.0), 0.0, 0.1, width, height).unwrap();
    Map::from_cells(frame, cells, Unknown::Blocked).unwrap()
}

/// A spanning-tree maze with walls and corridors one cell wide (depth-first, random).
fn maze(rooms: usize, random: &mut Random) -> (usize, Vec<u8>) {
    let width = 2 * rooms + 1;
    let mut cells = vec![100u8; width * width];
    let at = |i: usize, j: usize| (2 * j + 1) * width + 2 * i + 1;
    let mut stack = vec![(0usize, 0usize)];
    cells[at(0, 0)] = 0;
    while let Some(&(i, j)) = stack.last() {
        let mut near = Vec::new();
        for (di, dj) in [(1i64, 0i64), (-1, 0), (0, 1), (0, -1)] {
            let (a, b) = (i as i64 + di, j as i64 + dj);
            let inside = (0..rooms as i64).contains(&a) && (0..rooms as i64).contains(&b);
            if inside && cells[at(a as usize, b as usize)] != 0 {
                near.push((a as usize, b as usize));
            }
        }
        if near.is_empty() {
            stack.pop();
            continue;
        }
        let (a, b) = near[random.below(near.len())];
        cells[at(a, b)] = 0;
        cells[usize::midpoint(at(i, j), at(a, b))] = 0;
        stack.push((a, b));
    }
    (width, cells)
}

#[test]
fn mazes_one_cell_wide() {
    for seed in 0..8 {
        let mut random = Random(seed);
        let rooms = 8 + 8 * seed as usize;
        let (width, cells) = maze(rooms, &mut random);
        let map = map_of(width, cells);
        let oracle = Oracle::new(&map);
        let radius_m = 0.045;
        let params = PlannerParams { radius_m, seed, spacing_m: 0.1, ..Default::default() };
        let mut planner = Planner::new(ClearanceField::new(&map), params);
        for _ in 0..25 {
            let start = oracle.random_free(&mut random, radius_m);
            let goal = oracle.random_free(&mut random, radius_m);
            let plan = planner.plan(start, goal, &mut Unlimited).unwrap();
            oracle.judge(&plan, start, goal, radius_m);
        }
    }
}

/// Rooms with one-cell doors; a closed door closes the room.
#[test]
fn rooms_with_doors_open_and_shut() {
    let (room, rooms) = (12usize, 5usize);
    let width = room * rooms + 1;
    for seed in 0..6 {
        let mut random = Random(seed + 100);
        let wall = |i: usize, j: usize| i.is_multiple_of(room) || j.is_multiple_of(room);
        let mut cells: Vec<u8> =
            (0..width * width).map(|c| if wall(c % width, c / width) { 100 } else { 0 }).collect();
        for a in 0..rooms {
            for b in 0..rooms {
                let along = 1 + random.below(room - 1);
                if a + 1 < rooms && random.unit() < 0.7 {
                    cells[(b * room + along) * width + (a + 1) * room] = 0;
                }
                if b + 1 < rooms && random.unit() < 0.7 {
                    cells[(b + 1) * room * width + a * room + along] = 0;
                }
            }
        }
        judge_against_flood(&map_of(width, cells), 0.048, seed, 60);
    }
}

/// Plans random queries between cell centres and compares with the flood fill, both ways.
fn judge_against_flood(map: &Map, radius_m: f64, seed: u64, queries: usize) -> (usize, usize) {
    let oracle = Oracle::new(map);
    let components = oracle.components(radius_m);
    let free: Vec<usize> = (0..components.len()).filter(|&cell| components[cell] != 0).collect();
    if free.is_empty() {
        return (0, 0);
    }
    let params = PlannerParams { radius_m, seed, spacing_m: 0.2, ..Default::default() };
    let mut planner = Planner::new(ClearanceField::new(map), params);
    let mut random = Random(seed);
    let width = map.frame().width_cells();
    let (mut solved, mut refused) = (0, 0);
    for _ in 0..queries {
        let (a, b) = (free[random.below(free.len())], free[random.below(free.len())]);
        let centre = |cell: usize| map.frame().cell_centre(cell % width, cell / width);
        match planner.plan(centre(a), centre(b), &mut Unlimited) {
            Ok(plan) => {
                oracle.judge(&plan, centre(a), centre(b), radius_m);
                solved += 1;
            }
            Err(Refusal::NoWay) => {
                assert_ne!(components[a], components[b], "seed {seed}: wrongly refused {a} to {b}");
                refused += 1;
            }
            Err(other) => panic!("seed {seed}: {other}"),
        }
    }
    (solved, refused)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn clutter(seed: u64, width in 8usize..60, height in 8usize..60, density in 0.02f64..0.45, radius in 0.0f64..0.25) {
        let mut random = Random(seed);
        let cells = (0..width * height).map(|_| if random.unit() < density { 100 } else { 0 }).collect();
        judge_against_flood(&map_of(width, cells), radius, seed, 12);
    }

    /// Start and goal anywhere, off the lattice of centres.
    #[test]
    fn clutter_off_centre(seed: u64, density in 0.02f64..0.3, radius in 0.01f64..0.2) {
        let mut random = Random(seed);
        let cells: Vec<u8> = (0..40 * 40).map(|_| if random.unit() < density { 100 } else { 0 }).collect();
        let map = map_of(40, cells);
        let oracle = Oracle::new(&map);
        let params = PlannerParams { radius_m: radius, seed, spacing_m: 0.2, ..Default::default() };
        let mut planner = Planner::new(ClearanceField::new(&map), params);
        prop_assume!((0..1600).any(|c| oracle.free(map.frame().cell_centre(c % 40, c / 40), radius * 1.001)));
        for _ in 0..8 {
            let (start, goal) = (oracle.random_free(&mut random, radius), oracle.random_free(&mut random, radius));
            match planner.plan(start, goal, &mut Unlimited) {
                Ok(plan) => oracle.judge(&plan, start, goal, radius),
                Err(Refusal::NoWay) => {}
                Err(other) => panic!("{other}"),
            }
        }
    }

    /// The exact clearance equals brute force, off centre too.
    #[test]
    fn clearance_is_exact(seed: u64, density in 0.0f64..0.3) {
        let mut random = Random(seed);
        let cells: Vec<u8> = (0..30 * 30).map(|_| if random.unit() < density { 100 } else { 0 }).collect();
        let map = map_of(30, cells);
        let (oracle, field) = (Oracle::new(&map), ClearanceField::new(&map));
        for _ in 0..50 {
            let p = WorldPoint::new(-1.0 + 3.0 * random.unit(), 2.0 + 3.0 * random.unit());
            let clearance = field.clearance_m(p).unwrap();
            if clearance.is_infinite() {
                prop_assert!(oracle.free(p, 10.0));
            } else {
                prop_assert!(clearance == 0.0 || oracle.free(p, clearance - 1e-9), "{p:?} {clearance}");
                prop_assert!(!oracle.free(p, clearance + 1e-9), "{p:?} {clearance}");
            }
        }
    }
}

fn open_map() -> Map {
    let mut cells = vec![0u8; 50 * 50];
    for row in 0..50 {
        cells[row * 50 + 25] = 100;
    }
    map_of(50, cells)
}

#[test]
fn refusals_are_distinct() {
    let map = open_map();
    let params = PlannerParams { radius_m: 0.1, ..Default::default() };
    let mut planner = Planner::new(ClearanceField::new(&map), params.clone());
    let (left, right) = (WorldPoint::new(0.0, 4.0), WorldPoint::new(3.0, 4.0));
    let (wall, outside) = (WorldPoint::new(1.55, 4.0), WorldPoint::new(-1.01, 4.0));
    let nan = WorldPoint::new(f64::NAN, 0.0);
    let mut plan = |a, b| planner.plan(a, b, &mut Unlimited).map(|_| ());
    assert_eq!(plan(wall, left), Err(Refusal::StartInObstacle));
    assert_eq!(plan(left, wall), Err(Refusal::GoalInObstacle));
    assert_eq!(plan(outside, left), Err(Refusal::StartOutsideMap));
    assert_eq!(plan(left, outside), Err(Refusal::GoalOutsideMap));
    assert_eq!(plan(left, right), Err(Refusal::NoWay));
    assert_eq!(plan(nan, right), Err(Refusal::NotFinite));
    assert_eq!(plan(left, left), Ok(()));
    let mut walled =
        Planner::new(ClearanceField::new(&map), PlannerParams { border: Border::Wall, ..params });
    let edge = WorldPoint::new(-0.95, 4.0);
    assert_eq!(walled.plan(edge, left, &mut Unlimited), Err(Refusal::StartOutsideMap));
    assert!(walled.plan(left, WorldPoint::new(0.5, 2.5), &mut Unlimited).is_ok());
}

/// Senseless parameters are answered, not obeyed.
#[test]
fn odd_parameters() {
    let map = open_map();
    let (a, b) = (WorldPoint::new(-0.5, 2.5), WorldPoint::new(1.0, 6.5));
    for radius_m in [f64::NAN, -1.0, 0.0] {
        for spacing_m in [f64::NAN, 0.0, -1.0, f64::INFINITY, 1e-300] {
            let params = PlannerParams {
                radius_m,
                spacing_m,
                samples: 0,
                batch: 0,
                neighbours: 0,
                ..Default::default()
            };
            let plan = Planner::new(ClearanceField::new(&map), params).plan(a, b, &mut Unlimited).unwrap();
            assert!((2..=65_536).contains(&plan.waypoints.len()));
        }
    }
    for radius_m in [f64::INFINITY, 1e300] {
        let params = PlannerParams { radius_m, ..Default::default() };
        let mut planner = Planner::new(ClearanceField::new(&map), params);
        assert_eq!(planner.plan(a, b, &mut Unlimited), Err(Refusal::StartInObstacle));
    }
}

/// A budget that ends after so many questions.
struct Questions(u32);

impl Budget for Questions {
    fn exhausted(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 == 0
    }
}

#[test]
fn an_empty_budget_is_out_of_time_and_does_not_spoil_the_next_query() {
    let mut random = Random(5);
    let (width, cells) = maze(20, &mut random);
    let map = map_of(width, cells);
    let field = std::sync::Arc::new(ClearanceField::new(&map));
    let params = PlannerParams { radius_m: 0.04, spacing_m: 0.1, ..Default::default() };
    let (start, goal) = (map.frame().cell_centre(1, 1), map.frame().cell_centre(width - 2, width - 2));
    let mut planner = Planner::new(field, params);
    for questions in 1..40 {
        match planner.plan(start, goal, &mut Questions(questions)) {
            Ok(_) => break,
            Err(refusal) => assert_eq!(refusal, Refusal::OutOfTime),
        }
    }
    let plan = planner.plan(start, goal, &mut Unlimited).unwrap();
    Oracle::new(&map).judge(&plan, start, goal, 0.04);
}

fn bits(plan: &Plan) -> Vec<u64> {
    let points = plan.waypoints.iter().flat_map(|p| [p.x_m.to_bits(), p.y_m.to_bits()]);
    points.chain([plan.length_m.to_bits(), plan.clearance_min_m.to_bits()]).collect()
}

/// Same seed, same bits: fresh planners, reset planners, and planners on several threads at once.
#[test]
fn same_seed_same_bits() {
    let mut random = Random(11);
    let cells: Vec<u8> = (0..200 * 200).map(|_| if random.unit() < 0.05 { 100 } else { 0 }).collect();
    let map = map_of(200, cells);
    let field = std::sync::Arc::new(ClearanceField::new(&map));
    let oracle = Oracle::new(&map);
    let ends: Vec<_> = (0..12)
        .map(|_| (oracle.random_free(&mut random, 0.12), oracle.random_free(&mut random, 0.12)))
        .collect();
    let run = |planner: &mut Planner| -> Vec<Vec<u64>> {
        let mut plan_bits = |&(a, b): &(WorldPoint, WorldPoint)| {
            planner.plan(a, b, &mut Unlimited).map_or(vec![], |p| bits(&p))
        };
        ends.iter().map(&mut plan_bits).collect()
    };
    let params = PlannerParams { radius_m: 0.12, seed: 3, spacing_m: 0.2, ..Default::default() };
    let mut first = Planner::new(std::sync::Arc::clone(&field), params.clone());
    let expected = run(&mut first);
    assert!(expected.iter().filter(|bits| !bits.is_empty()).count() > 6);
    first.reset(4);
    assert_ne!(run(&mut first), expected, "another seed samples elsewhere");
    first.reset(3);
    assert_eq!(run(&mut first), expected);
    std::thread::scope(|scope| {
        let fresh = || run(&mut Planner::new(std::sync::Arc::clone(&field), params.clone()));
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(fresh)).collect();
        for thread in threads {
            assert_eq!(thread.join().unwrap(), expected);
        }
    });
}
