//! What `hilare status` shows.

use super::Counts;
use crate::logging::plain;
use serde::{Deserialize, Deserializer, Serialize};

/// State of a robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Status {
    /// Its name.
    pub robot: String,
    /// Version of hilare its launch is of.
    pub version: String,
    /// Process id of its launch.
    pub launch_pid: u32,
    /// Time since it was launched, s.
    pub uptime_s: f64,
    /// What drives the ticks.
    pub clock: String,
    /// What the operator wants: disarmed, armed, stop, e-stop; `starting` until all workers are at work.
    pub mode: String,
    /// Why the wheels turn as they do.
    pub drive: String,
    /// Ticks executed.
    pub tick: u64,
    /// Path progress: idle, tracking, arrived.
    pub path_state: String,
    /// Current waypoint.
    pub waypoint: u64,
    /// Waypoints of the path, the start (waypoint 0) included.
    pub waypoints: u64,
    /// Estimated pose: m, m, rad; absent until the robot was armed for the first time.
    #[serde(deserialize_with = "three_numbers")]
    pub pose: Option<[f64; 3]>,
    /// Commanded speed, m/s.
    #[serde(deserialize_with = "number")]
    pub speed_mps: f64,
    /// Commanded yaw rate, rad/s.
    #[serde(deserialize_with = "number")]
    pub omega_radps: f64,
    /// Wake-ups of the clock a tick or more late.
    pub ticks_late: u64,
    /// Commands that came late.
    pub commands_late: u64,
    /// Commands refused.
    pub commands_rejected: u64,
    /// Why the last of them was, if any was.
    pub last_refusal: Option<String>,
    /// Control cycles without a command.
    pub cycles_without_command: u64,
    /// Control cycles driven by the standby's command for want of one from the controller in charge.
    pub commands_borrowed: u64,
    /// Times the standby took charge.
    pub promotions: u64,
    /// Controllers and boxes swapped.
    pub swaps: u64,
    /// Whole ticks the clock lost to pauses.
    pub paused_ticks: u64,
    /// Changes of parameters since it is up.
    #[serde(default)]
    pub param_changes: u64,
    /// The last of them, in words.
    #[serde(default)]
    pub last_param_change: Option<String>,
    /// Why the robot cannot go on, if so.
    pub fault: Option<String>,
    /// It can: it only has to be armed again.
    pub halted: bool,
    /// How it ends, if it does and in good order: arrived, not arrived, emergency stop (of a run), interrupted, taken down.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ended: Option<String>,
    /// Number of the system file in force, in the runtime directory.
    pub system: u64,
    /// Where the operator's page is, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub page: Option<String>,
    /// Where Foxglove and Lichtblick connect to, if they can.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foxglove: Option<String>,
    /// The processes.
    pub processes: Vec<ProcessStatus>,
}

/// State of a process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ProcessStatus {
    /// Its place in the robot; commands name it, counted from 1, as their source.
    pub slot: usize,
    /// Its box.
    pub name: String,
    /// What drives in it, if it is a controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Its process id; 0 if it is not running.
    pub pid: u32,
    /// starting, ready, running, standby, trial, leaving, degraded, dead; awaited: it has not joined yet.
    pub state: String,
    /// Why, where there is more to say.
    pub reason: String,
    /// Times it was started again.
    pub restarts: u64,
    /// Newest tick it has worked on.
    pub tick: u64,
    /// Messages that were missing or refused at its rim; of relay and recorder, lost ones.
    pub rejected: u64,
    /// True for the controller in charge.
    pub authority: bool,
    /// What the kernel granted: `fifo:80 cpu:1 mlock`; empty for nothing.
    pub granted: String,
    /// What has kept it from its work.
    #[serde(flatten)]
    pub counts: Counts,
}

/// JSON has `null` for what is no number, which a worker gone wrong may have put on its wire.
fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

fn three_numbers<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    let numbers: Option<[Option<f64>; 3]> = Option::deserialize(from)?;
    Ok(numbers.map(|numbers| numbers.map(|number| number.unwrap_or(f64::NAN))))
}

impl Status {
    /// The status for people. Nothing in it moves their cursor: reasons are the words of any program.
    pub fn to_text(&self) -> String {
        let drive = if self.mode == self.drive { String::new() } else { format!(", {}", self.drive) };
        let mut text = format!(
            "{} ({} clock, launch {}): {}{drive}\n",
            self.robot, self.clock, self.launch_pid, self.mode
        );
        if let Some(fault) = &self.fault {
            text.push_str(&format!("  fault     {fault}\n"));
        }
        if let Some(page) = &self.page {
            text.push_str(&format!("  page      {page}\n"));
        }
        if let Some(foxglove) = &self.foxglove {
            text.push_str(&format!("  foxglove  {foxglove}\n"));
        }
        let pose = self.pose.map_or("not known before the robot is armed".to_owned(), |[x, y, theta]| {
            format!("x {x:.4} m, y {y:.4} m, heading {theta:.3} rad")
        });
        text.push_str(&format!(
            "  path      {}, waypoint {} of {}\n  pose      {pose}\n  \
             command   {:.4} m/s, {:.3} rad/s at tick {}\n  counters  {} late, {} refused, {} cycles without, {} ticks paused\n",
            self.path_state,
            self.waypoint,
            self.waypoints.saturating_sub(1),
            self.speed_mps,
            self.omega_radps,
            self.tick,
            self.commands_late,
            self.commands_rejected,
            self.cycles_without_command,
            self.paused_ticks,
        ));
        if let Some(why) = &self.last_refusal {
            text.push_str(&format!("  refused   {why}\n"));
        }
        if let Some(last) = &self.last_param_change {
            let times =
                if self.param_changes == 1 { "1 change" } else { &format!("{} changes", self.param_changes) };
            text.push_str(&format!("  params    {times}, the last: {last}\n"));
        }
        text.push_str(&format!(
            "  {:<26}{:>8}  {:<10}{:>9}  {}\n",
            "process", "pid", "state", "restarts", "granted"
        ));
        for process in &self.processes {
            let law = process.law.as_ref().map_or(String::new(), |law| format!(" ({law})"));
            let name = format!("{}{law}{}", process.name, if process.authority { " *" } else { "" });
            text.push_str(&format!(
                "  {:<26}{:>8}  {:<10}{:>9}  {} {}\n",
                name,
                process.pid,
                process.state,
                process.restarts,
                process.granted,
                plain(&process.reason)
            ));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_arrives_even_if_its_numbers_are_none() {
        let status = Status {
            pose: Some([1.0, f64::NAN, f64::INFINITY]),
            speed_mps: f64::NEG_INFINITY,
            ..Status::default()
        };
        let text = serde_json::to_string(&status).unwrap();
        let back: Status = serde_json::from_str(&text).unwrap();
        let [x, y, theta] = back.pose.unwrap();
        assert!(
            x == 1.0 && y.is_nan() && theta.is_nan() && back.speed_mps.is_nan() && back.omega_radps == 0.0
        );
        let without: Status =
            serde_json::from_str(&serde_json::to_string(&Status::default()).unwrap()).unwrap();
        assert_eq!(without, Status::default());
    }

    #[test]
    fn a_reason_cannot_clear_the_screen() {
        let process = ProcessStatus { reason: "\u{1b}[2Jall is well".to_owned(), ..ProcessStatus::default() };
        let text = Status { processes: vec![process], ..Status::default() }.to_text();
        assert!(text.contains("all is well") && !text.contains('\u{1b}'), "{text:?}");
    }
}
