//! When a message was, by its tick.

use hilare_interfaces::block::Tick;
use std::time::SystemTime;

const NS_PER_TICK: u64 = 1_000_000;

/// Gives messages their time: the clock on the wall when the first tick was heard, and a millisecond a tick from
/// there on; what comes without a tick has the time of the newest tick heard.
#[derive(Clone, Debug)]
pub struct Dating {
    began_ns: u64,
    /// Time of tick 0, once a tick is known.
    epoch_ns: Option<u64>,
    newest: Tick,
}

impl Dating {
    /// From now on.
    pub fn begin() -> Self {
        let began = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        Self { began_ns: began.as_nanos() as u64, epoch_ns: None, newest: 0 }
    }

    /// Time of a message that speaks of a tick, or of none, ns since 1970.
    pub fn of(&mut self, tick: Option<Tick>) -> u64 {
        if let Some(tick) = tick {
            self.newest = self.newest.max(tick);
            let began_ns = self.began_ns;
            self.epoch_ns.get_or_insert(began_ns.saturating_sub(tick.saturating_mul(NS_PER_TICK)));
        }
        self.epoch_ns.map_or(self.began_ns, |epoch_ns| {
            epoch_ns.saturating_add(tick.unwrap_or(self.newest).saturating_mul(NS_PER_TICK))
        })
    }
}
