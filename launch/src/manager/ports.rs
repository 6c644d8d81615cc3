//! What launch itself sends and receives.

use crate::shell::transport::{Domain, Input, Output, SliceOutput, TransportError};
use hilare_interfaces::messages::{Answer, Authority, GoalHeader, Health, Pose, Reference, Steps, Waypoint};
use hilare_interfaces::wires::{self, watch};

/// Launch's own ports.
pub(super) struct Ports {
    pub(super) authority: Output<Authority>,
    pub(super) goal: SliceOutput<GoalHeader, Waypoint>,
    pub(super) answer: Input<Answer>,
    pub(super) health: Input<Health>,
    pub(super) steps: Input<Steps>,
    pub(super) pose: Input<Pose>,
    pub(super) reference: Input<Reference>,
}

impl Ports {
    pub(super) fn open(domain: &Domain) -> Result<Self, TransportError> {
        Ok(Self {
            authority: domain.output(&wires::AUTHORITY)?,
            goal: domain.slice_output(&wires::GOAL)?,
            answer: domain.input(&wires::ANSWER)?,
            health: domain.input(&wires::HEALTH)?,
            steps: domain.newest(&watch::STEPS)?,
            pose: domain.newest(&watch::POSE)?,
            reference: domain.newest(&watch::REFERENCE)?,
        })
    }
}
