//! A four-wheel cart (paper 2): two rear wheels on DC servos, two passive casters in front.
//!
//! ```text
//!      left wheel ┃──────────────────○╲   caster: pivot ○, wheel trails it along −e
//!                 ┃                    ━
//!               L │    d               e      v, Ω: forward speed and yaw rate of the axle's middle M
//!                 M────●── C of mass ─────▶ x
//!               L │                           per wheel: supply · duty → R, k_t = k_e → gear → ω → rim
//!                 ┃                    ━
//!     right wheel ┃──────────────────○╱       floor:     μN against sliding  s = r ω − (v ± L Ω)
//! ```
//!
//! With the centre of mass d ahead of M, traction F and caster forces C at q:
//!
//! ```text
//!     m v̇ = m d Ω² + Σ F + Σ C_x          (I_C + m d²) Ω̇ = −m d v Ω + L (F_right − F_left) + Σ q × C
//!     J ω̇ = n k_t i − dry − viscous − r F          i = (V − k_e n ω) / R
//! ```
//!
//! What is simplified: the driven axle never moves sideways (its side force has no limit), wheel loads
//! are those at rest, the motors' inductance is neglected (electric time constants are below a
//! millisecond) and so are a current limit and the casters' own mass. Slip makes a wheel's effective
//! radius smaller, for travel and traction alike.
//!
//! Each drive runs its velocity loop at 1 kHz on what its encoder shows: counts a tick, low-passed.

mod caster;
mod wheel;

use crate::contact::{GRAVITY_MPS2, advance, encoder_counts, set_point, ticks_due};
use crate::noise::Noise;
use crate::slip::Slip;
use crate::start::start_errors;
use caster::Caster;
use hilare_interfaces::block::{TICK_S, Tick};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::Steps;
use hilare_interfaces::param_group;
use hilare_interfaces::state::{StateWords, Stateful};
use wheel::{Drive, Guess, Wheel};

