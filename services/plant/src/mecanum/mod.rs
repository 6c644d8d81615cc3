//! A robot on four Mecanum wheels (the AGV of paper 3), rollers at 45°.
//!
//! ```text
//!            x ▲
//!   front left │  front right   Roller axes at the ground, seen from above; the rollers on top of the
//!        ╱     │     ╲          wheels show the other diagonal, so that the wheels look like an X.
//!       y ◀────M                A contact at q holds along its axis u and rolls freely across it, n:
//!        ╲           ╱            u·(v + Ω ẑ×q − ω r x̂)   sliding, against the traction
//!   rear left      rear right     n·(v + Ω ẑ×q − ω r x̂)   the roller's own rolling
//! ```
//!
//! The twist follows from mass, yaw inertia and the forces of the eight contact directions; no
//! kinematics of the chassis enters. What is simplified: each servo is a first-order lag with a speed
//! and an acceleration limit and does not feel its load; the wheels carry equal loads; the contact point
//! stays below the wheel's centre instead of wandering with the roller.

use crate::contact::{
    CREEP_MPS, GRAVITY_MPS2, advance, drag_nspm, encoder_counts, set_point, ticks_due, turned,
};
use crate::noise::Noise;
use crate::slip::Slip;
use crate::start::start_errors;
use core::f64::consts::FRAC_1_SQRT_2;
use hilare_interfaces::block::{TICK_S, Tick};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::Steps;
use hilare_interfaces::param_group;
use hilare_interfaces::state::{StateWords, Stateful};

param_group! {
    /// Mass, servos and rollers, and what else the control path does not know.
    MecanumPlantParams {
        /// Mass.
        mass_kg: f64 = 40.0, "kg", 0.1, 5000.0;
        /// Moment of inertia about the vertical axis through the centre.
        yaw_inertia_kgm2: f64 = 2.5, "kg m^2", 0.001, 5000.0;
        /// Time constant of the servos' answer to a set point.
        servo_time_s: f64 = 0.05, "s", 0.0005, 2.0;
        /// Highest wheel speed of the servos.
        servo_speed_max_radps: f64 = 30.0, "rad/s", 0.01, 1000.0;
        /// Highest wheel acceleration of the servos.
        servo_acceleration_max_radps2: f64 = 200.0, "rad/s^2", 0.1, 100000.0;
        /// Friction coefficient along a roller's axis.
        traction: f64 = 0.6, "", 0.01, 2.0;
        /// Rolling resistance of a roller, force per load.
        roller_friction: f64 = 0.02, "", 0.0, 0.5;
        /// Mean share of the rim's travel lost to slip, all wheels.
        roller_slip_mean: f64 = 0.0, "", -0.5, 0.9;
        /// Standard deviation of that share, each wheel on its own.
        roller_slip_sd: f64 = 0.0, "", 0.0, 0.5;
        /// Time over which that deviation persists.
        roller_slip_time_s: f64 = 0.02, "s", 0.0001, 10.0;
        /// Relative error of the front left wheel's diameter.
        wheel_error_front_left: f64 = 0.0, "", -0.5, 0.5;
        /// Relative error of the front right wheel's diameter.
        wheel_error_front_right: f64 = 0.0, "", -0.5, 0.5;
        /// Relative error of the rear left wheel's diameter.
        wheel_error_rear_left: f64 = 0.0, "", -0.5, 0.5;
        /// Relative error of the rear right wheel's diameter.
        wheel_error_rear_right: f64 = 0.0, "", -0.5, 0.5;
        /// Relative error of the track.
        track_error: f64 = 0.0, "", -0.5, 0.5;
        /// True start is this much ahead of the assumed one, along world x.
        start_error_x_m: f64 = 0.0, "m", -1.0, 1.0;
        /// True start is this much ahead of the assumed one, along world y.
        start_error_y_m: f64 = 0.0, "m", -1.0, 1.0;
        /// True start heading minus the assumed one.
        start_error_theta_rad: f64 = 0.0, "rad", -3.2, 3.2;
        /// Standard deviation of a random start error, each of x and y.
        start_sd_m: f64 = 0.0, "m", 0.0, 1.0;
        /// Standard deviation of a random start heading error.
        start_sd_rad: f64 = 0.0, "rad", 0.0, 3.2;
        /// Seed of slip and start errors.
        seed: u64 = 1, "", 0, 9007199254740991u64;
    }
}

