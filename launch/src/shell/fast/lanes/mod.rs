//! Runs side by side: lane by lane the same operations, so that the compiler makes vectors of them.
//!
//! Loops over lanes call no function that cannot be inlined and take no branch; where there is something to decide
//! that happens seldom (a waypoint near, a sine libm has to be asked for), the loop only notes it. Here is how a run
//! begins, goes on and ends; [`period`] has what all of them do in a period, [`truth`] where that leads.
#![allow(clippy::needless_range_loop, reason = "a lane is one place in many rows")]

mod period;
pub mod truth;

use super::{Candidate, FastFigures, FastPath, Leg};
use hilare_controller::kanayama::KanayamaGains;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::geometry::{WorldPoint, WorldPose};

/// Ticks worked on together: the paper's control period.
pub const TICKS: usize = 5;

/// So much farther than the acceptance radius the square of a distance is certain to be outside, relative.
const NEAR: f64 = 1.0 + 1e-9;

/// A value a lane.
type Row<const N: usize> = [f64; N];

/// Wheel speeds of a command as the pulses take them.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Drive<const N: usize> {
    /// Δθ of right and left, rad.
    per_tick_rad: [Row<N>; 2],
    /// Owed angle from which on there is a pulse: none for a robot that is to stand, rad.
    act_from_rad: Row<N>,
    /// v, m/s, and ω, rad/s.
    twist: [Row<N>; 2],
    /// |v − v_r|, m/s.
    speed_error_mps: Row<N>,
}

/// What is found out about a tick of all lanes before the poses go on.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Beat<const N: usize> {
    /// Of right and left: −1, 0 or 1.
    steps: [Row<N>; 2],
    theta_rad: Row<N>,
    sin: Row<N>,
    cos: Row<N>,
}

impl<const N: usize> Beat<N> {
    const BLANK: Self = Self { steps: [[0.0; N]; 2], theta_rad: [0.0; N], sin: [0.0; N], cos: [0.0; N] };
}

/// `N` runs.
#[repr(align(64))]
pub struct Lanes<const N: usize> {
    gains: [Row<N>; 3],
    v_max_mps: Row<N>,
    omega_max_radps: Row<N>,

    /// Which leg, and its parts.
    index: [usize; N],
    target: [Row<N>; 2],
    target_heading_rad: Row<N>,
    normal: [Row<N>; 2],
    offset_m: Row<N>,

    periods: [u64; N],
    /// What acts in the period, and what will in the next.
    acting: Drive<N>,
    coming: Drive<N>,
    owed_rad: [Row<N>; 2],
    counts: [Row<N>; 2],

    x_m: Row<N>,
    y_m: Row<N>,
    theta_rad: Row<N>,
    sin: Row<N>,
    cos: Row<N>,

    true_x_m: Row<N>,
    true_y_m: Row<N>,
    true_sin: Row<N>,
    true_cos: Row<N>,

    cross_track_sum_m: Row<N>,
    cross_track_max_m: Row<N>,
    speed_error_sum_mps: Row<N>,
    effort_sum: Row<N>,
}

impl<const N: usize> Lanes<N> {
    /// Robots at the start that nobody waits for; they drive, so that a lane without a candidate is like any other.
    pub fn new(path: &FastPath) -> Self {
        let zero = [0.0; N];
        let still = Drive {
            per_tick_rad: [zero; 2],
            act_from_rad: [f64::INFINITY; N],
            speed_error_mps: zero,
            twist: [zero; 2],
        };
        let mut lanes = Self {
            gains: [zero; 3],
            v_max_mps: zero,
            omega_max_radps: zero,
            index: [0; N],
            target: [zero; 2],
            target_heading_rad: zero,
            normal: [zero; 2],
            offset_m: zero,
            periods: [0; N],
            acting: still,
            coming: still,
            owed_rad: [zero; 2],
            counts: [zero; 2],
            x_m: zero,
            y_m: zero,
            theta_rad: zero,
            sin: zero,
            cos: zero,
            true_x_m: zero,
            true_y_m: zero,
            true_sin: zero,
            true_cos: zero,
            cross_track_sum_m: zero,
            cross_track_max_m: zero,
            speed_error_sum_mps: zero,
            effort_sum: zero,
        };
        let candidate = Candidate { gains: KanayamaGains::default(), v_max_mps: 0.0, omega_max_radps: 0.0 };
        (0..N).for_each(|lane| lanes.start(path, lane, &candidate));
        lanes
    }

