//! A run over time: how fast, how far off the line, how well the robot knew where it was.

use super::canvas::{BLUE, DARK, FAINT_BLUE, GREEN, ORANGE, VERMILION};
use super::plots::{Mishaps, PlotInput};
use super::timeline::{Curve, Timeline, changes, points, seconds, usable};
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_recorder::trace::TraceRow;
use plotters::style::RGBColor;
use std::io;

/// Ticks over which the truth's speeds are taken: 0.1 s, as for `speed_error_truth_mean_mps`.
const WINDOW: u64 = 100;

/// Broad and orange: the truth, which lies under what the robot makes of it.
fn truth(name: &str, points: Vec<(f64, f64)>) -> Curve {
    Curve { name: name.to_owned(), color: ORANGE, width: 5, points }
}

/// Something of the rows of every [`WINDOW`], per second and at its middle: from the row it begins with, and those
/// that follow to its end.
fn windowed(rows: &[TraceRow], value: impl Fn(&TraceRow, &[TraceRow]) -> f64) -> Vec<(f64, f64)> {
    let mut from = 0;
    let values = rows.iter().enumerate().filter_map(|(at, row)| {
        while rows.get(from + 1).is_some_and(|next| next.tick + WINDOW <= row.tick) {
            from += 1;
        }
        let before = rows.get(from).filter(|before| before.tick + WINDOW <= row.tick)?;
        let (start_s, end_s) = (seconds(before.tick), seconds(row.tick));
        Some(((start_s + end_s) / 2.0, value(before, &rows[from + 1..=at])))
    });
    usable(values)
}

/// A rate of the truth over [`WINDOW`].
fn truth_rate(rows: &[TraceRow], difference: impl Fn(&TraceRow, &TraceRow) -> f64) -> Vec<(f64, f64)> {
    windowed(rows, |before, rest| {
        rest.last().map_or(0.0, |last| difference(before, last) / seconds(last.tick - before.tick))
    })
}

/// Commanded speed, the truth's, and the reference.
pub(super) fn speed_svg(input: &PlotInput<'_>, height: i32) -> io::Result<String> {
    let reference = Some(input.reference_speed_mps * 1e3).filter(|reference| reference.abs() < 1e10);
    // The way of the truth has no sign; it goes backwards when it is told to.
    let way_mm = |before: &TraceRow, row: &TraceRow| {
        let way_mm = before.truth.position().distance_m(row.truth.position()) * 1e3;
        if row.speed_mps < 0.0 { -way_mm } else { way_mm }
    };
    let mut curves = vec![
        truth("truth, over 0.1 s", truth_rate(input.rows, way_mm)),
        Curve::own("commanded, after the constraints", points(input.rows, |row| row.speed_mps * 1e3)),
    ];
    let name = |v_r: f64| format!("reference v_r {v_r:.1} mm/s");
    let mut levels = Vec::new();
    if input.reference_speeds.len() > 1 {
        let end = input.rows.last().map_or(0, |row| row.tick);
        let points = reference_stairs(input.reference_speeds, end);
        curves.push(Curve { name: "reference v_r".to_owned(), color: DARK, width: 1, points });
    } else {
        levels.extend(reference.map(|v_r| (name(v_r), v_r)));
    }
    let (title, y) = (&input.headed("Speed"), ("linear speed", "mm/s"));
    Timeline { title, y, height, curves, levels, changes: Vec::new() }.svg()
}

/// Reference speeds (mm/s) as stairs, to the tick `end`.
fn reference_stairs(speeds: &[(u64, f64)], end: u64) -> Vec<(f64, f64)> {
    let ends = speeds.iter().skip(1).map(|(tick, _)| *tick).chain([end]);
    let steps = speeds.iter().zip(ends);
    usable(steps.flat_map(|((from, mps), to)| [(seconds(*from), mps * 1e3), (seconds(to), mps * 1e3)]))
}

/// Distance of the truth to the path, and its mean.
pub(super) fn cross_track_svg(input: &PlotInput<'_>, height: i32) -> io::Result<String> {
    let points = points(input.rows, |row| (row.cross_track_m * 1e3).abs());
    let mean = (!points.is_empty()).then(|| points.iter().map(|p| p.1).sum::<f64>() / points.len() as f64);
    let levels = mean.map(|mean| (format!("mean {mean:.1} mm"), mean)).into_iter().collect();
    let curves = vec![Curve::own("|cross-track| of the truth", points)];
    let (title, y) = (&input.headed("Cross-track"), ("cross-track error", "mm"));
    Timeline { title, y, height, curves, levels, changes: changes(input.rows) }.svg()
}

