//! The clearance field: how far every place is from the nearest obstacle, and exact answers near them.
//!
//! Two layers. The *field* is one f32 a cell, the exact Euclidean distance from the cell's centre to the
//! nearest blocked square (`transform`); through the triangle inequality it bounds the clearance of any
//! point from both sides. Where the bounds do not decide, the *obstacles themselves* do: the squares of
//! blocked cells (`cells`), or the boxes, discs and polygons of an obstacle list (`shapes`), for which
//! the raster is a bound only. So checks are exact on both kinds of map and cost a look-up in the open.

mod cells;
mod distance;
mod shapes;
mod transform;

use crate::map::{GridPoint, Layer, Map, MapFrame};
use cells::RimCells;
use distance::Segment;
use hilare_interfaces::geometry::WorldPoint;
use shapes::Shapes;

/// The f32 field may be this much too large, relative.
const ROUNDING: f64 = 4e-7;

/// Least sphere-tracing step worth taking; below it the obstacles themselves are asked, cells.
const MIN_STEP: f64 = 1.0;

/// Longest piece measured against the obstacles at once, in radii, and its least length, cells: found by
/// trying; shorter ones look at the same obstacles again and again.
const PIECE_RADII: f64 = 4.0;
const PIECE_LEAST: f64 = 4.0;

/// A line with a unit direction, and the clearance wanted along it.
struct Ray {
    a: GridPoint,
    du: f64,
    dv: f64,
    radius: f64,
}

impl Ray {
    fn at(&self, distance: f64) -> GridPoint {
        GridPoint { u: self.a.u + self.du * distance, v: self.a.v + self.dv * distance }
    }
}

/// A convex corner of an obstacle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub at: GridPoint,
    /// unit direction that halves the outer angle
    pub out: (f64, f64),
    /// how many radii out the lines parallel to its sides at one radius meet
    pub mitre: f64,
}

#[derive(Debug)]
enum Obstacles {
    Cells(RimCells),
    Shapes(Shapes),
}

/// Distances to the nearest obstacle on one map. Build once a map, share between planners.
#[derive(Debug)]
pub struct ClearanceField {
    frame: MapFrame,
    width: usize,
    height: usize,
    /// cells, from each cell's centre
    distance: Vec<f32>,
    /// the true clearance may exceed the field by this much, cells
    slack: f64,
    obstacles: Obstacles,
}

impl ClearanceField {
    /// Transforms `map`. Time is linear in cells; memory 4 bytes a cell kept, 2 more while building.
    pub fn new(map: &Map) -> Self {
        let frame = map.frame().clone();
        let (width, height) = (frame.width_cells(), frame.height_cells());
        let (distance, slack, obstacles) = match map.layer() {
            Layer::Cells(values) => {
                let range = map.blocking_range();
                let mask = |row: usize, out: &mut [u8]| {
                    let cells = &values[row * width..];
                    out.iter_mut().zip(cells).for_each(|(o, v)| *o = u8::from(range.contains(v)));
                };
                let distance = transform::distance_to_squares(width, height, mask);
                (distance, 0.0, Obstacles::Cells(RimCells::new(width, height, mask)))
            }
            Layer::Obstacles(list) => {
                let shapes = Shapes::new(&frame, list);
                let (marked, leaves) = shapes.rasterise(width, height);
                let mask = |row: usize, out: &mut [u8]| {
                    let cells = &marked[row * width..];
                    out.iter_mut().zip(cells).for_each(|(o, &b)| *o = u8::from(b));
                };
                let distance = transform::distance_to_squares(width, height, mask);
                // any point of a marked cell is within a diagonal of its shape, unless the shape was cut off
                let slack = if leaves { f64::INFINITY } else { std::f64::consts::SQRT_2 + 1e-6 };
                (distance, slack, Obstacles::Shapes(shapes))
            }
        };
        Self { frame, width, height, distance, slack, obstacles }
    }

    /// The map's frame.
    pub fn frame(&self) -> &MapFrame {
        &self.frame
    }

    /// Exact distance from `point` to the nearest obstacle, metres; 0 inside one, infinite on a map without
    /// obstacles, `None` outside the map.
    pub fn clearance_m(&self, point: WorldPoint) -> Option<f64> {
        if !self.frame.contains(point) {
            return None;
        }
        let grid = self.frame.to_grid(point);
        Some(self.segment_clearance(grid, grid, f64::INFINITY) * self.frame.resolution_m())
    }

