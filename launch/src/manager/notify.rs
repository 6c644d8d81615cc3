//! What launch tells the service manager that started it (sd_notify(3)): that the robot is up, what it is
//! doing, that launch is alive, that it is ending.
//!
//! Said from launch's own loop and from nowhere else, so a loop that hangs falls silent. Never blocks: a
//! service manager that does not read must not cost the lease on the step generator. What could not be
//! sent is said again.

use super::{LEAVE_PATIENCE, Manager, REST_PATIENCE, START_PATIENCE};
use crate::shell::ClockKind;
use hilare_interfaces::messages::{Drive, Mode, ReferenceState};
use std::ffi::OsStr;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};
use tracing::warn;

/// Longest time from the start of launch to a robot that is up: ports, first heartbeats, first path.
pub const LONGEST_START: Duration = START_PATIENCE.saturating_mul(3);
/// Longest time from the wish to end to the end of launch: rest, recorder, workers.
pub const LONGEST_END: Duration = REST_PATIENCE.saturating_mul(3).saturating_add(LEAVE_PATIENCE);

/// What the service manager is told about, read from launch's loop.
#[derive(Clone, Debug, Default, PartialEq)]
struct View {
    /// Every worker is at work.
    up: bool,
    /// The robot is being taken down, wanted or not.
    ending: bool,
    /// The real clock has to tick: the robot is armed.
    must_tick: bool,
    /// Ticks executed.
    tick: u64,
    mode: u64,
    drive: u64,
    path: u64,
    fault: Option<String>,
    /// Why the robot has to be armed again, if so.
    halted: Option<String>,
}

impl View {
    /// One line for `systemctl status`.
    fn status(&self) -> String {
        if let Some(fault) = &self.fault {
            return format!("fault: {}", one_line(fault));
        }
        if self.ending {
            return "ending".to_owned();
        }
        if !self.up {
            return "starting".to_owned();
        }
        let mode = Mode::from_code(self.mode).map_or("unknown", Mode::label);
        let drive = Drive::from_code(self.drive).map_or("unknown", Drive::label);
        let path = ReferenceState::from_code(self.path).map_or("unknown", ReferenceState::label);
        let drive = if mode == drive { String::new() } else { format!(", {drive}") };
        let halted = self.halted.as_ref().map_or(String::new(), |why| format!("; {}", one_line(why)));
        format!("{mode}{drive}; path {path}{halted}")
    }

    /// True if both give the same line; compared 50 times a second, so without building it.
    fn reads_like(&self, other: &Self) -> bool {
        let stage = |view: &Self| (view.up, view.ending);
        let drives = |view: &Self| (view.mode, view.drive, view.path);
        stage(self) == stage(other)
            && (&self.fault, &self.halted) == (&other.fault, &other.halted)
            && (!self.up || self.ending || drives(self) == drives(other))
    }
}

/// A message is lines: what it tells must not add one.
fn one_line(text: &str) -> String {
    text.replace('\n', " | ")
}

/// The way to the service manager; silent if there is none.
pub(super) struct Notify {
    to: Option<(UnixDatagram, SocketAddr)>,
    /// Time between two signs of life: half of what the service manager waits.
    interval: Option<Duration>,
    ready: bool,
    stopping: bool,
    said: Option<View>,
    /// When it was last fed, and the tick then; none before the robot was up.
    fed: Option<(Instant, u64)>,
}

impl Notify {
    /// As the environment says: `NOTIFY_SOCKET`, `WATCHDOG_USEC`, `WATCHDOG_PID`.
    pub(super) fn from_environment() -> Self {
        let to = std::env::var_os("NOTIFY_SOCKET").and_then(|name| {
            let opened = open(&name);
            opened.inspect_err(|error| warn!("NOTIFY_SOCKET {}: {error}", name.display())).ok()
        });
        let number = |name: &str| std::env::var(name).ok()?.parse::<u64>().ok();
        let ours = number("WATCHDOG_PID").is_none_or(|pid| pid == u64::from(std::process::id()));
        let patience = number("WATCHDOG_USEC").filter(|us| ours && *us > 0);
        Self::new(to, patience.map(|us| Duration::from_micros(us) / 2))
    }

    fn new(to: Option<(UnixDatagram, SocketAddr)>, interval: Option<Duration>) -> Self {
        Self { to, interval, ready: false, stopping: false, said: None, fed: None }
    }

    /// Says what there is to say.
    fn tell(&mut self, now: Instant, view: &View) {
        let Some((socket, address)) = &self.to else { return };
        let Some(text) = self.message(now, view) else { return };
        if socket.send_to_addr(text.as_bytes(), address).is_ok() {
            self.ready |= view.up;
            self.stopping |= view.ending;
            self.said = Some(view.clone());
            if text.contains(ALIVE) {
                self.fed = Some((now, view.tick));
            }
        }
    }

    /// What is to be said at `now`, as lines of sd_notify(3).
    fn message(&self, now: Instant, view: &View) -> Option<String> {
        let mut text = String::new();
        if view.up && !view.ending && !self.ready {
            text.push_str("READY=1\n");
        }
        if view.ending && !self.stopping {
            text.push_str("STOPPING=1\n");
        }
        if !self.said.as_ref().is_some_and(|said| said.reads_like(view)) {
            text.push_str(&format!("STATUS={}\n", view.status()));
        }
        if self.interval.is_some_and(|interval| self.alive(now, interval, view)) {
            text.push_str(ALIVE);
        }
        (!text.is_empty()).then_some(text)
    }

