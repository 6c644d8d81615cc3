//! The world as the plan sees it: robot at the origin, heading along x, lengths in turn radii.
//!
//! ```text
//!              ● waypoint k+1         R = v_hi/ω_max   tightest bend at full speed (53.5 mm)
//!             /                       v_hi             v_r inside v_min … v_max
//!            / leg 1
//!   robot   /                         leg: a line n·p = c or an arc, with a circle d_T about the
//!   ▷─x    ● waypoint k  (circle d_T) waypoint it ends in; there the next one comes into force
//!     leg 0
//! ```
//!
//! Because every number below is relative to the robot, turning or moving the world changes nothing
//! but rounding, and the same weights serve a robot of any size.

use crate::TwistLimits;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::{PREVIEW, Reference, Waypoint};
use hilare_interfaces::state::StateWords;

/// Farther away than this a waypoint is taken for this far, m, so that squares stay numbers.
const FAR_M: f64 = 1e9;
/// Most legs a reference shows: the current one and one a coming waypoint.
pub const MAX_LEGS: usize = PREVIEW + 1;
/// Nearer to its centre than this an arc has no direction, turn radii.
const AT_CENTRE: f64 = 1e-9;

/// A point or direction in the plan's frame, turn radii.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vector {
    /// Forward.
    pub x: f64,
    /// To the left.
    pub y: f64,
}

impl Vector {
    /// From components.
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// `self + other · factor`.
    pub fn plus(self, other: Self, factor: f64) -> Self {
        Self::new(self.x + other.x * factor, self.y + other.y * factor)
    }

    /// `self − other`.
    pub fn minus(self, other: Self) -> Self {
        self.plus(other, -1.0)
    }

    /// Scalar product.
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// A quarter turn to the left.
    pub fn left(self) -> Self {
        Self::new(-self.y, self.x)
    }

    /// Length.
    pub fn norm(self) -> f64 {
        libm::sqrt(self.dot(self))
    }
}

/// What makes lengths, speeds and yaw rates pure numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// R, m.
    pub radius_m: f64,
    /// Planned speed v_hi, m/s.
    pub speed_mps: f64,
    /// ω_max, rad/s.
    pub omega_radps: f64,
}

impl Scale {
    /// For a reference speed inside the limits; `None` if the robot cannot drive or cannot turn.
    pub fn new(speed_mps: f64, limits: &TwistLimits) -> Option<Self> {
        let speed_mps = speed_mps.max(limits.v_min_mps).min(limits.v_max_mps);
        let omega_radps = limits.omega_max_radps;
        let usable = speed_mps > 1e-6 && omega_radps > 1e-6;
        usable.then(|| Self { radius_m: speed_mps / omega_radps, speed_mps, omega_radps })
    }

    /// Shows the scale of a plan to `words`: a robot's is known by its speed. Only one that `limits` have is
    /// loaded.
    pub fn visit_state(scale: &mut Option<Self>, limits: &TwistLimits, words: &mut StateWords<'_>) {
        let mut speed_mps = scale.map(|scale| scale.speed_mps);
        words.option(&mut speed_mps, 0.0, |speed_mps, words| words.number(speed_mps));
        let known = speed_mps.and_then(|speed_mps| Self::new(speed_mps, limits));
        words.require(known.map(|scale| scale.speed_mps) == speed_mps);
        *scale = known;
    }
}

/// One line or arc to follow, with the waypoint it leads to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Leg {
    /// Unit vector to the left of a line, n; zero for a leg of no length and for an arc.
    normal: Vector,
    /// n · p on the line, c.
    offset: f64,
    /// Unit vector along it where it ends; that of the leg before if it has no length.
    pub tangent: Vector,
    /// The waypoint at its end.
    pub end: Vector,
    /// Length along it, turn radii.
    pub length: f64,
    /// Direction of travel minus heading on it, rad.
    pub crab: f64,
    /// Curvature, positive to the left, in 1/R; 0 for a line.
    pub curvature: f64,
    /// Centre, radius and sweep (positive to the left, rad); `None` for a line.
    arc: Option<Arc>,
}

#[derive(Clone, Copy, Debug)]
struct Arc {
    centre: Vector,
    radius: f64,
    sweep: f64,
}

impl Leg {
    fn between(from: Vector, to: Vector, bulge: f64, before: Vector) -> Self {
        let way = to.minus(from);
        let length = way.norm();
        if length <= 1e-9 {
            return Self { tangent: before, end: to, ..Self::default() };
        }
        let tangent = Vector::new(way.x / length, way.y / length);
        let normal = tangent.left();
        if bulge != 0.0 {
            return Self::arc(from, to, bulge, normal);
        }
        Self { normal, offset: normal.dot(from), tangent, end: to, length, ..Self::default() }
    }

    /// `left`: unit vector to the left of the chord.
    fn arc(from: Vector, to: Vector, bulge: f64, left: Vector) -> Self {
        let chord = to.minus(from).norm();
        // The centre is (1 − bulge²)/(4 bulge) chords to the left of the chord's middle.
        let height = chord * (1.0 - bulge * bulge) / (4.0 * bulge);
        let centre = from.plus(to.minus(from), 0.5).plus(left, height);
        let curvature = 4.0 * bulge / (chord * (1.0 + bulge * bulge));
        let arc = Arc { centre, radius: 1.0 / curvature.abs(), sweep: 4.0 * libm::atan(bulge) };
        let length = arc.radius * arc.sweep.abs();
        let mut leg = Self { end: to, length, curvature, arc: Some(arc), ..Self::default() };
        leg.tangent = leg.tangent_at(to);
        leg
    }

