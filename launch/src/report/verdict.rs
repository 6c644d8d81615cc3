//! What is printed when a run ends: its figures beside the published ones, its timing, its outcome.

use super::{Correction, Summary};
use crate::config::Published;
use hilare_interfaces::geometry::wrap_angle_rad;
use std::f64::consts::PI;
use std::fmt::Write;

/// Widest line, characters.
const WIDTH: usize = 100;
/// Width of the names on the left.
const NAME: usize = 20;
/// Width of the run's own column.
const OWN: usize = 22;
/// Published columns a table has at most; more go into a further table.
const COLUMNS: usize = 3;
/// Width of each, with the two blanks before it.
const COLUMN: usize = (WIDTH - NAME - OWN) / COLUMNS;

/// Width of the names beside corrections.
const NAMES: usize = 52;

const BOLD: &str = "1";
const GREEN: &str = "1;32";
const RED: &str = "1;31";
const YELLOW: &str = "33";

/// The text printed at the end of a run: at most 100 columns (but for words that are longer), ends
/// in a newline. `stopped_by` says why the run ended before it arrived, where that is known. Colour
/// codes only with `color`.
pub fn verdict_text(
    summary: &Summary,
    published: &[Published],
    stopped_by: Option<&str>,
    color: bool,
) -> String {
    let pen = Pen { color };
    let mut text = String::new();
    let title = format!("{}, {}, {} clock", summary.scenario, summary.controller, summary.clock);
    paragraph(&mut text, "", &title, |line| pen.paint(BOLD, line));
    text.push('\n');
    // Columns for those who did the same job; who only corrected a deviation has a line below.
    let (whole, corrected): (Vec<&Published>, Vec<&Published>) = published
        .iter()
        .partition(|row| row.cross_track_mean_m.is_some() || row.speed_error_mean_mps.is_some());
    // Without a published figure there is still one table, of the run alone.
    let chunks = whole.chunks(COLUMNS).chain(whole.is_empty().then_some(&whole[..]));
    for chunk in chunks {
        table(&mut text, summary, chunk, pen);
        text.push('\n');
    }
    if let Some(correction) = &summary.correction {
        corrections(&mut text, correction, &corrected);
        text.push('\n');
    }
    if whole.iter().any(|row| is_measured(row)) {
        let note = "measured on a real robot seen by a camera: slip and an unsure start are in it";
        paragraph(&mut text, "* ", note, str::to_owned);
        text.push('\n');
    }
    timing(&mut text, summary, pen);
    text.push('\n');
    outcome(&mut text, summary, stopped_by, pen);
    text
}

fn is_measured(row: &Published) -> bool {
    row.source.to_lowercase().contains("measured")
}

/// Colours a text, or leaves it.
#[derive(Clone, Copy)]
struct Pen {
    color: bool,
}

