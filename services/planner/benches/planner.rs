//! CPU times of the planner on one core, as JSON lines; `benches/ompl/run` sets OMPL's beside them.
//!
//! `planner platform FILE SEEDS [EXPORT]` plans the file's own job with a fresh roadmap a seed.
//! `planner map FILE RADIUS_M QUERIES [EXPORT]` plans random solvable queries on one kept roadmap.
//! `planner deadline FILE RADIUS_M QUERIES` gives each query a fresh roadmap and a random deadline below
//! 20 ms of CPU time, and tells by how much it is overrun.
//! `planner generate DIR` writes two megapixel maps, `warehouse.yaml` and `offices.yaml`.
//! EXPORT writes the problem (field, radius, queries) for the OMPL driver.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have files, clocks, output and an environment"
)]

use hilare_planner::{
    ClearanceField, Deadline, LoadOptions, Map, Plan, Planner, PlannerParams, Refusal, WorldPoint,
};
use rustix::time::{ClockId, clock_gettime};
use std::fmt::Write as _;
use std::sync::Arc;

/// CPU time of this process, nanoseconds.
fn cpu_ns() -> u64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as u64 * 1_000_000_000 + t.tv_nsec as u64
}

fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}

fn summary(name: &str, values: &mut [f64]) -> String {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let mut text = format!("\"{name}_mean\": {mean:.2}");
    for (label, share) in [("p50", 0.5), ("p99", 0.99), ("max", 1.0)] {
        let _ = write!(text, ", \"{name}_{label}\": {:.2}", percentile(values, share));
    }
    text
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["platform", file, seeds, ref export @ ..] => {
            platform(file, number(seeds) as u64, export.first().copied());
        }
        ["map", file, radius, queries, ref export @ ..] => {
            repeated(file, number(radius), number(queries) as usize, export.first().copied());
        }
        ["generate", dir] => generate(dir),
        ["deadline", file, radius, queries] => deadline(file, number(radius), number(queries) as usize),
        _ => eprintln!(
            "usage: planner platform FILE SEEDS [EXPORT] | planner map FILE RADIUS_M QUERIES [EXPORT] | planner generate DIR"
        ),
    }
}

fn number(text: &str) -> f64 {
    text.parse().unwrap_or_else(|_| panic!("not a number: {text}"))
}

