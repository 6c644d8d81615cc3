//! Curves without corners: biarcs, two arcs with one tangent where they meet, over stretches as long as can be.
//!
//! The headings at the points come from a first fit of lines and arcs within a share of the tolerance, not from
//! neighbouring points: an arc over a stretch does not see the noise of its points. Where two of its segments
//! meet at an angle θ, the heading turns evenly over the length that a rounding within 0.9 τ takes,
//! d = 0.9 τ / tan(θ/4) to both sides, or up to the segments' middles. Where the angle is sharper than asked for
//! and the polyline itself turns so sharply at a point within τ of it, the corner stays.
//!
//! ```text
//!     t₀ ╱ q ╲ t₁      with equal tangent lengths d:  2 (1 − t₀·t₁) d² + 2 v·(t₀ + t₁) d − v·v = 0
//!       ● ─v─ ●        q = (p₀ + d t₀ + p₁ − d t₁) / 2
//! ```

use super::bulges::{BULGE_MAX, Finder, Limits};
use super::chain::Chain;
use super::follow::{Fitted, Piece};
use super::least::{farthest, fewest};
use super::vector::Vector;
use super::{LEAST_MOST, WORK};
use hilare_interfaces::geometry::wrap_angle_rad;
use std::cell::Cell;

/// Bulges below this are lines: the heading is off by 4e-9 rad at most, which no joint shows.
const STRAIGHT: f64 = 1e-9;

/// Shares of the tolerance that the first fit, which gives the headings, may use; the fewest segments win. The
/// closer ones find what was made of lines and arcs, the wide one sees through noise.
const GUIDES: [f64; 3] = [0.5, 0.1, 0.02];
/// Share of the tolerance that the rounding of a bend aims at.
const ROUND: f64 = 0.9;

/// Why there is no curve: the place where no biarc leads on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stuck {
    pub at: Vector,
    /// True when a tighter radius would do.
    pub too_tight: bool,
}

/// Fits a polyline without corners other than its own.
pub(super) fn fit_smooth(points: &[Vector], limits: Limits, corner: f64) -> Result<Vec<Fitted>, Stuck> {
    let chain = Chain::new(beside_bends(points, limits.tolerance));
    let mut best: Result<Vec<Fitted>, Stuck> = fit_guided(&chain, limits, corner, GUIDES[0]);
    for share in &GUIDES[1..] {
        let other = fit_guided(&chain, limits, corner, *share);
        let fewer = match (&best, &other) {
            (Ok(best), Ok(other)) => other.len() < best.len(),
            (Err(_), Ok(_)) => true,
            _ => false,
        };
        if fewer {
            best = other;
        }
    }
    best
}

fn fit_guided(chain: &Chain, limits: Limits, corner: f64, share: f64) -> Result<Vec<Fitted>, Stuck> {
    let guide = Guide::new(chain, limits, corner, share);
    let looks = Cell::new(0);
    let mut pieces = Vec::new();
    for pair in guide.corners.windows(2) {
        let (first, n) = (pair[0], pair[1] - pair[0] + 1);
        let mut span = |from: usize, to: usize| guide.biarc(first + from, first + to, limits, &looks);
        let least = if n <= LEAST_MOST { fewest(n, &mut span, &mut || looks.get() > WORK) } else { None };
        let spans = match least {
            Some(spans) => spans,
            None => farthest(n, &mut span).map_err(|index| guide.stuck(first + index, pair[1], limits))?,
        };
        pieces.extend(spans.into_iter().flat_map(|(_, span)| span.into_iter().flatten()));
    }
    Ok(pieces)
}

/// The points, and two more beside each bend on edges that are longer than its rounding needs.
fn beside_bends(points: &[Vector], tolerance: f64) -> Vec<Vector> {
    let mut chain = vec![points[0]];
    for triple in points.windows(3) {
        let (before, after) = (triple[1] - triple[0], triple[2] - triple[1]);
        let reach = rounding(turn(before, after), tolerance);
        let (l0, l1) = (before.length(), after.length());
        let apart = |length: f64| reach > 5.0 * crate::MIN_SPACING_M && reach < 0.45 * length;
        if apart(l0) {
            chain.push(triple[1].towards(triple[0], reach / l0));
        }
        chain.push(triple[1]);
        if apart(l1) {
            chain.push(triple[1].towards(triple[2], reach / l1));
        }
    }
    chain.push(points[points.len() - 1]);
    chain
}

