//! What a tick consists of, side by side.

use hilare_interfaces::geometry::WorldPoint;
use hilare_recorder::statistics::Line;

/// A value a lane.
pub type Row<const N: usize> = [f64; N];

/// Wheel speeds of a command as the pulses take them.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Drive<const N: usize> {
    /// Δθ of right and left, rad.
    pub per_tick_rad: [Row<N>; 2],
    /// Owed angle from which on there is a pulse: none for a robot that is to stand, rad.
    pub act_from_rad: Row<N>,
    /// v, m/s, and ω, rad/s.
    pub twist: [Row<N>; 2],
    /// |v − v_r|, m/s.
    pub speed_error_mps: Row<N>,
}

/// What is found out about a tick of all lanes before the poses go on.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Beat<const N: usize> {
    /// Of right and left: −1, 0 or 1.
    pub steps: [Row<N>; 2],
    pub theta_rad: Row<N>,
    pub sin: Row<N>,
    pub cos: Row<N>,
}

impl<const N: usize> Beat<N> {
    /// Nothing yet.
    pub const BLANK: Self = Self { steps: [[0.0; N]; 2], theta_rad: [0.0; N], sin: [0.0; N], cos: [0.0; N] };
}

/// Where a robot really is, and its cross-track errors.
#[derive(Clone, Copy)]
pub struct TruthSoFar {
    pub place: WorldPoint,
    pub line: Line,
    pub cross_track_sum_m: f64,
    pub cross_track_max_m: f64,
}

impl TruthSoFar {
    /// A tick in which it moves by this, m.
    #[inline(always)]
    pub fn go(&mut self, dx_m: f64, dy_m: f64) {
        self.place = WorldPoint::new(self.place.x_m + dx_m, self.place.y_m + dy_m);
        let cross_track_m = self.line.distance_m(self.place);
        self.cross_track_sum_m += cross_track_m;
        if cross_track_m > self.cross_track_max_m {
            self.cross_track_max_m = cross_track_m;
        }
    }
}

/// tan(h)/(4h) for a turn of 2h, given its square, rad².
#[inline(always)]
pub fn tan_share(square: f64) -> f64 {
    0.25 + square * (1.0 / 48.0 + square * (1.0 / 480.0))
}
