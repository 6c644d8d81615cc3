//! `hilare tune`: the parameters of a law, searched for on scenarios.

mod evaluate;
mod job;

use super::{VerbResult, print, refused};
use crate::manager::Failure;
use crate::report::write_file;
use crate::tuning::choice::choose;
use crate::tuning::objectives::STANDARD;
use crate::tuning::problem::Problem;
use crate::tuning::report::{HeldOut, SCENARIO_FILE, Tuned};
use clap::Args;
use hilare_tuner::{Budget, Ending, Log, LogError, Mopso, hypervolume};
use indicatif::{ProgressBar, ProgressStyle};
use job::{Job, PLAN_FILE, Plan};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

const LOG_FILE: &str = "evaluations.csv";

/// Options of `hilare tune`.
#[derive(Args)]
pub struct TuneArgs {
    /// Built-in scenarios or .toml files, all of them at once [default: trapezoid]
    #[arg(value_name = "SCENARIO", conflicts_with = "resume")]
    scenarios: Vec<String>,
    /// A further scenario (repeatable)
    #[arg(long = "scenario", value_name = "SCENARIO", conflicts_with = "resume")]
    more: Vec<String>,
    /// Law to tune [default: the scenario's]
    #[arg(long, value_name = "LAW", conflicts_with = "resume")]
    controller: Option<String>,
    /// Search a key, KEY=LOW..HIGH with :log or :int behind it, instead of or besides the law's own
    /// (repeatable)
    #[arg(long = "parameter", value_name = "KEY=LOW..HIGH", conflicts_with = "resume")]
    parameters: Vec<String>,
    /// Set a key, e.g. plant.slip_mean=0.03; what is set is not searched (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true, conflicts_with = "resume")]
    set: Vec<String>,
    /// Two or three of cross-track-mean, cross-track-max, speed-error, time, effort
    #[arg(long, value_name = "NAME,NAME", default_value = STANDARD, conflicts_with = "resume")]
    objectives: String,
    /// Objectives up to which hypervolume counts, SI [default: paper 1: 0.006,0.003; else twice the untuned]
    #[arg(long, value_name = "N,N", conflicts_with = "resume")]
    reference: Option<String>,
    /// Runs of each scenario, with plant and camera noise of the seeds 1 to N
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000), conflicts_with = "resume")]
    seeds: u64,
    /// Scenario that is not searched on, only reported (repeatable)
    #[arg(long, value_name = "SCENARIO", conflicts_with = "resume")]
    held_out: Vec<String>,
    /// Candidates in all [default: 20000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    evaluations: Option<u64>,
    /// Particles of the swarm
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..=10_000), conflicts_with = "resume")]
    swarm: u64,
    /// Threads; they change no bit of the outcome [default: one a processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    threads: Option<u64>,
    /// Seed of the search
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "resume")]
    seed: u64,
    /// Weights by which the point of the front is chosen [default: equal, its knee]
    #[arg(long, value_name = "W,W")]
    weights: Option<String>,
    /// Directory for log and report [default: runs/tune-N]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Go on with a search that was stopped, to its end or to more --evaluations
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Search nothing: answer candidates on standard input, a JSON list of lists of values a line
    #[arg(long, conflicts_with_all = ["resume", "out", "json"])]
    evaluate: bool,
    /// Print tune.json instead of the table
    #[arg(long)]
    json: bool,
}

/// Searches, or answers candidates.
pub fn tune(args: &TuneArgs) -> VerbResult {
    let plan = match &args.resume {
        Some(dir) => Plan::resumed(dir, args)?,
        None => Plan::new(args)?,
    };
    let job = Job::new(plan)?;
    let threads = args.threads.map_or_else(processors, |threads| threads as usize);
    if args.evaluate {
        return evaluate::answer(&job, threads);
    }
    let (dir, log) = match &args.resume {
        Some(dir) => {
            let log = open_log(dir, &job, Log::resume)?;
            if log.known() > job.plan.evaluations {
                return Err(refused(format!(
                    "--resume {}: {} candidates are evaluated already; --evaluations {} are fewer",
                    dir.display(),
                    log.known(),
                    job.plan.evaluations
                )));
            }
            (dir.clone(), log)
        }
        None => {
            let dir = make_out_dir(args, &job)?;
            let log = open_log(&dir, &job, Log::create)?;
            (dir, log)
        }
    };
    search(job, &dir, log, threads, args.json)
}

fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

