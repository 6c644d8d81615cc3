//! Slip that comes and goes: the share of a wheel's rim travel that the floor does not see.

use crate::noise::Noise;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::state::{StateWords, Stateful};

/// Most of the travel that can be lost, and most that can be gained (a wheel that is dragged along).
const SHARE_MAX: f64 = 0.95;

/// Slip of `N` wheels: a mean, and a noise which forgets itself exponentially (Ornstein–Uhlenbeck),
/// because a patch of floor or a roller lasts longer than a tick.
#[derive(Clone, Debug)]
pub struct Slip<const N: usize> {
    mean: f64,
    sd: f64,
    /// What is left of the noise after a tick.
    kept: f64,
    /// Standard deviation of what a tick adds, so that the noise keeps a deviation of 1.
    fresh: f64,
    state: [f64; N],
    noise: Noise,
}

impl<const N: usize> Slip<N> {
    /// Slip of mean `mean` and standard deviation `sd`, correlated over `time_s` seconds.
    pub fn new(mean: f64, sd: f64, time_s: f64, mut noise: Noise) -> Self {
        let kept = libm::exp(-TICK_S / time_s);
        let state = core::array::from_fn(|_| if sd > 0.0 { noise.normal() } else { 0.0 });
        Self { mean, sd, kept, fresh: libm::sqrt(1.0 - kept * kept), state, noise }
    }

    /// Goes on where `before` is, with parameters of its own.
    pub fn take_over(&mut self, before: &Self) {
        self.state = before.state;
        self.noise.clone_from(&before.noise);
    }

    /// Factor of the rim travel that the floor sees in the next tick, a wheel.
    pub fn grip(&mut self) -> [f64; N] {
        if self.sd > 0.0 {
            for state in &mut self.state {
                *state = self.kept * *state + self.fresh * self.noise.normal();
            }
        }
        self.state.map(|state| 1.0 - (self.mean + self.sd * state).clamp(-SHARE_MAX, SHARE_MAX))
    }
}

impl<const N: usize> Stateful for Slip<N> {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.finite(&mut self.state);
        self.noise.visit_state(words);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_has_the_asked_spread_and_memory() {
        let mut slip = Slip::<1>::new(0.1, 0.05, 0.010, Noise::new(7));
        let shares: std::vec::Vec<f64> = (0..200_000).map(|_| 1.0 - slip.grip()[0]).collect();
        let moment = |lag: usize| {
            let pairs = shares.iter().zip(&shares[lag..]).map(|(a, b)| (a - 0.1) * (b - 0.1));
            pairs.sum::<f64>() / (shares.len() - lag) as f64
        };
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        assert!((mean - 0.1).abs() < 0.003, "{mean}");
        assert!((libm::sqrt(moment(0)) - 0.05).abs() < 0.002, "{}", moment(0));
        // After its correlation time the noise remembers 1/e of itself.
        assert!((moment(10) / moment(0) - libm::exp(-1.0)).abs() < 0.03, "{}", moment(10) / moment(0));
    }
}
