//! The two processes of a peer: started, watched, ended.

#![allow(unsafe_code)]

use crate::conductor::SHARED_MEMORY;
use crate::links::{self, Launcher, Peer};
use crate::page::{Page, Side};
use crate::roles::page_file;
use crate::{Result, realtime};
use rustix::process::{Pid, Signal, kill_process, set_parent_process_death_signal};
use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

/// Longest time until both processes can be spoken to; dora's daemon takes some seconds.
const START: Duration = Duration::from_secs(60);
/// Longest silence in a turn.
const STALL: Duration = Duration::from_secs(10);
/// Time to leave before being made to.
const LEAVE: Duration = Duration::from_secs(10);
/// How often we look.
const POLL: Duration = Duration::from_millis(10);
/// SCHED_FIFO priority of dora's daemon: below the nodes, which it must not keep waiting.
const DAEMON_PRIORITY: i32 = 60;

/// Which processors, and what is where.
pub struct Setting {
    /// The run's directory.
    pub directory: PathBuf,
    /// The processor of the drivers, and of dora's daemon: on another one it is slower.
    pub driver_cpu: usize,
    /// The processor of the responders.
    pub responder_cpu: usize,
    /// dora's command line, if there is one.
    pub dora: Option<PathBuf>,
}

/// A peer at work.
pub struct Pair {
    /// Which.
    pub peer: &'static Peer,
    /// Where its samples are.
    pub page: Page,
    log: PathBuf,
    children: Vec<Child>,
}

