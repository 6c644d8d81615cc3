//! The odometry since the last fix's picture, tick by tick, bounded.

use alloc::collections::VecDeque;
use hilare_interfaces::block::Tick;
use hilare_interfaces::chassis::PerWheel;

/// Cumulative counts after a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counted {
    /// The tick.
    pub tick: Tick,
    /// The counts.
    pub counts: PerWheel<i64>,
}

impl Counted {
    /// What was counted from `self` to `later`.
    pub fn until(&self, later: &Self) -> PerWheel<i64> {
        core::array::from_fn(|wheel| later.counts[wheel].wrapping_sub(self.counts[wheel]))
    }

    /// The counts at `tick`, between `self` and `later`: messages between them were lost, the wheels
    /// are taken to have turned evenly, by whole counts.
    fn between(&self, later: &Self, tick: Tick) -> Self {
        let share = (tick - self.tick) as f64 / (later.tick - self.tick) as f64;
        let gone = self.until(later);
        let counts = core::array::from_fn(|wheel| {
            self.counts[wheel].wrapping_add(libm::round(share * gone[wheel] as f64) as i64)
        });
        Self { tick, counts }
    }
}

/// Odometry from the filter's tick to the present one; never empty.
#[derive(Clone, Debug)]
pub struct History {
    /// The oldest first, ticks rising.
    entries: VecDeque<Counted>,
    ticks_max: u64,
}

impl History {
    /// Nothing counted at tick 0. Allocates all it will ever need.
    pub fn new(ticks_max: u64) -> Self {
        let mut entries = VecDeque::with_capacity(ticks_max as usize + 2);
        entries.push_back(Counted { tick: 0, counts: [0; 4] });
        Self { entries, ticks_max }
    }

    /// Where the filter stands.
    pub fn base(&self) -> Counted {
        self.entries[0]
    }

    /// The newest odometry.
    pub fn newest(&self) -> Counted {
        self.entries[self.entries.len() - 1]
    }

    /// Adds newer odometry. What then is too old must be taken with [`Self::step_to`] first.
    pub fn push(&mut self, counted: Counted) {
        self.entries.push_back(counted);
    }

    /// Tick up to which the base has to move so that no more than the bound is kept.
    pub fn due(&self) -> Tick {
        self.newest().tick.saturating_sub(self.ticks_max)
    }

    /// Moves the base one entry on, at most to `tick`; what was counted on the way, `None` if it
    /// stands there already.
    pub fn step_to(&mut self, tick: Tick) -> Option<PerWheel<i64>> {
        let base = self.base();
        let next = *self.entries.get(1)?;
        if base.tick >= tick {
            return None;
        }
        let reached = if next.tick <= tick {
            self.entries.pop_front();
            next
        } else {
            base.between(&next, tick)
        };
        self.entries[0] = reached;
        Some(base.until(&reached))
    }

    /// What was counted from entry to entry, the oldest first.
    pub fn moves(&self) -> impl Iterator<Item = PerWheel<i64>> {
        self.entries.iter().zip(self.entries.iter().skip(1)).map(|(from, to)| from.until(to))
    }
}
