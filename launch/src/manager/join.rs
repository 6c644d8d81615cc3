//! Workers that somebody else starts, a service manager for one: they join a launch that awaits them.
//!
//! ```text
//! hilare service ROLE --join ROBOT ──{"join":"controller"}──────────▶ control socket
//!                                  ◀──{"place":["--slot","0",…]}───── and the page, as a descriptor
//! becomes, by exec, the process that launch would have started
//! ```
//!
//! Launch knows who joined from the socket, holds on to it by a pidfd, and from then on treats it as its
//! own. What differs is the end: launch cannot read its exit code, and it does not die with launch by
//! the kernel's doing, but watches launch as launch watches it.

use super::control::{Request, Response, send};
use super::member::Duty;
use super::robot_dir::living_robots;
use super::{Failure, Job, Manager, children, start};
use crate::config::System;
use crate::shell::ClockKind;
use clap::ValueEnum;
use hilare_interfaces::wires::Role;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::sockopt::socket_peercred;
use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage,
    SendFlags, recvmsg, sendmsg,
};
use rustix::process::{Pid, PidfdFlags, Signal, getpid, kill_process, pidfd_open};
use std::io::{self, IoSlice, IoSliceMut, Write};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};
use tracing::info;

/// How long a worker waits for its robot, and for its place in it.
const JOIN_PATIENCE: Duration = super::notify::LONGEST_START;
/// Time between two requests.
const JOIN_RETRY: Duration = Duration::from_millis(10);

/// Longest answer to a request to join.
const MAX_ANSWER: usize = 64 << 10;

/// Who starts the workers of a robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Workers {
    /// Launch does.
    #[default]
    Own,
    /// Somebody else does; launch waits for them to join.
    Joined,
}

impl Workers {
    /// Name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Joined => "joined",
        }
    }
}

/// The workers that join a system's launch, if they are to: their boxes, and whether one is the standby.
pub fn joiners(system: &System) -> Vec<(Role, bool)> {
    let job = Job {
        system: system.clone(),
        clock: ClockKind::Real,
        task: None,
        record: false,
        recording: None,
        workers: Workers::Joined,
    };
    let members = start::members(&job).into_iter().filter(|member| member.joined);
    members.map(|member| (member.role, member.duty == Duty::Standby)).collect()
}

/// The process at the other end of a connection.
pub struct Peer {
    /// Process id.
    pub pid: u32,
    /// The process itself, whatever its number is used for later.
    pub pidfd: OwnedFd,
}

impl Peer {
    /// Who connected; an error if it is gone or is another user's.
    pub fn of(stream: &UnixStream) -> io::Result<Self> {
        let credentials = socket_peercred(stream)?;
        if credentials.uid != rustix::process::geteuid() {
            return Err(io::Error::other("a process of another user"));
        }
        let pidfd = pidfd_open(credentials.pid, PidfdFlags::empty())?;
        // Its number may be another's by now, unless it still holds the other end.
        let mut ends = [PollFd::new(stream, PollFlags::empty())];
        poll(&mut ends, Some(&Timespec { tv_sec: 0, tv_nsec: 0 }))?;
        if ends[0].revents().contains(PollFlags::HUP) {
            return Err(io::Error::other("it is gone"));
        }
        Ok(Self { pid: credentials.pid.as_raw_nonzero().get().unsigned_abs(), pidfd })
    }
}

/// A worker's place in a robot: what launch would have started it with.
pub struct Place {
    /// Arguments of `hilare service`.
    pub arguments: Vec<String>,
    /// The page, to be inherited.
    pub page: OwnedFd,
}

impl Manager {
    /// Somebody wants to be the `role` of this robot.
    pub(super) fn join(&mut self, role: &str, peer: Option<Peer>) -> Response {
        let Some(role) = Role::from_name(role).filter(|role| *role != Role::Launch) else {
            return Response::refused(format!("there is no service {role:?}"));
        };
        if !self.members.iter().any(|member| member.role == role && member.joined) {
            return Response::refused(format!("launch starts its {} itself", role.name()));
        }
        let invited =
            |slot: &usize| self.members[*slot].role == role && self.members[*slot].invitation.is_some();
        let Some(slot) = (0..self.members.len()).find(invited).filter(|_| !self.leaving) else {
            return Response::later(format!("no place for a {} at present", role.name()));
        };
        let Some(peer) = peer else { return Response::later("who asks is gone") };
        let member = &mut self.members[slot];
        let (pid, incarnation) = (peer.pid, member.incarnation);
        let realtime = self.job.clock == ClockKind::Real;
        match children::adopt(peer, slot, incarnation, realtime, &self.sender, self.sweeper.clone()) {
            Ok(running) => {
                let place = member.invitation.take();
                info!("{} has joined, pid {pid}", member.name());
                self.began(slot, running);
                Response { place, ..Response::done("joined") }
            }
            Err(error) => Response::later(error.to_string()),
        }
    }
}

