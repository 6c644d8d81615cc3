//! Random numbers that can be had again.

use std::io::Write;

/// SplitMix64 (Steele, Lea, Flood 2014).
#[derive(Clone, Debug)]
pub struct Random(u64);

/// `HILARE_TEST_SEED`, if it is set.
pub fn given_seed() -> Option<u64> {
    std::env::var("HILARE_TEST_SEED").ok().and_then(|seed| seed.parse().ok())
}

impl Random {
    /// From `HILARE_TEST_SEED`, or from `default`; the seed is printed when a test fails.
    pub fn new(test: &str, default: u64) -> Self {
        let given = given_seed();
        let seed = given.unwrap_or(default);
        println!("{test}: HILARE_TEST_SEED={seed}");
        if given.is_some() {
            let _ = writeln!(std::io::stderr().lock(), "{test}: HILARE_TEST_SEED={seed}");
        }
        Self(seed)
    }

    /// The sequence of a seed; whoever asks prints it.
    pub fn of_seed(seed: u64) -> Self {
        Self(seed)
    }

    /// Any word.
    pub fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly from `from..to`.
    pub fn real(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * ((self.word() >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Evenly from `from..=to`.
    pub fn whole(&mut self, from: u64, to: u64) -> u64 {
        from + self.word() % (to - from + 1)
    }

    /// True this often.
    pub fn chance(&mut self, share: f64) -> bool {
        self.real(0.0, 1.0) < share
    }

    /// One of these.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.whole(0, of.len() as u64 - 1) as usize]
    }
}
