//! What a search asks: objectives out of a problem's figures.

use super::objectives::{OBJECTIVES, Objective};
use super::problem::{Figures, Problem};
use hilare_tuner::{Archive, Batch, Budget, Ending, InLanes, Log, LogError, Mopso};
use std::sync::atomic::AtomicBool;
use std::thread;

/// Judges candidates.
#[derive(Debug)]
pub struct Judge {
    /// Robots, paths and parameters.
    pub problem: Problem,
    /// What is minimised.
    pub objectives: Vec<&'static Objective>,
    /// Its places among the figures.
    places: Vec<usize>,
}

impl Judge {
    /// By the objectives at these places in [`OBJECTIVES`].
    pub fn new(problem: Problem, places: Vec<usize>) -> Self {
        Self { problem, objectives: places.iter().map(|place| &OBJECTIVES[*place]).collect(), places }
    }

    /// Names of the objectives in files.
    pub fn keys(&self) -> Vec<&'static str> {
        self.objectives.iter().map(|objective| objective.key).collect()
    }

    /// The objectives among figures.
    pub fn of(&self, figures: &Figures) -> Vec<f64> {
        self.places.iter().map(|place| figures[*place]).collect()
    }

    /// By how much each candidate violates the constraints, and its objectives: zeros if it does.
    pub fn answers(&self, candidates: &[&[f64]], threads: usize) -> Vec<(f64, Vec<f64>)> {
        let answer = |judged: Result<Figures, f64>| match judged {
            Ok(figures) => (0.0, self.of(&figures)),
            Err(left) => (left, vec![0.0; self.places.len()]),
        };
        // The fast path takes many candidates at once, and shares them out by itself.
        let (parts, inner) = if self.problem.is_fast() { (1, threads) } else { (threads, 1) };
        let share = candidates.len().div_ceil(parts).max(1);
        if share >= candidates.len() {
            return self.problem.figures_of(candidates, inner).into_iter().map(answer).collect();
        }
        thread::scope(|scope| {
            let part = |candidates| scope.spawn(move || self.problem.figures_of(candidates, inner));
            let parts: Vec<_> = candidates.chunks(share).map(part).collect();
            let judged = parts.into_iter().flat_map(|part| part.join().unwrap_or_default());
            judged.map(answer).collect()
        })
    }

    /// Lets a search run to its budget, or until `stop` is set: see [`Mopso::run`].
    ///
    /// # Errors
    ///
    /// If the log cannot be written or is of another search.
    pub fn search(
        &self,
        search: &mut Mopso,
        budget: Budget,
        log: Option<&mut Log>,
        stop: &AtomicBool,
        watch: impl FnMut(u64, &Archive),
    ) -> Result<Ending, LogError> {
        let fast = self.problem.is_fast();
        let lanes = if fast { search.settings().swarm } else { 1 };
        let inner = if fast { budget.threads } else { 1 };
        let evaluate = |batch: &mut Batch<'_>| {
            let candidates: Vec<Vec<f64>> = (0..batch.len()).map(|n| batch.lane(n).0.to_vec()).collect();
            let values: Vec<&[f64]> = candidates.iter().map(Vec::as_slice).collect();
            for (n, (left, answer)) in self.answers(&values, inner).into_iter().enumerate() {
                let (_, found, violation) = batch.lane(n);
                found.copy_from_slice(&answer);
                *violation = left;
            }
        };
        let outer = Budget { threads: if fast { 1 } else { budget.threads }, ..budget };
        search.run(&InLanes { lanes, evaluate }, outer, log, stop, watch)
    }
}
