//! One unit a process: systemd starts and restarts the workers, launch watches the robot.
//!
//! Launch is ordered after its workers, which wait for it to listen and then join. So launch is ready when
//! the robot is up, and when everything is stopped it is launch that goes first and stops the robot, before
//! any worker leaves.

use super::sandbox::Network;
use super::unit::{Unit, command_line};
use super::{BAD_INPUT, MARGIN, Scope, Units, Wanted, head, launch, limits, oom, runtime_directory};
use super::{sandbox, seconds};
use crate::manager::LAUNCH_PRIORITY;
use crate::manager::join::joiners;
use crate::manager::notify::LONGEST_END;
use hilare_interfaces::wires::Role;
use std::time::Duration;

/// Pause before a worker is started again: the robot waits for it.
const WORKER_PAUSE: Duration = Duration::from_millis(10);

/// A worker's unit.
struct Worker {
    role: Role,
    standby: bool,
    unit: String,
}

pub(super) fn units(wanted: &Wanted) -> Result<Units, String> {
    let main = format!("{}.target", wanted.stem());
    let workers: Vec<Worker> = joiners(&wanted.system)
        .into_iter()
        .map(|(role, standby)| Worker { role, standby, unit: service_name(wanted, role, standby) })
        .collect();
    let names: Vec<&str> = workers.iter().map(|worker| worker.unit.as_str()).collect();
    let names = names.join(" ");
    let mut units = vec![target(wanted, &main, &names), launch_unit(wanted, &main, &names)?];
    for worker in &workers {
        units.push(worker_unit(wanted, worker, &main)?);
    }
    Ok(Units { units, main })
}

fn service_name(wanted: &Wanted, role: Role, standby: bool) -> String {
    // Who stands by and who drives changes in the course of a day; the units are two of a kind.
    let number = if standby { "-2" } else { "" };
    format!("{}-{}{number}.service", wanted.stem(), role.name())
}

fn target(wanted: &Wanted, main: &str, workers: &str) -> Unit {
    let mut unit = Unit::new(main.to_owned());
    unit.section("Unit");
    unit.set("Description", format!("Robot {} (hilare), one unit a process", wanted.system.robot));
    unit.set("Wants", format!("{} {workers}", service_name(wanted, Role::Launch, false)));
    unit.section("Install");
    unit.set("WantedBy", wanted.wanted_by());
    unit
}

fn launch_unit(wanted: &Wanted, main: &str, workers: &str) -> Result<Unit, String> {
    let mut unit = Unit::new(service_name(wanted, Role::Launch, false));
    head(&mut unit, wanted, &format!("Robot {} (hilare): launch", wanted.system.robot));
    unit.set("PartOf", main);
    unit.why(
        "After the workers: ready means that all have joined, and at the end launch stops the robot first.",
    );
    unit.set("Wants", workers);
    unit.set("After", workers);
    unit.section("Service");
    launch(&mut unit, wanted, &["--workers", "joined"])?;
    runtime_directory(&mut unit, wanted);
    limits(&mut unit, LAUNCH_PRIORITY);
    oom(&mut unit, wanted, Role::Launch);
    sandbox::write(&mut unit, wanted.scope == Scope::User, Network::None, &wanted.files());
    Ok(unit)
}

fn worker_unit(wanted: &Wanted, worker: &Worker, main: &str) -> Result<Unit, String> {
    let (robot, role) = (&wanted.system.robot, worker.role);
    let mut unit = Unit::new(worker.unit.clone());
    unit.section("Unit");
    unit.set(
        "Description",
        format!("Robot {robot} (hilare): {}{}", role.name(), if worker.standby { ", one more" } else { "" }),
    );
    unit.set("PartOf", main);
    let supervision = &wanted.system.supervision;
    unit.why("One start more than launch's own budget: it is launch that gives up, and says why.");
    unit.set("StartLimitBurst", supervision.restart_budget + 2);
    unit.set("StartLimitIntervalSec", seconds(supervision.restart_window_s));
    unit.section("Service");
    unit.set("Type", "exec");
    let arguments = ["service", role.name(), "--join", robot].map(str::to_owned);
    unit.set("ExecStart", command_line(&wanted.program, &arguments)?);
    unit.why(
        "It ends in good order when launch says so, and with an error when it was killed or launch is gone.",
    );
    unit.set("Restart", "on-failure");
    unit.set("RestartSec", seconds(WORKER_PAUSE.as_secs_f64()));
    unit.set("RestartPreventExitStatus", BAD_INPUT);
    unit.set("TimeoutStopSec", seconds((LONGEST_END + MARGIN).as_secs_f64()));
    runtime_directory(&mut unit, wanted);
    scheduling(&mut unit, wanted, role);
    oom(&mut unit, wanted, role);
    // The others keep their walls: it is the page alone that is asked from outside.
    let network = if role == Role::Operator { Network::of(&wanted.system) } else { Network::None };
    sandbox::write(&mut unit, wanted.scope == Scope::User, network, &wanted.files());
    Ok(unit)
}

/// What `[realtime.ROLE]` asks for.
fn scheduling(unit: &mut Unit, wanted: &Wanted, role: Role) {
    let realtime = wanted.system.realtime(role);
    if realtime.priority > 0 {
        if wanted.scope == Scope::User {
            unit.why("The worker raises itself: a user's service manager may lack the right to, and would then not start it.");
        } else {
            unit.set("CPUSchedulingPolicy", "fifo");
            unit.set("CPUSchedulingPriority", realtime.priority);
        }
        limits(unit, realtime.priority);
    }
    match realtime.cpu {
        _ if role == Role::Controller && wanted.system.controller.standby().is_some() => {
            unit.why("Launch places the controllers: the one that stands by is on a processor of its own.");
        }
        cpu if cpu >= 0 => unit.set("CPUAffinity", cpu),
        -1 => unit.why("cpu = -1: the worker binds itself to the last processor it may use."),
        _ => unit.why("cpu = -2: any processor."),
    }
}
