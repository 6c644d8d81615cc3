//! Pose state against the path: e_θ, e_d, and which segment they are measured against.

use super::plan::Deviation;
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::messages::Reference;
use hilare_interfaces::state::{StateWords, Stateful};

/// Distances beyond this are as good as this, m.
const FAR_M: f64 = 1e6;

/// A segment of the path under way: the index of its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Leg(u64);

impl Stateful for Leg {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.0);
    }
}

/// What is to be corrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// e_θ, e_d.
    pub deviation: Deviation,
    /// Speed along the path, v_τ, m/s.
    pub along_mps: f64,
    /// Curvature of the path, 1/m.
    pub curvature_per_m: f64,
    /// Against which segment.
    pub leg: Leg,
}

impl Sight {
    /// Of a pose in the course frame. A predicted pose may be past the end of the current segment before
    /// the selector knows: it is measured against the segment it is on, if that has the same crab angle.
    pub fn new(pose: WorldPose, reference: &Reference) -> Self {
        let mut segment = reference.segment();
        let mut leg = Leg(reference.index);
        let mut last = reference.current;
        for next in reference.ahead().skip(1) {
            let passed = segment.nearest(pose.position()).along > 1.0;
            if !passed || next.crab_rad != reference.current.crab_rad {
                break;
            }
            segment = next.segment_from(last);
            leg.0 = leg.0.saturating_add(1);
            last = *next;
        }
        let station = segment.nearest(pose.position());
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        Self {
            deviation: Deviation {
                heading_rad: finite(wrap_angle_rad(pose.theta_rad - station.heading_rad)),
                distance_m: finite(station.cross_track_m).clamp(-FAR_M, FAR_M),
            },
            along_mps: finite(reference.speed_mps),
            curvature_per_m: finite(segment.curvature_per_m()),
            leg,
        }
    }
}
