//! The external archive (Coello 2004): what nobody has beaten yet.
//!
//! It is bounded by crowding, not by the paper's adaptive grid: a grid keeps whole cells and loses the
//! borders of a front, and how fine it is has to be guessed. What counts as crowded is what a member adds:
//!
//! * two objectives ([`staircase`]): the area that it alone dominates. It is a product of two gaps, so it
//!   needs no scaling, and what is kept comes as near to the greatest hypervolume as that many
//!   points can (`tests/fronts.rs`: within 0.0001 on ZDT1 and ZDT2). The sum of the gaps, NSGA-II's crowding
//!   distance, spaces them evenly instead.
//! * three ([`neighbours`]): the distance to the nearest other member, in units of the front's extent.
//!   The sum of gaps in each objective says little about distance there, and the exact volume costs too much.
//!
//! Either way a newcomer costs a comparison with the members and the change of a few neighbours, not a
//! sort of the whole archive.

mod neighbours;
mod staircase;

use crate::random::Random;
use neighbours::Neighbours;
use staircase::Staircase;

/// Most objectives that can be searched.
pub const OBJECTIVES_MAX: usize = 3;

/// How far a point is beyond the limits, relative to them; `None` within. The farthest leave first, so that while
/// nothing is within, the members draw near.
fn beyond<const N: usize>(point: &[f64; N], limits: &[f64; N]) -> Option<f64> {
    let pairs = point.iter().zip(limits).filter(|(value, limit)| value >= limit);
    let excesses = pairs.map(|(value, limit)| (value - limit) / limit.abs().max(f64::MIN_POSITIVE));
    excesses.max_by(f64::total_cmp)
}

/// Which members stay, by two or three objectives. A rank is a place among the members; a slot is where
/// the archive keeps what belongs to one.
#[derive(Clone, Debug)]
enum Keeper {
    Two(Staircase),
    Three(Neighbours),
}

/// The best found so far: mutually non-dominated, at most `capacity`.
#[derive(Clone, Debug)]
pub struct Archive {
    keeper: Keeper,
    objectives: usize,
    dimensions: usize,
    /// By slot: objectives, coordinates, number of the evaluation.
    points: Vec<f64>,
    coordinates: Vec<f64>,
    evaluations: Vec<u64>,
    free: Vec<usize>,
    left: Vec<usize>,
    /// While nothing feasible is known: the candidate that is the least infeasible, and its violation.
    least: Option<(f64, Vec<f64>)>,
}

/// One member of the archive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member<'a> {
    /// Its objectives.
    pub objectives: &'a [f64],
    /// Where it is in the unit cube ([`crate::Space::decode`]).
    pub coordinates: &'a [f64],
    /// The evaluation it comes from, from 0.
    pub evaluation: u64,
}

/// What an evaluation came to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found<'a> {
    pub objectives: &'a [f64],
    /// 0 if feasible.
    pub violation: f64,
    pub coordinates: &'a [f64],
    pub evaluation: u64,
}

impl Archive {
    /// An empty archive. What is not below `reference` goes first once it is full.
    pub(crate) fn new(
        objectives: usize,
        dimensions: usize,
        capacity: usize,
        reference: Option<&[f64]>,
    ) -> Self {
        let limits = |index: usize| reference.map_or(f64::INFINITY, |reference| reference[index]);
        let keeper = if objectives == 2 {
            Keeper::Two(Staircase::new(capacity, [limits(0), limits(1)]))
        } else {
            Keeper::Three(Neighbours::new(capacity, [limits(0), limits(1), limits(2)]))
        };
        let slots = capacity + 1;
        Self {
            keeper,
            objectives,
            dimensions,
            points: vec![0.0; slots * objectives],
            coordinates: vec![0.0; slots * dimensions],
            evaluations: vec![0; slots],
            free: (0..slots).rev().collect(),
            left: Vec::with_capacity(slots),
            least: None,
        }
    }

    /// Members.
    pub fn len(&self) -> usize {
        match &self.keeper {
            Keeper::Two(keeper) => keeper.len(),
            Keeper::Three(keeper) => keeper.len(),
        }
    }

    /// Nothing feasible was found yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn slot(&self, rank: usize) -> usize {
        match &self.keeper {
            Keeper::Two(keeper) => keeper.slot(rank),
            Keeper::Three(keeper) => keeper.slot(rank),
        }
    }

    /// The members, in no particular order.
    pub fn members(&self) -> impl ExactSizeIterator<Item = Member<'_>> {
        (0..self.len()).map(|rank| {
            let slot = self.slot(rank);
            Member {
                objectives: &self.points[slot * self.objectives..][..self.objectives],
                coordinates: self.coordinates_of(slot),
                evaluation: self.evaluations[slot],
            }
        })
    }

    fn coordinates_of(&self, slot: usize) -> &[f64] {
        &self.coordinates[slot * self.dimensions..][..self.dimensions]
    }

    fn worth(&self, rank: usize) -> f64 {
        match &self.keeper {
            Keeper::Two(keeper) => keeper.worth(rank),
            Keeper::Three(keeper) => keeper.worth(rank),
        }
    }

    /// Whom to follow: the least crowded of `best_of` members drawn at random. Without members, the least infeasible
    /// candidate; `None` before the first evaluation.
    #[inline]
    pub(crate) fn leader(&self, best_of: usize, random: &mut Random) -> Option<&[f64]> {
        let count = self.len();
        if count == 0 {
            return self.least.as_ref().map(|(_, coordinates)| coordinates.as_slice());
        }
        let mut leader = random.below(count);
        for _ in 1..best_of {
            let other = random.below(count);
            if self.worth(other) > self.worth(leader) {
                leader = other;
            }
        }
        Some(self.coordinates_of(self.slot(leader)))
    }

    /// Takes in what an evaluation came to, if nobody dominates it and there is room for it.
    pub(crate) fn offer(&mut self, found: Found<'_>) {
        if found.violation > 0.0 {
            self.offer_infeasible(found);
            return;
        }
        let Some(&slot) = self.free.last() else { return };
        self.left.clear();
        let admitted = match (&mut self.keeper, found.objectives) {
            (Keeper::Two(keeper), &[x, y]) => keeper.admit([x, y], slot, &mut self.left),
            (Keeper::Three(keeper), &[x, y, z]) => keeper.admit([x, y, z], slot, &mut self.left),
            _ => false,
        };
        if !admitted {
            return;
        }
        self.least = None;
        self.free.pop();
        self.points[slot * self.objectives..][..self.objectives].copy_from_slice(found.objectives);
        self.coordinates[slot * self.dimensions..][..self.dimensions].copy_from_slice(found.coordinates);
        self.evaluations[slot] = found.evaluation;
        self.free.append(&mut self.left);
    }

    fn offer_infeasible(&mut self, found: Found<'_>) {
        let better = self.least.as_ref().is_none_or(|(violation, _)| found.violation < *violation);
        if self.is_empty() && better {
            self.least = Some((found.violation, found.coordinates.to_vec()));
        }
    }
}

#[cfg(test)]
mod tests;