/// Waits for a place in a robot. Refused where waiting is of no use.
pub fn find_place(robot: &str, role: Role) -> Result<Place, Failure> {
    let deadline = Instant::now() + JOIN_PATIENCE;
    let request = Request::Join(role.name().to_owned());
    loop {
        let living = living_robots().into_iter().find(|living| living.robot == robot);
        let why = match living.map(|living| ask_for_place(&living.socket, &request)) {
            Some(Ok((response, page))) => match (response.place, page) {
                (Some(arguments), Some(page)) => return Ok(Place { arguments, page }),
                _ if !response.later => {
                    return Err(Failure::Refused(format!("robot {robot:?}: {}", response.message)));
                }
                _ => response.message,
            },
            // It is about to listen, or about to go.
            Some(Err(error)) => format!("it does not answer: {error}"),
            None => "it is not up".to_owned(),
        };
        if Instant::now() > deadline {
            let up = format!("hilare up SYSTEM --robot {robot} --workers joined");
            let waited = format!("waited {} s for robot {robot:?}: {why}; {up}", JOIN_PATIENCE.as_secs());
            return Err(Failure::Fault(waited));
        }
        std::thread::sleep(JOIN_RETRY);
    }
}

/// Asks the launch that listens on a socket for a place; the page comes with it.
fn ask_for_place(socket: &Path, request: &Request) -> io::Result<(Response, Option<OwnedFd>)> {
    let stream = send(socket, request)?;
    let (mut text, mut page) = (Vec::new(), None);
    while !text.ends_with(b"\n") {
        let mut bytes = [0; 4096];
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
        let mut control = RecvAncillaryBuffer::new(&mut space);
        // Not closed on exec: it is meant for the process that this one becomes.
        let part = recvmsg(&stream, &mut [IoSliceMut::new(&mut bytes)], &mut control, RecvFlags::empty())?;
        for message in control.drain() {
            if let RecvAncillaryMessage::ScmRights(mut descriptors) = message {
                page = descriptors.next().or(page);
            }
        }
        text.extend_from_slice(&bytes[..part.bytes]);
        if part.bytes == 0 || text.len() > MAX_ANSWER {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
    Ok((serde_json::from_slice(&text)?, page))
}

/// Sends an answer with a descriptor beside it.
pub(super) fn send_with(stream: &UnixStream, bytes: &[u8], page: &OwnedFd) -> io::Result<()> {
    let descriptors = [page.as_fd()];
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut control = SendAncillaryBuffer::new(&mut space);
    if !control.push(SendAncillaryMessage::ScmRights(&descriptors)) {
        return Err(io::Error::other("no room for a descriptor"));
    }
    let sent = sendmsg(stream, &[IoSlice::new(bytes)], &mut control, SendFlags::NOSIGNAL)?;
    let mut stream = stream;
    stream.write_all(&bytes[sent..])
}

/// Launch, seen from a worker that is not its child.
pub struct Watch(OwnedFd);

impl Watch {
    /// From here on this process is told to leave when launch is gone.
    pub fn over(launch_pid: i32) -> io::Result<Self> {
        let pid = Pid::from_raw(launch_pid).ok_or(io::ErrorKind::InvalidInput)?;
        let watch = Self(pidfd_open(pid, PidfdFlags::empty())?);
        let watched = watch.0.try_clone()?;
        std::thread::Builder::new().name("launch".into()).stack_size(children::STACK).spawn(move || {
            children::wait(&watched);
            let _ = kill_process(getpid(), Signal::TERM);
        })?;
        Ok(watch)
    }

    /// True if launch is gone.
    pub fn is_gone(&self) -> bool {
        let mut fds = [PollFd::new(&self.0, PollFlags::IN)];
        poll(&mut fds, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })).is_ok_and(|ready| ready > 0)
    }
}
