//! The waypoint selector: which waypoint the robot tracks, paper 1 eq. (6), (8).
//!
//! Waypoint 0 is where the path begins; the first to track is waypoint 1. Waypoint k + 1 becomes the
//! reference when waypoint k is accepted, in the paper when the robot is within d_T of it; other laws
//! ask for other rules ([`Acceptance`]). The run has arrived when the last one is accepted. At most one
//! waypoint is accepted a control period, as in the paper's loop.
//!
//! A selector that has loaded the state of another knows where on which path that one was, but not the
//! waypoints, which are too many to be saved every period. It waits for the path ([`awaits_path`]), and goes on
//! where the other one was as soon as it comes.
//!
//! [`awaits_path`]: WaypointSelector::awaits_path
#![no_std]

extern crate alloc;
#[cfg(test)]
extern crate std;

use alloc::vec::Vec;
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{
    MAX_WAYPOINTS, PREVIEW, PathHeader, Pose, Reference, ReferenceState, Waypoint,
};
use hilare_interfaces::param_group;
use hilare_interfaces::state::{StateWords, Stateful};
use hilare_interfaces::wires::SUCCESSOR_PERIODS;

param_group! {
    /// How a path is tracked.
    Tracking {
        /// Reference speed, v_r.
        speed_mps: f64 = 0.040, "m/s", 0.0, 10.0;
        /// Acceptance radius of a waypoint, d_T (the paper's is half the track).
        acceptance_radius_m: f64 = 0.027, "m", 1e-4, 10.0;
    }
}

/// A new path.
#[derive(Clone, Copy, Debug)]
pub struct NewPath<'a> {
    /// Its header.
    pub header: &'a PathHeader,
    /// Its waypoints, at least two, at most [`MAX_WAYPOINTS`].
    pub waypoints: &'a [Waypoint],
}

/// What a step reads.
#[derive(Clone, Copy, Debug)]
pub struct SelectorInputs<'a> {
    /// The pose of this control period.
    pub pose: &'a Pose,
    /// A path, if a new one arrived; it takes effect at this very step.
    pub path: Option<NewPath<'a>>,
}

/// How far along a path a selector is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Progress {
    path_id: u64,
    /// Waypoints of the path.
    total: usize,
    /// The current one.
    index: usize,
    arrived: bool,
    /// The last pose was inside the circle of the current waypoint.
    inside: bool,
}

impl Progress {
    /// What one is loaded over.
    const BLANK: Self = Self { path_id: 0, total: 2, index: 1, arrived: false, inside: false };

    /// True if it is of this path.
    fn is_on(&self, path: &NewPath<'_>) -> bool {
        (self.path_id, self.total) == (path.header.path_id, path.waypoints.len())
    }
}

impl Stateful for Progress {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.path_id);
        words.index(&mut self.total, MAX_WAYPOINTS + 1);
        words.index(&mut self.index, self.total);
        words.require(self.index > 0);
        words.flag(&mut self.arrived);
        words.flag(&mut self.inside);
    }
}

/// The box.
#[derive(Clone, Debug)]
pub struct WaypointSelector {
    tracking: Tracking,
    acceptance: Acceptance,
    waypoints: Vec<Waypoint>,
    reference: Reference,
    rejected_paths: u64,
    rejected_poses: u64,
    /// The last pose was inside the circle of the current waypoint.
    inside: bool,
    /// Where to go on once its path is there.
    awaited: Option<Progress>,
    /// Where it was when it answered the last poses that its readers may still have to answer, the oldest first.
    told: [Option<(Tick, Progress)>; SUCCESSOR_PERIODS],
}

impl WaypointSelector {
    /// Without a path. Allocates room for the longest one, so that a step never does.
    pub fn new(tracking: Tracking, acceptance: Acceptance) -> Self {
        Self {
            tracking,
            acceptance,
            waypoints: Vec::with_capacity(MAX_WAYPOINTS),
            reference: Reference::ZERO,
            rejected_paths: 0,
            rejected_poses: 0,
            inside: false,
            awaited: None,
            told: [None; SUCCESSOR_PERIODS],
        }
    }

