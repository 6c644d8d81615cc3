//! What Foxglove and Lichtblick see: the channels of a recording, live.
//!
//! ```text
//!   relay's wires ──taps──▶ Viewer, 100 Hz ──▶ Feed ──▶ viewers (hilare_operator::foxglove)
//!                             └─ recording::ros: the standard messages
//! ```
//!
//! Topics, schemas and encodings come from the recorder's tables. What comes every tick or every control period is
//! thinned to 30 Hz at most, by the tick, so that messages of a tick stay together.

use super::door::Door;
use super::{port, thread};
use crate::logging::plain;
use crate::recording::part::View;
use crate::recording::wires::{RECORDED, Tap, taps};
use crate::recording::{Entry, Heard, cdr, dating::Dating, ros, schemas};
use crate::shell::worker::Worker;
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_interfaces::wires::Rate;
use hilare_operator::Verdict;
use hilare_operator::foxglove::{Channel, Feed, Gate, serve};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tracing::{info, warn};

/// Messages of a channel a second, at most, of wires that have one a tick or a control period.
const MAX_HZ: u64 = 30;
/// Time between two words about a site that was refused.
const WARN_EVERY: Duration = Duration::from_secs(10);
/// Sites that are told apart in it: whoever makes up more does not fill the log.
const MAX_SITES: usize = 8;

/// Makes what is seen of what the relay repeats.
pub struct Viewer {
    taps: Vec<Box<dyn Tap>>,
    stride: u64,
    views: ros::Views,
    dating: Dating,
    feed: Arc<Feed>,
    /// What has come: its time, whether it is shown itself, and what it is.
    heard: Vec<(u64, bool, Entry)>,
    cdr: Vec<u8>,
    left_out: bool,
}

impl Viewer {
    /// Opens its port and its wires; `None` if the system wants no live view.
    pub fn open(worker: &Worker, door: &Arc<Door>) -> Result<Option<Self>, String> {
        let system = &worker.system;
        if system.foxglove.is_empty() {
            return Ok(None);
        }
        let listener = port::bind(port::FOXGLOVE, &system.foxglove)?;
        let stride = stride(system.timing.period_ticks);
        let views = RECORDED.iter().map(schemas::view).chain(ros::channels());
        let channels = views.map(|View { topic, type_name, definition }| Channel {
            topic,
            encoding: cdr::ENCODING,
            schema_name: type_name,
            schema: definition,
            schema_encoding: schemas::LANGUAGE,
        });
        let feed = Arc::new(Feed::new(format!("hilare {}", system.robot), channels.collect()));
        let guard = Guard {
            door: Arc::clone(door),
            origins: system.foxglove_origins.split_whitespace().map(str::to_owned).collect(),
            warned: Mutex::default(),
        };
        let taps = taps(&worker.domain)?;
        let served = Arc::clone(&feed);
        thread("foxglove", move || {
            if let Err(error) = serve(listener, served, Arc::new(guard)) {
                tracing::error!("the live view: {error}");
                std::process::exit(1);
            }
        })?;
        info!("the live view is at {}", url(&system.foxglove));
        Ok(Some(Self {
            taps,
            stride,
            views: ros::Views::new(stride, ros::Body::of(system)),
            dating: Dating::default(),
            feed,
            heard: Vec::new(),
            cdr: Vec::new(),
            left_out: false,
        }))
    }

    /// Takes in what has come.
    pub fn look(&mut self) {
        let Self { taps, stride, views, dating, feed, heard, cdr, left_out } = self;
        for (tap, recorded) in taps.iter().zip(RECORDED) {
            let thinned = matches!(recorded.wire.rate, Rate::EveryTick | Rate::EveryPeriod);
            // As many as the wire holds.
            for _ in 0..recorded.wire.buffer {
                let any = tap.hear(&mut |message| {
                    let tick = message.tick();
                    let time_ns = dating.of(tick);
                    let shown = !thinned || tick.is_some_and(|tick| tick.is_multiple_of(*stride));
                    // How far the robot is from the path goes by the newest of these.
                    if shown || matches!(message, Heard::Reference(_)) {
                        heard.push((time_ns, shown, message.kept()));
                    }
                });
                if !any {
                    break;
                }
            }
        }
        // Wires are read one after the other.
        heard.sort_by_key(|(time_ns, ..)| *time_ns);
        let mut publish = |channel, time_ns, bytes: &[u8]| {
            if !feed.publish(channel, time_ns, bytes) && !*left_out {
                *left_out = true;
                let (topic, mb) = (&feed.channels()[channel].topic, bytes.len() / 1_000_000);
                warn!("the live view leaves out a message of {topic}: it has {mb} MB");
            }
        };
        for (time_ns, shown, entry) in heard.drain(..) {
            let message = entry.heard();
            if shown {
                cdr.clear();
                cdr::write_message(cdr, message.bytes(), message.elements());
                publish(message.place(), time_ns, cdr);
            }
            views.of(&entry, time_ns, |view, time_ns, cdr| publish(RECORDED.len() + view, time_ns, cdr));
        }
    }

