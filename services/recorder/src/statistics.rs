//! The figures of a run, as spec 1 and `summary.json` define them.
//!
//! Means are over every tick until the selector accepts the last waypoint. Cross-track is the
//! distance of the truth to the line (or arc) through the last and the current waypoint; the speed error is
//! |v − v_r| of the commanded speed after the input constraints; the true speed is the truth's
//! displacement over 0.1 s.

use crate::TickRecord;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::geometry::{WorldPoint, WorldPose};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Steps};
use hilare_interfaces::segment::Segment;
use serde::{Deserialize, Serialize};

/// Window of the true speed, ticks (0.1 s, about the paper's camera).
const SPEED_WINDOW: usize = 100;
const WINDOW_S: f64 = SPEED_WINDOW as f64 * TICK_S;

/// Figures of a run so far.
#[derive(Clone, Debug)]
pub struct RunStatistics {
    ticks: u64,
    arrived: bool,
    cross_track_sum_m: f64,
    cross_track_max_m: f64,
    speed_error_sum_mps: f64,
    true_speed_error_sum_mps: f64,
    true_speed_samples: u64,
    window: Box<[WorldPoint; SPEED_WINDOW]>,
    track: Track,
    hash: StateHash,
    pose: WorldPose,
    truth: WorldPose,
    /// State of the step generator after the last tick that counts.
    steps: Steps,
}

/// What a run came to, for `summary.json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunFigures {
    /// The last waypoint was accepted.
    pub reached: bool,
    /// Ticks executed until then (or in all).
    pub ticks: u64,
    /// Mean distance of the truth to the tracked line, m.
    pub cross_track_mean_m: f64,
    /// Greatest such distance, m.
    pub cross_track_max_m: f64,
    /// Mean |v − v_r| of the commanded speed after the constraints, m/s.
    pub speed_error_mean_mps: f64,
    /// Mean |v − v_r| of the true speed over 0.1 s, m/s.
    pub speed_error_truth_mean_mps: f64,
    /// Steps a wheel, right first.
    pub steps: [i64; 4],
    /// Estimated pose at the end: x, y (m), heading (rad).
    pub final_pose: [f64; 3],
    /// True pose at the end.
    pub final_truth: [f64; 3],
    /// Hash of every bit of the estimated pose over all ticks.
    pub state_hash: u64,
    /// Wake-ups a tick or more late.
    pub ticks_late: u64,
    /// Whole ticks lost to such pauses.
    pub paused_ticks: u64,
    /// Longest single pause, ticks.
    pub paused_max_ticks: u64,
    /// Commands that came after their effective tick.
    pub commands_late: u64,
    /// Commands refused.
    pub commands_rejected: u64,
    /// Control cycles in which no command of their own acted.
    pub cycles_without_command: u64,
}

impl Default for RunStatistics {
    fn default() -> Self {
        Self {
            ticks: 0,
            arrived: false,
            cross_track_sum_m: 0.0,
            cross_track_max_m: 0.0,
            speed_error_sum_mps: 0.0,
            true_speed_error_sum_mps: 0.0,
            true_speed_samples: 0,
            window: Box::new([WorldPoint::default(); SPEED_WINDOW]),
            track: Track::default(),
            hash: StateHash::default(),
            pose: WorldPose::default(),
            truth: WorldPose::default(),
            steps: Steps::ZERO,
        }
    }
}

impl RunStatistics {
    /// True once the last waypoint was accepted; further ticks are not counted.
    pub fn arrived(&self) -> bool {
        self.arrived
    }

    /// Ticks counted.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// The reference that says `Arrived` ends the count.
    pub fn note_arrival(&mut self) {
        self.arrived = true;
    }

    /// Counts on after an arrival: the robot was given another path.
    pub fn go_on(&mut self) {
        self.arrived = false;
    }

    /// Takes in one tick.
    pub fn push(&mut self, record: TickRecord<'_>) {
        if record.reference.state == ReferenceState::Arrived.code() {
            self.note_arrival();
            return;
        }
        self.pose = record.pose.pose();
        self.truth = record.truth.pose();
        self.steps = *record.steps;
        self.hash.update(self.pose);
        let position = self.truth.position();
        if record.reference.state == ReferenceState::Tracking.code() {
            let distance = self.track.of(record.reference).distance_m(position);
            self.cross_track_sum_m += distance;
            self.cross_track_max_m = self.cross_track_max_m.max(distance);
        }
        let wanted = record.reference.speed_mps;
        self.speed_error_sum_mps += (record.steps.commanded_twist().speed_mps() - wanted).abs();
        let slot = &mut self.window[self.ticks as usize % SPEED_WINDOW];
        if self.ticks >= SPEED_WINDOW as u64 {
            let (dx, dy) = (position.x_m - slot.x_m, position.y_m - slot.y_m);
            let speed = (dx * dx + dy * dy).sqrt() / WINDOW_S;
            self.true_speed_error_sum_mps += (speed - wanted).abs();
            self.true_speed_samples += 1;
        }
        *slot = position;
        self.ticks += 1;
    }

