//! The extended Kalman filter itself: pose and scale errors with their covariance.
//!
//! ```text
//!   state  pose p = (x, y, θ), scale errors s          covariance  ┌ P   C ┐
//!                                                                  └ Cᵀ  S ┘
//!   motion   p' = p ⊕ (d + M s)        F = ∂p'/∂p, G = ∂p'/∂d, B = G M
//!            P' = F P Fᵀ + F C Bᵀ + B Cᵀ Fᵀ + B S Bᵀ + G Q Gᵀ
//!            C' = F C + B S            S' = S + drift
//!   fix      z = p + v, v ~ N(0, R)    K_p = P (P + R)⁻¹, K_s = Cᵀ (P + R)⁻¹
//! ```
//!
//! Covariances are kept by the Joseph form, in blocks of 3 × 3, which stay symmetric and
//! positive. (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 5.2.)

use super::motion::{Moved, arc};
use super::params::EkfParams;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::state::{StateWords, Stateful};
use nalgebra::{Cholesky, Matrix3, Vector3};

/// Sum of variances (m², rad²) from which on nothing is known of the pose: counts no wheel can make.
const VARIANCE_MAX: f64 = 1e6;

/// What is believed of the state at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// x and y (m), heading (rad, not wrapped).
    pub pose: Vector3<f64>,
    /// Relative scale errors.
    pub scale: Vector3<f64>,
    /// P, covariance of the pose.
    pub pose_cov: Matrix3<f64>,
    /// C, of the pose with the scale errors.
    pub cross_cov: Matrix3<f64>,
    /// S, of the scale errors.
    pub scale_cov: Matrix3<f64>,
}

/// What a camera says.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// x and y (m), heading (rad).
    pub pose: Vector3<f64>,
    /// R: variances of the three.
    pub variance: Vector3<f64>,
}

/// S before anything was measured.
pub fn prior_scale_cov(chassis: &Chassis, params: &EkfParams) -> Matrix3<f64> {
    let second = match chassis {
        Chassis::Differential(_) => params.wheel_difference_sd,
        Chassis::Mecanum(_) => params.sideways_scale_sd,
    };
    Matrix3::from_diagonal(
        &Vector3::new(params.forward_scale_sd, second, params.yaw_scale_sd).map(|sd| sd * sd),
    )
}

/// The average of a matrix and its transpose.
fn symmetric(m: &Matrix3<f64>) -> Matrix3<f64> {
    (m + m.transpose()) * 0.5
}

impl Stateful for Belief {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.finite(self.pose.as_mut_slice());
        words.finite(self.scale.as_mut_slice());
        for block in [&mut self.pose_cov, &mut self.cross_cov, &mut self.scale_cov] {
            words.finite(block.as_mut_slice());
        }
    }
}

impl Belief {
    /// A pose with independent errors of these variances, the scale errors independent of it.
    pub fn new(
        pose: Vector3<f64>,
        variance: Vector3<f64>,
        scale: Vector3<f64>,
        scale_cov: Matrix3<f64>,
    ) -> Self {
        Self {
            pose,
            scale,
            pose_cov: Matrix3::from_diagonal(&variance),
            cross_cov: Matrix3::zeros(),
            scale_cov,
        }
    }

    /// The pose as others know it.
    pub fn world_pose(&self) -> WorldPose {
        WorldPose::new(self.pose.x, self.pose.y, self.pose.z)
    }

    /// After the wheels have moved.
    pub fn predict(&mut self, moved: &Moved) {
        let arc = arc(&self.pose, &(moved.nominal + moved.scaling * self.scale));
        let f = arc.by_pose();
        let g = arc.by_displacement();
        let b = g * moved.scaling;
        let fc = f * self.cross_cov * b.transpose();
        let noise = g * moved.slip * g.transpose();
        self.pose_cov = symmetric(
            &(f * self.pose_cov * f.transpose()
                + fc
                + fc.transpose()
                + b * self.scale_cov * b.transpose()
                + noise),
        );
        self.cross_cov = f * self.cross_cov + b * self.scale_cov;
        self.scale_cov += Matrix3::from_diagonal_element(moved.drift);
        self.pose += arc.way;
        // NaN is not below the limit either.
        let known = self.pose_cov.trace() < VARIANCE_MAX && self.scale_cov.trace() < VARIANCE_MAX;
        if !known {
            let lost = Vector3::repeat(VARIANCE_MAX / 4.0);
            *self = Self::new(self.pose, lost, Vector3::zeros(), Matrix3::identity());
        }
    }

    /// What a fix adds to the pose, its heading the short way round.
    pub fn innovation(&self, fix: &Measurement) -> Vector3<f64> {
        let mut off = fix.pose - self.pose;
        off.z = wrap_angle_rad(off.z);
        off
    }

    /// Takes in a fix unless it is more than `gate_sd` standard deviations off; true if taken.
    pub fn update(&mut self, fix: &Measurement, gate_sd: f64) -> bool {
        let r = Matrix3::from_diagonal(&fix.variance);
        let Some(spread) = Cholesky::new(self.pose_cov + r) else { return false };
        let off = self.innovation(fix);
        let distance_squared = off.dot(&spread.solve(&off));
        // Written so that NaN is refused.
        let inside = distance_squared <= gate_sd * gate_sd;
        if !inside {
            return false;
        }
        // (P + R) is symmetric: K = P (P + R)⁻¹ = ((P + R)⁻¹ P)ᵀ.
        let kp = spread.solve(&self.pose_cov).transpose();
        let ks = spread.solve(&self.cross_cov).transpose();
        self.pose += kp * off;
        self.scale += ks * off;
        // Joseph form: (I − K H) Cov (I − K H)ᵀ + K R Kᵀ.
        let rest = Matrix3::identity() - kp;
        let kc = ks * self.cross_cov;
        self.scale_cov =
            symmetric(&(self.scale_cov + ks * (self.pose_cov + r) * ks.transpose() - kc - kc.transpose()));
        self.cross_cov = rest * (self.cross_cov - self.pose_cov * ks.transpose()) + kp * r * ks.transpose();
        self.pose_cov = symmetric(&(rest * self.pose_cov * rest.transpose() + kp * r * kp.transpose()));
        true
    }
}
