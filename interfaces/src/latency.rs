//! A latency histogram of fixed size.
//!
//! Log-linear buckets: 16 to an octave, so a quantile is off by at most 1/16 of itself; no
//! allocation, no trimming, constant time to record. The exact maximum is kept beside the buckets.

/// Sub-buckets to an octave.
const SUB: u64 = 16;
/// Highest distinguished octave: 2^33 ns is 8.6 s.
const OCTAVES: u64 = 30;
/// Number of buckets.
pub const BUCKETS: usize = (SUB * OCTAVES) as usize;

/// Distribution of a duration, nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatencyHistogram {
    /// Samples recorded.
    pub count: u64,
    /// Largest sample, ns.
    pub max_ns: u64,
    /// Samples a bucket; see [`bucket`].
    pub buckets: [u64; BUCKETS],
}

impl Default for LatencyHistogram {
    fn default() -> Self {
        Self::ZERO
    }
}

/// Quantiles the project reports, microseconds, untrimmed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantiles {
    /// Median.
    pub p50_us: f64,
    /// 99th percentile.
    pub p99_us: f64,
    /// 99.9th percentile.
    pub p99_9_us: f64,
    /// Largest sample, exact.
    pub max_us: f64,
}

impl LatencyHistogram {
    /// Nothing recorded.
    pub const ZERO: Self = Self { count: 0, max_ns: 0, buckets: [0; BUCKETS] };

    /// Counts one duration of `ns` nanoseconds.
    pub fn record(&mut self, ns: u64) {
        self.buckets[bucket(ns)] += 1;
        self.count += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// Adds another histogram's samples to this one.
    pub fn merge(&mut self, other: &Self) {
        for (mine, theirs) in self.buckets.iter_mut().zip(&other.buckets) {
            *mine = mine.saturating_add(*theirs);
        }
        self.count = self.count.saturating_add(other.count);
        self.max_ns = self.max_ns.max(other.max_ns);
    }

    /// What was recorded after `before`, an earlier copy of the same histogram. Its maximum is the upper edge of
    /// the highest bucket, unless it is the maximum of all.
    pub fn since(&self, before: &Self) -> Self {
        let mut after = *self;
        for (mine, theirs) in after.buckets.iter_mut().zip(&before.buckets) {
            *mine = mine.saturating_sub(*theirs);
        }
        after.count = after.buckets.iter().sum();
        let highest = after.buckets.iter().rposition(|samples| *samples > 0);
        after.max_ns = highest.map_or(0, |index| upper_edge_ns(index as u64).min(self.max_ns));
        after
    }

    /// The value below which `fraction` (0..=1) of the samples lie, ns: the upper edge of its
    /// bucket, never above the maximum; 0 without samples.
    pub fn quantile_ns(&self, fraction: f64) -> u64 {
        if self.count == 0 {
            return 0;
        }
        let rank = (libm::ceil(fraction * self.count as f64) as u64).clamp(1, self.count);
        let mut seen = 0u64;
        for (index, samples) in self.buckets.iter().enumerate() {
            seen = seen.saturating_add(*samples);
            if seen >= rank {
                return upper_edge_ns(index as u64).min(self.max_ns);
            }
        }
        self.max_ns
    }

    /// p50, p99, p99.9 and max.
    pub fn quantiles(&self) -> Quantiles {
        let us = |fraction| self.quantile_ns(fraction) as f64 / 1e3;
        Quantiles { p50_us: us(0.5), p99_us: us(0.99), p99_9_us: us(0.999), max_us: self.max_ns as f64 / 1e3 }
    }
}

/// Bucket of a value, ns: values below 2·SUB have one each, above that SUB to an octave.
#[inline]
pub fn bucket(ns: u64) -> usize {
    if ns < SUB {
        return ns as usize;
    }
    let shift = (63 - ns.leading_zeros()) as u64 - 4;
    let index = shift * SUB + (ns >> shift);
    (index as usize).min(BUCKETS - 1)
}

/// Largest value that falls into bucket `index`, ns.
pub fn upper_edge_ns(index: u64) -> u64 {
    if index < 2 * SUB {
        return index;
    }
    let shift = index / SUB - 1;
    ((index % SUB + SUB + 1) << shift) - 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn quantiles_are_within_a_sixteenth_of_the_sorted_samples(
            mut samples in proptest::collection::vec(0u64..2_000_000_000, 1..400),
            fraction in 0.0..=1.0f64,
        ) {
            let mut histogram = LatencyHistogram::default();
            samples.iter().for_each(|s| histogram.record(*s));
            samples.sort_unstable();
            let rank = ((fraction * samples.len() as f64).ceil() as usize).clamp(1, samples.len());
            let exact = samples[rank - 1];
            let got = histogram.quantile_ns(fraction);
            prop_assert!(got >= exact && got as f64 <= exact as f64 * (1.0 + 1.0 / 16.0) + 1.0);
            prop_assert_eq!(histogram.max_ns, *samples.last().unwrap());
        }
    }

    proptest! {
        #[test]
        fn what_came_since_is_what_was_recorded_since(
            early in proptest::collection::vec(0u64..2_000_000_000, 0..100),
            late in proptest::collection::vec(0u64..2_000_000_000, 0..100),
        ) {
            let mut histogram = LatencyHistogram::ZERO;
            early.iter().for_each(|ns| histogram.record(*ns));
            let before = histogram;
            let mut alone = LatencyHistogram::ZERO;
            late.iter().for_each(|ns| {
                histogram.record(*ns);
                alone.record(*ns);
            });
            let since = histogram.since(&before);
            prop_assert_eq!((since.count, since.buckets), (alone.count, alone.buckets));
            prop_assert!(since.max_ns >= alone.max_ns && since.max_ns <= alone.max_ns + alone.max_ns / 16 + 1);
        }
    }

    #[test]
    fn buckets_are_contiguous() {
        let edges: Vec<u64> = (0..BUCKETS as u64).map(upper_edge_ns).collect();
        for (i, pair) in edges.windows(2).enumerate() {
            assert_eq!(bucket(pair[0]), i);
            assert_eq!(bucket(pair[0] + 1), i + 1);
        }
        assert_eq!(bucket(u64::MAX), BUCKETS - 1);
    }
}
