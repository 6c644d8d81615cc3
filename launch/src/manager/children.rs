//! Worker processes: started as this very binary, watched by pidfd, never orphaned.

use super::Event;
use super::join::Peer;
use crate::logging::LogSink;
use crate::shell::page::{PAGE_FD, SharedPage};
use crate::shell::realtime::set_fifo;
use crate::shell::transport::Sweeper;
use crossbeam_channel::{Receiver, Sender, bounded};
use hilare_interfaces::wires::Role;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open, pidfd_send_signal};
use rustix::thread::set_name;
use std::ffi::CString;
use std::io::{self, BufRead, BufReader, Read, pipe};
use std::os::fd::OwnedFd;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::Duration;

/// Stack of the small watching threads.
pub(super) const STACK: usize = 128 << 10;
/// Priority of a thread that waits for a death: just above launch's loop, which it wakes.
pub(super) const WATCH_PRIORITY: u64 = super::LAUNCH_PRIORITY + 1;
/// Longest wait for the last line of one that is gone. Far shorter than the lease that launch renews.
const LAST_WORDS_PATIENCE: Duration = Duration::from_millis(20);
const PROGRAM_NAME: &str = env!("CARGO_PKG_NAME");
/// Longest line taken from a worker; more is cut.
const MAX_LINE: u64 = 64 << 10;

/// A started worker.
pub struct Running {
    /// Process id.
    pub pid: u32,
    pidfd: Arc<OwnedFd>,
    /// Empty for one whose standard error goes elsewhere.
    last_words: Option<Receiver<String>>,
}

impl Running {
    /// Sends a signal; to this very process, even if its number was used again.
    pub fn signal(&self, signal: Signal) {
        let _ = pidfd_send_signal(&*self.pidfd, signal);
    }

    /// The last line that a process that is gone wrote to its standard error; empty for none. Waits a moment
    /// for it: the end is known at once, the line may be on its way.
    pub fn last_words(&self) -> String {
        let words = self.last_words.as_ref();
        words.and_then(|words| words.recv_timeout(LAST_WORDS_PATIENCE).ok()).unwrap_or_default()
    }
}

/// What to start.
pub struct Start<'a> {
    /// The box.
    pub role: Role,
    /// Its slot.
    pub slot: usize,
    /// Which incarnation of the slot, for events.
    pub incarnation: u64,
    /// Further arguments of `hilare service`.
    pub arguments: Vec<String>,
    /// The page to inherit.
    pub page: &'a SharedPage,
    /// Watch it in real time, so that its death is known at once on a busy machine, too.
    pub realtime: bool,
    /// Who frees those that wait for it when it is dead.
    pub sweeper: &'a Sweeper,
}

/// A command that runs this very binary, even if another one lies in its place by now: that may have other
/// wires.
pub(crate) fn this_program() -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0(std::env::args_os().next().unwrap_or_else(|| PROGRAM_NAME.into()));
    command
}

/// Gives the process the name it would have if it had been started by its path.
pub(crate) fn name_this_process() {
    if let Ok(name) = CString::new(PROGRAM_NAME) {
        let _ = set_name(&name);
    }
}

