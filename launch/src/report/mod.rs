//! The report of a run: what it came to ([`summary`]), beside what was published ([`verdict`]), its path and
//! its curves ([`pictures`]).

pub(crate) mod canvas;
mod compose;
mod labels;
mod moments;
pub(crate) mod shapes;
pub(crate) mod thin;
mod timeline;

pub mod chart;
pub mod correction;
pub mod curves;
pub mod differences;
pub mod drove;
pub mod overlay;
pub mod pictures;
pub mod plan;
pub mod plots;
pub mod raster;
pub mod source;
pub mod summary;
pub mod verdict;

#[cfg(test)]
mod tests;

pub use correction::{Band, Correction};
pub use pictures::write_plots;
pub use plots::{Mishaps, PlotInput};
pub use source::PastRun;
pub use summary::{Counters, RecordingSummary, RunIdentity, Summary};
pub use verdict::verdict_text;

use crate::whole::write_whole;
use hilare_planner::waypoint_file;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Writes `summary.json`, the plots, `path.csv` and `trace.csv` into `dir`, which is made if need be; the figures
/// first, which matter most when a disk is nearly full. Returns the files written. An error is one line that
/// names the path and the system's reason.
pub fn write_report(
    dir: &Path,
    summary: &Summary,
    plots: &PlotInput<'_>,
    trace_csv: &str,
) -> io::Result<Vec<PathBuf>> {
    let mut written = vec![summary.write(dir)?];
    written.extend(write_plots(dir, plots)?);
    written.push(write_file(dir, "path.csv", &waypoint_file::write(plots.waypoints))?);
    written.push(write_file(dir, "trace.csv", trace_csv)?);
    Ok(written)
}

/// Writes a file of a report whole or not at all.
pub fn write_file(dir: &Path, name: &str, text: &str) -> io::Result<PathBuf> {
    let path = dir.join(name);
    write_whole(&path, text.as_bytes())?;
    Ok(path)
}

/// Makes `dir` and what leads to it.
pub(crate) fn make_dir(dir: &Path) -> io::Result<()> {
    fs::create_dir_all(dir).map_err(|error| {
        let (dir, kind) = (dir.display(), error.kind());
        io::Error::new(kind, format!("cannot make the directory {dir}: {error}; choose another with --out"))
    })
}
