//! The control socket: how the command line reaches a running launch.
//!
//! One request a connection, one line of JSON each way, in a socket only the owner can open. The
//! listener ([`server`]) only carries; launch's own loop answers.

mod server;

use super::join::Peer;
use crate::private::euid;
use crossbeam_channel::Sender;
use hilare_interfaces::messages::MAX_WAYPOINTS;
use serde::{Deserialize, Serialize};
pub use server::listen;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// Longest request: the longest path, as JSON.
const MAX_REQUEST: usize = 8 << 20;
/// Longest answer: every process of a robot, each with its reason.
const MAX_RESPONSE: u64 = 1 << 20;
/// How long an answer is waited for.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);

/// What can be asked of a launch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request {
    /// Everything there is to know.
    Status,
    /// The status, and what the processes measure of themselves.
    Measured,
    /// The merged log.
    Log {
        /// How many of its lines are known already.
        after: u64,
    },
    /// Let commands act.
    Arm,
    /// Ramp to a stop and stay.
    Stop,
    /// Stop at once, latched.
    Estop,
    /// Release the emergency stop; leaves the robot disarmed.
    Reset,
    /// Stop and end.
    Down,
    /// Be the box of this name; asked by a process that wants to become it.
    Join(String),
    /// Put another controller in charge, or another instance of a box to work.
    Swap {
        /// The box.
        role: String,
        /// Law or executable, for a controller.
        driver: Option<String>,
        /// Keys to set, `KEY=VALUE`.
        set: Vec<String>,
    },
    /// Change these keys, `KEY=VALUE`, all at one tick or none.
    Set(Vec<String>),
    /// The system file that is in force.
    System,
    /// Where each box stands: 0 asks them, the number of a question fetches what they have answered.
    Standings(u64),
    /// Follow these waypoints: x and y (m), bulge, crab angle (rad).
    Follow(Vec<[f64; 4]>),
    /// Go to this point, metres; a heading in radians if one is wanted.
    Goal {
        /// World x.
        x_m: f64,
        /// World y.
        y_m: f64,
        /// Final heading.
        theta_rad: Option<f64>,
    },
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// It was done.
    pub ok: bool,
    /// What was done, or why not.
    pub message: String,
    /// The status, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub status: Option<super::status::Status>,
    /// What the processes measure, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<Vec<super::measured::Measured>>,
    /// What a change of parameters came to, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub param: Option<super::param::Outcome>,
    /// The system file that is in force, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system: Option<String>,
    /// Where each box stands, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standings: Option<super::standings::Standings>,
    /// Lines of the log, if that was asked for, and how many there are up to there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log: Option<(u64, Vec<crate::logging::Said>)>,
    /// A worker's place, if that was asked for: the arguments of `hilare service`. The page comes with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<Vec<String>>,
    /// Not done now, but it is worth asking again.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub later: bool,
    /// Not done, and never will be: what is asked for makes no sense here.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub wrong_use: bool,
}

impl Response {
    /// Done.
    pub fn done(message: impl Into<String>) -> Self {
        let message = message.into();
        Self {
            ok: true,
            message,
            status: None,
            measured: None,
            param: None,
            system: None,
            standings: None,
            log: None,
            place: None,
            later: false,
            wrong_use: false,
        }
    }

    /// Not done, and why.
    pub fn refused(message: impl Into<String>) -> Self {
        Self { ok: false, ..Self::done(message) }
    }

    /// Not to be done, and why.
    pub fn wrong_use(message: impl Into<String>) -> Self {
        Self { wrong_use: true, ..Self::refused(message) }
    }

    /// Not done yet, and why.
    pub fn later(message: impl Into<String>) -> Self {
        Self { later: true, ..Self::refused(message) }
    }
}

/// A request with the way back.
pub struct Call {
    /// What is asked.
    pub request: Request,
    /// Who asks, for a request to join.
    pub peer: Option<Peer>,
    /// Process id of whoever asks, if it can be told.
    pub from: Option<u32>,
    /// Where the answer goes; the caller may be gone.
    pub reply: Sender<Response>,
}

impl Request {
    /// Why it is not passed on, if it is not.
    fn refusal(&self) -> Option<String> {
        match self {
            Self::Follow(points) if points.len() > MAX_WAYPOINTS => {
                Some(format!("more than {MAX_WAYPOINTS} waypoints ({}); thin the path out", points.len()))
            }
            _ => None,
        }
    }

    /// True if launch answers it without waiting for anybody else.
    fn is_answered_at_once(&self) -> bool {
        !matches!(self, Self::Follow(_) | Self::Goal { .. } | Self::Swap { .. } | Self::Set(_))
    }
}

/// Sends one request to the launch of a robot. A socket that is not this user's is not spoken to.
pub(super) fn send(socket: &Path, request: &Request) -> io::Result<UnixStream> {
    let found = std::fs::symlink_metadata(socket)?;
    if found.uid() != euid() || !found.file_type().is_socket() {
        return Err(io::Error::other("its control socket is not one of this user"));
    }
    let mut stream = UnixStream::connect(socket)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut text = serde_json::to_string(request)?;
    text.push('\n');
    stream.write_all(text.as_bytes())?;
    Ok(stream)
}

/// Sends one request to the launch of a robot and waits for the answer.
pub fn ask(socket: &Path, request: &Request) -> io::Result<Response> {
    let stream = send(socket, request)?;
    let mut line = String::new();
    BufReader::new(stream.take(MAX_RESPONSE)).read_line(&mut line)?;
    Ok(serde_json::from_str(&line)?)
}
