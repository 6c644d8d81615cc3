//! Evaluating candidates: one by one or several at once, on as many threads as wanted.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// What candidates are judged by. An objective must answer a candidate with the same bits every time,
/// whoever else is in the batch.
///
/// A closure `Fn(&[f64], &mut [f64]) -> f64` is one: it is shown the values of a candidate, fills in its
/// objectives (all of them to be minimised) and answers by how much it violates the constraints, 0
/// if it is feasible. A candidate with an objective that is not finite counts as violating them beyond measure.
pub trait Objective: Sync {
    /// Candidates it likes to be shown at once; the last batch may be shorter.
    fn lanes(&self) -> usize {
        1
    }

    /// Judges every candidate of a batch.
    fn evaluate(&self, batch: &mut Batch<'_>);
}

impl<F: Fn(&[f64], &mut [f64]) -> f64 + Sync> Objective for F {
    fn evaluate(&self, batch: &mut Batch<'_>) {
        for index in 0..batch.len() {
            let (values, objectives, violation) = batch.lane(index);
            *violation = self(values, objectives);
        }
    }
}

/// An objective that judges several candidates at once.
pub struct InLanes<F> {
    /// How many.
    pub lanes: usize,
    /// Judges every candidate of a batch.
    pub evaluate: F,
}

impl<F: Fn(&mut Batch<'_>) + Sync> Objective for InLanes<F> {
    fn lanes(&self) -> usize {
        self.lanes
    }

    fn evaluate(&self, batch: &mut Batch<'_>) {
        (self.evaluate)(batch);
    }
}

/// Candidates, and room for what they come to.
#[derive(Debug)]
pub struct Batch<'a> {
    values: &'a [f64],
    objectives: &'a mut [f64],
    violations: &'a mut [f64],
}

impl<'a> Batch<'a> {
    /// Over `violations.len()` candidates; the others have as many numbers for each.
    pub(crate) fn new(values: &'a [f64], objectives: &'a mut [f64], violations: &'a mut [f64]) -> Self {
        Self { values, objectives, violations }
    }

    /// Candidates.
    pub fn len(&self) -> usize {
        self.violations.len()
    }

    /// There is none.
    pub fn is_empty(&self) -> bool {
        self.violations.is_empty()
    }

    /// A candidate's values, its objectives and its violation of the constraints, both to be filled in.
    ///
    /// # Panics
    ///
    /// If there are not as many candidates.
    #[inline]
    pub fn lane(&mut self, index: usize) -> (&[f64], &mut [f64], &mut f64) {
        let count = self.violations.len();
        let (dimensions, objectives) = (self.values.len() / count, self.objectives.len() / count);
        (
            &self.values[index * dimensions..][..dimensions],
            &mut self.objectives[index * objectives..][..objectives],
            &mut self.violations[index],
        )
    }

    /// Evaluates in parts of the objective's lanes, on `threads` threads. The parts are taken in order, and
    /// one that was taken is finished, so after a stop the evaluated candidates are the first ones: answers
    /// how many.
    pub(crate) fn evaluate<O: Objective + ?Sized>(
        self,
        objective: &O,
        threads: usize,
        stop: &AtomicBool,
    ) -> usize {
        let count = self.len();
        let lanes = objective.lanes().max(1);
        let Some(dimensions) = self.values.len().checked_div(count) else { return 0 };
        let objectives = self.objectives.len() / count;
        let parts = self
            .values
            .chunks(lanes * dimensions)
            .zip(self.objectives.chunks_mut(lanes * objectives))
            .zip(self.violations.chunks_mut(lanes))
            .map(|((values, objectives), violations)| Batch { values, objectives, violations });
        let helpers = threads.min(count.div_ceil(lanes)).saturating_sub(1);
        if helpers == 0 {
            let mut done = 0;
            for mut part in parts {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                objective.evaluate(&mut part);
                done += part.len();
            }
            return done;
        }
        let queue = Mutex::new((parts, 0));
        let take = || {
            // Whoever panicked while it held the queue ends the search when the threads are joined.
            let mut queue = queue.lock().ok()?;
            let part = (!stop.load(Ordering::Relaxed)).then(|| queue.0.next())??;
            queue.1 += part.len();
            Some(part)
        };
        let work = || {
            while let Some(mut part) = take() {
                objective.evaluate(&mut part);
            }
        };
        thread::scope(|scope| {
            for _ in 0..helpers {
                scope.spawn(work);
            }
            work();
        });
        queue.into_inner().map_or(0, |(_, done)| done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_and_threads_see_every_candidate_once() {
        let values: Vec<f64> = (0..23).map(f64::from).collect();
        for lanes in [1, 4, 23, 50] {
            for threads in [1, 2, 7] {
                let (mut objectives, mut violations) = (vec![0.0; 23], vec![f64::NAN; 23]);
                let evaluate = |batch: &mut Batch<'_>| {
                    assert!(batch.len() <= lanes);
                    for index in 0..batch.len() {
                        let (values, objectives, violation) = batch.lane(index);
                        objectives[0] += values[0] + 1.0;
                        *violation = 0.0;
                    }
                };
                let batch = Batch::new(&values, &mut objectives, &mut violations);
                let done = batch.evaluate(&InLanes { lanes, evaluate }, threads, &AtomicBool::new(false));
                assert_eq!(done, 23);
                assert!(objectives.iter().zip(&values).all(|(objective, value)| *objective == value + 1.0));
                assert!(violations.iter().all(|violation| *violation == 0.0));
            }
        }
    }

    #[test]
    fn a_stop_leaves_the_first_ones_done() {
        let values = [0.0; 40];
        for threads in [1, 3] {
            let (mut objectives, mut violations) = (vec![0.0; 40], vec![f64::NAN; 40]);
            let stop = AtomicBool::new(false);
            let objective = |_: &[f64], objectives: &mut [f64]| {
                objectives[0] = 1.0;
                stop.store(true, Ordering::Relaxed);
                0.0
            };
            let batch = Batch::new(&values, &mut objectives, &mut violations);
            let done = batch.evaluate(&objective, threads, &stop);
            assert!((1..=threads).contains(&done), "{done}");
            assert!(violations[..done].iter().all(|violation| *violation == 0.0));
            assert!(violations[done..].iter().all(|violation| violation.is_nan()));
        }
    }
}
