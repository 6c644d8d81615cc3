//! Where a run went, after paper 1, figures 7 and 10 to 12.

use super::canvas::{
    Area, BLUE, BOTTOM, DARK, Drawn, GREEN, Key, LEFT, LIGHT, ORANGE, RIGHT, STONE, Sample, VERMILION, WIDTH,
    axes, line, px, sheet, text_style, top,
};
use super::{labels, shapes, thin};
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::Waypoint;
use hilare_planner::Map;
use hilare_recorder::trace::TraceRow;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use std::f64::consts::FRAC_PI_2;
use std::io;
use std::iter;
use std::ops::Range;

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct PlotInput<'a> {
    /// What ran, for the titles.
    pub title: &'a str,
    /// The planned path.
    pub waypoints: &'a [Waypoint],
    /// Paths that were driven after it, in order.
    pub later_paths: &'a [Vec<Waypoint>],
    /// Acceptance radius of a waypoint, d_T, m.
    pub acceptance_radius_m: f64,
    /// Reference speed, v_r, m/s.
    pub reference_speed_mps: f64,
    /// From which tick on it was which, where it changed during the drive; else empty.
    pub reference_speeds: &'a [(u64, f64)],
    /// The run, oldest first.
    pub rows: &'a [TraceRow],
    /// The map driven on.
    pub map: Option<&'a Map>,
    /// What went amiss, where every tick was recorded; else empty.
    pub mishaps: &'a [Mishaps],
}

impl PlotInput<'_> {
    /// `Speed: what ran`.
    pub(super) fn headed(&self, what: &str) -> String {
        if self.title.is_empty() { what.to_owned() } else { format!("{what}: {}", self.title) }
    }
}

/// What had gone amiss by a tick, counted from the start of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mishaps {
    /// Ticks executed.
    pub tick: u64,
    /// Wake-ups a tick or more late.
    pub ticks_late: u64,
    /// Whole ticks lost to such pauses.
    pub paused_ticks: u64,
    /// Commands that came after their effective tick.
    pub commands_late: u64,
    /// Control cycles that had no command of their own.
    pub cycles_without_command: u64,
}

/// Points a curve is drawn with at most.
const POINTS: usize = 4000;
/// Waypoints up to which each has a dot and its circle.
const DOTS: usize = 500;
/// Coordinates beyond this (m) are no robot's; a runaway must not blow up the axes.
const FAR_M: f64 = 1e7;

/// The plane of the path plot, in `unit`s, the same number of pixels to a unit both ways.
pub(super) struct Plane {
    pub x: Range<f64>,
    pub y: Range<f64>,
    /// Pixels of the plot's height.
    pub height: i32,
    /// Pixels to a unit.
    scale: f64,
}

impl Plane {
    /// Holds all points with `margin` (units) about each.
    pub fn around(points: impl Iterator<Item = (f64, f64)>, margin: f64) -> Self {
        let mut low = (f64::INFINITY, f64::INFINITY);
        let mut high = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for (x, y) in points {
            low = (low.0.min(x), low.1.min(y));
            high = (high.0.max(x), high.1.max(y));
        }
        if low.0 > high.0 {
            (low, high) = ((0.0, 0.0), (0.0, 0.0));
        }
        let middle = ((low.0 + high.0) / 2.0, (low.1 + high.1) / 2.0);
        // 8 % of air about the longer side, so that the numbers at the rim have room.
        let air = margin + 0.08 * (high.0 - low.0).max(high.1 - low.1);
        // Below a thousandth of a unit axis labels would be all digits.
        let size = ((high.0 - low.0 + 2.0 * air).max(1e-3), (high.1 - low.1 + 2.0 * air).max(1e-3));
        let width = WIDTH - LEFT - RIGHT;
        let height = (f64::from(width) * size.1 / size.0).clamp(320.0, 760.0) as i32;
        let scale = (f64::from(width) / size.0).min(f64::from(height) / size.1);
        let half = (f64::from(width) / scale / 2.0, f64::from(height) / scale / 2.0);
        Self {
            x: middle.0 - half.0..middle.0 + half.0,
            y: middle.1 - half.1..middle.1 + half.1,
            height,
            scale,
        }
    }

    /// In pixels, y downwards.
    fn pixel(&self, (x, y): (f64, f64)) -> (f64, f64) {
        ((x - self.x.start) * self.scale, (self.y.end - y) * self.scale)
    }

