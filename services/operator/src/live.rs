//! What pages are shown, in one place for all of them.
//!
//! Whoever knows something new puts it here; each page takes what it has not seen yet, when it can take it. So
//! nothing is queued for anybody, and a page that is slow sees less.

use crate::message::{Line, Place, State, frame};
use axum::extract::ws::Utf8Bytes;
use serde_json::json;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Lines of the log that are kept.
pub const LOG_MAX: usize = 1000;
/// Lines of the log in one message.
const LINES_A_MESSAGE: usize = 250;
/// Points of a trail.
const TRAIL_MAX: usize = 20_000;
/// Least distance of two points of a trail at first, m.
const TRAIL_STEP_M: f64 = 0.0005;

/// Time that plots show, and between two of their samples, s.
const PLOT_S: f64 = 60.0;
const PLOT_STEP_S: f64 = 0.1;

/// A message with a number that goes up whenever it changes.
#[derive(Default)]
struct Said {
    number: u64,
    text: Utf8Bytes,
}

impl Said {
    fn say(&mut self, text: String) {
        self.number += 1;
        self.text = text.into();
    }

    /// The text, unless `seen` is its number already.
    fn unseen(&self, seen: &mut u64) -> Option<Utf8Bytes> {
        if self.number == *seen {
            return None;
        }
        *seen = self.number;
        Some(self.text.clone())
    }
}

/// Where something has been.
#[derive(Default)]
struct Trail {
    points: Vec<[f64; 2]>,
    /// Every how many-th point's distance is kept: doubled when there are too many.
    thinned: u32,
}

impl Trail {
    fn extend(&mut self, place: Place) {
        let step_m = TRAIL_STEP_M * f64::from(1u32 << self.thinned.min(20));
        let far = |[x, y]: &[f64; 2]| {
            let (dx, dy) = (place.x - x, place.y - y);
            dx * dx + dy * dy >= step_m * step_m
        };
        if self.points.last().is_none_or(far) {
            self.points.push([place.x, place.y]);
        }
        if self.points.len() > TRAIL_MAX {
            self.thinned += 1;
            let mut index = 0;
            self.points.retain(|_| {
                index += 1;
                index % 2 == 1
            });
        }
    }
}

/// A sample of the plots: s; commanded and reference speed, m/s; distance of estimate and truth from the path, m.
type Sample = (f64, [Option<f64>; 4]);

/// What plots show: the last minute.
#[derive(Default)]
struct Plots(VecDeque<Sample>);

impl Plots {
    fn extend(&mut self, state: &State) {
        let now_s = state.time_s;
        let age_s = self.0.back().map(|(last_s, _)| now_s - last_s);
        if age_s.is_some_and(|age_s| age_s < 0.0) {
            // Another run: its time begins anew.
            self.0.clear();
        } else if state.pose.is_none() || age_s.is_some_and(|age_s| age_s < PLOT_STEP_S) {
            return;
        }
        self.0.retain(|(then_s, _)| now_s - then_s <= PLOT_S);
        let numbers =
            [Some(state.speed_mps), state.reference_mps, state.cross_track_m, state.cross_track_truth_m];
        self.0.push_back((now_s, numbers));
    }

    fn rows(&self) -> Vec<[Option<f64>; 5]> {
        self.0.iter().map(|&(now_s, [a, b, c, d])| [Some(now_s), a, b, c, d]).collect()
    }
}

#[derive(Default)]
struct Known {
    hello: Said,
    path: Said,
    status: Said,
    state: State,
    states: u64,
    estimate: Trail,
    truth: Trail,
    plots: Plots,
    log: VecDeque<Line>,
    /// Lines there have ever been.
    lines: u64,
}

/// What is known of a robot now.
#[derive(Default)]
pub struct Live(Mutex<Known>);

/// What a page has seen.
#[derive(Debug, Default)]
pub struct Seen {
    hello: u64,
    path: u64,
    status: u64,
    states: u64,
    lines: u64,
    trail: bool,
}

impl Live {
    fn known(&self) -> MutexGuard<'_, Known> {
        // Nothing is ever half done in it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a page has to know first: an object.
    pub fn set_hello(&self, hello: &impl serde::Serialize) {
        let text = frame("hello", hello);
        self.known().hello.say(text);
    }

    /// The path in force.
    pub fn set_path(&self, path_id: u64, waypoints: &[[f64; 4]]) {
        let text = frame("path", &json!({ "path_id": path_id, "waypoints": waypoints }));
        self.known().path.say(text);
    }

    /// Slow figures: an object.
    pub fn set_status(&self, status: &impl serde::Serialize) {
        let text = frame("status", status);
        self.known().status.say(text);
    }

    /// The robot now; its places are added to the trails.
    pub fn set_state(&self, state: State) {
        let mut known = self.known();
        let known = &mut *known;
        if known.state == state {
            return;
        }
        for (trail, place) in [(&mut known.estimate, state.pose), (&mut known.truth, state.truth)] {
            place.inspect(|place| trail.extend(*place));
        }
        known.plots.extend(&state);
        known.state = state;
        known.states += 1;
    }

    /// More of the log.
    pub fn add_lines(&self, lines: impl IntoIterator<Item = Line>) {
        let mut known = self.known();
        for line in lines {
            if known.log.len() == LOG_MAX {
                known.log.pop_front();
            }
            known.log.push_back(line);
            known.lines += 1;
        }
    }

    /// What the operator wants now, as in `hilare status`.
    pub fn is_armed(&self) -> bool {
        let known = self.known();
        known.state.mode == "armed" && !known.state.gone
    }

