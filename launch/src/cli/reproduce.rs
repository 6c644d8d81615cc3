//! `hilare reproduce`: the papers' figures and tables beside ours.

use super::compare::out_dir;
use super::{VerbResult, print, refused};
use crate::manager::Failure;
use crate::reproduce::{Reproduction, report};
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

/// Options of `hilare reproduce`.
#[derive(Args)]
pub struct ReproduceArgs {
    /// Papers: 1, 2, 3 [default: all]
    #[arg(value_name = "PAPER", value_parser = clap::value_parser!(u64).range(1..=3))]
    papers: Vec<u64>,
    /// Runs of each disturbed job, with the seeds 1 to N; two at least
    #[arg(long, value_name = "N", default_value_t = 50, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(2..=10_000))]
    seeds: u64,
    /// Directory for reproduction.md, reproduction.json and images/ [default: runs/reproduce-N]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print reproduction.json instead of the tables
    #[arg(long)]
    json: bool,
}

/// Drives what the papers drove, in one thread each and virtual time.
pub fn reproduce(args: &ReproduceArgs) -> VerbResult {
    let papers: Vec<u64> = (1..=3).filter(|n| args.papers.is_empty() || args.papers.contains(n)).collect();
    if args.papers.len() > papers.len() {
        return Err(refused("a paper is named twice; name each once"));
    }
    let out = out_dir(args.out.as_deref(), "reproduce")?;
    let reproduction = Reproduction::of(&papers, args.seeds)?;
    report::write(&out, &reproduction).map_err(|error| Failure::Fault(error.to_string()))?;
    if args.json {
        print(&report::json(&reproduction).map_err(|error| Failure::Fault(error.to_string()))?);
    } else {
        print(&report::text(&reproduction));
        print(&format!("Report: {}\n", out.display()));
    }
    Ok(ExitCode::SUCCESS)
}
