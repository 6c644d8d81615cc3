//! The operator's process: a page about the robot, for whoever asks on this machine.
//!
//! It reads what the relay repeats and asks launch, like any observer; nobody on the tick knows of it. The page
//! itself is [`hilare_operator`]'s.

pub mod port;

use crate::look::Told;
use crate::look::usage::Usage;
use crate::look::wires::{Heard, Wires};
use crate::manager::measured::Measured;
use crate::manager::robot_dir::SOCKET;
use crate::shell::worker::{Reactive, Report, Worker};
use hilare_interfaces::wires::Role;
use hilare_operator::robot::{self, Robot};
use hilare_operator::server::{Source, serve};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tracing::info;

/// Time between two looks at the wires.
const LOOK: Duration = Duration::from_millis(10);
/// Stack of the page's thread.
const STACK: usize = 512 << 10;

/// The relay's wires and launch → the page.
pub struct OperatorProcess {
    wires: Wires,
    heard: Arc<Mutex<Heard>>,
    report: Report,
}

impl OperatorProcess {
    /// Opens its ports, those of the network included.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let listen = &worker.system.listen;
        let listener = port::bind(listen)?;
        let wires = Wires::open(&worker.domain)?;
        let heard = Arc::new(Mutex::new(wires.heard()));
        let launch = Launch { socket: worker.assignment.runtime_dir.join(SOCKET), heard: Arc::clone(&heard) };
        let thread = std::thread::Builder::new().name("page".into()).stack_size(STACK);
        let ended = thread.spawn(move || {
            if let Err(error) = serve(listener, Arc::new(launch)) {
                tracing::error!("the page: {error}");
                std::process::exit(1);
            }
        });
        ended.map_err(|error| format!("no thread for the page: {error}"))?;
        info!("http://{listen}/metrics");
        Ok(Self { wires, heard, report: Report::default() })
    }
}

impl Reactive for OperatorProcess {
    fn poll(&mut self, _worker: &mut Worker) -> bool {
        self.wires.look();
        let heard = self.wires.heard();
        self.report.tick = heard.steps.map_or(0, |steps| steps.tick);
        self.report.steps = self.report.tick;
        *lock(&self.heard) = heard;
        // Looked at by interval, so that a busy wire does not keep it awake.
        false
    }

    fn report(&self) -> Report {
        self.report
    }

    fn poll_interval(&self) -> Duration {
        LOOK
    }

    fn connect(&self) {
        self.wires.connect();
    }
}

fn lock(heard: &Mutex<Heard>) -> MutexGuard<'_, Heard> {
    // It is replaced as a whole: there is nothing half done in it.
    heard.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Where the page's figures come from.
struct Launch {
    socket: PathBuf,
    heard: Arc<Mutex<Heard>>,
}

impl Source for Launch {
    fn look(&self) -> Result<Robot, String> {
        let told = Told::by(&self.socket).map_err(|why| format!("launch does not answer: {why}"))?;
        let heard = *lock(&self.heard);
        Ok(shown(&told, &heard, Usage::of))
    }
}

/// A robot as the page has it.
fn shown(told: &Told, heard: &Heard, usage: impl Fn(u32) -> Option<Usage>) -> Robot {
    let status = told.status.clone();
    let of_measured = |measured: &Measured| {
        Box::new(robot::Measured {
            lateness: measured.taken.histogram(),
            step: measured.step.histogram(),
            age: measured.age.histogram(),
        })
    };
    let process = |one: &crate::manager::status::ProcessStatus| {
        let usage = usage(one.pid);
        robot::Process {
            slot: Some(one.slot as u64),
            role: one.name.clone(),
            law: one.law.clone(),
            pid: one.pid.into(),
            state: one.state.clone(),
            in_charge: one.authority,
            restarts: one.restarts,
            rejected: one.rejected,
            over_budget: one.counts.over_budget,
            page_faults: one.counts.page_faults,
            involuntary_switches: one.counts.involuntary_switches,
            cpu_s: usage.map(|usage| usage.cpu_s),
            resident_bytes: usage.map(|usage| usage.resident_bytes),
            measured: told.measured(one.slot).map(of_measured),
        }
    };
    let of_launch = usage(status.launch_pid);
    let launch = robot::Process {
        role: Role::Launch.name().to_owned(),
        pid: status.launch_pid.into(),
        state: status.mode.clone(),
        cpu_s: of_launch.map(|usage| usage.cpu_s),
        resident_bytes: of_launch.map(|usage| usage.resident_bytes),
        ..robot::Process::default()
    };
    Robot {
        processes: std::iter::once(launch).chain(status.processes.iter().map(process)).collect(),
        wires: heard.messages.iter().map(|(wire, messages)| ((*wire).to_owned(), *messages)).collect(),
        truth: heard.track.truth,
        cross_track_m: heard.track.estimate_m,
        cross_track_truth_m: heard.track.truth_m,
        name: status.robot,
        version: status.version,
        clock: status.clock,
        fault: status.fault.is_some(),
        mode: status.mode,
        path_state: status.path_state,
        uptime_s: status.uptime_s,
        tick: status.tick,
        ticks_late: status.ticks_late,
        paused_ticks: status.paused_ticks,
        commands_late: status.commands_late,
        commands_rejected: status.commands_rejected,
        cycles_without_command: status.cycles_without_command,
        commands_borrowed: status.commands_borrowed,
        promotions: status.promotions,
        swaps: status.swaps,
        waypoint: status.waypoint,
        waypoints: status.waypoints,
        pose: status.pose,
        speed_mps: status.speed_mps,
        omega_radps: status.omega_radps,
    }
}
