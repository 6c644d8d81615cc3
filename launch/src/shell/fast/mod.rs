//! Thousands of in-process runs at once, for tuning: the same robot on the same path with other gains and limits.
//!
//! ```text
//!  candidates ──▶ queue ──▶ lanes of a core   ┌─ control period ───────────────────────────┐
//!   (any number)            (side by side in  │ selector (8), law (5) (7), constraints (9)–(24) │ once
//!                            vectors, refilled│ pulses (25)–(29), estimate (30) (31),           │ every
//!  figures ◀── index ◀───── as they arrive)   │ the true robot, figures                        │ tick
//!                                             └─────────────────────────────────────────────┘
//! ```
//!
//! What it computes is what [`super::in_process`] computes: the formulas are the boxes' own functions, taken in
//! the same order, so that commands, pulses and the estimated pose have the same bits. What it leaves out is what
//! cannot happen here: messages, authority, lost ticks, wheels that wait for a driver. The figures are sums of the
//! same terms, the true pose is the same to rounding.
//!
//! It knows paper 1's robot only: two wheels on steppers that need no time, dead reckoning, Kanayama's law on
//! straight lines, no acceleration limits, and slip that does not vary. [`FastPath::of`] says what is different;
//! then there is [`super::in_process::InProcess`].

mod applies;
mod lanes;
mod sine;

use crate::config::System;
use hilare_controller::kanayama::{KanayamaGains, SPEC};
use hilare_interfaces::block::Tick;
use hilare_interfaces::chassis::DifferentialParams;
use hilare_interfaces::geometry::{WorldPoint, WorldPose};
use hilare_interfaces::params::ParamGroup;
use hilare_plant::stepper_drive::Steady;
use hilare_pose_estimator::dead_reckoning::DeadReckoning;
use hilare_recorder::statistics::Line;
use hilare_step_generator::limits::Limits;
use hilare_waypoint_selector::Tracking;
use lanes::{Lanes, TICKS};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// Runs side by side in one thread: two vectors of the widest there are, so that one's latency is the other's time.
const LANES: usize = 16;

/// What differs from run to run: the gains and limits of the paper's search, table 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// k1, k2, k3.
    pub gains: KanayamaGains,
    /// v_max, m/s.
    pub v_max_mps: f64,
    /// ω_max, rad/s.
    pub omega_max_radps: f64,
}

impl Candidate {
    /// The keys of a system file whose values it has.
    pub const KEYS: [&str; 5] = [
        "controller.kanayama.k1_per_s",
        "controller.kanayama.k2_per_m2",
        "controller.kanayama.k3_per_m",
        "limits.v_max_mps",
        "limits.omega_max_radps",
    ];

    /// The values a system has.
    pub fn of(system: &System) -> Self {
        let mut gains = KanayamaGains::default();
        for (name, value) in system.controller.values_of(SPEC.name) {
            // A system's values are checked already.
            let _ = gains.set(name, value);
        }
        Self { gains, v_max_mps: system.limits.v_max_mps, omega_max_radps: system.limits.omega_max_radps }
    }

    /// The keys and values that make a system drive like this, for [`System::set_all`]: to the bit.
    pub fn keys(&self) -> [String; 5] {
        let gains = self.gains;
        let values = [gains.k1_per_s, gains.k2_per_m2, gains.k3_per_m, self.v_max_mps, self.omega_max_radps];
        std::array::from_fn(|n| format!("{}={}", Self::KEYS[n], values[n]))
    }
}

/// What a run came to: as [`hilare_recorder::statistics::RunFigures`], where they have the same name.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FastFigures {
    /// The last waypoint was accepted.
    pub reached: bool,
    /// Ticks executed until then (or in all).
    pub ticks: Tick,
    /// Steps of the right and the left wheel.
    pub steps: [i64; 2],
    /// Estimated pose at the end.
    pub final_pose: WorldPose,
    /// True pose at the end.
    pub final_truth: WorldPose,
    /// Mean distance of the truth to the tracked line, m.
    pub cross_track_mean_m: f64,
    /// Greatest such distance, m.
    pub cross_track_max_m: f64,
    /// Mean |v − v_r| of the commanded speed after the constraints, m/s.
    pub speed_error_mean_mps: f64,
    /// By how much of the motors' range the command changes, after the constraints, 1/s.
    pub effort_per_s: f64,
    /// Number of the waypoint it drove to last.
    pub waypoint: u64,
}

/// A segment of the path, worked out.
#[derive(Clone, Copy, Debug)]
struct Leg {
    target: WorldPoint,
    heading_rad: f64,
    line: Line,
}

