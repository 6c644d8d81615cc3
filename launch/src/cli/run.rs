//! `hilare run` and `hilare demo`.

use super::ending::{End, report};
use super::flags::{seed_keys, set_flag, set_foxglove, set_listen, set_with_drivers, start_keys};
use super::{VerbResult, print, refused, warn};
use crate::config::{Scenario, System, Task};
use crate::logging::{self, LogSink};
use crate::manager::{Claim, Failure, Job, Manager};
use crate::recording::info::remove_parts;
use crate::recording::{Order, RECORDING_FILE, RunInfo, Settings, Tape};
use crate::shell::in_process::InProcess;
use crate::shell::observer::{Handover, survive_the_file_size_limit};
use crate::shell::{ClockKind, build};
use clap::Args;
use hilare_interfaces::block::{TICKS_PER_SECOND, Tick};
use hilare_interfaces::latency::Quantiles;
use hilare_interfaces::messages::{GoalKind, Mode, ReferenceState, Waypoint};
use hilare_planner::{Map, Unlimited, check_crab};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tracing::{Level, warn};

/// Options of `hilare run`.
#[derive(Args)]
pub struct RunArgs {
    /// Built-in scenario or a .toml file [built-in: rectangle, rectangle-open, trapezoid, so,
    /// platform, line-21deg, arc-102cm, agv-low, agv-high, agv-course]
    #[arg(value_name = "SCENARIO", required_unless_present = "path")]
    pub(super) scenario: Option<String>,
    /// Follow these waypoints instead (CSV, header x,y[,bulge[,crab_rad]], metres), starting on the first,
    /// heading 0; the robot is the scenario's, or the e-puck
    #[arg(long, value_name = "FILE.csv")]
    pub(super) path: Option<PathBuf>,
    /// Start pose instead: metres, metres, radians
    #[arg(long, value_name = "X,Y,THETA", allow_hyphen_values = true)]
    pub(super) start: Option<String>,
    /// Control law, or an executable that speaks the wires (a name with a /)
    #[arg(long, value_name = "LAW")]
    pub(super) controller: Option<String>,
    /// Law or executable of a second controller that takes over within the tick
    #[arg(long, value_name = "LAW")]
    pub(super) standby: Option<String>,
    /// Address and port of the operator's page and metrics for Prometheus, e.g. 127.0.0.1:7070
    #[arg(long, value_name = "ADDR")]
    pub(super) listen: Option<String>,
    /// Address and port of a live view for Foxglove and Lichtblick, e.g. 127.0.0.1:8765
    #[arg(long, value_name = "ADDR")]
    pub(super) foxglove: Option<String>,
    /// What drives the ticks: real, lockstep or in-process
    #[arg(long, value_name = "CLOCK", default_value = "real")]
    pub(super) clock: ClockKind,
    /// Seed of the simulated slip, start error and camera noise
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(super) seed: Option<u64>,
    /// Set a key of the system file, e.g. plant.slip_mean=0.03 (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    pub(super) set: Vec<String>,
    /// Name the robot runs under
    #[arg(long, value_name = "NAME")]
    pub(super) robot: Option<String>,
    /// Keep no recording of the run (run.mcap)
    #[arg(long)]
    pub(super) no_recording: bool,
    /// Directory for the report; one that is there is replaced [default: runs/SCENARIO-LAW-CLOCK-N]
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Print summary.json instead of the verdict
    #[arg(long)]
    pub(super) json: bool,
}

/// A scenario to its end, with a report.
pub fn run(args: &RunArgs) -> VerbResult {
    let scenario = resolve(args)?;
    if args.clock == ClockKind::InProcess && !scenario.system.controller.exec.is_empty() {
        return Err(refused("controller.exec: an executable is a process; --clock real or lockstep"));
    }
    for (flag, what) in [("--listen: the page", &args.listen), ("--foxglove: the live view", &args.foxglove)]
    {
        if args.clock == ClockKind::InProcess && what.is_some() {
            return Err(refused(format!("{flag} is a process; --clock real or lockstep")));
        }
    }
    let map = scenario.system.load_map().map_err(refused)?;
    let waypoints = path_of(&scenario, map.as_ref())?;
    let out = open_out_dir(args, &scenario)?;
    let drive = Drive { scenario: &scenario, waypoints: &waypoints, map: map.as_ref() };
    let result = run_into(&out, args, &drive);
    if let Err(Failure::Refused(_)) = &result {
        discard(&out);
    }
    result
}

