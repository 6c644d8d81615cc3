//! How often messages come.

use serde::Serialize;
use std::time::Instant;

/// Messages of a wire over some time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rates {
    /// Messages that came.
    pub messages: u64,
    /// For how long it was looked, s.
    pub seconds: f64,
    /// Messages a second.
    pub hz: f64,
    /// Ticks between the first and the last message; the robot's own time, in which 1000 are a second.
    pub ticks: u64,
    /// Messages a second of the robot's own time; absent if they carry no tick or too few came.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hz_of_ticks: Option<f64>,
    /// Most ticks between two messages.
    pub gap_max_ticks: u64,
}

/// Counts messages.
pub struct Counter {
    since: Instant,
    messages: u64,
    first: Option<u64>,
    last: Option<u64>,
    gap_max: u64,
}

impl Counter {
    /// From now on.
    pub fn new() -> Self {
        Self { since: Instant::now(), messages: 0, first: None, last: None, gap_max: 0 }
    }

    /// A message came, of this tick if it carries one.
    pub fn count(&mut self, tick: Option<u64>) {
        self.messages += 1;
        let Some(tick) = tick else { return };
        self.first = self.first.or(Some(tick));
        // Two controllers answer the same tick; a successor may repeat.
        self.gap_max = self.gap_max.max(tick.saturating_sub(self.last.unwrap_or(tick)));
        self.last = self.last.max(Some(tick));
    }

    /// So far.
    pub fn rates(&self) -> Rates {
        let seconds = self.since.elapsed().as_secs_f64();
        let ticks = self.last.zip(self.first).map_or(0, |(last, first)| last - first);
        let between = self.messages.saturating_sub(1) as f64;
        Rates {
            messages: self.messages,
            seconds,
            hz: self.messages as f64 / seconds.max(f64::MIN_POSITIVE),
            ticks,
            hz_of_ticks: (ticks > 0).then(|| between / ticks as f64 * 1000.0),
            gap_max_ticks: self.gap_max,
        }
    }
}

impl Default for Counter {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_tell_rate_and_gaps() {
        let mut counter = Counter::new();
        [10, 15, 20, 40, 45].into_iter().for_each(|tick| counter.count(Some(tick)));
        let rates = counter.rates();
        assert_eq!((rates.messages, rates.ticks, rates.gap_max_ticks), (5, 35, 20));
        assert!((rates.hz_of_ticks.unwrap() - 4.0 / 35.0 * 1000.0).abs() < 1e-9);
        let mut counter = Counter::new();
        counter.count(None);
        assert_eq!(counter.rates().hz_of_ticks, None);
    }
}
