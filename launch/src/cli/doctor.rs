//! `hilare doctor`: what this machine allows, each finding with its cure.

use super::{VerbResult, print};
use crate::doctor::{Verdict, findings};
use clap::Args;
use std::process::ExitCode;

/// Options of `hilare doctor`.
#[derive(Args)]
pub struct DoctorArgs {
    /// Answer in JSON
    #[arg(long)]
    json: bool,
}

/// Runs every check.
pub fn doctor(args: &DoctorArgs) -> VerbResult {
    let findings = findings();
    if args.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&findings).unwrap_or_default()));
    } else {
        for finding in &findings {
            let mark = match finding.verdict {
                Verdict::Good => "ok  ",
                Verdict::Warning => "warn",
                Verdict::Bad => "BAD ",
                Verdict::Unknown => "?   ",
            };
            print(&format!("{mark}  {:<14} {}\n", finding.check, finding.found));
            if !finding.cure.is_empty() {
                print(&format!("      {:<14} cure: {}\n", "", finding.cure));
            }
        }
    }
    let bad = findings.iter().any(|finding| finding.verdict == Verdict::Bad);
    Ok(if bad { ExitCode::from(1) } else { ExitCode::SUCCESS })
}
