//! The odometry since the last fix's picture, tick by tick, bounded.

use alloc::collections::VecDeque;
use hilare_interfaces::block::Tick;
use hilare_interfaces::chassis::PerWheel;
use hilare_interfaces::state::{StateWords, Stateful};

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

impl Stateful for Counted {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.tick);
        self.counts.iter_mut().for_each(|count| words.signed(count));
    }
}

/// A move from entry to entry in one word, so that a whole history is among the words of a state:
///
/// ```text
///   63      56 55       42 41       28 27       14 13        0
///   │ ticks   │ wheel 0   │ wheel 1   │ wheel 2   │ wheel 3  │      counts, each as if 8192 higher
/// ```
///
/// [`WIDE`] stands before a move that has more ticks or counts, as after lost messages.
#[derive(Clone, Copy, Debug)]
struct Packed(u64);

/// No move takes 0 ticks.
const WIDE: u64 = 0;
/// Bits of the counts of one wheel.
const COUNT_BITS: u32 = 14;
/// What is added to them.
const COUNT_OFFSET: i64 = 1 << (COUNT_BITS - 1);
/// Most ticks of a move.
const GAP_MAX: u64 = 0xff;

impl Packed {
    fn new(from: &Counted, to: &Counted) -> Self {
        let gap = to.tick.wrapping_sub(from.tick);
        let mut word = gap;
        let mut fits = gap <= GAP_MAX;
        for count in from.until(to) {
            let field = count.wrapping_add(COUNT_OFFSET).cast_unsigned();
            fits &= field >> COUNT_BITS == 0;
            word = word << COUNT_BITS | field;
        }
        Self(if fits { word } else { WIDE })
    }

    /// Where it leads from `from`.
    fn to(self, from: &Counted) -> Counted {
        let mut word = self.0;
        let mut counts = from.counts;
        for count in counts.iter_mut().rev() {
            let field = (word & ((1 << COUNT_BITS) - 1)).cast_signed();
            *count = count.wrapping_add(field - COUNT_OFFSET);
            word >>= COUNT_BITS;
        }
        Counted { tick: from.tick.wrapping_add(word), counts }
    }
}

/// Odometry of a tick, and the move to it from the one before.
#[derive(Clone, Copy, Debug)]
struct Entry {
    counted: Counted,
    moved: Packed,
}

impl Entry {
    const ZERO: Self = Self { counted: Counted { tick: 0, counts: [0; 4] }, moved: Packed(WIDE) };

    /// Shows how it is come to from `before`.
    fn visit_move(&mut self, before: &Counted, words: &mut StateWords<'_>) {
        words.word(&mut self.moved.0);
        if self.moved.0 == WIDE {
            self.counted.visit_state(words);
        } else if words.is_loading() {
            self.counted = self.moved.to(before);
        }
        words.require(before.tick < self.counted.tick);
    }
}

/// Odometry from the filter's tick to the present one; never empty.
#[derive(Clone, Debug)]
pub struct History {
    /// The oldest first, ticks rising; how that one was come to is of no interest.
    entries: VecDeque<Entry>,
    ticks_max: u64,
}

impl History {
    /// Nothing counted at tick 0. Allocates all it will ever need.
    pub fn new(ticks_max: u64) -> Self {
        let mut entries = VecDeque::with_capacity(ticks_max as usize + 2);
        entries.push_back(Entry::ZERO);
        Self { entries, ticks_max }
    }

    /// Goes on with the odometry of `before`, which keeps another number of ticks. What is too old for this one
    /// goes with the next step. Allocates nothing.
    pub fn take_over(&mut self, before: &mut Self) {
        if self.entries.capacity() < before.entries.capacity() {
            core::mem::swap(&mut self.entries, &mut before.entries);
        } else {
            self.entries.clear();
            self.entries.extend(before.entries.iter().copied());
        }
    }

    /// Where the filter stands.
    pub fn base(&self) -> Counted {
        self.entries[0].counted
    }

    /// The newest odometry.
    pub fn newest(&self) -> Counted {
        self.entries[self.entries.len() - 1].counted
    }

    /// Adds newer odometry. What then is too old must be taken with [`Self::step_to`] first.
    pub fn push(&mut self, counted: Counted) {
        let moved = Packed::new(&self.newest(), &counted);
        self.entries.push_back(Entry { counted, moved });
    }

    /// Tick up to which the base has to move so that no more than the bound is kept.
    pub fn due(&self) -> Tick {
        self.newest().tick.saturating_sub(self.ticks_max)
    }

    /// Moves the base one entry on, at most to `tick`; what was counted on the way, `None` if it
    /// stands there already.
    pub fn step_to(&mut self, tick: Tick) -> Option<PerWheel<i64>> {
        let base = self.base();
        let next = self.entries.get_mut(1)?;
        if base.tick >= tick {
            return None;
        }
        let reached = if next.counted.tick <= tick {
            self.entries.pop_front();
            self.base()
        } else {
            let reached = base.between(&next.counted, tick);
            next.moved = Packed::new(&reached, &next.counted);
            self.entries[0].counted = reached;
            reached
        };
        Some(base.until(&reached))
    }

    /// What was counted from entry to entry, the oldest first.
    pub fn moves(&self) -> impl Iterator<Item = PerWheel<i64>> {
        let later = self.entries.iter().skip(1);
        self.entries.iter().zip(later).map(|(from, to)| from.counted.until(&to.counted))
    }
}

impl Stateful for History {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        let mut moves = self.entries.len() - 1;
        words.index(&mut moves, self.ticks_max as usize + 1);
        if words.is_loading() {
            self.entries.resize(moves + 1, Entry::ZERO);
        }
        self.entries[0].counted.visit_state(words);
        let mut before = self.base();
        for entry in self.entries.iter_mut().skip(1) {
            entry.visit_move(&before, words);
            before = entry.counted;
        }
        words.require(before.tick.wrapping_sub(self.base().tick) <= self.ticks_max);
    }
}
