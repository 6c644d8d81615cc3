//! A control period of all lanes: the law and the constraints at its start, then ticks.

use super::{Beat, Lanes};
use crate::shell::fast::{FastPath, sine};
use hilare_controller::kanayama::KanayamaGains;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::geometry::{WRAPPED_ONCE_RAD, WorldPoint, seen_along, wrap_angle_rad, wrap_once_rad};
use hilare_step_generator::limits::Limits;
use hilare_step_generator::pulses;

impl<const N: usize> Lanes<N> {
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
}
