//! `hilare compare`: laws side by side on the same jobs; runs that are over, in `compare_runs`.

use super::compare_runs::compare_runs;
use super::flags::seed_keys;
use super::plot::ShapeArgs;
use super::run::{Drive, path_of, time_limit};
use super::{VerbResult, print, refused, warn};
use crate::config::{Published, Scenario};
use crate::manager::Failure;
use crate::report::overlay::{Run, write_overlay};
use crate::report::{Band, Correction, PastRun, write_file};
use crate::shell::in_process::InProcess;
use clap::Args;
use hilare_controller::{LAWS, LawSpec};
use hilare_interfaces::latency::{LatencyHistogram, Quantiles};
use hilare_interfaces::messages::Waypoint;
use hilare_recorder::statistics::RunFigures;
use hilare_recorder::trace::TraceRow;
use serde::Serialize;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Scenarios compared when none is named: those of paper 1.
const STANDARD: [&str; 3] = ["trapezoid", "rectangle", "so"];

/// Options of `hilare compare`.
#[derive(Args)]
pub struct CompareArgs {
    /// Built-in scenarios or .toml files [default: trapezoid rectangle so]; or runs that are over, two or more:
    /// directories or recordings (.mcap)
    #[arg(value_name = "SCENARIO|RUN")]
    pub(super) named: Vec<String>,
    /// Laws, separated by commas [default: every law that drives the scenario's chassis]
    #[arg(long, value_name = "LAW,LAW", value_delimiter = ',')]
    laws: Vec<String>,
    /// Runs of each pair, with plant and camera noise of the seeds 1 to N
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Set a key of every system file, e.g. plant.slip_mean=0.03 (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// Directory for compare.json and the pictures [default: runs/compare-N]
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) shape: ShapeArgs,
    /// Print compare.json instead of the tables
    #[arg(long)]
    pub(super) json: bool,
}

/// Processor time of a law's step on the machine it ran on, µs, untrimmed.
#[derive(Clone, Copy, Debug, Serialize)]
struct StepCpuUs {
    p50: f64,
    p99: f64,
    p99_9: f64,
    max: f64,
}

/// One law on one scenario: means and maxima over the runs that arrived.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scenario: String,
    controller: &'static str,
    runs: u64,
    arrived: u64,
    cross_track_mean_m: Option<f64>,
    cross_track_max_m: Option<f64>,
    speed_error_mean_mps: Option<f64>,
    duration_s: Option<f64>,
    step_cpu_us: StepCpuUs,
    /// Of the first seed, where the scenario asks.
    #[serde(skip_serializing_if = "Option::is_none")]
    correction: Option<Correction>,
}

/// Runs that are over, or laws on scenarios.
pub fn compare(args: &CompareArgs) -> VerbResult {
    let (runs, scenarios): (Vec<&String>, Vec<&String>) =
        args.named.iter().partition(|argument| PastRun::is_named_by(argument));
    match (&runs[..], &scenarios[..]) {
        ([], _) => compare_laws(args),
        // A scenario is built in or a file; what is neither was meant to be a run.
        (_, [missing, ..]) if !Path::new(missing.as_str()).exists() && Scenario::load(missing).is_err() => {
            Err(refused(format!("{missing}: no such run; name a run's directory or a recording (.mcap)")))
        }
        ([run, ..], [scenario, ..]) => Err(refused(format!(
            "{run} is a run that is over and {scenario} a scenario; compare either runs or laws on scenarios"
        ))),
        (runs, []) => {
            let laws = [
                ("--laws", !args.laws.is_empty()),
                ("--seeds", args.seeds != 1),
                ("--set", !args.set.is_empty()),
            ];
            if let Some((flag, _)) = laws.iter().find(|(_, given)| *given) {
                return Err(refused(format!(
                    "{flag}: {} is a run that is over; it goes with scenarios",
                    runs[0]
                )));
            }
            compare_runs(args, runs)
        }
    }
}

/// Runs every law on every scenario, in one thread and virtual time.
fn compare_laws(args: &CompareArgs) -> VerbResult {
    let shape = (args.shape.format(), args.shape.width_px()?);
    let names: Vec<&str> = match &args.named[..] {
        [] => STANDARD.to_vec(),
        given => given.iter().map(String::as_str).collect(),
    };
    let laws = chosen_laws(&args.laws)?;
    let jobs: Vec<Job> = names.iter().map(|name| Job::new(name, args, &laws)).collect::<Result<_, _>>()?;
    for (n, job) in jobs.iter().enumerate() {
        // Each scenario's pictures bear its name.
        if jobs[..n].iter().any(|other| other.scenario.name == job.scenario.name) {
            let name = &job.scenario.name;
            return Err(refused(format!(
                "{name}: two scenarios of this name; rename a file or leave one away"
            )));
        }
    }
    let out = out_dir(args.out.as_deref(), "compare")?;
    let mut rows = Vec::new();
    let mut text = String::new();
    for job in &jobs {
        let (table, traces) = job.run(args.seeds)?;
        let runs: Vec<Run<'_>> = traces.iter().map(|(law, rows)| Run { name: law.name, rows }).collect();
        write_overlay(&out, (&job.scenario.name, &job.scenario.name), &[&job.waypoints], &runs, shape)
            .map_err(|error| Failure::Fault(error.to_string()))?;
        text.push_str(&table_text(job, &table, args.seeds));
        rows.extend(table);
    }
    finish(args, &out, &rows, &text)
}

