//! `hilare latency`, and the bare processes it starts.

use super::flags::set_flag;
use super::{VerbResult, print, refused, warn};
use crate::config::System;
use crate::latency::bare::{self, Part, Place};
use crate::latency::{Figures, Measurement, load, measure, write_pictures};
use crate::logging::{self, LogSink};
use crate::manager::{Claim, Failure};
use crate::recording::{Order, RunInfo};
use crate::report::write_file;
use crate::shell::ClockKind;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, IsTerminal};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tracing::Level;

/// Longest measurement, s: a path has at most 65 536 waypoints.
const LONGEST_S: f64 = 86_400.0;

/// Most observers at once: a wire of the relay has room for 64 beside those of the table.
const MOST_OBSERVERS: usize = 60;

/// Options of `hilare latency`.
#[derive(Args)]
pub struct LatencyArgs {
    /// How long to measure
    #[arg(long, value_name = "N", default_value_t = 60.0)]
    seconds: f64,
    /// Load processor, memory and disk on every core meanwhile (stress-ng, where it is installed)
    #[arg(long)]
    load: bool,
    /// By turns let as many observers come and go every 0.1 s, and show what that costs the tick
    #[arg(long, value_name = "N", default_value_t = 0)]
    observers: usize,
    /// By turns let as many pages come that misbehave, and show what that costs the tick
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "observers")]
    pages: usize,
    /// Without the recorder that every run has
    #[arg(long)]
    no_recorder: bool,
    /// Record every wire into this file meanwhile, as hilare run does
    #[arg(long, value_name = "FILE.mcap", conflicts_with = "no_recorder")]
    record: Option<PathBuf>,
    /// Built-in system or a .toml file [built-in: epuck, cart, agv]
    #[arg(long, value_name = "SYSTEM", default_value = "epuck")]
    system: String,
    /// Set a key of the system file, e.g. realtime.controller.cpu=0 (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// Name the robot runs under
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    /// Write figures, pictures and raw histograms into this directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Answer in JSON
    #[arg(long)]
    json: bool,
}

/// Measures and prints.
pub fn latency(args: &LatencyArgs) -> VerbResult {
    if !(1.0..=LONGEST_S).contains(&args.seconds) {
        return Err(refused(format!("--seconds {}: 1 to {LONGEST_S} are wanted", args.seconds)));
    }
    if args.observers > MOST_OBSERVERS {
        return Err(refused(format!("--observers {}: 0 to {MOST_OBSERVERS} are wanted", args.observers)));
    }
    if args.pages > MOST_OBSERVERS {
        return Err(refused(format!("--pages {}: 0 to {MOST_OBSERVERS} are wanted", args.pages)));
    }
    let mut system = System::load(&args.system).map_err(refused)?;
    system.set_all(&args.set).map_err(refused)?;
    warn(&system.warnings());
    if let Some(robot) = &args.robot {
        set_flag(&mut system, "--robot", robot, &[format!("robot={robot}")])?;
    }
    if args.pages > 0 && system.listen.is_empty() {
        let port = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr());
        system.listen = port.map_err(|e| Failure::Fault(format!("no port for the page: {e}")))?.to_string();
    }
    if let Some(dir) = &args.out {
        std::fs::create_dir_all(dir).map_err(|e| {
            refused(format!("--out {}: {e}; choose a directory you can write", dir.display()))
        })?;
    }
    let log = LogSink::new(Level::WARN).map_err(refused)?;
    logging::init_launch(&log);
    let _written = log.written_at_end();
    let bar = progress(args, &log);
    let claim = Claim::new(&system.robot)?;
    let recording = args.record.as_ref().map(|file| order(file, &system)).transpose()?;
    let what = Measurement {
        system,
        seconds: args.seconds,
        load: args.load,
        observers: args.observers.max(args.pages),
        visitors: args.pages > 0,
        record: !args.no_recorder,
        recording,
    };
    let measured = measure(&what, claim, &log, |passed| bar.set_position(passed.as_secs()));
    bar.finish_and_clear();
    log.around(None);
    log.flush();
    let measured = measured?;
    let figures = Figures::of(&measured);
    let json = serde_json::to_string_pretty(&figures).map_err(|e| Failure::Fault(e.to_string()))? + "\n";
    if let Some(dir) = &args.out {
        let failed = |e: io::Error| Failure::Fault(e.to_string());
        write_file(dir, "latency.json", &json).map_err(failed)?;
        write_pictures(dir, &measured).map_err(failed)?;
    }
    if args.json {
        print(&json);
    } else {
        print(&figures.to_text(&measured.causes));
        if let Some(dir) = &args.out {
            print(&format!("Figures, pictures and histograms: {}\n", dir.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn order(file: &Path, system: &System) -> Result<Order, Failure> {
    if file.exists() {
        return Err(refused(format!("--record {}: is there already; choose another name", file.display())));
    }
    let info = RunInfo::new(system, "latency", ClockKind::Real.name());
    let dir = file.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Order::new(file, info, dir).map_err(|error| refused(format!("--record {}: {error}", file.display())))
}

fn progress(args: &LatencyArgs, log: &LogSink) -> ProgressBar {
    if args.json || !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(args.seconds as u64), log.draw_target());
    let style = ProgressStyle::with_template("latency [{bar:30}] {pos}/{len} s");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
    log.around(Some(bar.clone()));
    bar
}

/// What `hilare latency` tells a bare process.
#[derive(Args)]
pub struct BareArgs {
    part: String,
    #[arg(long, default_value = ".")]
    runtime_dir: PathBuf,
    #[arg(long, allow_negative_numbers = true, default_value_t = -2)]
    cpu: i64,
    #[arg(long, default_value_t = 0)]
    priority: u64,
    #[arg(long, default_value_t = 0)]
    phase_ns: u64,
}

/// One of the bare processes.
pub fn bare(args: &BareArgs) -> VerbResult {
    if args.part == "load" {
        load::run();
        return Ok(ExitCode::SUCCESS);
    }
    let part = Part::from_name(&args.part).ok_or_else(|| {
        refused(format!("there is no bare process {:?}; they are started by hilare latency", args.part))
    })?;
    let place = Place { cpu: args.cpu, priority: args.priority, phase_ns: args.phase_ns };
    let dir: &Path = &args.runtime_dir;
    bare::run(part, place, dir).map_err(refused)?;
    Ok(ExitCode::SUCCESS)
}
