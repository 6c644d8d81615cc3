//! The front, drawn: paper 1's figure 6.

use super::objectives::Objective;
use crate::report::canvas::{BLUE, Drawn, GREEN, Key, Sample, VERMILION, axes, line, px, sheet};
use plotters::prelude::*;
use std::io;

/// Height of the picture, pixels.
const HEIGHT: i32 = 560;
/// Air about what is drawn, as a share of it.
const AIR: f64 = 0.06;

/// What is drawn; points in SI, in the order of the objectives, of which the first two are the axes.
#[derive(Debug)]
pub struct Front<'a> {
    /// Title of the sheet.
    pub title: &'a str,
    /// The objectives.
    pub objectives: &'a [&'static Objective],
    /// The front.
    pub points: &'a [Vec<f64>],
    /// The chosen point.
    pub chosen: Option<&'a [f64]>,
    /// The point before tuning, and its name.
    pub untuned: Option<(&'a [f64], &'a str)>,
    /// Points beyond it are left out, unless nothing else is there.
    pub reference: &'a [f64],
}

/// Draws a front.
pub fn front_svg(front: &Front<'_>) -> io::Result<String> {
    let [across, up] = [front.objectives[0], front.objectives[1]];
    let place = |point: &[f64]| (point[0] * across.factor, point[1] * up.factor);
    let inside = |point: &&Vec<f64>| point[0] < front.reference[0] && point[1] < front.reference[1];
    let mut shown: Vec<(f64, f64)> = front.points.iter().filter(inside).map(|point| place(point)).collect();
    if shown.is_empty() {
        shown = front.points.iter().map(|point| place(point)).collect();
    }
    let marks: Vec<(f64, f64)> =
        front.chosen.into_iter().chain(front.untuned.map(|(point, _)| point)).map(place).collect();
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let values = || shown.iter().chain(&marks).map(pick);
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        if low > high {
            return 0.0..1.0;
        }
        let air = ((high - low) * AIR).max(high.abs() * 1e-3).max(1e-9);
        low - air..high + air
    };
    let (x, y) = (range(|point| point.0), range(|point| point.1));
    let mut legend = vec![Key::new(Sample::Waypoint(BLUE), "front")];
    if front.chosen.is_some() {
        legend.push(Key::new(Sample::End, "chosen"));
    }
    if let Some((_, name)) = front.untuned {
        legend.push(Key::new(Sample::Start, name));
    }
    let name = |objective: &Objective| format!("{}, {}", objective.title, objective.unit);
    sheet(HEIGHT, front.title, &legend, |area| -> Drawn {
        let mut chart = axes(area, (x, &name(across)), (y, &name(up)))?;
        // With a third objective the front is no line.
        if front.objectives.len() == 2 {
            chart.draw_series(LineSeries::new(shown.iter().copied(), line(BLUE, 1)))?;
        }
        chart.draw_series(shown.iter().map(|point| Circle::new(*point, px(3), BLUE.filled())))?;
        let mut marks = marks.iter();
        if front.chosen.is_some()
            && let Some(mark) = marks.next()
        {
            chart.draw_series([TriangleMarker::new(*mark, px(8), VERMILION.filled())])?;
        }
        if let Some(mark) = marks.next() {
            chart.draw_series([Circle::new(*mark, px(5), GREEN.filled())])?;
        }
        Ok(())
    })
}