    /// Connects to a relay that has come.
    pub fn connect(&self) {
        self.taps.iter().for_each(|tap| tap.connect());
    }
}

/// Every how many ticks something is shown: the least multiple of the control period with which it comes [`MAX_HZ`]
/// times a second or less, and on whole seconds if there is one.
fn stride(period_ticks: u64) -> u64 {
    let period = period_ticks.max(1);
    let least = TICKS_PER_SECOND.div_ceil(MAX_HZ).next_multiple_of(period);
    let whole = (least..=TICKS_PER_SECOND).step_by(period as usize);
    whole.into_iter().find(|ticks| TICKS_PER_SECOND.is_multiple_of(*ticks)).unwrap_or(least)
}

/// The address to open in Foxglove.
pub fn url(address: &str) -> String {
    hilare_operator::address::parse(address).map_or(String::new(), |address| format!("ws://{address}/"))
}

/// The robot's user alone, and of web pages those that are named.
struct Guard {
    door: Arc<Door>,
    origins: Vec<String>,
    /// Who was refused, and when that was said.
    warned: Mutex<Vec<(String, Instant)>>,
}

impl Gate for Guard {
    fn admit(&self, peer: SocketAddr, own: SocketAddr, verdict: Verdict) {
        self.door.ask(peer, own, verdict);
    }

    fn lets_in(&self, origin: &str) -> bool {
        let known = self.origins.iter().any(|known| known.eq_ignore_ascii_case(origin));
        // Whoever is refused is told nothing by the browser.
        let origin: String = plain(origin).chars().take(80).collect();
        if !known && self.is_to_be_told(&origin) {
            warn!(
                "the live view: a web page of {origin:?} wanted to look and was refused; if it is yours, name it in \
                 operator.foxglove_origins"
            );
        }
        known
    }
}

impl Guard {
    /// True if it has not been said of late that this site was refused.
    fn is_to_be_told(&self, origin: &str) -> bool {
        let mut warned = super::lock(&self.warned);
        warned.retain(|(_, said)| said.elapsed() < WARN_EVERY);
        let told = warned.len() < MAX_SITES && warned.iter().all(|(known, _)| known != origin);
        if told {
            warned.push((origin.to_owned(), Instant::now()));
        }
        told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_shown_thirty_times_a_second_at_most_and_on_whole_seconds() {
        for (period, ticks) in
            [(0, 40), (1, 40), (5, 40), (7, 35), (20, 40), (50, 50), (200, 200), (300, 300)]
        {
            assert_eq!(stride(period), ticks, "{period}");
        }
    }

    #[test]
    fn pages_of_other_sites_are_refused() {
        let guard = Guard {
            door: Arc::new(Door::open().expect("a thread")),
            origins: vec!["https://app.foxglove.dev".to_owned(), "file://".to_owned()],
            warned: Mutex::default(),
        };
        assert!(guard.lets_in("https://app.foxglove.dev") && guard.lets_in("file://"));
        for origin in
            ["null", "", "https://app.foxglove.dev.evil.example", "http://app.foxglove.dev", "file:///"]
        {
            assert!(!guard.lets_in(origin), "{origin}");
        }
    }

    #[test]
    fn every_site_that_is_refused_is_told_once_and_no_more_than_some() {
        let guard = Guard {
            door: Arc::new(Door::open().expect("a thread")),
            origins: Vec::new(),
            warned: Mutex::default(),
        };
        assert!(guard.is_to_be_told("http://a.example") && guard.is_to_be_told("http://b.example"));
        assert!(!guard.is_to_be_told("http://a.example"));
        let told = (0..100).filter(|n| guard.is_to_be_told(&format!("http://{n}.example"))).count();
        assert_eq!(told, MAX_SITES - 2);
    }
}
