//! Pairs messages of one tick that come over two wires.
//!
//! A writer fills its readers' queues one after the other. The waypoint selector may have a pose,
//! answer it and be read by the controller while the estimator is still on its way to the
//! controller's own queue (seen in lockstep on busy cores, where it then waited for ever). So a
//! reference whose pose is not there yet waits; only a later pose proves that it was lost. Steps and
//! the wheels that answer them meet in the same way.
//!
//! A tick that is a lie costs the messages it meets, at most [`APART_MAX`] ticks of them, not those that come:
//! what lies too far apart to be of one time is given up on both sides.

use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::{Pose, PoseFix, Reference, Steps, Wheels};

/// Ticks between two messages beyond which they are not of one time: two seconds.
const APART_MAX: u64 = 2_000;

/// A message of a tick.
pub trait Stamped: Copy {
    /// The tick.
    fn tick(&self) -> Tick;
}

macro_rules! stamped {
    ($($message:ty),*) => {
        $(impl Stamped for $message {
            fn tick(&self) -> Tick {
                self.tick
            }
        })*
    };
}
stamped!(Pose, Reference, Steps, Wheels);

/// Messages on their way to each other; each of the first kind is wanted with one of the second.
#[derive(Debug)]
pub struct Pairing<A, B> {
    waiting: Option<A>,
    /// Newest of the second kind that was read.
    newest: Option<B>,
    lost: u64,
}

impl<A, B> Default for Pairing<A, B> {
    fn default() -> Self {
        Self { waiting: None, newest: None, lost: 0 }
    }
}

impl<A: Stamped, B: Stamped> Pairing<A, B> {
    /// The next pair, from what the wires hold now.
    pub fn next(
        &mut self,
        mut first: impl FnMut() -> Option<A>,
        mut second: impl FnMut() -> Option<B>,
    ) -> Option<(A, B)> {
        loop {
            let wanting = match self.waiting {
                Some(waiting) => waiting,
                None => *self.waiting.insert(first()?),
            };
            let newest = match self.newest {
                Some(newest) => newest,
                None => *self.newest.insert(second()?),
            };
            if newest.tick().abs_diff(wanting.tick()) > APART_MAX {
                (self.waiting, self.newest) = (None, None);
                self.lost = self.lost.saturating_add(1);
            } else if newest.tick() < wanting.tick() {
                self.newest = None;
            } else {
                self.waiting = None;
                if newest.tick() == wanting.tick() {
                    return Some((wanting, newest));
                }
                self.lost = self.lost.saturating_add(1);
            }
        }
    }

    /// True if one of the first kind is there without the other.
    pub const fn waits(&self) -> bool {
        self.waiting.is_some()
    }

