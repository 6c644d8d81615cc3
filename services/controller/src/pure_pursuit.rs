//! Pure pursuit (Coulter, CMU-RI-TR-92-01, 1992): drive the arc that leads to a point of the path ahead.
//!
//! ```text
//!                      ● goal (x, y), in the robot's frame, a lookahead L away
//!                 ╭───╯         κ = 2y/L²      the arc that starts along the robot's x axis and
//!        robot ▷──╯                            passes the goal
//! ```
//!
//! The goal is where the path first leaves the circle of radius L about the robot, counted from the place
//! nearest to the robot: over the current segment and the coming ones, lines and arcs; beyond its last
//! waypoint the path goes on as it ends. L is the largest of three: the way driven in `lookahead_s`, a
//! multiple of the tightest bend at the reference speed, and the acceptance radius; so the defaults serve
//! robots of any size.
//!
//! Departs from Coulter in this:
//!
//! * Away from the path, the circle grows to √2 times the distance, so that there always is a goal; the
//!   path is approached at 45°.
//! * A goal behind the robot has a flat arc (straight behind: none). Beyond ±90° the curvature stays at
//!   that for ±90°, 2/L; straight behind it turns left.
//! * Coulter's vehicle cuts every corner by as much as L gives. A waypoint must be accepted before the next
//!   counts, so where the path turns back the goal runs ahead of the waypoint by a share of the acceptance
//!   radius only.
//! * A coming segment with another crab angle is driven with another course: the goal does not move on
//!   to it before the robot does, which goes on through the waypoint until then.
//! * Where the arc asks for more than the highest yaw rate, the robot slows down.

use crate::unicycle::bend;
use crate::{Built, ControlLaw, LawInputs, LawOutput, LawSetup, LawSpec, TwistLimits};
use core::f64::consts::SQRT_2;
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::geometry::{BodyError, WorldPoint, WorldPose, wrap_angle_rad};
use hilare_interfaces::messages::Reference;
use hilare_interfaces::param_group;
use hilare_interfaces::params::ParamGroup;
use hilare_interfaces::segment::Segment;

param_group! {
    /// How far ahead the goal is.
    PurePursuitParams {
        /// Lookahead as driving time.
        lookahead_s: f64 = 0.4, "s", 0.0, 60.0;
        /// Least lookahead, in radii of the tightest bend at the reference speed, v_r/ω_max.
        lookahead_bends: f64 = 1.0, "", 0.0, 100.0;
    }
}

/// How far beyond a waypoint where the path turns back the goal may be, in acceptance radii: less than 1,
/// for there the waypoint is accepted.
const BEYOND: f64 = 0.7;
/// A goal beyond the waypoint lies ahead of it, and will be passed, if its direction from there is at
/// least this (as a cosine) along the current segment.
const AHEAD: f64 = 0.2;

/// Least distance of a goal that is divided by, m.
const NEAREST_M: f64 = 1e-6;
/// |sine| below which a goal behind is straight behind.
const HALF_TURN_TIE: f64 = 1e-6;

/// Its line in the registry.
pub const SPEC: LawSpec = LawSpec {
    name: "pure-pursuit",
    title: "the arc to a point of the path ahead",
    source: "Coulter 1992, CMU-RI-TR-92-01",
    chassis: &["differential", "mecanum"],
    acceptance: Acceptance::Passed,
    allocations: 0,
    keeps_limits: false,
    tunes_limits: false,
    params: PurePursuitParams::SPECS,
    build,
};

fn build(setup: &LawSetup<'_>) -> Built {
    let mut params = PurePursuitParams::default();
    for (name, value) in setup.values {
        params.set(name, *value).map_err(|error| (*name, error))?;
    }
    Ok(Box::new(PurePursuit { params, limits: setup.limits, acceptance_m: setup.acceptance_radius_m }))
}

/// The law; it has no state.
#[derive(Clone, Copy, Debug)]
pub struct PurePursuit {
    params: PurePursuitParams,
    limits: TwistLimits,
    acceptance_m: f64,
}

/// The share at which a segment, from its share `from` on, first leaves the circle about `centre`: above 1
/// beyond its end, infinite for an arc that stays inside. That it starts inside is the caller's promise.
fn leaves(segment: Segment, from: f64, centre: WorldPoint, radius_m: f64) -> f64 {
    let start = segment.point_at(from);
    let Some(middle) = segment.centre() else {
        return from + along_ray(start, segment.heading_rad(), centre, radius_m) / segment.length_m();
    };
    let (dx, dy) = (centre.x_m - middle.x_m, centre.y_m - middle.y_m);
    let (away, bend) = (libm::hypot(dx, dy), segment.from.distance_m(middle));
    // Law of cosines: the circles meet at ± this angle from the line of centres.
    let cos = (away * away + bend * bend - radius_m * radius_m) / (2.0 * away * bend);
    if cos < -1.0 {
        return f64::INFINITY;
    }
    let meets = libm::acos(cos.min(1.0));
    let at = libm::atan2(start.y_m - middle.y_m, start.x_m - middle.x_m) - libm::atan2(dy, dx);
    let turn = (meets - wrap_angle_rad(segment.bulge.signum() * at)).max(0.0);
    from + turn / segment.sweep_rad().abs()
}

