//! From a claimed robot to workers that are all connected.

use super::children::{self, Running, Start};
use super::control;
use super::join::Workers;
use super::member::{Duty, Member};
use super::robot_dir::SOCKET;
use super::{Event, Failure, Job, LAUNCH_PRIORITY, Manager, START_PATIENCE};
use crate::config::{Driver, Task};
use crate::shell::ClockKind;
use crate::shell::page::{Phase, SharedPage, SlotState};
use crate::shell::realtime;
use crate::shell::transport::write_config;
use crossbeam_channel::{Sender, bounded};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{GoalHeader, GoalKind, Waypoint};
use hilare_interfaces::wires::{self, Role};
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};
use tracing::{info, warn};

impl Manager {
    pub(super) fn start_workers(&mut self) -> Result<(), Failure> {
        for slot in 0..self.members.len() {
            self.page.assign(slot, self.members[slot].role);
            if self.members[slot].duty != Duty::Vacant {
                self.spawn(slot).map_err(Failure::Fault)?;
            }
        }
        self.await_all(SlotState::Ready)?;
        self.page.set_phase(Phase::Go);
        self.await_all(SlotState::Working)?;
        // After the children, which shall not inherit it.
        let _ = realtime::set_fifo(LAUNCH_PRIORITY, true);
        if let Some(task) = self.job.task.clone() {
            self.await_path(&task)?;
        }
        self.report_grants();
        self.up = true;
        let wanted = self.members.iter().filter(|member| member.duty != Duty::Vacant).count();
        info!("{wanted} workers at work");
        Ok(())
    }

    pub(super) fn spawn(&mut self, slot: usize) -> Result<(), String> {
        let epoch = self.next_epoch;
        self.next_epoch += 1;
        let realtime = self.job.system.realtime(self.members[slot].role);
        let spare_cpu = self.spare_cpu();
        let member = &mut self.members[slot];
        member.epoch = epoch;
        member.incarnation += 1;
        member.health = None;
        let spare = matches!(member.duty, Duty::Standby | Duty::Trial);
        let mut arguments = vec![
            "--runtime-dir".to_owned(),
            self.dir.path().display().to_string(),
            "--slot".to_owned(),
            slot.to_string(),
            "--epoch".to_owned(),
            epoch.to_string(),
            "--incarnation".to_owned(),
            member.incarnation.to_string(),
            "--clock".to_owned(),
            self.job.clock.to_string(),
            "--launch-pid".to_owned(),
            std::process::id().to_string(),
            "--system".to_owned(),
            if member.duty == Duty::Trial { self.systems.trial } else { self.systems.current }.to_string(),
            format!("--cpu={}", if spare { spare_cpu } else { realtime.cpu }),
        ];
        match &member.driver {
            Some(Driver::Law(law)) => arguments.extend(["--law".to_owned(), (*law).to_owned()]),
            Some(Driver::Exec(program)) => {
                arguments.extend(["--exec".to_owned(), program.display().to_string()]);
            }
            None => {}
        }
        if member.joined {
            member.invitation = Some(arguments);
            return Ok(());
        }
        let start = Start {
            role: member.role,
            slot,
            incarnation: member.incarnation,
            arguments,
            page: &self.page,
            realtime: self.job.clock == ClockKind::Real,
            sweeper: &self.sweeper,
        };
        let running = children::start(&start, &self.sender, &self.log)
            .map_err(|error| format!("cannot start {}: {error}", member.role.name()))?;
        self.began(slot, running);
        Ok(())
    }

    /// A process was started, or has joined, in this place.
    pub(super) fn began(&mut self, slot: usize, running: Running) {
        let member = &mut self.members[slot];
        member.began(running);
        if member.duty == Duty::Work && member.role == Role::Controller {
            // Another process, even if in the same place.
            self.authority.term += 1;
        }
        self.send_authority();
    }

    /// Waits until every worker has come as far as `state`, or one of them failed.
    fn await_all(&mut self, state: SlotState) -> Result<(), Failure> {
        let deadline = Instant::now() + START_PATIENCE;
        loop {
            // At work means that the first heartbeat is there as well.
            let missing = (0..self.members.len()).find(|slot| {
                let member = &self.members[*slot];
                member.duty != Duty::Vacant
                    && !member.is_foreign()
                    && (self.page.state(*slot) < state
                        || (state == SlotState::Working && member.health.is_none()))
            });
            let Some(missing) = missing else { return Ok(()) };
            self.step(Duration::from_millis(1));
            if let Some(fault) = self.fault.take() {
                return Err(Failure::Fault(fault));
            }
            if self.told_to_end() {
                return Err(Failure::Interrupted);
            }
            if Instant::now() > deadline {
                let name = self.members[missing].role.name();
                let start = if self.members[missing].invitation.is_some() { "join" } else { "start" };
                return Err(Failure::Fault(format!("{name} did not {start} within {START_PATIENCE:?}")));
            }
        }
    }

