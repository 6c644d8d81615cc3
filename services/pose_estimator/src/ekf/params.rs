//! What the filter is told of the robot and of the camera.

use hilare_interfaces::param_group;
use hilare_interfaces::state::STATE_WORDS;

/// Longest history: a tick of it is a word of the state, and the filter itself has some hundred.
pub const HISTORY_TICKS_MAX: u64 = STATE_WORDS as u64 * 15 / 16;

param_group! {
    /// The extended Kalman filter: what it may believe of odometry and camera. A standard deviation (sd) of 0
    /// says that a thing is known exactly.
    EkfParams {
        /// Sd of a fix, each of x and y.
        camera_sd_m: f64 = 0.001, "m", 1e-6, 1.0;
        /// Sd of the heading of a fix.
        camera_sd_rad: f64 = 0.005, "rad", 1e-6, 1.0;
        /// Sd of the assumed start, each of x and y.
        start_sd_m: f64 = 0.02, "m", 0.0, 10.0;
        /// Sd of the assumed start heading.
        start_sd_rad: f64 = 0.1, "rad", 0.0, 3.2;
        /// Sd of the relative error of the way forward: mean slip, wheel size.
        forward_scale_sd: f64 = 0.05, "", 0.0, 0.5;
        /// Sd of the relative difference of the right wheel to the left (differential drive).
        wheel_difference_sd: f64 = 0.01, "", 0.0, 0.5;
        /// Sd of the relative error of the way sideways (Mecanum).
        sideways_scale_sd: f64 = 0.1, "", 0.0, 0.5;
        /// Sd of the relative error of a turn: track, slip of turning wheels.
        yaw_scale_sd: f64 = 0.03, "", 0.0, 0.5;
        /// Sd by which each of these relative errors wanders while the robot travels a metre; grows
        /// with the root of the way.
        scale_drift: f64 = 0.002, "1/sqrt(m)", 0.0, 0.5;
        /// Sd of what a wheel's rim travels besides, after a metre; grows with the root of the way.
        slip_noise: f64 = 0.0003, "m/sqrt(m)", 0.0, 0.1;
        /// A fix that is this many sd off (Mahalanobis, 3 degrees of freedom) is an outlier.
        gate_sd: f64 = 5.0, "", 1.0, 100.0;
        /// So many outliers in a row that agree with one another restart the filter where they say.
        restart_after: u64 = 5, "", 2, 1000;
        /// Ticks of odometry that are kept; a fix of an older picture cannot be used.
        history_ticks: u64 = 2048, "ticks", 2, HISTORY_TICKS_MAX;
    }
}
