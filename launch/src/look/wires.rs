//! What the relay repeats: the newest of each wire, and how many came.

use crate::shell::page::MAX_SLOTS;
use crate::shell::transport::{Domain, Input, SliceInput, TransportError};
use hilare_interfaces::geometry::{WorldPoint, WorldPose};
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages::{
    Authority, Command, MAX_WAYPOINTS, PathHeader, Pose, PoseFix, Reference, ReferenceState, Steps, Truth,
    Waypoint, Wheels,
};
use hilare_interfaces::wires::{Role, watch};
use std::fmt;
use std::iter;

/// A wire with the newest of its messages.
struct Newest<T: WireMessage + fmt::Debug> {
    input: Input<T>,
    newest: Option<T>,
    messages: u64,
    /// Messages in one look: as many as the wire holds.
    at_most: usize,
}

impl<T: WireMessage + fmt::Debug> Newest<T> {
    fn open(domain: &Domain, wire: &hilare_interfaces::wires::Wire) -> Result<Self, TransportError> {
        Ok(Self { input: domain.input(wire)?, newest: None, messages: 0, at_most: wire.buffer })
    }

    fn look(&mut self, mut seen: impl FnMut(&T)) {
        for message in iter::from_fn(|| self.input.next()).take(self.at_most) {
            seen(&message);
            self.messages += 1;
            self.newest = Some(message);
        }
    }
}

/// The reading ends of the relay's wires.
pub struct Wires {
    path: SliceInput<PathHeader, Waypoint>,
    newest_path: Option<(PathHeader, Vec<Waypoint>)>,
    paths: u64,
    reference: Newest<Reference>,
    command: Newest<Command>,
    /// Commands by the slot of the controller they say they are of.
    commands_by_slot: [u64; MAX_SLOTS],
    authority: Newest<Authority>,
    steps: Newest<Steps>,
    wheels: Newest<Wheels>,
    fix: Newest<PoseFix>,
    pose: Newest<Pose>,
    truth: Newest<Truth>,
}

impl Wires {
    /// Joins the relay's wires.
    pub fn open(domain: &Domain) -> Result<Self, TransportError> {
        Ok(Self {
            path: domain.slice_input(&watch::PATH)?,
            newest_path: None,
            paths: 0,
            reference: Newest::open(domain, &watch::REFERENCE)?,
            command: Newest::open(domain, &watch::COMMAND)?,
            commands_by_slot: [0; MAX_SLOTS],
            authority: Newest::open(domain, &watch::AUTHORITY)?,
            steps: Newest::open(domain, &watch::STEPS)?,
            wheels: Newest::open(domain, &watch::WHEELS)?,
            fix: Newest::open(domain, &watch::FIX)?,
            pose: Newest::open(domain, &watch::POSE)?,
            truth: Newest::open(domain, &watch::TRUTH)?,
        })
    }

    /// Takes in what has come.
    pub fn look(&mut self) {
        let longest = |path: &[Waypoint]| path[..path.len().min(MAX_WAYPOINTS)].to_vec();
        while let Some(path) = self.path.next(|header, path| (*header, longest(path))) {
            self.paths += 1;
            self.newest_path = Some(path);
        }
        let by_slot = &mut self.commands_by_slot;
        self.command.look(|command| {
            let slot = usize::try_from(command.source).ok().and_then(|source| source.checked_sub(1));
            if let Some(count) = slot.and_then(|slot| by_slot.get_mut(slot)) {
                *count += 1;
            }
        });
        self.reference.look(|_| ());
        self.authority.look(|_| ());
        self.steps.look(|_| ());
        self.wheels.look(|_| ());
        self.fix.look(|_| ());
        self.pose.look(|_| ());
        self.truth.look(|_| ());
    }

    /// The path in force.
    pub fn path(&self) -> Option<(PathHeader, &[Waypoint])> {
        self.newest_path.as_ref().map(|(header, path)| (*header, &path[..]))
    }

    /// Newest path progress.
    pub fn reference(&self) -> Option<&Reference> {
        self.reference.newest.as_ref()
    }

    /// Newest word on who may drive.
    pub fn authority(&self) -> Option<&Authority> {
        self.authority.newest.as_ref()
    }

    /// Newest estimated pose.
    pub fn pose(&self) -> Option<&Pose> {
        self.pose.newest.as_ref()
    }

    /// Connects to a relay that has come.
    pub fn connect(&self) {
        self.path.connect();
        self.reference.input.connect();
        self.command.input.connect();
        self.authority.input.connect();
        self.steps.input.connect();
        self.wheels.input.connect();
        self.fix.input.connect();
        self.pose.input.connect();
        self.truth.input.connect();
    }