/// Starts a worker. Its end comes as [`Event::Died`]; what it prints goes to the log, but what the recorder prints on
/// its standard output comes as [`Event::Output`].
///
/// From the thread that calls it: workers die with this thread (PDEATHSIG).
pub fn start(what: &Start<'_>, events: &Sender<Event>, log: &LogSink) -> io::Result<Running> {
    let mut command = this_program();
    command
        .arg("service")
        .arg(what.role.name())
        .args(&what.arguments)
        .env(PAGE_FD, what.page.inherited_fd())
        // Out of the terminal's group: Ctrl-C is for launch, which stops the robot first.
        .process_group(0)
        .stdin(Stdio::null());
    let (errors, said) = pipe()?;
    if what.role == Role::Recorder {
        command.stdout(Stdio::piped()).stderr(said);
    } else {
        // What a program that is not ours prints belongs in the log.
        command.stdout(said.try_clone()?).stderr(said);
    }
    let threads = || std::thread::Builder::new().stack_size(STACK);
    let (sink, name, slot) = (log.clone(), what.role.name(), what.slot);
    let (last, last_words) = bounded(1);
    threads().spawn(move || {
        let mut newest = String::new();
        for_each_line(errors, |line| {
            sink.worker_line(slot, name, line);
            if !line.trim().is_empty() {
                line.clone_into(&mut newest);
            }
        });
        let _ = last.send(newest);
    })?;
    // Its watcher is there before it is: what nobody watches must not live.
    let (born, birth) = bounded::<(Child, Arc<OwnedFd>)>(1);
    let (kills_before, realtime, sweeper) = (memory_kills(), what.realtime, what.sweeper.clone());
    let (events, incarnation) = (events.clone(), what.incarnation);
    threads().spawn(move || {
        let Ok((mut child, pidfd)) = birth.recv() else { return };
        if let Some(output) = child.stdout.take() {
            for_each_line(output, |line| {
                let _ = events.send(Event::Output { slot, line: line.to_owned() });
            });
        }
        if realtime {
            let _ = set_fifo(WATCH_PRIORITY, false);
        }
        wait(&pidfd);
        sweeper.call();
        // Whatever it has started and not taken along: its number is taken until it is waited for.
        let _ = kill_process_group(Pid::from_child(&child), Signal::KILL);
        let how = describe(child.wait().ok(), kills_before);
        let _ = events.send(Event::Died { slot, incarnation, how });
    })?;
    let mut child = command.spawn()?;
    // Its ends of the pipe are the child's alone: when it is gone, the reader sees the end.
    drop(command);
    let pid = child.id();
    match pidfd_open(Pid::from_child(&child), PidfdFlags::empty()) {
        Ok(pidfd) => {
            let pidfd = Arc::new(pidfd);
            let _ = born.send((child, Arc::clone(&pidfd)));
            Ok(Running { pid, pidfd, last_words: Some(last_words) })
        }
        Err(error) => {
            let _ = child.kill();
            let _ = child.wait();
            Err(error.into())
        }
    }
}

fn for_each_line(from: impl Read, mut act: impl FnMut(&str)) {
    let mut reader = BufReader::new(from);
    let mut line = Vec::new();
    loop {
        line.clear();
        match reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => act(String::from_utf8_lossy(&line).trim_end()),
        }
    }
}

/// Waits until a process is gone.
pub(super) fn wait(pidfd: &OwnedFd) {
    let mut fds = [PollFd::new(pidfd, PollFlags::IN)];
    while poll(&mut fds, None) == Err(rustix::io::Errno::INTR) {}
}

/// Takes on a worker that somebody else started. Its end comes as [`Event::Died`]; how it ended, only
/// whoever started it can tell.
pub(super) fn adopt(
    peer: Peer,
    slot: usize,
    incarnation: u64,
    realtime: bool,
    events: &Sender<Event>,
    sweeper: Sweeper,
) -> io::Result<Running> {
    let Peer { pid, pidfd } = peer;
    let pidfd = Arc::new(pidfd);
    let (events, watched) = (events.clone(), Arc::clone(&pidfd));
    std::thread::Builder::new().stack_size(STACK).spawn(move || {
        if realtime {
            let _ = set_fifo(WATCH_PRIORITY, false);
        }
        wait(&watched);
        sweeper.call();
        let _ = events.send(Event::Died { slot, incarnation, how: "is gone".to_owned() });
    })?;
    Ok(Running { pid, pidfd, last_words: None })
}

/// Times the kernel has killed for want of memory since it was booted.
fn memory_kills() -> u64 {
    let text = std::fs::read_to_string("/proc/vmstat").unwrap_or_default();
    let count = text.lines().find_map(|line| line.strip_prefix("oom_kill "));
    count.and_then(|count| count.trim().parse().ok()).unwrap_or(0)
}

fn describe(status: Option<ExitStatus>, kills_before: u64) -> String {
    match status {
        Some(status) => match (status.code(), status.signal()) {
            (Some(0), _) => "ended with code 0".to_owned(),
            (Some(code), _) => format!("ended with code {code}"),
            (_, Some(9)) if memory_kills() > kills_before => "was killed for want of memory".to_owned(),
            (_, Some(9)) => "was killed (signal 9)".to_owned(),
            (_, Some(7)) => "was killed by a bus error (is /dev/shm full?)".to_owned(),
            (_, signal) => format!("was killed by signal {}", signal.unwrap_or(0)),
        },
        None => "ended".to_owned(),
    }
}