/// Way along a ray that starts inside a circle until it leaves it, m.
fn along_ray(start: WorldPoint, heading_rad: f64, centre: WorldPoint, radius_m: f64) -> f64 {
    let (sin, cos) = libm::sincos(heading_rad);
    let (dx, dy) = (start.x_m - centre.x_m, start.y_m - centre.y_m);
    let (along, aside) = (cos * dx + sin * dy, cos * dy - sin * dx);
    (libm::sqrt((radius_m * radius_m - aside * aside).max(0.0)) - along).max(0.0)
}

/// Where the path leaves a circle in which it starts.
#[derive(Clone, Copy)]
struct Goal {
    point: WorldPoint,
    /// Not on the segment it started on.
    is_beyond: bool,
}

/// The goal on the circle about `centre`, the path starting at the share `from` of its segment `skip`
/// (0: the current one).
fn goal(reference: &Reference, (skip, from): (usize, f64), centre: WorldPoint, radius_m: f64) -> Goal {
    let (mut from, mut is_beyond) = (from, false);
    let mut last = reference.last;
    // The last segment looked at, and where its line or circle leaves.
    let mut end = None;
    for (n, waypoint) in reference.ahead().enumerate() {
        if waypoint.crab_rad != reference.current.crab_rad {
            break;
        }
        let segment = waypoint.segment_from(last);
        last = *waypoint;
        if n < skip || segment.from == segment.to {
            continue;
        }
        is_beyond = n > skip;
        let share = leaves(segment, from, centre, radius_m);
        if share <= 1.0 {
            return Goal { point: segment.point_at(share), is_beyond };
        }
        (from, end) = (0.0, Some((segment, share)));
    }
    let point = match end {
        Some((segment, share)) if share.is_finite() => segment.point_at(share),
        Some((segment, _)) => {
            let heading = segment.heading_rad();
            let way = along_ray(segment.to, heading, centre, radius_m);
            let (sin, cos) = libm::sincos(heading);
            WorldPoint::new(segment.to.x_m + way * cos, segment.to.y_m + way * sin)
        }
        None => last.point(),
    };
    Goal { point, is_beyond }
}

/// How far `point` lies from `from` in direction `heading_rad`, as a share of its distance.
fn cosine(from: WorldPoint, heading_rad: f64, point: WorldPoint) -> f64 {
    let (sin, cos) = libm::sincos(heading_rad);
    let (dx, dy) = (point.x_m - from.x_m, point.y_m - from.y_m);
    (cos * dx + sin * dy) / libm::hypot(dx, dy).max(f64::MIN_POSITIVE)
}

impl PurePursuit {
    /// L for a speed, m.
    fn lookahead_m(&self, speed_mps: f64) -> f64 {
        let bend = speed_mps / self.limits.omega_max_radps;
        let bends = if bend.is_finite() { self.params.lookahead_bends * bend } else { 0.0 };
        bends.max(self.params.lookahead_s * speed_mps).max(self.acceptance_m)
    }

    /// The point to drive to.
    fn aim(&self, reference: &Reference, pose: WorldPose) -> WorldPoint {
        let (robot, segment) = (pose.position(), reference.segment());
        let from = segment.nearest(robot).along.clamp(0.0, 1.0);
        let away = robot.distance_m(segment.point_at(from));
        let lookahead = self.lookahead_m(reference.speed_mps).max(SQRT_2 * away);
        let ahead = goal(reference, (0, from), robot, lookahead);
        if !ahead.is_beyond || cosine(segment.to, segment.heading_rad(), ahead.point) >= AHEAD {
            return ahead.point;
        }
        goal(reference, (1, 0.0), segment.to, BEYOND * self.acceptance_m).point
    }
}

impl ControlLaw for PurePursuit {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let pose = inputs.pose;
        let aim = self.aim(inputs.reference, pose);
        let aim = BodyError::between(pose, WorldPose::new(aim.x_m, aim.y_m, 0.0));
        let distance = libm::hypot(aim.x_m, aim.y_m).max(NEAREST_M);
        let sine = if aim.x_m >= 0.0 {
            aim.y_m / distance
        } else if aim.y_m >= -HALF_TURN_TIE * distance {
            1.0
        } else {
            -1.0
        };
        // κ = 2y/L²
        LawOutput::sound(bend(inputs.reference.speed_mps, 2.0 * sine / distance, &self.limits))
    }

    fn reset(&mut self) {}
}

#[cfg(test)]
mod tests;
