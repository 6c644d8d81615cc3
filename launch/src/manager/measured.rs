//! What the processes measure of themselves, for whoever asks launch: `hilare top`, the operator's page.

use super::Manager;
use super::member::Duty;
use crate::config::Driver;
use crate::shell::timing::Histogram;
use hilare_interfaces::latency::{BUCKETS, LatencyHistogram};
use serde::{Deserialize, Serialize};

/// A [`LatencyHistogram`] on its way: only the buckets that hold something.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Distribution {
    /// Largest sample, ns.
    pub max_ns: u64,
    /// Bucket and samples in it.
    pub buckets: Vec<(usize, u64)>,
}

impl Distribution {
    fn of(histogram: &Histogram) -> Self {
        let LatencyHistogram { max_ns, buckets, .. } = histogram.snapshot();
        Self {
            max_ns,
            buckets: buckets.into_iter().enumerate().filter(|(_, samples)| *samples > 0).collect(),
        }
    }

    /// The histogram it was; buckets that there are none of are left out.
    pub fn histogram(&self) -> LatencyHistogram {
        let mut histogram = LatencyHistogram { max_ns: self.max_ns, ..LatencyHistogram::ZERO };
        for (index, samples) in self.buckets.iter().filter(|(index, _)| *index < BUCKETS) {
            histogram.buckets[*index] = histogram.buckets[*index].saturating_add(*samples);
            histogram.count = histogram.count.saturating_add(*samples);
        }
        histogram
    }
}

/// What a process has measured since its box first began; see [`crate::shell::timing`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Measured {
    /// Its place in the robot.
    pub slot: usize,
    /// Its box.
    pub name: String,
    /// What drives in it, if it is a controller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Time messages were on their way to it; of the clock, how late it woke.
    pub taken: Distribution,
    /// Time from waking to having told everything.
    pub step: Distribution,
    /// Age of the steps its answers are based on; of the clock, time a command was ready before it was taken in.
    pub age: Distribution,
}

impl Manager {
    /// Of every process there is a place for.
    pub(super) fn measured(&self) -> Vec<Measured> {
        let wanted = self.members.iter().enumerate().filter(|(_, member)| member.duty != Duty::Vacant);
        wanted
            .map(|(slot, member)| {
                let timing = self.page.timing(slot);
                Measured {
                    slot,
                    name: member.role.name().to_owned(),
                    law: member.driver.as_ref().map(Driver::name),
                    taken: Distribution::of(&timing.taken),
                    step: Distribution::of(&timing.step),
                    age: Distribution::of(&timing.age),
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::page::SharedPage;

    #[test]
    fn a_histogram_arrives_as_it_was_and_nonsense_does_no_harm() {
        let page = SharedPage::create().expect("a page");
        let histogram = &page.timing(1).taken;
        (0..2000).for_each(|n| histogram.record(n * n));
        let sent = serde_json::to_string(&Distribution::of(histogram)).expect("JSON");
        let came: Distribution = serde_json::from_str(&sent).expect("JSON");
        assert_eq!(came.histogram(), histogram.snapshot());
        let nonsense = Distribution { max_ns: 5, buckets: vec![(BUCKETS, 3), (2, u64::MAX), (2, 7)] };
        assert_eq!(nonsense.histogram().count, u64::MAX);
    }
}
