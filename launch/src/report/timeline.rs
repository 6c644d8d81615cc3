//! Curves over the time of a run.

use super::canvas::{
    Axes, BLUE, DARK, Drawn, Key, LEFT, PALE, RIGHT, Sample, VERMILION, WIDTH, axes, line, px, sheet,
    text_style, text_width,
};
use super::thin;
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_recorder::trace::TraceRow;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use std::io;
use std::ops::Range;

/// Points a curve is drawn with at most.
const POINTS: usize = 4000;
/// Waypoint changes up to which each has its vertical line.
const CHANGES: usize = 100;
/// Height of a picture of its own, pixels.
pub const HEIGHT: i32 = 440;
/// Values beyond this are no robot's; a runaway must not blow up the axes.
const FAR: f64 = 1e10;
/// Changes of waypoint, and how the legend calls them.
const NEXT: &str = "heads for the next waypoint";

/// One picture: first the changes of waypoint, then the curves in their order, then the levels.
pub(super) struct Timeline<'a> {
    /// What it shows.
    pub title: &'a str,
    /// What the y axis means, and its unit.
    pub y: (&'a str, &'a str),
    /// Height, pixels.
    pub height: i32,
    /// What is drawn.
    pub curves: Vec<Curve>,
    /// Horizontal lines and what the legend calls them.
    pub levels: Vec<(String, f64)>,
    /// When the robot heads for another waypoint (s), and for which.
    pub changes: Vec<(f64, u64)>,
}

/// One curve.
pub(super) struct Curve {
    /// What the legend calls it.
    pub name: String,
    /// Colour.
    pub color: RGBColor,
    /// Width, pixels.
    pub width: i32,
    /// Seconds and values, finite.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// Narrow and blue: the robot's own.
    pub fn own(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.to_owned(), color: BLUE, width: 2, points }
    }
}

/// Seconds of a tick.
pub(super) fn seconds(tick: u64) -> f64 {
    tick as f64 / TICKS_PER_SECOND as f64
}

/// Seconds of a row, and a value of it, where it is finite.
pub(super) fn points(rows: &[TraceRow], value: impl Fn(&TraceRow) -> f64) -> Vec<(f64, f64)> {
    usable(rows.iter().map(|row| (seconds(row.tick), value(row))))
}

/// Those that can be drawn.
pub(super) fn usable(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    points.filter(|(x, y)| x.is_finite() && y.abs() < FAR).collect()
}

/// When the robot headed for another waypoint, and for which; none if they are a fence that hides what is
/// behind it.
pub(super) fn changes(rows: &[TraceRow]) -> Vec<(f64, u64)> {
    let changed = rows.windows(2).filter(|pair| pair[0].waypoint != pair[1].waypoint);
    let changes: Vec<_> =
        changed.map(|pair| (seconds(pair[1].tick), pair[1].waypoint)).take(CHANGES + 1).collect();
    if changes.len() > CHANGES { Vec::new() } else { changes }
}

impl Timeline<'_> {
    /// As SVG.
    pub fn svg(&self) -> io::Result<String> {
        let time = self.time_range();
        let values = self.curves.iter().flat_map(|curve| &curve.points).map(|point| point.1);
        let range = value_range(values.chain(self.levels.iter().map(|level| level.1)));
        // Beside a low plot there is no room for more than the unit.
        let (what, unit) = self.y;
        let y_name = if self.height < HEIGHT { unit.to_owned() } else { format!("{what} ({unit})") };
        sheet(self.height, self.title, &self.legend(), |area| {
            let (low, high) = (range.start, range.end);
            let mut chart = axes(area, (time.clone(), "time (s)"), (range, &y_name))?;
            draw_changes(&mut chart, &self.changes, &time, (low, high))?;
            for curve in &self.curves {
                draw_curve(&mut chart, curve)?;
            }
            for (_, level) in &self.levels {
                let ends = [(time.start, *level), (time.end, *level)];
                chart.draw_series(LineSeries::new(ends, line(VERMILION, 2)))?;
            }
            Ok(())
        })
    }

    fn legend(&self) -> Vec<Key> {
        let key = |curve: &Curve| Key::new(Sample::Line(curve.color, curve.width), curve.name.as_str());
        let mut legend: Vec<Key> = self.curves.iter().map(key).collect();
        legend
            .extend(self.levels.iter().map(|(name, _)| Key::new(Sample::Line(VERMILION, 2), name.as_str())));
        if !self.changes.is_empty() {
            legend.push(Key::new(Sample::Line(PALE, 1), NEXT));
        }
        legend
    }

    /// From nothing (or the first row, of a run that was joined late) to the last.
    fn time_range(&self) -> Range<f64> {
        let ends =
            self.curves.iter().filter_map(|curve| Some((curve.points.first()?.0, curve.points.last()?.0)));
        let (first, last) = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 0.0));
        let from = if first < last / 10.0 || first == last { 0.0 } else { first };
        from..last.max(from + 0.1)
    }
}

/// Holds 0 and all values with some air.
fn value_range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((0.0f64, 0.0f64), |(low, high), y| (low.min(y), high.max(y)));
    let air = 0.08 * (high - low);
    let high = if high - low < 1e-9 { low + 1.0 } else { high + air };
    (if low < 0.0 { low - air } else { 0.0 })..high
}

fn draw_curve(chart: &mut Axes<'_, '_>, curve: &Curve) -> Drawn {
    // A line of one point would not be seen.
    if let [only] = curve.points[..] {
        chart.draw_series([Circle::new(only, px(3), curve.color.filled())])?;
    }
    chart.draw_series(LineSeries::new(thin::thin(&curve.points, POINTS), line(curve.color, curve.width)))?;
    Ok(())
}

/// A vertical line at each change of waypoint, numbered where there is room.
fn draw_changes(
    chart: &mut Axes<'_, '_>,
    changes: &[(f64, u64)],
    time: &Range<f64>,
    (low, high): (f64, f64),
) -> Drawn {
    let per_second = f64::from(WIDTH - LEFT - RIGHT) / (time.end - time.start);
    let style = text_style(11, DARK, HPos::Left, VPos::Top);
    let mut free_from_s = f64::NEG_INFINITY;
    for (at_s, waypoint) in changes {
        chart.draw_series([PathElement::new([(*at_s, low), (*at_s, high)], line(PALE, 1))])?;
        let text = waypoint.to_string();
        let wide_s = f64::from(text_width(&text, 11) + 8) / per_second;
        if *at_s >= free_from_s && at_s + wide_s < time.end {
            let at = (at_s + 3.0 / per_second, high);
            chart.draw_series([Text::new(text, at, style.clone())])?;
            free_from_s = at_s + wide_s;
        }
    }
    Ok(())
}