    /// A robot at the start, standing, for one candidate.
    pub fn start(&mut self, path: &FastPath, lane: usize, candidate: &Candidate) {
        let gains = candidate.gains;
        for (row, gain) in self.gains.iter_mut().zip([gains.k1_per_s, gains.k2_per_m2, gains.k3_per_m]) {
            row[lane] = gain;
        }
        self.v_max_mps[lane] = candidate.v_max_mps;
        self.omega_max_radps[lane] = candidate.omega_max_radps;
        self.point_at(path, lane, 0);
        self.periods[lane] = 0;
        for wheel in 0..2 {
            self.owed_rad[wheel][lane] = 0.0;
            self.counts[wheel][lane] = 0.0;
            self.coming.per_tick_rad[wheel][lane] = 0.0;
        }
        // The command of the first pose acts from the second period on.
        self.coming.act_from_rad[lane] = f64::INFINITY;
        self.coming.speed_error_mps[lane] = path.tracking.speed_mps.abs();
        // Nothing acted before.
        for drive in [&mut self.acting, &mut self.coming] {
            (drive.twist[0][lane], drive.twist[1][lane]) = (0.0, 0.0);
        }
        let (start, truth) = (path.start, path.robot.pose);
        (self.x_m[lane], self.y_m[lane], self.theta_rad[lane]) = (start.x_m, start.y_m, start.theta_rad);
        (self.sin[lane], self.cos[lane]) = libm::sincos(start.theta_rad);
        (self.true_x_m[lane], self.true_y_m[lane]) = (truth.x_m, truth.y_m);
        (self.true_sin[lane], self.true_cos[lane]) = libm::sincos(truth.theta_rad);
        self.cross_track_sum_m[lane] = 0.0;
        self.cross_track_max_m[lane] = 0.0;
        self.speed_error_sum_mps[lane] = 0.0;
        self.effort_sum[lane] = 0.0;
    }

    fn point_at(&mut self, path: &FastPath, lane: usize, index: usize) {
        let Leg { target, heading_rad, line } = path.legs[index];
        self.index[lane] = index;
        (self.target[0][lane], self.target[1][lane]) = (target.x_m, target.y_m);
        self.target_heading_rad[lane] = heading_rad;
        (self.normal[0][lane], self.normal[1][lane]) = line.normal;
        self.offset_m[lane] = line.offset_m;
        // Rounding of the true heading does not add up over more than a leg.
        let truth = self.true_heading_rad(path, lane);
        (self.true_sin[lane], self.true_cos[lane]) = libm::sincos(truth);
    }

    fn true_heading_rad(&self, path: &FastPath, lane: usize) -> f64 {
        let [right, left] = path.robot.rolled_m;
        let turned = (self.counts[0][lane] * right - self.counts[1][lane] * left) / path.robot.track_m;
        path.robot.pose.theta_rad + turned
    }

    /// The waypoint selector at the start of a period, [MH18] (8). What the run has come to, if it ends here: true
    /// for an arrival.
    pub fn select(&mut self, path: &FastPath, lane: usize, periods_max: u64) -> Option<bool> {
        if self.periods[lane] >= periods_max {
            return Some(false);
        }
        let robot = WorldPoint::new(self.x_m[lane], self.y_m[lane]);
        let Leg { target, .. } = path.legs[self.index[lane]];
        if robot.distance_m(target) <= path.tracking.acceptance_radius_m {
            let next = self.index[lane] + 1;
            if next == path.legs.len() {
                return Some(true);
            }
            self.point_at(path, lane, next);
        }
        None
    }

    /// Takes note of a period; true if any lane has to be looked at with [`Self::select`] before the next.
    #[inline(always)]
    pub fn close_period(&mut self, path: &FastPath, periods_max: u64) -> bool {
        let (radius_m, period) = (path.tracking.acceptance_radius_m, path.period_ticks as f64);
        let mut any = false;
        for lane in 0..N {
            self.speed_error_sum_mps[lane] += self.acting.speed_error_mps[lane] * period;
            let dx = self.target[0][lane] - self.x_m[lane];
            let dy = self.target[1][lane] - self.y_m[lane];
            any |= dx * dx + dy * dy <= radius_m * radius_m * NEAR;
        }
        for periods in &mut self.periods {
            *periods += 1;
            any |= *periods >= periods_max;
        }
        any
    }

    /// What a run has come to by now.
    pub fn figures(&self, path: &FastPath, lane: usize, reached: bool) -> FastFigures {
        let ticks = self.periods[lane] * path.period_ticks;
        let mean = |sum: f64| if ticks == 0 { 0.0 } else { sum / ticks as f64 };
        FastFigures {
            reached,
            ticks,
            steps: [self.counts[0][lane] as i64, self.counts[1][lane] as i64],
            final_pose: WorldPose::new(self.x_m[lane], self.y_m[lane], self.theta_rad[lane]),
            final_truth: WorldPose::new(
                self.true_x_m[lane],
                self.true_y_m[lane],
                self.true_heading_rad(path, lane),
            ),
            cross_track_mean_m: mean(self.cross_track_sum_m[lane]),
            cross_track_max_m: self.cross_track_max_m[lane],
            speed_error_mean_mps: mean(self.speed_error_sum_mps[lane]),
            effort_per_s: self.effort_sum[lane] / (ticks.max(1) as f64 * TICK_S),
            waypoint: self.index[lane] as u64 + 1,
        }
    }
}