fn load(file: &str) -> (Map, Arc<ClearanceField>, f64, f64) {
    let t0 = cpu_ns();
    let map = Map::load(file, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let t1 = cpu_ns();
    let mut field = ClearanceField::new(&map);
    let mut field_us = f64::INFINITY;
    for _ in 0..11 {
        let t = cpu_ns();
        field = ClearanceField::new(&map);
        field_us = field_us.min((cpu_ns() - t) as f64 * 1e-3);
    }
    (map, Arc::new(field), (t1 - t0) as f64 * 1e-3, field_us)
}

fn platform(file: &str, seeds: u64, export: Option<&str>) {
    let (map, field, load_us, field_us) = load(file);
    let job = map.job().expect("the file names a job").clone();
    let (start, goal) = (job.start.expect("start"), job.goal.expect("goal"));
    let radius_m = job.robot_radius_m.expect("radius");
    if let Some(export) = export {
        write_problem(export, &field, radius_m, &[(start, goal)]);
    }
    let params = PlannerParams { radius_m, ..PlannerParams::default() };
    let mut planner = Planner::new(Arc::clone(&field), params);
    let (mut first, mut smoothing, mut all) = (Vec::new(), Vec::new(), Vec::new());
    let (mut raw, mut length, mut quick) = (Vec::new(), Vec::new(), Vec::new());
    let (mut waypoints, mut solved) = (Vec::new(), 0);
    let mut plan = Plan::default();
    for seed in 0..seeds {
        // once without improvement, for the first solution and its smoothing
        planner.reset(seed);
        let mut once = FirstOnly { stamps: 0 };
        if planner.plan_into(start, goal, &mut once, &mut plan).is_ok() {
            first.push(plan.times.first_solution_ns as f64 * 1e-3);
            smoothing.push(plan.times.smoothing_ns as f64 * 1e-3);
            raw.push(plan.first_length_m * 1e3);
            quick.push(plan.length_m * 1e3);
        }
        // once to the full number of samples
        planner.reset(seed);
        let began = cpu_ns();
        if planner.plan_into(start, goal, &mut Deadline::new(cpu_ns, u64::MAX), &mut plan).is_ok() {
            solved += 1;
            all.push((cpu_ns() - began) as f64 * 1e-3);
            length.push(plan.length_m * 1e3);
            waypoints.push(plan.waypoints.len() as f64);
        }
    }
    println!(
        "{{\"side\": \"hilare\", \"map\": \"{file}\", \"solved\": {solved}, \"seeds\": {seeds}, \"load_us\": {load_us:.1}, \"field_us\": {field_us:.1}, {}, {}, {}, {}, {}, {}, {}}}",
        summary("first_us", &mut first),
        summary("smoothing_us", &mut smoothing),
        summary("full_us", &mut all),
        summary("first_raw_mm", &mut raw),
        summary("first_smoothed_mm", &mut quick),
        summary("length_mm", &mut length),
        summary("waypoints", &mut waypoints),
    );
}

/// Ends the improvement before it begins, and tells CPU time: the planner takes its third time stamp
/// when the first way is smooth and its fourth before it improves.
struct FirstOnly {
    stamps: u32,
}

impl hilare_planner::Budget for FirstOnly {
    fn exhausted(&mut self) -> bool {
        self.stamps >= 4
    }
    fn now_ns(&mut self) -> u64 {
        self.stamps += 1;
        cpu_ns()
    }
}

fn deadline(file: &str, radius_m: f64, queries: usize) {
    let (_, field, ..) = load(file);
    let params = PlannerParams { radius_m, spacing_m: 0.25, ..PlannerParams::default() };
    let mut planner = Planner::new(Arc::clone(&field), params);
    let mut random = random_numbers();
    let (mut over, mut solved, mut late) = (Vec::new(), 0, 0);
    for seed in 0..queries {
        let ends = [(); 2].map(|()| free_point(&field, radius_m, &mut random));
        planner.reset(seed as u64);
        let end = cpu_ns() + (random() * 20e6) as u64;
        match planner.plan(ends[0], ends[1], &mut Deadline::new(cpu_ns, end)) {
            Ok(_) => solved += 1,
            Err(Refusal::OutOfTime) => late += 1,
            Err(_) => {}
        }
        over.push((cpu_ns() as f64 - end as f64) * 1e-3);
    }
    let overrun = summary("overrun_us", &mut over);
    println!("{{\"map\": \"{file}\", \"solved\": {solved}, \"out_of_time\": {late}, {overrun}}}");
}

fn random_numbers() -> impl FnMut() -> f64 {
    let mut state = 1u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A random point where the robot fits, at the point itself and at its cell's centre: the other side looks
/// at the nearest centre only and shall find the ends free as well.
fn free_point(field: &ClearanceField, radius_m: f64, random: &mut impl FnMut() -> f64) -> WorldPoint {
    let (frame, extent) = (field.frame(), field.frame().extent_m());
    let origin = frame.origin();
    loop {
        let p = WorldPoint::new(origin.x_m + random() * extent.0, origin.y_m + random() * extent.1);
        let cell = |v: f64, from: f64| ((v - from) / frame.resolution_m()) as usize;
        let centre = frame.cell_centre(cell(p.x_m, origin.x_m), cell(p.y_m, origin.y_m));
        if [p, centre].iter().all(|&q| field.clearance_m(q).is_some_and(|c| c > radius_m * 1.001)) {
            return p;
        }
    }
}

fn repeated(file: &str, radius_m: f64, queries: usize, export: Option<&str>) {
    let (_, field, load_us, field_us) = load(file);
    let params = PlannerParams { radius_m, spacing_m: 0.25, ..PlannerParams::default() };
    let mut planner = Planner::new(Arc::clone(&field), params);
    let mut random = random_numbers();
    let mut point = || free_point(&field, radius_m, &mut random);
    let mut solvable = Vec::new();
    let (mut no_way, mut first_pass) = (0, Vec::new());
    let mut plan = Plan::default();
    while solvable.len() < queries && no_way < queries * 20 {
        let (start, goal) = (point(), point());
        let began = cpu_ns();
        match planner.plan_into(start, goal, &mut Deadline::new(cpu_ns, u64::MAX), &mut plan) {
            Ok(()) => {
                first_pass.push((cpu_ns() - began) as f64 * 1e-3);
                solvable.push((start, goal));
            }
            Err(Refusal::NoWay) => no_way += 1,
            Err(other) => panic!("{start:?} {goal:?}: {other}"),
        }
    }
    if let Some(export) = export {
        write_problem(export, &field, radius_m, &solvable);
    }
    let (mut total, mut search, mut smoothing) = (Vec::new(), Vec::new(), Vec::new());
    let mut lengths = String::new();
    let mut methods = std::collections::BTreeMap::new();
    for &(start, goal) in &solvable {
        let began = cpu_ns();
        planner
            .plan_into(start, goal, &mut Deadline::new(cpu_ns, u64::MAX), &mut plan)
            .expect("solved before");
        total.push((cpu_ns() - began) as f64 * 1e-3);
        search.push(plan.times.first_solution_ns as f64 * 1e-3);
        smoothing.push(plan.times.smoothing_ns as f64 * 1e-3);
        *methods.entry(plan.method.name()).or_insert(0) += 1;
        let _ = write!(lengths, "{}{:.4}", if lengths.is_empty() { "" } else { ", " }, plan.length_m);
    }
    let cells = field.frame().width_cells() * field.frame().height_cells();
    println!(
        "{{\"side\": \"hilare\", \"map\": \"{file}\", \"cells\": {cells}, \"radius_m\": {radius_m}, \"solved\": {}, \"no_way\": {no_way}, \"methods\": {methods:?}, \"load_us\": {load_us:.1}, \"field_us\": {field_us:.1}, \"field_ns_per_cell\": {:.2}, {}, {}, {}, {}, \"lengths_m\": [{lengths}]}}",
        solvable.len(),
        field_us * 1e3 / cells as f64,
        summary("first_pass_us", &mut first_pass),
        summary("query_us", &mut total),
        summary("search_us", &mut search),
        summary("smoothing_us", &mut smoothing),
    );
}

/// One text line a number group, then the field as little-endian f32 distances in metres at the centres.
fn write_problem(path: &str, field: &ClearanceField, radius_m: f64, queries: &[(WorldPoint, WorldPoint)]) {
    let frame = field.frame();
    let mut text = String::new();
    let (width, height) = (frame.width_cells(), frame.height_cells());
    let _ = writeln!(
        text,
        "{width} {height} {} {} {}",
        frame.resolution_m(),
        frame.origin().x_m,
        frame.origin().y_m
    );
    let _ = writeln!(text, "{radius_m} {}", queries.len());
    for (a, b) in queries {
        let _ = writeln!(text, "{} {} {} {}", a.x_m, a.y_m, b.x_m, b.y_m);
    }
    let mut bytes = text.into_bytes();
    for row in 0..height {
        for column in 0..width {
            let clearance = field.clearance_m(frame.cell_centre(column, row)).unwrap_or(0.0) as f32;
            bytes.extend(clearance.to_le_bytes());
        }
    }
    std::fs::write(path, bytes).expect("the export can be written");
}

/// Maps of 1024 x 1024 cells of 5 cm: shelves in rows with cross aisles and pallets left about, and rooms of
/// 64 cells with doors of 20.
fn generate(dir: &str) {
    const SIDE: usize = 1024;
    let mut state = 42u64;
    let mut random = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    let mut warehouse = vec![254u8; SIDE * SIDE];
    let mut offices = warehouse.clone();
    let fill = |map: &mut [u8], x: usize, y: usize, w: usize, h: usize, value: u8| {
        for row in y..(y + h).min(SIDE) {
            map[row * SIDE + x..row * SIDE + (x + w).min(SIDE)].fill(value);
        }
    };
    for map in [&mut warehouse, &mut offices] {
        for (x, y, w, h) in [(0, 0, SIDE, 2), (0, SIDE - 2, SIDE, 2), (0, 0, 2, SIDE), (SIDE - 2, 0, 2, SIDE)]
        {
            fill(map, x, y, w, h, 0);
        }
    }
    for x in (60..SIDE - 60).step_by(64) {
        for y in (60..SIDE - 200).step_by(240) {
            fill(&mut warehouse, x, y, 22, 190, 0);
        }
    }
    for _ in 0..120 {
        let (x, y) = (random(SIDE - 40) + 10, random(SIDE - 40) + 10);
        fill(&mut warehouse, x, y, 6 + random(18), 6 + random(12), 0);
    }
    for at in (64..SIDE).step_by(64) {
        fill(&mut offices, at, 0, 3, SIDE, 0);
        fill(&mut offices, 0, at, SIDE, 3, 0);
    }
    for a in (64..SIDE).step_by(64) {
        for b in (0..SIDE).step_by(64) {
            let (across, along) = (b + 6 + random(36), b + 6 + random(36));
            fill(&mut offices, a, across, 3, 20, 254);
            fill(&mut offices, along, a, 20, 3, 254);
        }
    }
    for (name, map) in [("warehouse", warehouse), ("offices", offices)] {
        let yaml = format!("image: {name}.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n");
        let mut image = format!("P5\n{SIDE} {SIDE}\n255\n").into_bytes();
        image.extend(map);
        std::fs::write(format!("{dir}/{name}.yaml"), yaml).expect("the folder can be written");
        std::fs::write(format!("{dir}/{name}.pgm"), image).expect("the folder can be written");
    }
}
