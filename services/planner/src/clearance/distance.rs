//! Squared distances between segments and convex shapes, in grid units. Plain plane geometry.

use crate::map::GridPoint;

/// A segment with what every distance needs of it.
#[derive(Clone, Copy)]
pub struct Segment {
    pub a: GridPoint,
    pub b: GridPoint,
    du: f64,
    dv: f64,
    /// 1 / length², 0 for a point
    inverse: f64,
}

impl Segment {
    pub fn new(a: GridPoint, b: GridPoint) -> Self {
        let (du, dv) = (b.u - a.u, b.v - a.v);
        let square = du * du + dv * dv;
        Self { a, b, du, dv, inverse: if square > 0.0 { 1.0 / square } else { 0.0 } }
    }

    /// Squared distance to a point.
    pub fn to_point2(self, u: f64, v: f64) -> f64 {
        let (pu, pv) = (u - self.a.u, v - self.a.v);
        let t = ((pu * self.du + pv * self.dv) * self.inverse).clamp(0.0, 1.0);
        let (eu, ev) = (pu - t * self.du, pv - t * self.dv);
        eu * eu + ev * ev
    }

    /// Squared distance to another segment: zero where they cross, else at one of the four ends.
    pub fn to_segment2(self, other: Self) -> f64 {
        let side = |s: Self, p: GridPoint| s.du * (p.v - s.a.v) - s.dv * (p.u - s.a.u);
        let apart = side(self, other.a) * side(self, other.b) > 0.0
            || side(other, self.a) * side(other, self.b) > 0.0;
        let ends = self
            .to_point2(other.a.u, other.a.v)
            .min(self.to_point2(other.b.u, other.b.v))
            .min(other.to_point2(self.a.u, self.a.v))
            .min(other.to_point2(self.b.u, self.b.v));
        let parallel = self.du * other.dv - self.dv * other.du == 0.0;
        if apart || parallel { ends } else { 0.0 }
    }

    /// Squared distance to the closed box; `limit2` when it is certainly not below that.
    pub fn to_box2(self, min: [f64; 2], max: [f64; 2], limit2: f64) -> f64 {
        let (low_u, high_u) = if self.du < 0.0 { (self.b.u, self.a.u) } else { (self.a.u, self.b.u) };
        let (low_v, high_v) = if self.dv < 0.0 { (self.b.v, self.a.v) } else { (self.a.v, self.b.v) };
        let gap_u = (min[0] - high_u).max(low_u - max[0]).max(0.0);
        let gap_v = (min[1] - high_v).max(low_v - max[1]).max(0.0);
        if gap_u * gap_u + gap_v * gap_v >= limit2 {
            return limit2;
        }
        // signed areas of the corners: all on one side means that the line misses the box
        let side = |u: f64, v: f64| self.du * (v - self.a.v) - self.dv * (u - self.a.u);
        let sides = [side(min[0], min[1]), side(max[0], min[1]), side(min[0], max[1]), side(max[0], max[1])];
        let positive = sides.iter().filter(|&&s| s > 0.0).count();
        let crosses = positive != 0 && positive != 4 || sides.contains(&0.0);
        if crosses && gap_u == 0.0 && gap_v == 0.0 {
            // neither the axes nor the segment's normal separate the two (separating axis theorem)
            return 0.0;
        }
        let to_end = |p: GridPoint| {
            let u = (min[0] - p.u).max(p.u - max[0]).max(0.0);
            let v = (min[1] - p.v).max(p.v - max[1]).max(0.0);
            u * u + v * v
        };
        to_end(self.a)
            .min(to_end(self.b))
            .min(self.to_point2(min[0], min[1]))
            .min(self.to_point2(max[0], min[1]))
            .min(self.to_point2(min[0], max[1]))
            .min(self.to_point2(max[0], max[1]))
    }
}