    /// Tracks as told from the next step on. Where it is on its path stays as it is.
    pub fn set_tracking(&mut self, tracking: Tracking, acceptance: Acceptance) {
        if tracking.acceptance_radius_m != self.tracking.acceptance_radius_m {
            // A robot that the circle has shrunk away from has not driven out of it.
            self.inside = false;
        }
        if self.reference.state == ReferenceState::Tracking.code() {
            self.reference.speed_mps = tracking.speed_mps;
        }
        (self.tracking, self.acceptance) = (tracking, acceptance);
    }

    /// Paths refused at the rim: too short, too long, or of waypoints that make no sense. The old one is kept.
    pub fn rejected_paths(&self) -> u64 {
        self.rejected_paths
    }

    /// Poses that make no sense: they lead to no waypoint.
    pub fn rejected_poses(&self) -> u64 {
        self.rejected_poses
    }

    /// The path that has to come before this selector goes on where the one was whose state it loaded. Until
    /// then what it answers is not that one's: its references say that there is no path yet. `None` once the
    /// path, or any other, is there.
    pub fn awaits_path(&self) -> Option<u64> {
        self.awaited.map(|progress| progress.path_id)
    }

    /// Takes the path it awaits, and repeats what the other selector said of it last, the oldest first: nobody
    /// may have heard that. Nothing, and nothing is taken, if it awaits no path or another one.
    pub fn take_up(&mut self, path: NewPath<'_>) -> impl Iterator<Item = Reference> {
        let taken = self.awaited.filter(|awaited| awaited.is_on(&path)).is_some_and(|_| {
            self.take_path(path);
            // A path that is none is refused.
            self.awaited.is_none()
        });
        let told = self.told.into_iter().flatten().filter(move |(_, told)| taken && told.is_on(&path));
        told.map(|(tick, progress)| {
            self.go_on(progress);
            Reference { tick, ..self.reference }
        })
    }

    fn progress(&self) -> Option<Progress> {
        let reference = &self.reference;
        let under_way = || Progress {
            path_id: reference.path_id,
            total: self.waypoints.len(),
            index: reference.index as usize,
            arrived: reference.state == ReferenceState::Arrived.code(),
            inside: self.inside,
        };
        self.awaited.or_else(|| (reference.state != ReferenceState::Idle.code()).then(under_way))
    }

    /// The path that is awaited is gone on with, any other begins anew.
    fn take_path(&mut self, path: NewPath<'_>) {
        let valid = (2..=MAX_WAYPOINTS).contains(&path.waypoints.len())
            && path.waypoints.iter().all(Waypoint::makes_sense);
        if !valid {
            self.rejected_paths = self.rejected_paths.saturating_add(1);
            return;
        }
        self.waypoints.clear();
        self.waypoints.extend_from_slice(path.waypoints);
        self.reference = Reference {
            state: ReferenceState::Tracking.code(),
            path_id: path.header.path_id,
            total: path.waypoints.len() as u64,
            speed_mps: self.tracking.speed_mps,
            ..Reference::ZERO
        };
        match self.awaited.take().filter(|awaited| awaited.is_on(&path)) {
            Some(awaited) => self.go_on(awaited),
            None => self.point_at(1),
        }
    }

    /// Takes up a path where another selector was.
    fn go_on(&mut self, progress: Progress) {
        self.reference.state = ReferenceState::Tracking.code();
        self.reference.speed_mps = self.tracking.speed_mps;
        self.point_at(progress.index);
        self.inside = progress.inside;
        if progress.arrived {
            self.arrive();
        }
    }

    /// The segment stays for those who report the distance to it.
    fn arrive(&mut self) {
        self.reference.state = ReferenceState::Arrived.code();
        self.reference.speed_mps = 0.0;
    }

    /// Makes waypoint `index` the current one.
    fn point_at(&mut self, index: usize) {
        self.inside = false;
        self.reference.index = index as u64;
        self.reference.last = self.waypoints[index - 1];
        self.reference.current = self.waypoints[index];
        let coming = &self.waypoints[index + 1..];
        let len = coming.len().min(PREVIEW);
        self.reference.preview_len = len as u64;
        self.reference.preview[..len].copy_from_slice(&coming[..len]);
        // So that a reference hangs on the place alone, not on those before.
        self.reference.preview[len..].fill(Waypoint::ZERO);
    }

