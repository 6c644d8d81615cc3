//! `hilare tune --evaluate`: the simulation as an objective for other searches, through a pipe.

use super::job::Job;
use crate::cli::{VerbResult, print, refused};
use crate::manager::Failure;
use std::io::{self, BufRead};
use std::process::ExitCode;

/// The problem on the first line; then for each line of candidates a line of `[violation, objectives ...]`.
pub fn answer(job: &Job, threads: usize) -> VerbResult {
    let space = job.search.space();
    let parameters: Vec<serde_json::Value> = space
        .parameters()
        .iter()
        .map(|one| serde_json::json!({"name": one.name, "low": one.low, "high": one.high, "kind": format!("{:?}", one.kind)}))
        .collect();
    let keys = job.judge.keys();
    let head = serde_json::json!({"parameters": parameters, "objectives": keys, "reference": job.reference});
    print(&format!("{head}\n"));
    for (number, line) in io::stdin().lock().lines().enumerate() {
        let wrong = |what: String| refused(format!("standard input, line {}: {what}", number + 1));
        let line = line.map_err(|error| wrong(error.to_string()))?;
        let candidates: Vec<Vec<f64>> =
            serde_json::from_str(&line).map_err(|error| wrong(error.to_string()))?;
        if candidates.iter().any(|values| space.encode(values).is_none()) {
            return Err(wrong("a candidate is not within the bounds of the parameters".to_owned()));
        }
        let values: Vec<&[f64]> = candidates.iter().map(Vec::as_slice).collect();
        let answers = job.judge.answers(&values, threads).into_iter();
        let answers: Vec<Vec<f64>> = answers.map(|(left, found)| [vec![left], found].concat()).collect();
        let answers = serde_json::to_string(&answers).map_err(|error| Failure::Fault(error.to_string()))?;
        print(&format!("{answers}\n"));
    }
    Ok(ExitCode::SUCCESS)
}
