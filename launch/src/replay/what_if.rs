//! What was driven and what would have been, side by side.

use super::boxes::controller;
use super::closed::midway::moved;
use super::closed::{Driven, drive};
use super::fields::Difference;
use super::log::RunLog;
use super::states::States;
use crate::report::overlay::{Run, write_overlay};
use crate::report::raster::Format;
use hilare_controller::LawSpec;
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_interfaces::messages::ReferenceState;
use hilare_recorder::RunRecord;
use hilare_recorder::assembler::Assembler;
use hilare_recorder::statistics::RunFigures;
use serde::Serialize;
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};

/// Keys and sections (with a dot) that say nothing to a replay: no process, no clock, no file is in it.
const WITHOUT_EFFECT: [&str; 7] =
    ["robot", "realtime.", "wake_up.", "supervision.", "recording.", "controller.exec", "controller.standby"];

/// Figures of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The last waypoint was accepted.
    pub reached: bool,
    /// Time until then, or in all.
    pub duration_s: f64,
    /// Mean distance of the truth to the path.
    pub cross_track_mean_m: f64,
    /// Greatest distance.
    pub cross_track_max_m: f64,
    /// Mean |v − v_r| of the commanded speed.
    pub speed_error_mean_mps: f64,
    /// Control cycles without a command of their own.
    pub cycles_without_command: u64,
    /// Hash of every bit of the estimated pose over all ticks.
    pub state_hash: u64,
}

impl From<RunFigures> for Figures {
    fn from(figures: RunFigures) -> Self {
        Self {
            reached: figures.reached,
            duration_s: figures.ticks as f64 / TICKS_PER_SECOND as f64,
            cross_track_mean_m: figures.cross_track_mean_m,
            cross_track_max_m: figures.cross_track_max_m,
            speed_error_mean_mps: figures.speed_error_mean_mps,
            cycles_without_command: figures.cycles_without_command,
            state_hash: figures.state_hash,
        }
    }
}

/// Both drives.
#[derive(Clone, Debug, Serialize)]
pub struct WhatIf {
    /// What was recorded.
    pub run: String,
    /// What was changed.
    pub changes: Vec<String>,
    /// What was driven.
    pub recorded: Figures,
    /// What would have been.
    pub changed: Figures,
    /// Where the estimated poses part; nothing if they never do.
    pub parted: Option<Difference>,
    /// What is to be said of the drives.
    pub notes: Vec<String>,
    /// Pictures of both.
    pub pictures: Vec<PathBuf>,
}

/// Refuses a key that would change nothing, in a line.
pub fn check_keys(set: &[String]) -> Result<(), String> {
    for assignment in set {
        let key = assignment.split('=').next().unwrap_or_default().trim();
        let idle = |known: &&str| key == *known || (known.ends_with('.') && key.starts_with(*known));
        if WITHOUT_EFFECT.iter().any(idle) {
            return Err(format!(
                "--set {key}: without effect in a replay, which has no processes; leave it away"
            ));
        }
    }
    Ok(())
}

/// Figures and curves of what was recorded.
pub fn recorded(log: &RunLog, period_ticks: u64) -> RunRecord {
    let mut record = RunRecord::new(period_ticks);
    let mut assembler = Assembler::new(period_ticks);
    for tick in log.begin..=log.end {
        log.references.first(tick).into_iter().for_each(|reference| assembler.push_reference(*reference));
        if tick == log.begin {
            continue;
        }
        log.steps.first(tick).into_iter().for_each(|steps| assembler.push_steps(*steps));
        log.poses.first(tick).into_iter().for_each(|pose| assembler.push_pose(*pose));
        log.truths.first(tick).into_iter().for_each(|truth| assembler.push_truth(*truth));
        if tick.is_multiple_of(512) {
            assembler.drain(|tick| record.push(tick));
        }
    }
    assembler.finish(|tick| record.push(tick));
    // One that ends with its arrival has no tick that knows of it.
    let last = log.references.between(None, log.end).last();
    if last.is_some_and(|last| last.state == ReferenceState::Arrived.code()) {
        record.statistics.note_arrival();
    }
    record
}

/// Both drives, and what they came to.
pub struct Compared {
    /// In words and numbers.
    pub what_if: WhatIf,
    recorded: RunRecord,
    changed: Driven,
}

/// Drives again with changes.
pub fn compare(log: RunLog, set: &[String], law: Option<&'static LawSpec>) -> Result<Compared, String> {
    check_keys(set)?;
    let period = |log: &RunLog| log.first_system().map_or(1, |system| system.timing.period_ticks);
    let log = moved(log)?;
    let recorded = recorded(&log, period(&log));
    let (_, lost) = controller::replay(&log, &mut States::new(&log), false);
    let mut notes = log.overruled(set);
    if log.begin > 0 {
        notes.push(format!(
            "begun in mid-drive: both drives and their figures are from tick {} on",
            log.begin
        ));
    }
    let changed_log = log.changed(set, law)?;
    let changed = drive(&changed_log, &lost)?;
    notes.extend_from_slice(&changed.notes);
    let law = law.map(|law| format!("controller.law={}", law.name));
    let what_if = WhatIf {
        run: changed_log.title.name.clone(),
        changes: set.iter().cloned().chain(law).collect(),
        recorded: recorded.statistics.figures().into(),
        changed: changed.record.statistics.figures().into(),
        parted: changed.parted.get("pose").and_then(|parted| parted.first.clone()),
        notes,
        pictures: Vec::new(),
    };
    Ok(Compared { what_if, recorded, changed })
}

impl Compared {
    /// Draws both drives into a directory.
    pub fn draw(&mut self, dir: &Path) -> io::Result<()> {
        // A drive with several paths is shown beside the first of them.
        let waypoints = self.changed.paths.values().next().map_or(&[][..], |(_, waypoints)| waypoints);
        let runs = [
            Run { name: "recorded", rows: self.recorded.trace.rows() },
            Run { name: "what if", rows: self.changed.record.trace.rows() },
        ];
        self.what_if.pictures =
            write_overlay(dir, ("what-if", "what if"), &[waypoints], &runs, (Format::Svg, None))?;
        Ok(())
    }
}

impl WhatIf {
    /// A table of both.
    pub fn to_text(&self) -> String {
        let mut text = format!("{}; what if {}\n", self.run, self.changes.join(", "));
        let _ = writeln!(text, "  {:<26}{:>16}{:>16}", "", "recorded", "what if");
        let mut line = |name: &str, of: &dyn Fn(&Figures) -> String| {
            let _ = writeln!(text, "  {name:<26}{:>16}{:>16}", of(&self.recorded), of(&self.changed));
        };
        line("arrived", &|f| if f.reached { "yes" } else { "no" }.to_owned());
        line("time", &|f| format!("{:.3} s", f.duration_s));
        line("cross-track, mean", &|f| format!("{:.3} mm", f.cross_track_mean_m * 1e3));
        line("cross-track, greatest", &|f| format!("{:.3} mm", f.cross_track_max_m * 1e3));
        line("speed error, mean", &|f| format!("{:.3} mm/s", f.speed_error_mean_mps * 1e3));
        line("cycles without command", &|f| f.cycles_without_command.to_string());
        match &self.parted {
            None => text.push_str("The poses never part.\n"),
            Some(first) => {
                let _ = writeln!(text, "The poses part at {}", first.in_words());
            }
        }
        self.notes.iter().for_each(|note| text.push_str(&format!("  {note}\n")));
        self.pictures.iter().for_each(|file| text.push_str(&format!("{}\n", file.display())));
        text
    }
}
