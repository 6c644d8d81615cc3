//! Where a plan leads, and what it costs.
//!
//! A plan is a curvature k_j and a slowness z_j for each stage j of fixed *travel* ds_j, as pure
//! numbers (lengths in turn radii R, speed v = v_hi/z, yaw rate ω = ω_max k/z):
//!
//! ```text
//!   θ_j = θ_{j−1} + k_j ds_j                     p_j = p_{j−1} + chord of the arc
//!   |ω| ≤ ω_max   ⇔  |k| ≤ z                     v ≤ v_hi  ⇔  z ≥ 1
//!   ∫|e| dt + λ ∫|v_r − v| dt  ∝  Σ ds (|e| z + λ v_r (z − 1))         (dt = z ds)
//! ```
//!
//! So the shape depends on k alone, all limits are linear, and a bend tighter than R is paid for by
//! slowing at a constant price. Going slower hides nothing from a horizon counted in travel, so it
//! never pays to dawdle before a corner.
//!
//! The leg to measure against switches where the selector would switch it; a stage in which that
//! happens is cut there. Each piece is measured at its middle: that of the chord against a line, that
//! of the bend itself against an arc, which a chord would leave by the height of the bend.

use super::frame::{Leg, MAX_LEGS, Track, Vector};
use super::weights::Weights;

/// Stages of a plan.
pub const STAGES: usize = 28;
/// Most pieces: every stage whole, and one more a switch.
pub const MAX_PIECES: usize = STAGES + MAX_LEGS;

/// Travel of each stage, turn radii: short ones first, the last three times as long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// ds_j.
    pub travel: [f64; STAGES],
}

impl Grid {
    /// Equal stages that add up to `horizon`, turn radii.
    pub fn new(horizon: f64) -> Self {
        Self { travel: [horizon / STAGES as f64; STAGES] }
    }
}

/// Inputs of every stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Curvature k_j, in 1/R.
    pub curvature: [f64; STAGES],
    /// Slowness z_j = v_hi/v.
    pub slowness: [f64; STAGES],
}

impl Plan {
    /// Straight on at full speed.
    pub const STRAIGHT: Self = Self { curvature: [0.0; STAGES], slowness: [1.0; STAGES] };

    /// The same motion seen `travelled` later: the first stage shrinks, and what is left of it joins
    /// the next when it is half gone. The boundaries stay where they are in the world, so a plan that is
    /// carried along is not smeared. What comes into sight at the end is straight.
    pub fn advance(&mut self, grid: &mut Grid, travelled: f64) {
        let whole = grid.travel[STAGES - 1];
        grid.travel[0] -= travelled;
        if grid.travel[0] > 0.5 * whole {
            return;
        }
        let left = grid.travel[0].max(0.0);
        let share = left / (left + whole);
        let (k, z) = (self.curvature[0], self.slowness[0]);
        self.curvature.copy_within(1.., 0);
        self.slowness.copy_within(1.., 0);
        self.curvature[0] += share * (k - self.curvature[0]);
        self.slowness[0] += share * (z - self.slowness[0]);
        self.curvature[STAGES - 1] = 0.0;
        self.slowness[STAGES - 1] = 1.0;
        grid.travel[0] = left + whole;
    }

    /// `share` of the way from `self` to `other`.
    pub fn blend(&self, other: &Self, share: f64) -> Self {
        let mut plan = *self;
        for j in 0..STAGES {
            plan.curvature[j] += share * (other.curvature[j] - self.curvature[j]);
            plan.slowness[j] += share * (other.slowness[j] - self.slowness[j]);
        }
        plan
    }
}

/// A part of a stage on one leg.
#[derive(Clone, Copy, Debug, Default)]
pub struct Piece {
    /// Its stage.
    pub stage: usize,
    /// Its middle, as a share of the stage.
    pub at: f64,
    /// Its travel, turn radii.
    pub travel: f64,
    /// Its leg.
    pub leg: usize,
}

/// Where the plan enters a circle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Switch {
    /// The stage.
    pub stage: usize,
    /// The point, as a share of the stage.
    pub at: f64,
    /// Leg before; its waypoint is the circle's centre.
    pub before: usize,
    /// Leg after.
    pub after: usize,
    /// How far outside the circle the plan passes; 0 if it enters.
    pub excess: f64,
}

/// The motion of a plan.
#[derive(Clone, Debug)]
pub struct Rollout {
    /// p_0 … p_N.
    pub position: [Vector; STAGES + 1],
    /// θ_0 … θ_N.
    pub heading: [f64; STAGES + 1],
    pieces: [Piece; MAX_PIECES],
    pieces_len: usize,
    switches: [Switch; MAX_LEGS],
    switches_len: usize,
    /// Leg at the end.
    pub last_leg: usize,
    /// The stage before ended on the way towards the waypoint ahead.
    approaching: bool,
}