    /// The rule of [`Acceptance`]. The last waypoint leads nowhere, so it has no bisector.
    fn accepts(&mut self, robot: WorldPoint) -> bool {
        let segment = self.reference.segment();
        let inside = robot.distance_m(segment.to) <= self.tracking.acceptance_radius_m;
        let left = self.inside && !inside;
        self.inside = inside;
        let passed = self.acceptance == Acceptance::Passed && segment.nearest(robot).along >= 1.0;
        if self.acceptance == Acceptance::Rim || self.reference.preview_len == 0 {
            // [MH18] (8)
            return inside || passed;
        }
        let next = self.reference.preview[0].segment_from(self.reference.current);
        let nearer = || next.cross_track_m(robot).abs() <= segment.cross_track_m(robot).abs();
        left || passed || (inside && nearer())
    }
}

impl Block for WaypointSelector {
    type Inputs<'a> = SelectorInputs<'a>;
    type Output = Reference;

    fn step(&mut self, tick: Tick, inputs: SelectorInputs<'_>) -> Reference {
        if let Some(path) = inputs.path {
            self.take_path(path);
        }
        self.reference.tick = tick;
        if !inputs.pose.makes_sense() {
            self.rejected_poses = self.rejected_poses.saturating_add(1);
        } else if self.reference.state == ReferenceState::Tracking.code() {
            let robot = inputs.pose.pose().position();
            if self.accepts(robot) {
                let next = self.reference.index as usize + 1;
                if next < self.waypoints.len() {
                    self.point_at(next);
                } else {
                    self.arrive();
                }
            }
        }
        // What is answered while the path is awaited is not the other one's.
        if let Some(progress) = self.progress().filter(|_| self.awaited.is_none()) {
            self.told.rotate_left(1);
            self.told[SUCCESSOR_PERIODS - 1] = Some((tick, progress));
        }
        self.reference
    }
}

impl Stateful for WaypointSelector {
    /// Everything but the waypoints.
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        let mut progress = self.progress();
        words.option(&mut progress, Progress::BLANK, Progress::visit_state);
        for told in &mut self.told {
            words.option(told, (0, Progress::BLANK), |(tick, progress), words| {
                words.word(tick);
                progress.visit_state(words);
            });
        }
        if words.is_loading() {
            self.awaited = progress;
            self.reference = Reference::ZERO;
        }
    }
}

