//! Random numbers: SplitMix64 (Steele, Lea, Flood 2014). A word of state, the same bits on every machine; its
//! period of 2⁶⁴ is far beyond what a search draws. A crate for it would be longer than it is.

/// A seeded stream of uniform numbers.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    #[inline]
    fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in 0 ≤ u < 1, 53 bits.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Uniform in `low ≤ u < high`.
    #[inline]
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// One of `0..count`; `count` is at least 1. By multiplication: the bias of 2⁻⁶⁴·`count` is nothing here.
    #[inline]
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.next_u64()) * count as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_stream() {
        // Seed 1234567, from the authors' reference implementation.
        let mut random = Random::new(1_234_567);
        let words: Vec<u64> = (0..3).map(|_| random.next_u64()).collect();
        assert_eq!(words, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn draws_stay_where_they_belong() {
        let mut random = Random::new(7);
        let mut seen = [0u32; 5];
        let mut sum = 0.0;
        for _ in 0..50_000 {
            let u = random.unit();
            assert!((0.0..1.0).contains(&u));
            sum += u;
            seen[random.below(5)] += 1;
        }
        assert!((sum / 50_000.0 - 0.5).abs() < 0.01);
        assert!(seen.iter().all(|&count| (9_500..10_500).contains(&count)), "{seen:?}");
    }
}