param_group! {
    /// Cart, motors, drives and casters, and what else the control path does not know.
    DcServoParams {
        /// Mass of the cart.
        mass_kg: f64 = 15.0, "kg", 0.1, 1000.0;
        /// Moment of inertia about the vertical axis through the centre of mass.
        yaw_inertia_kgm2: f64 = 0.5, "kg m^2", 0.0001, 1000.0;
        /// Centre of mass ahead of the driven axle, d.
        com_ahead_m: f64 = 0.1, "m", 0.0, 2.0;
        /// Supply voltage, what a duty of 1 puts on a motor.
        supply_v: f64 = 24.0, "V", 1.0, 400.0;
        /// Torque constant of a motor, N·m/A, and its back-EMF, V·s/rad.
        torque_constant_nmpa: f64 = 0.05, "N m/A", 0.001, 10.0;
        /// Resistance of a motor and its bridge.
        resistance_ohm: f64 = 0.8, "ohm", 0.001, 1000.0;
        /// Turns of the motor to one of the wheel.
        gear_ratio: f64 = 20.0, "", 0.1, 1000.0;
        /// Moment of inertia of a wheel, with its gear and rotor, at the wheel.
        wheel_inertia_kgm2: f64 = 0.013, "kg m^2", 0.000001, 100.0;
        /// Dry friction of a gear, at the wheel.
        dry_friction_nm: f64 = 0.3, "N m", 0.0, 100.0;
        /// Viscous friction of a gear, at the wheel.
        viscous_friction_nms: f64 = 0.02, "N m s/rad", 0.0, 100.0;
        /// Proportional gain of the velocity loop.
        velocity_gain_vsprad: f64 = 1.8, "V s/rad", 0.0, 1000.0;
        /// Integral time of the velocity loop.
        velocity_integral_s: f64 = 0.07, "s", 0.001, 100.0;
        /// Time constant of the speed measurement's low-pass.
        speed_filter_s: f64 = 0.004, "s", 0.00001, 1.0;
        /// Friction coefficient of the driven wheels' tyres.
        traction: f64 = 0.7, "", 0.01, 2.0;
        /// Casters' pivots ahead of the driven axle.
        caster_ahead_m: f64 = 0.35, "m", 0.01, 5.0;
        /// Casters' pivots left and right of the middle.
        caster_aside_m: f64 = 0.15, "m", 0.0, 5.0;
        /// From a caster's pivot to its contact.
        caster_trail_m: f64 = 0.03, "m", 0.001, 1.0;
        /// Friction coefficient of the casters' tyres, sideways.
        caster_traction: f64 = 0.6, "", 0.0, 2.0;
        /// Rolling resistance of the casters, force per load.
        caster_rolling: f64 = 0.02, "", 0.0, 0.5;
        /// Friction against a caster's swivelling: bearing and tyre on the floor.
        caster_swivel_nm: f64 = 0.1, "N m", 0.0, 100.0;
        /// Angle of both casters at the start, 0 is trailing straight behind.
        caster_start_rad: f64 = 0.02, "rad", -3.2, 3.2;
        /// Mean share of the rim's travel lost to slip, both wheels.
        slip_mean: f64 = 0.0, "", -0.5, 0.9;
        /// Standard deviation of that share, each wheel on its own.
        slip_sd: f64 = 0.0, "", 0.0, 0.5;
        /// Time over which that deviation persists.
        slip_time_s: f64 = 0.02, "s", 0.0001, 10.0;
        /// Relative error of the right wheel's diameter.
        wheel_error_right: f64 = 0.0, "", -0.5, 0.5;
        /// Relative error of the left wheel's diameter.
        wheel_error_left: f64 = 0.0, "", -0.5, 0.5;
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
    /// Distance between the driven wheels' contact points, 2L, m.
    pub track_m: f64,
    /// Diameter of the driven wheels, m.
    pub wheel_diameter_m: f64,
    /// Encoder counts of one turn of a wheel.
    pub counts_per_turn: u64,
}

/// Sub-steps of a tick.
const SUB_STEPS: u32 = 3;
/// Solutions of the equations of motion a sub-step.
const PASSES: u32 = 2;
/// Most of the weight on the casters, so that the driven wheels keep some.
const FRONT_SHARE_MAX: f64 = 0.95;
/// The robot.
#[derive(Clone, Debug)]
pub struct DcServo {
    params: DcServoParams,
    counts_per_turn: f64,
    /// Share of a new speed sample that the low-pass takes.
    fresh: f64,
    /// Load of a driven wheel and of a caster, N.
    wheel_load_n: f64,
    caster_load_n: f64,
    /// Right, left.
    wheels: [Wheel; 2],
    casters: [Caster; 2],
    slip: Slip<2>,
    pose: WorldPose,
    /// Forward speed and yaw rate: m/s, rad/s.
    velocity: [f64; 2],
    tick: Tick,
    sub_steps: u32,
}

impl DcServo {
    /// At `start` (the pose the control path assumes) plus the start errors.
    pub fn new(body: Body, params: DcServoParams, start: WorldPose) -> Self {
        let mut noise = Noise::new(params.seed);
        let pose = start_errors!(params).displaced(start, &mut noise);
        let half_track = body.track_m * (1.0 + params.track_error) / 2.0;
        let wheel =
            |aside_m: f64, error: f64| Wheel::new(aside_m, body.wheel_diameter_m / 2.0 * (1.0 + error));
        let caster = |aside_m: f64| Caster::new([params.caster_ahead_m, aside_m], params.caster_start_rad);
        let weight_n = params.mass_kg * GRAVITY_MPS2;
        let front = (params.com_ahead_m / params.caster_ahead_m).min(FRONT_SHARE_MAX);
        Self {
            counts_per_turn: body.counts_per_turn as f64,
            fresh: 1.0 - libm::exp(-TICK_S / params.speed_filter_s),
            wheel_load_n: weight_n * (1.0 - front) / 2.0,
            caster_load_n: weight_n * front / 2.0,
            wheels: [
                wheel(-half_track, params.wheel_error_right),
                wheel(half_track, params.wheel_error_left),
            ],
            casters: [caster(-params.caster_aside_m), caster(params.caster_aside_m)],
            slip: Slip::new(params.slip_mean, params.slip_sd, params.slip_time_s, noise),
            params,
            pose,
            velocity: [0.0; 2],
            tick: 0,
            sub_steps: SUB_STEPS,
        }
    }

    /// Goes on where `before` is, with parameters of its own.
    pub fn take_over(&mut self, before: &Self) {
        for (wheel, old) in self.wheels.iter_mut().zip(&before.wheels) {
            *wheel = Wheel { aside_m: wheel.aside_m, radius_m: wheel.radius_m, ..*old };
        }
        for (caster, old) in self.casters.iter_mut().zip(&before.casters) {
            caster.take_over(old);
        }
        self.slip.take_over(&before.slip);
        (self.pose, self.velocity, self.tick) = (before.pose, before.velocity, before.tick);
    }

    /// The true pose after the set points of a tick; a repeated or older message changes nothing, the
    /// ticks of lost ones are made up with the set points of the new one.
    #[inline]
    pub fn step(&mut self, steps: &Steps) -> WorldPose {
        let [right, left, ..] = steps.wheel_speed_radps;
        for _ in 0..ticks_due(self.tick, steps.tick) {
            self.run([set_point(right), set_point(left)]);
        }
        self.tick = self.tick.max(steps.tick);
        self.pose
    }

    /// Cumulative encoder counts, right and left: of the wheels, not of the ground.
    pub fn counts(&self) -> [i64; 4] {
        let [right, left] = self.wheels.map(|wheel| encoder_counts(wheel.angle_rad, self.counts_per_turn));
        [right, left, 0, 0]
    }

    fn run(&mut self, set_points: [f64; 2]) {
        for (wheel, set_point) in self.wheels.iter_mut().zip(set_points) {
            wheel.regulate(set_point, &self.params, self.counts_per_turn, self.fresh);
        }
        let dt_s = TICK_S / f64::from(self.sub_steps);
        let grip = self.slip.grip();
        for _ in 0..self.sub_steps {
            self.push(grip, dt_s);
            let [v, omega] = self.velocity;
            for caster in &mut self.casters {
                caster.swivel(&self.params, [v, omega], dt_s);
            }
            advance(&mut self.pose, [v, 0.0, omega], dt_s);
        }
    }

    /// The velocities after motors and floor have pushed for `dt_s`, all forces taken after it.
    fn push(&mut self, grip: [f64; 2], dt_s: f64) {
        let before = self.velocity;
        let mut wheels_radps = self.wheels.map(|wheel| wheel.speed_radps);
        // The first pass guesses how fast everything slides at the end, the second uses it.
        for _ in 0..PASSES {
            let drives = [0, 1].map(|i| {
                let guess = Guess { wheel_radps: wheels_radps[i], velocity: self.velocity };
                let wheel = &self.wheels[i];
                wheel.drive(&self.params, wheel.radius_m * grip[i], self.wheel_load_n, guess, dt_s)
            });
            self.velocity = self.balance(before, &drives, dt_s);
            wheels_radps = [0, 1].map(|i| drives[i].speed_radps(self.velocity));
            for caster in &mut self.casters {
                caster.feel(&self.params, self.caster_load_n, self.velocity);
            }
        }
        for (wheel, speed_radps) in self.wheels.iter_mut().zip(wheels_radps) {
            wheel.speed_radps = speed_radps;
            wheel.angle_rad += speed_radps * dt_s;
        }
    }

    /// v′ and Ω′ from momentum and impulses.
    fn balance(&self, [v, omega]: [f64; 2], drives: &[Drive; 2], dt_s: f64) -> [f64; 2] {
        let p = &self.params;
        // The centrifugal pair exchanges energy between v and Ω, and makes none.
        let pair = dt_s * p.mass_kg * p.com_ahead_m * omega;
        let inertia = p.yaw_inertia_kgm2 + p.mass_kg * p.com_ahead_m * p.com_ahead_m;
        let mut system =
            System { matrix: [[p.mass_kg, -pair], [pair, inertia]], right: [p.mass_kg * v, inertia * omega] };
        for drive in drives {
            // What the floor gives the body, the wheel's own speed eliminated.
            let Drive { row, drag, radius_m, momentum, stiffness, .. } = *drive;
            system.add(row, drag * stiffness, drag * radius_m * momentum);
        }
        for caster in &self.casters {
            let [roll, scrub] = caster.drags(p, self.caster_load_n, self.velocity);
            let [along, across] = caster.rows(p.caster_trail_m);
            system.add(along, dt_s * roll, 0.0);
            system.add(across, dt_s * scrub, 0.0);
        }
        system.solve()
    }
}

impl Stateful for DcServo {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.wheels.iter_mut().for_each(|wheel| wheel.visit_state(words));
        self.casters.iter_mut().for_each(|caster| caster.visit_state(words));
        self.slip.visit_state(words);
        words.pose(&mut self.pose);
        words.finite(&mut self.velocity);
        words.word(&mut self.tick);
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Two equations: a positive diagonal part, a skew part, and contacts.
struct System {
    matrix: [[f64; 2]; 2],
    right: [f64; 2],
}

impl System {
    /// A contact of impulse `push − drag · row·ν` along `row`.
    fn add(&mut self, row: [f64; 2], drag: f64, push: f64) {
        for (i, line) in self.matrix.iter_mut().enumerate() {
            self.right[i] += row[i] * push;
            for (entry, part) in line.iter_mut().zip(row) {
                *entry += drag * row[i] * part;
            }
        }
    }

    fn solve(&self) -> [f64; 2] {
        let [[a, b], [c, d]] = self.matrix;
        let [x, y] = self.right;
        let determinant = a * d - b * c;
        [(x * d - b * y) / determinant, (a * y - c * x) / determinant]
    }
}

#[cfg(test)]
mod tests;
