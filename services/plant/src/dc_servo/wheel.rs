//! A driven wheel: motor, gear, tyre, and the drive that regulates its speed.

use super::{DcServoParams, dot};
use crate::contact::{CREEP_MPS, drag_nspm, encoder_counts};
use core::f64::consts::TAU;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::state::{StateWords, Stateful};

/// Speed at which a gear's dry friction is half there, rad/s.
const GEAR_CREEP_RADPS: f64 = 0.02;
/// What a drive keeps of its integral from tick to tick while it is told to stand and stands.
const STANDING_KEEPS: f64 = 0.98;

/// A driven wheel and its drive.
#[derive(Clone, Copy, Debug)]
pub struct Wheel {
    /// Contact left of the middle, m.
    pub aside_m: f64,
    pub radius_m: f64,
    pub speed_radps: f64,
    pub angle_rad: f64,
    /// What the drive has counted, measured and decided.
    pub counts: i64,
    pub measured_radps: f64,
    pub integral_v: f64,
    pub motor_v: f64,
}

/// How a sub-step may end; the secants of the friction are taken there.
#[derive(Clone, Copy, Debug)]
pub struct Guess {
    pub wheel_radps: f64,
    /// Of the body: m/s, rad/s.
    pub velocity: [f64; 2],
}

/// A wheel's equation over a sub-step, J(ω′ − ω) = dt (τ − k ω′) − r·drag·(r ω′ − row·ν′), solved for ω′.
pub struct Drive {
    /// Speed of the contact is row·(v, Ω).
    pub row: [f64; 2],
    pub radius_m: f64,
    /// Impulse on the floor per sliding speed, dt·μN/(|s| + s₀).
    pub drag: f64,
    /// (J ω + dt τ) / (J + dt k + r² drag).
    pub momentum: f64,
    /// (J + dt k) / (J + dt k + r² drag).
    pub stiffness: f64,
    /// r·drag / (J + dt k + r² drag).
    pub dragged: f64,
}

impl Drive {
    pub fn speed_radps(&self, velocity: [f64; 2]) -> f64 {
        self.momentum + self.dragged * dot(self.row, velocity)
    }
}

impl Wheel {
    /// Standing, at `aside_m` left of the middle.
    pub fn new(aside_m: f64, radius_m: f64) -> Self {
        Self {
            aside_m,
            radius_m,
            speed_radps: 0.0,
            angle_rad: 0.0,
            counts: 0,
            measured_radps: 0.0,
            integral_v: 0.0,
            motor_v: 0.0,
        }
    }

    /// The velocity loop: PI, the integral waits while the duty is at its end and would go further.
    pub fn regulate(&mut self, set_point: f64, p: &DcServoParams, counts_per_turn: f64, fresh: f64) {
        let counts = encoder_counts(self.angle_rad, counts_per_turn);
        let moved = counts.wrapping_sub(self.counts);
        self.counts = counts;
        let sample = moved as f64 * (TAU / counts_per_turn) / TICK_S;
        self.measured_radps += fresh * (sample - self.measured_radps);
        let error = set_point - self.measured_radps;
        let wish = p.velocity_gain_vsprad * error + self.integral_v;
        self.motor_v = wish.clamp(-p.supply_v, p.supply_v);
        if self.motor_v == wish || error * wish < 0.0 {
            let more = p.velocity_gain_vsprad * TICK_S / p.velocity_integral_s * error;
            self.integral_v = (self.integral_v + more).clamp(-p.supply_v, p.supply_v);
        }
        if set_point == 0.0 && moved == 0 {
            self.integral_v *= STANDING_KEEPS;
        }
    }

    /// Its equation over a sub-step, which ends about as `guess` says.
    pub fn drive(&self, p: &DcServoParams, radius_m: f64, load_n: f64, guess: Guess, dt_s: f64) -> Drive {
        let row = [1.0, -self.aside_m];
        let sliding = radius_m * guess.wheel_radps - dot(row, guess.velocity);
        let drag = dt_s * drag_nspm(p.traction * load_n, sliding, CREEP_MPS);
        let motor = p.gear_ratio * p.torque_constant_nmpa;
        let braking = motor * motor / p.resistance_ohm
            + p.viscous_friction_nms
            + drag_nspm(p.dry_friction_nm, guess.wheel_radps, GEAR_CREEP_RADPS);
        let torque = motor * self.motor_v / p.resistance_ohm;
        let own = p.wheel_inertia_kgm2 + dt_s * braking;
        let per_all = 1.0 / (own + radius_m * radius_m * drag);
        Drive {
            row,
            radius_m,
            drag,
            momentum: (p.wheel_inertia_kgm2 * self.speed_radps + dt_s * torque) * per_all,
            stiffness: own * per_all,
            dragged: radius_m * drag * per_all,
        }
    }
}

impl Stateful for Wheel {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        let numbers = [
            &mut self.speed_radps,
            &mut self.angle_rad,
            &mut self.measured_radps,
            &mut self.integral_v,
            &mut self.motor_v,
        ];
        numbers.into_iter().for_each(|number| words.finite(core::slice::from_mut(number)));
        words.signed(&mut self.counts);
    }
}
