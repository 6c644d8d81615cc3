//! The page of one peer: shared memory in which its two processes and the conductor meet.
//!
//! It carries whose turn it is, how far each process is, the samples, and the bells of the peers that
//! are woken by a futex. All of it is atomics, and all zero is a valid, new page.

#![allow(unsafe_code)]

use crate::Result;
use crate::messages::{COMMAND_WORDS, POSE_WORDS};
use rustix::fs::ftruncate;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;
use rustix::time::Timespec;
use std::fs::{File, OpenOptions};
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::atomic::{AtomicU32, AtomicU64};
use std::time::Duration;

/// A word to sleep on. Own cache lines, so that one process's bell does not slow another's.
#[repr(C, align(128))]
#[derive(Default)]
pub struct Bell {
    rung: AtomicU32,
    waiting: AtomicU32,
}

impl Bell {
    /// Wakes who waits; without one, no system call.
    pub fn ring(&self) {
        // SeqCst on both sides: either the waiter sees the new count, or we see that it waits.
        self.rung.fetch_add(1, SeqCst);
        if self.waiting.load(SeqCst) != 0 {
            let _ = futex::wake(&self.rung, futex::Flags::empty(), i32::MAX as u32);
        }
    }

    /// How often it was rung; read it before looking for messages, then give it to [`Bell::wait`].
    pub fn rung(&self) -> u32 {
        self.rung.load(SeqCst)
    }

    /// Sleeps until the count is no longer `seen`, a signal comes, or `timeout` is over.
    pub fn wait(&self, seen: u32, timeout: Option<Duration>) {
        let timeout = timeout.map(|timeout| Timespec {
            tv_sec: timeout.as_secs() as i64,
            tv_nsec: timeout.subsec_nanos().into(),
        });
        self.waiting.store(1, SeqCst);
        if self.rung.load(SeqCst) == seen {
            // EINTR, EAGAIN and time-out all mean the same to the caller: look again.
            let _ = futex::wait(&self.rung, futex::Flags::empty(), seen, timeout.as_ref());
        }
        self.waiting.store(0, SeqCst);
    }
}

/// One of a peer's two processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Sends poses, takes commands.
    Driver = 0,
    /// Takes poses, sends commands.
    Responder = 1,
}

/// One round, ns.
#[repr(C)]
#[derive(Default)]
pub struct Sample {
    lateness: AtomicU64,
    one_way: AtomicU64,
    round: AtomicU64,
}

/// What a [`Sample`] says, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Round {
    /// From the instant the driver asked to be woken at to its sending.
    pub lateness: u64,
    /// From its sending to the responder's having the pose.
    pub one_way: u64,
    /// From its sending to its having the command.
    pub round: u64,
}

#[repr(C)]
struct Header {
    turn: Bell,
    /// For the futex peers: there is a new pose.
    pose: Bell,
    /// For the futex peers: there is a new command.
    command: Bell,
    pose_words: [AtomicU64; POSE_WORDS],
    command_words: [AtomicU64; COMMAND_WORDS],
    /// Samples the driver may have taken by now.
    allowed: AtomicU32,
    /// Samples it has taken.
    done: AtomicU32,
    /// Periods it left out because a round, or the host, took longer.
    skipped: AtomicU32,
    leaving: AtomicU32,
    /// Process ids, by [`Side`]; 0 until the process is ready.
    ready: [AtomicU32; 2],
}

/// The page, mapped into this process.
pub struct Page {
    header: NonNull<Header>,
    samples: usize,
}

// SAFETY: the page consists of atomics only.
unsafe impl Send for Page {}
// SAFETY: as above.
unsafe impl Sync for Page {}

