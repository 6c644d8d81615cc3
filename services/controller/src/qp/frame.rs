//! The world as the plan sees it: robot at the origin, heading along x, lengths in turn radii.
//!
//! ```text
//!              ● waypoint k+1         R = v_hi/ω_max   tightest bend at full speed (53.5 mm)
//!             /                       v_hi             v_r inside v_min … v_max
//!            / line 1
//!   robot   /                         line l: n_l·p = c_l, tangent t_l, ends in a circle d_T
//!   ▷─x    ● waypoint k  (circle d_T) about its waypoint; entering it switches to line l+1
//!     line 0
//! ```
//!
//! Because every number below is relative to the robot, turning or moving the world changes nothing
//! but rounding, and the same weights serve a robot of any size.

use crate::TwistLimits;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::{PREVIEW, Reference, Waypoint};

/// Most lines a reference shows: the current one and one a coming waypoint.
pub const MAX_LINES: usize = PREVIEW + 1;

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
}

/// One line to follow, with the waypoint it leads to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Unit vector to its left, n_l; zero for a line of no length.
    pub normal: Vector,
    /// n_l · p on the line, c_l.
    pub offset: f64,
    /// Unit vector along it, t_l; that of the line before if it has no length.
    pub tangent: Vector,
    /// The waypoint at its end.
    pub end: Vector,
}

impl Line {
    fn between(from: Vector, to: Vector, before: Vector) -> Self {
        let way = to.minus(from);
        let length = way.norm();
        if length <= 1e-9 {
            return Self { normal: Vector::default(), offset: 0.0, tangent: before, end: to };
        }
        let tangent = Vector::new(way.x / length, way.y / length);
        let normal = tangent.left();
        Self { normal, offset: normal.dot(from), tangent, end: to }
    }

    /// Signed distance to the line, positive to its left.
    pub fn cross_track(&self, point: Vector) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// The lines ahead.
#[derive(Clone, Debug)]
pub struct Track {
    lines: [Line; MAX_LINES],
    len: usize,
    /// d_T less a margin for what the plan does not see (steps, slip), turn radii.
    pub acceptance: f64,
    /// The selector accepts where the next line is as near as the current one, not on the rim.
    pub at_bisector: bool,
}

impl Track {
    /// Room for the longest reference.
    pub fn new(at_bisector: bool) -> Self {
        Self { lines: [Line::default(); MAX_LINES], len: 1, acceptance: 0.5, at_bisector }
    }

    /// The lines of `reference` seen from `pose`.
    pub fn look(&mut self, reference: &Reference, pose: WorldPose, scale: &Scale, acceptance_m: f64) {
        let (sin, cos) = libm::sincos(pose.theta_rad);
        let local = |waypoint: Waypoint| {
            let (dx, dy) = (waypoint.x_m - pose.x_m, waypoint.y_m - pose.y_m);
            Vector::new((cos * dx + sin * dy) / scale.radius_m, (cos * dy - sin * dx) / scale.radius_m)
        };
        self.acceptance = acceptance_m / scale.radius_m;
        let coming = (reference.preview_len as usize).min(PREVIEW);
        let mut from = local(reference.last);
        let mut before = Vector::new(1.0, 0.0);
        self.len = 0;
        for waypoint in core::iter::once(&reference.current).chain(&reference.preview[..coming]) {
            let to = local(*waypoint);
            let line = Line::between(from, to, before);
            (from, before) = (to, line.tangent);
            self.lines[self.len] = line;
            self.len += 1;
        }
        self.turn_back_if_missed();
    }

    /// A waypoint that lies behind outside its circle is never accepted by going on: then the line
    /// to follow is the one from here to it.
    fn turn_back_if_missed(&mut self) {
        let first = &mut self.lines[0];
        let robot = Vector::default();
        if robot.minus(first.end).dot(first.tangent) > self.acceptance {
            *first = Line::between(robot, first.end, first.tangent);
        }
    }

    /// The lines, the one in force first.
    pub fn lines(&self) -> &[Line] {
        &self.lines[..self.len]
    }
}