/// Angle from one direction to another, radians.
fn turn(a: Vector, b: Vector) -> f64 {
    libm::atan2(a.cross(b), a.dot(b))
}

/// Distance from a corner at which an arc that rounds it within [`ROUND`] of the tolerance begins.
fn rounding(angle: f64, tolerance: f64) -> f64 {
    ROUND * tolerance / libm::tan(0.25 * angle.abs()).max(f64::MIN_POSITIVE)
}

/// The headings that the curve takes up at the points.
struct Guide<'a> {
    chain: &'a Chain,
    /// Where a segment ends, radians.
    arrive: Vec<f64>,
    /// Where a segment starts: the same, but at corners.
    leave: Vec<f64>,
    /// Indices of both ends and the corners, in order.
    corners: Vec<usize>,
}

/// Where two segments of the first fit meet.
#[derive(Clone, Copy)]
struct Meeting {
    /// From one heading to the next, radians.
    angle: f64,
    /// How far from it the heading turns, metres.
    reach: f64,
    corner: bool,
}

impl<'a> Guide<'a> {
    fn new(chain: &'a Chain, limits: Limits, corner: f64, share: f64) -> Self {
        let finder = Finder::new(chain, Limits { tolerance: share * limits.tolerance, ..limits });
        // Neighbours are always joined by a line, so there is a way.
        let steps = farthest(chain.len(), &mut |from, to| finder.piece(from, to)).unwrap_or_default();
        let n = chain.len();
        let mut guide = Self { chain, arrive: vec![0.0; n], leave: vec![0.0; n], corners: vec![0] };
        let (mut from, mut before) = (0, None);
        for (index, (to, fitted)) in steps.iter().enumerate() {
            let after = steps.get(index + 1).map(|next| guide.meeting(*to, fitted, &next.1, limits, corner));
            for k in from..=*to {
                let heading = guide.heading(k, fitted, before, after);
                if k > from {
                    guide.arrive[k] = heading;
                }
                if k < *to {
                    guide.leave[k] = heading;
                }
            }
            if after.is_none_or(|meeting| meeting.corner) {
                guide.corners.push(*to);
            }
            (from, before) = (*to, after);
        }
        guide
    }

    fn meeting(&self, at: usize, before: &Fitted, after: &Fitted, limits: Limits, corner: f64) -> Meeting {
        let (s0, s1) = (before.piece.segment(), after.piece.segment());
        let angle = wrap_angle_rad(s1.start_heading_rad() - s0.heading_rad());
        let middles = 0.5 * s0.length_m().min(s1.length_m());
        let corner = angle.abs() > corner && self.bends(at, limits.tolerance, corner);
        Meeting { angle, reach: rounding(angle, limits.tolerance).min(middles), corner }
    }

    /// True when the polyline itself turns by more than `corner` at a point near this one.
    fn bends(&self, at: usize, near: f64, corner: f64) -> bool {
        let points = &self.chain.points;
        let is_near = |index: &usize| points[*index].distance(points[at]) <= near;
        let sharp = |index: usize| {
            let inner = index > 0 && index + 1 < points.len();
            let bend = || turn(points[index] - points[index - 1], points[index + 1] - points[index]);
            inner && bend().abs() > corner
        };
        (0..=at).rev().take_while(is_near).any(sharp) || (at..points.len()).take_while(is_near).any(sharp)
    }

    /// Heading at a point of a segment of the first fit.
    fn heading(&self, k: usize, fitted: &Fitted, before: Option<Meeting>, after: Option<Meeting>) -> f64 {
        let segment = fitted.piece.segment();
        let along = segment.nearest(self.chain.points[k].world()).along.clamp(0.0, 1.0);
        let share = |meeting: Meeting, along: f64| {
            let far = along * segment.length_m() / meeting.reach;
            if meeting.corner { 0.0 } else { 0.5 * meeting.angle * (1.0 - far).max(0.0) }
        };
        segment.start_heading_rad() + along * segment.sweep_rad()
            - before.map_or(0.0, |meeting| share(meeting, along))
            + after.map_or(0.0, |meeting| share(meeting, 1.0 - along))
    }

    /// Says why no biarc leads on from a point.
    fn stuck(&self, index: usize, last: usize, limits: Limits) -> Stuck {
        let free = Limits { radius_min: 0.0, ..limits };
        let looks = Cell::new(0);
        let too_tight = (index + 1..=last).any(|to| self.biarc(index, to, free, &looks).is_some());
        Stuck { at: self.chain.points[index], too_tight }
    }