/// Direction of travel of the truth less that of the path.
pub(super) fn heading_svg(input: &PlotInput<'_>, height: i32) -> io::Result<String> {
    let points = points(input.rows, |row| row.heading_error_rad.to_degrees());
    let curves = vec![Curve::own("heading of the truth less the path's, left (+)", points)];
    let (title, y) = (&input.headed("Heading error"), ("heading error", "deg"));
    Timeline { title, y, height, curves, levels: Vec::new(), changes: changes(input.rows) }.svg()
}

/// Commanded yaw rate, its mean, and the truth's. A law without damping commands left and right in turn.
pub(super) fn yaw_rate_svg(input: &PlotInput<'_>, height: i32) -> io::Result<String> {
    let turn_deg =
        |before: &TraceRow, row: &TraceRow| (row.truth.theta_rad - before.truth.theta_rad).to_degrees();
    let commanded_deg = |row: &TraceRow| row.omega_radps.to_degrees();
    let mean_deg =
        |_: &TraceRow, rest: &[TraceRow]| rest.iter().map(commanded_deg).sum::<f64>() / rest.len() as f64;
    let commanded = points(input.rows, commanded_deg);
    let curves = vec![
        Curve { name: "commanded".to_owned(), color: FAINT_BLUE, width: 2, points: commanded },
        truth("truth, over 0.1 s", truth_rate(input.rows, turn_deg)),
        Curve::own("commanded, mean over 0.1 s", windowed(input.rows, mean_deg)),
    ];
    let (title, y) = (&input.headed("Yaw rate"), ("yaw rate", "deg/s"));
    Timeline { title, y, height, curves, levels: Vec::new(), changes: Vec::new() }.svg()
}

/// Where the estimate lies, seen from the true robot.
pub(super) fn estimate_svg(input: &PlotInput<'_>, height: i32) -> io::Result<String> {
    let off_mm = |row: &TraceRow| {
        let (dx, dy) = (row.pose.x_m - row.truth.x_m, row.pose.y_m - row.truth.y_m);
        let (sin, cos) = row.truth.theta_rad.sin_cos();
        ((cos * dx + sin * dy) * 1e3, (cos * dy - sin * dx) * 1e3)
    };
    let ahead = points(input.rows, |row| off_mm(row).0);
    let left = points(input.rows, |row| off_mm(row).1);
    let curves = vec![
        Curve { name: "ahead of the true robot (+)".to_owned(), color: ORANGE, width: 3, points: ahead },
        Curve::own("left of it (+)", left),
    ];
    let (title, y) = (&input.headed("Estimate off truth"), ("estimate off truth", "mm"));
    Timeline { title, y, height, curves, levels: Vec::new(), changes: Vec::new() }.svg()
}

/// Late ticks and commands, counted up over the run.
pub(super) fn mishaps_svg(input: &PlotInput<'_>, height: i32) -> io::Result<String> {
    type Count = (&'static str, RGBColor, i32, fn(&Mishaps) -> u64);
    let counts: [Count; 4] = [
        ("ticks late", VERMILION, 5, |row| row.ticks_late),
        ("ticks lost to pauses", BLUE, 3, |row| row.paused_ticks),
        ("commands late", GREEN, 3, |row| row.commands_late),
        ("cycles without command", ORANGE, 2, |row| row.cycles_without_command),
    ];
    let curve = |(name, color, width, count): Count| Curve {
        name: name.to_owned(),
        color,
        width,
        points: stairs(input.mishaps, count),
    };
    let curves = counts.into_iter().map(curve).collect();
    let (title, y) = (&input.headed("Late"), ("count so far", "count"));
    Timeline { title, y, height, curves, levels: Vec::new(), changes: Vec::new() }.svg()
}

/// A count as stairs; where it stays the same there is nothing to draw between its ends.
fn stairs(rows: &[Mishaps], count: fn(&Mishaps) -> u64) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut last = None;
    for row in rows {
        let (at_s, now) = (row.tick as f64 / TICKS_PER_SECOND as f64, count(row));
        if last != Some(now) {
            points.extend(last.map(|before| (at_s, before as f64)));
            points.push((at_s, now as f64));
        }
        last = Some(now);
    }
    if let (Some(row), Some(now)) = (rows.last(), last) {
        points.push((seconds(row.tick), now as f64));
    }
    points
}
