//! Several runs of one job in one picture: where each went, how far off each was.

use super::canvas::{
    Axes, BLUE, BOTTOM, DARK, Drawn, GREEN, Key, ORANGE, Sample, VERMILION, axes, line, px, sheet, top,
};
use super::plots::{Plane, course};
use super::raster::{Format, save};
use super::timeline::{Curve, HEIGHT, Timeline, points};
use super::{make_dir, thin};
use hilare_interfaces::messages::Waypoint;
use hilare_recorder::trace::TraceRow;
use plotters::prelude::*;
use std::io;
use std::path::{Path, PathBuf};

/// Points a curve is thinned to.
const POINTS: usize = 4000;
/// Beyond this a run has left the picture, m.
const FAR_M: f64 = 1e3;
/// What a path is drawn wider than its own size by, so that small ones have air, m.
const AIR_M: f64 = 0.01;

/// Runs that can be told apart.
pub const PEN_COUNT: usize = 7;

/// Colours of the runs in turn, and a width so that equal ones are both seen. Okabe and Ito's, less
/// yellow, which white paper hides.
const PENS: [(RGBColor, i32); PEN_COUNT] = [
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

/// Writes `NAME-path`, `NAME-cross_track` and `NAME-speed` into `dir`, which is made if need be, and returns their
/// paths; `plans` are the paths that were to be driven, each once. An error is one line that names the path and the
/// reason.
pub fn write_overlay(
    dir: &Path,
    (name, title): (&str, &str),
    plans: &[&[Waypoint]],
    runs: &[Run<'_>],
    (format, width_px): (Format, Option<u32>),
) -> io::Result<Vec<PathBuf>> {
    make_dir(dir)?;
    let pictures = [
        ("path", path_svg(title, plans, runs)?),
        ("cross_track", cross_track_svg(title, runs)?),
        ("speed", speed_svg(title, runs)?),
    ];
    let mut written = Vec::new();
    for (what, svg) in pictures {
        let path = dir.join(format!("{name}-{what}.{}", format.name()));
        save(&path, &svg, format, width_px)?;
        written.push(path);
    }
    Ok(written)
}

fn pens<'a, 'r>(runs: &'a [Run<'r>]) -> impl Iterator<Item = (&'a Run<'r>, (RGBColor, i32))> {
    runs.iter().zip(PENS.into_iter().cycle())
}

fn path_svg(name: &str, plans: &[&[Waypoint]], runs: &[Run<'_>]) -> io::Result<String> {
    let seen = |(x, y): &(f64, f64)| x.abs() < FAR_M && y.abs() < FAR_M;
    let planned: Vec<Vec<(f64, f64)>> =
        plans.iter().map(|plan| course(plan).map(|p| (p.x_m, p.y_m)).filter(seen).collect()).collect();
    let trails: Vec<Vec<(f64, f64)>> = runs
        .iter()
        .map(|run| run.rows.iter().map(|row| (row.truth.x_m, row.truth.y_m)).filter(seen).collect())
        .collect();
    let plane = Plane::around(planned.iter().chain(&trails).flatten().copied(), AIR_M);
    let mut legend = vec![Key::new(Sample::Line(DARK, 1), "planned path")];
    legend.extend(pens(runs).map(|(run, (color, width))| Key::new(Sample::Line(color, width), run.name)));
    let height = top(&legend) + plane.height + BOTTOM;
    sheet(height, &format!("Truth on the path: {name}"), &legend, |area| {
        let mut chart = axes(area, (plane.x.clone(), "x (m)"), (plane.y.clone(), "y (m)"))?;
        for (trail, (color, width)) in trails.iter().zip(PENS.into_iter().cycle()) {
            curve(&mut chart, trail, color, width)?;
        }
        planned.iter().try_for_each(|plan| curve(&mut chart, plan, DARK, 1))
    })
}

fn cross_track_svg(name: &str, runs: &[Run<'_>]) -> io::Result<String> {
    let title = format!("Cross-track error of the truth: {name}");
    let y = ("left (+), right (-) of the path", "mm");
    timeline(&title, y, runs, |row| row.cross_track_m * 1e3)
}

fn speed_svg(name: &str, runs: &[Run<'_>]) -> io::Result<String> {
    let title = format!("Commanded speed: {name}");
    timeline(&title, ("linear speed", "mm/s"), runs, |row| row.speed_mps * 1e3)
}

fn timeline(
    title: &str,
    y: (&str, &str),
    runs: &[Run<'_>],
    value: impl Fn(&TraceRow) -> f64,
) -> io::Result<String> {
    let curve = |(run, (color, width)): (&Run<'_>, (RGBColor, i32))| Curve {
        name: run.name.to_owned(),
        color,
        width,
        points: points(run.rows, &value),
    };
    let curves = pens(runs).map(curve).collect();
    Timeline { title, y, height: HEIGHT, curves, levels: Vec::new(), changes: Vec::new() }.svg()
}

fn curve(chart: &mut Axes<'_, '_>, points: &[(f64, f64)], color: RGBColor, width: i32) -> Drawn {
    if let [only] = points {
        chart.draw_series([Circle::new(*only, px(3), color.filled())])?;
    }
    chart.draw_series(LineSeries::new(thin::thin(points, POINTS), line(color, width)))?;
    Ok(())
}