    /// The biarc between two points, if it stays with the chain and inside the limits.
    fn biarc(&self, from: usize, to: usize, limits: Limits, looks: &Cell<u64>) -> Option<Span> {
        let chain = self.chain;
        let (p0, p1) = (chain.points[from], chain.points[to]);
        let (t0, t1) = (unit(self.leave[from]), unit(self.arrive[to]));
        let joint = joint(p0, t0, p1, t1)?;
        let first = Piece { from: p0, to: joint, bulge: bulge(t0, joint - p0) };
        let second = Piece { from: joint, to: p1, bulge: -bulge(t1 * -1.0, joint - p1) };
        let least = limits.radius_min.max(2.0 * limits.tolerance);
        let allowed = |piece: Piece| {
            let fits = piece.bulge.abs() <= BULGE_MAX && piece.radius() >= least;
            fits && piece.from.distance(piece.to) >= crate::MIN_SPACING_M
        };
        if !allowed(first) || !allowed(second) {
            return None;
        }
        looks.set(looks.get() + 2 * (to - from) as u64);
        if let Some(piece) = merged(first, second)
            && let Some(deviation) = piece.follow(chain.between(from, to), limits.tolerance)
        {
            return Some([Some(Fitted { piece, deviation }), None]);
        }
        let (edge, place) = nearest(chain, from, to, joint, limits.tolerance)?;
        let before = chain.between(from, edge).chain([place]);
        let after = [place].into_iter().chain(chain.between(edge + 1, to));
        let first = Fitted { piece: first, deviation: first.follow(before, limits.tolerance)? };
        let second = Fitted { piece: second, deviation: second.follow(after, limits.tolerance)? };
        Some([Some(first), Some(second)])
    }
}

type Span = [Option<Fitted>; 2];

fn unit(angle: f64) -> Vector {
    let (sin, cos) = libm::sincos(angle);
    Vector::new(cos, sin)
}

fn joint(p0: Vector, t0: Vector, p1: Vector, t1: Vector) -> Option<Vector> {
    let v = p1 - p0;
    let (square, ahead, bend) = (v.dot(v), v.dot(t0 + t1), 2.0 * (1.0 - t0.dot(t1)));
    let root = (ahead * ahead + bend * square).max(0.0).sqrt();
    let d = square / (ahead + root);
    (d.is_finite() && d > 0.0).then(|| (p0 + t0 * d).towards(p1 - t1 * d, 0.5))
}

/// The bulge of the arc that leaves along the unit vector `tangent` and ends a `chord` away: the chord is
/// turned from the tangent by half the sweep.
fn bulge(tangent: Vector, chord: Vector) -> f64 {
    let bulge = tangent.cross(chord) / (chord.length() + tangent.dot(chord));
    if bulge.abs() < STRAIGHT { 0.0 } else { bulge }
}

/// One segment where both are of the same line or circle.
fn merged(first: Piece, second: Piece) -> Option<Piece> {
    let (s0, s1) = (first.segment(), second.segment());
    let (k0, k1) = (s0.curvature_per_m(), s1.curvature_per_m());
    let same = (k0 - k1).abs() * (s0.length_m() + s1.length_m()) < STRAIGHT;
    let bulge = libm::tan(0.25 * (s0.sweep_rad() + s1.sweep_rad()));
    let bulge = if bulge.abs() < STRAIGHT { 0.0 } else { bulge };
    let smooth = wrap_angle_rad(s1.start_heading_rad() - s0.heading_rad()).abs() < 4.0 * STRAIGHT;
    (same && smooth && bulge.abs() <= BULGE_MAX).then_some(Piece { from: first.from, to: second.to, bulge })
}

/// The place of the chain nearest to the joint, by its edge; `None` if it is farther than the tolerance.
fn nearest(chain: &Chain, from: usize, to: usize, joint: Vector, tolerance: f64) -> Option<(usize, Vector)> {
    let mut best = (f64::INFINITY, from, joint);
    for edge in from..to {
        let (a, b) = (chain.points[edge], chain.points[edge + 1]);
        let along = b - a;
        let place = a.towards(b, (along.dot(joint - a) / along.dot(along)).clamp(0.0, 1.0));
        let distance = place.distance(joint);
        if distance < best.0 {
            best = (distance, edge, place);
        }
    }
    (best.0 <= tolerance).then_some((best.1, best.2))
}
