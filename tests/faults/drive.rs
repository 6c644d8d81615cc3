//! A real robot on its way, with a witness beside it.

use super::cast::{Seen, Witness};
use super::host::{Bystanders, Stalls};
use super::seeds::Figures;
use super::watch::drive;
use crate::support::{Ended, Lab, PATIENCE, Running, comes_true, number, pid_of, process, wait_until};
use hilare_interfaces::messages::{Drive as Why, Steps};
use rustix::process::Signal;
use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

/// `hilare run` under way.
pub struct Drive<'l> {
    /// Its laboratory.
    pub lab: &'l Lab,
    /// Its name.
    pub robot: String,
    /// Launch.
    pub run: Running,
    /// What is seen of every tick.
    pub witness: Witness,
    host: Bystanders,
    out: PathBuf,
}

/// What is left of a drive.
pub struct Told {
    /// How launch ended.
    pub ended: Ended,
    /// `summary.json`, if there is one.
    pub summary: Value,
    /// Every tick the witness saw.
    pub seen: Vec<Seen>,
    /// What the host did meanwhile.
    pub stalls: Stalls,
    /// The log of all processes.
    pub log: String,
}

impl<'l> Drive<'l> {
    /// `hilare run JOB --set …`, in real time. Deaths by hand are no fault of a box, and a pause of a shared host
    /// shall not stop the robot.
    pub fn start(lab: &'l Lab, suffix: &str, job: &[&str], set: &[&str]) -> Self {
        Self::start_as(lab, suffix, job, set, Running::start)
    }

    /// The same, started by `start`, which may redirect its output.
    pub fn start_as(
        lab: &'l Lab,
        suffix: &str,
        job: &[&str],
        set: &[&str],
        start: impl FnOnce(Command) -> Running,
    ) -> Self {
        let robot = lab.robot_named(suffix);
        let out = lab.dir().join(format!("report-{suffix}"));
        let mut command = lab.command(&["run"]);
        command.args(job).args(["--robot", &robot, "--out"]).arg(&out);
        for key in ["supervision.restart_budget=10000", "timing.pause_stop_ticks=0"].iter().chain(set) {
            command.args(["--set", key]);
        }
        let host = Bystanders::start();
        let run = start(command);
        let witness = Witness::start(lab, &robot);
        Self { lab, robot, run, witness, host, out }
    }

    /// Waits until a tick is over.
    #[track_caller]
    pub fn await_tick(&mut self, tick: u64) {
        let come = comes_true(PATIENCE, || self.witness.newest().tick >= tick || !self.run.lives());
        if !come || self.witness.newest().tick < tick {
            let log = std::fs::read_to_string(self.out.join("hilare.log")).unwrap_or_default();
            panic!("no tick {tick}, the witness is at {}:\n{log}", self.witness.newest().tick);
        }
    }

    /// The status; waits for it.
    pub fn status(&self) -> Value {
        self.lab.await_status(&self.robot, "a status", |_| true)
    }

    /// Waits until the controller in charge has a warm standby.
    pub fn await_standby(&self) -> Value {
        self.lab.await_status(&self.robot, "a warm standby", |status| {
            let processes = status["processes"].as_array();
            processes.is_some_and(|all| all.iter().any(|one| one["state"] == "standby"))
        })
    }

    /// Pid of a box, or of the controller in charge.
    pub fn pid(&self, name: &str) -> i32 {
        let status = self.status();
        if name != "controller" {
            return pid_of(&status, name);
        }
        let processes = status["processes"].as_array().expect("processes");
        let in_charge = processes.iter().find(|one| one["name"] == name && one["authority"] == true);
        let pid = in_charge.and_then(|one| one["pid"].as_i64()).unwrap_or(0);
        i32::try_from(pid).ok().filter(|pid| *pid > 1).unwrap_or_else(|| panic!("no controller: {status}"))
    }

    /// Sends a signal to a box, and returns the last tick seen before.
    pub fn strike(&mut self, name: &str, signal: Signal) -> Steps {
        let pid = self.pid(name);
        let before = self.witness.newest();
        process::signal(pid, signal);
        before
    }

    /// Waits for a box to be back: another process, at work.
    pub fn await_successor(&self, name: &str, restarts: u64) {
        self.lab.await_status(&self.robot, "a successor at work", |status| {
            let processes = status["processes"].as_array();
            let back = |one: &Value| {
                // A planner without a goal is ready for one.
                let idle = if name == "planner" { "" } else { "ready" };
                let working = ["dead", "starting", idle].iter().all(|state| one["state"] != *state);
                one["name"] == name && number(one, "restarts") >= restarts as f64 && working
            };
            processes.is_some_and(|all| all.iter().any(back))
        });
    }

    /// Waits for its end.
    pub fn end(self, code: i32) -> Told {
        let ended = self.run.wait(3 * PATIENCE).expect_code(code);
        let stalls = self.host.end();
        let seen = self.witness.end();
        let read = |file: &str| std::fs::read_to_string(self.out.join(file)).unwrap_or_default();
        let summary = serde_json::from_str(&read("summary.json")).unwrap_or(Value::Null);
        let told = Told { ended, summary, seen, stalls, log: read("hilare.log") };
        assert!(!told.ended.stderr.contains("panicked") && !told.log.contains("panicked"), "{}", told.log);
        wait_until("everybody has left", || self.lab.processes().is_empty());
        told
    }
}