    /// The convex corners of the obstacles; a disc has six. Shortest paths bend nowhere else.
    pub(crate) fn corners(&self, mut each: impl FnMut(Corner)) {
        match &self.obstacles {
            Obstacles::Cells(cells) => cells.corners(&mut each),
            Obstacles::Shapes(shapes) => shapes.corners(&mut each),
        }
    }

    /// Cells (width, height).
    pub(crate) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The field at a cell's centre, as a lower bound of the clearance there, cells; exact up to rounding
    /// for cell maps.
    pub(crate) fn at_cell(&self, index: usize) -> f64 {
        f64::from(self.distance[index]) * (1.0 - ROUNDING)
    }

    /// True when two valid neighbouring centres prove the straight way between them (see `links`).
    pub(crate) fn squares_only(&self) -> bool {
        matches!(self.obstacles, Obstacles::Cells(_))
    }

    /// Lower bound of the clearance at a point of the map and the distance to the centre it came from, cells.
    fn bound(&self, p: GridPoint) -> (f64, f64) {
        let column = (p.u.max(0.0) as usize).min(self.width - 1);
        let row = (p.v.max(0.0) as usize).min(self.height - 1);
        let off = p.distance(GridPoint { u: column as f64 + 0.5, v: row as f64 + 0.5 });
        (self.at_cell(row * self.width + column), off)
    }

    fn nearest2(&self, segment: &Segment, limit2: f64, stop2: f64) -> f64 {
        match &self.obstacles {
            Obstacles::Cells(cells) => {
                // rim squares alone do not fill an obstacle
                let (centre, off) = self.bound(segment.a);
                if centre <= 0.0 && off <= 0.71 {
                    return 0.0;
                }
                cells.nearest2(segment, limit2, stop2)
            }
            Obstacles::Shapes(shapes) => shapes.nearest2(segment, limit2, stop2),
        }
    }

    /// True when every point between `a` and `b` is at least `radius` cells from every obstacle.
    ///
    /// Sphere tracing (Hart, *Sphere tracing*, 1996) through the field's lower bound, from the middle
    /// outwards: a ball covers both its sides, and most blocked segments are blocked well inside.
    pub(crate) fn segment_free(&self, a: GridPoint, b: GridPoint, radius: f64) -> bool {
        let length = a.distance(b);
        let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
        let (du, dv) = ((b.u - a.u) * inverse, (b.v - a.v) * inverse);
        self.ray_free(&Ray { a, du, dv, radius }, 0.0, length)
    }

    fn ray_free(&self, ray: &Ray, from: f64, to: f64) -> bool {
        let half = 0.5 * (to - from);
        let middle = from + half;
        let (centre, off) = self.bound(ray.at(middle));
        let ball = centre - off - ray.radius;
        if ball >= half {
            return true;
        }
        if centre + off + self.slack + 1e-6 * centre < ray.radius {
            return false;
        }
        if ball >= MIN_STEP {
            return self.ray_free(ray, from, middle - ball) && self.ray_free(ray, middle + ball, to);
        }
        if 2.0 * half > (PIECE_RADII * ray.radius).max(PIECE_LEAST) {
            return self.ray_free(ray, from, middle) && self.ray_free(ray, middle, to);
        }
        let square = ray.radius * ray.radius;
        self.nearest2(&Segment::new(ray.at(from), ray.at(to)), square, square) >= square
    }

    /// True when `p` is at least `radius` cells from every obstacle.
    pub(crate) fn point_free(&self, p: GridPoint, radius: f64) -> bool {
        let (centre, off) = self.bound(p);
        if centre - off >= radius {
            return true;
        }
        if centre + off + self.slack + 1e-6 * centre < radius {
            return false;
        }
        self.nearest2(&Segment::new(p, p), radius * radius, radius * radius) >= radius * radius
    }

    /// Exact least clearance along a segment, or `limit` when it is not below that, cells.
    pub(crate) fn segment_clearance(&self, a: GridPoint, b: GridPoint, limit: f64) -> f64 {
        let half = 0.5 * a.distance(b);
        let middle = a.towards(b, 0.5);
        let (centre, off) = self.bound(middle);
        if centre - off - half >= limit || centre.is_infinite() {
            return limit;
        }
        if half > 1.0 {
            let first = self.segment_clearance(a, middle, limit);
            return self.segment_clearance(middle, b, first);
        }
        // the obstacle nearest to the middle bounds the search; without such a bound take the whole map
        let reach = (centre + off + self.slack).min((self.width + self.height) as f64) + 1e-3;
        let reach = reach.min(limit);
        let found = self.nearest2(&Segment::new(a, b), reach * reach, 0.0);
        if found < reach * reach { found.sqrt() } else { limit.min(reach) }
    }
}