impl Pair {
    /// Starts both processes and waits until they can be spoken to. `interrupted` ends the wait.
    pub fn start(
        peer: &'static Peer,
        samples: usize,
        setting: &Setting,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<Self> {
        let page = Page::create(&page_file(&setting.directory, peer.name), samples)?;
        let log = setting.directory.join(format!("{}.log", peer.name));
        let mut pair = Self { peer, page, log, children: Vec::new() };
        match peer.launcher {
            Launcher::Conductor => {
                pair.spawn(&mut role(peer, Side::Responder, setting)?)?;
                pair.await_ready(Side::Responder, interrupted)?;
                pair.spawn(&mut role(peer, Side::Driver, setting)?)?;
            }
            Launcher::Dora => pair.spawn(&mut daemon(peer, setting)?)?,
        }
        pair.await_ready(Side::Responder, interrupted)?;
        pair.await_ready(Side::Driver, interrupted)?;
        Ok(pair)
    }

    fn spawn(&mut self, command: &mut Command) -> Result<()> {
        let log = File::options().create(true).append(true).open(&self.log)?;
        command.stdin(std::process::Stdio::null()).stdout(log.try_clone()?).stderr(log);
        // A group of its own: Ctrl-C is for the conductor, which ends the others in order.
        command.process_group(0);
        // SAFETY: between fork and exec; a system call, no allocation, no memory of ours.
        unsafe { command.pre_exec(|| Ok(set_parent_process_death_signal(Some(Signal::KILL))?)) };
        let program = command.get_program().to_owned();
        let child = command.spawn().map_err(|error| format!("{}: {error}", program.display()))?;
        self.children.push(child);
        Ok(())
    }

    fn await_ready(&mut self, side: Side, interrupted: &dyn Fn() -> bool) -> Result<()> {
        let deadline = Instant::now() + START;
        while self.page.ready(side).is_none() {
            self.check()?;
            if interrupted() {
                return Err("interrupted".into());
            }
            if Instant::now() > deadline {
                return Err(self.fault(&format!("{side:?} not ready within {} s", START.as_secs())));
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// Lets the driver take so many samples and waits for them.
    pub fn turn(&mut self, samples: u32, interrupted: &dyn Fn() -> bool) -> Result<()> {
        let goal = self.page.done() + samples;
        self.page.allow(samples);
        let (mut done, mut heard) = (self.page.done(), Instant::now());
        while done < goal {
            std::thread::sleep(POLL);
            self.check()?;
            if interrupted() {
                return Err("interrupted".into());
            }
            if self.page.done() > done {
                (done, heard) = (self.page.done(), Instant::now());
            } else if heard.elapsed() > STALL {
                return Err(self.fault(&format!("no answer to a pose for {} s", STALL.as_secs())));
            }
        }
        Ok(())
    }

    /// What the kernel granted to whom.
    pub fn granted(&self) -> Vec<(&'static str, String)> {
        let of = |side, name| self.page.ready(side).map(|pid| (name, realtime::granted(pid)));
        let mut all: Vec<_> =
            [of(Side::Driver, "driver"), of(Side::Responder, "responder")].into_iter().flatten().collect();
        if self.peer.launcher == Launcher::Dora {
            all.extend(self.children.first().map(|daemon| ("daemon", realtime::granted(daemon.id()))));
        }
        all
    }

    fn check(&mut self) -> Result<()> {
        let ended: Option<ExitStatus> =
            self.children.iter_mut().find_map(|child| child.try_wait().ok().flatten());
        ended.map_or(Ok(()), |status| Err(self.fault(&format!("a process ended early, {status}"))))
    }

    /// An error with what the processes said last.
    fn fault(&self, what: &str) -> crate::Error {
        let said = fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = said.lines().filter(|line| !line.trim().is_empty()).collect();
        let last = lines[lines.len().saturating_sub(5)..].join(" / ");
        format!("{what}; it said: {}", if last.is_empty() { "nothing" } else { &last }).into()
    }
}

impl Drop for Pair {
    /// Asks the processes to leave, so that they take away what they made; then makes them.
    fn drop(&mut self) {
        // Who leaves has nothing urgent to do. And dora's daemon, where it was left at a priority over the
        // responder's, waited in the kernel for it without letting it run, and could not even be killed.
        let ready = [Side::Driver, Side::Responder].into_iter().filter_map(|side| self.page.ready(side));
        let processes: Vec<u32> = ready.chain(self.children.iter().map(Child::id)).collect();
        processes.iter().copied().for_each(realtime::release);
        let left_behind: Vec<PathBuf> = processes.iter().copied().flat_map(zenoh_segments).collect();
        self.page.dismiss();
        if !self.peer.returns {
            self.children.iter().for_each(|child| _ = kill_process(Pid::from_child(child), Signal::TERM));
        }
        let deadline = Instant::now() + LEAVE;
        for child in &mut self.children {
            while matches!(child.try_wait(), Ok(None)) && Instant::now() < deadline {
                std::thread::sleep(POLL);
            }
            let _ = child.kill();
            let _ = child.wait();
        }
        left_behind.iter().for_each(|file| _ = fs::remove_file(file));
    }
}

/// zenoh's files in shared memory that a process has mapped. dora's daemon does not always take away its own.
fn zenoh_segments(pid: u32) -> Vec<PathBuf> {
    let maps = fs::read_to_string(format!("/proc/{pid}/maps")).unwrap_or_default();
    let files = maps.lines().filter_map(|line| line.find('/').map(|start| PathBuf::from(&line[start..])));
    let zenohs = |file: &PathBuf| {
        file.starts_with(SHARED_MEMORY) && file.extension().is_some_and(|end| end == "zenoh")
    };
    files.filter(zenohs).collect()
}

fn role(peer: &Peer, side: Side, setting: &Setting) -> Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(role_arguments(peer, side, setting));
    Ok(command)
}

fn role_arguments(peer: &Peer, side: Side, setting: &Setting) -> [String; 6] {
    let (name, cpu) = match side {
        Side::Driver => ("drive", setting.driver_cpu),
        Side::Responder => ("respond", setting.responder_cpu),
    };
    let directory = setting.directory.display().to_string();
    [name.into(), peer.name.into(), "--directory".into(), directory, "--cpu".into(), cpu.to_string()]
}

/// dora's daemon, with a dataflow of this peer's two processes. It is not a real-time program: what it keeps
/// in memory is not locked.
fn daemon(peer: &Peer, setting: &Setting) -> Result<Command> {
    let dora = setting.dora.as_ref().ok_or("no dora command line; benches/peers/run installs it")?;
    let arguments = |side| role_arguments(peer, side, setting).join(" ");
    let (driver, responder) = (arguments(Side::Driver), arguments(Side::Responder));
    let dataflow = links::write_dataflow(&setting.directory, &std::env::current_exe()?, &driver, &responder)?;
    let mut command = Command::new(dora);
    command.arg("run").arg(dataflow).current_dir(&setting.directory);
    // Everybody is told everybody's address; nothing is asked of a network.
    command.env("DORA_ZENOH_MULTICAST", "off");
    let cpu = setting.driver_cpu;
    // SAFETY: between fork and exec; two system calls, no allocation, no memory of ours.
    unsafe {
        command.pre_exec(move || {
            realtime::place(DAEMON_PRIORITY, cpu);
            Ok(())
        })
    };
    Ok(command)
}
