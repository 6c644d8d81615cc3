//! `hilare compare` of runs that are over.

use super::compare::{CompareArgs, finish, out_dir};
use super::{VerbResult, refused};
use crate::manager::Failure;
use crate::report::PastRun;
use crate::report::differences::{Differences, letter};
use crate::report::overlay::{PEN_COUNT, Run, write_overlay};
use hilare_interfaces::messages::Waypoint;
use std::path::Path;

/// What the pictures are called.
const NAME: &str = "compare";

/// Reads the runs, says how they differ, draws their curves over each other.
pub(super) fn compare_runs(args: &CompareArgs, places: &[&String]) -> VerbResult {
    match places.len() {
        1 => return Err(refused(format!("{}: one run; name another one to compare it with", places[0]))),
        n if n > PEN_COUNT => {
            return Err(refused(format!("{n} runs; {PEN_COUNT} at most can be told apart in a picture")));
        }
        _ => {}
    }
    let shape = (args.shape.format(), args.shape.width_px()?);
    let runs: Vec<PastRun> = places
        .iter()
        .map(|place| PastRun::open(Path::new(place)))
        .collect::<Result<_, _>>()
        .map_err(refused)?;
    let differences = Differences::of(&runs);
    let out = out_dir(args.out.as_deref(), "compare")?;
    let names: Vec<String> = runs.iter().enumerate().map(|(n, run)| name(n, run)).collect();
    let curves: Vec<Run<'_>> =
        runs.iter().zip(&names).map(|(run, name)| Run { name, rows: &run.rows }).collect();
    let mut plans: Vec<&[Waypoint]> = Vec::new();
    for run in &runs {
        if !plans.contains(&&run.waypoints[..]) {
            plans.push(&run.waypoints);
        }
    }
    let mut title: Vec<&str> = runs.iter().map(|run| run.summary.scenario.as_str()).collect();
    title.dedup();
    write_overlay(&out, (NAME, &title.join(", ")), &plans, &curves, shape)
        .map_err(|error| Failure::Fault(error.to_string()))?;
    let mut text = differences.text();
    for lacking in runs.iter().flat_map(|run| &run.lacking) {
        text.push_str(&format!("{lacking}\n"));
    }
    finish(args, &out, &differences, &text)
}

/// A letter and what the run's directory is called.
fn name(n: usize, run: &PastRun) -> String {
    let place = std::path::absolute(&run.place).unwrap_or_else(|_| run.place.clone());
    format!("{}: {}", letter(n), place.file_name().unwrap_or_default().to_string_lossy())
}
