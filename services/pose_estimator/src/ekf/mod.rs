//! Odometry and late fixes fused: an extended Kalman filter that lives at the tick of the picture.
//!
//! ```text
//!        filter (pose, scale errors, covariance)                       present pose
//!   ───────●━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━●────▶ ticks
//!     captured_tick          counts of every tick since, in a ring       now
//! ```
//!
//! A fix says where the robot was some ticks ago. The filter is led there through the counts in the
//! ring, takes the fix in where it belongs, and its pose is carried forward through the counts since:
//! the delay is no approximation. Between fixes a tick costs one arc. With the scale errors (mean slip,
//! unequal wheels, track) it learns what the fixes show of the odometry, so that the way carried
//! forward is right too.
//!
//! A fix that is out of the gate is an outlier: the pose does not move. But it starts a rival belief,
//! and if the next fixes agree with the rival and not with the filter, `restart_after` of them in a
//! row, the rival takes over. So a robot that was carried away, or did not start where it was thought
//! to, is found again, and a single wild fix, or a row of them that contradict each other, does nothing.
//!
//! The pose steps at a fix by what is learnt from it. It is not smoothed, since smoothing is a delay, and
//! need not be: once the filter has settled, the default camera (1 mm) moves it by some hundredths of a
//! millimetre, a fraction of a motor step.

pub mod filter;
pub mod history;
pub mod motion;
pub mod params;

use crate::EstimatorSetup;
use filter::{Belief, Measurement, prior_scale_cov};
use hilare_interfaces::block::Tick;
use hilare_interfaces::chassis::{MAX_WHEELS, PerWheel};
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::messages::PoseFix;
use hilare_interfaces::state::{StateWords, Stateful};
use history::{Counted, History};
use motion::{Motion, arc};
use nalgebra::{Matrix3, Vector3};
use params::EkfParams;

/// What became of the fixes so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixCounts {
    /// Taken in.
    pub used: u64,
    /// Out of the gate.
    pub outliers: u64,
    /// They make no sense: not finite, or off the earth.
    pub invalid: u64,
    /// Their time of use or of the picture is still to come.
    pub early: u64,
    /// Repeated, out of order, or their picture is older than the odometry kept.
    pub late: u64,
    /// Times that outliers which agreed with one another restarted the filter.
    pub restarts: u64,
}

/// Another belief, made of outliers.
#[derive(Clone, Debug)]
struct Rival {
    belief: Belief,
    /// Fixes in a row that agree with it.
    agreed: u64,
}

impl Stateful for Rival {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.belief.visit_state(words);
        words.word(&mut self.agreed);
    }
}

/// The estimator.
#[derive(Clone, Debug)]
pub struct Ekf {
    params: EkfParams,
    motion: Motion,
    prior_scale_cov: Matrix3<f64>,
    /// At the base of the history, as is the rival.
    belief: Belief,
    rival: Option<Rival>,
    history: History,
    /// Displacement of one count of each wheel with the scale errors believed.
    per_count: [Vector3<f64>; MAX_WHEELS],
    /// Now.
    pose: Vector3<f64>,
    /// Picture of the newest fix that was looked at.
    captured: Option<Tick>,
    counts: FixCounts,
}

impl Ekf {
    /// At the assumed start. Allocates the ring of `history_ticks`; later nothing.
    pub fn new(setup: &EstimatorSetup, params: EkfParams) -> Self {
        let motion = Motion::new(&setup.chassis, setup.count_rad, &params);
        let prior_scale_cov = prior_scale_cov(&setup.chassis, &params);
        let start = Vector3::new(setup.start.x_m, setup.start.y_m, setup.start.theta_rad);
        let sd = Vector3::new(params.start_sd_m, params.start_sd_m, params.start_sd_rad);
        let belief = Belief::new(start, sd.map(|sd| sd * sd), Vector3::zeros(), prior_scale_cov);
        let per_count = motion.per_count(&belief.scale);
        Self {
            params,
            motion,
            prior_scale_cov,
            belief,
            rival: None,
            history: History::new(params.history_ticks),
            per_count,
            pose: start,
            captured: None,
            counts: FixCounts::default(),
        }
    }

    /// Goes on with what `before` knows, which has other parameters; what is believed stays.
    pub fn take_over(&mut self, before: &mut Self) {
        self.belief = before.belief;
        let most = self.params.restart_after - 1;
        self.rival = before.rival.take().map(|rival| Rival { agreed: rival.agreed.min(most), ..rival });
        self.history.take_over(&mut before.history);
        self.per_count = before.per_count;
        self.pose = before.pose;
        self.captured = before.captured;
        self.counts = before.counts;
    }