/// A run that never began leaves nothing. What is not empty is not ours.
fn discard(out: &Path) {
    for file in [LOG_FILE, SYSTEM_FILE] {
        let _ = fs::remove_file(out.join(file));
    }
    let empty = fs::remove_dir(out).is_ok();
    if empty && out.starts_with(RUNS) {
        let _ = fs::remove_dir(RUNS);
    }
}

fn run_into(out: &Path, args: &RunArgs, drive: &Drive<'_>) -> VerbResult {
    let log = LogSink::new(Level::WARN).map_err(refused)?;
    logging::init_launch(&log);
    let _written = log.written_at_end();
    let failed = |e: io::Error| refused(format!("{}: {e}", out.display()));
    log.to_file(&out.join(LOG_FILE)).map_err(failed)?;
    fs::write(out.join(SYSTEM_FILE), drive.scenario.system.to_toml()).map_err(failed)?;
    let order = order(out, args, drive)?;
    warn_if_endless(drive);
    let max_ticks = time_limit(drive);
    let end = match args.clock {
        ClockKind::InProcess => run_in_process(drive, max_ticks, order)?,
        ClockKind::Real | ClockKind::Lockstep => run_processes(args, drive, max_ticks, order, &log)?,
    };
    report(args, drive, out, end)
}

/// Where to record, if so. What an earlier run has recorded there goes, as its report does.
fn order(out: &Path, args: &RunArgs, drive: &Drive<'_>) -> Result<Option<Order>, Failure> {
    let file = out.join(RECORDING_FILE);
    remove_parts(&file).map_err(refused)?;
    if args.no_recording {
        return Ok(None);
    }
    let info = RunInfo::new(&drive.scenario.system, &drive.scenario.name, args.clock.name());
    Order::new(&file, info, &out.join(SYSTEM_FILE))
        .map(Some)
        .map_err(|error| refused(format!("{}: {error}", file.display())))
}

/// A scenario with the path it comes to.
pub struct Drive<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Its path.
    pub waypoints: &'a [Waypoint],
    /// Its map.
    pub map: Option<&'a Map>,
}

/// The path of a scenario: its own, or the planner's. The planner's process finds the same one: same
/// map, same seed, same bits.
pub(crate) fn path_of(scenario: &Scenario, map: Option<&Map>) -> Result<Vec<Waypoint>, Failure> {
    let system = &scenario.system;
    match &scenario.task {
        Task::Follow(waypoints) => {
            check_crab(waypoints, system.chassis.is_omnidirectional()).map_err(|why| {
                let index = why.index().unwrap_or_default();
                refused(format!("{}: waypoint {}: {why}", scenario.name, index + 1))
            })?;
            let navigator = build::navigator_on(None, system);
            navigator.fitted(waypoints.clone()).map_err(|why| refused(format!("{}: {why}", scenario.name)))
        }
        Task::Reach(goal) => build::navigator_on(map, system)
            .path(GoalKind::Point, &[Waypoint::from(*goal)], system.start.position(), &mut Unlimited)
            .map_err(|why| Failure::Fault(format!("the planner: {why}"))),
    }
}

/// Directory for reports that were given none.
const RUNS: &str = "runs";
const LOG_FILE: &str = "hilare.log";
const SYSTEM_FILE: &str = "system.toml";

/// A path in millimetres is a drive of hours.
fn warn_if_endless(drive: &Drive<'_>) {
    let (length_m, speed_mps) = (path_length_m(drive), drive.scenario.system.tracking.speed_mps);
    let hours = length_m / speed_mps.max(1e-4) / 3600.0;
    if hours > 1.0 {
        warn!(
            "the path is {length_m:.0} m long, {hours:.1} hours at {speed_mps} m/s; are the waypoints in metres?"
        );
    }
}

fn path_length_m(drive: &Drive<'_>) -> f64 {
    drive.waypoints.windows(2).map(|pair| pair[1].segment_from(pair[0]).length_m()).sum()
}

