//! `hilare up`: a robot that stays up.

use super::flags::{set_flag, set_foxglove, set_listen, set_with_drivers};
use super::run::show_page;
use super::{VerbResult, print, refused, warn};
use crate::config::System;
use crate::logging::{self, LogSink};
use crate::manager::children::this_program;
use crate::manager::control::{Request, ask};
use crate::manager::join::Workers;
use crate::manager::notify::LONGEST_START;
use crate::manager::robot_dir::{log_path, socket_path};
use crate::manager::{Claim, Failure, Job, Manager};
use crate::shell::ClockKind;
use clap::Args;
use hilare_interfaces::messages::Mode;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{ExitCode, Stdio};
use std::time::{Duration, Instant};
use tracing::{Level, error, info};

/// Options of `hilare up`.
#[derive(Args)]
pub struct UpArgs {
    /// Built-in system or a .toml file [built-in: epuck, cart, agv]
    #[arg(value_name = "SYSTEM", default_value = "epuck")]
    system: String,
    /// Set a key of the system file, e.g. limits.v_max_mps=0.05 (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// Name the robot runs under [default: the system's]
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    /// Control law, or an executable that speaks the wires (a name with a /)
    #[arg(long, value_name = "LAW")]
    controller: Option<String>,
    /// Law or executable of a second controller that takes over within the tick
    #[arg(long, value_name = "LAW")]
    standby: Option<String>,
    /// Address and port of the operator's page and metrics for Prometheus, e.g. 127.0.0.1:7070
    #[arg(long, value_name = "ADDR")]
    listen: Option<String>,
    /// Address and port of a live view for Foxglove and Lichtblick, e.g. 127.0.0.1:8765
    #[arg(long, value_name = "ADDR")]
    foxglove: Option<String>,
    /// Write the merged log of all processes to this file as well [default with --detach: the runtime
    /// directory's ROBOT.log, kept if the robot ends with a fault]
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Who starts the workers: launch itself, or somebody else (then each joins: hilare service ROLE --join
    /// ROBOT)
    #[arg(long, value_enum, default_value_t, value_name = "WHO")]
    workers: Workers,
    /// Return once the robot is up; end it with hilare down
    #[arg(long, short)]
    detach: bool,
    /// Set on the launch that --detach leaves behind
    #[arg(long, hide = true)]
    background: bool,
    /// Print the status as JSON once it is up (with --detach)
    #[arg(long)]
    json: bool,
}

/// Brings a robot up; in the foreground until Ctrl-C or `hilare down`.
pub fn up(args: &UpArgs) -> VerbResult {
    let mut system = System::load(&args.system).map_err(refused)?;
    set_with_drivers(&mut system, &args.set, args.controller.as_deref(), args.standby.as_deref())?;
    if let Some(robot) = &args.robot {
        set_flag(&mut system, "--robot", robot, &[format!("robot={robot}")])?;
    }
    set_listen(&mut system, args.listen.as_deref())?;
    set_foxglove(&mut system, args.foxglove.as_deref())?;
    system.load_map().map_err(refused)?;
    if !args.background {
        warn(&system.warnings());
    }
    if args.detach {
        return detach(args, &system.robot);
    }
    let log = LogSink::new(Level::INFO).map_err(refused)?;
    logging::init_launch(&log);
    let _written = log.written_at_end();
    // Nobody watches a robot in the background: its reasons must be somewhere.
    let file = args.log.clone().or_else(|| args.background.then(|| log_path(&system.robot)));
    let arm = system.supervision.arm_on_start;
    let robot = system.robot.clone();
    let job = Job {
        system,
        clock: ClockKind::Real,
        task: None,
        record: false,
        recording: None,
        workers: args.workers,
    };
    let claim = Claim::new(&robot)?;
    // Only now: the log of a robot that holds the name already is not ours.
    if let Some(file) = &file {
        log.to_file(file).map_err(|e| refused(format!("--log {}: {e}", file.display())))?;
    }
    let mut manager = match Manager::start(claim, job, &log) {
        Err(Failure::Interrupted) => {
            info!("{robot} was told to end before it was up");
            return Ok(ExitCode::SUCCESS);
        }
        started => started?,
    };
    if !args.background {
        show_page(&manager, args.json);
    }
    let arm = arm && manager.mode() != Mode::EStop;
    if arm {
        manager.set_mode(Mode::Armed, "the command line").map_err(Failure::Fault)?;
    }
    info!("{robot} is up{}", if arm { " and armed" } else { "; hilare arm lets it drive" });
    while !manager.told_to_end() && manager.fault().is_none() {
        manager.step(Duration::from_millis(50));
    }
    let outcome = manager.end();
    match outcome.fault {
        Some(fault) => {
            error!("{robot} ended: {fault}");
            Err(Failure::Fault(fault))
        }
        None => {
            if args.background && args.log.is_none() {
                let _ = std::fs::remove_file(log_path(&robot));
            }
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Starts the same command in a session of its own and waits until the robot answers.
fn detach(args: &UpArgs, robot: &str) -> VerbResult {
    let fault = |e: std::io::Error| Failure::Fault(format!("cannot start launch: {e}"));
    let mut command = this_program();
    command.arg("up").arg(&args.system);
    for (flag, values) in [
        ("--set", &args.set[..]),
        ("--robot", args.robot.as_slice()),
        ("--controller", args.controller.as_slice()),
        ("--standby", args.standby.as_slice()),
        ("--listen", args.listen.as_slice()),
        ("--foxglove", args.foxglove.as_slice()),
    ] {
        for value in values {
            command.arg(format!("{flag}={value}"));
        }
    }
    command.arg("--workers").arg(args.workers.name());
    command.arg("--background");
    if let Some(file) = &args.log {
        command.arg("--log").arg(file);
    }
    let log = args.log.clone().unwrap_or_else(|| log_path(robot));
    let mut child = command
        .process_group(0)
        .current_dir(std::env::current_dir().map_err(fault)?)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(fault)?;
    let deadline = Instant::now() + LONGEST_START;
    loop {
        if child.try_wait().map_err(fault)?.is_some() {
            return Err(why_it_ended(&mut child));
        }
        // Another launch may hold the name: then the child ends by itself and says so.
        let answer = ask(&socket_path(robot), &Request::Status).ok().and_then(|answer| answer.status);
        let ours = answer.filter(|status| status.launch_pid == child.id());
        if let Some(status) = ours.filter(|status| status.mode != "starting") {
            let text = if args.json {
                format!("{}\n", serde_json::to_string_pretty(&status).unwrap_or_default())
            } else {
                let (pid, log) = (child.id(), log.display());
                let robot_flag =
                    args.robot.as_ref().map_or(String::new(), |robot| format!(" --robot {robot}"));
                let page = status.page.map_or(String::new(), |page| format!(", page {page}"));
                let foxglove = status.foxglove.map_or(String::new(), |url| format!(", foxglove {url}"));
                format!(
                    "{robot} is up, launch has pid {pid}, log {log}{page}{foxglove}; next: hilare arm{robot_flag}, \
                     hilare follow FILE.csv{robot_flag}\n"
                )
            };
            print(&text);
            return Ok(ExitCode::SUCCESS);
        }
        if Instant::now() > deadline {
            // It ends its workers.
            if let Some(pid) = Pid::from_raw(child.id().cast_signed()) {
                let _ = kill_process(pid, Signal::TERM);
            }
            return Err(Failure::Fault(format!(
                "launch did not come up within {LONGEST_START:?}; why is in {}",
                log.display()
            )));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The last line the child wrote, which says why.
fn why_it_ended(child: &mut std::process::Child) -> Failure {
    let code = child.wait().ok().and_then(|status| status.code());
    let last =
        child.stderr.take().and_then(|errors| BufReader::new(errors).lines().map_while(Result::ok).last());
    let why = last.map_or_else(|| "launch ended at once".to_owned(), |line| line.replacen("hilare: ", "", 1));
    if code == Some(2) { Failure::Refused(why) } else { Failure::Fault(why) }
}
