//! A box stepped over the ticks it has answered.
//!
//! Of a tick without a recorded answer it is not known whether the box did not answer it, or the recording has lost
//! the answer. The next recorded one tells: it is made both ways.

use super::fields::same;
use super::log::{Dated, Wire};
use hilare_interfaces::block::Tick;

/// Ticks stepped through at most where no answer was recorded.
const THROUGH_MAX: u64 = 100_000;

/// A box between two steps, with what it is stepped with.
pub trait Walker: Clone {
    /// What it answers.
    type Answer: Dated;

    /// Answers a tick; why not, if an input of it is not in the recording.
    fn step(&mut self, tick: Tick) -> Result<Self::Answer, String>;
}

/// Ticks of several lists in order, each once.
pub fn rising(ticks: impl IntoIterator<Item = Tick>) -> Vec<Tick> {
    let mut ticks: Vec<Tick> = ticks.into_iter().collect();
    ticks.sort_unstable();
    ticks.dedup();
    ticks
}

/// Steps a box over `ticks`, which rise; `made` sees each answer, and the box after it. `next`: the first tick it
/// might answer; `stride`: ticks from one answer to the next. An error has the tick at which an input is missing.
pub fn walk<W: Walker>(
    walker: &mut W,
    next: Tick,
    stride: u64,
    ticks: &[Tick],
    recorded: &Wire<W::Answer>,
    mut made: impl FnMut(&W::Answer, &mut W),
) -> Result<(), String> {
    let mut next = next;
    for tick in ticks.iter().copied() {
        let is_recorded = |answer: &W::Answer| recorded.at(tick).iter().any(|known| same(known, answer));
        let gap = tick.saturating_sub(next);
        let before = (gap > 0 && gap <= THROUGH_MAX).then(|| walker.clone());
        let answer = walker.step(tick)?;
        let through = before
            .filter(|_| !is_recorded(&answer))
            .and_then(|other| step_through(other, (tick - gap..=tick).step_by(stride as usize)))
            .filter(|(_, answers)| answers.last().is_some_and(is_recorded));
        match through {
            Some((other, answers)) => {
                *walker = other;
                answers.iter().for_each(|answer| made(answer, walker));
            }
            None => made(&answer, walker),
        }
        next = tick.saturating_add(stride);
    }
    Ok(())
}

fn step_through<W: Walker>(mut walker: W, ticks: impl Iterator<Item = Tick>) -> Option<(W, Vec<W::Answer>)> {
    let answers: Result<Vec<_>, String> = ticks.map(|tick| walker.step(tick)).collect();
    answers.ok().map(|answers| (walker, answers))
}
