//! What launch says, four times a second: status, measurements, log.

use super::hello::{hello, launch};
use super::orders::for_page;
use super::{Shared, lock};
use crate::config::System;
use crate::look::Told;
use crate::manager::control::{Request, ask};
use crate::manager::status::{ProcessStatus, Status};
use crate::shell::worker::{Worker, system_file};
use hilare_interfaces::latency::{LatencyHistogram, upper_edge_ns};
use hilare_interfaces::wires::Role;
use hilare_operator::message::Line;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time between two looks.
const LOOK: Duration = Duration::from_millis(250);
/// Longest time in which it is not seen that the robot ends.
const NAP: Duration = Duration::from_millis(50);
/// Time without an answer after which launch is taken for gone.
const SILENCE: Duration = Duration::from_secs(3);
/// Answers with log lines in one look.
const LOG_ANSWERS: usize = 8;

/// What is known of launch.
#[derive(Clone, Debug)]
pub struct Slow {
    /// What the operator wants, as in `hilare status`.
    pub mode: String,
    /// What is in charge.
    pub law: Option<String>,
    /// What stands by.
    pub standby: Option<String>,
    /// Why the robot cannot go on, if so.
    pub fault: Option<String>,
    /// Why it has to be armed again, if so.
    pub halted: Option<String>,
    /// How the robot ends, if in good order.
    pub ended: Option<String>,
    /// Number of the system file in force.
    pub system: u64,
    /// The robot has ended.
    pub down: bool,
    answered: Instant,
}

impl Default for Slow {
    fn default() -> Self {
        Self {
            mode: "starting".to_owned(),
            law: None,
            standby: None,
            fault: None,
            halted: None,
            ended: None,
            system: 0,
            down: false,
            answered: Instant::now(),
        }
    }
}

impl Slow {
    /// Takes over what launch has just said.
    pub fn note(&mut self, status: &Status) {
        let named = |wanted: &dyn Fn(&ProcessStatus) -> bool| {
            status.processes.iter().find(|one| wanted(one)).and_then(|one| one.law.clone())
        };
        self.law = named(&|one| one.authority);
        self.standby = named(&|one| one.state == "standby" && !one.authority);
        let why = status.fault.as_deref().map(for_page);
        let (fault, halted) = if status.halted { (None, why) } else { (why, None) };
        (self.fault, self.halted) = (fault, halted);
        (self.mode, self.ended, self.system) = (status.mode.clone(), status.ended.clone(), status.system);
        self.answered = Instant::now();
    }

    /// Nobody launches the robot any more.
    pub fn is_gone(&self) -> bool {
        self.down || self.answered.elapsed() > SILENCE
    }
}

/// Asks launch and tells the pages.
pub struct Teller {
    shared: Arc<Shared>,
    clock: String,
    launch: String,
    system: System,
    number: u64,
    hello: Value,
    lines: u64,
}

impl Teller {
    /// For the worker that has the page.
    pub fn new(shared: Arc<Shared>, worker: &Worker) -> Self {
        Self {
            launch: launch(&shared.runtime_dir),
            shared,
            clock: worker.assignment.clock.to_string(),
            system: worker.system.clone(),
            number: worker.assignment.system,
            hello: Value::Null,
            lines: 0,
        }
    }

    /// Never ends.
    pub fn tell_for_ever(&mut self) {
        self.greet();
        loop {
            self.look();
            // The last lines of all say why it has ended.
            for _ in 0..LOOK.as_millis() / NAP.as_millis() {
                std::thread::sleep(NAP);
                if lock(&self.shared.slow).down {
                    break;
                }
            }
        }
    }

    fn greet(&mut self) {
        let hello = hello(&self.system, &self.clock, &self.launch);
        if hello != self.hello {
            self.shared.live.set_hello(&hello);
            self.hello = hello;
        }
    }

    fn look(&mut self) {
        let Ok(told) = Told::by(&self.shared.socket) else { return };
        lock(&self.shared.slow).note(&told.status);
        if told.status.system != self.number {
            let file = self.shared.runtime_dir.join(system_file(told.status.system));
            if let Ok(system) = System::load(&file.to_string_lossy()) {
                (self.system, self.number) = (system, told.status.system);
                self.greet();
            }
        }
        self.shared.live.set_status(&status(&told));
        for _ in 0..LOG_ANSWERS {
            let answer = ask(&self.shared.socket, &Request::Log { after: self.lines });
            let Some((count, said)) = answer.ok().and_then(|answer| answer.log) else { return };
            if said.is_empty() {
                return;
            }
            self.lines = count;
            let offset_s = clock_s(ClockId::Realtime) - clock_s(ClockId::Monotonic);
            self.shared.live.add_lines(said.into_iter().map(|line| Line {
                time: ((line.at_s + offset_s) * 1e3).round(),
                level: match line.level.as_str() {
                    "ERROR" => "error",
                    "WARN" => "warn",
                    _ => "info",
                },
                text: line.text,
            }));
        }
    }
}

