//! A run that is over, read back to be drawn and compared, from what `hilare run` has written.

mod directory;
mod recording;

use super::{Mishaps, PlotInput, Summary};
use crate::config::Scenario;
use crate::recording::{RECORDING_FILE, Recording};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::Waypoint;
use hilare_planner::Map;
use hilare_recorder::trace::TraceRow;
use std::path::{Path, PathBuf};

/// What a run leaves in its directory, without which it is read from its recording.
const REPORT: [&str; 3] = ["summary.json", "system.toml", "trace.csv"];

/// What a recording's name ends in.
const RECORDING: &str = "mcap";

/// Paths that were driven after the first, and from which tick on the reference speed was which.
pub type Changes = (Vec<Vec<Waypoint>>, Vec<(u64, f64)>);

/// A run that is over.
#[derive(Clone, Debug)]
pub struct PastRun {
    /// Where it was read.
    pub place: PathBuf,
    /// What it came to.
    pub summary: Summary,
    /// It is a recording alone: what launch counts (restarts, swaps, lateness) is not known.
    pub is_recording: bool,
    /// Its path; empty where that is not known.
    pub waypoints: Vec<Waypoint>,
    /// Paths that were driven after it, in order.
    pub later_paths: Vec<Vec<Waypoint>>,
    /// Acceptance radius of a waypoint, m.
    pub acceptance_radius_m: f64,
    /// Reference speed, m/s.
    pub reference_speed_mps: f64,
    /// From which tick on it was which, where every tick was recorded; else empty.
    pub reference_speeds: Vec<(u64, f64)>,
    /// The map driven on.
    pub map: Option<Map>,
    /// Its curves, oldest first.
    pub rows: Vec<TraceRow>,
    /// Every tick and its estimated pose, oldest first; empty where only the curves were kept.
    pub poses: Vec<(u64, WorldPose)>,
    /// What went amiss; empty where not every tick was recorded.
    pub mishaps: Vec<Mishaps>,
    /// The system file, resolved; empty where that is not known.
    pub system: String,
    /// What lacks, for people, a line each.
    pub lacking: Vec<String>,
}

impl PastRun {
    /// Reads a run's directory or a recording. An error is one line that says where, what and what to do.
    pub fn open(place: &Path) -> Result<Self, String> {
        let shown = place.display();
        let wanted = "a run's directory, as hilare run --out DIR makes it, or a recording (.mcap)";
        if place.is_dir() {
            let recorded = place.join(RECORDING_FILE);
            let lost = REPORT.iter().find(|file| !place.join(file).exists());
            match lost {
                // What is in the directory of a run that never finished.
                Some(lost) if recorded.exists() => recording::open(&recorded).map(|mut run| {
                    run.lacking.push(format!("{shown}: no {lost} in it; read from {RECORDING_FILE}"));
                    run
                }),
                _ => directory::open(place),
            }
        } else if place.extension().is_some_and(|extension| extension == RECORDING) {
            recording::open(place)
        } else if place.exists() {
            Err(format!("{shown}: not a run; {wanted}, is wanted"))
        } else {
            Err(format!("{shown}: no such run; name {wanted}"))
        }
    }

    /// True if an argument names a run, not a scenario: it is a directory, or a recording by its name. What is built
    /// in comes first, wherever the directory `so` may lie.
    pub fn is_named_by(argument: &str) -> bool {
        if Scenario::builtin_names().any(|name| name == argument) {
            return false;
        }
        let path = Path::new(argument);
        path.extension().is_some_and(|extension| extension == RECORDING) || path.is_dir()
    }

    /// Paths and reference speeds of a recording, for the pictures of the run it is of; `None` if it cannot be read.
    pub fn changes(recording: &Path) -> Option<Changes> {
        let read = Recording::open(recording).ok()?;
        recording::ticks(&read).ok().map(|mut ticks| (ticks.later_paths(), ticks.speeds))
    }

    /// What ran, for the titles of pictures.
    pub fn title(&self) -> String {
        title(&self.summary.scenario, &self.summary.controller, &self.summary.clock)
    }

    /// What is drawn of it.
    pub fn plot_input<'a>(&'a self, title: &'a str) -> PlotInput<'a> {
        PlotInput {
            title,
            waypoints: &self.waypoints,
            later_paths: &self.later_paths,
            acceptance_radius_m: self.acceptance_radius_m,
            reference_speed_mps: self.reference_speed_mps,
            reference_speeds: &self.reference_speeds,
            rows: &self.rows,
            map: self.map.as_ref(),
            mishaps: &self.mishaps,
        }
    }

    /// Ticks and estimated poses, as many as are known, oldest first.
    pub fn poses(&self) -> impl Iterator<Item = (u64, WorldPose)> + '_ {
        // Of one of them there is nothing.
        let rows = if self.poses.is_empty() { &self.rows[..] } else { &[] };
        self.poses.iter().copied().chain(rows.iter().map(|row| (row.tick, row.pose)))
    }
}

/// What ran, for the titles of pictures.
pub fn title(scenario: &str, law: &str, clock: &str) -> String {
    format!("{scenario}, {law}, {clock} clock")
}

#[cfg(test)]
mod tests;