    /// What came so far.
    pub fn heard(&self) -> Heard {
        Heard {
            messages: [
                ("path", self.paths),
                ("reference", self.reference.messages),
                ("command", self.command.messages),
                ("authority", self.authority.messages),
                ("steps", self.steps.messages),
                ("wheels", self.wheels.messages),
                ("fix", self.fix.messages),
                ("pose", self.pose.messages),
                ("truth", self.truth.messages),
            ],
            commands_by_slot: self.commands_by_slot,
            track: Track::of(
                self.reference.newest.as_ref(),
                self.pose.newest.as_ref(),
                self.truth.newest.as_ref(),
            ),
            steps: self.steps.newest,
            pose: self.pose.newest.map(|pose| pose.pose()).filter(is_a_place),
        }
    }
}

/// What the wires have carried since they were joined.
#[derive(Clone, Copy, Debug)]
pub struct Heard {
    /// Wire and messages, in the diagram's order.
    pub messages: [(&'static str, u64); 9],
    /// Commands by the slot of their controller.
    pub commands_by_slot: [u64; MAX_SLOTS],
    /// How well the robot keeps to its path.
    pub track: Track,
    /// Newest state of the step generator.
    pub steps: Option<Steps>,
    /// Newest estimated pose.
    pub pose: Option<WorldPose>,
}

impl Heard {
    /// Messages of the wire that shows the pulse of the process of a role in a slot; `None` of one that has none.
    pub fn pulse(&self, role: Role, slot: usize) -> Option<u64> {
        let wire = match role {
            Role::Launch => "authority",
            Role::Planner => "path",
            Role::WaypointSelector => "reference",
            Role::Controller => return self.commands_by_slot.get(slot).copied(),
            Role::StepGenerator => "steps",
            Role::PoseEstimator => "pose",
            Role::Plant => "truth",
            _ => return None,
        };
        self.messages.iter().find(|(name, _)| *name == wire).map(|(_, messages)| *messages)
    }
}

fn is_a_place(pose: &WorldPose) -> bool {
    pose.position().is_finite() && pose.theta_rad.is_finite()
}

/// Where the robot is beside its path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Track {
    /// Distance of the estimated pose from the line or arc through the last and the current waypoint, m; positive
    /// to the left. Absent without a path.
    pub estimate_m: Option<f64>,
    /// The same of the true pose, where it is simulated.
    pub truth_m: Option<f64>,
    /// The true pose: m, m, rad.
    pub truth: Option<[f64; 3]>,
}

impl Track {
    fn of(reference: Option<&Reference>, pose: Option<&Pose>, truth: Option<&Truth>) -> Self {
        let beside = |point: WorldPoint| cross_track_m(reference?, point);
        Self {
            estimate_m: pose.and_then(|pose| beside(pose.pose().position())),
            truth_m: truth.and_then(|truth| beside(truth.pose().position())),
            truth: truth.map(|truth| [truth.x_m, truth.y_m, truth.theta_rad]),
        }
    }
}

/// Distance of a point from the line or arc a reference is on, m; positive to the left. `None` without a path.
pub fn cross_track_m(reference: &Reference, point: WorldPoint) -> Option<f64> {
    if reference.state == ReferenceState::Idle.code() {
        return None;
    }
    let segment = reference.segment();
    let aside_m =
        if segment.is_line() { segment.cross_track_m(point) } else { segment.nearest(point).cross_track_m };
    aside_m.is_finite().then_some(aside_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;

    #[test]
    fn the_distance_is_that_from_the_segment_and_there_is_none_without_a_path() {
        let mut reference = Reference {
            state: ReferenceState::Tracking.code(),
            current: Waypoint::straight(2.0, 0.0),
            ..Reference::ZERO
        };
        let pose = Pose { x_m: 1.0, y_m: 0.01, ..Pose::ZERO };
        let truth = Truth { x_m: 1.0, y_m: -0.02, theta_rad: 0.5, ..Truth::ZERO };
        let track = Track::of(Some(&reference), Some(&pose), Some(&truth));
        assert!((track.estimate_m.unwrap() - 0.01).abs() < 1e-12, "{track:?}");
        assert!((track.truth_m.unwrap() + 0.02).abs() < 1e-12, "{track:?}");
        assert_eq!(track.truth, Some([1.0, -0.02, 0.5]));
        // A half circle to the left from the origin to (2, 0) bulges to the right: its lowest point is (1, -1).
        reference.current.bulge = 1.0;
        let pose = Pose { x_m: 1.0, y_m: -1.1, ..Pose::ZERO };
        let track = Track::of(Some(&reference), Some(&pose), None);
        assert!((track.estimate_m.unwrap() + 0.1).abs() < 1e-12, "{track:?}");
        assert_eq!((track.truth_m, track.truth), (None, None));
        reference.state = ReferenceState::Idle.code();
        assert_eq!(Track::of(Some(&reference), Some(&pose), None), Track::default());
        let nonsense = Pose { x_m: f64::NAN, ..Pose::ZERO };
        assert_eq!(Track::of(Some(&reference), Some(&nonsense), None).estimate_m, None);
    }
}
