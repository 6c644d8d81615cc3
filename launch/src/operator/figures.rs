//! A robot as `/metrics` has it.

use crate::look::Told;
use crate::look::usage::Usage;
use crate::look::wires::Heard;
use crate::manager::measured::Measured;
use hilare_interfaces::wires::Role;
use hilare_operator::robot::{self, Robot};

/// What launch says, what the wires carry and what the kernel counts, as one.
pub fn robot(told: &Told, heard: &Heard, usage: impl Fn(u32) -> Option<Usage>) -> Robot {
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
