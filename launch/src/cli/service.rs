//! `hilare service ROLE`: a worker process.

use super::{VerbResult, refused};
use crate::config::System;
use crate::logging;
use crate::manager::Failure;
use crate::manager::children::this_program;
use crate::manager::join::{Watch, find_place};
use crate::operator::OperatorProcess;
use crate::private::PrivateUmask;
use crate::shell::ClockKind;
use crate::shell::boxes::{ControllerProcess, EstimatorProcess, PlantProcess, SelectorProcess};
use crate::shell::clock::ClockProcess;
use crate::shell::observer::RecorderProcess;
use crate::shell::page::{MAX_SLOTS, PAGE_FD};
use crate::shell::planning::PlannerProcess;
use crate::shell::realtime::{self, CpuChoice};
use crate::shell::relay::RelayProcess;
use crate::shell::transport::CONFIG_FILE;
use crate::shell::worker::{Assignment, Worker, die_with_launch, system_file};
use clap::Args;
use hilare_interfaces::wires::Role;
use std::os::fd::AsRawFd;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use tracing::error;

const GONE: &str = "launch is gone";

/// Which worker it is, and what it is part of.
#[derive(Args)]
pub struct ServiceArgs {
    /// Name of the box.
    role: String,
    /// Join this robot, whose launch awaits its workers (hilare up --workers joined).
    #[arg(long, value_name = "ROBOT", conflicts_with = "Told")]
    join: Option<String>,
    #[command(flatten)]
    told: Option<Told>,
}

/// What launch tells a worker.
#[derive(Args)]
struct Told {
    #[arg(long)]
    runtime_dir: PathBuf,
    #[arg(long)]
    slot: usize,
    #[arg(long)]
    epoch: u64,
    #[arg(long)]
    incarnation: u64,
    #[arg(long)]
    clock: ClockKind,
    #[arg(long)]
    launch_pid: i32,
    /// Number of its system file in the runtime directory.
    #[arg(long)]
    system: u64,
    #[arg(long, allow_negative_numbers = true)]
    cpu: i64,
    #[arg(long)]
    law: Option<String>,
    /// A program that drives instead.
    #[arg(long)]
    exec: Option<PathBuf>,
    /// Set on a worker that launch has not started.
    #[arg(long)]
    joined: bool,
}

/// Hosts one box until the end.
pub fn service(args: &ServiceArgs) -> VerbResult {
    let role = Role::from_name(&args.role).filter(|role| *role != Role::Launch).ok_or_else(|| {
        refused(format!("there is no service {:?}; services are started by hilare up or run", args.role))
    })?;
    let told = match (&args.join, &args.told) {
        (Some(robot), _) => return Err(become_worker(role, robot)),
        (None, Some(told)) => told,
        (None, None) => {
            return Err(refused("workers are started by hilare up or run; to join one: --join ROBOT"));
        }
    };
    if told.slot >= MAX_SLOTS {
        return Err(refused(format!("--slot {}: there are {MAX_SLOTS}", told.slot)));
    }
    // Whatever it creates is its user's alone, also when somebody else than launch has started it.
    let _umask = PrivateUmask::set();
    logging::init_worker(role.name());
    let assignment = Assignment {
        role,
        slot: told.slot,
        runtime_dir: told.runtime_dir.clone(),
        clock: told.clock,
        launch_pid: told.launch_pid,
        joined: told.joined,
        system: told.system,
        cpu: told.cpu,
        law: told.law.clone(),
        epoch: told.epoch,
        incarnation: told.incarnation,
    };
    let ended = match &told.exec {
        Some(program) => Err(become_program(program, &assignment)),
        None if told.joined => host_joined(assignment),
        None => host(assignment),
    };
    match ended {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(why) => {
            // Its standard error is the log: once is enough.
            error!("{why}");
            Ok(ExitCode::FAILURE)
        }
    }
}

/// Becomes the process that launch would have started, with the place launch gives it. Returns only if
/// that fails.
fn become_worker(role: Role, robot: &str) -> Failure {
    let place = match find_place(robot, role) {
        Ok(place) => place,
        Err(failure) => return failure,
    };
    let mut command = this_program();
    command.arg("service").arg(role.name()).args(&place.arguments).arg("--joined");
    let error = command.env(PAGE_FD, place.page.as_raw_fd().to_string()).exec();
    Failure::Fault(format!("cannot become {}: {error}", role.name()))
}

/// Hosts a box whose process launch has not started. That launch is gone is an error: whoever started it
/// is to start it again.
fn host_joined(assignment: Assignment) -> Result<(), String> {
    let launch = Watch::over(assignment.launch_pid).map_err(|_| GONE)?;
    host(assignment)?;
    if launch.is_gone() { Err(GONE.to_owned()) } else { Ok(()) }
}

/// Becomes a controller that is not ours, with what it has to know in its environment. Returns only if
/// that fails.
fn become_program(program: &Path, assignment: &Assignment) -> String {
    let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", program.display());
    if let Err(why) = die_with_launch(assignment.launch_pid) {
        return why;
    }
    let dir = &assignment.runtime_dir;
    let file = dir.join(system_file(assignment.system));
    let system = match System::load(&file.to_string_lossy()) {
        Ok(system) => system,
        Err(error) => return failed(&error),
    };
    // A foreign program has a name of its own on the machine: its path as it was written.
    let program = match std::path::absolute(program) {
        Ok(program) => program,
        Err(error) => return failed(&error),
    };
    let wanted = system.realtime(assignment.role);
    let on_the_tick = assignment.clock == ClockKind::Real && wanted.priority > 0;
    realtime::apply(realtime::Request {
        // Below our own controllers: it may spin.
        priority: if on_the_tick { wanted.priority - 1 } else { 0 },
        cpu: CpuChoice::from_key(assignment.cpu),
        // Locks do not survive exec.
        lock_memory: false,
    });
    let error = Command::new(&program)
        .env("HILARE_ROBOT", &system.robot)
        .env("HILARE_ICEORYX2_CONFIG", dir.join(CONFIG_FILE))
        .env("HILARE_SYSTEM", &file)
        .env("HILARE_SOURCE", (assignment.slot + 1).to_string())
        .env("HILARE_EPOCH", assignment.epoch.to_string())
        .env("HILARE_PERIOD_TICKS", system.timing.period_ticks.to_string())
        .env_remove(PAGE_FD)
        .exec();
    failed(&error)
}

fn host(assignment: Assignment) -> Result<(), String> {
    let mut worker = Worker::start(assignment)?;
    match worker.assignment.role {
        Role::Planner => PlannerProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::WaypointSelector => SelectorProcess::new(&mut worker).and_then(|hosted| worker.host(hosted)),
        Role::Controller => ControllerProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::StepGenerator => ClockProcess::new(&mut worker).and_then(|clock| clock.run(worker)),
        Role::PoseEstimator => EstimatorProcess::new(&mut worker).and_then(|hosted| worker.host(hosted)),
        Role::Plant => PlantProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Relay => RelayProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Recorder => RecorderProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Operator => OperatorProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Launch => Err("launch is not a service".to_owned()),
    }
}
