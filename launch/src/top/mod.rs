//! What `hilare top` shows: a robot between two looks.
//!
//! [`shown`](Shown::between) turns two looks into figures, [`screen`] lays them out as lines of text, [`terminal`]
//! puts lines on a terminal and takes keys.

pub mod screen;
pub mod terminal;

use crate::look::Told;
use crate::look::usage::Usage;
use crate::look::wires::Heard;
use crate::manager::measured::Distribution;
use crate::manager::status::ProcessStatus;
use hilare_interfaces::latency::{LatencyHistogram, upper_edge_ns};
use hilare_interfaces::wires::Role;
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Instant;

/// Bars of the lateness line: up to 1, 2, 4, ... 1024 µs, and above.
pub const BARS: usize = 12;

/// A look at a robot at some time.
pub struct Glance {
    /// When.
    pub at: Instant,
    /// What launch said.
    pub told: Told,
    /// What the wires had carried.
    pub heard: Heard,
    /// What its processes had taken of the machine, by pid.
    pub usage: BTreeMap<u32, Usage>,
}

impl Glance {
    /// Now.
    pub fn new(told: Told, heard: Heard) -> Self {
        let launch = std::iter::once(told.status.launch_pid);
        let pids = launch.chain(told.status.processes.iter().map(|process| process.pid));
        let usage = pids.filter_map(|pid| Some((pid, Usage::of(pid)?))).collect();
        Self { at: Instant::now(), told, heard, usage }
    }
}

/// Quantiles of a duration, µs; absent where nothing was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Median since the look before.
    pub p50: Option<f64>,
    /// 99 of 100 since the look before.
    pub p99: Option<f64>,
    /// The largest of all.
    pub max: Option<f64>,
}

impl Spread {
    fn between(before: Option<&Distribution>, now: &Distribution) -> Self {
        let all = now.histogram();
        let recent = before.map_or(all, |before| all.since(&before.histogram()));
        let us = |ns: u64| ns as f64 / 1e3;
        let of = |fraction| (recent.count > 0).then(|| us(recent.quantile_ns(fraction)));
        Self { p50: of(0.5), p99: of(0.99), max: (all.count > 0).then(|| us(all.max_ns)) }
    }
}

/// A line of the table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Process {
    /// Its place in the robot.
    pub slot: Option<usize>,
    /// Its box.
    pub name: String,
    /// What drives in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Its process id; 0 if it is not running.
    pub pid: u32,
    /// As in `hilare status`.
    pub state: String,
    /// Why, where there is more to say.
    pub reason: String,
    /// True for the controller in charge.
    pub authority: bool,
    /// What the kernel granted it.
    pub granted: String,
    /// Share of a processor, percent.
    pub cpu_percent: Option<f64>,
    /// Memory it has resident, bytes.
    pub resident_bytes: Option<u64>,
    /// Messages a second on the wire it writes.
    pub hz: Option<f64>,
    /// Of the clock how late it woke, of others how long messages were on their way, µs.
    pub lateness_us: Spread,
    /// Time of a step, µs.
    pub step_us: Spread,
    /// Times it was started again.
    pub restarts: u64,
}

/// Messages a second of a wire.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WireRate {
    /// Name of the wire.
    pub name: &'static str,
    /// Messages a second.
    pub hz: f64,
}

