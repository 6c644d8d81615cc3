//! `hilare plan`: a path on a map, without a robot.

use super::{VerbResult, print, refused};
use crate::manager::Failure;
use crate::report::plan::plan_svg;
use clap::Args;
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::Waypoint;
use hilare_planner::{ClearanceField, Deadline, Map, Plan, Planner, PlannerSettings, Refusal, waypoint_file};
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

/// Options of `hilare plan`.
#[derive(Args)]
pub struct PlanArgs {
    /// Map: ROS .yaml, Moving AI .map, obstacles .json or .toml (boxes, discs, polygons), discs .csv (x,y,radius)
    #[arg(long, value_name = "FILE")]
    map: PathBuf,
    /// Start, metres [default: the map's own, where it has one]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    start: Option<String>,
    /// Goal, metres [default: the map's own, where it has one]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    goal: Option<String>,
    /// Radius kept free about the robot's midpoint, metres [default: the map's own, or 0.037]
    #[arg(long, value_name = "R")]
    radius: Option<f64>,
    /// Mean distance of the waypoints, metres; 0 for the corners alone
    #[arg(long, value_name = "D", default_value_t = PlannerSettings::default().spacing_m)]
    spacing: f64,
    /// Seed of the samples; the same seed gives the same path
    #[arg(long, value_name = "N", default_value_t = PlannerSettings::default().seed)]
    seed: u64,
    /// Samples the roadmap grows to
    #[arg(long, value_name = "N", default_value_t = PlannerSettings::default().samples)]
    samples: u64,
    /// Time the plan may take, CPU milliseconds [default: until all samples are used]
    #[arg(long, value_name = "D")]
    deadline_ms: Option<u64>,
    /// Unknown space is free instead of blocked
    #[arg(long)]
    unknown_free: bool,
    /// Write the waypoints (.csv) or the picture (.svg) here (repeatable)
    #[arg(long, value_name = "FILE.csv|.svg")]
    out: Vec<PathBuf>,
    /// Answer in JSON
    #[arg(long)]
    json: bool,
}

/// CPU time of the preparations, microseconds.
struct Prepared {
    load_us: f64,
    field_us: f64,
}

/// Plans and answers; exit code 1 if there is no path.
pub fn plan(args: &PlanArgs) -> VerbResult {
    for file in &args.out {
        writer(file)?;
    }
    let began = cpu_ns();
    let options = settings(args, 0.0)?.load_options();
    let map = Map::load(&args.map, &options).map_err(refused)?;
    let loaded = cpu_ns();
    let job = map.job().cloned();
    let own = |pick: fn(&hilare_planner::map::MapJob) -> Option<WorldPoint>| job.as_ref().and_then(pick);
    let start = point("--start", args.start.as_deref(), own(|job| job.start))?;
    let goal = point("--goal", args.goal.as_deref(), own(|job| job.goal))?;
    let own_radius = job.as_ref().and_then(|job| job.robot_radius_m);
    let radius_m = args.radius.or(own_radius).unwrap_or(PlannerSettings::default().robot_radius_m);
    let settings = settings(args, radius_m)?;
    let before_field = cpu_ns();
    let field = ClearanceField::new(&map);
    let prepared = Prepared { load_us: us(loaded - began), field_us: us(cpu_ns() - before_field) };
    let mut planner = Planner::new(field, settings.params());
    let limit = args.deadline_ms.map_or(u64::MAX, |ms| cpu_ns().saturating_add(ms.saturating_mul(1_000_000)));
    let planned = planner.plan(start, goal, &mut Deadline::new(cpu_ns, limit));
    if let Ok(plan) = &planned {
        for file in &args.out {
            write(file, &map, &planner, plan)?;
        }
    }
    answer(args, &planned, &prepared)
}

fn settings(args: &PlanArgs, radius_m: f64) -> Result<PlannerSettings, Failure> {
    use hilare_interfaces::params::ParamGroup;
    let mut settings = PlannerSettings { unknown_is_free: args.unknown_free, ..PlannerSettings::default() };
    let values = [
        ("--radius", "robot_radius_m", radius_m),
        ("--spacing", "spacing_m", args.spacing),
        ("--samples", "samples", args.samples as f64),
        ("--seed", "seed", args.seed as f64),
    ];
    for (flag, key, value) in values {
        settings.set(key, value).map_err(|error| refused(format!("{flag} {value}: {error}")))?;
    }
    Ok(settings)
}

