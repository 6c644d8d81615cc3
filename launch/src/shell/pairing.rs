//! Pairs each reference with the pose of its tick.
//!
//! A writer fills its readers' queues one after the other. The waypoint selector may have a pose,
//! answer it and be read by the controller while the estimator is still on its way to the
//! controller's own queue (seen in lockstep on busy cores, where it then waited for ever). So a
//! reference whose pose is not there yet waits; only a later pose proves that it was lost.

use hilare_interfaces::messages::{Pose, Reference};

/// References and poses on their way to each other.
#[derive(Debug, Default)]
pub struct Pairing {
    reference: Option<Reference>,
    /// Newest pose read.
    pose: Option<Pose>,
    lost: u64,
}

impl Pairing {
    /// The next reference with its pose, from what the wires hold now.
    pub fn next(
        &mut self,
        mut references: impl FnMut() -> Option<Reference>,
        mut poses: impl FnMut() -> Option<Pose>,
    ) -> Option<(Reference, Pose)> {
        loop {
            let reference = match self.reference {
                Some(waiting) => waiting,
                None => *self.reference.insert(references()?),
            };
            while self.pose.is_none_or(|pose| pose.tick < reference.tick) {
                self.pose = Some(poses()?);
            }
            self.reference = None;
            match self.pose.filter(|pose| pose.tick == reference.tick) {
                Some(pose) => return Some((reference, pose)),
                None => self.lost += 1,
            }
        }
    }

    /// References whose pose was lost.
    pub fn lost(&self) -> u64 {
        self.lost
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

        fn next(&mut self, pairing: &mut Pairing) -> Option<(u64, u64)> {
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
}
