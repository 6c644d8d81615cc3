//! Units for systemd: how a robot is started at boot, watched, restarted and fenced in.
//!
//! ```text
//! whole    hilare-ROBOT.service            launch, which starts its workers itself
//! split    hilare-ROBOT.target             all of it
//!          hilare-ROBOT-launch.service     launch, which waits for its workers to join
//!          hilare-ROBOT-ROLE.service       one a worker, started and restarted by systemd
//! ```
//!
//! Priorities, processors and restart budgets are those of the system; there is no second list.

mod sandbox;
mod split;
mod unit;

pub use unit::Unit;

use crate::config::System;
use crate::manager::LAUNCH_PRIORITY;
use crate::manager::notify::{LONGEST_END, LONGEST_START};
use crate::shell::worker::memory_rank;
use hilare_interfaces::wires::{self, Role};
use sandbox::Network;
use std::path::PathBuf;
use std::time::Duration;
use unit::command_line;

/// How long launch may be silent before it is ended and started again. The robot does not wait for that:
/// without launch's lease it stops by itself within a tenth of a second.
const WATCHDOG: Duration = Duration::from_secs(2);
/// Pause before launch is started again.
const RESTART_PAUSE: Duration = Duration::from_secs(1);
/// What is left out of the reckoning of how long an end takes: starting `hilare down`, a loaded machine.
const MARGIN: Duration = Duration::from_secs(2);
/// Exit code of wrong use or bad input, which no restart mends.
const BAD_INPUT: u8 = 2;

/// What units are wanted.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// The system; `system.robot` names the units.
    pub system: System,
    /// How the system is called on the command line: a built-in name or an absolute path.
    pub source: String,
    /// Keys set on top of it, `SECTION.KEY=VALUE`.
    pub set: Vec<String>,
    /// Absolute path of `hilare`.
    pub program: PathBuf,
    /// Whose service manager starts them.
    pub scope: Scope,
    /// One unit a process.
    pub split: bool,
}

/// Whose service manager starts the units.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Scope {
    /// The machine's; the processes run as this account.
    System {
        /// Name of the account.
        account: String,
    },
    /// That of the user who logs in.
    User,
}

/// The units, and what to do with them.
#[derive(Clone, Debug)]
pub struct Units {
    /// The files.
    pub units: Vec<Unit>,
    /// The unit that is enabled and started.
    pub main: String,
}

/// Writes the units. An error says what a unit file cannot hold.
pub fn units(wanted: &Wanted) -> Result<Units, String> {
    if wanted.split {
        return split::units(wanted);
    }
    let name = format!("{}.service", wanted.stem());
    Ok(Units { units: vec![whole(wanted, name.clone())?], main: name })
}

/// One unit: launch, and below it its workers.
fn whole(wanted: &Wanted, name: String) -> Result<Unit, String> {
    let mut unit = Unit::new(name);
    head(&mut unit, wanted, &format!("Robot {} (hilare)", wanted.system.robot));
    unit.section("Service");
    launch(&mut unit, wanted, &[])?;
    runtime_directory(&mut unit, wanted);
    unit.why("What the [realtime] sections ask for; launch's workers pin and raise themselves.");
    let highest = roles(&wanted.system).map(|role| wanted.system.realtime(role).priority).max().unwrap_or(0);
    limits(&mut unit, highest.max(LAUNCH_PRIORITY));
    match pinned(&wanted.system) {
        Some(cpus) => unit.set("CPUAffinity", cpus),
        None => {
            unit.why("No CPUAffinity: some processes may use any processor. cpu = -1 is the last one allowed here.");
        }
    }
    oom(&mut unit, wanted, Role::Launch);
    unit.why("If the kernel takes a worker, launch decides what follows.");
    unit.set("OOMPolicy", "continue");
    let network = Network::of(&wanted.system);
    sandbox::write(&mut unit, wanted.scope == Scope::User, network, &wanted.files());
    unit.section("Install");
    unit.set("WantedBy", wanted.wanted_by());
    Ok(unit)
}

/// Section `[Unit]` of launch, with its restart budget.
fn head(unit: &mut Unit, wanted: &Wanted, description: &str) {
    unit.section("Unit");
    unit.set("Description", description);
    let supervision = &wanted.system.supervision;
    let starts = supervision.restart_budget + 1;
    let window_s = supervision.restart_window_s + starts as f64 * RESTART_PAUSE.as_secs_f64();
    unit.why("supervision.restart_budget and restart_window_s, and the pauses in between.");
    unit.set("StartLimitBurst", starts);
    unit.set("StartLimitIntervalSec", seconds(window_s));
}