    /// The pose after the counts of tick `tick` and these fixes, the oldest first. A repeated or older
    /// tick adds no way.
    pub fn step(&mut self, tick: Tick, counts: &PerWheel<i64>, fixes: &[PoseFix]) -> WorldPose {
        let newest = self.history.newest();
        if tick > newest.tick {
            let counted = Counted { tick, counts: *counts };
            self.history.push(counted);
            self.pose = carry(self.pose, &newest.until(&counted), &self.per_count);
            self.advance(self.history.due());
        }
        let mut learnt = false;
        for fix in fixes {
            learnt |= self.take(fix);
        }
        if learnt {
            self.per_count = self.motion.per_count(&self.belief.scale);
            let per_count = &self.per_count;
            self.pose =
                self.history.moves().fold(self.belief.pose, |pose, moved| carry(pose, &moved, per_count));
        }
        WorldPose::new(self.pose.x, self.pose.y, self.pose.z)
    }

    /// What became of the fixes so far.
    pub fn fixes(&self) -> FixCounts {
        self.counts
    }

    /// What is believed of the tick of the newest picture.
    pub fn belief(&self) -> &Belief {
        &self.belief
    }

    /// What is believed of the present tick, covariance included. Not for the tick: it goes through the
    /// whole history.
    pub fn present(&self) -> Belief {
        let mut belief = self.belief;
        for moved in self.history.moves() {
            belief.predict(&self.motion.moved(&moved));
        }
        belief
    }

    /// Leads filter and rival to `tick`.
    fn advance(&mut self, tick: Tick) {
        while let Some(counts) = self.history.step_to(tick) {
            if counts == [0; MAX_WHEELS] {
                continue;
            }
            let moved = self.motion.moved(&counts);
            self.belief.predict(&moved);
            if let Some(rival) = &mut self.rival {
                rival.belief.predict(&moved);
            }
        }
    }

    /// Looks at a fix; true if it has changed what is believed.
    fn take(&mut self, fix: &PoseFix) -> bool {
        let now = self.history.newest().tick;
        if !fix.makes_sense() {
            self.counts.invalid += 1;
            return false;
        }
        if fix.tick > now || fix.captured_tick > now {
            self.counts.early += 1;
            return false;
        }
        if fix.captured_tick < self.history.base().tick
            || self.captured.is_some_and(|newest| fix.captured_tick <= newest)
        {
            self.counts.late += 1;
            return false;
        }
        self.captured = Some(fix.captured_tick);
        self.advance(fix.captured_tick);
        let (position, heading) = (self.params.camera_sd_m, self.params.camera_sd_rad);
        let measurement = Measurement {
            pose: Vector3::new(fix.x_m, fix.y_m, fix.theta_rad),
            variance: Vector3::new(position * position, position * position, heading * heading),
        };
        if self.belief.update(&measurement, self.params.gate_sd) {
            self.counts.used += 1;
            self.rival = None;
            return true;
        }
        self.counts.outliers += 1;
        self.outlier(&measurement)
    }

    /// Lets the rival answer for a fix the filter cannot; true if it has taken over.
    fn outlier(&mut self, fix: &Measurement) -> bool {
        let standing = self.rival.take().and_then(|mut rival| {
            let agrees = rival.belief.update(fix, self.params.gate_sd);
            agrees.then(|| Rival { agreed: rival.agreed + 1, ..rival })
        });
        let rival = standing.unwrap_or_else(|| {
            let mut pose = fix.pose;
            pose.z = self.belief.pose.z + wrap_angle_rad(fix.pose.z - self.belief.pose.z);
            // What was learnt of the wheels holds, but is no longer trusted.
            let belief = Belief::new(pose, fix.variance, self.belief.scale, self.prior_scale_cov);
            Rival { belief, agreed: 1 }
        });
        if rival.agreed < self.params.restart_after {
            self.rival = Some(rival);
            return false;
        }
        self.belief = rival.belief;
        self.counts.restarts += 1;
        true
    }
}

impl Stateful for Ekf {
    /// All of it, the history too, so that a fix under way is used as if nothing had happened. What became of
    /// the fixes so far is the process's own.
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.belief.visit_state(words);
        let restart_after = self.params.restart_after;
        words.option(&mut self.rival, Rival { belief: self.belief, agreed: 0 }, |rival, words| {
            rival.visit_state(words);
            words.require(rival.agreed < restart_after);
        });
        self.per_count.iter_mut().for_each(|gain| words.finite(gain.as_mut_slice()));
        words.finite(self.pose.as_mut_slice());
        words.option(&mut self.captured, 0, |tick, words| words.word(tick));
        self.history.visit_state(words);
    }
}

/// `pose` after these counts.
fn carry(pose: Vector3<f64>, counts: &PerWheel<i64>, per_count: &[Vector3<f64>; MAX_WHEELS]) -> Vector3<f64> {
    if *counts == [0; MAX_WHEELS] {
        return pose;
    }
    let mut moved = Vector3::zeros();
    for (count, gain) in counts.iter().zip(per_count) {
        moved += gain * *count as f64;
    }
    pose + arc(&pose, &moved).way
}

#[cfg(test)]
mod tests;