/// Writes `compare.json` and prints it or the text.
pub(super) fn finish(args: &CompareArgs, out: &Path, all: &impl Serialize, text: &str) -> VerbResult {
    let json = serde_json::to_string_pretty(all).map_err(|error| Failure::Fault(error.to_string()))? + "\n";
    write_file(out, "compare.json", &json).map_err(|error| Failure::Fault(error.to_string()))?;
    if args.json {
        print(&json);
    } else {
        print(text);
        print(&format!("Report: {}\n", out.display()));
    }
    Ok(ExitCode::SUCCESS)
}

fn chosen_laws(names: &[String]) -> Result<Vec<&'static LawSpec>, Failure> {
    let known = || LAWS.iter().map(|law| law.name).collect::<Vec<_>>().join(", ");
    let find = |name: &String| {
        hilare_controller::law(name.trim())
            .ok_or_else(|| refused(format!("--laws: unknown law {name:?}; known: {}", known())))
    };
    names.iter().map(find).collect()
}

/// The directory a verb was given, or the next free `runs/VERB-N`; made now, so that an unwritable one is known
/// before anything runs.
pub(super) fn out_dir(given: Option<&Path>, verb: &str) -> Result<PathBuf, Failure> {
    let dir = match given {
        Some(dir) => dir.to_owned(),
        None => {
            let free =
                (1u64..).map(|n| Path::new("runs").join(format!("{verb}-{n}"))).find(|dir| !dir.exists());
            free.unwrap_or_else(|| Path::new("runs").join(verb))
        }
    };
    if dir.exists() && !dir.is_dir() {
        return Err(refused(format!("--out {}: is a file; choose a directory", dir.display())));
    }
    fs::create_dir_all(&dir)
        .map_err(|e| refused(format!("--out {}: {e}; choose a directory you can write", dir.display())))?;
    Ok(dir)
}