/// One frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Shown {
    /// The robot.
    pub robot: String,
    /// Version of its launch.
    pub version: String,
    /// Pid of its launch.
    pub launch_pid: u32,
    /// What drives the ticks.
    pub clock: String,
    /// What the operator wants.
    pub mode: String,
    /// Why the wheels turn as they do.
    pub drive: String,
    /// Why it cannot go on, if so.
    pub fault: Option<String>,
    /// Time since it was launched, s.
    pub uptime_s: f64,
    /// Ticks executed.
    pub tick: u64,
    /// Path progress.
    pub path_state: String,
    /// Current waypoint.
    pub waypoint: u64,
    /// The last waypoint.
    pub waypoint_last: u64,
    /// The controller in charge.
    pub in_charge: Option<String>,
    /// The controller that stands by.
    pub standby: Option<String>,
    /// Estimated pose: m, m, rad.
    pub pose: Option<[f64; 3]>,
    /// True pose, where it is simulated.
    pub truth: Option<[f64; 3]>,
    /// Commanded speed, m/s.
    pub speed_mps: f64,
    /// Commanded yaw rate, rad/s.
    pub omega_radps: f64,
    /// Distance of the estimated pose from the segment under way, m, positive to the left.
    pub cross_track_m: Option<f64>,
    /// The same of the true pose.
    pub cross_track_truth_m: Option<f64>,
    /// Wake-ups a tick or more late.
    pub ticks_late: u64,
    /// Ticks lost to pauses.
    pub paused_ticks: u64,
    /// Commands that came late.
    pub commands_late: u64,
    /// Commands refused.
    pub commands_rejected: u64,
    /// Control cycles without a command.
    pub cycles_without_command: u64,
    /// Control cycles driven by the standby's command.
    pub commands_borrowed: u64,
    /// Controllers and boxes swapped.
    pub swaps: u64,
    /// Workers started again.
    pub restarts: u64,
    /// Lateness of the ticks since the look before, samples up to 1, 2, 4, ... 1024 µs and above.
    pub lateness_bars: [u64; BARS],
    /// The processes, launch first.
    pub processes: Vec<Process>,
    /// The wires.
    pub wires: Vec<WireRate>,
}

impl Shown {
    /// What two looks come to.
    pub fn between(before: &Glance, now: &Glance) -> Self {
        let seconds = (now.at - before.at).as_secs_f64().max(1e-3);
        let status = now.told.status.clone();
        let named = |process: &ProcessStatus| process.law.clone().unwrap_or_else(|| process.name.clone());
        let controllers = || status.processes.iter().filter(|process| process.law.is_some());
        let clock = now.told.measured.iter().find(|one| one.name == Role::StepGenerator.name());
        let clock_before = clock.and_then(|clock| before.told.measured(clock.slot));
        let recent = clock.map(|clock| {
            let all = clock.taken.histogram();
            clock_before.map_or(all, |before| all.since(&before.taken.histogram()))
        });
        let rate = |(now, before): ((&'static str, u64), (&str, u64))| WireRate {
            name: now.0,
            hz: now.1.saturating_sub(before.1) as f64 / seconds,
        };
        let compare = Compare { before, now, seconds };
        let processes = std::iter::once(compare.launch());
        let processes = processes.chain(status.processes.iter().map(|process| compare.process(process)));
        Self {
            in_charge: controllers().find(|process| process.authority).map(named),
            standby: controllers().find(|one| !one.authority && one.state != "trial").map(named),
            restarts: now.told.restarts(),
            processes: processes.collect(),
            wires: now.heard.messages.into_iter().zip(before.heard.messages).map(rate).collect(),
            lateness_bars: recent.map_or([0; BARS], |recent| bars(&recent)),
            cross_track_m: now.heard.track.estimate_m,
            cross_track_truth_m: now.heard.track.truth_m,
            truth: now.heard.track.truth,
            robot: status.robot,
            version: status.version,
            launch_pid: status.launch_pid,
            clock: status.clock,
            mode: status.mode,
            drive: status.drive,
            fault: status.fault,
            uptime_s: status.uptime_s,
            tick: status.tick,
            path_state: status.path_state,
            waypoint: status.waypoint,
            waypoint_last: status.waypoints.saturating_sub(1),
            pose: status.pose,
            speed_mps: status.speed_mps,
            omega_radps: status.omega_radps,
            ticks_late: status.ticks_late,
            paused_ticks: status.paused_ticks,
            commands_late: status.commands_late,
            commands_rejected: status.commands_rejected,
            cycles_without_command: status.cycles_without_command,
            commands_borrowed: status.commands_borrowed,
            swaps: status.swaps,
        }
    }
}

struct Compare<'g> {
    before: &'g Glance,
    now: &'g Glance,
    seconds: f64,
}

