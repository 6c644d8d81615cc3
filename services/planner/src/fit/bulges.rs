//! The bulges with which an arc between two points of a chain stays within a tolerance of what lies between.
//!
//! The arcs to the right of a chord, in the chord's frame (left turns, bulge b > 0), fill the half plane
//! y ≤ 0 once: through each of its points goes exactly one. So the arcs that meet a disc, which is convex, are
//! those of an interval of b; so are those that come within τ of every point of an edge; and what satisfies
//! all edges is an intersection of intervals. Right turns are the mirror image.
//!
//! ```text
//!     A ────────┬──────── B     y = 0, x from −a to a
//!      ╲        │       ╱       R = a (1 + b²)/(2b), centre (0, h), h = a (1 − b²)/(2b)
//!        ╲______│_____╱         a point is within τ of the circle where (R − τ)² ≤ x² + (y − h)² ≤ (R + τ)²;
//!              b a              times b this is free of the root and of division by b:
//!                                 (τ−y)a b² + (τ²−N) b + (τ+y)a ≥ 0        N = x² + y² − a²
//!                                 (τ+y)a b² + (N−τ²) b + (τ−y)a ≥ 0
//! ```

use super::chain::{Chain, Look, Stretch};
use super::follow::{Fitted, Piece};
use super::vector::Vector;
use std::cell::Cell;

/// Bulge of the longest arc, 270°: tan(67.5°) = 1 + √2.
pub(super) const BULGE_MAX: f64 = 1.0 + std::f64::consts::SQRT_2;

/// Where in the interval of bulges an arc is tried, until one also keeps the chain's order.
const SHARES: [f64; 5] = [0.5, 0.25, 0.75, 0.05, 0.95];

/// Bulges that differ by less, relative, are the same.
const ROUNDING: f64 = 1e-9;

/// What a segment may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub tolerance: f64,
    pub radius_min: f64,
    pub radius_max: f64,
}

/// Finds segments between points of a chain, and counts what it looks at.
pub(super) struct Finder<'a> {
    pub chain: &'a Chain,
    pub limits: Limits,
    /// Edges and boxes looked at.
    pub looks: Cell<u64>,
}

impl<'a> Finder<'a> {
    pub const fn new(chain: &'a Chain, limits: Limits) -> Self {
        Self { chain, limits, looks: Cell::new(0) }
    }

    /// A segment from point `from` to point `to` that stays with the chain in between: the line if it does,
    /// else an arc from the middle of the interval of bulges.
    pub fn piece(&self, from: usize, to: usize) -> Option<Fitted> {
        let points = &self.chain.points;
        let (a, b) = (points[from], points[to]);
        let chord = a.distance(b);
        if chord < crate::MIN_SPACING_M {
            return None;
        }
        if to == from + 1 {
            let piece = Piece { from: a, to: b, bulge: 0.0 };
            return Some(Fitted { piece, deviation: 0.0 });
        }
        let frame = Frame::new(a, b, self.limits.tolerance);
        if self.line_is_near(&frame, from, to) {
            let line = Piece { from: a, to: b, bulge: 0.0 };
            if let Some(fitted) = self.follow(line, from, to) {
                return Some(fitted);
            }
        }
        if frame.half <= 0.5 * frame.tolerance || frame.half >= self.limits.radius_max {
            return None;
        }
        // R ≥ radius_min leaves flat arcs and, where the chord is short, those of nearly a full turn.
        let least = self.limits.radius_min.max(2.0 * self.limits.tolerance);
        let flattest = tightest_bulge(frame.half, self.limits.radius_max);
        let tightest = tightest_bulge(frame.half, least);
        let ranges = if tightest < 1.0 {
            [(flattest, tightest), (1.0 / tightest, BULGE_MAX)]
        } else {
            [(flattest, BULGE_MAX), (1.0, 0.0)]
        };
        for side in [1.0, -1.0] {
            for range in ranges.into_iter().filter(|range| range.0 <= range.1) {
                let Some((low, high)) = self.interval(&frame.seen(side), range, from, to) else { continue };
                for share in SHARES {
                    let arc = Piece { from: a, to: b, bulge: side * (low + share * (high - low)) };
                    if let Some(fitted) = self.follow(arc, from, to) {
                        return Some(fitted);
                    }
                }
            }
        }
        None
    }

    fn follow(&self, piece: Piece, from: usize, to: usize) -> Option<Fitted> {
        self.looks.set(self.looks.get() + (to - from) as u64);
        let deviation = piece.follow(self.chain.between(from, to), self.limits.tolerance)?;
        Some(Fitted { piece, deviation })
    }