    /// Messages of the first kind whose partner was lost.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

/// Fixes that have come, until they are used.
#[derive(Debug)]
pub struct Fixes {
    /// Those due at the tick asked for last, and at most one that is not; at most [`ROOM`].
    waiting: Vec<PoseFix>,
    used: usize,
}

/// Fixes taken in at most at once, without allocating: of each tick there is at most one.
const ROOM: usize = 64;

impl Default for Fixes {
    fn default() -> Self {
        Self { waiting: Vec::with_capacity(ROOM), used: 0 }
    }
}

impl Fixes {
    /// The fixes to be used at `tick`, each once, the oldest first. A plant that is ahead has sent later
    /// ones already: they stay on the wire. One that is not of this time is given up.
    pub fn due(&mut self, tick: Tick, mut arrived: impl FnMut() -> Option<PoseFix>) -> &[PoseFix] {
        self.waiting.drain(..self.used);
        while self.waiting.len() < ROOM && self.waiting.last().is_none_or(|fix| fix.tick <= tick) {
            let Some(fix) = arrived() else { break };
            if fix.tick.abs_diff(tick) <= APART_MAX {
                self.waiting.push(fix);
            }
        }
        self.used = self.waiting.iter().take_while(|fix| fix.tick <= tick).count();
        &self.waiting[..self.used]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::hostile::{cases, integer, some};
    use hilare_interfaces::layout::WireField;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    #[derive(Default)]
    struct Wires {
        references: VecDeque<Reference>,
        poses: VecDeque<Pose>,
    }

    impl Wires {
        fn reference(&mut self, tick: u64) -> &mut Self {
            self.references.push_back(Reference { tick, ..Reference::ZERO });
            self
        }

        fn poses(&mut self, ticks: impl Iterator<Item = u64>) -> &mut Self {
            self.poses.extend(ticks.map(|tick| Pose { tick, ..Pose::ZERO }));
            self
        }

        fn next(&mut self, pairing: &mut Pairing<Reference, Pose>) -> Option<(u64, u64)> {
            let (references, poses) = (&mut self.references, &mut self.poses);
            pairing.next(|| references.pop_front(), || poses.pop_front()).map(|(r, p)| (r.tick, p.tick))
        }
    }

    #[test]
    fn a_reference_that_overtook_its_pose_waits_for_it() {
        let (mut pairing, mut wires) = (Pairing::default(), Wires::default());
        wires.poses(0..5).reference(0);
        assert_eq!(wires.next(&mut pairing), Some((0, 0)));
        wires.reference(5);
        assert_eq!(wires.next(&mut pairing), None);
        wires.poses(5..6);
        assert_eq!(wires.next(&mut pairing), Some((5, 5)));
        assert_eq!(pairing.lost(), 0);
    }

    #[test]
    fn a_lost_pose_costs_its_reference_and_no_other() {
        let (mut pairing, mut wires) = (Pairing::default(), Wires::default());
        wires.reference(0).reference(5).poses([0, 1, 2, 3, 4, 6].into_iter());
        assert_eq!(wires.next(&mut pairing), Some((0, 0)));
        assert_eq!(wires.next(&mut pairing), None);
        wires.reference(10).poses(7..11);
        assert_eq!(wires.next(&mut pairing), Some((10, 10)));
        assert_eq!(pairing.lost(), 1);
    }

    #[test]
    fn a_fix_waits_for_its_tick_and_is_used_once() {
        let fix = |tick| PoseFix { tick, ..PoseFix::ZERO };
        let mut fixes = Fixes::default();
        let mut come = vec![fix(9), fix(7), fix(3)];
        let mut ticks =
            |tick| -> Vec<Tick> { fixes.due(tick, || come.pop()).iter().map(|f| f.tick).collect() };
        assert_eq!(
            [ticks(2), ticks(3), ticks(4), ticks(9), ticks(10)],
            [vec![], vec![3], vec![], vec![7, 9], vec![]]
        );
        // A plant far ahead: nothing is lost, and nothing is used before its tick.
        let mut many = (11..1011).map(fix);
        let mut seen = 0;
        for tick in 11..1011 {
            let due = fixes.due(tick, || many.next());
            assert_eq!(due.iter().map(|fix| fix.tick).collect::<Vec<_>>(), [tick]);
            seen += due.len();
        }
        assert_eq!(seen, 1000);
    }

    proptest! {
        #![proptest_config(cases(100))]

        #[test]
        fn a_lie_about_a_tick_costs_what_it_meets_and_no_more(
            lies in some((0u64..60, integer(), any::<bool>()), 6),
        ) {
            let (mut pairing, mut wires) = (Pairing::default(), Wires::default());
            let mut last = None;
            for tick in 0..2 * APART_MAX {
                for (_, lie, of_a_pose) in lies.iter().filter(|(when, ..)| *when == tick) {
                    if *of_a_pose { wires.poses(std::iter::once(*lie)) } else { wires.reference(*lie) };
                }
                wires.poses(tick..tick + 1);
                if tick % 5 == 0 {
                    wires.reference(tick);
                }
                while let Some((reference, pose)) = wires.next(&mut pairing) {
                    prop_assert_eq!(reference, pose);
                    last = Some(reference);
                }
            }
            prop_assert_eq!(last, Some(2 * APART_MAX - 5));
        }

        #[test]
        fn a_lying_fix_keeps_no_other_from_its_tick(
            lies in some((0u64..60, integer()), 6),
        ) {
            let (mut fixes, mut wire) = (Fixes::default(), VecDeque::new());
            let mut last = 0;
            for tick in 0..2 * APART_MAX {
                wire.extend(lies.iter().filter(|(when, _)| *when == tick).map(|(_, lie)| *lie));
                wire.push_back(tick);
                let due = fixes.due(tick, || wire.pop_front().map(|tick| PoseFix { tick, ..PoseFix::ZERO }));
                prop_assert!(due.len() <= ROOM && due.iter().all(|fix| fix.tick <= tick));
                last = due.last().map_or(last, |fix| fix.tick);
            }
            prop_assert_eq!(last, 2 * APART_MAX - 1);
        }
    }
}
