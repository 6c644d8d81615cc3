//! The listening side of the control socket. Whoever is at the other end, it never waits for them.
//!
//! ```text
//!   accept ──▶ reading: bytes until a line is there ──▶ launch ──▶ waiting: for launch's answer ──▶ written, closed
//!              at most MAX_READING, MAX_BUFFERED in all            at most MAX_WAITING
//! ```
//!
//! One thread, sockets that do not block, everything bounded. When there are too many callers who do not
//! finish their request, the oldest of them goes: so a newcomer, who may want an emergency stop, always
//! gets in.

use super::super::join::{Peer, send_with};
use super::{Call, MAX_REQUEST, PATIENCE, Request, Response};
use crossbeam_channel::{Receiver, Select, TryRecvError, bounded};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::sockopt::socket_peercred;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::{Duration, Instant};

/// Callers at once that have not finished their request.
const MAX_READING: usize = 64;
/// Of those, how many of the oldest go when there is no place left.
const ROOM: usize = MAX_READING / 4;
/// Bytes of unfinished requests, of all callers together.
const MAX_BUFFERED: usize = 2 * MAX_REQUEST;
/// Time a caller has for the whole of its request.
const REQUEST_PATIENCE: Duration = Duration::from_secs(2);
/// Requests at launch that wait for somebody else, such as the planner.
const MAX_WAITING: usize = 64;
/// Requests at launch of any kind; all but those are answered within a turn of its loop.
const MAX_AT_LAUNCH: usize = 192;
/// Bytes taken from a caller in one go.
const CHUNK: usize = 64 << 10;
/// Longest part of a bad request that is said back.
const QUOTED: usize = 200;
/// Time between two looks at the sockets while an answer is awaited.
const LOOK: Duration = Duration::from_millis(2);
/// Rest after an accept that failed, for want of descriptors: not to ask again at once, for ever.
const OUT_OF_DESCRIPTORS: Duration = Duration::from_millis(10);

/// Listens on `path`, handing every request to `deliver`, which must not block. Whoever gets a place gets
/// `page` with it.
pub fn listen(path: &Path, page: OwnedFd, deliver: impl Fn(Call) + Send + 'static) -> io::Result<()> {
    let listener = UnixListener::bind(path)?;
    std::fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(0o600))?;
    listener.set_nonblocking(true)?;
    let thread = std::thread::Builder::new().name("control".into()).stack_size(512 << 10);
    thread.spawn(move || {
        let mut server = Server::default();
        loop {
            server.sleep(&listener);
            // Before room is made: whose request has come meanwhile is not one of those who do not finish.
            server.read(&deliver);
            server.accept(&listener);
            server.read(&deliver);
            server.answer(&page);
        }
    })?;
    Ok(())
}

/// A caller whose request is not yet whole.
struct Reading {
    stream: UnixStream,
    bytes: Vec<u8>,
    deadline: Instant,
}

/// A caller whose request is with launch.
struct Waiting {
    stream: UnixStream,
    answer: Receiver<Response>,
    deadline: Instant,
}

/// What a look at a caller came to.
enum Progress {
    /// More is to come.
    Unfinished,
    /// Its request, or what it sent instead.
    Finished,
    /// It cannot be one any more, and why.
    Refused(&'static str),
    /// There is nobody to answer.
    Gone,
}

#[derive(Default)]
struct Server {
    /// The oldest first.
    reading: VecDeque<Reading>,
    waiting: Vec<Waiting>,
}

impl Server {
    /// Until there is something to do.
    fn sleep(&self, listener: &UnixListener) {
        let until = match (self.waiting.is_empty(), self.reading.front()) {
            // Answers are waited for in `answer`.
            (false, _) => Some(Duration::ZERO),
            (true, Some(oldest)) => Some(oldest.deadline.saturating_duration_since(Instant::now())),
            (true, None) => None,
        };
        let timeout = until.and_then(|until| Timespec::try_from(until).ok());
        let callers = self.reading.iter().map(|caller| PollFd::new(&caller.stream, PollFlags::IN));
        let mut fds: Vec<PollFd<'_>> =
            std::iter::once(PollFd::new(listener, PollFlags::IN)).chain(callers).collect();
        // Interrupted or failed: the sockets are looked at anyway.
        let _ = poll(&mut fds, timeout.as_ref());
    }

    fn accept(&mut self, listener: &UnixListener) {
        if self.reading.len() == MAX_READING {
            self.reading.drain(..ROOM);
        }
        while self.reading.len() < MAX_READING {
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => {
                    self.reading.pop_front();
                    std::thread::sleep(OUT_OF_DESCRIPTORS);
                    return;
                }
            };
            if stream.set_nonblocking(true).is_ok() {
                let deadline = Instant::now() + REQUEST_PATIENCE;
                self.reading.push_back(Reading { stream, bytes: Vec::new(), deadline });
            }
        }
    }