fn point(flag: &str, text: Option<&str>, own: Option<WorldPoint>) -> Result<WorldPoint, Failure> {
    let Some(text) = text else {
        return own.ok_or_else(|| refused(format!("{flag} X,Y is wanted: the map has none of its own")));
    };
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([x_m, y_m]) if x_m.is_finite() && y_m.is_finite() => Ok(WorldPoint::new(*x_m, *y_m)),
        _ => Err(refused(format!("{flag} {text}: two finite numbers are wanted, X,Y in metres"))),
    }
}

/// What a file's ending asks for.
enum Writer {
    Waypoints,
    Picture,
}

fn writer(file: &std::path::Path) -> Result<Writer, Failure> {
    match file.extension().and_then(|ending| ending.to_str()) {
        Some("csv") => Ok(Writer::Waypoints),
        Some("svg") => Ok(Writer::Picture),
        _ => Err(refused(format!("--out {}: a file ending in .csv or .svg is wanted", file.display()))),
    }
}

fn write(file: &std::path::Path, map: &Map, planner: &Planner, plan: &Plan) -> Result<(), Failure> {
    let failed = |error: std::io::Error| refused(format!("--out {}: {error}", file.display()));
    let text = match writer(file)? {
        Writer::Waypoints => {
            let waypoints: Vec<Waypoint> =
                plan.waypoints.iter().map(|point| Waypoint::from(*point)).collect();
            waypoint_file::write(&waypoints)
        }
        Writer::Picture => {
            let edges = planner.roadmap_edges().map(|(a, b, _)| (a, b));
            let title = format!("Plan: {:.3} m, {} waypoints", plan.length_m, plan.waypoints.len());
            plan_svg(&title, map, edges, &plan.waypoints).map_err(failed)?
        }
    };
    std::fs::write(file, text).map_err(failed)
}

fn answer(args: &PlanArgs, planned: &Result<Plan, Refusal>, prepared: &Prepared) -> VerbResult {
    if args.json {
        print(&format!(
            "{}\n",
            serde_json::to_string_pretty(&as_json(args, planned, prepared)).unwrap_or_default()
        ));
    }
    match planned {
        Ok(plan) => {
            if !args.json {
                print(&format!(
                    "{:.4} m over {} waypoints, least clearance {:.4} m, found by {} with {} samples\n\
                     cpu: load {:.0} us, field {:.0} us, first solution {:.0} us, smoothing {:.0} us\n",
                    plan.length_m,
                    plan.waypoints.len(),
                    plan.clearance_min_m,
                    plan.method.name(),
                    plan.samples,
                    prepared.load_us,
                    prepared.field_us,
                    us(plan.times.first_solution_ns),
                    us(plan.times.smoothing_ns)
                ));
            }
            Ok(ExitCode::SUCCESS)
        }
        Err(_) if args.json => Ok(ExitCode::from(1)),
        Err(refusal) => Err(Failure::Fault(format!("no path: {refusal}"))),
    }
}

fn as_json(args: &PlanArgs, planned: &Result<Plan, Refusal>, prepared: &Prepared) -> Value {
    let mut answer = match planned {
        Ok(plan) => json!({
            "solved": true,
            "reason": Value::Null,
            "method": plan.method.name(),
            "length_m": plan.length_m,
            // JSON has no infinity; a map without obstacles has no clearance.
            "clearance_min_m": plan.clearance_min_m.is_finite().then_some(plan.clearance_min_m),
            "waypoints": plan.waypoints.iter().map(|point| [point.x_m, point.y_m]).collect::<Vec<_>>(),
            "samples": plan.samples,
        }),
        Err(refusal) => json!({
            "solved": false,
            "reason": refusal.name(),
            "method": Value::Null,
            "length_m": Value::Null,
            "clearance_min_m": Value::Null,
            "waypoints": [],
            "samples": Value::Null,
        }),
    };
    let times = planned.as_ref().map(|plan| plan.times).unwrap_or_default();
    answer["seed"] = json!(args.seed);
    answer["cpu_us"] = json!({
        "load": prepared.load_us,
        "field": prepared.field_us,
        "first_solution": us(times.first_solution_ns),
        "improvement": us(times.improvement_ns),
        "smoothing": us(times.smoothing_ns),
    });
    answer
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

fn cpu_ns() -> u64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}
