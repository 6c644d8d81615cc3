//! A search from its beginning, or from its log, to its end or until it is stopped.

use crate::archive::{Archive, Member};
use crate::batch::{Batch, Objective};
use crate::log::{Log, LogError};
use crate::swarm::Mopso;
use std::sync::atomic::{AtomicBool, Ordering};

/// How far and how a search goes.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// Evaluations in all, those of the log included.
    pub evaluations: u64,
    /// Threads that evaluate; they change nothing but the time.
    pub threads: usize,
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The budget is used up.
    Done,
    /// It was told to stop; the log has all that was evaluated.
    Stopped,
}

/// A solution.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Parameter values, in the space's order.
    pub values: Vec<f64>,
    /// What they come to.
    pub objectives: Vec<f64>,
    /// The evaluation that found it, from 0.
    pub evaluation: u64,
}

impl Mopso {
    /// Searches until `budget` is used up or `stop` is set, and shows the archive after every generation. With
    /// a log, what is known is not evaluated again, and what is evaluated is written at the end of its
    /// generation.
    ///
    /// # Errors
    ///
    /// If the log cannot be written or is of another search.
    pub fn run<O: Objective + ?Sized>(
        &mut self,
        objective: &O,
        budget: Budget,
        mut log: Option<&mut Log>,
        stop: &AtomicBool,
        mut watch: impl FnMut(u64, &Archive),
    ) -> Result<Ending, LogError> {
        while self.evaluations() < budget.evaluations {
            let first = self.evaluations();
            let (dimensions, width) = (self.space().dimensions(), self.settings().objectives);
            let count = (self.settings().swarm as u64).min(budget.evaluations - first) as usize;
            let generation = self.ask();
            let values = &generation.values[..count * dimensions];
            let objectives = &mut generation.objectives[..count * width];
            let violations = &mut generation.violations[..count];
            let known = match &log {
                Some(log) => log.recall(first, values, objectives, violations)?,
                None => 0,
            };
            let rest = Batch::new(
                &values[known * dimensions..],
                &mut objectives[known * width..],
                &mut violations[known..],
            );
            let done = known + rest.evaluate(objective, budget.threads, stop);
            if let Some(log) = &mut log {
                log.append(first, known..done, values, objectives, violations)?;
            }
            self.tell(done);
            watch(self.evaluations(), self.archive());
            if done < count || stop.load(Ordering::Relaxed) && self.evaluations() < budget.evaluations {
                return Ok(Ending::Stopped);
            }
        }
        Ok(Ending::Done)
    }

    /// The archive's members with their parameter values, ascending in the first objective (then in the others).
    pub fn front(&self) -> Vec<Solution> {
        let solution = |member: Member<'_>| {
            let mut values = vec![0.0; self.space().dimensions()];
            self.space().decode(member.coordinates, &mut values);
            Solution { values, objectives: member.objectives.to_vec(), evaluation: member.evaluation }
        };
        let mut front: Vec<Solution> = self.archive().members().map(solution).collect();
        front.sort_by(|a, b| {
            let pairs = a.objectives.iter().zip(&b.objectives);
            pairs
                .map(|(a, b)| a.total_cmp(b))
                .find(|order| order.is_ne())
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        front
    }
}