/// A robot and a path, ready for any number of candidates.
#[derive(Clone, Debug)]
pub struct FastPath {
    period_ticks: u64,
    chassis: DifferentialParams,
    /// But for what a [`Candidate`] says.
    limits: Limits,
    tracking: Tracking,
    reckoning: DeadReckoning,
    start: WorldPose,
    /// Wheel angle of a step, rad.
    step_rad: f64,
    /// Highest wheel speed the pulses can carry, rad/s, if any that passes the constraints is above.
    pulse_speed_max_radps: Option<f64>,
    robot: Steady,
    /// Of a robot that is as believed: s steps, of both wheels together, lead s·([0] + [1]·s²) along the sum of the
    /// directions before and after, m.
    share_m: Option<[f64; 2]>,
    legs: Vec<Leg>,
}

/// Candidates that wait, with the place for what comes of each.
type Queue<'a> = Mutex<std::iter::Zip<std::slice::Iter<'a, Candidate>, std::slice::IterMut<'a, FastFigures>>>;

impl FastPath {
    /// What each candidate comes to, in their order, on all cores. A run that has not arrived ends after
    /// `ticks_max`, rounded up to whole control periods.
    pub fn evaluate(&self, candidates: &[Candidate], ticks_max: Tick) -> Vec<FastFigures> {
        let threads = thread::available_parallelism().map_or(1, usize::from);
        let mut figures = vec![FastFigures::default(); candidates.len()];
        self.evaluate_with(threads, candidates, ticks_max, &mut figures);
        figures
    }

    /// The same on so many threads, into a place for each candidate; which thread a candidate meets, and beside
    /// whom, makes no difference. With one it is the caller's, and nothing is allocated.
    pub fn evaluate_with(
        &self,
        threads: usize,
        candidates: &[Candidate],
        ticks_max: Tick,
        figures: &mut [FastFigures],
    ) {
        let periods_max = ticks_max.div_ceil(self.period_ticks);
        let queue = Mutex::new(candidates.iter().zip(figures));
        if threads <= 1 {
            return self.work(&queue, periods_max);
        }
        thread::scope(|scope| {
            // No more than there is to do.
            for _ in 0..threads.min(candidates.len()) {
                scope.spawn(|| self.work(&queue, periods_max));
            }
        });
    }

    /// One thread's share, with the widest vectors this processor has.
    #[cfg_attr(target_arch = "x86_64", allow(unsafe_code, reason = "a function for some processors only"))]
    fn work(&self, queue: &Queue<'_>, periods_max: u64) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            if has!("avx512f") && has!("avx512dq") && has!("avx512vl") {
                // SAFETY: the processor has what the function needs.
                return unsafe { self.work_with_avx512(queue, periods_max) };
            }
            if has!("avx2") {
                // SAFETY: as above.
                return unsafe { self.work_with_avx2(queue, periods_max) };
            }
        }
        self.drive::<LANES>(queue, periods_max);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq,avx512vl")]
    fn work_with_avx512(&self, queue: &Queue<'_>, periods_max: u64) {
        self.drive::<LANES>(queue, periods_max);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn work_with_avx2(&self, queue: &Queue<'_>, periods_max: u64) {
        self.drive::<LANES>(queue, periods_max);
    }

    /// Drives `N` candidates at a time until none is left.
    #[inline(always)]
    fn drive<const N: usize>(&self, queue: &Queue<'_>, periods_max: u64) {
        let mut lanes = Lanes::<N>::new(self);
        let mut places: [Option<&mut FastFigures>; N] = [const { None }; N];
        for (lane, place) in places.iter_mut().enumerate() {
            *place = self.take_up(&mut lanes, lane, queue, periods_max);
        }
        while places.iter().any(Option::is_some) {
            lanes.command(self);
            for _ in 0..self.period_ticks / TICKS as u64 {
                lanes.run::<TICKS>(self);
            }
            for _ in 0..self.period_ticks % TICKS as u64 {
                lanes.run::<1>(self);
            }
            if !lanes.close_period(self, periods_max) {
                continue;
            }
            for (lane, place) in places.iter_mut().enumerate() {
                let Some(figures) = place else { continue };
                if let Some(reached) = lanes.select(self, lane, periods_max) {
                    **figures = lanes.figures(self, lane, reached);
                    *place = self.take_up(&mut lanes, lane, queue, periods_max);
                }
            }
        }
    }

    /// The next candidate that has a way to go; what need not even start is finished here.
    fn take_up<'a, const N: usize>(
        &self,
        lanes: &mut Lanes<N>,
        lane: usize,
        queue: &Queue<'a>,
        periods_max: u64,
    ) -> Option<&'a mut FastFigures> {
        loop {
            let (candidate, place) = queue.lock().unwrap_or_else(PoisonError::into_inner).next()?;
            lanes.start(self, lane, candidate);
            match lanes.select(self, lane, periods_max) {
                None => return Some(place),
                Some(reached) => *place = lanes.figures(self, lane, reached),
            }
        }
    }
}
