//! From counts to a displacement of the body, and how scale errors and slip change it.
//!
//! ```text
//!   d = Σ n_w (g_w + D_w s)        d   displacement (forward, left, turn) in the body frame
//!                                  n_w counts of wheel w
//!   differential   s = (forward, right − left, turn)       g_w displacement of one count
//!   Mecanum        s = (forward, sideways, turn)           s   relative errors, D_w what they act on
//! ```
//!
//! Mean and difference, not right and left: both wheels slip on the same floor, so what is known
//! beforehand (5 % of slip, 1 % of difference) is of these two.

use super::params::EkfParams;
use hilare_interfaces::chassis::{Chassis, MAX_WHEELS, PerWheel};
use nalgebra::{Matrix3, Vector3};

/// A robot as the filter sees it.
#[derive(Clone, Debug)]
pub struct Motion {
    wheels: usize,
    /// g_w: m, m, rad.
    gain: [Vector3<f64>; MAX_WHEELS],
    /// D_w.
    scaling: [Matrix3<f64>; MAX_WHEELS],
    /// Rim travel of one count, m.
    rim_m: f64,
    /// Variance of a wheel's travel, per count, as a share of the square of a count.
    slip_variance: f64,
    /// Variance by which a scale error wanders, per metre.
    drift_variance: f64,
}

/// What the wheels did between two ticks.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    /// Displacement without errors: Σ n_w g_w.
    pub nominal: Vector3<f64>,
    /// Derivative of the displacement by the scale errors: Σ n_w D_w.
    pub scaling: Matrix3<f64>,
    /// Covariance of the displacement by slip.
    pub slip: Matrix3<f64>,
    /// Variance by which each scale error has wandered.
    pub drift: f64,
}

impl Motion {
    /// Of a chassis whose wheels turn by `count_rad` a count.
    pub fn new(chassis: &Chassis, count_rad: f64, params: &EkfParams) -> Self {
        let mut gain = [Vector3::zeros(); MAX_WHEELS];
        let mut scaling = [Matrix3::zeros(); MAX_WHEELS];
        for wheel in 0..chassis.wheels() {
            let mut one = [0.0; MAX_WHEELS];
            one[wheel] = count_rad;
            // [MH18] (3), [Qian18] (1)
            let twist = chassis.twist(one);
            let g = Vector3::new(twist.vx_mps, twist.vy_mps, twist.omega_radps);
            gain[wheel] = g;
            scaling[wheel] = match chassis {
                Chassis::Differential(_) => {
                    let half = if wheel == 0 { 0.5 } else { -0.5 };
                    Matrix3::from_columns(&[g, g * half, Vector3::new(0.0, 0.0, g.z)])
                }
                Chassis::Mecanum(_) => Matrix3::from_diagonal(&g),
            };
        }
        let rim_m = count_rad.abs() * chassis.wheel_radius_m();
        Self {
            wheels: chassis.wheels(),
            gain,
            scaling,
            rim_m,
            slip_variance: params.slip_noise * params.slip_noise / rim_m,
            drift_variance: params.scale_drift * params.scale_drift,
        }
    }

    /// Displacement of one count of each wheel with scale errors `scale`.
    pub fn per_count(&self, scale: &Vector3<f64>) -> [Vector3<f64>; MAX_WHEELS] {
        core::array::from_fn(|wheel| self.gain[wheel] + self.scaling[wheel] * scale)
    }

    /// What these counts are, with how uncertain they are.
    pub fn moved(&self, counts: &PerWheel<i64>) -> Moved {
        let mut moved = Moved {
            nominal: Vector3::zeros(),
            scaling: Matrix3::zeros(),
            slip: Matrix3::zeros(),
            drift: 0.0,
        };
        let mut rim_counts = 0.0;
        for (wheel, count) in counts.iter().enumerate().take(self.wheels) {
            let n = *count as f64;
            let g = &self.gain[wheel];
            moved.nominal += g * n;
            moved.scaling += self.scaling[wheel] * n;
            // Slip of step after step is independent: its variance grows with the way, not with the
            // time, and a robot at rest loses no certainty.
            moved.slip += g * g.transpose() * (self.slip_variance * n.abs());
            rim_counts += n.abs();
        }
        moved.drift = self.drift_variance * rim_counts * self.rim_m / self.wheels as f64;
        moved
    }
}

/// Where a displacement `d` leads from `pose`, the twist being constant on the way.
///
/// ```text
///   h = d_θ/2     p' = p + sin(h)/h · R(θ + h) · (d_x, d_y)     θ' = θ + d_θ
/// ```
pub fn arc(pose: &Vector3<f64>, d: &Vector3<f64>) -> Arc {
    let half = 0.5 * d.z;
    let (sin, cos) = libm::sincos(pose.z + half);
    let turned = (d.x * cos - d.y * sin, d.x * sin + d.y * cos);
    let chord = chord(half);
    let way = Vector3::new(chord * turned.0, chord * turned.1, d.z);
    Arc { way, half, turned, chord, cos_sin: (cos, sin) }
}

/// sin(h)/h. For the small angles of a tick the series is exact to the last bit.
fn chord(half: f64) -> f64 {
    if half.abs() < 0.02 {
        let h2 = half * half;
        1.0 - h2 / 6.0 * (1.0 - h2 / 20.0 * (1.0 - h2 / 42.0))
    } else {
        libm::sin(half) / half
    }
}

/// A way along an arc, world frame.
#[derive(Clone, Copy, Debug)]
pub struct Arc {
    /// What it adds to the pose.
    pub way: Vector3<f64>,
    half: f64,
    turned: (f64, f64),
    chord: f64,
    cos_sin: (f64, f64),
}

impl Arc {
    /// Derivative of the pose after it by the pose before it.
    pub fn by_pose(&self) -> Matrix3<f64> {
        let mut by = Matrix3::identity();
        by[(0, 2)] = -self.way.y;
        by[(1, 2)] = self.way.x;
        by
    }

    /// Derivative of the pose after it by the displacement.
    pub fn by_displacement(&self) -> Matrix3<f64> {
        let (cos, sin) = self.cos_sin;
        // Of sin(h)/h.
        let slope = if self.half.abs() < 0.02 {
            let h2 = self.half * self.half;
            -self.half / 3.0 * (1.0 - h2 / 10.0 * (1.0 - h2 / 28.0))
        } else {
            (libm::cos(self.half) - self.chord) / self.half
        };
        Matrix3::new(
            self.chord * cos,
            -self.chord * sin,
            0.5 * (slope * self.turned.0 - self.way.y),
            self.chord * sin,
            self.chord * cos,
            0.5 * (slope * self.turned.1 + self.way.x),
            0.0,
            0.0,
            1.0,
        )
    }
}