    fn line_is_near(&self, frame: &Frame, from: usize, to: usize) -> bool {
        let tolerance = frame.tolerance;
        let near = |point: Vector, spread: f64| frame.local(point).y.abs() + spread <= tolerance;
        let stretch = |_: &mut (), s: Stretch| {
            self.looks.set(self.looks.get() + 1);
            if near(s.p, s.spread) && near(s.q, s.spread) { Look::Settled } else { Look::Closer }
        };
        let edge = |_: &mut (), index: usize| {
            self.looks.set(self.looks.get() + 1);
            near(self.chain.points[index], 0.0)
        };
        let middle = usize::midpoint(from, to);
        near(self.chain.points[middle], 0.0) && self.chain.visit(from, to, &mut (), stretch, edge)
    }

    /// Left turns (as the frame sees them) within `range` that come within τ of every edge.
    fn interval(&self, frame: &Frame, range: (f64, f64), from: usize, to: usize) -> Option<(f64, f64)> {
        let points = &self.chain.points;
        let mut range = range;
        // Points far from both ends tell most.
        let count = to - from;
        for index in [from + count / 2, from + count / 4, from + 3 * count / 4] {
            if index > from && !frame.narrow(&mut range, points[index]) {
                return None;
            }
        }
        let stretch = |range: &mut (f64, f64), s: Stretch| {
            self.looks.set(self.looks.get() + 1);
            if frame.settled(*range, s) { Look::Settled } else { Look::Closer }
        };
        let edge = |range: &mut (f64, f64), index: usize| {
            self.looks.set(self.looks.get() + 1);
            frame.narrow(range, points[index + 1])
                && frame.narrow_edge(range, points[index], points[index + 1])
        };
        self.chain.visit(from, to, &mut range, stretch, edge).then_some(range)
    }
}

/// The bulge of the tighter-than-half-circle arc of a radius over a chord; 1 if the radius is less than half
/// the chord, which no arc is.
fn tightest_bulge(half: f64, radius: f64) -> f64 {
    if radius <= half { 1.0 } else { half / (radius + ((radius - half) * (radius + half)).sqrt()) }
}

/// A chord's own frame: origin in its middle, x along it, mirrored for right turns.
#[derive(Clone, Copy)]
struct Frame {
    middle: Vector,
    along: Vector,
    /// Half the chord.
    half: f64,
    tolerance: f64,
    side: f64,
}

impl Frame {
    fn new(from: Vector, to: Vector, tolerance: f64) -> Self {
        let length = from.distance(to);
        let along = (to - from) * (1.0 / length);
        Self { middle: from.towards(to, 0.5), along, half: 0.5 * length, tolerance, side: 1.0 }
    }

    const fn seen(self, side: f64) -> Self {
        Self { side, ..self }
    }

    fn local(&self, point: Vector) -> Vector {
        let d = point - self.middle;
        Vector::new(self.along.dot(d), self.side * self.along.cross(d))
    }

    /// True when all of a stretch is within τ of every arc of the range: when it is of both outermost ones.
    fn settled(&self, range: (f64, f64), stretch: Stretch) -> bool {
        let tolerance = self.tolerance - stretch.spread;
        if tolerance <= 0.0 {
            return false;
        }
        let (p, q) = (self.local(stretch.p), self.local(stretch.q));
        let faced = |p: Vector| {
            let (low, high) = self.facing(p);
            low <= range.0 && range.1 <= high
        };
        if !faced(p) || !faced(q) {
            return false;
        }
        [range.0, range.1].into_iter().all(|b| {
            self.near(b, p, tolerance) && self.near(b, q, tolerance) && self.dip(b, p, q, tolerance).is_none()
        })
    }

    /// True when a point is within a tolerance of the circle of bulge `b`.
    fn near(&self, b: f64, p: Vector, tolerance: f64) -> bool {
        let a = self.half;
        let n = p.x * p.x + (p.y - a) * (p.y + a);
        let q = b * n - p.y * a * (1.0 - b * b);
        (q - b * tolerance * tolerance).abs() <= tolerance * a * (1.0 + b * b)
    }

    /// The bulges whose arc, and not the rest of its circle, lies in a point's direction from the centre:
    /// up to where the centre is in line with the point and the nearer end, at h = y a / (a − |x|).
    fn facing(&self, p: Vector) -> (f64, f64) {
        let beside = self.half - p.x.abs();
        if beside == 0.0 {
            return (0.0, f64::INFINITY);
        }
        let slope = p.y / beside;
        let root = libm::hypot(1.0, slope);
        let limit = if slope > 0.0 { 1.0 / (slope + root) } else { root - slope };
        if beside > 0.0 { (0.0, limit) } else { (limit, f64::INFINITY) }
    }