fn resolve(args: &RunArgs) -> Result<Scenario, Failure> {
    // With --path the scenario only lends its robot.
    let name = args.scenario.as_deref().unwrap_or("rectangle");
    if name.ends_with(".csv") {
        return Err(refused(format!("{name}: waypoint files go with --path: hilare run --path {name}")));
    }
    let mut scenario = Scenario::load(name).map_err(refused)?;
    if let Some(path) = &args.path {
        scenario = scenario.with_path(path).map_err(refused)?;
        scenario.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    }
    let system = &mut scenario.system;
    set_with_drivers(system, &args.set, args.controller.as_deref(), args.standby.as_deref())?;
    set_listen(system, args.listen.as_deref())?;
    set_foxglove(system, args.foxglove.as_deref())?;
    if let Some(seed) = args.seed {
        set_flag(system, "--seed", &seed.to_string(), &seed_keys(seed))?;
    }
    if let Some(robot) = &args.robot {
        set_flag(system, "--robot", robot, &[format!("robot={robot}")])?;
    }
    if let Some(start) = &args.start {
        set_flag(system, "--start", start, &start_keys(start)?)?;
    }
    warn(&scenario.warnings());
    Ok(scenario)
}

/// Makes the report's directory now, so that an unwritable one is known before the robot moves.
fn open_out_dir(args: &RunArgs, scenario: &Scenario) -> Result<PathBuf, Failure> {
    let dir = match &args.out {
        Some(dir) => dir.clone(),
        None => {
            let law = scenario.system.controller.driver().short_name();
            let stem = format!("{}-{law}-{}", scenario.name, args.clock);
            (1..)
                .map(|n| Path::new(RUNS).join(format!("{stem}-{n}")))
                .find(|dir| !dir.exists())
                .unwrap_or_else(|| Path::new(RUNS).join(stem))
        }
    };
    if dir.exists() && !dir.is_dir() {
        return Err(refused(format!("--out {}: is a file; choose a directory", dir.display())));
    }
    let failed =
        |e: io::Error| refused(format!("--out {}: {e}; choose a directory you can write", dir.display()));
    fs::create_dir_all(&dir).map_err(failed)?;
    let probe = dir.join(".hilare-probe");
    fs::write(&probe, b"").and_then(|()| fs::remove_file(&probe)).map_err(failed)?;
    Ok(dir)
}

/// Ticks after which a run that has not arrived is ended: five times what the path takes at the
/// reference speed, and a minute.
pub(crate) fn time_limit(drive: &Drive<'_>) -> Tick {
    limit_of_length(&drive.scenario.system, path_length_m(drive))
}

/// The same for a path of so many metres.
pub(crate) fn limit_of_length(system: &System, length_m: f64) -> Tick {
    let speed_mps = system.tracking.speed_mps.max(1e-4);
    let seconds = 60.0 + 5.0 * length_m / speed_mps;
    (seconds.min(1e7) as Tick) * TICKS_PER_SECOND
}

const TIME_LIMIT: &str = "the time limit (a minute and five times what the path takes) ran out";

fn run_in_process(drive: &Drive<'_>, max_ticks: Tick, order: Option<Order>) -> Result<End, Failure> {
    let mut system = InProcess::new(&drive.scenario.system, drive.waypoints).map_err(refused)?;
    let (record, recording) = match order {
        Some(order) => {
            survive_the_file_size_limit().map_err(Failure::Fault)?;
            let toml = drive.scenario.system.to_toml();
            let settings = Settings::of(&drive.scenario.system, order.path, true);
            let mut tape = Tape::begin(settings, order.info, toml).map_err(refused)?;
            let record = system.run_heard(max_ticks, |heard| tape.hear(heard));
            (record, Some(tape.finish(None)))
        }
        None => (system.run(max_ticks), None),
    };
    Ok(End {
        stopped_by: (!system.arrived()).then(|| TIME_LIMIT.to_owned()),
        fault: false,
        rows: record.trace.rows().to_vec(),
        trace_csv: record.trace.to_csv(),
        handover: Some(Handover { figures: record.statistics.figures(), gaps: 0, recording }),
        lateness: Quantiles::default(),
        swaps: 0,
        drove: Vec::new(),
        changed: false,
        diverted: false,
        restarts: 0,
    })
}

