//! A figure of a paper, drawn again: curves, what is published as levels, posts and bands.

use super::canvas::{Axes, BOTTOM, Drawn, GREEN, Key, Sample, VERMILION, axes, line, px, sheet, top};
use super::plots::Plane;
use super::thin;
use plotters::prelude::*;
use std::io;
use std::ops::Range;

/// Points a curve is thinned to.
const POINTS: usize = 1500;
/// Height of a plot, pixels.
const HEIGHT: i32 = 440;
/// Part of a colour in a band that is filled with it.
const TINT: f64 = 0.2;

/// Axes, and what is drawn over them, first what lies below.
pub struct Chart<'a> {
    /// What it shows.
    pub title: &'a str,
    /// Description of the x axis with its unit.
    pub x_name: &'a str,
    /// Description of the y axis with its unit.
    pub y_name: &'a str,
    /// How the axes are scaled.
    pub scale: Scale,
    /// What is drawn.
    pub marks: Vec<Mark<'a>>,
}

/// How the axes of a chart are scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// As many pixels to a unit both ways, for the plane the robot moves in.
    Plane,
    /// Each as its values ask.
    Own,
}

/// Something drawn.
pub struct Mark<'a> {
    /// What the legend calls it; empty for what it does not mention.
    pub name: &'a str,
    /// Colour.
    pub color: RGBColor,
    /// Width of lines, pixels.
    pub width: i32,
    /// What it is.
    pub shape: Shape,
}

impl<'a> Mark<'a> {
    /// With a name for the legend, a colour and a width of lines.
    pub fn new(name: &'a str, color: RGBColor, width: i32, shape: Shape) -> Self {
        Self { name, color, width, shape }
    }
}

/// Shapes, in the units of the axes.
pub enum Shape {
    /// Curves.
    Curves(Vec<Vec<(f64, f64)>>),
    /// Points, joined by a line.
    Dots(Vec<(f64, f64)>),
    /// A horizontal line across.
    Level(f64),
    /// A vertical line across.
    Post(f64),
    /// A band across, from y to y.
    Band(Range<f64>),
    /// Filled outlines.
    Areas(Vec<Vec<(f64, f64)>>),
    /// Where a robot starts and where it ends.
    Ends((f64, f64), (f64, f64)),
}

impl Shape {
    /// What has to be on the sheet.
    fn points(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Curves(curves) => curves.concat(),
            Self::Dots(dots) => dots.clone(),
            Self::Ends(start, end) => vec![*start, *end],
            // What is cut at the rim, or runs across.
            Self::Areas(_) | Self::Level(_) | Self::Post(_) | Self::Band(_) => Vec::new(),
        }
    }

    fn sample(&self, color: RGBColor, width: i32) -> Vec<Sample> {
        match self {
            Self::Curves(_) | Self::Level(_) | Self::Post(_) => vec![Sample::Line(color, width)],
            Self::Dots(_) => vec![Sample::Waypoint(color)],
            Self::Band(_) => vec![Sample::Band(color, TINT)],
            Self::Areas(_) => vec![Sample::Line(color, 9)],
            Self::Ends(..) => vec![Sample::Start, Sample::End],
        }
    }
}

impl Chart<'_> {
    /// As SVG.
    pub fn svg(&self) -> io::Result<String> {
        let legend = self.legend();
        let points = || self.marks.iter().flat_map(|mark| mark.shape.points());
        match self.scale {
            Scale::Plane => {
                let plane = Plane::around(points(), 0.0);
                let height = top(&legend) + plane.height + BOTTOM;
                self.draw(height, &legend, plane.x, plane.y)
            }
            Scale::Own => {
                let levels = |shape: &Shape| match shape {
                    Shape::Level(y) => vec![*y],
                    Shape::Band(band) => vec![band.start, band.end],
                    _ => Vec::new(),
                };
                let posts = |shape: &Shape| match shape {
                    Shape::Post(x) => Some(*x),
                    _ => None,
                };
                let x = points().map(|p| p.0).chain(self.marks.iter().filter_map(|mark| posts(&mark.shape)));
                let y = points().map(|p| p.1).chain(self.marks.iter().flat_map(|mark| levels(&mark.shape)));
                self.draw(HEIGHT, &legend, range(x, 0.0), range(y, 0.08))
            }
        }
    }

    fn legend(&self) -> Vec<Key> {
        let named = self.marks.iter().filter(|mark| !mark.name.is_empty());
        let keys = named.flat_map(|mark| {
            let samples = mark.shape.sample(mark.color, mark.width);
            let ends = ["start", "end"];
            let name =
                move |n: usize| if matches!(mark.shape, Shape::Ends(..)) { ends[n] } else { mark.name };
            samples.into_iter().enumerate().map(move |(n, sample)| Key::new(sample, name(n)))
        });
        keys.collect()
    }

    fn draw(&self, height: i32, legend: &[Key], x: Range<f64>, y: Range<f64>) -> io::Result<String> {
        sheet(height, self.title, legend, |area| {
            let mut chart = axes(area, (x.clone(), self.x_name), (y.clone(), self.y_name))?;
            self.marks.iter().try_for_each(|mark| draw_mark(&mut chart, mark, &x, &y))
        })
    }
}

/// Holds 0 and all values, with a share of air where they are not 0.
fn range(values: impl Iterator<Item = f64>, air: f64) -> Range<f64> {
    let (low, high) = values.fold((0.0f64, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
    let high = if high - low < 1e-9 { low + 1.0 } else { high };
    let air = air * (high - low);
    (if low < 0.0 { low - air } else { low })..(if high > 0.0 { high + air } else { high })
}

fn draw_mark(chart: &mut Axes<'_, '_>, mark: &Mark<'_>, x: &Range<f64>, y: &Range<f64>) -> Drawn {
    let pen = line(mark.color, mark.width);
    match &mark.shape {
        Shape::Curves(curves) => {
            for curve in curves {
                chart.draw_series(LineSeries::new(thin::thin(curve, POINTS), pen))?;
            }
        }
        Shape::Dots(dots) => {
            chart.draw_series(LineSeries::new(dots.iter().copied(), pen))?;
            chart.draw_series(dots.iter().map(|dot| Circle::new(*dot, px(3), mark.color.filled())))?;
        }
        Shape::Level(level) => {
            chart.draw_series(LineSeries::new([(x.start, *level), (x.end, *level)], pen))?;
        }
        Shape::Post(post) => {
            chart.draw_series(LineSeries::new([(*post, y.start), (*post, y.end)], pen))?;
        }
        Shape::Band(band) => {
            let corners = [(x.start, band.start), (x.end, band.end)];
            chart.draw_series([Rectangle::new(corners, mark.color.mix(TINT).filled())])?;
        }
        Shape::Areas(areas) => {
            // plotters does not clip what is filled.
            let inside = |(px, py): &(f64, f64)| (px.clamp(x.start, x.end), py.clamp(y.start, y.end));
            let cut = |area: &Vec<(f64, f64)>| area.iter().map(inside).collect::<Vec<_>>();
            chart.draw_series(areas.iter().map(|area| Polygon::new(cut(area), mark.color.filled())))?;
        }
        Shape::Ends(start, end) => {
            chart.draw_series([Circle::new(*start, px(5), GREEN.filled())])?;
            chart.draw_series([TriangleMarker::new(*end, px(7), VERMILION.filled())])?;
        }
    }
    Ok(())
}
