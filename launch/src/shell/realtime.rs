//! What is asked of the kernel for a worker, and what it granted.
//!
//! Every grant is read back from the kernel and reported; a refusal is never fatal and never
//! silent.

#![allow(unsafe_code)]

mod refusal;

pub use refusal::FifoRefusal;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Pid, Resource, getrlimit};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_getaffinity, sched_setaffinity};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stack of a thread that does nothing.
const STACK: usize = 64 << 10;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// SCHED_FIFO priority; 0 leaves the default policy.
    pub priority: u64,
    /// Processor to stay on.
    pub cpu: CpuChoice,
    /// Lock all memory, so that no page fault can happen.
    pub lock_memory: bool,
}

/// Which processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CpuChoice {
    /// Any.
    Any,
    /// Every one this process may use but the last; that one, if there is no other.
    AllButLast,
    /// The last one this process may use.
    Last,
    /// This one.
    Number(usize),
}

impl CpuChoice {
    /// From the key `cpu` of a system file: −3 all but the last, −2 any, −1 the last, else a number.
    pub fn from_key(cpu: i64) -> Self {
        match usize::try_from(cpu) {
            Ok(cpu) => Self::Number(cpu),
            Err(_) if cpu == -1 => Self::Last,
            Err(_) if cpu == -3 => Self::AllButLast,
            Err(_) => Self::Any,
        }
    }
}

/// What the kernel says the process has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Granted {
    /// Runs under SCHED_FIFO.
    pub fifo: bool,
    /// Its real-time priority.
    pub priority: u64,
    /// The one processor it is bound to.
    pub cpu: Option<u64>,
    /// Its memory is locked.
    pub mlock: bool,
}

/// Asks for `request`; what was refused is seen by comparing with [`granted`].
pub fn apply(request: Request) {
    if request.lock_memory {
        // Without room for everything to come, MCL_FUTURE would make later mappings fail.
        let future = if may_lock_everything() { MlockAllFlags::FUTURE } else { MlockAllFlags::empty() };
        let _ = mlockall(MlockAllFlags::CURRENT | future);
    }
    if let Some(set) = chosen_cpus(request.cpu) {
        let _ = sched_setaffinity(None, &set);
    }
    if request.priority > 0 {
        let _ = set_fifo(request.priority, false);
    }
}

/// True if no limit stands in the way of locked memory. Being root is not enough: in a container it may
/// lack the capability.
pub fn may_lock_everything() -> bool {
    let able = capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    able || getrlimit(Resource::Memlock).current.is_none()
}

/// Moves another process of this user to a processor; where that is not allowed it stays.
pub fn place(pid: Pid, choice: CpuChoice) {
    if let Some(set) = chosen_cpus(choice) {
        let _ = sched_setaffinity(Some(pid), &set);
    }
}

/// Takes the calling thread off the processor on which the control path runs by default. What maps and unmaps
/// memory, or makes files, keeps the kernel busy where no real-time process can interrupt it.
pub fn leave_the_control_path() {
    apply(Request { priority: 0, cpu: CpuChoice::AllButLast, lock_memory: false });
}

/// A processor this process may use other than a chosen one; `None` if nothing is chosen or there is none.
pub fn another_cpu(choice: CpuChoice) -> Option<usize> {
    let (chosen, allowed) = (chosen_cpu(choice)?, sched_getaffinity(None).ok()?);
    (0..CpuSet::MAX_CPU).find(|cpu| allowed.is_set(*cpu) && *cpu != chosen)
}

/// The one processor a process is bound to, or the calling thread.
fn bound_cpu(pid: Option<Pid>) -> Option<u64> {
    let set = sched_getaffinity(pid).ok().filter(|set| set.count() == 1)?;
    (0..CpuSet::MAX_CPU).find(|cpu| set.is_set(*cpu)).map(|cpu| cpu as u64)
}

