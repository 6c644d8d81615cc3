//! What a box of the block diagram is.

/// Ticks are counted by the step generator; one tick is [`TICK_S`].
pub type Tick = u64;

/// Length of a tick, seconds (the paper's Δt, table 1).
pub const TICK_S: f64 = 1e-3;

/// Ticks in a second.
pub const TICKS_PER_SECOND: u64 = 1000;

/// A box of the diagram: values in, values out, no clock, no file, no log, no allocation.
///
/// `step` is total: stale, missing or invalid input is a value it answers, not an error. Set-up
/// (each box's constructor) may fail; stepping may only degrade. The same `step` is called by every
/// clock (`real`, `lockstep`, `in-process`), which is why the three end in the same bits.
pub trait Block {
    /// What one step reads.
    type Inputs<'a>;
    /// What one step writes.
    type Output;

    /// Advances the box to `tick` and returns what it publishes there.
    fn step(&mut self, tick: Tick, inputs: Self::Inputs<'_>) -> Self::Output;
}
