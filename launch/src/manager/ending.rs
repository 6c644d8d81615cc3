//! The end of a launch: the robot rests, the recorder is heard, everybody leaves, nothing is left.

use super::member::Member;
use super::{LEAVE_PATIENCE, Manager, Outcome, REST_PATIENCE};
use crate::shell::ClockKind;
use crate::shell::observer::TRACE_FILE;
use crate::shell::page::Phase;
use hilare_interfaces::messages::Mode;
use hilare_interfaces::wires::Role;
use rustix::process::Signal;
use std::time::{Duration, Instant};
use tracing::warn;

/// Time the recorder has to write what waits for the disk.
const DISK_PATIENCE: Duration = Duration::from_secs(10);

impl Manager {
    /// Stops the robot, lets everybody leave and collects what they left.
    pub fn end(mut self) -> Outcome {
        let _ = self.set_mode(Mode::Stop, "launch, which ends");
        self.await_rest();
        self.await_recorder();
        self.leave();
        self.look();
        Outcome {
            trace_csv: std::fs::read_to_string(self.dir.path().join(TRACE_FILE)).ok(),
            handover: self.handover.take(),
            lateness: self.timings().lateness.quantiles(),
            swaps: self.swaps,
            param_changes: self.params.made,
            drove: std::mem::take(&mut self.drove_names),
            restarts: self.members.iter().map(|member| member.restarts).sum(),
            fault: self.fault.take(),
            interrupted: self.interrupted || self.down,
        }
    }

    /// How it ends, in good order and with everybody leaving.
    pub(super) fn ended(&self) -> Option<&'static str> {
        let runs = self.job.task.is_some();
        match self.mode() {
            _ if !self.leaving || self.fault.is_some() => None,
            _ if runs && self.arrived() => Some("arrived"),
            _ if self.down => Some("taken down"),
            _ if self.interrupted => Some("interrupted"),
            // It waits for an operator it does not have.
            _ if self.halted.is_some() => None,
            Mode::EStop => Some("emergency stop"),
            _ => Some("not arrived"),
        }
    }

    fn await_rest(&mut self) {
        let deadline = Instant::now() + REST_PATIENCE;
        let clock_lives =
            |this: &Self| this.members.iter().any(|m| m.role == Role::StepGenerator && m.running.is_some());
        while self.job.clock == ClockKind::Real
            && self.newest.steps.twist != [0.0; 3]
            && clock_lives(self)
            && Instant::now() < deadline
        {
            self.step(Duration::from_millis(2));
        }
    }

    /// The recorder has read what there is, and the plant has told of it, before the writers go.
    fn await_recorder(&mut self) {
        // The tick after the arrival is the first that knows of it.
        let target = self.newest.steps.tick.max(self.newest.reference.tick + 1);
        let deadline = Instant::now() + REST_PATIENCE;
        while self.page.least_progress(&[Role::Recorder, Role::Plant]) < target && Instant::now() < deadline {
            self.step(Duration::from_millis(2));
        }
    }

    /// Everybody leaves: asked, then told, then killed. Boxes first, then the relay, then who looks: so every wire of a
    /// recording ends where the robot did.
    pub(super) fn leave(&mut self) {
        self.leaving = true;
        self.page.set_phase(Phase::Leave);
        let started = Instant::now();
        let mut harder =
            [(LEAVE_PATIENCE / 2, Signal::TERM), (LEAVE_PATIENCE, Signal::KILL)].into_iter().peekable();
        // Who records may have to wait for a slow disk.
        let recorder_s = if self.job.recording.is_some() { DISK_PATIENCE } else { Duration::ZERO };
        while self.members.iter().any(|member| member.running.is_some()) {
            self.step(Duration::from_millis(5));
            let there = self.members.iter().filter(|member| member.running.is_some());
            let first = there.map(|member| Phase::leaves(member.role)).min().unwrap_or(Phase::AllLeave);
            // Whoever does not go keeps nobody else.
            let next = if started.elapsed() > LEAVE_PATIENCE / 4 { Phase::AllLeave } else { first };
            if next > self.page.phase() {
                self.page.set_phase(next);
            }
            let records = |member: &Member| {
                member.role == Role::Recorder && member.running.is_some() && started.elapsed() < recorder_s
            };
            if let Some((_, signal)) = harder.next_if(|(after, _)| started.elapsed() > *after) {
                self.signal_all(signal, |member| !records(member));
            }
            // The kernel lets nobody go who waits for a device; its page is no reason to wait with it.
            if started.elapsed() > LEAVE_PATIENCE + REST_PATIENCE && !self.members.iter().any(records) {
                return self.signal_all(Signal::KILL, |_| true);
            }
        }
    }

    fn signal_all(&self, signal: Signal, whom: impl Fn(&Member) -> bool) {
        for member in self.members.iter().filter(|member| whom(member)) {
            if let Some(running) = &member.running {
                warn!("{} (pid {}) does not leave: {signal:?}", member.name(), running.pid);
                running.signal(signal);
            }
        }
    }
}
