//! What is known of a robot at a time.

use hilare_interfaces::latency::LatencyHistogram;

/// A robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Version of hilare its launch is of.
    pub version: String,
    /// What drives the ticks.
    pub clock: String,
    /// What the operator wants, as in `hilare status`.
    pub mode: String,
    /// Path progress.
    pub path_state: String,
    /// It cannot go on, or not before it is armed again.
    pub fault: bool,
    /// Time since it was launched, s.
    pub uptime_s: f64,
    /// Ticks executed.
    pub tick: u64,
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
    /// Times the standby took charge.
    pub promotions: u64,
    /// Controllers and boxes swapped.
    pub swaps: u64,
    /// Current waypoint.
    pub waypoint: u64,
    /// Waypoints of the path.
    pub waypoints: u64,
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
    /// Its processes, launch first.
    pub processes: Vec<Process>,
    /// Wires, and messages that came over them since the page looks.
    pub wires: Vec<(String, u64)>,
}

/// A process of a robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Process {
    /// Its place in the robot; launch has none.
    pub slot: Option<u64>,
    /// Its box.
    pub role: String,
    /// What drives in it.
    pub law: Option<String>,
    /// Its process id; 0 if it is not running.
    pub pid: u64,
    /// As in `hilare status`.
    pub state: String,
    /// True for the controller in charge.
    pub in_charge: bool,
    /// Times it was started again.
    pub restarts: u64,
    /// Messages missing or refused at its rim; of relay and recorder, lost ones.
    pub rejected: u64,
    /// Steps that took longer than they may.
    pub over_budget: u64,
    /// Page faults.
    pub page_faults: u64,
    /// Times something else took the processor from it.
    pub involuntary_switches: u64,
    /// Processor time, s.
    pub cpu_s: Option<f64>,
    /// Memory it has resident, bytes.
    pub resident_bytes: Option<u64>,
    /// What it measures of itself; launch and programs that are not ours measure nothing.
    pub measured: Option<Box<Measured>>,
}

/// What a process measures of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Time messages were on their way to it; of the clock, how late it woke.
    pub lateness: LatencyHistogram,
    /// Time of a step.
    pub step: LatencyHistogram,
    /// Age of the steps its answers are based on; of the clock, time a command was ready before it was taken in.
    pub age: LatencyHistogram,
}