    /// An obstacle, cut at the rim: plotters does not clip what is filled.
    pub fn filled(&self, outline: &[(f64, f64)]) -> Polygon<(f64, f64)> {
        let inside =
            |(x, y): &(f64, f64)| (x.clamp(self.x.start, self.x.end), y.clamp(self.y.start, self.y.end));
        Polygon::new(outline.iter().map(inside).collect::<Vec<_>>(), STONE.filled())
    }

    fn point(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (x / self.scale + self.x.start, self.y.end - y / self.scale)
    }
}

/// Points on an arc, a quarter turn.
const ARC_POINTS: f64 = 24.0;

/// The lines and arcs through waypoints, as points.
pub(crate) fn course(waypoints: &[Waypoint]) -> impl Iterator<Item = WorldPoint> + '_ {
    let arcs = waypoints.windows(2).flat_map(|pair| {
        let segment = pair[1].segment_from(pair[0]);
        let pieces = (segment.sweep_rad().abs() / FRAC_PI_2 * ARC_POINTS).ceil().max(1.0);
        (1..=pieces as usize).map(move |n| segment.point_at(n as f64 / pieces))
    });
    waypoints.first().map(|waypoint| waypoint.point()).into_iter().chain(arcs)
}

/// What the path plot shows, in its unit.
struct Trails {
    unit: &'static str,
    per_metre: f64,
    /// The waypoints of every path.
    plans: Vec<Vec<(f64, f64)>>,
    /// The lines and arcs between them.
    courses: Vec<Vec<(f64, f64)>>,
    estimate: Vec<(f64, f64)>,
    truth: Vec<(f64, f64)>,
    radius: f64,
    /// Outlines of the map's obstacles.
    obstacles: Vec<Vec<(f64, f64)>>,
}

impl Trails {
    fn of(input: &PlotInput<'_>) -> Self {
        let usable = |x: f64, y: f64| (x.abs() < FAR_M && y.abs() < FAR_M).then_some((x, y));
        let paths = || iter::once(input.waypoints).chain(input.later_paths.iter().map(Vec::as_slice));
        let plans: Vec<Vec<_>> =
            paths().map(|path| path.iter().filter_map(|p| usable(p.x_m, p.y_m)).collect()).collect();
        let courses: Vec<Vec<_>> =
            paths().map(|path| course(path).filter_map(|p| usable(p.x_m, p.y_m)).collect()).collect();
        let estimate: Vec<_> =
            input.rows.iter().filter_map(|row| usable(row.pose.x_m, row.pose.y_m)).collect();
        let truth: Vec<_> =
            input.rows.iter().filter_map(|row| usable(row.truth.x_m, row.truth.y_m)).collect();
        let obstacles = input.map.map(shapes::outlines).unwrap_or_default();
        let outlines: Vec<Vec<_>> = obstacles
            .iter()
            .map(|outline| outline.iter().filter_map(|p| usable(p.x_m, p.y_m)).collect())
            .collect();
        let all = || courses.iter().flatten().chain(&estimate).chain(&truth);
        // Millimetres as in the paper, as long as they can be read.
        let farthest = all().fold(0.0, |far: f64, (x, y)| far.max(x.abs()).max(y.abs()));
        let (unit, per_metre) = if farthest < 50.0 { ("mm", 1e3) } else { ("m", 1.0) };
        let scaled = |points: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
            points.into_iter().map(|(x, y)| (x * per_metre, y * per_metre)).collect()
        };
        let radius = input.acceptance_radius_m;
        let radius = if radius > 0.0 && radius < FAR_M { radius * per_metre } else { 0.0 };
        let obstacles = outlines.into_iter().map(scaled).collect();
        let plans = plans.into_iter().map(scaled).collect();
        let courses = courses.into_iter().map(scaled).collect();
        let (estimate, truth) = (scaled(estimate), scaled(truth));
        Self { unit, per_metre, radius, plans, courses, estimate, truth, obstacles }
    }

    /// Waypoints of all paths.
    fn waypoints(&self) -> usize {
        self.plans.iter().map(Vec::len).sum()
    }

    fn plane(&self) -> Plane {
        let all = self.courses.iter().flatten().chain(&self.estimate).chain(&self.truth).copied();
        // A robot that stands still is shown with a hand's breadth about it.
        let margin = if self.waypoints() <= DOTS { self.radius } else { 0.0 };
        Plane::around(all, margin.max(0.01 * self.per_metre))
    }

    /// What the legend calls the paths.
    fn planned(&self) -> String {
        match self.plans.len() {
            0 | 1 => "planned path, waypoints".to_owned(),
            n => format!("{n} planned paths, waypoints"),
        }
    }

    fn legend(&self) -> Vec<Key> {
        let mut legend = vec![Key::new(Sample::Waypoint(DARK), self.planned())];
        if self.radius > 0.0 && self.waypoints() <= DOTS {
            let radius = (self.radius * 10.0).round() / 10.0;
            legend.push(Key::new(Sample::Ring(LIGHT), format!("d_T {radius} {}", self.unit)));
        }
        if !self.obstacles.is_empty() {
            legend.push(Key::new(Sample::Line(STONE, 9), "obstacles"));
        }
        legend.push(Key::new(Sample::Line(BLUE, 2), "estimate"));
        legend.push(Key::new(Sample::Line(ORANGE, 5), "truth"));
        legend.push(Key::new(Sample::Start, "start"));
        legend.push(Key::new(Sample::End, "end"));
        legend
    }
}