    /// Narrows a range to the arcs within τ of a point; false if none is left.
    fn narrow(&self, range: &mut (f64, f64), point: Vector) -> bool {
        let p = self.local(point);
        let (a, t) = (self.half, self.tolerance);
        if p.y > t {
            return false;
        }
        if libm::hypot(p.x.abs() - a, p.y) <= t {
            return true;
        }
        let n = p.x * p.x + (p.y - a) * (p.y + a);
        let outer = [(t - p.y) * a, t * t - n, (t + p.y) * a];
        let inner = [(t + p.y) * a, n - t * t, (t - p.y) * a];
        // The arc nearest to the point is surely within τ: the interval is what hangs together with it.
        let nearest = if p.y < 0.0 {
            let (depth, root) = (-2.0 * p.y * a, libm::hypot(n, 2.0 * p.y * a));
            if n > 0.0 { (n + root) / depth } else { depth / (root - n) }
        } else if p.x.abs() <= a {
            0.0
        } else {
            f64::INFINITY
        };
        let (low, high) = self.facing(p);
        *range = (range.0.max(low), range.1.min(high));
        for quadratic in [outer, inner] {
            for root in roots(quadratic) {
                // Which of two roots bounds the interval is told by the side on which it lies.
                if root <= nearest {
                    range.0 = range.0.max(root);
                } else {
                    range.1 = range.1.min(root);
                }
            }
        }
        range.0 <= range.1
    }

    /// Narrows a range, whose arcs are within τ of both ends of an edge, to those within τ of all of it.
    fn narrow_edge(&self, range: &mut (f64, f64), from: Vector, to: Vector) -> bool {
        let (p, q) = (self.local(from), self.local(to));
        // A like edge may have put the bound on this very root: what differs by rounding is the same.
        if let Some(quadratic) = self.dip(range.0, p, q, self.tolerance) {
            let low = range.0 * (1.0 - ROUNDING);
            let next = roots(quadratic).into_iter().filter(|root| *root >= low).fold(f64::INFINITY, f64::min);
            range.0 = next.max(range.0);
        }
        if range.0 > range.1 {
            return false;
        }
        if let Some(quadratic) = self.dip(range.1, p, q, self.tolerance) {
            let high = range.1 * (1.0 + ROUNDING);
            let next =
                roots(quadratic).into_iter().filter(|root| *root <= high).fold(-f64::INFINITY, f64::max);
            range.1 = next.min(range.1);
        }
        range.0 <= range.1
    }

    /// Where the middle of an edge dips more than a tolerance into the circle of bulge `b`: the quadratic
    /// in b that is negative there. It is reached before the foot leaves the edge, since the ends are near.
    fn dip(&self, b: f64, p: Vector, q: Vector, tolerance: f64) -> Option<[f64; 3]> {
        let a = self.half;
        let edge = q - p;
        let length = edge.length();
        if length == 0.0 || b <= 0.0 {
            return None;
        }
        let along = edge * (1.0 / length);
        // 2b times how far the centre's foot is along the edge.
        let foot = along.y * a * (1.0 - b * b) - 2.0 * b * along.dot(p);
        if foot <= 0.0 || foot >= 2.0 * b * length {
            return None;
        }
        let (normal, d) = (along.left(), along.left().dot(p));
        // The centre is to the left of the edge; only short edges may run back.
        let left = length > 2.0 * self.tolerance || normal.y * a * (1.0 - b * b) - 2.0 * b * d >= 0.0;
        let (normal, d) = if left { (normal, d) } else { (normal * -1.0, -d) };
        // 1 − n_y without cancellation.
        let slant = if normal.y > 0.0 { normal.x * normal.x / (1.0 + normal.y) } else { 1.0 - normal.y };
        let quadratic = [-(1.0 + normal.y) * a, 2.0 * (tolerance - d), -slant * a];
        (quadratic[0] * b * b + quadratic[1] * b + quadratic[2] < 0.0).then_some(quadratic)
    }
}

/// The real roots of c₀ x² + c₁ x + c₂; NaN where there is none.
fn roots([c0, c1, c2]: [f64; 3]) -> [f64; 2] {
    let square = c1 * c1 - 4.0 * c0 * c2;
    if square < 0.0 {
        return [f64::NAN; 2];
    }
    let sum = -0.5 * (c1 + square.sqrt().copysign(c1));
    [sum / c0, c2 / sum]
}
