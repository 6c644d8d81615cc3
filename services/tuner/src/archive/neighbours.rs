//! Three objectives: the members keep their distance.
//!
//! Who is nearest to whom is kept from one newcomer to the next (SPEA2's truncation, Zitzler et al. 2001, without
//! its sorting): of the two nearest to each other the one goes whose second neighbour is nearer.

use super::beyond;

/// A change of the front's extent by this share is worth measuring all distances anew.
const RESCALE: f64 = 0.05;

/// Members in no order; the last one moves to the rank of one that leaves.
#[derive(Clone, Debug)]
pub struct Neighbours {
    capacity: usize,
    /// What is not below them counts last; infinite for none.
    limits: [f64; 3],
    points: Vec<[f64; 3]>,
    slots: Vec<usize>,
    /// The extent of the front that distances are measured by.
    extent: [f64; 3],
    /// One over it, 0 where there is none.
    scale: [f64; 3],
    /// Room for the squared distances of one member to all.
    row: Vec<f64>,
    /// The nearest other member, and its squared distance.
    nearest: Vec<usize>,
    gaps: Vec<f64>,
    /// Who has the least and who the greatest of an objective.
    best: [usize; 3],
    worst: [usize; 3],
    /// Members beyond the limits.
    beyond: usize,
}

/// As good everywhere. Without branches: how one objective compares says nothing about the next.
fn covers(a: &[f64; 3], b: &[f64; 3]) -> bool {
    (a[0] <= b[0]) & (a[1] <= b[1]) & (a[2] <= b[2])
}

