//! A passive caster: swivels behind its pivot, and pushes the cart aside until it has.

use super::{DcServoParams, dot};
use crate::contact::{CREEP_MPS, drag_nspm, turned};
use hilare_interfaces::state::{StateWords, Stateful};

/// Speed at which a caster's swivel friction is half there, rad/s.
const SWIVEL_CREEP_RADPS: f64 = 0.1;

/// A caster.
#[derive(Clone, Copy, Debug)]
pub struct Caster {
    /// Pivot in the body frame, m.
    pivot_m: [f64; 2],
    /// Direction e in which it rolls, the contact trailing the pivot.
    pub rolls: [f64; 2],
    /// Speeds of the last sub-step, for the secants: swivelling and scrubbing sideways.
    swivel_radps: f64,
    scrub_mps: f64,
}

impl Caster {
    /// At rest, turned by `angle_rad` from trailing straight behind `pivot_m`.
    pub fn new(pivot_m: [f64; 2], angle_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(angle_rad);
        Self { pivot_m, rolls: [cos, sin], swivel_radps: 0.0, scrub_mps: 0.0 }
    }

    /// Goes on as `before` was turned, on a pivot of its own.
    pub const fn take_over(&mut self, before: &Self) {
        *self = Self { pivot_m: self.pivot_m, ..*before };
    }

    /// How (v, Ω) moves the contact, the swivel held: along e and across it, along n.
    pub fn rows(&self, trail_m: f64) -> [[f64; 2]; 2] {
        let [x, y] = self.rolls;
        let at = [self.pivot_m[0] - trail_m * x, self.pivot_m[1] - trail_m * y];
        [[x, at[0] * y - at[1] * x], [-y, at[0] * x + at[1] * y]]
    }

    /// Tyre against scrubbing, N·s/m, and swivel against turning, N·m·s/rad, and c t²: what the tyre
    /// does at the lever of the trail.
    fn holds(&self, p: &DcServoParams, load_n: f64) -> [f64; 3] {
        let tyre = drag_nspm(p.caster_traction * load_n, self.scrub_mps, CREEP_MPS);
        let swivel = drag_nspm(p.caster_swivel_nm, self.swivel_radps, SWIVEL_CREEP_RADPS);
        [tyre, swivel, tyre * p.caster_trail_m * p.caster_trail_m]
    }

    /// Force per speed of the contact, N·s/m: against rolling, and sideways. Sideways the tyre (c) and
    /// the swivel (b, at the lever t) yield one after the other: the contact moves a = s + t δ̇, with
    /// c s t = b δ̇ as the caster has no mass, so the floor pushes with c s = a · c b / (b + c t²).
    pub fn drags(&self, p: &DcServoParams, load_n: f64, velocity: [f64; 2]) -> [f64; 2] {
        let [along, _] = self.rows(p.caster_trail_m);
        let roll = drag_nspm(p.caster_rolling * load_n, dot(along, velocity), CREEP_MPS);
        let [c, b, at_trail] = self.holds(p, load_n);
        [roll, c * share(b, at_trail)]
    }

    /// Takes note of how a body velocity makes it swivel and scrub.
    pub fn feel(&mut self, p: &DcServoParams, load_n: f64, velocity: [f64; 2]) {
        let [_, across] = self.rows(p.caster_trail_m);
        let [_, b, at_trail] = self.holds(p, load_n);
        let sideways = dot(across, velocity);
        self.scrub_mps = sideways * share(b, at_trail);
        self.swivel_radps = if at_trail > 0.0 { (sideways - self.scrub_mps) / p.caster_trail_m } else { 0.0 };
    }

    /// Swivels for `dt_s`.
    pub fn swivel(&mut self, p: &DcServoParams, velocity: [f64; 2], dt_s: f64) {
        let [along, across] = self.rows(p.caster_trail_m);
        // As it aligns, the pull on it fades: dδ̇/dδ = −δ̇ · (speed along e) / (speed along n). With that in
        // the denominator (backward Euler) no sub-step swings past the end.
        let sideways = dot(across, velocity);
        let fades = if sideways == 0.0 { 0.0 } else { self.swivel_radps * dot(along, velocity) / sideways };
        let turn = dt_s * self.swivel_radps / (1.0 + dt_s * fades.max(0.0));
        self.rolls = unit(turned(self.rolls, turn / 2.0));
    }
}

/// `part / (part + rest)`, 0 of nothing.
fn share(part: f64, rest: f64) -> f64 {
    if part > 0.0 { part / (part + rest) } else { 0.0 }
}

/// Back to length 1 from rounding off it.
fn unit([x, y]: [f64; 2]) -> [f64; 2] {
    let scale = 1.5 - 0.5 * (x * x + y * y);
    [x * scale, y * scale]
}

impl Stateful for Caster {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.finite(&mut self.rolls);
        for speed in [&mut self.swivel_radps, &mut self.scrub_mps] {
            words.finite(core::slice::from_mut(speed));
        }
    }
}
