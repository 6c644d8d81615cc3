//! Time, lent by the caller: the library reads no clock of its own.

/// When to stop improving, and what time it is.
///
/// Asked between batches of bounded work, so a wall-clock deadline ends planning at a batch border: a batch
/// is well below a millisecond. With a budget that does not depend on a clock the plan depends on map, seed
/// and queries alone.
pub trait Budget {
    /// True once no more work shall be begun.
    fn exhausted(&mut self) -> bool;

    /// A time stamp in nanoseconds for the plan's stage times; constant where nobody cares.
    fn now_ns(&mut self) -> u64 {
        0
    }
}

/// No limit: the plan is improved until the roadmap has its full number of samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unlimited;

impl Budget for Unlimited {
    fn exhausted(&mut self) -> bool {
        false
    }
}

/// Time from a clock in nanoseconds, until a deadline on that clock.
#[derive(Clone, Copy, Debug)]
pub struct Deadline<C> {
    clock: C,
    deadline_ns: u64,
}

impl<C: FnMut() -> u64> Deadline<C> {
    /// Stops at `deadline_ns` on `clock` (nanoseconds, any epoch); `u64::MAX` never stops, and still stamps.
    pub fn new(clock: C, deadline_ns: u64) -> Self {
        Self { clock, deadline_ns }
    }
}

impl<C: FnMut() -> u64> Budget for Deadline<C> {
    fn exhausted(&mut self) -> bool {
        (self.clock)() >= self.deadline_ns
    }

    fn now_ns(&mut self) -> u64 {
        (self.clock)()
    }
}

/// Gives `buffer` `length` copies of `value`, in pieces small enough to look at the budget between them;
/// false when it ran out.
pub(crate) fn refill<T: Copy>(buffer: &mut Vec<T>, length: usize, value: T, budget: &mut dyn Budget) -> bool {
    const PIECE: usize = 1 << 14;
    buffer.clear();
    buffer.reserve_exact(length);
    while buffer.len() < length {
        if budget.exhausted() {
            return false;
        }
        buffer.resize((buffer.len() + PIECE).min(length), value);
    }
    true
}