#[cfg(test)]
mod state_tests;
#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::geometry::WorldPose;

    fn accepting(acceptance: Acceptance) -> WaypointSelector {
        WaypointSelector::new(Tracking::default(), acceptance)
    }

    fn path(points: &[(f64, f64)]) -> Vec<Waypoint> {
        points.iter().map(|(x_m, y_m)| Waypoint::straight(*x_m, *y_m)).collect()
    }

    fn at(x_m: f64, y_m: f64) -> Pose {
        Pose::at(0, WorldPose::new(x_m, y_m, 0.0))
    }

    fn step(selector: &mut WaypointSelector, pose: &Pose, waypoints: Option<&[Waypoint]>) -> Reference {
        let header = PathHeader { path_id: 7, goal_id: 0 };
        let path = waypoints.map(|waypoints| NewPath { header: &header, waypoints });
        selector.step(10, SelectorInputs { pose, path })
    }

    #[test]
    fn it_walks_the_path_one_waypoint_a_period_and_arrives() {
        let mut selector = accepting(Acceptance::Rim);
        assert_eq!(step(&mut selector, &at(0.0, 0.0), None).state, ReferenceState::Idle.code());
        let square = path(&[(0.0, 0.0), (0.4, 0.0), (0.4, 0.3), (0.4, 0.31)]);
        let first = step(&mut selector, &at(0.0, 0.0), Some(&square));
        assert_eq!((first.index, first.total, first.preview_len, first.tick), (1, 4, 2, 10));
        assert_eq!(first.preview[..2], square[2..]);
        assert_eq!(step(&mut selector, &at(0.4 - 0.0271, 0.0), None).index, 1);
        assert_eq!(step(&mut selector, &at(0.4 - 0.0269, 0.0), None).index, 2);
        // Waypoints 2 and 3 are within one radius: still one a period.
        assert_eq!(step(&mut selector, &at(0.4, 0.3), None).index, 3);
        let done = step(&mut selector, &at(0.4, 0.3), None);
        assert_eq!((done.state, done.index, done.last), (ReferenceState::Arrived.code(), 3, square[2]));
        assert_eq!(step(&mut selector, &at(0.0, 0.0), None).state, ReferenceState::Arrived.code());
    }

    #[test]
    fn at_the_bisector_it_waits_for_the_best_point_but_not_beyond_the_circle() {
        let corner = path(&[(0.0, 0.0), (0.4, 0.0), (0.4, 0.3)]);
        let mut selector = accepting(Acceptance::Bisector);
        step(&mut selector, &at(0.0, 0.0), Some(&corner));
        // Inside, but nearer to the line it is on; then past the bisector.
        assert_eq!(step(&mut selector, &at(0.38, 0.001), None).index, 1);
        assert_eq!(step(&mut selector, &at(0.39, 0.009), None).index, 1);
        assert_eq!(step(&mut selector, &at(0.391, 0.0095), None).index, 2);
        // The last waypoint leads to no other line: (8) as it stands.
        assert_eq!(step(&mut selector, &at(0.4, 0.274), None).state, ReferenceState::Arrived.code());

        // In and out again on the near side: accepted on leaving, as every circle visited is.
        let mut selector = accepting(Acceptance::Bisector);
        step(&mut selector, &at(0.0, 0.0), Some(&corner));
        assert_eq!(step(&mut selector, &at(0.375, 0.0), None).index, 1);
        assert_eq!(step(&mut selector, &at(0.372, 0.0), None).index, 2);
    }

    #[test]
    fn a_segment_whose_end_is_passed_is_done_even_outside_the_circle() {
        let mut path = path(&[(0.0, 0.0), (0.4, 0.0), (0.4, 0.8)]);
        path[2].bulge = 1.0;
        let mut selector = accepting(Acceptance::Passed);
        step(&mut selector, &at(0.0, 0.0), Some(&path));
        assert_eq!(step(&mut selector, &at(0.399, 0.1), None).index, 1);
        assert_eq!(step(&mut selector, &at(0.401, 0.1), None).index, 2);
        // The half circle to the left about (0.4, 0.4) ends where it comes back to x = 0.4.
        assert_eq!(step(&mut selector, &at(0.9, 0.4), None).index, 2);
        assert_eq!(step(&mut selector, &at(0.41, 0.9), None).state, ReferenceState::Tracking.code());
        assert_eq!(step(&mut selector, &at(0.39, 0.9), None).state, ReferenceState::Arrived.code());
    }

    #[test]
    fn a_bad_path_leaves_the_old_one() {
        let mut selector = accepting(Acceptance::Rim);
        step(&mut selector, &at(0.0, 0.0), Some(&path(&[(0.0, 0.0), (0.4, 0.0)])));
        let long = std::vec![Waypoint::ZERO; MAX_WAYPOINTS + 1];
        let broken = path(&[(0.0, 0.0), (f64::NAN, 0.0)]);
        for bad in [&long[..], &broken, &path(&[(0.0, 0.0)]), &[]] {
            let reference = step(&mut selector, &at(0.0, 0.0), Some(bad));
            assert_eq!((reference.total, reference.state), (2, ReferenceState::Tracking.code()));
        }
        assert_eq!(selector.rejected_paths(), 4);
    }

    #[test]
    fn the_preview_is_bounded() {
        let mut selector = accepting(Acceptance::Rim);
        let long = (0..100).map(|i| (f64::from(i), 0.0)).collect::<Vec<_>>();
        let reference = step(&mut selector, &at(0.0, 0.0), Some(&path(&long)));
        assert_eq!(reference.preview_len, PREVIEW as u64);
        assert_eq!(reference.preview[PREVIEW - 1].x_m, 1.0 + PREVIEW as f64);
    }
}