impl Pen {
    fn paint(self, code: &str, text: &str) -> String {
        if self.color { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }
}

fn table(text: &mut String, summary: &Summary, published: &[&Published], pen: Pen) {
    let heads: Vec<Vec<String>> = published
        .iter()
        .map(|row| wrap(&format!("{}{}", row.source, if is_measured(row) { " *" } else { "" }), COLUMN - 2))
        .collect();
    let height = heads.iter().map(Vec::len).max().unwrap_or(1).max(1);
    for line in 0..height {
        // Heads stand on the line below them, so a short one is at the bottom.
        let own = if line + 1 == height { "this run" } else { "" };
        let mut row = format!("{:NAME$}{own:>OWN$}", "");
        for head in &heads {
            let cell = (line + head.len()).checked_sub(height).map_or("", |at| &head[at]);
            let _ = write!(row, "{cell:>COLUMN$}");
        }
        let _ = writeln!(text, "{}", pen.paint(BOLD, row.trim_end()));
    }
    let _ = writeln!(text, "{}", "-".repeat(NAME + OWN + COLUMN * published.len()));
    for (name, own, theirs) in rows(summary) {
        let mut row = format!("{name:NAME$}{own:>OWN$}");
        for published in published {
            let cell = theirs.map_or(String::new(), |of| of(published).unwrap_or_else(|| "-".to_owned()));
            let _ = write!(row, "{cell:>COLUMN$}");
        }
        let _ = writeln!(text, "{}", row.trim_end());
    }
}

/// How the deviation at the start was corrected, ours first.
fn corrections(text: &mut String, ours: &Correction, published: &[&Published]) {
    let band = match ours.band.heading_rad {
        rad if rad < PI => format!("{}, {:.1} deg", millimetres(ours.band.cross_track_m), rad.to_degrees()),
        _ => millimetres(ours.band.cross_track_m),
    };
    let cell = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    let mut row = |name: &str, time_s: Option<f64>, travel_m: Option<f64>, steady_m: Option<f64>| {
        let time = cell(time_s.map(|s| format!("{s:.3} s")));
        let travel = cell(travel_m.map(|m| format!("{m:.3} m")));
        let steady = cell(steady_m.map(millimetres));
        let names = wrap(name, NAMES - 2);
        for more in &names[1..] {
            let _ = writeln!(text, "{more}");
        }
        let _ = writeln!(text, "{:NAMES$}{time:>12}{travel:>12}{steady:>14}", names[0]);
    };
    row("this run", ours.time_s, ours.travel_m, Some(ours.steady_cross_track_m));
    for theirs in published {
        row(
            &theirs.source,
            theirs.correction_time_s,
            theirs.correction_travel_m,
            theirs.steady_cross_track_m,
        );
    }
    let note = format!(
        "corrected to within {band} after this time and way; {} overshoots; then at most this far off, {} in heading",
        ours.overshoots,
        degrees(ours.steady_heading_rad)
    );
    paragraph(text, "", &note, str::to_owned);
}

type Theirs = fn(&Published) -> Option<String>;

/// Name, this run's value, how to get the published one.
fn rows(summary: &Summary) -> Vec<(&'static str, String, Option<Theirs>)> {
    let (pose, truth) = (summary.final_pose, summary.final_truth);
    let off_m = (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m);
    let off_rad = wrap_angle_rad(pose.theta_rad - truth.theta_rad).abs();
    let cross_track: Theirs = |row| row.cross_track_mean_m.map(millimetres);
    let speed: Theirs = |row| row.speed_error_mean_mps.map(millimetres_a_second);
    vec![
        ("cross-track mean", millimetres(summary.cross_track_mean_m), Some(cross_track)),
        ("cross-track max", millimetres(summary.cross_track_max_m), None),
        ("speed error mean", millimetres_a_second(summary.speed_error_mean_mps), Some(speed)),
        ("true speed error", millimetres_a_second(summary.speed_error_truth_mean_mps), None),
        ("duration", format!("{:.3} s", summary.duration_s), None),
        ("ticks", summary.ticks.to_string(), None),
        ("final x, y", format!("{:.1}, {:.1} mm", zero(pose.x_m * 1e3), zero(pose.y_m * 1e3)), None),
        ("final heading", degrees(wrap_angle_rad(pose.theta_rad)), None),
        ("estimate off truth", format!("{:.1} mm, {}", off_m * 1e3, degrees(off_rad)), None),
    ]
}

fn millimetres(metres: f64) -> String {
    format!("{:.2} mm", metres * 1e3)
}

fn millimetres_a_second(mps: f64) -> String {
    format!("{:.2} mm/s", mps * 1e3)
}

fn degrees(rad: f64) -> String {
    format!("{:.1} deg", zero(rad.to_degrees()))
}

/// Keeps a value that rounds to nothing from being printed as `-0.0`.
fn zero(value: f64) -> f64 {
    if value.abs() < 0.05 { 0.0 } else { value }
}

fn timing(text: &mut String, summary: &Summary, pen: Pen) {
    let late = summary.lateness_us;
    let line = if summary.clock != "real" && late.max == 0.0 {
        "virtual time: nothing can be late".to_owned()
    } else {
        let (p50, p99, p99_9, max) = (late.p50, late.p99, late.p99_9, late.max);
        format!("p50 {p50:.1} us, p99 {p99:.1} us, p99.9 {p99_9:.1} us, max {max:.1} us")
    };
    paragraph(text, "lateness  ", &line, str::to_owned);
    let line = match (summary.ticks_late, summary.paused_ticks) {
        (0, 0) => "none".to_owned(),
        (late, lost) => format!(
            "{late} (wake-ups a tick or more late), {lost} ms in all, longest {} ms; the robot waited, no step \
             is lost",
            summary.paused_max_ticks
        ),
    };
    paragraph(text, "pauses    ", &line, str::to_owned);
    let line = format!(
        "{} late, {} rejected, {} cycles without one; {} swaps, {} restarts",
        summary.commands_late,
        summary.commands_rejected,
        summary.cycles_without_command,
        summary.swaps,
        summary.restarts
    );
    paragraph(text, "commands  ", &line, str::to_owned);
    if let Some(recording) = &summary.recording {
        let size = format!("{} messages, {:.1} MB", recording.messages, recording.bytes as f64 / 1e6);
        let files = recording.files.join(", ");
        if recording.complete {
            paragraph(text, "recording ", &format!("{files}: {size}, none is missing"), str::to_owned);
        } else {
            let line = format!("{files}: {size}, NOT COMPLETE: {}", recording.why);
            paragraph(text, "recording ", &line, |line| pen.paint(RED, line));
        }
    }
    paragraph(text, "hash      ", &summary.state_hash, str::to_owned);
    if summary.commands_late > 0 || summary.cycles_without_command > 0 {
        let note = "commands were late or did not act, so this hash is not expected to be the simulation's";
        paragraph(text, "          ", note, |line| pen.paint(YELLOW, line));
    }
}

fn outcome(text: &mut String, summary: &Summary, stopped_by: Option<&str>, pen: Pen) {
    if summary.reached {
        let line = format!(
            "ARRIVED after {:.3} s, {} off the line in the mean, {} at most",
            summary.duration_s,
            millimetres(summary.cross_track_mean_m),
            millimetres(summary.cross_track_max_m)
        );
        paragraph(text, "", &line, |line| pen.paint(GREEN, line));
    } else {
        let reason = match stopped_by {
            Some(reason) if !reason.trim().is_empty() => reason.to_owned(),
            _ => format!("the run ended after {:.3} s, before the last waypoint", summary.duration_s),
        };
        paragraph(text, "", &format!("NOT ARRIVED: {reason}"), |line| pen.paint(RED, line));
    }
}

/// Adds a text broken to the width; lines after the first are indented as wide as `lead`.
fn paragraph(text: &mut String, lead: &str, body: &str, paint: impl Fn(&str) -> String) {
    let indent = lead.chars().count();
    for (number, line) in wrap(body, WIDTH - indent).iter().enumerate() {
        let lead = if number == 0 { lead } else { "" };
        let _ = writeln!(text, "{lead:indent$}{}", paint(line));
    }
}

/// Words in lines of at most `width` characters; a word that is longer is cut.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        // Names come from files: a control character must not reach the terminal.
        let word: Vec<char> = word.chars().map(|c| if c.is_control() { '?' } else { c }).collect();
        for (number, piece) in word.chunks(width).enumerate() {
            let line = lines.last_mut().expect("never empty");
            let used = line.chars().count();
            if number > 0 || (used > 0 && used + 1 + piece.len() > width) {
                lines.push(piece.iter().collect());
            } else {
                if used > 0 {
                    line.push(' ');
                }
                line.extend(piece);
            }
        }
    }
    lines
}
