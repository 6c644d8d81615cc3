//! A small world for the tests: a robot whose wheels are not what the estimator thinks, and a camera.
//!
//! It shares no formula with the estimators: contact points roll, the body follows exact arcs.
#![allow(dead_code, reason = "each test uses its part")]

use hilare_interfaces::block::Tick;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams, PerWheel};
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::messages::PoseFix;
use hilare_pose_estimator::EstimatorSetup;
use hilare_pose_estimator::ekf::params::EkfParams;
use std::collections::VecDeque;

pub mod rectangle;

/// Rim travel of a step of the e-puck, m.
pub const STEP_M: f64 = 0.000_13;
/// Encoder counts of a turn of a Mecanum wheel.
pub const COUNTS_PER_TURN: f64 = 4096.0;

/// The e-puck of paper 1.
pub fn differential(ekf: EkfParams) -> EstimatorSetup {
    let chassis = Chassis::Differential(DifferentialParams::default());
    let start = WorldPose::new(0.2, 0.2, 0.0);
    EstimatorSetup { chassis, count_rad: STEP_M / chassis.wheel_radius_m(), start, ekf }
}

/// A Mecanum platform with encoders.
pub fn mecanum(ekf: EkfParams) -> EstimatorSetup {
    let chassis = Chassis::Mecanum(MecanumParams::default());
    let start = WorldPose::new(0.2, 0.2, 0.0);
    EstimatorSetup { chassis, count_rad: core::f64::consts::TAU / COUNTS_PER_TURN, start, ekf }
}

/// SplitMix64 and the Box–Muller transform.
#[derive(Clone)]
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(1))
    }

    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) + 1) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(self.uniform()));
        radius * libm::cos(core::f64::consts::TAU * self.uniform())
    }
}

/// What is wrong with the robot.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wrong {
    /// Relative errors of the way forward, of the right wheel to the left (differential) or the way sideways
    /// (Mecanum), of the turn.
    pub scale: [f64; 3],
    /// Sd of a wheel's travel after a metre, m.
    pub slip_noise: f64,
    /// Sd by which each of `scale` wanders on a metre.
    pub scale_drift: f64,
    /// True start minus the assumed one.
    pub start: [f64; 3],
}

impl Wrong {
    /// Drawn from what the filter is told.
    pub fn drawn(params: &EkfParams, setup: &EstimatorSetup, noise: &mut Noise) -> Self {
        let second = match setup.chassis {
            Chassis::Differential(_) => params.wheel_difference_sd,
            Chassis::Mecanum(_) => params.sideways_scale_sd,
        };
        let scale = [params.forward_scale_sd, second, params.yaw_scale_sd].map(|sd| sd * noise.normal());
        let start = [params.start_sd_m, params.start_sd_m, params.start_sd_rad].map(|sd| sd * noise.normal());
        Self { scale, slip_noise: params.slip_noise, scale_drift: params.scale_drift, start }
    }
}

/// The true robot.
pub struct Robot {
    pub wrong: Wrong,
    pub pose: WorldPose,
    pub counts: PerWheel<i64>,
    chassis: Chassis,
    rim_m: f64,
    noise: Noise,
}

impl Robot {
    pub fn new(setup: &EstimatorSetup, wrong: Wrong, noise: Noise) -> Self {
        let [x, y, theta] = wrong.start;
        let start = setup.start;
        Self {
            wrong,
            pose: WorldPose::new(start.x_m + x, start.y_m + y, start.theta_rad + theta),
            counts: [0; 4],
            chassis: setup.chassis,
            rim_m: setup.count_rad * setup.chassis.wheel_radius_m(),
            noise,
        }
    }

