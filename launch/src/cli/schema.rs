//! `hilare schema`: the keys of system and scenario files, for editors and for people.

use super::{VerbResult, print, refused};
use crate::config::{manual, scenario_schema, system_schema};
use crate::report::write_file;
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Options of `hilare schema`.
#[derive(Args)]
pub struct SchemaArgs {
    /// Of scenario files instead of system files
    #[arg(long)]
    scenario: bool,
    /// Both as a page for people (docs/configuration.md)
    #[arg(long, conflicts_with = "scenario")]
    markdown: bool,
    /// Write to a file instead of standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Prints or writes it.
pub fn schema(args: &SchemaArgs) -> VerbResult {
    let text = if args.markdown {
        manual()
    } else {
        let schema = if args.scenario { scenario_schema() } else { system_schema() };
        format!("{}\n", serde_json::to_string_pretty(&schema).unwrap_or_default())
    };
    match &args.out {
        None => {
            print(&text);
        }
        Some(file) => {
            let name = file.file_name().and_then(|name| name.to_str());
            let name =
                name.ok_or_else(|| refused(format!("--out {}: not the name of a file", file.display())))?;
            write_file(file.parent().unwrap_or(Path::new("")), name, &text)
                .map_err(|error| refused(format!("--out: {error}")))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