/// The robot: what its maker built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// From the centre to the front wheels' contacts, L1, m.
    pub half_wheelbase_m: f64,
    /// From the centre to the left wheels' contacts, L2, m.
    pub half_track_m: f64,
    /// Radius of the wheels, m.
    pub wheel_radius_m: f64,
    /// Encoder counts of one turn of a wheel.
    pub counts_per_turn: u64,
}

/// Sub-steps of a tick.
const SUB_STEPS: u32 = 2;
/// Solutions of the contacts' equations a sub-step.
const PASSES: u32 = 2;

/// One wheel.
#[derive(Clone, Copy, Debug)]
struct Wheel {
    /// Contact in the body frame, m.
    at_m: [f64; 2],
    /// Direction of the roller's axis at the contact.
    axis: [f64; 2],
    radius_m: f64,
    speed_radps: f64,
    angle_rad: f64,
}

impl Wheel {
    /// At `(x, y)`; the axis at the ground lies across the diagonal from the centre.
    fn new(x_m: f64, y_m: f64, radius_m: f64) -> Self {
        let lean = if x_m * y_m > 0.0 { -1.0 } else { 1.0 };
        Self {
            at_m: [x_m, y_m],
            axis: [FRAC_1_SQRT_2, lean * FRAC_1_SQRT_2],
            radius_m,
            speed_radps: 0.0,
            angle_rad: 0.0,
        }
    }

    /// How a body velocity moves the contact along `direction`: the row j with speed = j·(vx, vy, Ω).
    fn row(&self, direction: [f64; 2]) -> [f64; 3] {
        [direction[0], direction[1], self.at_m[0] * direction[1] - self.at_m[1] * direction[0]]
    }
}

/// The robot.
#[derive(Clone, Debug)]
pub struct Mecanum {
    params: MecanumPlantParams,
    counts_per_turn: f64,
    wheels: [Wheel; 4],
    slip: Slip<4>,
    pose: WorldPose,
    /// Body velocity: m/s, m/s, rad/s.
    velocity: [f64; 3],
    tick: Tick,
    sub_steps: u32,
}

impl Mecanum {
    /// At `start` (the pose the control path assumes) plus the start errors.
    pub fn new(body: Body, params: MecanumPlantParams, start: WorldPose) -> Self {
        let mut noise = Noise::new(params.seed);
        let pose = start_errors!(params).displaced(start, &mut noise);
        let (front, left) = (body.half_wheelbase_m, body.half_track_m * (1.0 + params.track_error));
        let radius = |error: f64| body.wheel_radius_m * (1.0 + error);
        Self {
            counts_per_turn: body.counts_per_turn as f64,
            wheels: [
                Wheel::new(front, left, radius(params.wheel_error_front_left)),
                Wheel::new(front, -left, radius(params.wheel_error_front_right)),
                Wheel::new(-front, left, radius(params.wheel_error_rear_left)),
                Wheel::new(-front, -left, radius(params.wheel_error_rear_right)),
            ],
            slip: Slip::new(params.roller_slip_mean, params.roller_slip_sd, params.roller_slip_time_s, noise),
            params,
            pose,
            velocity: [0.0; 3],
            tick: 0,
            sub_steps: SUB_STEPS,
        }
    }

    /// Goes on where `before` is, with parameters of its own.
    pub fn take_over(&mut self, before: &Self) {
        for (wheel, old) in self.wheels.iter_mut().zip(&before.wheels) {
            (wheel.speed_radps, wheel.angle_rad) = (old.speed_radps, old.angle_rad);
        }
        self.slip.take_over(&before.slip);
        (self.pose, self.velocity, self.tick) = (before.pose, before.velocity, before.tick);
    }

    /// The true pose after the set points of a tick; a repeated or older message changes nothing, the
    /// ticks of lost ones are made up with the set points of the new one.
    #[inline]
    pub fn step(&mut self, steps: &Steps) -> WorldPose {
        let set_points = steps.wheel_speed_radps.map(set_point);
        for _ in 0..ticks_due(self.tick, steps.tick) {
            self.run(set_points);
        }
        self.tick = self.tick.max(steps.tick);
        self.pose
    }

    /// Cumulative encoder counts: of the wheels, not of the ground.
    pub fn counts(&self) -> [i64; 4] {
        self.wheels.map(|wheel| encoder_counts(wheel.angle_rad, self.counts_per_turn))
    }

