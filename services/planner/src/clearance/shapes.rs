//! Exact distances to the shapes of an obstacle list, through buckets of the raster.

use super::Corner;
use super::distance::Segment;
use crate::map::{GridPoint, MapFrame, Obstacle};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Side of a bucket, cells of the raster.
const BUCKET_CELLS: usize = 16;

#[derive(Debug)]
enum Shape {
    Box { min: [f64; 2], max: [f64; 2] },
    Disc { centre: [f64; 2], radius: f64 },
    Polygon { corners: Vec<GridPoint> },
}

/// Shapes in grid units, each listed in every bucket its bounding box touches.
#[derive(Debug)]
pub struct Shapes {
    shapes: Vec<Shape>,
    columns: usize,
    rows: usize,
    /// start of each bucket's list, one more than buckets
    starts: Vec<u32>,
    lists: Vec<u32>,
    bounds: Vec<([f64; 2], [f64; 2])>,
}

impl Shapes {
    pub fn new(frame: &MapFrame, obstacles: &[Obstacle]) -> Self {
        let scale = 1.0 / frame.resolution_m();
        let grid = |p: [f64; 2]| p.map(|v| v * scale);
        let shapes = obstacles
            .iter()
            .map(|obstacle| match obstacle {
                Obstacle::Box { min_m, max_m } => Shape::Box { min: grid(*min_m), max: grid(*max_m) },
                Obstacle::Disc { centre_m, radius_m } => {
                    Shape::Disc { centre: grid(*centre_m), radius: radius_m * scale }
                }
                Obstacle::Polygon { corners_m } => Shape::Polygon {
                    corners: corners_m.iter().map(|&c| grid(c)).map(|[u, v]| GridPoint { u, v }).collect(),
                },
            })
            .collect();
        let bounds: Vec<_> = obstacles
            .iter()
            .map(|o| {
                let (min, max) = o.bounds_m();
                (grid(min), grid(max))
            })
            .collect();
        let columns = frame.width_cells().div_ceil(BUCKET_CELLS);
        let rows = frame.height_cells().div_ceil(BUCKET_CELLS);
        let mut this = Self { shapes, columns, rows, starts: Vec::new(), lists: Vec::new(), bounds };
        this.fill_buckets();
        this
    }

    fn fill_buckets(&mut self) {
        let mut counts = vec![0u32; self.columns * self.rows + 1];
        let visit = |this: &Self, each: &mut dyn FnMut(usize, u32)| {
            for (index, (min, max)) in this.bounds.iter().enumerate() {
                let (columns, rows) = this.buckets(*min, *max);
                for row in rows {
                    for column in columns.clone() {
                        each(row * this.columns + column, index as u32);
                    }
                }
            }
        };
        visit(self, &mut |bucket, _| counts[bucket + 1] += 1);
        for i in 1..counts.len() {
            counts[i] += counts[i - 1];
        }
        let mut lists = vec![0u32; counts[counts.len() - 1] as usize];
        let mut next = counts.clone();
        visit(self, &mut |bucket, index| {
            lists[next[bucket] as usize] = index;
            next[bucket] += 1;
        });
        (self.starts, self.lists) = (counts, lists);
    }

    /// Buckets (columns, rows) that a rectangle touches; what lies outside the map goes to the border's.
    fn buckets(&self, min: [f64; 2], max: [f64; 2]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let index = |v: f64, count: usize| ((v / BUCKET_CELLS as f64).max(0.0) as usize).min(count - 1);
        let range = |axis: usize, count: usize| index(min[axis], count)..index(max[axis], count) + 1;
        (range(0, self.columns), range(1, self.rows))
    }

    /// Least squared distance (cells²) from the segment to a shape, or `limit2` if none is below it;
    /// returns early once below `stop2`.
    pub fn nearest2(&self, segment: &Segment, limit2: f64, stop2: f64) -> f64 {
        let reach = limit2.sqrt();
        let (a, b) = (segment.a, segment.b);
        let min = [a.u.min(b.u) - reach, a.v.min(b.v) - reach];
        let max = [a.u.max(b.u) + reach, a.v.max(b.v) + reach];
        let (columns, rows) = self.buckets(min, max);
        let mut best = limit2;
        for row in rows {
            for column in columns.clone() {
                let bucket = row * self.columns + column;
                let range = self.starts[bucket] as usize..self.starts[bucket + 1] as usize;
                for &index in &self.lists[range] {
                    best = best.min(self.shapes[index as usize].distance2(segment, best));
                    if best < stop2 {
                        return best;
                    }
                }
            }
        }
        best
    }