fn make_out_dir(args: &TuneArgs, job: &Job) -> Result<PathBuf, Failure> {
    let free = || (1u64..).map(|n| Path::new("runs").join(format!("tune-{n}"))).find(|dir| !dir.exists());
    let dir = args.out.clone().or_else(free).unwrap_or_else(|| PathBuf::from("runs/tune"));
    let failed = |what: String| refused(format!("--out {}: {what}", dir.display()));
    if dir.join(LOG_FILE).exists() {
        return Err(failed(format!("a search is there; go on with hilare tune --resume {}", dir.display())));
    }
    let cure = |error: io::Error| failed(format!("{error}; choose a directory you can write"));
    fs::create_dir_all(&dir).map_err(cure)?;
    let plan = serde_json::to_string_pretty(&job.plan).map_err(|error| failed(error.to_string()))? + "\n";
    write_file(&dir, PLAN_FILE, &plan).map_err(|error| failed(error.to_string()))?;
    Ok(dir)
}

type OpenLog = fn(&Path, &Mopso, &str, &[&str]) -> Result<Log, LogError>;

fn open_log(dir: &Path, job: &Job, open: OpenLog) -> Result<Log, Failure> {
    let keys = job.judge.keys();
    let problem = format!("{:016x}", job.judge.problem.fingerprint());
    open(&dir.join(LOG_FILE), &job.search, &problem, &keys)
        .map_err(|error| refused(format!("{}: {error}", dir.join(LOG_FILE).display())))
}

/// Set by the first Ctrl-C; the second one ends the process at once.
fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
        let fault = |error: io::Error| Failure::Fault(format!("signals: {error}"));
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop)).map_err(fault)?;
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(fault)?;
    }
    Ok(stop)
}

fn progress_bar(job: &Job, json: bool) -> ProgressBar {
    if json {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(job.plan.evaluations);
    let style = ProgressStyle::with_template("{prefix} [{bar:30}] {pos}/{len}  {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
    bar.set_prefix(job.judge.problem.courses()[0].scenario.name.clone());
    bar
}

fn search(mut job: Job, dir: &Path, mut log: Log, threads: usize, json: bool) -> VerbResult {
    let stop = stop_flag()?;
    let bar = progress_bar(&job, json);
    let known = log.known();
    let start = Instant::now();
    let box_volume: f64 = job.reference.iter().product();
    let (judge, reference) = (&job.judge, &job.reference);
    let budget = Budget { evaluations: job.plan.evaluations, threads };
    let ending = judge.search(&mut job.search, budget, Some(&mut log), &stop, |evaluations, archive| {
        if evaluations < known || bar.is_hidden() {
            return;
        }
        let share = hypervolume(archive.members().map(|member| member.objectives), reference) / box_volume;
        bar.set_position(evaluations);
        bar.set_message(format!("hypervolume {share:.4}, front {}", archive.len()));
    });
    bar.finish_and_clear();
    let ending =
        ending.map_err(|error| Failure::Fault(format!("{}: {error}", dir.join(LOG_FILE).display())))?;
    let seconds = start.elapsed().as_secs_f64();
    report(&job, dir, seconds, ending == Ending::Stopped, json)
}

fn report(job: &Job, dir: &Path, seconds: f64, stopped: bool, json: bool) -> VerbResult {
    let front = job.search.front();
    let points: Vec<Vec<f64>> = front.iter().map(|solution| solution.objectives.clone()).collect();
    let chosen = choose(&points, &job.reference, &job.weights);
    let held = |problem: &Problem| HeldOut {
        scenario: problem.courses()[0].scenario.name.clone(),
        untuned: problem.figures(&problem.untuned()).ok(),
        chosen: chosen.and_then(|index| problem.figures(&front[index].values).ok()),
    };
    let held_out: Vec<HeldOut> = job.held_out.iter().map(held).collect();
    let tuned = Tuned {
        problem: &job.judge.problem,
        objectives: &job.judge.objectives,
        reference: &job.reference,
        front: &front,
        chosen,
        untuned: job.untuned,
        untuned_name: job.untuned_name(),
        held_out: &held_out,
        evaluations: job.search.evaluations(),
        seconds,
        stopped,
    };
    tuned.write(dir).map_err(|error| Failure::Fault(error.to_string()))?;
    print(&if json { tuned.to_json() } else { tuned.to_text() });
    if stopped {
        let (done, all) = (job.search.evaluations(), job.plan.evaluations);
        let what = format!("stopped after {done} of {all} evaluations");
        return Err(Failure::Fault(format!("{what}; go on with: hilare tune --resume {}", dir.display())));
    }
    if !json {
        print(&format!("Report: {}\n", dir.display()));
        if chosen.is_some() {
            print(&format!("Drive it: hilare run {}\n", dir.join(SCENARIO_FILE).display()));
        }
    }
    Ok(if chosen.is_some() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