impl Neighbours {
    pub fn new(capacity: usize, limits: [f64; 3]) -> Self {
        let room = capacity + 1;
        Self {
            capacity,
            limits,
            points: Vec::with_capacity(room),
            slots: Vec::with_capacity(room),
            extent: [0.0; 3],
            scale: [0.0; 3],
            row: vec![0.0; room],
            nearest: Vec::with_capacity(room),
            gaps: Vec::with_capacity(room),
            best: [0; 3],
            worst: [0; 3],
            beyond: 0,
        }
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    #[inline]
    pub fn slot(&self, rank: usize) -> usize {
        self.slots[rank]
    }

    /// Squared distance to the nearest member: infinite for who has the least of an objective, not
    /// above 0 beyond the limits.
    #[inline]
    pub fn worth(&self, rank: usize) -> f64 {
        if self.beyond > 0
            && let Some(excess) = beyond(&self.points[rank], &self.limits)
        {
            -excess
        } else if self.best.contains(&rank) {
            f64::INFINITY
        } else {
            self.gaps[rank]
        }
    }

    /// As [`super::staircase::Staircase::admit`].
    pub fn admit(&mut self, point: [f64; 3], slot: usize, left: &mut Vec<usize>) -> bool {
        let (mut covered, mut covering) = (false, false);
        for member in &self.points {
            covered |= covers(member, &point);
            covering |= covers(&point, member);
        }
        if covered {
            return false;
        }
        for rank in (0..self.points.len()).rev().filter(|_| covering) {
            if covers(&point, &self.points[rank]) {
                left.push(self.remove(rank));
            }
        }
        let rank = self.points.len();
        self.beyond += usize::from(beyond(&point, &self.limits).is_some());
        self.points.push(point);
        self.slots.push(slot);
        self.nearest.push(rank);
        self.gaps.push(f64::INFINITY);
        for (axis, value) in point.iter().enumerate() {
            if rank == 0 || *value < self.points[self.best[axis]][axis] {
                self.best[axis] = rank;
            }
            if rank == 0 || *value > self.points[self.worst[axis]][axis] {
                self.worst[axis] = rank;
            }
        }
        if self.extent_changed() {
            (0..=rank).for_each(|member| self.find_nearest(member));
        } else {
            self.find_nearest(rank);
            let kept = self.gaps.iter_mut().zip(&mut self.nearest);
            for ((gap, nearest), distance) in kept.zip(&self.row[..rank]) {
                if distance < gap {
                    (*gap, *nearest) = (*distance, rank);
                }
            }
        }
        if self.points.len() > self.capacity {
            let least = self.least();
            left.push(self.remove(least));
        }
        true
    }

    /// True if the front's extent is no longer the one distances are in; then it is taken over.
    fn extent_changed(&mut self) -> bool {
        let extent: [f64; 3] = std::array::from_fn(|axis| {
            self.points[self.worst[axis]][axis] - self.points[self.best[axis]][axis]
        });
        let changed = extent.iter().zip(&self.extent).any(|(new, old)| (new - old).abs() > RESCALE * old);
        if changed {
            self.extent = extent;
            self.scale = extent.map(|extent| if extent > 0.0 { 1.0 / extent } else { 0.0 });
        }
        changed
    }

    /// Squared distance; the same bits both ways.
    #[inline]
    fn distance(&self, a: &[f64; 3], b: &[f64; 3]) -> f64 {
        let gap = |axis: usize| (a[axis] - b[axis]) * self.scale[axis];
        gap(0) * gap(0) + gap(1) * gap(1) + gap(2) * gap(2)
    }

    /// Measures a member's distances to all, infinite to itself, and finds the nearest.
    fn find_nearest(&mut self, rank: usize) {
        let mut row = std::mem::take(&mut self.row);
        let from = self.points[rank];
        for (distance, to) in row.iter_mut().zip(&self.points) {
            *distance = self.distance(&from, to);
        }
        row[rank] = f64::INFINITY;
        let (mut gap, mut nearest) = (f64::INFINITY, rank);
        for (other, distance) in row[..self.points.len()].iter().enumerate() {
            if *distance < gap {
                (gap, nearest) = (*distance, other);
            }
        }
        (self.gaps[rank], self.nearest[rank]) = (gap, nearest);
        self.row = row;
    }

    /// Distance to the second neighbour.
    fn second(&self, rank: usize) -> f64 {
        let others = self.points.iter().enumerate();
        let others = others.filter(|(other, _)| *other != rank && *other != self.nearest[rank]);
        let distances = others.map(|(_, other)| self.distance(&self.points[rank], other));
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Who is worth the least.
    fn least(&self) -> usize {
        let mut least = 0;
        let mut worth = self.worth(0);
        for rank in 1..self.points.len() {
            // What is not near is not looked at any closer.
            if self.beyond == 0 && self.gaps[rank] > worth {
                continue;
            }
            let other = self.worth(rank);
            if other < worth || other == worth && self.second(rank) < self.second(least) {
                (least, worth) = (rank, other);
            }
        }
        least
    }

    /// Takes a member out; the last one moves to its rank.
    fn remove(&mut self, rank: usize) -> usize {
        let last = self.points.len() - 1;
        self.beyond -= usize::from(beyond(&self.points[rank], &self.limits).is_some());
        self.points.swap_remove(rank);
        self.nearest.swap_remove(rank);
        self.gaps.swap_remove(rank);
        for member in 0..last {
            match self.nearest[member] {
                gone if gone == rank => self.find_nearest(member),
                moved if moved == last => self.nearest[member] = rank,
                _ => {}
            }
        }
        self.forget_extreme(rank, last);
        self.slots.swap_remove(rank)
    }

    /// Finds the extremes anew that left, and follows those that moved.
    fn forget_extreme(&mut self, rank: usize, last: usize) {
        for axis in 0..3 {
            let by = |a: &usize, b: &usize| self.points[*a][axis].total_cmp(&self.points[*b][axis]);
            let all = || 0..self.points.len();
            let follow = |extreme: usize, anew: &dyn Fn() -> Option<usize>| match extreme {
                gone if gone == rank => anew().unwrap_or(0),
                moved if moved == last => rank,
                other => other,
            };
            let (best, worst) = (self.best[axis], self.worst[axis]);
            self.best[axis] = follow(best, &|| all().min_by(by));
            self.worst[axis] = follow(worst, &|| all().max_by(by));
        }
    }

    /// Everything that is kept up to date, against what it is kept for.
    #[cfg(test)]
    pub fn check(&self) {
        for rank in 0..self.len() {
            let others = (0..self.len()).filter(|other| *other != rank).map(|other| {
                let gaps = (0..3).map(|axis| {
                    let gap = self.points[other][axis] - self.points[rank][axis];
                    if self.extent[axis] > 0.0 { gap / self.extent[axis] } else { 0.0 }
                });
                gaps.map(|gap| gap * gap).sum::<f64>()
            });
            let least = others.fold(f64::INFINITY, f64::min);
            let (kept, nearest) = (self.gaps[rank], self.nearest[rank]);
            assert!(kept == least || (kept - least).abs() <= 1e-9 * least, "{rank}: {kept}, not {least}");
            assert!(nearest != rank || self.len() == 1);
        }
        for axis in 0..3 {
            let all = || self.points.iter().map(|point| point[axis]);
            assert_eq!(self.points[self.best[axis]][axis], all().fold(f64::INFINITY, f64::min));
            assert_eq!(self.points[self.worst[axis]][axis], all().fold(f64::NEG_INFINITY, f64::max));
        }
    }
}
