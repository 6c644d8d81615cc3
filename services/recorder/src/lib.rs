//! The recorder: what happened in a run.
//!
//! [`assembler`] puts the messages of one tick together from wires that arrive apart, [`statistics`]
//! turns ticks into the figures of `summary.json`, [`trace`] keeps what the plots need.

pub mod assembler;
pub mod statistics;
pub mod trace;

use hilare_interfaces::messages::{Pose, Reference, Steps, Truth};

/// Everything that is known of one tick.
#[derive(Clone, Copy, Debug)]
pub struct TickRecord<'a> {
    /// State of the step generator after the tick.
    pub steps: &'a Steps,
    /// Estimated pose after the tick.
    pub pose: &'a Pose,
    /// True pose after the tick.
    pub truth: &'a Truth,
    /// The reference in force during the tick: chosen at the last control period before it.
    pub reference: &'a Reference,
}

/// Statistics and trace of a run, fed tick by tick.
#[derive(Clone, Debug)]
pub struct RunRecord {
    /// The figures.
    pub statistics: statistics::RunStatistics,
    /// The curves.
    pub trace: trace::Trace,
}

impl RunRecord {
    /// An empty record; the trace keeps one row a control period.
    pub fn new(period_ticks: u64) -> Self {
        Self { statistics: statistics::RunStatistics::default(), trace: trace::Trace::new(period_ticks) }
    }

    /// Takes in one tick, in order; ticks after the arrival change nothing.
    pub fn push(&mut self, record: TickRecord<'_>) {
        if self.statistics.arrived() {
            return;
        }
        self.statistics.push(record);
        self.trace.push(record);
    }
}
