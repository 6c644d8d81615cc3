//! Where the wheels really lead, and how far from the line that is.
//!
//! The true robot moves along arcs. The chord of an arc points half-way between the headings at its ends: along the
//! sum of their directions, by (s_R + s_L)/2 · tan(h)/(2h), h half the turn. That is the plant's own arc
//! (`hilare_plant::stepper_drive`) to rounding, without its sine and cosine. Nothing here has a way back to the
//! control path.

use super::{Beat, Lanes};
use crate::shell::fast::FastPath;
use hilare_interfaces::geometry::WorldPoint;
use hilare_recorder::statistics::Line;

/// Where a robot really is, and its cross-track errors.
#[derive(Clone, Copy)]
struct TruthSoFar {
    place: WorldPoint,
    line: Line,
    cross_track_sum_m: f64,
    cross_track_max_m: f64,
}

impl TruthSoFar {
    /// A tick in which it moves by this, m.
    #[inline(always)]
    fn go(&mut self, dx_m: f64, dy_m: f64) {
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

impl<const N: usize> Lanes<N> {
    /// The true robot's way, of any steps that are all alike.
    #[inline(always)]
    pub(super) fn roll<const T: usize>(&mut self, path: &FastPath, beats: &[Beat<N>; T]) {
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

    /// The same where robot and start are as the estimator believes: the headings are known already.
    #[inline(always)]
    pub(super) fn roll_as_believed<const T: usize>(
        &mut self,
        [once, thrice]: [f64; 2],
        beats: &[Beat<N>; T],
    ) {
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
}
