//! Two objectives: the members are a staircase, and each keeps a rectangle from being lost.
//!
//! ```text
//!   y │ a ─┐            what b alone dominates is the rectangle between it, the next x and the
//!     │    │            y before:  (c.x − b.x)(a.y − b.y)
//!     │    b░░░┐
//!     │    └───c ──
//!     └─────────────── x
//! ```

use super::beyond;

/// Members in ascending x, and so in descending y.
#[derive(Clone, Debug)]
pub struct Staircase {
    capacity: usize,
    /// Right and top border of what counts; infinite for none.
    limits: [f64; 2],
    points: Vec<[f64; 2]>,
    slots: Vec<usize>,
    worth: Vec<f64>,
}

impl Staircase {
    pub fn new(capacity: usize, limits: [f64; 2]) -> Self {
        let room = capacity + 1;
        Self {
            capacity,
            limits,
            points: Vec::with_capacity(room),
            slots: Vec::with_capacity(room),
            worth: Vec::with_capacity(room),
        }
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    #[inline]
    pub fn slot(&self, rank: usize) -> usize {
        self.slots[rank]
    }

    /// The area that is lost without it: infinite at an end of the staircase that no limit closes, not above 0
    /// beyond the limits.
    #[inline]
    pub fn worth(&self, rank: usize) -> f64 {
        self.worth[rank]
    }

    fn appraise(&mut self, rank: usize) {
        let [x, y] = self.points[rank];
        let [right, top] = self.limits;
        let next = self.points.get(rank + 1).map_or(right, |point| point[0].min(right));
        let before = if rank == 0 { top } else { self.points[rank - 1][1].min(top) };
        self.worth[rank] = match beyond(&[x, y], &self.limits) {
            None => (next - x) * (before - y),
            Some(excess) => -excess,
        };
    }

    /// Admits a point unless a member is as good everywhere. `left` gets the slots of those who go for it:
    /// whom it dominates, and whoever is worth the least if there are too many; that may be itself.
    pub fn admit(&mut self, [x, y]: [f64; 2], slot: usize, left: &mut Vec<usize>) -> bool {
        let at = self.points.partition_point(|point| point[0] < x);
        let dominated = at > 0 && self.points[at - 1][1] <= y
            || self.points.get(at).is_some_and(|point| point[0] == x && point[1] <= y);
        if dominated {
            return false;
        }
        let covered = self.points[at..].iter().take_while(|point| point[1] >= y).count();
        left.extend(self.slots.drain(at..at + covered));
        self.points.drain(at..at + covered);
        self.worth.drain(at..at + covered);
        self.points.insert(at, [x, y]);
        self.slots.insert(at, slot);
        self.worth.insert(at, 0.0);
        self.appraise(at);
        self.appraise_about(at, at + 1);
        if self.points.len() > self.capacity {
            let least = self.least();
            left.push(self.slots.remove(least));
            self.points.remove(least);
            self.worth.remove(least);
            self.appraise_about(least, least);
        }
        true
    }

    /// The member before `rank` and the one at `after`, if there are.
    fn appraise_about(&mut self, rank: usize, after: usize) {
        if rank > 0 {
            self.appraise(rank - 1);
        }
        if after < self.points.len() {
            self.appraise(after);
        }
    }

    fn least(&self) -> usize {
        let mut least = 0;
        for (rank, worth) in self.worth.iter().enumerate() {
            if *worth < self.worth[least] {
                least = rank;
            }
        }
        least
    }
}
