//! What there is to see, in one place for all viewers.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Messages kept of a channel, for viewers that look less often than they come.
const KEPT: usize = 64;
/// Bytes kept of a channel, but for one message, which may be longer.
const KEPT_BYTES: usize = 256 << 10;
/// Longest message; longer ones are left out.
pub const MESSAGE_MAX: usize = 8 << 20;

/// A topic, as recordings have it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its topic.
    pub topic: String,
    /// How messages are laid out: `cdr`.
    pub encoding: &'static str,
    /// What they are: `nav_msgs/msg/Odometry`.
    pub schema_name: String,
    /// The definition of that.
    pub schema: String,
    /// In which language: `ros2msg`.
    pub schema_encoding: &'static str,
}

/// A message of a channel.
#[derive(Debug, PartialEq, Eq)]
pub struct Message {
    /// Place of its channel.
    pub channel: usize,
    /// Grows with every message of any channel, from 1.
    pub number: u64,
    /// Its time, ns since 1970.
    pub time_ns: u64,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

#[derive(Default)]
struct Ring {
    messages: VecDeque<Arc<Message>>,
    bytes: usize,
}

#[derive(Default)]
struct Rings {
    number: u64,
    rings: Vec<Ring>,
}

/// The channels, and the newest messages of each.
pub struct Feed {
    /// What is told of the robot: its name.
    pub name: String,
    channels: Vec<Channel>,
    rings: Mutex<Rings>,
}

impl Feed {
    /// Channels without a message.
    pub fn new(name: String, channels: Vec<Channel>) -> Self {
        let rings = channels.iter().map(|_| Ring::default()).collect();
        Self { name, channels, rings: Mutex::new(Rings { number: 0, rings }) }
    }

    /// The channels, by their places.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn rings(&self) -> MutexGuard<'_, Rings> {
        self.rings.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a message where viewers find it. False if it is too long for them, or of no channel.
    pub fn publish(&self, channel: usize, time_ns: u64, bytes: &[u8]) -> bool {
        if bytes.len() > MESSAGE_MAX || channel >= self.channels.len() {
            return false;
        }
        let bytes = bytes.to_vec();
        let mut rings = self.rings();
        rings.number += 1;
        let number = rings.number;
        let ring = &mut rings.rings[channel];
        ring.bytes += bytes.len();
        ring.messages.push_back(Arc::new(Message { channel, number, time_ns, bytes }));
        while ring.messages.len() > KEPT || (ring.bytes > KEPT_BYTES && ring.messages.len() > 1) {
            ring.bytes -= ring.messages.pop_front().map_or(0, |oldest| oldest.bytes.len());
        }
        true
    }

    /// What a viewer has not seen of the channels it follows, the oldest first.
    pub fn unseen(&self, seen: &mut [Seen]) -> Vec<Arc<Message>> {
        let mut messages: Vec<Arc<Message>> = Vec::new();
        {
            let rings = self.rings();
            for seen in seen {
                let Some(ring) = rings.rings.get(seen.channel) else { continue };
                let news = ring.messages.iter().rev().take_while(|message| message.number > seen.number);
                // Whoever comes is told the newest, however old that is; what was before it is past.
                let news = news.take(if seen.number == 0 { 1 } else { KEPT });
                messages.extend(news.cloned());
                if let Some(newest) = ring.messages.back() {
                    seen.number = newest.number;
                }
            }
        }
        messages.sort_unstable_by_key(|message| message.number);
        messages
    }
}

/// How far a viewer has seen a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// Place of the channel.
    pub channel: usize,
    number: u64,
}

impl Seen {
    /// A channel of which nothing has been seen.
    pub fn nothing_of(channel: usize) -> Self {
        Self { channel, number: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feed() -> Feed {
        let channel = |topic: &str| Channel {
            topic: topic.to_owned(),
            encoding: "cdr",
            schema_name: String::new(),
            schema: String::new(),
            schema_encoding: "ros2msg",
        };
        Feed::new("mule".to_owned(), ["/odom", "/path"].map(channel).into())
    }

    fn told(messages: &[Arc<Message>]) -> Vec<(usize, u8)> {
        messages.iter().map(|message| (message.channel, message.bytes[0])).collect()
    }

    #[test]
    fn whoever_comes_is_told_the_newest_and_then_all_that_comes() {
        let feed = feed();
        let mut seen = [Seen::nothing_of(0), Seen::nothing_of(1)];
        assert!(feed.unseen(&mut seen).is_empty());
        (1..=3).for_each(|value| assert!(feed.publish(0, 0, &[value])));
        assert!(feed.publish(1, 0, &[9]));
        assert_eq!(told(&feed.unseen(&mut seen)), [(0, 3), (1, 9)]);
        assert!(feed.unseen(&mut seen).is_empty());
        for (channel, value) in [(0, 4), (1, 8), (0, 5)] {
            assert!(feed.publish(channel, 0, &[value]));
        }
        assert_eq!(told(&feed.unseen(&mut seen[..1])), [(0, 4), (0, 5)]);
        assert_eq!(told(&feed.unseen(&mut seen)), [(1, 8)]);
    }

    #[test]
    fn nobody_who_is_slow_costs_more_than_what_is_kept() {
        let feed = feed();
        let mut seen = [Seen::nothing_of(0)];
        assert!(feed.publish(0, 0, &[0]));
        assert_eq!(feed.unseen(&mut seen).len(), 1);
        (0..200).for_each(|value| assert!(feed.publish(0, 0, &[value])));
        let told = told(&feed.unseen(&mut seen));
        assert_eq!((told.len(), told[0], told[KEPT - 1]), (KEPT, (0, 200 - KEPT as u8), (0, 199)));
        (0..200).for_each(|_| assert!(feed.publish(1, 0, &[0; KEPT_BYTES / 4])));
        assert_eq!(feed.rings().rings[1].messages.len(), 4);
        // One that is longer than what is kept is kept all the same, alone.
        assert!(feed.publish(1, 0, &[0; MESSAGE_MAX]));
        assert_eq!(feed.rings().rings[1].messages.len(), 1);
        assert!(!feed.publish(1, 0, &[0; MESSAGE_MAX + 1]) && !feed.publish(2, 0, &[0]));
    }
}
