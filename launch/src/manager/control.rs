//! The control socket: how the command line reaches a running launch.
//!
//! One request a connection, one line of JSON each way, in a socket only the owner can open. The
//! listener's threads only carry; launch's own loop answers.

use super::join::{Peer, send_with};
use crossbeam_channel::{Sender, bounded};
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Longest request: the longest path, as JSON.
const MAX_REQUEST: u64 = 8 << 20;
/// How long either side waits for the other.
const PATIENCE: Duration = Duration::from_secs(10);
/// Requests under way at once.
const MAX_CONNECTIONS: usize = 16;

/// What can be asked of a launch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request {
    /// Everything there is to know.
    Status,
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
    /// A worker's place, if that was asked for: the arguments of `hilare service`. The page comes with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<Vec<String>>,
    /// Not done now, but it is worth asking again.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub later: bool,
}

impl Response {
    /// Done.
    pub fn done(message: impl Into<String>) -> Self {
        Self { ok: true, message: message.into(), status: None, place: None, later: false }
    }

    /// Not done, and why.
    pub fn refused(message: impl Into<String>) -> Self {
        Self { ok: false, ..Self::done(message) }
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
    /// Where the answer goes; the caller may be gone.
    pub reply: Sender<Response>,
}

/// Listens on `path`, handing every request to `deliver`. Whoever gets a place gets `page` with it.
pub fn listen(path: &Path, page: OwnedFd, deliver: impl Fn(Call) + Clone + Send + 'static) -> io::Result<()> {
    let page = Arc::new(page);
    let listener = UnixListener::bind(path)?;
    std::fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(0o600))?;
    let places = bounded::<()>(MAX_CONNECTIONS);
    let threads = std::thread::Builder::new().name("control".into()).stack_size(256 << 10);
    threads.spawn(move || {
        for stream in listener.incoming().flatten() {
            if places.0.try_send(()).is_err() {
                continue;
            }
            let (deliver, place, page) = (deliver.clone(), places.1.clone(), Arc::clone(&page));
            let serving = std::thread::Builder::new().stack_size(256 << 10).spawn(move || {
                let _ = serve(&stream, &page, deliver);
                let _ = place.try_recv();
            });
            if serving.is_err() {
                let _ = places.1.try_recv();
            }
        }
    })?;
    Ok(())
}

fn serve(stream: &UnixStream, page: &OwnedFd, deliver: impl Fn(Call)) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut line = String::new();
    BufReader::new(stream.take(MAX_REQUEST)).read_line(&mut line)?;
    let response = match serde_json::from_str(&line) {
        Ok(request) => {
            let (reply, answer) = bounded(1);
            let joins = matches!(request, Request::Join(_));
            let peer = joins.then(|| Peer::of(stream).ok()).flatten();
            deliver(Call { request, peer, reply });
            answer
                .recv_timeout(PATIENCE)
                .unwrap_or_else(|_| Response::refused("launch did not answer in time"))
        }
        Err(error) => Response::refused(format!("not a request: {error}")),
    };
    let mut text = serde_json::to_string(&response)?;
    text.push('\n');
    let mut stream = stream;
    match response.place {
        Some(_) => send_with(stream, text.as_bytes(), page),
        None => stream.write_all(text.as_bytes()),
    }
}

/// Sends one request to the launch of a robot.
pub(super) fn send(socket: &Path, request: &Request) -> io::Result<UnixStream> {
    let mut stream = UnixStream::connect(socket)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    let mut text = serde_json::to_string(request)?;
    text.push('\n');
    stream.write_all(text.as_bytes())?;
    Ok(stream)
}

/// Sends one request to the launch of a robot and waits for the answer.
pub fn ask(socket: &Path, request: &Request) -> io::Result<Response> {
    let stream = send(socket, request)?;
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line)?;
    Ok(serde_json::from_str(&line)?)
}
