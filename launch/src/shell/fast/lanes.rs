//! Runs side by side: lane by lane the same operations, so that the compiler makes vectors of them.
//!
//! Loops over lanes call no function that cannot be inlined and take no branch; where there is something to decide
//! that happens seldom (a waypoint near, a sine libm has to be asked for), the loop only notes it.
#![allow(clippy::needless_range_loop, reason = "a lane is one place in many rows")]

use super::parts::{Beat, Drive, Row, TruthSoFar, tan_share};
use super::{Candidate, FastFigures, FastPath, Leg, sine};
use hilare_controller::kanayama::KanayamaGains;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::geometry::{
    WRAPPED_ONCE_RAD, WorldPoint, WorldPose, seen_along, wrap_angle_rad, wrap_once_rad,
};
use hilare_recorder::statistics::Line;
use hilare_step_generator::limits::Limits;
use hilare_step_generator::pulses;

/// Ticks worked on together: the paper's control period.
pub const TICKS: usize = 5;

/// So much farther than the acceptance radius the square of a distance is certain to be outside, relative.
const NEAR: f64 = 1.0 + 1e-9;

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
            twist: [zero; 2],
            speed_error_mps: zero,
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

    /// The controller at the start of a period: the command of the last one acts, that of this pose is to come.
    #[inline(always)]
    pub fn command(&mut self, path: &FastPath) {
        for lane in 0..N {
            let [dv, domega] =
                [0, 1].map(|part| self.coming.twist[part][lane] - self.acting.twist[part][lane]);
            self.effort_sum[lane] += path.chassis.motor_use(dv, domega);
        }
        self.acting = self.coming;
        let v_r = path.tracking.speed_mps;
        let mut heading_error = [0.0; N];
        let mut wrapped = true;
        for lane in 0..N {
            let error = self.target_heading_rad[lane] - self.theta_rad[lane];
            wrapped &= error.abs() < WRAPPED_ONCE_RAD;
            heading_error[lane] = wrap_once_rad(error);
        }
        if !wrapped {
            for lane in 0..N {
                heading_error[lane] = wrap_angle_rad(self.target_heading_rad[lane] - self.theta_rad[lane]);
            }
        }
        let [sin, cos] = sine::of(&heading_error);
        let mut speeds_radps = [[0.0; N]; 2];
        for lane in 0..N {
            let [k1_per_s, k2_per_m2, k3_per_m] = [0, 1, 2].map(|gain| self.gains[gain][lane]);
            let gains = KanayamaGains { k1_per_s, k2_per_m2, k3_per_m };
            let robot = WorldPoint::new(self.x_m[lane], self.y_m[lane]);
            let target = WorldPoint::new(self.target[0][lane], self.target[1][lane]);
            let error = seen_along((self.sin[lane], self.cos[lane]), robot, target);
            let (vx, omega) = gains.answer(error, (sin[lane], cos[lane]), (v_r, 0.0));
            let limits = Limits {
                v_max_mps: self.v_max_mps[lane],
                omega_max_radps: self.omega_max_radps[lane],
                ..path.limits
            };
            let [vx, omega] = limits.constrain_differential(&path.chassis, vx, omega);
            [speeds_radps[0][lane], speeds_radps[1][lane]] = path.chassis.wheel_speeds(vx, omega);
            self.coming.speed_error_mps[lane] = (vx - v_r).abs();
            (self.coming.twist[0][lane], self.coming.twist[1][lane]) = (vx, omega);
        }
        if let Some(most_radps) = path.pulse_speed_max_radps {
            for lane in 0..N {
                let speeds = [speeds_radps[0][lane], speeds_radps[1][lane]];
                [speeds_radps[0][lane], speeds_radps[1][lane]] = pulses::within(most_radps, speeds);
            }
        }
        let coming = &mut self.coming;
        for lane in 0..N {
            let (right, left) = (speeds_radps[0][lane], speeds_radps[1][lane]);
            // [MH18] (26)
            coming.per_tick_rad[0][lane] = right * TICK_S;
            coming.per_tick_rad[1][lane] = left * TICK_S;
            let stands = (right == 0.0) & (left == 0.0);
            coming.act_from_rad[lane] = if stands { f64::INFINITY } else { path.step_rad };
        }
    }

    /// `T` ticks of all lanes. Each loop does one thing for all of them, and is short: so a processor finds enough in
    /// it to do at a time, and what goes on from tick to tick stays in its registers.
    #[inline(always)]
    pub fn run<const T: usize>(&mut self, path: &FastPath) {
        // On the stack, and not a part of the lanes: the compiler has to see that the one is not the other.
        let mut beats = [Beat::BLANK; T];
        self.pulse(path, &mut beats);
        for beat in &mut beats {
            [beat.sin, beat.cos] = sine::of(&beat.theta_rad);
        }
        match path.share_m {
            Some(share_m) => self.roll_as_believed(share_m, &beats),
            None => self.roll(path, &beats),
        }
        self.reckon(path, &beats);
    }

    /// The step generator's part, and the headings that come of it.
    #[inline(always)]
    fn pulse<const T: usize>(&mut self, path: &FastPath, beats: &mut [Beat<N>; T]) {
        for lane in 0..N {
            let act_from = self.acting.act_from_rad[lane];
            let per_tick = [self.acting.per_tick_rad[0][lane], self.acting.per_tick_rad[1][lane]];
            let mut owed = [self.owed_rad[0][lane], self.owed_rad[1][lane]];
            let mut counts = [self.counts[0][lane], self.counts[1][lane]];
            for beat in &mut *beats {
                for wheel in 0..2 {
                    // [MH18] (27)–(29)
                    let angle = owed[wheel] + per_tick[wheel];
                    let forward = if angle >= act_from { 1.0 } else { 0.0 };
                    let step = if angle <= -act_from { -1.0 } else { forward };
                    owed[wheel] = angle - path.step_rad * step;
                    counts[wheel] += step;
                    beat.steps[wheel][lane] = step;
                }
                beat.theta_rad[lane] = path.reckoning.heading_rad(counts);
            }
            [self.owed_rad[0][lane], self.owed_rad[1][lane]] = owed;
            [self.counts[0][lane], self.counts[1][lane]] = counts;
        }
    }

    /// The pose estimator's part.
    #[inline(always)]
    fn reckon<const T: usize>(&mut self, path: &FastPath, beats: &[Beat<N>; T]) {
        // A step of both wheels is twice as far, to the bit, and one of each sign nowhere.
        let ahead_m = path.reckoning.moved([1.0, 0.0, 0.0, 0.0]).vx_mps;
        for lane in 0..N {
            let (mut x_m, mut y_m) = (self.x_m[lane], self.y_m[lane]);
            let (mut sin, mut cos) = (self.sin[lane], self.cos[lane]);
            for beat in beats {
                // [MH18] (30), (31), by the heading before the tick.
                let moved_m = ahead_m * (beat.steps[0][lane] + beat.steps[1][lane]);
                x_m += moved_m * cos;
                y_m += moved_m * sin;
                (sin, cos) = (beat.sin[lane], beat.cos[lane]);
            }
            (self.x_m[lane], self.y_m[lane]) = (x_m, y_m);
            (self.sin[lane], self.cos[lane]) = (sin, cos);
            self.theta_rad[lane] = beats[T - 1].theta_rad[lane];
        }
    }

    /// The true robot where it is as the estimator believes it is: but for that, as [`Self::roll`].
    #[inline(always)]
    fn roll_as_believed<const T: usize>(&mut self, [once, thrice]: [f64; 2], beats: &[Beat<N>; T]) {
        for lane in 0..N {
            let mut truth = self.truth(lane);
            let (mut sin, mut cos) = (self.sin[lane], self.cos[lane]);
            for beat in beats {
                let steps = beat.steps[0][lane] + beat.steps[1][lane];
                let share_m = steps * (once + thrice * (steps * steps));
                let (sin_after, cos_after) = (beat.sin[lane], beat.cos[lane]);
                truth.go(share_m * (cos + cos_after), share_m * (sin + sin_after));
                (sin, cos) = (sin_after, cos_after);
            }
            self.put_truth(lane, truth);
        }
    }

    /// The true robot's arcs, and how far from the line they are. The chord of an arc points half-way between the
    /// headings at its ends: along the sum of their directions, by (s_R + s_L)/2 · tan(h)/(2h), h half the turn.
    #[inline(always)]
    fn roll<const T: usize>(&mut self, path: &FastPath, beats: &[Beat<N>; T]) {
        let [right_m, left_m] = path.robot.rolled_m;
        let [right_rad, left_rad] = path.robot.rolled_m.map(|rolled_m| rolled_m / path.robot.track_m);
        for lane in 0..N {
            let mut truth = self.truth(lane);
            let (mut sin, mut cos) = (self.true_sin[lane], self.true_cos[lane]);
            for beat in beats {
                let (right, left) = (beat.steps[0][lane], beat.steps[1][lane]);
                let turn = right * right_rad - left * left_rad;
                let square = turn * turn;
                let s = turn * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)));
                let c = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)));
                let (sin_after, cos_after) = (sin * c + cos * s, cos * c - sin * s);
                let share_m = (right * right_m + left * left_m) * tan_share(square);
                truth.go(share_m * (cos + cos_after), share_m * (sin + sin_after));
                (sin, cos) = (sin_after, cos_after);
            }
            (self.true_sin[lane], self.true_cos[lane]) = (sin, cos);
            self.put_truth(lane, truth);
        }
    }

    #[inline(always)]
    fn truth(&self, lane: usize) -> TruthSoFar {
        TruthSoFar {
            place: WorldPoint::new(self.true_x_m[lane], self.true_y_m[lane]),
            line: Line {
                normal: (self.normal[0][lane], self.normal[1][lane]),
                offset_m: self.offset_m[lane],
            },
            cross_track_sum_m: self.cross_track_sum_m[lane],
            cross_track_max_m: self.cross_track_max_m[lane],
        }
    }

    #[inline(always)]
    fn put_truth(&mut self, lane: usize, truth: TruthSoFar) {
        (self.true_x_m[lane], self.true_y_m[lane]) = (truth.place.x_m, truth.place.y_m);
        self.cross_track_sum_m[lane] = truth.cross_track_sum_m;
        self.cross_track_max_m[lane] = truth.cross_track_max_m;
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