    /// Signed distance to the line or full circle, positive to its left.
    pub fn cross_track(&self, point: Vector) -> f64 {
        match self.arc {
            None => self.normal.dot(point) - self.offset,
            // Inside a left turn is to its left, inside a right turn to its right.
            Some(arc) => (arc.radius - point.minus(arc.centre).norm()) * 1.0_f64.copysign(self.curvature),
        }
    }

    /// Gradient of [`cross_track`](Self::cross_track): the unit vector to the left of the nearest place.
    pub fn normal_at(&self, point: Vector) -> Vector {
        let Some(arc) = self.arc else { return self.normal };
        let out = point.minus(arc.centre);
        let distance = out.norm();
        if distance < AT_CENTRE {
            return Vector::new(1.0, 0.0);
        }
        let size = 1.0_f64.copysign(-self.curvature) / distance;
        Vector::new(out.x * size, out.y * size)
    }

    /// Direction of travel at the place nearest to `point`.
    pub fn tangent_at(&self, point: Vector) -> Vector {
        if self.arc.is_none() {
            return self.tangent;
        }
        let normal = self.normal_at(point);
        Vector::new(normal.y, -normal.x)
    }

    /// The place `distance` before its end, along the line or round the circle, and the direction there.
    pub fn before_end(&self, distance: f64) -> (Vector, Vector) {
        let Some(arc) = self.arc else { return (self.end.plus(self.tangent, -distance), self.tangent) };
        let (sin, cos) = libm::sincos(-distance * self.curvature);
        let turned = |v: Vector| Vector::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y);
        (arc.centre.plus(turned(self.end.minus(arc.centre)), 1.0), turned(self.tangent))
    }

    /// How far `point` lies behind the leg's end, along the leg; negative before it.
    pub fn beyond_end(&self, point: Vector) -> f64 {
        let Some(arc) = self.arc else { return point.minus(self.end).dot(self.tangent) };
        // From the end back to the point, seen from the centre, in the sense of the arc; a place is
        // behind the end up to half a turn from the arc's middle.
        let (out, end) = (point.minus(arc.centre), self.end.minus(arc.centre));
        let side = 1.0_f64.copysign(self.curvature);
        let turn = libm::atan2(side * end.left().dot(out), end.dot(out));
        let most = core::f64::consts::PI - 0.5 * arc.sweep.abs();
        let turn = if turn > most { turn - core::f64::consts::TAU } else { turn };
        arc.radius * turn
    }
}

/// The legs ahead.
#[derive(Clone, Debug)]
pub struct Track {
    legs: [Leg; MAX_LEGS],
    len: usize,
    /// d_T less a margin for what the plan does not see (steps, slip), turn radii.
    pub acceptance: f64,
    /// The selector accepts where the next leg is as near as the current one, not on the rim.
    pub at_bisector: bool,
}

impl Track {
    /// Room for the longest reference.
    pub fn new(at_bisector: bool) -> Self {
        Self { legs: [Leg::default(); MAX_LEGS], len: 1, acceptance: 0.5, at_bisector }
    }

    /// The legs of `reference` seen from `pose`.
    pub fn look(&mut self, reference: &Reference, pose: WorldPose, scale: &Scale, acceptance_m: f64) {
        let (sin, cos) = libm::sincos(pose.theta_rad);
        let local = |waypoint: Waypoint| {
            let dx = (waypoint.x_m - pose.x_m).clamp(-FAR_M, FAR_M);
            let dy = (waypoint.y_m - pose.y_m).clamp(-FAR_M, FAR_M);
            Vector::new((cos * dx + sin * dy) / scale.radius_m, (cos * dy - sin * dx) / scale.radius_m)
        };
        self.acceptance = acceptance_m / scale.radius_m;
        let mut from = local(reference.last);
        let mut before = Vector::new(1.0, 0.0);
        self.len = 0;
        for waypoint in reference.ahead() {
            let to = local(*waypoint);
            let leg = Leg { crab: waypoint.crab_rad, ..Leg::between(from, to, waypoint.bulge, before) };
            (from, before) = (to, leg.tangent);
            self.legs[self.len] = leg;
            self.len += 1;
        }
    }

    /// A waypoint that lies more than `most` behind outside its circle is never accepted by going on:
    /// then the leg to follow is the line from here to it.
    pub fn turn_back_if_missed(&mut self, most: f64) {
        let first = &mut self.legs[0];
        let robot = Vector::default();
        if first.beyond_end(robot) > most && first.end.norm() > self.acceptance {
            *first = Leg { crab: first.crab, ..Leg::between(robot, first.end, 0.0, first.tangent) };
        }
    }

    /// The legs, the one in force first.
    pub fn legs(&self) -> &[Leg] {
        &self.legs[..self.len]
    }
}