/// Path, estimate and truth in the plane.
pub(super) fn path_svg(input: &PlotInput<'_>) -> io::Result<String> {
    let trails = Trails::of(input);
    let plane = trails.plane();
    let legend = trails.legend();
    let title = input.headed("Path");
    let height = top(&legend) + plane.height + BOTTOM;
    sheet(height, &title, &legend, |area| draw_path(area, &trails, &plane))
}

fn draw_path(area: &Area<'_>, trails: &Trails, plane: &Plane) -> Drawn {
    let (x_name, y_name) = (format!("x ({})", trails.unit), format!("y ({})", trails.unit));
    let mut chart = axes(area, (plane.x.clone(), &x_name), (plane.y.clone(), &y_name))?;
    // plotters does not clip what is filled.
    let inside =
        |(x, y): (f64, f64)| (x.clamp(plane.x.start, plane.x.end), y.clamp(plane.y.start, plane.y.end));
    chart.draw_series(trails.obstacles.iter().map(|outline| {
        Polygon::new(outline.iter().map(|p| inside(*p)).collect::<Vec<_>>(), STONE.filled())
    }))?;
    let (estimate, truth) = (thin::thin(&trails.estimate, POINTS), thin::thin(&trails.truth, POINTS));
    let radius = (trails.radius * plane.scale * f64::from(px(1))) as i32;
    let few = trails.waypoints() <= DOTS;
    if few && radius > px(4) {
        chart.draw_series(trails.plans.iter().flatten().map(|p| Circle::new(*p, radius, line(LIGHT, 1))))?;
    }
    for course in &trails.courses {
        chart.draw_series(LineSeries::new(thin::thin(course, POINTS), line(DARK, 1)))?;
    }
    // The broad truth lies under the narrow estimate: where they agree both are seen.
    chart.draw_series(LineSeries::new(truth.iter().copied(), line(ORANGE, 5)))?;
    chart.draw_series(LineSeries::new(estimate.iter().copied(), line(BLUE, 2)))?;
    if few {
        let size = px(if trails.waypoints() > 100 { 2 } else { 3 });
        chart.draw_series(trails.plans.iter().flatten().map(|p| Circle::new(*p, size, DARK.filled())))?;
    }
    if let (Some(start), Some(end)) = (trails.truth.first(), trails.truth.last()) {
        chart.draw_series([Circle::new(*start, px(5), GREEN.filled())])?;
        chart.draw_series([TriangleMarker::new(*end, px(7), VERMILION.filled())])?;
    }
    let pixels = |points: &[(f64, f64)]| points.iter().map(|p| plane.pixel(*p)).collect::<Vec<_>>();
    let mut ink = pixels(&estimate);
    ink.extend(pixels(&truth));
    let style = text_style(labels::SIZE, DARK, HPos::Center, VPos::Center);
    // Each path counts its own waypoints.
    let numbers: Vec<_> = trails.plans.iter().flat_map(|plan| labels::place(&pixels(plan), &ink)).collect();
    chart.draw_series(
        numbers.into_iter().map(|label| Text::new(label.text, plane.point(label.at), style.clone())),
    )?;
    Ok(())
}