impl Compare<'_> {
    fn cpu_percent(&self, pid: u32) -> Option<f64> {
        let (now, before) = (self.now.usage.get(&pid)?, self.before.usage.get(&pid)?);
        Some((now.cpu_s - before.cpu_s).max(0.0) / self.seconds * 100.0)
    }

    fn hz(&self, role: Role, slot: usize) -> Option<f64> {
        let (now, before) = (self.now.heard.pulse(role, slot)?, self.before.heard.pulse(role, slot)?);
        Some(now.saturating_sub(before) as f64 / self.seconds)
    }

    fn launch(&self) -> Process {
        let pid = self.now.told.status.launch_pid;
        Process {
            name: Role::Launch.name().to_owned(),
            pid,
            state: self.now.told.status.mode.clone(),
            cpu_percent: self.cpu_percent(pid),
            resident_bytes: self.now.usage.get(&pid).map(|usage| usage.resident_bytes),
            hz: self.hz(Role::Launch, 0),
            ..Process::default()
        }
    }

    fn process(&self, process: &ProcessStatus) -> Process {
        let (now, before) = (self.now.told.measured(process.slot), self.before.told.measured(process.slot));
        // Another box has been in its place.
        let before = before.filter(|before| Some(&before.name) == now.map(|now| &now.name));
        let spread = |of: fn(&crate::manager::measured::Measured) -> &Distribution| {
            now.map_or(Spread::default(), |now| Spread::between(before.map(of), of(now)))
        };
        Process {
            slot: Some(process.slot),
            name: process.name.clone(),
            law: process.law.clone(),
            pid: process.pid,
            state: process.state.clone(),
            reason: process.reason.clone(),
            authority: process.authority,
            granted: process.granted.clone(),
            cpu_percent: self.cpu_percent(process.pid),
            resident_bytes: self.now.usage.get(&process.pid).map(|usage| usage.resident_bytes),
            hz: Role::from_name(&process.name).and_then(|role| self.hz(role, process.slot)),
            lateness_us: spread(|one| &one.taken),
            step_us: spread(|one| &one.step),
            restarts: process.restarts,
        }
    }
}

/// Samples up to 1, 2, 4, ... µs; the last bar holds what is above.
fn bars(histogram: &LatencyHistogram) -> [u64; BARS] {
    let mut bars = [0; BARS];
    for (index, samples) in histogram.buckets.iter().enumerate().filter(|(_, samples)| **samples > 0) {
        let us = upper_edge_ns(index as u64).div_ceil(1000).max(1);
        let bar = us.next_power_of_two().trailing_zeros() as usize;
        bars[bar.min(BARS - 1)] += samples;
    }
    bars
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_count_every_sample_once() {
        let mut histogram = LatencyHistogram::ZERO;
        [0, 900, 1500, 3000, 60_000, 1_000_000, 5_000_000, u64::MAX]
            .into_iter()
            .for_each(|ns| histogram.record(ns));
        assert_eq!(bars(&histogram), [2, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1, 2]);
    }

    #[test]
    fn quantiles_are_of_what_came_since_and_the_largest_is_of_all() {
        let of = |samples: &[u64]| {
            let mut histogram = LatencyHistogram::ZERO;
            samples.iter().for_each(|ns| histogram.record(*ns));
            let filled = histogram.buckets.into_iter().enumerate().filter(|(_, n)| *n > 0).collect();
            Distribution { max_ns: histogram.max_ns, buckets: filled }
        };
        let (before, now) = (of(&[9000, 9000, 9000]), of(&[9000, 9000, 9000, 16, 17]));
        let spread = Spread::between(Some(&before), &now);
        assert_eq!(spread, Spread { p50: Some(0.016), p99: Some(0.017), max: Some(9.0) });
        assert_eq!(
            Spread::between(Some(&now), &now),
            Spread { max: Some(9.0), ..Spread::default() },
            "nothing came"
        );
        assert_eq!(Spread::between(None, &of(&[])), Spread::default());
    }
}
