//! The picture of a plan: map, roadmap, path.

use super::canvas::{
    BLUE, BOTTOM, DARK, GREEN, Key, PALE, STONE, Sample, VERMILION, axes, line, px, sheet, top,
};
use super::plots::Plane;
use super::shapes;
use hilare_interfaces::geometry::WorldPoint;
use hilare_planner::Map;
use hilare_planner::map::GridPoint;
use plotters::prelude::*;
use std::io;

/// Roadmap edges drawn at most; a denser one would be a grey sheet.
const EDGES: usize = 20_000;

/// Waypoints up to which each has a dot; more would hide the path.
const DOTS: usize = 100;

/// The plan as SVG, metres.
pub fn plan_svg(
    title: &str,
    map: &Map,
    edges: impl Iterator<Item = (WorldPoint, WorldPoint)>,
    path: &[WorldPoint],
) -> io::Result<String> {
    let xy = |point: WorldPoint| (point.x_m, point.y_m);
    let (width, height) = (map.frame().width_cells() as f64, map.frame().height_cells() as f64);
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
    let corners = corners.map(|(u, v)| xy(map.frame().to_world(GridPoint { u, v })));
    let plane = Plane::around(corners.into_iter(), 0.0);
    let path: Vec<_> = path.iter().map(|point| xy(*point)).collect();
    let edges: Vec<_> = edges.take(EDGES).map(|(a, b)| [xy(a), xy(b)]).collect();
    let obstacles: Vec<Vec<_>> =
        shapes::outlines(map).into_iter().map(|outline| outline.into_iter().map(xy).collect()).collect();
    let legend = [
        Key::new(Sample::Line(STONE, 9), "obstacles"),
        Key::new(Sample::Line(PALE, 1), "roadmap"),
        Key::new(Sample::Line(BLUE, 3), "path"),
        Key::new(Sample::Start, "start"),
        Key::new(Sample::End, "goal"),
    ];
    sheet(top(&legend) + plane.height + BOTTOM, title, &legend, |area| {
        let mut chart = axes(area, (plane.x.clone(), "x (m)"), (plane.y.clone(), "y (m)"))?;
        // The roadmap is dense; what it must not hide is drawn over it.
        chart.draw_series(edges.iter().map(|edge| PathElement::new(edge.to_vec(), line(PALE, 1))))?;
        chart.draw_series(obstacles.iter().map(|outline| plane.filled(outline)))?;
        chart.draw_series(LineSeries::new(path.iter().copied(), line(BLUE, 3)))?;
        if path.len() <= DOTS {
            chart.draw_series(path.iter().map(|point| Circle::new(*point, px(2), DARK.filled())))?;
        }
        if let (Some(start), Some(goal)) = (path.first(), path.last()) {
            chart.draw_series([Circle::new(*start, px(5), GREEN.filled())])?;
            chart.draw_series([TriangleMarker::new(*goal, px(7), VERMILION.filled())])?;
        }
        Ok(())
    })
}