    /// Turns the wheels by these counts in one tick.
    pub fn turn(&mut self, counts: PerWheel<i64>) {
        let mut rim = [0.0; 4];
        for wheel in 0..self.chassis.wheels() {
            let n = counts[wheel] as f64;
            self.counts[wheel] += counts[wheel];
            rim[wheel] = n * self.rim_m;
            if self.wrong.slip_noise > 0.0 && n != 0.0 {
                rim[wheel] += self.wrong.slip_noise * libm::sqrt(n.abs() * self.rim_m) * self.noise.normal();
            }
        }
        let [first, second, third] = self.wrong.scale;
        let (forward, left, turn) = match self.chassis {
            Chassis::Differential(p) => {
                let right_m = rim[0] * (1.0 + first + second / 2.0);
                let left_m = rim[1] * (1.0 + first - second / 2.0);
                ((right_m + left_m) / 2.0, 0.0, (right_m - left_m) / p.track_m * (1.0 + third))
            }
            Chassis::Mecanum(p) => {
                let [fl, fr, rl, rr] = rim;
                let arm = p.half_wheelbase_m + p.half_track_m;
                (
                    (fl + fr + rl + rr) / 4.0 * (1.0 + first),
                    (fr + rl - fl - rr) / 4.0 * (1.0 + second),
                    (fr + rr - fl - rl) / (4.0 * arm) * (1.0 + third),
                )
            }
        };
        self.wander(counts);
        // Exponential of a planar twist: V(turn) (forward, left) in the frame of the start.
        let (a, b) = if turn.abs() < 1e-5 {
            (1.0 - turn * turn / 6.0, turn / 2.0)
        } else {
            (libm::sin(turn) / turn, (1.0 - libm::cos(turn)) / turn)
        };
        let (x, y) = (a * forward - b * left, b * forward + a * left);
        let (sin, cos) = libm::sincos(self.pose.theta_rad);
        self.pose.x_m += x * cos - y * sin;
        self.pose.y_m += x * sin + y * cos;
        self.pose.theta_rad += turn;
    }

    /// Lets the scale errors wander with the way of these counts.
    fn wander(&mut self, counts: PerWheel<i64>) {
        let way_m =
            counts.iter().map(|n| n.abs() as f64).sum::<f64>() * self.rim_m / self.chassis.wheels() as f64;
        if self.wrong.scale_drift > 0.0 && way_m > 0.0 {
            for scale in &mut self.wrong.scale {
                *scale += self.wrong.scale_drift * libm::sqrt(way_m) * self.noise.normal();
            }
        }
    }
}

/// The overhead camera: a picture every `period`, used `delay` later.
pub struct Camera {
    pub period: Tick,
    pub delay: Tick,
    pub sd: (f64, f64),
    pub noise: Noise,
    under_way: VecDeque<PoseFix>,
}

impl Camera {
    pub fn new(period: Tick, delay: Tick, sd: (f64, f64), noise: Noise) -> Self {
        Self { period, delay, sd, noise, under_way: VecDeque::new() }
    }

    /// What the defaults of the plant's camera are.
    pub fn usual(noise: Noise) -> Self {
        Self::new(40, 60, (0.001, 0.005), noise)
    }

    pub fn watch(&mut self, tick: Tick, truth: WorldPose) -> Option<PoseFix> {
        if tick.is_multiple_of(self.period) {
            self.under_way.push_back(PoseFix {
                tick: tick + self.delay,
                captured_tick: tick,
                x_m: truth.x_m + self.sd.0 * self.noise.normal(),
                y_m: truth.y_m + self.sd.0 * self.noise.normal(),
                theta_rad: wrap_angle_rad(truth.theta_rad + self.sd.1 * self.noise.normal()),
            });
        }
        let due = self.under_way.front().is_some_and(|fix| fix.tick <= tick);
        if due { self.under_way.pop_front() } else { None }
    }
}

/// Whole counts a tick out of wheel speeds, `[MH18] (26)–(29)`.
#[derive(Default)]
pub struct Pulses {
    owed_rad: [f64; 4],
}

impl Pulses {
    pub fn tick(&mut self, setup: &EstimatorSetup, speeds_radps: PerWheel<f64>) -> PerWheel<i64> {
        core::array::from_fn(|wheel| {
            self.owed_rad[wheel] += speeds_radps[wheel] * 1e-3;
            let n = libm::trunc(self.owed_rad[wheel] / setup.count_rad);
            self.owed_rad[wheel] -= n * setup.count_rad;
            n as i64
        })
    }
}
