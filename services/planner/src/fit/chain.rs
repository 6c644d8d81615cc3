//! The polyline with boxes about its stretches, so that a stretch well inside a tolerance costs one look.
//!
//! ```text
//!          ·  ·
//!     p ────────────── q      every point of the stretch lies within `spread` of the segment p q
//!        ·     ·   ·
//! ```

use super::vector::Vector;

/// Stretches of fewer edges than this have no box.
const LEAF: usize = 8;

/// A box about the edges of a stretch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stretch {
    pub p: Vector,
    pub q: Vector,
    pub spread: f64,
}

/// Points, and a binary tree of boxes over their edges.
pub(super) struct Chain {
    pub points: Vec<Vector>,
    /// Node 1 is the root; 2k and 2k + 1 are the halves of k.
    boxes: Vec<Stretch>,
}

/// What a visitor of stretches wants next.
pub(super) enum Look {
    /// The whole stretch is settled.
    Settled,
    /// The stretch in smaller parts.
    Closer,
}

impl Chain {
    pub fn new(points: Vec<Vector>) -> Self {
        let edges = points.len() - 1;
        let mut boxes = vec![Stretch::default(); (4 * edges / LEAF + 2).next_power_of_two()];
        enclose_all(&points, &mut boxes, 1, 0, edges);
        Self { points, boxes }
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Points `from..=to` in order.
    pub fn between(&self, from: usize, to: usize) -> impl Iterator<Item = Vector> + '_ {
        self.points[from..=to].iter().copied()
    }

    /// Walks over the edges between points `from` and `to`: whole boxes first; single edges, by the index
    /// of their first point, where `stretch` wants a closer look. Ends when `edge` returns false.
    pub fn visit<T>(
        &self,
        from: usize,
        to: usize,
        state: &mut T,
        stretch: impl Fn(&mut T, Stretch) -> Look,
        edge: impl Fn(&mut T, usize) -> bool,
    ) -> bool {
        // Depth of the tree is below 20; each level leaves one half waiting.
        let mut waiting = [(0, 0, 0); 40];
        waiting[0] = (1, 0, self.len() - 1);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (node, first, last) = waiting[count];
            if last <= from || first >= to {
                continue;
            }
            if last - first >= LEAF {
                let inside = first >= from && last <= to;
                if inside && matches!(stretch(state, self.boxes[node]), Look::Settled) {
                    continue;
                }
                let middle = usize::midpoint(first, last);
                waiting[count] = (2 * node + 1, middle, last);
                waiting[count + 1] = (2 * node, first, middle);
                count += 2;
                continue;
            }
            for index in first.max(from)..last.min(to) {
                if !edge(state, index) {
                    return false;
                }
            }
        }
        true
    }
}

fn enclose_all(points: &[Vector], boxes: &mut Vec<Stretch>, node: usize, first: usize, last: usize) {
    if last - first < LEAF {
        return;
    }
    if boxes.len() <= node {
        boxes.resize(2 * node, Stretch::default());
    }
    boxes[node] = enclose(&points[first..=last]);
    let middle = usize::midpoint(first, last);
    enclose_all(points, boxes, 2 * node, first, middle);
    enclose_all(points, boxes, 2 * node + 1, middle, last);
}

/// The box along the stretch's chord.
fn enclose(points: &[Vector]) -> Stretch {
    let origin = points[0];
    let chord = points[points.len() - 1] - origin;
    let length = chord.length();
    let along = if length > 0.0 { chord * (1.0 / length) } else { Vector::new(1.0, 0.0) };
    let (mut s, mut e) = ((f64::INFINITY, f64::NEG_INFINITY), (f64::INFINITY, f64::NEG_INFINITY));
    for point in points {
        let d = *point - origin;
        let (ds, de) = (along.dot(d), along.cross(d));
        s = (s.0.min(ds), s.1.max(ds));
        e = (e.0.min(de), e.1.max(de));
    }
    let middle = along.left() * (0.5 * (e.0 + e.1));
    Stretch { p: origin + along * s.0 + middle, q: origin + along * s.1 + middle, spread: 0.5 * (e.1 - e.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn boxes_hold_their_points_and_edges_are_met_once(
            points in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 2..200),
            a in 0.0..1.0f64, b in 0.0..1.0f64,
        ) {
            let chain = Chain::new(points.iter().map(|p| Vector::new(p.0, p.1)).collect());
            let edges = chain.len() - 1;
            let (a, b) = ((a * edges as f64) as usize, (b * edges as f64) as usize + 1);
            let (from, to) = (a.min(b), a.max(b));
            let mut met = Vec::new();
            chain.visit(from, to, &mut met, |_, _| Look::Closer, |met, index| { met.push(index); true });
            prop_assert_eq!(met, (from..to).collect::<Vec<_>>());
            let held = |(first, last): (usize, usize), stretch: Stretch| {
                chain.points[first..=last].iter().all(|point| {
                    let axis = stretch.q - stretch.p;
                    let t = (axis.dot(*point - stretch.p) / axis.dot(axis)).clamp(0.0, 1.0);
                    stretch.p.towards(stretch.q, t).distance(*point) <= stretch.spread + 1e-12
                })
            };
            if edges >= LEAF {
                prop_assert!(held((0, edges), chain.boxes[1]));
            }
            if edges / 2 >= LEAF {
                prop_assert!(held((0, edges / 2), chain.boxes[2]));
                prop_assert!(held((edges / 2, edges), chain.boxes[3]));
            }
        }
    }
}
