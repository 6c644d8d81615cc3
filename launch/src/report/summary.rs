//! `summary.json`: the figures of a run, keys and order fixed by the design.

use super::{Correction, make_dir};
use crate::recording;
use crate::whole::write_whole;
use hilare_interfaces::latency::Quantiles;
use hilare_recorder::statistics::RunFigures;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// What ran.
#[derive(Clone, Copy, Debug)]
pub struct RunIdentity<'a> {
    /// Name of the scenario.
    pub scenario: &'a str,
    /// What drove: laws, and programs by their files' names; `kanayama, then qp` after a swap.
    pub controller: &'a str,
    /// `real`, `lockstep` or `in-process`.
    pub clock: &'a str,
}

/// What launch counted while it ran.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Controllers swapped while driving.
    pub swaps: u64,
    /// Processes started again.
    pub restarts: u64,
}

/// A pose in `summary.json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SummaryPose {
    /// World x, m.
    pub x_m: f64,
    /// World y, m.
    pub y_m: f64,
    /// Heading, rad, not wrapped.
    pub theta_rad: f64,
}

impl From<[f64; 3]> for SummaryPose {
    fn from([x_m, y_m, theta_rad]: [f64; 3]) -> Self {
        Self { x_m, y_m, theta_rad }
    }
}

/// Lateness of the tick's wake-up, µs, untrimmed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatenessUs {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p99_9: f64,
    /// Largest.
    pub max: f64,
}

/// `summary.json`. Its fields are written in the order they stand here.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Name of the scenario.
    pub scenario: String,
    /// What drove: laws, and programs by their files' names; `kanayama, then qp` after a swap.
    pub controller: String,
    /// `real`, `lockstep` or `in-process`.
    pub clock: String,
    /// The last waypoint was accepted.
    pub reached: bool,
    /// Ticks executed until then, or in all.
    pub ticks: u64,
    /// The same in seconds.
    pub duration_s: f64,
    /// Mean distance of the truth to the tracked line, m.
    pub cross_track_mean_m: f64,
    /// Greatest such distance, m.
    pub cross_track_max_m: f64,
    /// Mean |v − v_r| of the commanded speed after the constraints, m/s.
    pub speed_error_mean_mps: f64,
    /// Mean |v − v_r| of the truth's speed over 0.1 s, m/s.
    pub speed_error_truth_mean_mps: f64,
    /// Steps of each wheel the chassis has, right first.
    pub steps: Vec<i64>,
    /// Estimated pose at the end.
    pub final_pose: SummaryPose,
    /// True pose at the end.
    pub final_truth: SummaryPose,
    /// Wake-ups a tick or more late.
    pub ticks_late: u64,
    /// Whole ticks lost to such pauses.
    pub paused_ticks: u64,
    /// Longest single pause, ticks.
    pub paused_max_ticks: u64,
    /// Commands that came after their effective tick.
    pub commands_late: u64,
    /// Commands refused.
    pub commands_rejected: u64,
    /// Control cycles that had no command of their own.
    pub cycles_without_command: u64,
    /// Controllers swapped while driving.
    pub swaps: u64,
    /// Processes started again.
    pub restarts: u64,
    /// Lateness of the tick's wake-up.
    pub lateness_us: LatenessUs,
    /// Hash of every bit of the estimated pose over all ticks, 16 lower-case hexadecimal digits: a
    /// JSON number would lose bits in most readers.
    pub state_hash: String,
    /// Least distance between the true robot's rim and an obstacle of the map, m; only on a map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clearance_min_m: Option<f64>,
    /// How the deviation at the start was corrected; only where the scenario asks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<Correction>,
    /// What its recording came to; only where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingSummary>,
}

/// A recording in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingSummary {
    /// Its files, in the run's directory, in order.
    pub files: Vec<String>,
    /// Messages in them.
    pub messages: u64,
    /// Bytes of them.
    pub bytes: u64,
    /// Messages that were sent and never came.
    pub gaps: u64,
    /// Messages that came and were not written.
    pub dropped: u64,
    /// Everything that was sent is in the files.
    pub complete: bool,
    /// If not, why.
    pub why: String,
}

impl From<&recording::Report> for RecordingSummary {
    fn from(report: &recording::Report) -> Self {
        let recording::Report { files, messages, bytes, gaps, dropped, complete, why, wires: _ } = report;
        let (messages, bytes, gaps, dropped) = (*messages, *bytes, *gaps, *dropped);
        Self { files: files.clone(), messages, bytes, gaps, dropped, complete: *complete, why: why.clone() }
    }
}

impl Summary {
    /// The summary of a run on a chassis with `wheels` wheels (at most 4).
    pub fn new(
        identity: RunIdentity<'_>,
        figures: &RunFigures,
        wheels: usize,
        counters: Counters,
        lateness: Quantiles,
    ) -> Self {
        Self {
            scenario: identity.scenario.to_owned(),
            controller: identity.controller.to_owned(),
            clock: identity.clock.to_owned(),
            reached: figures.reached,
            ticks: figures.ticks,
            // A division, not a product with 0.001, so that 34125 ticks read 34.125.
            duration_s: figures.ticks as f64 / 1000.0,
            cross_track_mean_m: figures.cross_track_mean_m,
            cross_track_max_m: figures.cross_track_max_m,
            speed_error_mean_mps: figures.speed_error_mean_mps,
            speed_error_truth_mean_mps: figures.speed_error_truth_mean_mps,
            steps: figures.steps[..wheels.min(figures.steps.len())].to_vec(),
            final_pose: figures.final_pose.into(),
            final_truth: figures.final_truth.into(),
            ticks_late: figures.ticks_late,
            paused_ticks: figures.paused_ticks,
            paused_max_ticks: figures.paused_max_ticks,
            commands_late: figures.commands_late,
            commands_rejected: figures.commands_rejected,
            cycles_without_command: figures.cycles_without_command,
            swaps: counters.swaps,
            restarts: counters.restarts,
            lateness_us: LatenessUs {
                p50: lateness.p50_us,
                p99: lateness.p99_us,
                p99_9: lateness.p99_9_us,
                max: lateness.max_us,
            },
            state_hash: format!("{:016x}", figures.state_hash),
            clearance_min_m: None,
            correction: None,
            recording: None,
        }
    }

    /// The text of `summary.json`, indented, ending in a newline.
    pub fn to_json(&self) -> String {
        let mut json = serde_json::to_string_pretty(self).expect("a struct of numbers and strings");
        json.push('\n');
        json
    }

    /// Writes `summary.json` into `dir` at one stroke and returns its path; `dir` is made if need
    /// be. An error is one line that names the path and the system's reason.
    pub fn write(&self, dir: &Path) -> io::Result<PathBuf> {
        make_dir(dir)?;
        let path = dir.join("summary.json");
        write_whole(&path, self.to_json().as_bytes())?;
        Ok(path)
    }
}
