//! When a message was, by its tick.

use hilare_interfaces::block::Tick;
use std::time::SystemTime;

const NS_PER_TICK: u64 = 1_000_000;

/// Gives messages their time: the clock on the wall when the first tick was heard, and a millisecond a tick from
/// there on; what comes without a tick has the time of the newest tick heard, and before the first one that of the wall.
#[derive(Clone, Debug, Default)]
pub struct Dating {
    /// Time of tick 0, once a tick is known.
    epoch_ns: Option<u64>,
    newest: Tick,
}

impl Dating {
    /// Time of a message that speaks of a tick, or of none, ns since 1970.
    pub fn of(&mut self, tick: Option<Tick>) -> u64 {
        self.of_one_heard(tick, || {
            SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_nanos() as u64
        })
    }

    fn of_one_heard(&mut self, tick: Option<Tick>, now_ns: impl Fn() -> u64) -> u64 {
        if let Some(tick) = tick {
            self.newest = self.newest.max(tick);
            self.epoch_ns.get_or_insert_with(|| now_ns().saturating_sub(tick.saturating_mul(NS_PER_TICK)));
        }
        self.epoch_ns.map_or_else(now_ns, |epoch_ns| {
            epoch_ns.saturating_add(tick.unwrap_or(self.newest).saturating_mul(NS_PER_TICK))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A robot may be up for hours before it is armed, and its first tick comes.
    #[test]
    fn ticks_are_dated_from_the_first_one_on_and_the_wait_before_by_the_wall() {
        let mut dating = Dating::default();
        let mut at = |tick, now_s: u64| dating.of_one_heard(tick, || now_s * 1_000_000_000);
        assert_eq!(at(None, 1_000), 1_000_000_000_000);
        assert_eq!(at(None, 4_600), 4_600_000_000_000);
        assert_eq!(at(Some(5), 5_000), 5_000_000_000_000);
        assert_eq!(at(Some(3), 5_001), 4_999_998_000_000);
        assert_eq!(at(None, 5_002), 5_000_000_000_000);
        assert_eq!(at(Some(1_005), 9_000), 5_001_000_000_000);
        assert_eq!(at(None, 9_000), 5_001_000_000_000);
    }
}