/// A law and the rows of its first run.
type Trail = (&'static LawSpec, Vec<TraceRow>);

/// A scenario with its path and the laws to drive it.
struct Job {
    scenario: Scenario,
    waypoints: Vec<Waypoint>,
    laws: Vec<&'static LawSpec>,
}

impl Job {
    fn new(name: &str, args: &CompareArgs, chosen: &[&'static LawSpec]) -> Result<Self, Failure> {
        let mut scenario = Scenario::load(name).map_err(refused)?;
        scenario.system.set_all(&args.set).map_err(refused)?;
        warn(&scenario.warnings());
        let kind = scenario.system.chassis.name();
        let wanted: Vec<&'static LawSpec> =
            if chosen.is_empty() { LAWS.iter().collect() } else { chosen.to_vec() };
        let laws: Vec<_> = wanted.into_iter().filter(|law| law.chassis.contains(&kind)).collect();
        if laws.is_empty() {
            return Err(refused(format!("--laws: none of them drives the {kind} chassis of {name}")));
        }
        let map = scenario.system.load_map().map_err(refused)?;
        let waypoints = path_of(&scenario, map.as_ref())?;
        Ok(Self { scenario, waypoints, laws })
    }

    /// The table of the scenario, and the rows of each law's first run.
    fn run(&self, seeds: u64) -> Result<(Vec<Row>, Vec<Trail>), Failure> {
        let drive = Drive { scenario: &self.scenario, waypoints: &self.waypoints, map: None };
        let max_ticks = time_limit(&drive);
        let mut table = Vec::new();
        let mut traces = Vec::new();
        for law in &self.laws {
            let mut sums = Sums::default();
            let mut first = Vec::new();
            for seed in 1..=seeds {
                let mut system = self.scenario.system.clone();
                let mut keys = vec![format!("controller.law={}", law.name)];
                if seeds > 1 {
                    keys.extend(seed_keys(seed));
                }
                system.set_all(&keys).map_err(refused)?;
                let mut robot = InProcess::new(&system, &self.waypoints).map_err(refused)?;
                robot.time_the_law();
                let record = robot.run(max_ticks);
                sums.add(&record.statistics.figures(), &robot);
                if seed == 1 {
                    first = record.trace.rows().to_vec();
                }
            }
            table.push(sums.row(&self.scenario, law, seeds, &first));
            traces.push((*law, first));
        }
        Ok((table, traces))
    }
}

/// Figures of several runs.
#[derive(Default)]
struct Sums {
    arrived: u64,
    cross_track_m: f64,
    cross_track_max_m: f64,
    speed_error_mps: f64,
    duration_s: f64,
    step_time: LatencyHistogram,
}

impl Sums {
    fn add(&mut self, figures: &RunFigures, robot: &InProcess) {
        if let Some(time) = robot.law_time() {
            self.step_time.merge(time);
        }
        if figures.reached {
            self.arrived += 1;
            self.cross_track_m += figures.cross_track_mean_m;
            self.cross_track_max_m = self.cross_track_max_m.max(figures.cross_track_max_m);
            self.speed_error_mps += figures.speed_error_mean_mps;
            self.duration_s += figures.ticks as f64 / 1000.0;
        }
    }

    fn row(&self, scenario: &Scenario, law: &LawSpec, runs: u64, first: &[TraceRow]) -> Row {
        let mean = |sum: f64| (self.arrived > 0).then(|| sum / self.arrived as f64);
        let Quantiles { p50_us, p99_us, p99_9_us, max_us } = self.step_time.quantiles();
        Row {
            scenario: scenario.name.clone(),
            controller: law.name,
            runs,
            arrived: self.arrived,
            cross_track_mean_m: mean(self.cross_track_m),
            cross_track_max_m: (self.arrived > 0).then_some(self.cross_track_max_m),
            speed_error_mean_mps: mean(self.speed_error_mps),
            duration_s: mean(self.duration_s),
            step_cpu_us: StepCpuUs { p50: p50_us, p99: p99_us, p99_9: p99_9_us, max: max_us },
            correction: scenario.correction.and_then(|band| Correction::of(first, band)),
        }
    }
}

/// A number in its unit, or a dash.
fn cell(value: Option<f64>, factor: f64, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{:.digits$}", value * factor))
}

fn table_text(job: &Job, rows: &[Row], seeds: u64) -> String {
    let scenario = &job.scenario;
    let mut text = format!("{}: {}\n", scenario.name, scenario.description);
    if seeds > 1 {
        let _ = writeln!(text, "mean of {seeds} seeds, greatest cross-track of all");
    }
    let _ = writeln!(
        text,
        "  {:<20}{:>14}{:>14}{:>14}{:>10}{:>12}{:>12}",
        "law", "cross-track", "greatest", "speed error", "time", "CPU p50", "CPU p99"
    );
    for row in rows {
        let name = match row.arrived {
            n if n == row.runs => row.controller.to_owned(),
            n => format!("{} ({n} of {} arrived)", row.controller, row.runs),
        };
        let _ = writeln!(
            text,
            "  {name:<20}{:>11} mm{:>11} mm{:>9} mm/s{:>8} s{:>9.1} us{:>9.1} us",
            cell(row.cross_track_mean_m, 1e3, 2),
            cell(row.cross_track_max_m, 1e3, 2),
            cell(row.speed_error_mean_mps, 1e3, 2),
            cell(row.duration_s, 1.0, 2),
            row.step_cpu_us.p50,
            row.step_cpu_us.p99,
        );
    }
    if let Some(band) = scenario.correction {
        text.push_str(&corrections_text(band, rows, &scenario.published));
    }
    text.push('\n');
    text
}

/// How each law corrected the deviation at the start, and what others published of it.
fn corrections_text(band: Band, rows: &[Row], published: &[Published]) -> String {
    let mut text = format!("  corrected to within {:.1} mm", band.cross_track_m * 1e3);
    if band.heading_rad < std::f64::consts::PI {
        let _ = write!(text, ", {:.1} deg", band.heading_rad.to_degrees());
    }
    let _ = writeln!(text, "\n  {:<54}{:>11}{:>11}{:>16}", "", "after", "way", "off afterwards");
    let mut line = |name: &str, time_s: Option<f64>, way_m: Option<f64>, steady_m: Option<f64>| {
        let (time, way, steady) = (cell(time_s, 1.0, 2), cell(way_m, 1.0, 2), cell(steady_m, 1e3, 2));
        let _ = writeln!(text, "  {name:<54}{time:>9} s{way:>9} m{steady:>13} mm");
    };
    for row in rows {
        if let Some(ours) = &row.correction {
            line(row.controller, ours.time_s, ours.travel_m, Some(ours.steady_cross_track_m));
        }
    }
    for row in published {
        line(&row.source, row.correction_time_s, row.correction_travel_m, row.steady_cross_track_m);
    }
    text
}