fn run_processes(
    args: &RunArgs,
    drive: &Drive<'_>,
    max_ticks: Tick,
    recording: Option<Order>,
    log: &LogSink,
) -> Result<End, Failure> {
    let scenario = drive.scenario;
    let job = Job {
        system: scenario.system.clone(),
        clock: args.clock,
        task: Some(scenario.task.clone()),
        record: true,
        recording,
        workers: crate::manager::join::Workers::Own,
    };
    let bar = progress_bar(args, scenario, drive.waypoints.len(), log);
    log.around(Some(bar.clone()));
    let claim = Claim::new(&scenario.system.robot)?;
    let mut manager = Manager::start(claim, job, log)?;
    show_page(&manager, args.json);
    manager.set_mode(Mode::Armed, "the command line").map_err(Failure::Fault)?;
    let mut first_path = None;
    let stopped_by = loop {
        manager.step(Duration::from_millis(20));
        let reference = &manager.newest().reference;
        if reference.state != ReferenceState::Idle.code() {
            first_path.get_or_insert(reference.path_id);
        }
        show(&bar, &manager);
        if manager.arrived() {
            break None;
        }
        if let Some(why) = manager.fault().or(manager.halted()) {
            break Some(why.to_owned());
        }
        if manager.mode() == Mode::EStop {
            break Some("emergency stop; hilare reset releases it".to_owned());
        }
        if manager.told_to_end() {
            break Some("interrupted".to_owned());
        }
        if manager.newest().steps.tick >= max_ticks {
            break Some(TIME_LIMIT.to_owned());
        }
    };
    bar.finish_and_clear();
    log.around(None);
    let diverted = first_path.is_some_and(|path| path != manager.newest().reference.path_id);
    let outcome = manager.end();
    // The verdict comes below what led to it.
    log.flush();
    let fault = outcome.fault.is_some() || outcome.handover.is_none();
    let (rows, trace_csv) = match outcome.trace_csv {
        Some(csv) => (hilare_recorder::trace::parse_csv(&csv).map_err(Failure::Fault)?, csv),
        None => (Vec::new(), String::new()),
    };
    let lost = outcome.handover.is_none().then(|| "the recorder died; its figures are lost".to_owned());
    Ok(End {
        stopped_by: stopped_by.or(lost),
        fault,
        rows,
        trace_csv,
        handover: outcome.handover,
        lateness: outcome.lateness,
        swaps: outcome.swaps,
        drove: outcome.drove,
        changed: diverted || outcome.param_changes > 0,
        diverted,
        restarts: outcome.restarts,
    })
}

/// Says where the page is; standard output may be for JSON alone.
pub(super) fn show_page(manager: &Manager, json: bool) {
    let page = manager.page_url().map(|page| format!("page: {page}\n"));
    let foxglove = manager.foxglove_url().map(|url| format!("foxglove: {url}\n"));
    for line in [page, foxglove].into_iter().flatten() {
        if json {
            let _ = io::stderr().write_all(line.as_bytes());
        } else {
            print(&line);
        }
    }
}

fn progress_bar(args: &RunArgs, scenario: &Scenario, waypoints: usize, log: &LogSink) -> ProgressBar {
    if args.json || !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(waypoints as u64 - 1), log.draw_target());
    let style = ProgressStyle::with_template("{prefix} [{bar:30}] waypoint {pos}/{len}  {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
    bar.set_prefix(format!("{} ({})", scenario.name, args.clock));
    bar
}

fn show(bar: &ProgressBar, manager: &Manager) {
    if bar.is_hidden() {
        return;
    }
    let newest = manager.newest();
    let Some(pose) = newest.pose else { return };
    bar.set_position(newest.reference.index.saturating_sub(1));
    bar.set_message(format!(
        "{:.1} s  x {:.0} mm  y {:.0} mm  {:.1} mm/s",
        newest.steps.tick as f64 / TICKS_PER_SECOND as f64,
        pose.x_m * 1e3,
        pose.y_m * 1e3,
        newest.steps.commanded_twist().speed_mps() * 1e3
    ));
}
