//! Several runs of one job in one picture: where each went, how far off each was.

use super::canvas::{
    Axes, BLUE, BOTTOM, DARK, Drawn, GREEN, Key, ORANGE, Sample, VERMILION, axes, line, px, sheet, top,
};
use super::plots::{Plane, course};
use super::{make_dir, thin, write_whole};
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_interfaces::messages::Waypoint;
use hilare_recorder::trace::TraceRow;
use plotters::prelude::*;
use std::io;
use std::path::{Path, PathBuf};

/// Points a curve is thinned to.
const POINTS: usize = 4000;
/// Height of the cross-track plot, pixels.
const HEIGHT: i32 = 420;
/// Beyond this a run has left the picture, m.
const FAR_M: f64 = 1e3;
/// What a path is drawn wider than its own size by, so that small ones have air, m.
const AIR_M: f64 = 0.01;

/// Colours of the runs in turn, and a width so that equal ones are both seen. Okabe and Ito's, less
/// yellow, which white paper hides.
const PENS: [(RGBColor, i32); 7] = [
    (VERMILION, 4),
    (BLUE, 2),
    (GREEN, 2),
    (ORANGE, 2),
    (RGBColor(204, 121, 167), 2),
    (RGBColor(86, 180, 233), 2),
    (DARK, 2),
];

/// A run in the picture.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// What the legend calls it.
    pub name: &'a str,
    /// Its rows.
    pub rows: &'a [TraceRow],
}

/// Writes `NAME-path.svg` and `NAME-cross_track.svg` into `dir`, which is made if need be, and returns
/// their paths. An error is one line that names the path and the reason.
pub fn write_overlay(
    dir: &Path,
    name: &str,
    waypoints: &[Waypoint],
    runs: &[Run<'_>],
) -> io::Result<Vec<PathBuf>> {
    make_dir(dir)?;
    let pictures =
        [("path", path_svg(name, waypoints, runs)?), ("cross_track", cross_track_svg(name, runs)?)];
    let mut written = Vec::new();
    for (what, svg) in pictures {
        let path = dir.join(format!("{name}-{what}.svg"));
        write_whole(&path, svg.as_bytes())?;
        written.push(path);
    }
    Ok(written)
}

fn pens<'a, 'r>(runs: &'a [Run<'r>]) -> impl Iterator<Item = (&'a Run<'r>, (RGBColor, i32))> {
    runs.iter().zip(PENS.into_iter().cycle())
}

fn path_svg(name: &str, waypoints: &[Waypoint], runs: &[Run<'_>]) -> io::Result<String> {
    let seen = |(x, y): &(f64, f64)| x.abs() < FAR_M && y.abs() < FAR_M;
    let planned: Vec<(f64, f64)> = course(waypoints).map(|p| (p.x_m, p.y_m)).filter(seen).collect();
    let trails: Vec<Vec<(f64, f64)>> = runs
        .iter()
        .map(|run| run.rows.iter().map(|row| (row.truth.x_m, row.truth.y_m)).filter(seen).collect())
        .collect();
    let plane = Plane::around(planned.iter().chain(trails.iter().flatten()).copied(), AIR_M);
    let mut legend = vec![Key::new(Sample::Line(DARK, 1), "planned path")];
    legend.extend(pens(runs).map(|(run, (color, width))| Key::new(Sample::Line(color, width), run.name)));
    let height = top(&legend) + plane.height + BOTTOM;
    sheet(height, &format!("Truth on the path: {name}"), &legend, |area| {
        let mut chart = axes(area, (plane.x.clone(), "x (m)"), (plane.y.clone(), "y (m)"))?;
        for (trail, (color, width)) in trails.iter().zip(PENS.into_iter().cycle()) {
            curve(&mut chart, trail, color, width)?;
        }
        curve(&mut chart, &planned, DARK, 1)
    })
}

fn cross_track_svg(name: &str, runs: &[Run<'_>]) -> io::Result<String> {
    let off = |row: &TraceRow| (row.tick as f64 / TICKS_PER_SECOND as f64, row.cross_track_m * 1e3);
    let curves: Vec<Vec<(f64, f64)>> = runs
        .iter()
        .map(|run| run.rows.iter().map(off).filter(|(_, y)| y.abs() < FAR_M * 1e3).collect())
        .collect();
    let all = || curves.iter().flatten();
    let (low, high) = all().fold((0.0f64, 0.0f64), |(low, high), (_, y)| (low.min(*y), high.max(*y)));
    let air = 0.08 * (high - low).max(1e-3);
    let end = all().fold(0.1, |end: f64, (t, _)| end.max(*t));
    let legend: Vec<Key> =
        pens(runs).map(|(run, (color, width))| Key::new(Sample::Line(color, width), run.name)).collect();
    sheet(HEIGHT, &format!("Cross-track error of the truth: {name}"), &legend, |area| {
        let y = (low - air..high + air, "left (+), right (-) of the path (mm)");
        let mut chart = axes(area, (0.0..end, "time (s)"), y)?;
        for (points, (color, width)) in curves.iter().zip(PENS.into_iter().cycle()) {
            curve(&mut chart, points, color, width)?;
        }
        Ok(())
    })
}

fn curve(chart: &mut Axes<'_, '_>, points: &[(f64, f64)], color: RGBColor, width: i32) -> Drawn {
    if let [only] = points {
        chart.draw_series([Circle::new(*only, px(3), color.filled())])?;
    }
    chart.draw_series(LineSeries::new(thin::thin(points, POINTS), line(color, width)))?;
    Ok(())
}