    /// What has changed since it was last seen, in the order it has to be shown.
    pub fn unseen(&self, seen: &mut Seen) -> Vec<Utf8Bytes> {
        let known = self.known();
        let mut messages = Vec::new();
        let Some(hello) = known.hello.unseen(&mut seen.hello).or((seen.hello > 0).then(Utf8Bytes::default))
        else {
            // Nothing can be shown before it.
            return messages;
        };
        if !hello.is_empty() {
            // It begins anew.
            *seen = Seen { hello: seen.hello, ..Seen::default() };
            messages.push(hello);
        }
        messages.extend(known.path.unseen(&mut seen.path));
        if !seen.trail {
            seen.trail = true;
            let past = json!({
                "estimate": known.estimate.points, "truth": known.truth.points, "plots": known.plots.rows(),
            });
            messages.push(frame("trail", &past).into());
        }
        if known.states > seen.states {
            seen.states = known.states;
            messages.push(frame("state", &known.state).into());
        }
        messages.extend(known.status.unseen(&mut seen.status));
        let oldest = known.lines - known.log.len() as u64;
        let from = seen.lines.max(oldest);
        if known.lines > from {
            let skipped = (from - oldest) as usize;
            let lines: Vec<&Line> = known.log.iter().skip(skipped).take(LINES_A_MESSAGE).collect();
            seen.lines = from + lines.len() as u64;
            messages.push(frame("log", &json!({ "lines": lines })).into());
        }
        messages
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    fn types(messages: &[Utf8Bytes]) -> Vec<String> {
        let parsed = messages.iter().map(|text| serde_json::from_str::<Value>(text).expect("JSON"));
        parsed.map(|value| value["type"].as_str().expect("a type").to_owned()).collect()
    }

    fn at(tick: u64, x: f64) -> State {
        State { tick, pose: Place::of([x, 0.0, 0.0]), ..State::default() }
    }

    fn line(n: u64) -> Line {
        Line { time: 0.0, level: "info", text: n.to_string() }
    }

    #[test]
    fn a_page_gets_everything_once_and_then_what_changes() {
        let live = Live::default();
        let mut seen = Seen::default();
        live.set_state(at(1, 0.0));
        assert!(live.unseen(&mut seen).is_empty(), "not before the hello");
        live.set_hello(&json!({ "robot": "mule" }));
        live.set_path(3, &[[0.0; 4], [1.0, 0.0, 0.0, 0.0]]);
        live.set_status(&json!({ "hops": [] }));
        live.add_lines([line(0)]);
        let first = live.unseen(&mut seen);
        assert_eq!(types(&first), ["hello", "path", "trail", "state", "status", "log"]);
        assert!(live.unseen(&mut seen).is_empty());
        // Many changes are one message: the newest.
        (2..100).for_each(|tick| live.set_state(at(tick, 0.0)));
        let next = live.unseen(&mut seen);
        assert_eq!(types(&next), ["state"]);
        assert!(next[0].contains("\"tick\":99"), "{}", next[0]);
        live.set_state(at(99, 0.0));
        assert!(live.unseen(&mut seen).is_empty(), "nothing has changed");
        live.set_hello(&json!({ "robot": "mule" }));
        assert_eq!(types(&live.unseen(&mut seen)).len(), 6, "all of it again");
    }

    #[test]
    fn plots_keep_the_last_minute_and_begin_anew_with_another_run() {
        let mut plots = Plots::default();
        let at = |tick: u64| State {
            time_s: tick as f64 / 1e3,
            pose: Place::of([0.0; 3]),
            cross_track_m: (tick > 100_000).then_some(0.5),
            ..State::default()
        };
        plots.extend(&State { time_s: 1.0, ..State::default() });
        assert!(plots.rows().is_empty(), "nothing moves yet");
        (0..200_000).step_by(10).for_each(|tick| plots.extend(&at(tick)));
        let rows = plots.rows();
        assert!((500..=601).contains(&rows.len()), "{} samples", rows.len());
        assert!(rows[0][0] >= Some(139.0) && rows[rows.len() - 1][0] >= Some(199.8));
        assert_eq!((rows[0][2], rows[0][3]), (None, Some(0.5)));
        plots.extend(&at(50));
        assert_eq!(plots.rows(), [[Some(0.05), Some(0.0), None, None, None]]);
    }

    #[test]
    fn logs_and_trails_have_an_end() {
        let live = Live::default();
        live.set_hello(&json!({}));
        live.add_lines((0..5000).map(line));
        (0..200_000).for_each(|n| live.set_state(at(n, n as f64 * 0.001)));
        let mut seen = Seen::default();
        let mut texts = Vec::new();
        let messages = live.unseen(&mut seen);
        let trail: Value =
            serde_json::from_str(&messages[1 + usize::from(types(&messages)[1] == "path")]).expect("JSON");
        let points = trail["estimate"].as_array().expect("points").len();
        assert!((TRAIL_MAX / 4..=TRAIL_MAX).contains(&points), "{points} points");
        assert_eq!(trail["estimate"][0][0], 0.0);
        for messages in std::iter::once(messages).chain(std::iter::from_fn(|| {
            let more = live.unseen(&mut seen);
            (!more.is_empty()).then_some(more)
        })) {
            let log = messages.iter().find(|text| text.contains("\"type\":\"log\"")).expect("lines");
            let log: Value = serde_json::from_str(log).expect("JSON");
            let lines = log["lines"].as_array().expect("lines").clone();
            assert!(lines.len() <= LINES_A_MESSAGE);
            texts.extend(lines.iter().map(|line| line["text"].as_str().expect("text").to_owned()));
        }
        assert_eq!(texts, (4000..5000).map(|n| n.to_string()).collect::<Vec<_>>());
    }
}