    /// The figures so far.
    pub fn figures(&self) -> RunFigures {
        let mean = |sum: f64, n: u64| if n == 0 { 0.0 } else { sum / n as f64 };
        let flat = |pose: WorldPose| [pose.x_m, pose.y_m, pose.theta_rad];
        RunFigures {
            reached: self.arrived,
            ticks: self.ticks,
            cross_track_mean_m: mean(self.cross_track_sum_m, self.ticks),
            cross_track_max_m: self.cross_track_max_m,
            speed_error_mean_mps: mean(self.speed_error_sum_mps, self.ticks),
            speed_error_truth_mean_mps: mean(self.true_speed_error_sum_mps, self.true_speed_samples),
            steps: self.steps.counts,
            final_pose: flat(self.pose),
            final_truth: flat(self.truth),
            state_hash: self.hash.0,
            ticks_late: self.steps.ticks_late,
            paused_ticks: self.steps.paused_ticks,
            paused_max_ticks: self.steps.paused_max_ticks,
            commands_late: self.steps.commands_late,
            commands_rejected: self.steps.commands_rejected,
            cycles_without_command: self.steps.cycles_without_command,
        }
    }
}

/// The tracked segment, worked out only when the waypoint changes.
#[derive(Clone, Copy, Debug, Default)]
struct Track {
    key: (u64, u64),
    shape: Shape,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Line(Line),
    Circle { centre: WorldPoint, radius_m: f64 },
}

impl Default for Shape {
    fn default() -> Self {
        Self::Line(Line { normal: (0.0, 0.0), offset_m: 0.0 })
    }
}

/// The straight line through the ends of a segment; through ends that coincide there is none, and everything lies
/// on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Of length 1, to the left of the direction of travel.
    pub normal: (f64, f64),
    /// How far the line is from the origin, along the normal.
    pub offset_m: f64,
}

impl Line {
    /// The line of a straight segment.
    pub fn of(segment: Segment) -> Self {
        let length = segment.length_m().max(f64::MIN_POSITIVE);
        let normal =
            (-(segment.to.y_m - segment.from.y_m) / length, (segment.to.x_m - segment.from.x_m) / length);
        Self { normal, offset_m: normal.0 * segment.from.x_m + normal.1 * segment.from.y_m }
    }

    /// Distance of a point, m.
    #[inline]
    pub fn distance_m(&self, point: WorldPoint) -> f64 {
        (self.normal.0 * point.x_m + self.normal.1 * point.y_m - self.offset_m).abs()
    }
}

impl Track {
    fn of(&mut self, reference: &Reference) -> &Self {
        let key = (reference.path_id, reference.index);
        if key != self.key {
            *self = Self { key, shape: Shape::of(reference.segment()) };
        }
        self
    }

    fn distance_m(&self, point: WorldPoint) -> f64 {
        match self.shape {
            Shape::Line(line) => line.distance_m(point),
            Shape::Circle { centre, radius_m } => (centre.distance_m(point) - radius_m).abs(),
        }
    }
}

impl Shape {
    fn of(segment: Segment) -> Self {
        if let Some(centre) = segment.centre() {
            return Self::Circle { centre, radius_m: centre.distance_m(segment.to) };
        }
        Self::Line(Line::of(segment))
    }
}

/// Hash over the bits of every pose: `h = (rotl(h, 5) ^ word) · 0x517c_c1b7_2722_0a95`, words x, y,
/// heading of each tick (the multiplicative hash of Firefox, written out so that others can check).
#[derive(Clone, Copy, Debug, Default)]
struct StateHash(u64);

impl StateHash {
    fn update(&mut self, pose: WorldPose) {
        for word in [pose.x_m, pose.y_m, pose.theta_rad] {
            self.0 = (self.0.rotate_left(5) ^ word.to_bits()).wrapping_mul(0x517c_c1b7_2722_0a95);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::messages::{Pose, Truth, Waypoint};

    /// 1 m along x at 40 mm/s, 3 mm to the left of the line, commanded 38 mm/s.
    #[test]
    fn a_straight_run_by_hand() {
        let mut statistics = RunStatistics::default();
        let mut reference = Reference {
            state: ReferenceState::Tracking.code(),
            path_id: 1,
            index: 1,
            speed_mps: 0.040,
            current: Waypoint::straight(1.0, 0.0),
            ..Reference::ZERO
        };
        for n in 1..=500u64 {
            let pose = WorldPose::new(n as f64 * 4e-5, 0.003, 0.0);
            statistics.push(TickRecord {
                steps: &Steps {
                    tick: n,
                    counts: [n as i64, 2, 0, 0],
                    twist: [0.038, 0.0, 0.0],
                    ..Steps::ZERO
                },
                pose: &Pose::at(n, pose),
                truth: &Truth::at(n, pose),
                reference: &reference,
            });
        }
        let before = statistics.figures();
        reference.state = ReferenceState::Arrived.code();
        statistics.push(TickRecord {
            steps: &Steps::ZERO,
            pose: &Pose::ZERO,
            truth: &Truth::ZERO,
            reference: &reference,
        });
        let figures = statistics.figures();
        assert_eq!(
            figures,
            RunFigures { reached: true, ..before },
            "the tick after the arrival does not count"
        );
        assert_eq!((figures.ticks, figures.steps[0]), (500, 500));
        assert!((figures.cross_track_mean_m - 0.003).abs() < 1e-12);
        assert!((figures.speed_error_mean_mps - 0.002).abs() < 1e-12);
        assert!(figures.speed_error_truth_mean_mps < 1e-9);
        assert_ne!(figures.state_hash, 0);
    }
}
