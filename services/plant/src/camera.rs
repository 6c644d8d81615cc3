//! An overhead camera, or any positioning system: sees the robot at its rate, with noise, and late.

use crate::noise::Noise;
use alloc::collections::VecDeque;
use hilare_interfaces::block::Tick;
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::PoseFix;
use hilare_interfaces::param_group;
use hilare_interfaces::state::{STATE_WORDS, StateWords, Stateful};

param_group! {
    /// What watches the robot from outside.
    CameraParams {
        /// Ticks from one picture to the next.
        period_ticks: u64 = 40, "ticks", 1, 10000;
        /// Ticks from the picture to its use: exposure, processing, radio.
        delay_ticks: u64 = 60, "ticks", 0, 5000;
        /// Standard deviation of the noise, each of x and y.
        sd_m: f64 = 0.001, "m", 0.0, 1.0;
        /// Standard deviation of the noise of the heading.
        sd_rad: f64 = 0.005, "rad", 0.0, 1.0;
        /// Share of the pictures in which the robot is not found.
        lost: f64 = 0.0, "", 0.0, 1.0;
        /// Seed of its noise.
        seed: u64 = 1, "", 0, 9007199254740991u64;
    }
}

/// The camera.
#[derive(Clone, Debug)]
pub struct Camera {
    params: CameraParams,
    noise: Noise,
    /// First tick at which the next picture is taken.
    next_picture: Tick,
    /// Pictures under way, the oldest first.
    under_way: VecDeque<PoseFix>,
}

impl Camera {
    /// Takes its first picture at tick 0. Allocates room for all pictures under way.
    pub fn new(params: CameraParams) -> Self {
        let most = params.delay_ticks / params.period_ticks + 2;
        Self {
            params,
            noise: Noise::new(params.seed),
            next_picture: 0,
            under_way: VecDeque::with_capacity(most as usize),
        }
    }

    /// Goes on where `before` is, with parameters of its own: pictures under way come when they were to come.
    pub fn take_over(&mut self, before: &mut Self) {
        self.noise.clone_from(&before.noise);
        self.next_picture = before.next_picture;
        if self.under_way.capacity() < before.under_way.capacity() {
            core::mem::swap(&mut self.under_way, &mut before.under_way);
        } else {
            self.under_way.clear();
            self.under_way.extend(before.under_way.iter().copied());
        }
    }

    /// Watches the true pose of a tick; the fix that has come through by then, if any.
    pub fn watch(&mut self, tick: Tick, truth: WorldPose) -> Option<PoseFix> {
        if tick >= self.next_picture {
            self.next_picture = tick.saturating_add(self.params.period_ticks);
            if self.noise.uniform() > self.params.lost {
                let mut off = |sd: f64| if sd > 0.0 { sd * self.noise.normal() } else { 0.0 };
                let fix = PoseFix {
                    tick: tick.saturating_add(self.params.delay_ticks),
                    captured_tick: tick,
                    x_m: truth.x_m + off(self.params.sd_m),
                    y_m: truth.y_m + off(self.params.sd_m),
                    theta_rad: wrap_angle_rad(truth.theta_rad + off(self.params.sd_rad)),
                };
                self.under_way.push_back(fix);
            }
        }
        let due = self.under_way.front().is_some_and(|fix| fix.tick <= tick);
        if due { self.under_way.pop_front() } else { None }
    }
}

impl Stateful for Camera {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        self.noise.visit_state(words);
        words.word(&mut self.next_picture);
        let mut pictures = self.under_way.len();
        // More of them than would ever fit are none.
        words.index(&mut pictures, STATE_WORDS);
        if words.is_loading() {
            self.under_way.clear();
            self.under_way.resize(if words.is_sound() { pictures } else { 0 }, PoseFix::ZERO);
        }
        self.under_way.iter_mut().for_each(|fix| words.message(fix));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn watch(params: CameraParams, ticks: Tick) -> Vec<(Tick, PoseFix)> {
        let mut camera = Camera::new(params);
        let pose = |tick: Tick| WorldPose::new(tick as f64 * 1e-3, 0.0, 4.0);
        (0..ticks).filter_map(|tick| camera.watch(tick, pose(tick)).map(|fix| (tick, fix))).collect()
    }

    #[test]
    fn pictures_come_late_and_say_when_they_were_taken() {
        let exact = CameraParams { sd_m: 0.0, sd_rad: 0.0, ..CameraParams::default() };
        let fixes = watch(exact, 500);
        assert_eq!(fixes.len(), 11);
        for (n, (tick, fix)) in fixes.iter().enumerate() {
            assert_eq!((fix.captured_tick, fix.tick, *tick), (40 * n as u64, 40 * n as u64 + 60, fix.tick));
            assert_eq!(fix.x_m, fix.captured_tick as f64 * 1e-3);
            assert!((fix.theta_rad - (4.0 - core::f64::consts::TAU)).abs() < 1e-12);
        }
    }

    #[test]
    fn lost_pictures_and_noise_are_as_asked() {
        let params = CameraParams {
            period_ticks: 1,
            delay_ticks: 0,
            lost: 0.25,
            sd_m: 0.01,
            ..CameraParams::default()
        };
        let fixes = watch(params, 20_000);
        assert!((fixes.len() as f64 - 15_000.0).abs() < 300.0, "{}", fixes.len());
        let mean = fixes.iter().map(|(_, fix)| fix.y_m).sum::<f64>() / fixes.len() as f64;
        let square = fixes.iter().map(|(_, fix)| fix.y_m * fix.y_m).sum::<f64>() / fixes.len() as f64;
        assert!(mean.abs() < 5e-4 && (libm::sqrt(square) - 0.01).abs() < 5e-4, "{mean} {square}");
        assert_eq!(fixes, watch(params, 20_000), "the same seed, the same noise");
    }
}