/// How launch is started, watched and ended.
fn launch(unit: &mut Unit, wanted: &Wanted, more: &[&str]) -> Result<(), String> {
    let robot = &wanted.system.robot;
    let mut arguments = vec!["up".to_owned(), wanted.source.clone(), "--robot".to_owned(), robot.clone()];
    for assignment in &wanted.set {
        arguments.extend(["--set".to_owned(), assignment.clone()]);
    }
    arguments.extend(more.iter().map(|argument| (*argument).to_owned()));
    unit.set("Type", "notify");
    unit.set("NotifyAccess", "main");
    unit.set("ExecStart", command_line(&wanted.program, &arguments)?);
    unit.why(
        "Stops the robot first and returns when launch is gone; a robot that is down already is no failure.",
    );
    let down = ["down", "--robot", robot].map(str::to_owned);
    unit.set("ExecStop", format!("-{}", command_line(&wanted.program, &down)?));
    unit.set("TimeoutStartSec", seconds((LONGEST_START + MARGIN).as_secs_f64()));
    unit.set("TimeoutStopSec", seconds((LONGEST_END + MARGIN).as_secs_f64()));
    unit.why("Fed by launch's own loop, and while the robot is armed only if its clock ticks.");
    unit.set("WatchdogSec", seconds(WATCHDOG.as_secs_f64()));
    unit.set("Restart", "on-failure");
    unit.set("RestartSec", seconds(RESTART_PAUSE.as_secs_f64()));
    unit.set("RestartPreventExitStatus", BAD_INPUT);
    unit.why("If launch is lost, its workers get SIGTERM: the step generator ramps the robot down before it leaves.");
    unit.set("KillMode", "control-group");
    Ok(())
}

/// The account and the directory for sockets.
fn runtime_directory(unit: &mut Unit, wanted: &Wanted) {
    if let Scope::System { account } = &wanted.scope {
        unit.set("User", account);
    }
    unit.set("RuntimeDirectory", wanted.stem());
    unit.set("RuntimeDirectoryMode", "0700");
    unit.why("An emergency stop is latched there: it stays on through every restart. All units of a robot share it.");
    unit.set("RuntimeDirectoryPreserve", "yes");
    unit.set("Environment", format!("HILARE_RUNTIME_DIR=%t/{}", wanted.stem()));
}

/// Limits for real time: the priority, and memory that can be locked.
fn limits(unit: &mut Unit, priority: u64) {
    unit.set("LimitRTPRIO", priority);
    unit.set("LimitMEMLOCK", "infinity");
}

/// Out of memory, the kernel takes what does not drive first.
fn oom(unit: &mut Unit, wanted: &Wanted, role: Role) {
    let score = memory_rank(role);
    // Only the system's service manager may ask for less than it has itself.
    if wanted.scope != Scope::User || score > 0 {
        unit.set("OOMScoreAdjust", score);
    }
}

/// The processors of a system whose every process is bound to a numbered one.
fn pinned(system: &System) -> Option<String> {
    let cpus: Option<std::collections::BTreeSet<i64>> =
        roles(system).map(|role| system.realtime(role).cpu).map(|cpu| (cpu >= 0).then_some(cpu)).collect();
    cpus.map(|cpus| cpus.iter().map(i64::to_string).collect::<Vec<_>>().join(" "))
}

/// The boxes of a robot that stays up: nothing is recorded.
fn roles(system: &System) -> impl Iterator<Item = Role> {
    let wanted = |role: &Role| match role {
        Role::Recorder => false,
        Role::Operator => system.has_operator(),
        _ => true,
    };
    wires::start_order().into_iter().filter(wanted)
}

/// A time span, whole seconds where it is.
fn seconds(seconds: f64) -> String {
    if seconds.fract() == 0.0 { format!("{seconds}s") } else { format!("{:.0}ms", seconds * 1e3) }
}

impl Wanted {
    /// Beginning of the names of units and runtime directory.
    fn stem(&self) -> String {
        format!("hilare-{}", self.system.robot)
    }

    fn wanted_by(&self) -> &'static str {
        if self.scope == Scope::User { "default.target" } else { "multi-user.target" }
    }

    /// Files the processes read.
    fn files(&self) -> Vec<&std::path::Path> {
        let controller = &self.system.controller;
        let texts = [&self.source, &self.system.map, &controller.exec, &controller.standby];
        std::iter::once(&*self.program).chain(texts.map(|text| text.as_ref())).collect()
    }
}
