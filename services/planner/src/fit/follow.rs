//! Whether a line or an arc stays with a chain of points, all the way and in order.
//!
//! The last word of the fitter: whatever proposed a segment, it is kept only if it passes here.
//!
//! ```text
//!   line   every vertex v_k is paired with a place t_k of the line, |v_k − t_k| ≤ τ, t_k never less than
//!          t_{k−1}; in between both run evenly, so the pairs in between are no farther apart (discs are
//!          convex). The least t_k that does is taken, so this is exact: Fréchet distance ≤ τ or not.
//!   arc    a point is paired with the place in the same direction from the centre: the pair is |r − R|
//!          apart, over an edge at most at its ends (outside) or at its foot (inside). Where the chain runs
//!          back, the place waits, and what runs back must stay within τ of where it waits.
//! ```
//!
//! Both give an order-preserving pairing of the whole chain with the whole segment, every pair within τ.
//! The arc's rule is sufficient, not necessary: it refuses some arcs beside chains that run back by about τ.

use super::vector::Vector;
use hilare_interfaces::segment::Segment;

/// A segment that stays with its stretch of the chain, and how far the two part, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fitted {
    pub piece: Piece,
    pub deviation: f64,
}

/// A line or an arc from `from` to `to`; bulge as in [`Segment`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub from: Vector,
    pub to: Vector,
    pub bulge: f64,
}

impl Piece {
    pub const fn segment(self) -> Segment {
        Segment::new(self.from.world(), self.to.world(), self.bulge)
    }

    /// Radius, metres; infinite for a line.
    pub fn radius(self) -> f64 {
        let b = self.bulge.abs();
        if b == 0.0 { f64::INFINITY } else { self.from.distance(self.to) * (1.0 + b * b) / (4.0 * b) }
    }

    /// The greatest distance of the chain from this, or `None` where they part by more than `tolerance`.
    ///
    /// The chain's first point belongs to `from`, its last to `to`. An arc's radius must be at least
    /// 2 · `tolerance`: then no edge that stays with it sees half a turn from its centre.
    pub fn follow(self, chain: impl Iterator<Item = Vector>, tolerance: f64) -> Option<f64> {
        if self.bulge == 0.0 { self.follow_line(chain, tolerance) } else { self.follow_arc(chain, tolerance) }
    }

    fn follow_line(self, chain: impl Iterator<Item = Vector>, tolerance: f64) -> Option<f64> {
        let length = self.from.distance(self.to);
        let along = (self.to - self.from) * (1.0 / length);
        let (mut at, mut deviation, mut last) = (0.0_f64, 0.0_f64, self.from);
        for (index, point) in chain.enumerate() {
            let from_start = point - self.from;
            let (s, e) = (along.dot(from_start), along.cross(from_start));
            // Half the chord that the disc about the point cuts out of the line.
            let half = (tolerance * tolerance - e * e).max(0.0).sqrt();
            let beyond = (s - length).max(-s).max(0.0);
            if e.abs() > tolerance || s + half < at || s - half > length {
                return None;
            }
            if index == 0 && self.from.distance(point) > tolerance {
                return None;
            }
            at = at.max(s - half);
            deviation = deviation.max((e * e + beyond * beyond).sqrt());
            last = point;
        }
        (last.distance(self.to) <= tolerance).then_some(deviation)
    }

    fn follow_arc(self, chain: impl Iterator<Item = Vector>, tolerance: f64) -> Option<f64> {
        let arc = Arc::new(self);
        let end = arc.turned(self.to);
        let (mut at, mut waits) = (0.0_f64, self.from);
        let (mut last, mut turned, mut deviation) = (self.from, 0.0_f64, 0.0_f64);
        for (index, point) in chain.enumerate() {
            // No edge sees half a turn from the centre, which is 2 of the 4 units of a full turn.
            let step = arc.turned(point) - turned;
            turned += step - 4.0 * (0.25 * step).round();
            let off = arc.outside(point).abs();
            let dip = if index == 0 { 0.0 } else { arc.dip(last, point) };
            if off.max(dip) > tolerance || (index == 0 && point.distance(self.from) > tolerance) {
                return None;
            }
            deviation = deviation.max(off).max(dip);
            if turned > at {
                (at, waits) = if turned < end { (turned, arc.nearest(point)) } else { (end, self.to) };
            }
            if turned < at || turned > end {
                let away = point.distance(waits);
                if away > tolerance {
                    return None;
                }
                deviation = deviation.max(if turned > end || turned < 0.0 { away } else { off });
            }
            last = point;
        }
        (last.distance(self.to) <= tolerance).then_some(deviation)
    }
}

/// An arc by its centre.
struct Arc {
    centre: Vector,
    radius: f64,
    /// Unit vector from the centre to the start.
    start: Vector,
    /// 1 to the left, −1 to the right.
    side: f64,
}

impl Arc {
    fn new(piece: Piece) -> Self {
        let chord = piece.to - piece.from;
        let b = piece.bulge;
        let height = (1.0 - b * b) / (4.0 * b);
        let centre = piece.from.towards(piece.to, 0.5) + chord.left() * height;
        let radius = piece.radius();
        Self { centre, radius, start: (piece.from - centre) * (1.0 / radius), side: b.signum() }
    }

    /// How far the direction to a point is turned from the start in the arc's sense, as the distance round
    /// a diamond: 0 to 4 a turn, monotone in the angle, a quarter turn being 1 and no sine needed.
    fn turned(&self, point: Vector) -> f64 {
        let d = point - self.centre;
        let (c, s) = (self.start.dot(d), self.side * self.start.cross(d));
        let share = s / (c.abs() + s.abs());
        match (c >= 0.0, s >= 0.0) {
            (true, true) => share,
            (false, _) => 2.0 - share,
            (true, false) => 4.0 + share,
        }
    }

    fn outside(&self, point: Vector) -> f64 {
        point.distance(self.centre) - self.radius
    }

    /// How far the edge's foot from the centre lies inside the circle; 0 when the foot is off the edge.
    fn dip(&self, from: Vector, to: Vector) -> f64 {
        let (edge, d) = (to - from, self.centre - from);
        let (square, foot) = (edge.dot(edge), edge.dot(d));
        if foot <= 0.0 || foot >= square {
            return 0.0;
        }
        self.radius - edge.cross(d).abs() / square.sqrt()
    }

    fn nearest(&self, point: Vector) -> Vector {
        let d = point - self.centre;
        self.centre + d * (self.radius / d.length())
    }
}