/// The processors a choice comes to; `None` leaves them as they are.
fn chosen_cpus(choice: CpuChoice) -> Option<CpuSet> {
    if let CpuChoice::AllButLast = choice {
        let mut rest = sched_getaffinity(None).ok()?;
        rest.unset(chosen_cpu(CpuChoice::Last)?);
        return (rest.count() > 0).then_some(rest);
    }
    let mut one = CpuSet::new();
    one.set(chosen_cpu(choice)?);
    Some(one)
}

/// The one processor a choice comes to, of those this process may use.
pub fn chosen_cpu(choice: CpuChoice) -> Option<usize> {
    let allowed = sched_getaffinity(None).ok()?;
    match choice {
        CpuChoice::Any | CpuChoice::AllButLast => None,
        CpuChoice::Number(cpu) => (cpu < CpuSet::MAX_CPU && allowed.is_set(cpu)).then_some(cpu),
        CpuChoice::Last => (0..CpuSet::MAX_CPU).rev().find(|cpu| allowed.is_set(*cpu)),
    }
}

/// Puts the calling thread under SCHED_FIFO. With `reset_on_fork` its children and threads are not.
pub fn set_fifo(priority: u64, reset_on_fork: bool) -> io::Result<()> {
    let policy = libc::SCHED_FIFO | if reset_on_fork { libc::SCHED_RESET_ON_FORK } else { 0 };
    let parameters = libc::sched_param { sched_priority: priority as libc::c_int };
    // SAFETY: sets the calling thread's policy from a valid struct; no library wraps this call.
    let result = unsafe { libc::sched_setscheduler(0, policy, &parameters) };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Keeps the calling thread's processor from sleeping as long as this lives: a thread that runs when nothing else
/// does.
pub struct KeptAwake {
    over: Arc<AtomicBool>,
}

/// See [`KeptAwake`]. Without such a thread everything works, only less promptly.
pub fn keep_awake() -> KeptAwake {
    let over = Arc::new(AtomicBool::new(false));
    let told = Arc::clone(&over);
    let _ = std::thread::Builder::new().name("keep-awake".into()).stack_size(STACK).spawn(move || {
        let parameters = libc::sched_param { sched_priority: 0 };
        // SAFETY: sets the calling thread's policy from a valid struct. A thread that stayed in real time would
        // take the processor for itself.
        if unsafe { libc::sched_setscheduler(0, libc::SCHED_IDLE, &parameters) } == 0 {
            while !told.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        }
    });
    KeptAwake { over }
}

impl Drop for KeptAwake {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// Gives real time back: a process that leaves has much to unmap and nothing urgent.
pub fn release() {
    let parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: as above; going back to the default policy is always allowed.
    unsafe { libc::sched_setscheduler(0, libc::SCHED_OTHER, &parameters) };
}

/// Reads back what the calling thread has, or another process.
pub fn granted(pid: Option<Pid>) -> Granted {
    let id = pid.map_or(0, Pid::as_raw_pid);
    // SAFETY: no arguments but a thread id, 0 for the calling one.
    let policy = unsafe { libc::sched_getscheduler(id) };
    let fifo = policy >= 0 && policy & !libc::SCHED_RESET_ON_FORK == libc::SCHED_FIFO;
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: the kernel fills the struct it is given.
    unsafe { libc::sched_getparam(id, &mut parameters) };
    let of = pid.map_or("self".to_owned(), |pid| pid.to_string());
    let locked = std::fs::read_to_string(format!("/proc/{of}/status")).is_ok_and(|status| {
        status
            .lines()
            .find_map(|line| line.strip_prefix("VmLck:"))
            .and_then(|kib| kib.trim().trim_end_matches("kB").trim().parse::<u64>().ok())
            .is_some_and(|kib| kib > 0)
    });
    Granted {
        fifo,
        priority: u64::try_from(parameters.sched_priority).unwrap_or(0),
        cpu: bound_cpu(pid),
        mlock: locked,
    }
}
