//! Tails of distributions: what part of the samples is later than a time.

use super::canvas::{BLUE, DARK, GREEN, Key, ORANGE, Sample, VERMILION, line, log_axes, sheet};
use plotters::prelude::*;
use std::io;

/// Height of the picture, pixels.
const HEIGHT: i32 = 440;

/// One distribution.
#[derive(Clone, Debug)]
pub struct Curve<'a> {
    /// For the legend.
    pub name: &'a str,
    /// Times, µs, and the part of the samples that takes as long or longer, 0 to 1.
    pub points: Vec<(f64, f64)>,
}

/// Draws them, both axes in powers of ten.
pub fn tails_svg(title: &str, curves: &[Curve<'_>]) -> io::Result<String> {
    let colors = [VERMILION, BLUE, GREEN, ORANGE, DARK];
    let legend: Vec<Key> = curves
        .iter()
        .zip(colors)
        .map(|(curve, color)| Key::new(Sample::Line(color, 2), curve.name))
        .collect();
    let exponents = |pick: fn(&(f64, f64)) -> f64| {
        let all = curves.iter().flat_map(|curve| &curve.points).map(pick).filter(|value| *value > 0.0);
        let (low, high) = all.fold((f64::INFINITY, 0f64), |(low, high), v| (low.min(v), high.max(v)));
        if low > high { (0.0, 1.0) } else { (low.log10().floor(), high.log10().ceil()) }
    };
    let ((x_low, x_high), (y_low, _)) = (exponents(|point| point.0), exponents(|point| point.1));
    sheet(HEIGHT, title, &legend, |area| {
        let mut chart = log_axes(
            area,
            (x_low..x_high.max(x_low + 1.0), "time, µs"),
            (y_low.min(-1.0)..0.0, "part of the samples that is as late"),
        )?;
        for (curve, color) in curves.iter().zip(colors) {
            let points = curve.points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0);
            chart
                .draw_series(LineSeries::new(points.map(|(x, y)| (x.log10(), y.log10())), line(color, 2)))?;
        }
        Ok(())
    })
}