    /// Waits until the waypoint selector has the path, so that the run begins with it at tick 0.
    fn await_path(&mut self, task: &Task) -> Result<(), Failure> {
        let (reply, answer) = bounded(1);
        if let Task::Reach(goal) = task {
            let header = GoalHeader { kind: GoalKind::Point.code(), ..GoalHeader::ZERO };
            self.send_goal(header, vec![Waypoint::from(*goal)], reply, "the scenario");
        }
        let deadline = Instant::now() + START_PATIENCE;
        let has_path = |member: &Member| {
            member.role == Role::WaypointSelector && member.health.is_some_and(|health| health.path_id > 0)
        };
        while !self.members.iter().any(has_path) {
            self.step(Duration::from_millis(1));
            if let Some(fault) = self.fault.take() {
                return Err(Failure::Fault(fault));
            }
            if let Some(refused) = answer.try_recv().ok().filter(|answer| !answer.ok) {
                return Err(Failure::Fault(format!("the planner: {}", refused.message)));
            }
            if self.told_to_end() {
                return Err(Failure::Interrupted);
            }
            if Instant::now() > deadline {
                return Err(Failure::Fault("the path did not reach the waypoint selector".to_owned()));
            }
        }
        Ok(())
    }

    /// Says in one line what was asked of the kernel and refused.
    fn report_grants(&self) {
        if self.job.clock != ClockKind::Real {
            return;
        }
        let refused: Vec<&str> = self
            .members
            .iter()
            .filter(|member| member.duty != Duty::Vacant && !member.is_foreign())
            .filter(|member| self.job.system.realtime(member.role).priority > 0)
            .filter(|member| member.granted().is_none_or(|granted| !granted.fifo))
            .map(|member| member.role.name())
            .collect();
        if !refused.is_empty() {
            let highest =
                self.members.iter().map(|member| self.job.system.realtime(member.role).priority).max();
            let why = realtime::FifoRefusal::find(highest.unwrap_or(1));
            warn!(
                "SCHED_FIFO was refused for {}: {why}; best effort, ticks may be late; {}",
                refused.join(", "),
                why.cure()
            );
        }
    }
}

pub(super) fn write_files(dir: &Path, job: &Job) -> Result<(), Failure> {
    if let Some(Task::Follow(waypoints)) = &job.task {
        let file = dir.join("waypoints.csv");
        std::fs::write(&file, hilare_planner::waypoint_file::write(waypoints))
            .map_err(|e| Failure::Refused(format!("{}: {e}", file.display())))?;
    }
    if let Some(order) = &job.recording {
        order.leave_in(dir).map_err(Failure::Refused)?;
    }
    write_config(dir, &job.system.robot).map_err(|e| Failure::Refused(e.to_string()))
}

/// The system's workers, readers before the writers that wake them, the clock last; and places for the
/// standby, for a controller on trial, and for one that is leaving meanwhile.
pub(super) fn members(job: &Job) -> Vec<Member> {
    let controller = &job.system.controller;
    let wanted = |role: &Role| match role {
        Role::Recorder => job.record,
        Role::Operator => job.system.has_operator(),
        _ => true,
    };
    let roles = wires::start_order().into_iter().filter(wanted);
    let mut members: Vec<Member> = roles
        .map(|role| Member::new(role, Duty::Work, (role == Role::Controller).then(|| controller.driver())))
        .collect();
    let standby = controller.standby();
    let duty = if standby.is_some() { Duty::Standby } else { Duty::Vacant };
    members.push(Member::new(Role::Controller, duty, standby));
    members.extend([0; 2].map(|_| Member::new(Role::Controller, Duty::Vacant, None)));
    if job.workers == Workers::Joined {
        // A program that is not ours knows no place to ask for: launch starts it.
        members
            .iter_mut()
            .for_each(|member| member.joined = member.duty != Duty::Vacant && !member.is_foreign());
    }
    members
}

pub(super) fn listen(dir: &Path, page: &SharedPage, sender: &Sender<Event>) -> Result<(), Failure> {
    let failed = |error: io::Error| Failure::Fault(format!("control socket: {error}"));
    let calls = sender.clone();
    let page = page.descriptor().map_err(failed)?;
    control::listen(&dir.join(SOCKET), page, move |call| {
        let _ = calls.send(Event::Call(call));
    })
    .map_err(failed)
}

/// Signals that end a launch come as events.
pub(super) fn catch_signals(sender: &Sender<Event>) -> Result<(), Failure> {
    let fault = |error: io::Error| Failure::Fault(format!("signals: {error}"));
    let interrupts = sender.clone();
    let mut signals =
        signal_hook::iterator::Signals::new([libc::SIGINT, libc::SIGTERM, libc::SIGHUP]).map_err(&fault)?;
    std::thread::Builder::new()
        .name("signals".into())
        .stack_size(128 << 10)
        .spawn(move || {
            for _ in signals.forever() {
                let _ = interrupts.send(Event::Interrupt);
            }
        })
        .map_err(fault)?;
    Ok(())
}
