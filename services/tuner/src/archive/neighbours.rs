//! Three objectives: the members keep their distance.
//!
//! Who is nearest to whom is kept from one newcomer to the next (SPEA2's truncation, Zitzler et al. 2001, without
//! its sorting): of the two nearest to each other the one goes whose second neighbour is nearer.

/// A change of the front's extent by this share is worth measuring all distances anew.
const RESCALE: f64 = 0.05;

/// Members in no order; a rank moves when one before it leaves.
#[derive(Clone, Debug)]
pub struct Neighbours {
    capacity: usize,
    /// What is not below them counts last; infinite for none.
    limits: [f64; 3],
    points: Vec<[f64; 3]>,
    slots: Vec<usize>,
    /// The extent of the front that distances are measured by.
    extent: [f64; 3],
    /// Squared distances, a row of `stride` a rank.
    distances: Vec<f64>,
    stride: usize,
    /// The nearest other member and its squared distance.
    nearest: Vec<(f64, usize)>,
    /// Who has the least of an objective.
    best: [usize; 3],
}

fn covers(a: &[f64; 3], b: &[f64; 3]) -> bool {
    a[0] <= b[0] && a[1] <= b[1] && a[2] <= b[2]
}

impl Neighbours {
    pub fn new(capacity: usize, limits: [f64; 3]) -> Self {
        let stride = capacity + 1;
        Self {
            capacity,
            limits,
            points: Vec::with_capacity(stride),
            slots: Vec::with_capacity(stride),
            extent: [0.0; 3],
            distances: vec![f64::INFINITY; stride * stride],
            stride,
            nearest: Vec::with_capacity(stride),
            best: [0; 3],
        }
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    #[inline]
    pub fn slot(&self, rank: usize) -> usize {
        self.slots[rank]
    }

    /// Squared distance to the nearest member: infinite for who has the least of an objective, below 0
    /// beyond the limits.
    #[inline]
    pub fn worth(&self, rank: usize) -> f64 {
        if self.points[rank].iter().zip(&self.limits).any(|(value, limit)| value >= limit) {
            -1.0
        } else if self.best.contains(&rank) {
            f64::INFINITY
        } else {
            self.nearest[rank].0
        }
    }

    /// As [`super::staircase::Staircase::admit`].
    pub fn admit(&mut self, point: [f64; 3], slot: usize, left: &mut Vec<usize>) -> bool {
        if self.points.iter().any(|member| covers(member, &point)) {
            return false;
        }
        for rank in (0..self.points.len()).rev() {
            if covers(&point, &self.points[rank]) {
                left.push(self.remove(rank));
            }
        }
        let rank = self.points.len();
        self.points.push(point);
        self.slots.push(slot);
        self.nearest.push((f64::INFINITY, rank));
        if self.survey() {
            (0..=rank).for_each(|member| self.measure(member));
            (0..=rank).for_each(|member| self.find_nearest(member));
        } else {
            self.measure(rank);
            self.find_nearest(rank);
            for member in 0..rank {
                let distance = self.distances[member * self.stride + rank];
                if distance < self.nearest[member].0 {
                    self.nearest[member] = (distance, rank);
                }
            }
        }
        if self.points.len() > self.capacity {
            let least = self.least();
            left.push(self.remove(least));
            self.survey_best();
        }
        true
    }

    /// Measures the front's extent; true if it is no longer the one distances are in.
    fn survey(&mut self) -> bool {
        self.survey_best();
        let mut changed = false;
        for axis in 0..3 {
            let low = self.points[self.best[axis]][axis];
            let high = self.points.iter().map(|point| point[axis]).fold(low, f64::max);
            let extent = high - low;
            changed |= (extent - self.extent[axis]).abs() > RESCALE * self.extent[axis];
        }
        if changed {
            for axis in 0..3 {
                let low = self.points[self.best[axis]][axis];
                self.extent[axis] = self.points.iter().map(|point| point[axis]).fold(low, f64::max) - low;
            }
        }
        changed
    }

    fn survey_best(&mut self) {
        for axis in 0..3 {
            let mut best = 0;
            for (rank, point) in self.points.iter().enumerate() {
                if point[axis] < self.points[best][axis] {
                    best = rank;
                }
            }
            self.best[axis] = best;
        }
    }

    /// Distances of a member to all members.
    fn measure(&mut self, rank: usize) {
        let scale = self.extent.map(|extent| if extent > 0.0 { 1.0 / extent } else { 0.0 });
        let from = self.points[rank];
        for (other, to) in self.points.iter().enumerate() {
            let mut sum = 0.0;
            for axis in 0..3 {
                let gap = (to[axis] - from[axis]) * scale[axis];
                sum += gap * gap;
            }
            let distance = if other == rank { f64::INFINITY } else { sum };
            self.distances[rank * self.stride + other] = distance;
            self.distances[other * self.stride + rank] = distance;
        }
    }

    fn row(&self, rank: usize) -> &[f64] {
        &self.distances[rank * self.stride..][..self.points.len()]
    }

    fn find_nearest(&mut self, rank: usize) {
        let mut nearest = (f64::INFINITY, rank);
        for (other, distance) in self.row(rank).iter().enumerate() {
            if *distance < nearest.0 {
                nearest = (*distance, other);
            }
        }
        self.nearest[rank] = nearest;
    }

    /// Distance to the second neighbour.
    fn second(&self, rank: usize) -> f64 {
        let first = self.nearest[rank].1;
        let others = self.row(rank).iter().enumerate().filter(|(other, _)| *other != first);
        others.map(|(_, distance)| *distance).fold(f64::INFINITY, f64::min)
    }

    /// Who is worth the least.
    fn least(&self) -> usize {
        let mut least = 0;
        let mut worth = self.worth(0);
        for rank in 1..self.points.len() {
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
        self.points.swap_remove(rank);
        self.nearest.swap_remove(rank);
        if rank != last {
            let stride = self.stride;
            self.distances.copy_within(last * stride..last * stride + last, rank * stride);
            for other in 0..last {
                self.distances[other * stride + rank] = self.distances[rank * stride + other];
            }
            self.distances[rank * stride + rank] = f64::INFINITY;
        }
        for member in 0..last {
            match self.nearest[member].1 {
                gone if gone == rank => self.find_nearest(member),
                moved if moved == last => self.nearest[member].1 = rank,
                _ => {}
            }
        }
        self.slots.swap_remove(rank)
    }

    /// Everything that is kept up to date, against what it is kept for.
    #[cfg(test)]
    pub fn check(&self) {
        for rank in 0..self.len() {
            let mut least = f64::INFINITY;
            for other in (0..self.len()).filter(|other| *other != rank) {
                let gaps = (0..3).map(|axis| {
                    let gap = self.points[other][axis] - self.points[rank][axis];
                    if self.extent[axis] > 0.0 { gap / self.extent[axis] } else { 0.0 }
                });
                let distance: f64 = gaps.map(|gap| gap * gap).sum();
                let kept = self.distances[rank * self.stride + other];
                assert!((kept - distance).abs() <= 1e-9 * distance, "{rank} to {other}: {kept}, {distance}");
                least = least.min(kept);
            }
            let (kept, nearest) = self.nearest[rank];
            assert_eq!(kept, least, "nearest of {rank}");
            assert!(nearest != rank || self.len() == 1);
        }
    }
}
