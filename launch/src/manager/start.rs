//! From a claimed robot to workers that are all connected.

use super::children::{self, Start};
use super::control;
use super::member::Member;
use super::robot_dir::SOCKET;
use super::{Event, Failure, Job, LAUNCH_PRIORITY, Manager, START_PATIENCE};
use crate::config::Task;
use crate::shell::ClockKind;
use crate::shell::page::{Phase, SlotState};
use crate::shell::realtime;
use crate::shell::transport::write_config;
use crossbeam_channel::{Sender, bounded};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{GoalHeader, GoalKind, Waypoint};
use hilare_interfaces::wires::{self, Role};
use std::path::Path;
use std::time::{Duration, Instant};
use tracing::{info, warn};

impl Manager {
    pub(super) fn start_workers(&mut self) -> Result<(), Failure> {
        for slot in 0..self.members.len() {
            self.page.assign(slot, self.members[slot].role);
            self.spawn(slot).map_err(Failure::Fault)?;
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
        info!("{} workers at work", self.members.len());
        Ok(())
    }

    pub(super) fn spawn(&mut self, slot: usize) -> Result<(), String> {
        let epoch = self.next_epoch;
        self.next_epoch += 1;
        let member = &mut self.members[slot];
        member.epoch = epoch;
        member.incarnation += 1;
        member.health = None;
        let arguments = vec![
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
        ];
        let start =
            Start { role: member.role, slot, incarnation: member.incarnation, arguments, page: &self.page };
        let running = children::start(&start, &self.sender, &self.log)
            .map_err(|error| format!("cannot start {}: {error}", member.role.name()))?;
        member.running = Some(running);
        Ok(())
    }

    /// Waits until every worker has come as far as `state`, or one of them failed.
    fn await_all(&mut self, state: SlotState) -> Result<(), Failure> {
        let deadline = Instant::now() + START_PATIENCE;
        loop {
            // At work means that the first heartbeat, with what the kernel granted, is there as well.
            let missing = (0..self.members.len()).find(|slot| {
                self.page.state(*slot) < state
                    || (state == SlotState::Working && self.members[*slot].health.is_none())
            });
            let Some(missing) = missing else { return Ok(()) };
            self.step(Duration::from_millis(1));
            if let Some(fault) = self.fault.take() {
                return Err(Failure::Fault(fault));
            }
            if self.interrupted || self.down {
                return Err(Failure::Fault("interrupted while starting".to_owned()));
            }
            if Instant::now() > deadline {
                let name = self.members[missing].role.name();
                return Err(Failure::Fault(format!("{name} did not start within {START_PATIENCE:?}")));
            }
        }
    }

    /// Waits until the waypoint selector has the path, so that the run begins with it at tick 0.
    fn await_path(&mut self, task: &Task) -> Result<(), Failure> {
        let (reply, answer) = bounded(1);
        if let Task::Reach(goal) = task {
            let header = GoalHeader { kind: GoalKind::Point.code(), ..GoalHeader::ZERO };
            self.send_goal(header, vec![Waypoint::from(*goal)], reply);
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
            if self.interrupted || Instant::now() > deadline {
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
            .filter(|member| self.job.system.realtime(member.role).priority > 0)
            .filter(|member| member.health.is_none_or(|health| health.granted_fifo == 0))
            .map(|member| member.role.name())
            .collect();
        if !refused.is_empty() {
            warn!(
                "SCHED_FIFO was refused for {}: best effort, ticks may be late; allow it with `ulimit -r 99`, \
                 LimitRTPRIO=99 or CAP_SYS_NICE (hilare doctor)",
                refused.join(", ")
            );
        }
    }
}

pub(super) fn write_files(dir: &Path, job: &Job) -> Result<(), Failure> {
    let write = |name: &str, text: String| {
        let file = dir.join(name);
        std::fs::write(&file, text).map_err(|e| Failure::Refused(format!("{}: {e}", file.display())))
    };
    write("system.toml", job.system.to_toml())?;
    if let Some(Task::Follow(waypoints)) = &job.task {
        write("waypoints.csv", hilare_planner::waypoint_file::write(waypoints))?;
    }
    write_config(dir, &job.system.robot).map_err(|e| Failure::Refused(e.to_string()))
}

/// The system's workers, readers before the writers that wake them, the clock last.
pub(super) fn roles(job: &Job) -> impl Iterator<Item = Role> + use<> {
    let recorder = job.record;
    wires::start_order().into_iter().filter(move |role| *role != Role::Recorder || recorder)
}

pub(super) fn listen(dir: &Path, sender: &Sender<Event>) -> Result<(), Failure> {
    let calls = sender.clone();
    control::listen(&dir.join(SOCKET), move |call| {
        let _ = calls.send(Event::Call(call));
    })
    .map_err(|error| Failure::Fault(format!("control socket: {error}")))
}

/// Signals that end a launch come as events.
pub(super) fn catch_signals(sender: &Sender<Event>) -> Result<(), Failure> {
    let fault = |error: std::io::Error| Failure::Fault(format!("signals: {error}"));
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
