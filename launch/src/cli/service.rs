//! `hilare service ROLE`: a worker process.

use super::{VerbResult, refused};
use crate::logging;
use crate::manager::Failure;
use crate::shell::ClockKind;
use crate::shell::boxes::{ControllerProcess, EstimatorProcess, PlantProcess, SelectorProcess};
use crate::shell::clock::ClockProcess;
use crate::shell::observer::RecorderProcess;
use crate::shell::planning::PlannerProcess;
use crate::shell::worker::{Assignment, Worker};
use clap::Args;
use hilare_interfaces::wires::Role;
use std::path::PathBuf;
use std::process::ExitCode;
use tracing::error;

/// What launch tells a worker.
#[derive(Args)]
pub struct ServiceArgs {
    /// Name of the box.
    role: String,
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
}

/// Hosts one box until the end.
pub fn service(args: &ServiceArgs) -> VerbResult {
    let role = Role::from_name(&args.role).filter(|role| *role != Role::Launch).ok_or_else(|| {
        refused(format!("there is no service {:?}; services are started by hilare up or run", args.role))
    })?;
    logging::init_worker(role.name());
    let assignment = Assignment {
        role,
        slot: args.slot,
        runtime_dir: args.runtime_dir.clone(),
        clock: args.clock,
        launch_pid: args.launch_pid,
        epoch: args.epoch,
        incarnation: args.incarnation,
    };
    match host(assignment) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(why) => {
            error!("{why}");
            Err(Failure::Fault(why))
        }
    }
}

fn host(assignment: Assignment) -> Result<(), String> {
    let worker = Worker::start(assignment)?;
    match worker.assignment.role {
        Role::Planner => PlannerProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::WaypointSelector => SelectorProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Controller => ControllerProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::StepGenerator => ClockProcess::new(&worker).and_then(|clock| clock.run(worker)),
        Role::PoseEstimator => EstimatorProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Plant => PlantProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Recorder => RecorderProcess::new(&worker).and_then(|hosted| worker.host(hosted)),
        Role::Launch => Err("launch is not a service".to_owned()),
    }
}