impl Told {
    /// Why the host has spoilt this run, if it has.
    pub fn spoilt(&self) -> Option<String> {
        late(&self.seen, &self.stalls)
    }

    /// Its bits are those of `simulated`. Why the host has spoilt it, if they are not for that reason: a command
    /// that the host made late may change them.
    #[track_caller]
    pub fn same_bits(self, simulated: &Value) -> Result<Self, String> {
        let mut keys = ["state_hash", "ticks", "steps", "final_pose"].into_iter();
        let Some(key) = keys.find(|key| self.summary[*key] != simulated[*key]) else { return Ok(self) };
        let spoilt = self.spoilt();
        spoilt.map_or_else(
            || panic!("{key}: not as without the fault, {:?}\n{}\n{}", self.stalls, self.summary, self.log),
            Err,
        )
    }

    /// Every cycle had a command of its own. Why the host has spoilt it, if not for that reason.
    #[track_caller]
    pub fn no_cycle_lost(self) -> Result<Self, String> {
        if number(&self.summary, "cycles_without_command") == 0.0 {
            return Ok(self);
        }
        let spoilt = self.spoilt();
        spoilt.map_or_else(
            || panic!("cycles were lost, {:?}\n{}\n{}", self.stalls, self.summary, self.log),
            Err,
        )
    }

    /// What a box that died left the robot without, ms each, from the log.
    pub fn outages_ms(&self) -> Vec<f64> {
        let of = |line: &str| {
            let (_, rest) = line.split_once(" is back after ")?;
            rest.strip_suffix(" ms")?.parse().ok()
        };
        self.log.lines().filter_map(of).collect()
    }

    /// Every tick seen after `tick`.
    pub fn after(&self, tick: u64) -> impl Iterator<Item = &Steps> {
        self.seen.iter().map(|seen| &seen.steps).filter(move |steps| steps.tick > tick)
    }
}

/// The figures of a job in one thread.
pub fn simulated(lab: &Lab, job: &[&str]) -> Value {
    let ended = lab.hilare(&[&["run"], job, &["--clock", "in-process", "--json"]].concat()).expect_code(0);
    serde_json::from_str(&ended.stdout).expect("JSON")
}

/// At the tick of the arrival the wheels have made the steps of a run in one thread, and no cycle was lost: what
/// is to be said of a run that has lost its report.
#[track_caller]
pub fn same_steps(seen: &[Seen], simulated: &Value) {
    let ticks = number(simulated, "ticks") as u64;
    let last = seen.iter().find(|seen| seen.steps.tick == ticks).expect("the tick of the arrival").steps;
    let steps = [0, 1].map(|wheel| simulated["steps"][wheel].as_i64().expect("steps"));
    assert_eq!([last.counts[0], last.counts[1]], steps, "not the steps of a run without the fault");
    assert_eq!(last.cycles_without_command, 0, "{last:?}");
}

/// Why the host has spoilt a run, if it has: commands came late, just after the host had stalled a bare
/// loop, or the lease ran out while the host stalled one for longer than its renewal. What came late without is
/// the robot's own doing, or a fault's.
pub fn late(seen: &[Seen], stalls: &Stalls) -> Option<String> {
    let more_late = |pair: &&[Seen]| pair[1].steps.commands_late > pair[0].steps.commands_late;
    let late = seen.windows(2).filter(more_late).map(|pair| (pair[1].steps.tick, pair[1].ns));
    let late: Vec<_> = late.map(|(tick, ns)| (tick, stalls.boxes_before(ns))).collect();
    let lease_lost = seen.iter().any(|seen| drive(&seen.steps) == Why::LeaseLost);
    let commands = late.iter().any(|(_, stalled)| *stalled);
    let lease = lease_lost && stalls.lease();
    let what =
        format!("commands late at ticks, after a stall {late:?}; lease lost {lease_lost}, stalled {lease}");
    if !late.is_empty() || lease_lost {
        println!("{what}");
    }
    (commands || lease).then_some(what)
}

/// Runs of a drive at most, if the host spoils them.
const ATTEMPTS: u32 = 6;

/// Runs again what the host has spoilt, as bare loops beside the run have measured; how often goes into the
/// figures. A run that the host has not spoilt counts.
#[track_caller]
pub fn unless_spoilt<T>(figures: &mut Figures, mut run: impl FnMut(u32) -> Result<T, String>) -> T {
    let mut why = Vec::new();
    for attempt in 0..ATTEMPTS {
        match run(attempt) {
            Ok(result) => {
                if attempt > 0 {
                    figures.sum("{} runs spoilt by the host", f64::from(attempt));
                }
                return result;
            }
            Err(spoilt) => why.push(spoilt),
        }
    }
    panic!("the host has spoilt every run: {why:?}");
}

/// Waits a while, by the wall clock: the moment of a fault, never a measure.
pub fn sleep_ms(ms: u64) {
    std::thread::sleep(Duration::from_millis(ms));
}
