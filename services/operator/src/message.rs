//! What page and robot say to each other: JSON, a message a frame of text.
//!
//! To the page, by `type`: `hello`, `path`, `trail`, `state`, `status`, `log`, `answer`. From the page:
//! `{"id", "do", …}`, each answered by an `answer` with its `id`. All SI.

use hilare_interfaces::messages::MAX_WAYPOINTS;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// Longest message of a page: the longest path, as JSON.
pub const MAX_MESSAGE: usize = 4 << 20;

/// A waypoint on its way: x and y (m), bulge, crab angle (rad).
pub type Point = [f64; 4];

/// What a page can ask for.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Ramp to a stop and stay.
    Stop,
    /// Stop at once, latched.
    Estop,
    /// Let commands act.
    Arm,
    /// Release the emergency stop.
    Reset,
    /// Put another law in charge.
    Swap(String),
    /// Follow these waypoints.
    Follow(Vec<Point>),
    /// Go to this point, m.
    Goal([f64; 2]),
    /// Tell what the robot would make of these waypoints.
    Predict(Vec<Point>),
    /// Tell the planner's roadmap.
    Roadmap,
}

impl Order {
    /// It never waits for anything.
    pub fn is_stop(&self) -> bool {
        matches!(self, Self::Stop | Self::Estop)
    }

    /// Somebody has to think about it.
    pub fn is_slow(&self) -> bool {
        !matches!(self, Self::Stop | Self::Estop | Self::Arm | Self::Reset)
    }

    /// It only computes: the robot does nothing for it.
    pub fn is_question(&self) -> bool {
        matches!(self, Self::Predict(_) | Self::Roadmap)
    }
}

/// A frame of a page, whatever it asks for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Frame {
    id: u64,
    r#do: String,
    law: Option<String>,
    waypoints: Option<Vec<Point>>,
    x_m: Option<f64>,
    y_m: Option<f64>,
}

/// The order in a frame, with its number; or what is wrong with it, with its number if it has one.
pub fn parse(text: &str) -> Result<(u64, Order), (Option<u64>, String)> {
    let frame: Frame = serde_json::from_str(text).map_err(|error| (None, quoted(&error.to_string())))?;
    let id = frame.id;
    order(frame).map(|order| (id, order)).map_err(|why| (Some(id), why))
}

fn order(frame: Frame) -> Result<Order, String> {
    let wanted = |what: &str| format!("{} needs {what}", quoted(&frame.r#do));
    let waypoints = |given: Option<Vec<Point>>| match given {
        None => Err(wanted("waypoints")),
        Some(points) if points.len() > MAX_WAYPOINTS => {
            Err(format!("{} waypoints; a path has at most {MAX_WAYPOINTS}", points.len()))
        }
        Some(points) => Ok(points),
    };
    Ok(match frame.r#do.as_str() {
        "stop" => Order::Stop,
        "estop" => Order::Estop,
        "arm" => Order::Arm,
        "reset" => Order::Reset,
        "swap" => Order::Swap(frame.law.ok_or_else(|| wanted("law"))?),
        "follow" => Order::Follow(waypoints(frame.waypoints)?),
        "predict" => Order::Predict(waypoints(frame.waypoints)?),
        "goal" => Order::Goal([
            frame.x_m.ok_or_else(|| wanted("x_m and y_m"))?,
            frame.y_m.ok_or_else(|| wanted("x_m and y_m"))?,
        ]),
        "roadmap" => Order::Roadmap,
        other => return Err(format!("nobody knows how to do {:?}", quoted(other))),
    })
}

/// Somebody else's words, as many as do for a line.
fn quoted(text: &str) -> String {
    text.chars().take(200).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// What became of an order.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// It was done.
    pub ok: bool,
    /// What was done, or why not.
    pub message: String,
    /// What was asked for.
    pub more: Map<String, Value>,
}

impl Answer {
    /// Done.
    pub fn done(message: impl Into<String>) -> Self {
        Self { ok: true, message: message.into(), more: Map::new() }
    }

    /// Not done, and why.
    pub fn refused(message: impl Into<String>) -> Self {
        Self { ok: false, ..Self::done(message) }
    }

    /// The same with something that was asked for.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.more.insert(name.to_owned(), value.into());
        self
    }

    /// As a frame; `id` is the order's.
    pub fn frame(self, id: Option<u64>) -> String {
        let Self { ok, message, mut more } = self;
        more.insert("type".to_owned(), "answer".into());
        more.insert("id".to_owned(), id.into());
        more.insert("ok".to_owned(), ok.into());
        more.insert("message".to_owned(), message.into());
        Value::Object(more).to_string()
    }
}

/// Where something is: m, m, rad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Place {
    /// World x.
    pub x: f64,
    /// World y.
    pub y: f64,
    /// Heading.
    pub theta: f64,
}

impl Place {
    /// `None` of what is no place.
    pub fn of([x, y, theta]: [f64; 3]) -> Option<Self> {
        [x, y, theta].iter().all(|number| number.is_finite()).then_some(Self { x, y, theta })
    }
}