fn clock_s(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// Microseconds with one decimal, as far as there is anything measured.
fn us(ns: u64) -> f64 {
    (ns as f64 / 100.0).round() / 10.0
}

/// Samples by powers of two of a microsecond: upper bound, µs, and how many. None above the longest, but those
/// below the shortest there are.
fn by_octaves(histogram: &LatencyHistogram) -> Vec<(u64, u64)> {
    let mut octaves: Vec<(u64, u64)> = Vec::new();
    for (index, samples) in histogram.buckets.iter().enumerate().filter(|(_, samples)| **samples > 0) {
        let bound_us = (upper_edge_ns(index as u64) + 1).div_ceil(1000).next_power_of_two();
        let mut next = octaves.last().map_or(1, |(bound, _)| bound * 2);
        while next <= bound_us {
            octaves.push((next, 0));
            next *= 2;
        }
        if let Some((_, count)) = octaves.last_mut() {
            *count += samples;
        }
    }
    octaves
}

fn quantiles(histogram: &LatencyHistogram) -> [f64; 3] {
    [histogram.quantile_ns(0.5), histogram.quantile_ns(0.99), histogram.max_ns].map(us)
}

/// What is shown slowly.
fn status(told: &Told) -> Value {
    let of = |role: Role| told.measured.iter().find(|one| one.name == role.name());
    let in_charge = told.status.processes.iter().find(|one| one.authority).map(|one| one.slot);
    let controller = in_charge.and_then(|slot| told.measured(slot)).or_else(|| of(Role::Controller));
    let clock = of(Role::StepGenerator).map(|one| one.taken.histogram()).unwrap_or_default();
    let [p50, p99, max] = quantiles(&clock);
    let hops = [
        ("steps → pose", of(Role::PoseEstimator).map(|one| &one.taken)),
        ("pose → reference", of(Role::WaypointSelector).map(|one| &one.taken)),
        ("reference → command", controller.map(|one| &one.taken)),
        ("the whole cycle", controller.map(|one| &one.age)),
        ("command waits for its tick", of(Role::StepGenerator).map(|one| &one.age)),
        ("steps → plant", of(Role::Plant).map(|one| &one.taken)),
    ];
    let hops = hops.into_iter().filter_map(|(name, measured)| {
        let histogram = measured?.histogram();
        let [p50, p99, max] = quantiles(&histogram);
        (histogram.count > 0).then(|| json!({ "name": name, "p50_us": p50, "p99_us": p99, "max_us": max }))
    });
    let processes = told.status.processes.iter().map(|one| {
        let late = told.measured(one.slot).map(|measured| measured.taken.histogram());
        let late = late.filter(|histogram| histogram.count > 0).map(|histogram| us(histogram.quantile_ns(0.99)));
        let left = told.status.ended.is_some() && one.state == "dead";
        let state = if left { "left" } else { &one.state };
        json!({
            "name": one.name, "law": one.law, "authority": one.authority, "state": state, "reason": one.reason,
            "restarts": one.restarts, "late_p99_us": late,
        })
    });
    json!({
        "lateness": {
            "buckets": by_octaves(&clock),
            "quantiles": (clock.count > 0).then(|| json!({ "p50": p50, "p99": p99, "max": max })),
        },
        "hops": hops.collect::<Vec<_>>(),
        "processes": processes.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octaves_leave_nothing_out() {
        let mut histogram = LatencyHistogram::ZERO;
        assert_eq!(by_octaves(&histogram), []);
        [0, 900, 1500, 90_000, 100_000, 3_000_000].into_iter().for_each(|ns| histogram.record(ns));
        let octaves = by_octaves(&histogram);
        assert_eq!(octaves.iter().map(|(_, samples)| samples).sum::<u64>(), 6);
        let count = |bound| octaves.iter().find(|(at, _)| *at == bound).map(|(_, samples)| *samples);
        assert_eq!((count(2), count(128), count(4096)), (Some(1), Some(2), Some(1)), "{octaves:?}");
        assert!(octaves.windows(2).all(|pair| pair[1].0 == 2 * pair[0].0), "{octaves:?}");
        assert_eq!(octaves.last().map(|(bound, _)| *bound), Some(4096));
    }

    #[test]
    fn a_fault_is_told_from_a_stop_that_ends_when_it_is_armed() {
        let mut slow = Slow::default();
        let status = |halted| Status { fault: Some("why".to_owned()), halted, ..Status::default() };
        slow.note(&status(true));
        assert_eq!((slow.fault.as_deref(), slow.halted.as_deref()), (None, Some("why")));
        slow.note(&status(false));
        assert_eq!((slow.fault.as_deref(), slow.halted.as_deref()), (Some("why"), None));
        assert!(!slow.is_gone());
        slow.down = true;
        assert!(slow.is_gone());
    }
}