impl Rollout {
    /// Standing at the origin.
    pub fn new() -> Self {
        Self {
            position: [Vector::default(); STAGES + 1],
            heading: [0.0; STAGES + 1],
            pieces: [Piece::default(); MAX_PIECES],
            pieces_len: 0,
            switches: [Switch::default(); MAX_LEGS],
            switches_len: 0,
            last_leg: 0,
            approaching: false,
        }
    }

    /// The pieces in order.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.pieces_len]
    }

    /// The switches in order.
    pub fn switches(&self) -> &[Switch] {
        &self.switches[..self.switches_len]
    }

    /// A point of a stage, `at` its share.
    pub fn point(&self, stage: usize, at: f64) -> Vector {
        let (a, b) = (self.position[stage], self.position[stage + 1]);
        a.plus(b.minus(a), at)
    }

    /// The middle of a piece, as its leg is measured.
    pub fn middle(&self, piece: &Piece, plan: &Plan, grid: &Grid, leg: &Leg) -> Vector {
        let on_chord = self.point(piece.stage, piece.at);
        if leg.curvature == 0.0 {
            return on_chord;
        }
        let chord = self.position[piece.stage + 1].minus(self.position[piece.stage]);
        let turn = plan.curvature[piece.stage] * grid.travel[piece.stage];
        on_chord.plus(chord.left(), -0.5 * turn * piece.at * (1.0 - piece.at))
    }

    /// The point one looks at from the horizon's end: ahead by `travel` along the bend of its leg, at
    /// the tightest that of full speed.
    pub fn ahead(&self, travel: f64, leg: &Leg) -> Vector {
        let half = 0.5 * travel * leg.curvature.clamp(-1.0, 1.0);
        let (sin, cos) = libm::sincos(self.heading[STAGES] + half);
        self.position[STAGES].plus(Vector::new(cos, sin), travel * (1.0 - half * half / 6.0))
    }

    fn start(&mut self) {
        self.position[0] = Vector::default();
        self.heading[0] = 0.0;
        self.pieces_len = 0;
        self.switches_len = 0;
        self.last_leg = 0;
        self.approaching = false;
    }

    fn move_stage(&mut self, stage: usize, ds: f64, k: f64) {
        let half = k * ds / 2.0;
        // Chord of an arc; half an angle of a stage is small, the series is good to 1e-9.
        let chord = ds * (1.0 - half * half / 6.0 * (1.0 - half * half / 20.0));
        let (sin, cos) = libm::sincos(self.heading[stage] + half);
        self.position[stage + 1] = self.position[stage].plus(Vector::new(cos, sin), chord);
        self.heading[stage + 1] = self.heading[stage] + 2.0 * half;
    }

    /// Follows a plan.
    pub fn follow(&mut self, plan: &Plan, grid: &Grid, track: &Track) {
        self.start();
        for stage in 0..STAGES {
            self.move_stage(stage, grid.travel[stage], plan.curvature[stage]);
            self.cut_stage(stage, grid.travel[stage], track);
        }
    }

    /// Steers towards the legs as a helmsman would, without foresight: a first guess that always
    /// turns round and always comes back. `tightest` is the greatest curvature, above 1 at reduced speed.
    /// Writes the plan it drove.
    pub fn steer(&mut self, plan: &mut Plan, grid: &Grid, track: &Track, tightest: f64) {
        self.start();
        for stage in 0..STAGES {
            let leg = &track.legs()[self.last_leg];
            let here = self.position[stage];
            let off = leg.cross_track(here);
            // Aim at the point of the tangent one radius ahead.
            let aim = leg.tangent_at(here).plus(leg.normal_at(here), -off);
            let (sin, cos) = libm::sincos(self.heading[stage]);
            let heading = Vector::new(cos, sin);
            let error = libm::atan2(heading.left().dot(aim), heading.dot(aim));
            plan.curvature[stage] = (2.0 * error + leg.curvature).clamp(-tightest, tightest);
            plan.slowness[stage] = plan.curvature[stage].abs().max(1.0);
            self.move_stage(stage, grid.travel[stage], plan.curvature[stage]);
            self.cut_stage(stage, grid.travel[stage], track);
        }
    }

    /// Cuts a stage where it enters circles, as the selector would switch.
    fn cut_stage(&mut self, stage: usize, ds: f64, track: &Track) {
        let legs = track.legs();
        let mut from = 0.0;
        while self.last_leg + 1 < legs.len() {
            let entered = self.accepts(stage, from, track).map(|at| (at, 0.0));
            let Some((at, excess)) = entered.or_else(|| self.passes(stage, from, track)) else { break };
            if at > from {
                self.push_piece(stage, from, at, ds);
            }
            let after = self.last_leg + 1;
            match self.switches[..self.switches_len].last_mut() {
                // Inside the next circle already: one switch over two legs.
                Some(switch) if switch.stage == stage && switch.at == at => switch.after = after,
                _ => {
                    let before = self.last_leg;
                    self.switches[self.switches_len] = Switch { stage, at, before, after, excess };
                    self.switches_len += 1;
                }
            }
            self.last_leg = after;
            self.approaching = false;
            from = at;
        }
        self.push_piece(stage, from, 1.0, ds);
    }

    fn push_piece(&mut self, stage: usize, from: f64, to: f64, ds: f64) {
        let piece = Piece { stage, at: 0.5 * (from + to), travel: (to - from) * ds, leg: self.last_leg };
        self.pieces[self.pieces_len] = piece;
        self.pieces_len += 1;
    }

    /// First share from `from` on at which the selector accepts the waypoint ahead.
    fn accepts(&self, stage: usize, from: f64, track: &Track) -> Option<f64> {
        let (leg, next) = (&track.legs()[self.last_leg], &track.legs()[self.last_leg + 1]);
        let (enter, leave) = self.inside(stage, from, leg.end, track.acceptance)?;
        if !track.at_bisector {
            return Some(enter);
        }
        // Both distances are (on an arc nearly) linear in the share f: the first f with |e_next| ≤ |e|.
        let (a, b) = (self.position[stage], self.position[stage + 1]);
        let (e0, e1) = (leg.cross_track(a), leg.cross_track(b));
        let (n0, n1) = (next.cross_track(a), next.cross_track(b));
        let nearer = |f: f64| (n0 + f * (n1 - n0)).abs() <= (e0 + f * (e1 - e0)).abs();
        if nearer(enter) {
            return Some(enter);
        }
        let root = |start: f64, end: f64| {
            let at = start / (start - end);
            if at > enter && at <= leave.min(1.0) { at } else { f64::INFINITY }
        };
        let first = root(e0 - n0, e1 - n1).min(root(e0 + n0, e1 + n1));
        if first.is_finite() {
            return Some(first);
        }
        // Accepted at the latest when leaving.
        (leave <= 1.0).then_some(leave)
    }

    /// Shares between which the stage, from `from` on, is inside a circle; the second may exceed 1.
    fn inside(&self, stage: usize, from: f64, centre: Vector, radius: f64) -> Option<(f64, f64)> {
        let start = self.position[stage].minus(centre);
        let way = self.position[stage + 1].minus(self.position[stage]);
        // |start + f way|² = radius²
        let (a, b, c) = (way.dot(way), start.dot(way), start.dot(start) - radius * radius);
        let root = b * b - a * c;
        if root < 0.0 || a <= 0.0 {
            return None;
        }
        let root = libm::sqrt(root);
        let (enter, leave) = ((-b - root) / a, (-b + root) / a);
        (enter <= 1.0 && leave >= from).then_some((enter.max(from), leave))
    }

    /// The closest approach to the waypoint ahead if it is outside the circle but near: share of the
    /// stage and how far outside. Counting it as accepted, at a price, keeps the cost continuous where
    /// the best plan grazes the circle.
    fn passes(&mut self, stage: usize, from: f64, track: &Track) -> Option<(f64, f64)> {
        let centre = track.legs()[self.last_leg].end;
        let start = self.position[stage].minus(centre);
        let way = self.position[stage + 1].minus(self.position[stage]);
        let closest = -start.dot(way) / way.dot(way).max(f64::MIN_POSITIVE);
        let came_near = self.approaching;
        self.approaching = closest >= 1.0;
        if self.approaching || (closest <= from && !came_near) {
            return None;
        }
        let at = closest.max(from);
        let excess = start.plus(way, at).norm() - track.acceptance;
        (excess < track.acceptance).then_some((at, excess.max(0.0)))
    }

    /// What the plan costs (module's equation, smoothed near zero, with the terminal terms).
    pub fn cost(&self, plan: &Plan, grid: &Grid, track: &Track, weights: &Weights) -> f64 {
        let legs = track.legs();
        let mut cost = 0.0;
        for piece in self.pieces() {
            let leg = &legs[piece.leg];
            let off = leg.cross_track(self.middle(piece, plan, grid, leg));
            cost += piece.travel * plan.slowness[piece.stage] * weights.size(off);
        }
        for j in 0..STAGES {
            cost += weights.slow * grid.travel[j] * (plan.slowness[j] - 1.0);
        }
        let leg = &legs[self.last_leg];
        let (sin, cos) = libm::sincos(self.heading[STAGES]);
        let ahead = leg.cross_track(self.ahead(weights.ahead, leg));
        cost += weights.end_off * weights.size(ahead);
        let tangent = leg.tangent_at(self.position[STAGES]);
        cost += weights.end_heading * (1.0 - tangent.dot(Vector::new(cos, sin)));
        cost += weights.miss * self.switches().iter().map(|switch| switch.excess).sum::<f64>();
        cost + weights.effort(plan, grid)
    }
}

impl Default for Rollout {
    fn default() -> Self {
        Self::new()
    }
}