/// The robot now.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct State {
    /// Ticks executed.
    pub tick: u64,
    /// The same, s.
    pub time_s: f64,
    /// What the operator wants, as in `hilare status`.
    pub mode: String,
    /// Why the wheels turn as they do.
    pub drive: &'static str,
    /// Path progress.
    pub path_state: &'static str,
    /// Current waypoint.
    pub waypoint: u64,
    /// Waypoints of the path.
    pub waypoints: u64,
    /// Estimated pose.
    pub pose: Option<Place>,
    /// True pose, where it is simulated.
    pub truth: Option<Place>,
    /// Commanded speed, m/s.
    pub speed_mps: f64,
    /// Commanded yaw rate, rad/s.
    pub omega_radps: f64,
    /// Reference speed, m/s; none without a path.
    pub reference_mps: Option<f64>,
    /// Distance of the estimate from the segment under way, m, positive to the left.
    pub cross_track_m: Option<f64>,
    /// The same of the truth.
    pub cross_track_truth_m: Option<f64>,
    /// What is in charge.
    pub law: Option<String>,
    /// What stands by.
    pub standby: Option<String>,
    /// Commands that came late.
    pub commands_late: u64,
    /// Commands refused.
    pub commands_rejected: u64,
    /// Control cycles without a command.
    pub cycles_without_command: u64,
    /// Ticks lost to pauses.
    pub paused_ticks: u64,
    /// Why the robot cannot go on, if so.
    pub fault: Option<String>,
    /// Why it has to be armed again, if so.
    pub halted: Option<String>,
    /// It is down, or its launch does not answer.
    pub gone: bool,
    /// How it went down, if in good order, as in `hilare status`.
    pub ended: Option<String>,
}

/// A line of the merged log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    /// When, ms since 1970.
    pub time: f64,
    /// `info`, `warn` or `error`.
    pub level: &'static str,
    /// Who said what.
    pub text: String,
}

/// A message of a type.
pub fn frame(kind: &str, message: &impl Serialize) -> String {
    let mut value = json!(message);
    match &mut value {
        Value::Object(fields) => drop(fields.insert("type".to_owned(), kind.into())),
        _ => value = json!({ "type": kind }),
    }
    value.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_page_sends_is_understood() {
        for (text, order) in [
            (r#"{"id":1,"do":"stop"}"#, Order::Stop),
            (r#"{"id":1,"do":"swap","law":"qp"}"#, Order::Swap("qp".to_owned())),
            (
                r#"{"id":1,"do":"follow","waypoints":[[0,1,0,0],[1e-3,2.5,-0.5,0]]}"#,
                Order::Follow(vec![[0.0, 1.0, 0.0, 0.0], [1e-3, 2.5, -0.5, 0.0]]),
            ),
            (r#"{"id":1,"do":"goal","x_m":1,"y_m":-2}"#, Order::Goal([1.0, -2.0])),
            (r#"{"id":1,"do":"predict","waypoints":[]}"#, Order::Predict(Vec::new())),
        ] {
            assert_eq!(parse(text), Ok((1, order)), "{text}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_answered_in_a_line() {
        let long = format!(
            r#"{{"id":7,"do":"follow","waypoints":[{}]}}"#,
            vec!["[0,0,0,0]"; MAX_WAYPOINTS + 1].join(",")
        );
        assert!(long.len() < MAX_MESSAGE);
        for (text, id, said) in [
            ("", None, "EOF"),
            ("stop", None, "expected value"),
            ("[]", None, "expected struct"),
            ("{}", None, "missing field"),
            (r#"{"do":"stop"}"#, None, "missing field `id`"),
            (r#"{"id":-1,"do":"stop"}"#, None, "invalid value"),
            (r#"{"id":1,"do":"stop","now":true}"#, None, "unknown field `now`"),
            (r#"{"id":1,"do":"follow","waypoints":[[0,0]]}"#, None, "length"),
            (r#"{"id":1,"do":"follow","waypoints":[[0,0,0,1e999]]}"#, None, "out of range"),
            (r#"{"id":1,"do":"follow"}"#, Some(1), "follow needs waypoints"),
            (r#"{"id":1,"do":"goal","x_m":1}"#, Some(1), "goal needs x_m and y_m"),
            (r#"{"id":1,"do":"swap"}"#, Some(1), "swap needs law"),
            ("{\"id\":1,\"do\":\"down\\u001b[2J\\n\"}", Some(1), "nobody knows how to do \"down"),
            (&long, Some(7), "65537 waypoints; a path has at most 65536"),
        ] {
            let (got, why) = parse(text).expect_err(text);
            assert_eq!(got, id, "{text:.60}");
            assert!(why.contains(said) && !why.contains(['\n', '\u{1b}']), "{text:.60}: {why}");
        }
    }

    #[test]
    fn nothing_but_numbers_is_a_place() {
        assert_eq!(Place::of([1.0, f64::NAN, 0.0]), None);
        let state = State { pose: Place::of([1.0, 2.0, 3.0]), ..State::default() };
        let text = frame("state", &state);
        let value: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(
            (&value["type"], &value["pose"]["y"], &value["truth"]),
            (&json!("state"), &json!(2.0), &Value::Null)
        );
        let answer = Answer::refused("no \"map\"\n").with("edges", vec![1, 2]).frame(None);
        let value: Value = serde_json::from_str(&answer).expect("JSON");
        assert_eq!(
            (&value["id"], &value["ok"], &value["edges"][1]),
            (&Value::Null, &json!(false), &json!(2))
        );
    }
}
