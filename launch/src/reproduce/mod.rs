//! The three papers again: every table and every simulated figure, what is printed beside what comes out here.
//!
//! * [`published`]: what the papers print, with pages.
//! * [`rows`]: a printed value, ours, the difference, and why.
//! * `runs`: the drives behind them.
//! * `paper1`, `paper2`, `paper3`: a paper each.
//! * [`report`]: Markdown, JSON and pictures.
//!
//! Nothing in it depends on the machine: no date, no time taken, no order of threads.

mod paper1;
mod paper2;
mod paper3;
pub mod published;
pub mod report;
pub mod rows;
mod runs;

use crate::manager::Failure;
use rows::Row;
use runs::Note;
use serde::Serialize;

/// What the papers come to.
#[derive(Debug, Serialize)]
pub struct Reproduction {
    /// Runs of each disturbed job.
    pub seeds: u64,
    /// The papers asked for.
    pub papers: Vec<Section>,
}

/// A paper.
#[derive(Debug, Serialize)]
pub struct Section {
    /// 1, 2 or 3.
    pub paper: u64,
    /// Authors, title, journal.
    pub source: &'static str,
    /// What is unknown of its set-up, and what is assumed instead; Markdown.
    pub set_up: Vec<String>,
    /// Published values beside ours, in the paper's order.
    pub rows: Vec<Row>,
    /// Its figures, drawn again.
    pub pictures: Vec<Picture>,
    /// The disturbed runs, each of which `hilare run` repeats.
    pub runs: Vec<Note>,
}

/// A figure drawn again.
#[derive(Debug, Serialize)]
pub struct Picture {
    /// "figure 7".
    pub item: &'static str,
    /// Name of its file.
    pub file: String,
    /// What it shows.
    pub caption: String,
    /// The picture.
    #[serde(skip)]
    pub svg: String,
}

impl Reproduction {
    /// Drives what these papers drove; the disturbed jobs with the seeds 1 to `seeds`.
    pub fn of(papers: &[u64], seeds: u64) -> Result<Self, Failure> {
        let section = |paper: &u64| match paper {
            1 => paper1::reproduce(seeds),
            2 => paper2::reproduce(seeds),
            3 => paper3::reproduce(seeds),
            _ => Err(Failure::Refused(format!("there is no paper {paper}; there are 1, 2 and 3"))),
        };
        let papers = papers.iter().map(section).collect::<Result<_, _>>()?;
        Ok(Self { seeds, papers })
    }
}

fn fault(error: impl std::fmt::Display) -> Failure {
    Failure::Fault(error.to_string())
}