    /// The convex corners of all shapes, each with the direction that halves the outer angle.
    pub fn corners(&self, each: &mut dyn FnMut(Corner)) {
        for shape in &self.shapes {
            match shape {
                Shape::Box { min, max } => {
                    for (u, du) in [(min[0], -FRAC_1_SQRT_2), (max[0], FRAC_1_SQRT_2)] {
                        for (v, dv) in [(min[1], -FRAC_1_SQRT_2), (max[1], FRAC_1_SQRT_2)] {
                            each(Corner { at: GridPoint { u, v }, out: (du, dv), mitre: SQRT_2 });
                        }
                    }
                }
                Shape::Disc { centre, radius } => {
                    // a hexagon's corners: (cos, sin) of multiples of 60 degrees
                    let (half, high) = (0.5, 0.5 * 3f64.sqrt());
                    let mitre = 1.0 / high;
                    for (du, dv) in
                        [(1.0, 0.0), (half, high), (-half, high), (-1.0, 0.0), (-half, -high), (half, -high)]
                    {
                        let far = mitre * radius;
                        let at = GridPoint { u: centre[0] + far * du, v: centre[1] + far * dv };
                        each(Corner { at, out: (du, dv), mitre });
                    }
                }
                Shape::Polygon { corners } => polygon_corners(corners, each),
            }
        }
    }

    /// Raster cells that cover every shape: exactly those with a shape within half a diagonal of the
    /// centre, and, of a shape that leaves the map, the border cells beside it. Tells whether one leaves.
    pub fn rasterise(&self, width: usize, height: usize) -> (Vec<bool>, bool) {
        let mut marked = vec![false; width * height];
        let mut leaves = false;
        for (shape, (min, max)) in self.shapes.iter().zip(&self.bounds) {
            let out = min[0] < 0.0 || min[1] < 0.0 || max[0] > width as f64 || max[1] > height as f64;
            leaves |= out;
            let range = |axis: usize, cells: usize| {
                let index = |v: f64| (v.max(0.0) as usize).min(cells - 1);
                index(min[axis] - 1.0)..index(max[axis] + 1.0) + 1
            };
            for row in range(1, height) {
                for column in range(0, width) {
                    let centre = GridPoint { u: column as f64 + 0.5, v: row as f64 + 0.5 };
                    let point = Segment::new(centre, centre);
                    let border = column == 0 || row == 0 || column + 1 == width || row + 1 == height;
                    marked[row * width + column] |=
                        out && border || shape.distance2(&point, f64::INFINITY) <= 0.500_001;
                }
            }
        }
        (marked, leaves)
    }
}

impl Shape {
    fn distance2(&self, segment: &Segment, limit2: f64) -> f64 {
        match self {
            Self::Box { min, max } => segment.to_box2(*min, *max, limit2),
            Self::Disc { centre, radius } => {
                let gap = (segment.to_point2(centre[0], centre[1]).sqrt() - radius).max(0.0);
                gap * gap
            }
            Self::Polygon { corners } => {
                if contains(corners, segment.a) {
                    return 0.0;
                }
                let next = corners.iter().cycle().skip(1);
                let edges = corners.iter().zip(next).map(|(&a, &b)| Segment::new(a, b));
                edges.map(|edge| segment.to_segment2(edge)).fold(limit2, f64::min)
            }
        }
    }
}

fn polygon_corners(corners: &[GridPoint], each: &mut dyn FnMut(Corner)) {
    let n = corners.len();
    let leg = |a: GridPoint, b: GridPoint| {
        let length = a.distance(b).max(f64::MIN_POSITIVE);
        ((b.u - a.u) / length, (b.v - a.v) / length)
    };
    for (index, &corner) in corners.iter().enumerate() {
        let to_last = leg(corner, corners[(index + n - 1) % n]);
        let to_next = leg(corner, corners[(index + 1) % n]);
        let (du, dv) = (-to_last.0 - to_next.0, -to_last.1 - to_next.1);
        let length = (du * du + dv * dv).sqrt();
        // a straight or a reflex corner bends no shortest path
        let probe = GridPoint { u: corner.u + 1e-3 * du, v: corner.v + 1e-3 * dv };
        if length > 1e-3 && !contains(corners, probe) {
            // the legs meet at the angle θ with |sum of unit legs| = 2 cos(θ/2)
            let sine = (1.0 - 0.25 * length * length).max(0.0).sqrt();
            let out = (du / length, dv / length);
            each(Corner { at: corner, out, mitre: (1.0 / sine.max(0.5)) });
        }
    }
}

/// Even-odd rule.
fn contains(corners: &[GridPoint], p: GridPoint) -> bool {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).fold(false, |inside, (a, b)| {
        let straddles = (a.v > p.v) != (b.v > p.v);
        let left = p.u < (b.u - a.u) * (p.v - a.v) / (b.v - a.v) + a.u;
        inside ^ (straddles && left)
    })
}