    /// Takes in what callers have sent; whole requests go to launch.
    fn read(&mut self, deliver: &impl Fn(Call)) {
        let now = Instant::now();
        for mut caller in std::mem::take(&mut self.reading) {
            match caller.look(now) {
                Progress::Unfinished => self.reading.push_back(caller),
                Progress::Finished => self.pass_on(caller, deliver),
                Progress::Refused(why) => say(&caller.stream, &Response::refused(why)),
                Progress::Gone => {}
            }
        }
        while self.reading.iter().map(|caller| caller.bytes.capacity()).sum::<usize>() > MAX_BUFFERED {
            self.reading.pop_front();
        }
    }

    fn pass_on(&mut self, caller: Reading, deliver: &impl Fn(Call)) {
        let request: Request = match serde_json::from_slice(&caller.bytes) {
            Ok(request) => request,
            Err(error) => {
                let why: String = format!("not a request: {error}").chars().take(QUOTED).collect();
                return say(&caller.stream, &Response::refused(why));
            }
        };
        let most = if request.is_answered_at_once() { MAX_AT_LAUNCH } else { MAX_WAITING };
        let busy = self.waiting.len() >= most;
        let busy = busy.then(|| format!("busy with {} other requests; try again", self.waiting.len()));
        if let Some(why) = request.refusal().or(busy) {
            return say(&caller.stream, &Response::refused(why));
        }
        let joins = matches!(request, Request::Join(_));
        let peer = joins.then(|| Peer::of(&caller.stream).ok()).flatten();
        let credentials = socket_peercred(&caller.stream).ok();
        let from = credentials.map(|peer| peer.pid.as_raw_nonzero().get().unsigned_abs());
        let (reply, answer) = bounded(1);
        deliver(Call { request, peer, from, reply });
        self.waiting.push(Waiting { stream: caller.stream, answer, deadline: Instant::now() + PATIENCE });
    }

    /// Writes the answers that are there, and waits a moment for the next one.
    fn answer(&mut self, page: &OwnedFd) {
        if self.waiting.is_empty() {
            return;
        }
        let mut any = Select::new();
        for caller in &self.waiting {
            any.recv(&caller.answer);
        }
        let _ = any.ready_timeout(LOOK);
        let now = Instant::now();
        self.waiting.retain(|caller| {
            let response = match caller.answer.try_recv() {
                Ok(response) => response,
                Err(TryRecvError::Empty) if now < caller.deadline => return true,
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => Response::refused(
                    "no answer in time; what was asked for may still be done: hilare status",
                ),
            };
            match response.place {
                Some(_) => say_with(&caller.stream, &response, page),
                None => say(&caller.stream, &response),
            }
            false
        });
    }
}

impl Reading {
    /// Takes in at most a chunk of what has come.
    fn look(&mut self, now: Instant) -> Progress {
        let before = self.bytes.len();
        let room = (MAX_REQUEST + 1 - before).min(CHUNK) as u64;
        let read = (&self.stream).take(room).read_to_end(&mut self.bytes);
        let line = self.bytes[before..].iter().position(|byte| *byte == b'\n');
        if let Some(end) = line {
            self.bytes.truncate(before + end);
            return Progress::Finished;
        }
        match read {
            _ if self.bytes.len() > MAX_REQUEST => Progress::Refused("the request is too long"),
            // As much as was asked for: there may be more.
            Ok(count) if count as u64 == room => Progress::Unfinished,
            // The caller has closed its side.
            Ok(_) if self.bytes.is_empty() => Progress::Gone,
            Ok(_) => Progress::Finished,
            Err(error) if error.kind() == ErrorKind::WouldBlock && now < self.deadline => {
                Progress::Unfinished
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                Progress::Refused("the request did not come in time")
            }
            Err(_) => Progress::Gone,
        }
    }
}

/// One line of JSON. What a caller does not take at once, it does not get.
fn say(mut stream: &UnixStream, response: &Response) {
    let _ = line(response).and_then(|line| stream.write_all(&line));
}

/// The same with the page beside it.
fn say_with(stream: &UnixStream, response: &Response, page: &OwnedFd) {
    let _ = line(response).and_then(|line| send_with(stream, &line, page));
}

fn line(response: &Response) -> io::Result<Vec<u8>> {
    let mut line = serde_json::to_vec(response)?;
    line.push(b'\n');
    Ok(line)
}