impl Page {
    /// The conductor: a new page with room for `samples`.
    pub fn create(path: &Path, samples: usize) -> Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        ftruncate(&file, (size_of::<Header>() + samples * size_of::<Sample>()) as u64)?;
        Self::map(&file)
    }

    /// A process of the peer: the page the conductor made.
    pub fn open(path: &Path) -> Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path);
        Self::map(&file.map_err(|error| format!("{}: {error}; benches/peers/run makes it", path.display()))?)
    }

    fn map(file: &File) -> Result<Self> {
        let bytes = usize::try_from(file.metadata()?.len())?;
        let samples =
            bytes.checked_sub(size_of::<Header>()).ok_or("the page is too small")? / size_of::<Sample>();
        let (protection, flags) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED | MapFlags::POPULATE);
        // SAFETY: a fresh mapping of the whole file; nothing else is unmapped.
        let address = unsafe { mmap(std::ptr::null_mut(), bytes, protection, flags, file, 0) }?;
        let header = NonNull::new(address.cast()).ok_or("mmap returned null")?;
        Ok(Self { header, samples })
    }

    fn header(&self) -> &Header {
        // SAFETY: mapped for as long as self lives, page-aligned, large enough, all of it atomics.
        unsafe { self.header.as_ref() }
    }

    fn samples(&self) -> &[Sample] {
        // SAFETY: the samples lie behind the header in the same mapping, whose size says how many.
        unsafe { std::slice::from_raw_parts(self.header.add(1).as_ptr().cast(), self.samples) }
    }

    /// For the futex peers: rung for a new pose.
    pub fn pose_bell(&self) -> &Bell {
        &self.header().pose
    }

    /// For the futex peers: rung for a new command.
    pub fn command_bell(&self) -> &Bell {
        &self.header().command
    }

    /// For the bare futex: the pose itself.
    pub fn pose_words(&self) -> &[AtomicU64; POSE_WORDS] {
        &self.header().pose_words
    }

    /// For the bare futex: the command itself.
    pub fn command_words(&self) -> &[AtomicU64; COMMAND_WORDS] {
        &self.header().command_words
    }

    /// A process: I can be spoken to.
    pub fn set_ready(&self, side: Side) {
        self.header().ready[side as usize].store(std::process::id(), Release);
    }

    /// A process: I am gone.
    pub fn set_gone(&self, side: Side) {
        self.header().ready[side as usize].store(0, Release);
    }

    /// The conductor: the id of a process that can be spoken to.
    pub fn ready(&self, side: Side) -> Option<u32> {
        Some(self.header().ready[side as usize].load(Acquire)).filter(|pid| *pid != 0)
    }

    /// The conductor: lets the driver take so many samples more.
    pub fn allow(&self, more: u32) {
        self.header().allowed.fetch_add(more, SeqCst);
        self.header().turn.ring();
    }

    /// The conductor: everybody shall leave.
    pub fn dismiss(&self) {
        self.header().leaving.store(1, SeqCst);
        self.header().turn.ring();
    }

    /// True once everybody shall leave.
    pub fn leaving(&self) -> bool {
        self.header().leaving.load(SeqCst) != 0
    }

    /// The driver: sleeps until it may take samples, and says how many; `None` if it shall leave.
    pub fn await_turn(&self) -> Option<u32> {
        loop {
            let seen = self.header().turn.rung();
            if self.leaving() {
                return None;
            }
            let more = self.header().allowed.load(SeqCst).saturating_sub(self.done());
            if more > 0 {
                return Some(more);
            }
            self.header().turn.wait(seen, None);
        }
    }

    /// A responder that need not wait in its transport: sleeps until everybody shall leave and the driver, who
    /// may be waiting for an answer, has gone.
    pub fn await_dismissal(&self) {
        while !self.leaving() || self.ready(Side::Driver).is_some() {
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Samples taken.
    pub fn done(&self) -> u32 {
        self.header().done.load(Acquire)
    }

    /// The driver: writes down one round. What does not fit is a bug of the conductor.
    pub fn record(&self, round: Round) {
        let done = self.done();
        let sample = &self.samples()[done as usize];
        sample.lateness.store(round.lateness, Relaxed);
        sample.one_way.store(round.one_way, Relaxed);
        sample.round.store(round.round, Relaxed);
        self.header().done.store(done + 1, Release);
    }

    /// The driver: left out so many periods.
    pub fn skip(&self, periods: u32) {
        self.header().skipped.fetch_add(periods, Relaxed);
    }

    /// Periods left out.
    pub fn skipped(&self) -> u32 {
        self.header().skipped.load(Relaxed)
    }

    /// Every round so far, in order.
    pub fn rounds(&self) -> Vec<Round> {
        let taken = &self.samples()[..self.done() as usize];
        let read = |sample: &Sample| Round {
            lateness: sample.lateness.load(Relaxed),
            one_way: sample.one_way.load(Relaxed),
            round: sample.round.load(Relaxed),
        };
        taken.iter().map(read).collect()
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let bytes = size_of::<Header>() + self.samples * size_of::<Sample>();
        // SAFETY: mapped by us with this size; no reference outlives self.
        let _ = unsafe { munmap(self.header.as_ptr().cast(), bytes) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_driver_writes_the_conductor_reads() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("page");
        let (conductor, driver) = (Page::create(&path, 3).unwrap(), Page::open(&path).unwrap());
        assert_eq!(conductor.ready(Side::Driver), None);
        driver.set_ready(Side::Driver);
        assert_eq!(conductor.ready(Side::Driver), Some(std::process::id()));
        conductor.allow(2);
        assert_eq!(driver.await_turn(), Some(2));
        let round = Round { lateness: 1, one_way: 2, round: 3 };
        driver.record(round);
        assert_eq!(driver.await_turn(), Some(1));
        assert_eq!(conductor.rounds(), [round]);
        conductor.dismiss();
        assert_eq!(driver.await_turn(), None);
        driver.set_gone(Side::Driver);
        // Returns at once, or this test hangs.
        conductor.await_dismissal();
    }

    #[test]
    fn a_ring_before_the_wait_is_not_lost() {
        let bell = Bell::default();
        let seen = bell.rung();
        bell.ring();
        // Returns at once, or this test hangs.
        bell.wait(seen, None);
    }
}
