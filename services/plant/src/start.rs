//! Where a robot really starts.

use crate::noise::Noise;
use hilare_interfaces::geometry::WorldPose;

/// How far the true start lies from the one the control path assumes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StartErrors {
    /// Along world x, m.
    pub x_m: f64,
    /// Along world y, m.
    pub y_m: f64,
    /// Heading, rad.
    pub theta_rad: f64,
    /// Standard deviation of a random error on top, each of x and y, m.
    pub sd_m: f64,
    /// Standard deviation of a random heading error on top, rad.
    pub sd_rad: f64,
}

impl StartErrors {
    /// The true start for an assumed one.
    pub fn displaced(&self, start: WorldPose, noise: &mut Noise) -> WorldPose {
        let mut off = |fixed: f64, sd: f64| if sd > 0.0 { fixed + sd * noise.normal() } else { fixed };
        WorldPose::new(
            start.x_m + off(self.x_m, self.sd_m),
            start.y_m + off(self.y_m, self.sd_m),
            start.theta_rad + off(self.theta_rad, self.sd_rad),
        )
    }
}

/// The start errors of a parameter group: the same five keys in each.
macro_rules! start_errors {
    ($params:expr) => {
        $crate::start::StartErrors {
            x_m: $params.start_error_x_m,
            y_m: $params.start_error_y_m,
            theta_rad: $params.start_error_theta_rad,
            sd_m: $params.start_sd_m,
            sd_rad: $params.start_sd_rad,
        }
    };
}
pub(crate) use start_errors;
