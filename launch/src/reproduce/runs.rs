//! The drives behind the figures: in one thread each and virtual time, on every core.

use crate::cli::flags::seed_keys;
use crate::cli::run::{Drive, path_of, time_limit};
use crate::config::{Scenario, System};
use crate::manager::Failure;
use crate::report::{Correction, thin};
use crate::shell::in_process::InProcess;
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_interfaces::messages::Waypoint;
use hilare_planner::Map;
use hilare_recorder::statistics::RunFigures;
use hilare_recorder::trace::TraceRow;
use serde::Serialize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Points a trail is thinned to.
const TRAIL: usize = 360;

/// A job with its path.
pub struct Job {
    /// The scenario.
    pub scenario: Scenario,
    /// Its path.
    pub waypoints: Vec<Waypoint>,
    /// Its map.
    pub map: Option<Map>,
}

impl Job {
    /// A built-in scenario with its path, or the planner's.
    pub fn load(name: &str) -> Result<Self, Failure> {
        let refused = |error: crate::config::ConfigError| Failure::Refused(error.to_string());
        let scenario = Scenario::load(name).map_err(refused)?;
        let map = scenario.system.load_map().map_err(refused)?;
        let waypoints = path_of(&scenario, map.as_ref())?;
        Ok(Self { scenario, waypoints, map })
    }

    /// A number of its system file.
    pub fn number(&self, key: &str) -> Result<f64, Failure> {
        let found = self.scenario.system.get(key);
        found.ok_or_else(|| Failure::Fault(format!("{}: its system has no key {key}", self.scenario.name)))
    }
}

/// One drive of a job.
pub struct Trial<'a> {
    /// The job.
    pub job: &'a Job,
    /// Keys set beside the scenario's.
    pub set: Vec<String>,
    /// Seed of what is random.
    pub seed: u64,
    /// Its rows are kept, for curves.
    pub rows: bool,
}

/// What a drive came to.
pub struct Driven {
    /// What it was.
    pub note: Note,
    /// Its figures.
    pub figures: RunFigures,
    /// How a deviation at the start was corrected, where the scenario asks.
    pub correction: Option<Correction>,
    /// Where the truth went, m, thinned for drawing.
    pub trail: Vec<(f64, f64)>,
    /// Its rows, if they are kept.
    pub rows: Vec<TraceRow>,
}

/// A drive as anybody can have it again: `hilare run SCENARIO --clock in-process --seed N --set …`.
#[derive(Clone, Debug, Serialize)]
pub struct Note {
    /// Scenario.
    pub scenario: String,
    /// Seed.
    pub seed: u64,
    /// What is set beside it, keys and values separated by blanks.
    pub set: String,
    /// Hash of every bit of the estimated pose, as in `summary.json`.
    pub state_hash: String,
    /// Mean cross-track distance of the truth, m, as in `summary.json`.
    pub cross_track_mean_m: f64,
}

/// Drives them all, in the order given.
pub fn drive_all(trials: &[Trial<'_>]) -> Result<Vec<Driven>, Failure> {
    let next = AtomicUsize::new(0);
    let done: Vec<Mutex<Option<Result<Driven, Failure>>>> = trials.iter().map(|_| Mutex::new(None)).collect();
    let work = || {
        while let Some(index) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|n| *n < trials.len()) {
            let driven = drive(&trials[index]);
            if let Ok(mut slot) = done[index].lock() {
                *slot = Some(driven);
            }
        }
    };
    thread::scope(|scope| {
        let workers = thread::available_parallelism().map_or(1, usize::from).min(trials.len());
        for _ in 1..workers {
            scope.spawn(work);
        }
        work();
    });
    let lost = || Err(Failure::Fault("a drive was lost".to_owned()));
    done.into_iter().map(|slot| slot.into_inner().ok().flatten().unwrap_or_else(lost)).collect()
}

fn drive(trial: &Trial<'_>) -> Result<Driven, Failure> {
    let Trial { job, set, seed, rows: keep } = trial;
    let scenario = &job.scenario;
    let mut system: System = scenario.system.clone();
    let mut keys = set.clone();
    keys.extend(seed_keys(*seed));
    system.set_all(&keys).map_err(|error| Failure::Refused(error.to_string()))?;
    let mut robot = InProcess::new(&system, &job.waypoints).map_err(Failure::Refused)?;
    let max_ticks = time_limit(&Drive { scenario, waypoints: &job.waypoints, map: None });
    let record = robot.run(max_ticks);
    let figures = record.statistics.figures();
    if !figures.reached {
        let seconds = max_ticks / TICKS_PER_SECOND;
        return Err(Failure::Fault(format!("{}, seed {seed}: not there within {seconds} s", scenario.name)));
    }
    let rows = record.trace.rows();
    let truth: Vec<_> = rows.iter().map(|row| (row.truth.x_m, row.truth.y_m)).collect();
    Ok(Driven {
        note: Note {
            scenario: scenario.name.clone(),
            seed: *seed,
            set: set.join(" "),
            state_hash: format!("{:016x}", figures.state_hash),
            cross_track_mean_m: figures.cross_track_mean_m,
        },
        figures,
        correction: scenario.correction.and_then(|band| Correction::of(rows, band)),
        trail: thin::thin(&truth, TRAIL),
        rows: if *keep { rows.to_vec() } else { Vec::new() },
    })
}