    fn run(&mut self, set_points: [f64; 4]) {
        let dt_s = TICK_S / f64::from(self.sub_steps);
        let p = &self.params;
        let answer = 1.0 - libm::exp(-dt_s / p.servo_time_s);
        let gain_max = p.servo_acceleration_max_radps2 * dt_s;
        let top = p.servo_speed_max_radps;
        let grip = self.slip.grip();
        for _ in 0..self.sub_steps {
            let mut rim_mps = [0.0; 4];
            for (i, wheel) in self.wheels.iter_mut().enumerate() {
                let wanted = set_points[i].clamp(-top, top) - wheel.speed_radps;
                let gain = (wanted * answer).clamp(-gain_max, gain_max);
                // Velocities live at the middle of a sub-step, positions at its ends (leapfrog).
                let middle = wheel.speed_radps + gain / 2.0;
                wheel.speed_radps += gain;
                wheel.angle_rad += middle * dt_s;
                rim_mps[i] = middle * wheel.radius_m * grip[i];
            }
            self.push(rim_mps, dt_s);
            advance(&mut self.pose, self.velocity, dt_s);
        }
    }

    /// The velocity after the contacts have pushed for `dt_s`, from M(ν′ − ν) = dt · Σ jᵀ F(ν′).
    fn push(&mut self, rim_mps: [f64; 4], dt_s: f64) {
        let p = &self.params;
        let load_n = p.mass_kg * GRAVITY_MPS2 / 4.0;
        // Seen from the turning body, its momentum turns the other way.
        let [vx, vy] = turned([self.velocity[0], self.velocity[1]], -self.velocity[2] * dt_s / 2.0);
        let before = [vx, vy, self.velocity[2]];
        // The first pass guesses how fast the contacts slide at the end, the second uses it.
        let mut guess = before;
        for _ in 0..PASSES {
            let mut system = System::new([p.mass_kg, p.mass_kg, p.yaw_inertia_kgm2], before);
            for (wheel, rim) in self.wheels.iter().zip(rim_mps) {
                let across = [-wheel.axis[1], wheel.axis[0]];
                for (direction, coefficient) in [(wheel.axis, p.traction), (across, p.roller_friction)] {
                    let row = wheel.row(direction);
                    let surface = rim * direction[0];
                    let drag = drag_nspm(coefficient * load_n, dot(row, guess) - surface, CREEP_MPS);
                    system.add(row, dt_s * drag, surface);
                }
            }
            guess = system.solve();
        }
        self.velocity = guess;
    }
}

impl Stateful for Mecanum {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        for wheel in &mut self.wheels {
            words.finite(core::slice::from_mut(&mut wheel.speed_radps));
            words.finite(core::slice::from_mut(&mut wheel.angle_rad));
        }
        self.slip.visit_state(words);
        words.pose(&mut self.pose);
        words.finite(&mut self.velocity);
        words.word(&mut self.tick);
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Symmetric positive definite equations of three unknowns.
struct System {
    /// xx, xy, xz, yy, yz, zz.
    matrix: [f64; 6],
    right: [f64; 3],
}

impl System {
    fn new(mass: [f64; 3], before: [f64; 3]) -> Self {
        Self {
            matrix: [mass[0], 0.0, 0.0, mass[1], 0.0, mass[2]],
            right: [mass[0] * before[0], mass[1] * before[1], mass[2] * before[2]],
        }
    }

    /// A contact of impulse `drag · (surface − row·ν)` along `row`.
    fn add(&mut self, row: [f64; 3], drag: f64, surface: f64) {
        let [a, b, c] = row;
        let by = [a * a, a * b, a * c, b * b, b * c, c * c];
        for (entry, part) in self.matrix.iter_mut().zip(by) {
            *entry += drag * part;
        }
        for (entry, part) in self.right.iter_mut().zip(row) {
            *entry += drag * surface * part;
        }
    }

    /// By elimination in order (L D Lᵀ), which a positive definite matrix allows.
    fn solve(&self) -> [f64; 3] {
        let [xx, xy, xz, yy, yz, zz] = self.matrix;
        let [a, b, c] = self.right;
        let (l, m) = (xy / xx, xz / xx);
        let (yy, yz, zz) = (yy - l * xy, yz - l * xz, zz - m * xz);
        let (b, c) = (b - l * a, c - m * a);
        let n = yz / yy;
        let z = (c - n * b) / (zz - n * yz);
        let y = (b - yz * z) / yy;
        [(a - xy * y - xz * z) / xx, y, z]
    }
}

#[cfg(test)]
mod tests;