    /// A sign of life is due and deserved.
    fn alive(&self, now: Instant, interval: Duration, view: &View) -> bool {
        if !view.up || view.ending {
            return false;
        }
        self.fed.is_none_or(|(at, tick)| {
            // A clock begun anew counts from zero: any other tick is a sign of life.
            now.duration_since(at) >= interval && (!view.must_tick || view.tick != tick)
        })
    }
}

/// The sign of life.
const ALIVE: &str = "WATCHDOG=1\n";

/// A socket to send from, and the address: a path, or `@name` in the abstract name space.
fn open(name: &OsStr) -> io::Result<(UnixDatagram, SocketAddr)> {
    let address = match name.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
        [b'/', ..] => SocketAddr::from_pathname(name)?,
        _ => return Err(io::ErrorKind::Unsupported.into()),
    };
    let socket = UnixDatagram::unbound()?;
    socket.set_nonblocking(true)?;
    Ok((socket, address))
}

impl Manager {
    /// Once a turn of launch's loop.
    pub(super) fn tell_service_manager(&mut self, now: Instant) {
        if self.notify.to.is_none() {
            return;
        }
        let armed = self.authority.mode == Mode::Armed.code();
        let view = View {
            up: self.up,
            ending: self.leaving || self.told_to_end() || self.fault.is_some(),
            must_tick: armed && self.job.clock == ClockKind::Real,
            tick: self.newest.steps.tick,
            mode: self.authority.mode,
            drive: self.newest.steps.drive,
            path: self.newest.reference.state,
            fault: self.fault.clone(),
            halted: self.halted.clone(),
        };
        self.notify.tell(now, &view);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: Duration = Duration::from_millis(100);

    /// A service manager that listens, and what is told to it.
    struct Ear {
        socket: UnixDatagram,
        notify: Notify,
        start: Instant,
    }

    impl Ear {
        fn new(what: &str) -> Self {
            let name = format!("@hilare-test-{}-{what}", std::process::id());
            let socket = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(&name[1..]).unwrap());
            let socket = socket.unwrap();
            socket.set_nonblocking(true).unwrap();
            let notify = Notify::new(Some(open(OsStr::new(&name)).unwrap()), Some(INTERVAL));
            Self { socket, notify, start: Instant::now() }
        }

        /// What is heard when launch's loop comes by `after_ms` milliseconds after its start.
        fn hears(&mut self, after_ms: u64, view: &View) -> String {
            self.notify.tell(self.start + Duration::from_millis(after_ms), view);
            let mut bytes = [0; 512];
            let length = self.socket.recv(&mut bytes).unwrap_or(0);
            String::from_utf8_lossy(&bytes[..length]).into_owned()
        }
    }

    fn up(tick: u64) -> View {
        View { up: true, tick, must_tick: true, mode: Mode::Armed.code(), ..View::default() }
    }

    #[test]
    fn a_robot_comes_up_is_told_once_and_goes() {
        let mut ear = Ear::new("life");
        assert_eq!(ear.hears(0, &View::default()), "STATUS=starting\n");
        assert_eq!(ear.hears(1, &View::default()), "");
        let ready = ear.hears(2, &up(0));
        assert!(ready.starts_with("READY=1\nSTATUS=armed") && ready.ends_with(ALIVE), "{ready}");
        assert_eq!(ear.hears(3, &up(1)), "");
        let ending = View { ending: true, ..up(2) };
        assert_eq!(ear.hears(4, &ending), "STOPPING=1\nSTATUS=ending\n");
        let stopped = View { mode: Mode::Stop.code(), ..ending };
        assert_eq!(ear.hears(500, &stopped), "", "neither news nor a sign of life while it ends");
    }

    #[test]
    fn signs_of_life_need_ticks_where_it_is_armed() {
        let mut ear = Ear::new("ticks");
        assert!(ear.hears(0, &up(7)).contains(ALIVE));
        assert_eq!(ear.hears(99, &up(8)), "", "not due");
        assert_eq!(ear.hears(100, &up(7)), "", "due, but the clock stands");
        assert_eq!(ear.hears(250, &up(7)), "");
        assert_eq!(ear.hears(251, &up(9)), ALIVE, "as soon as it goes on");
        let disarmed = View { must_tick: false, ..up(9) };
        assert_eq!(ear.hears(351, &disarmed), ALIVE, "a clock that need not tick");
        assert_eq!(ear.hears(451, &up(0)), ALIVE, "a clock begun anew");
    }

    #[test]
    fn what_was_not_taken_is_said_again() {
        let mut ear = Ear::new("full");
        // Nobody reads: the queue of a datagram socket is short.
        let mut turns = 0;
        while let Some((socket, address)) = &ear.notify.to {
            turns += 1;
            if socket.send_to_addr(b"x", address).is_err() {
                break;
            }
        }
        assert!(turns > 1);
        ear.notify.tell(ear.start, &up(0));
        assert!(!ear.notify.ready, "it did not get through");
        let mut byte = [0; 8];
        while ear.socket.recv(&mut byte).is_ok() {}
        assert!(ear.hears(1, &up(0)).starts_with("READY=1\n"));
    }

    #[test]
    fn a_fault_is_one_line() {
        let fault = View { fault: Some("plant was killed\nREADY=1".to_owned()), ending: true, ..up(3) };
        let message = Ear::new("fault").hears(0, &fault);
        assert_eq!(message, "STOPPING=1\nSTATUS=fault: plant was killed | READY=1\n");
    }
}
