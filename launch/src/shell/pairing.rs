//! Pairs messages of one tick that come over two wires.
//!
//! A writer fills its readers' queues one after the other. The waypoint selector may have a pose,
//! answer it and be read by the controller while the estimator is still on its way to the
//! controller's own queue (seen in lockstep on busy cores, where it then waited for ever). So a
//! reference whose pose is not there yet waits; only a later pose proves that it was lost. Steps and
//! the wheels that answer them meet in the same way.

use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::{Pose, PoseFix, Reference, Steps, Wheels};

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
            while self.newest.is_none_or(|newest| newest.tick() < wanting.tick()) {
                self.newest = Some(second()?);
            }
            self.waiting = None;
            match self.newest.filter(|newest| newest.tick() == wanting.tick()) {
                Some(partner) => return Some((wanting, partner)),
                None => self.lost += 1,
            }
        }
    }

    /// Messages of the first kind whose partner was lost.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

/// Fixes that have come, until they are used.
#[derive(Debug)]
pub struct Fixes {
    /// Those due at the tick asked for last, and at most one that is not.
    waiting: Vec<PoseFix>,
    used: usize,
}

/// Fixes there is room for without allocating: of each tick there is at most one.
const ROOM: usize = 64;

impl Default for Fixes {
    fn default() -> Self {
        Self { waiting: Vec::with_capacity(ROOM), used: 0 }
    }
}

impl Fixes {
    /// The fixes to be used at `tick`, each once, the oldest first. A plant that is ahead has sent later
    /// ones already: they stay on the wire.
    pub fn due(&mut self, tick: Tick, mut arrived: impl FnMut() -> Option<PoseFix>) -> &[PoseFix] {
        self.waiting.drain(..self.used);
        while self.waiting.last().is_none_or(|fix| fix.tick <= tick) {
            let Some(fix) = arrived() else { break };
            self.waiting.push(fix);
        }
        self.used = self.waiting.iter().take_while(|fix| fix.tick <= tick).count();
        &self.waiting[..self.used]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;
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
}
