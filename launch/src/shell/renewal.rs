//! How a box comes to have other parameters while it works.
//!
//! Beside the loop sleeps a thread. When launch wants a change ([`super::change`]) it reads the new system file,
//! builds what the box needs of it and lays it ready. The loop looks at one word, and at the tick of the change
//! takes what lies there, lets it take over from what it has, and lays the old one down again: the thread throws it
//! away. So the loop builds nothing, reads no file, takes no lock and frees nothing.

use super::change::{Answer, Applied, Stage, Turn};
use super::page::{SharedPage, monotonic_ns};
use super::realtime;
use super::worker::{Worker, system_file};
use crate::config::System;
use crossbeam_utils::atomic::AtomicCell;
use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::JournalKind;
use std::path::PathBuf;
use std::sync::Arc;

/// Stack of the thread: it reads files and builds solvers.
const STACK: usize = 512 << 10;

/// What a box is to go on with; afterwards, what it had.
pub struct Renewal<B> {
    /// Number of the change.
    change: u64,
    /// Number of its system file.
    number: u64,
    /// The tick it is meant for.
    meant: Tick,
    began_ns: u64,
    /// The whole system.
    pub system: System,
    /// What was built of it.
    pub made: B,
}

/// One pointer each, so that nobody waits for anybody.
struct Tray<B> {
    ready: AtomicCell<Option<Box<Renewal<B>>>>,
    old: AtomicCell<Option<Box<Renewal<B>>>>,
}

/// The loop's side.
pub struct Renewals<B> {
    tray: Arc<Tray<B>>,
    /// The turn that needs nothing more of this box.
    settled: Turn,
}

impl<B: Send + 'static> Renewals<B> {
    /// Starts the thread. `build` makes of a system what the box will need of it, or says what is wrong.
    pub fn begin(
        worker: &Worker,
        build: impl Fn(&System) -> Result<B, String> + Send + 'static,
    ) -> Result<Self, String> {
        let tray = Arc::new(Tray { ready: AtomicCell::new(None), old: AtomicCell::new(None) });
        let beside = Beside {
            page: Arc::clone(&worker.page),
            slot: worker.assignment.slot,
            dir: worker.assignment.runtime_dir.clone(),
            tray: Arc::clone(&tray),
            // What is under way now is not for this process.
            last: worker.page.change().turn().change(),
            build,
        };
        let settled = worker.page.change().turn();
        let thread = std::thread::Builder::new().name("renewal".into()).stack_size(STACK);
        thread.spawn(move || beside.run()).map_err(|error| format!("thread: {error}"))?;
        Ok(Self { tray, settled })
    }

    /// What the box is to go on with before it works on what begins at tick `next`, if a change is due.
    #[inline]
    pub fn due(&mut self, worker: &Worker, next: Tick) -> Option<Box<Renewal<B>>> {
        let turn = worker.page.change().turn();
        if turn == self.settled { None } else { self.look(worker, turn, next) }
    }

    #[cold]
    fn look(&mut self, worker: &Worker, turn: Turn, next: Tick) -> Option<Box<Renewal<B>>> {
        let meant = worker.page.change().tick();
        if turn.stage() == Stage::Decided && next < meant {
            return None;
        }
        self.settled = turn;
        if turn.stage() != Stage::Decided || !worker.page.change().concerns(worker.assignment.slot) {
            return None;
        }
        let mut found = self.tray.ready.take()?;
        if found.change != turn.change() {
            // Never; whoever laid it there throws it away.
            self.tray.ready.store(Some(found));
            return None;
        }
        (found.meant, found.began_ns) = (meant, monotonic_ns());
        Some(found)
    }

    /// The box goes on with what was due, from tick `next` on: notes it and gives back what it had. `anew`: it
    /// could not make its own what it had learnt.
    pub fn applied(&mut self, worker: &mut Worker, old: Box<Renewal<B>>, next: Tick, anew: bool) {
        let tick = next.max(old.meant);
        worker.in_force = old.number;
        worker.journal(tick, JournalKind::Param, &[old.change, old.number, old.meant]);
        let took_ns = monotonic_ns().saturating_sub(old.began_ns);
        let change = old.change;
        // Nothing lies there: the thread has cleared it before it laid the new one ready.
        self.tray.old.store(Some(old));
        let applied = Answer::Applied(Applied { tick, took_ns, anew });
        worker.page.change().reply(worker.assignment.slot, change, &applied);
    }
}

/// The thread's side.
struct Beside<B, F> {
    page: Arc<SharedPage>,
    slot: usize,
    dir: PathBuf,
    tray: Arc<Tray<B>>,
    /// The change that was looked at last.
    last: u64,
    build: F,
}

impl<B, F: Fn(&System) -> Result<B, String>> Beside<B, F> {
    fn run(mut self) {
        realtime::leave_the_control_path();
        loop {
            let seen = self.page.change().bell();
            drop(self.tray.old.take());
            self.look();
            self.page.change().wait(seen);
        }
    }

    fn look(&mut self) {
        let change = self.page.change();
        let turn = change.turn();
        match turn.stage() {
            Stage::Prepare if turn.change() != self.last && change.concerns(self.slot) => {
                self.last = turn.change();
                let answer = match self.renewal(turn.change(), change.system()) {
                    Ok(renewal) => {
                        self.tray.ready.store(Some(Box::new(renewal)));
                        Answer::Prepared
                    }
                    Err(why) => Answer::Refused(why),
                };
                change.reply(self.slot, turn.change(), &answer);
            }
            // It was taken back, or is over.
            Stage::Idle => drop(self.tray.ready.take()),
            _ => {}
        }
    }

    fn renewal(&self, change: u64, number: u64) -> Result<Renewal<B>, String> {
        let file = self.dir.join(system_file(number));
        let system = System::load(&file.to_string_lossy()).map_err(|error| error.to_string())?;
        let made = (self.build)(&system)?;
        Ok(Renewal { change, number, meant: 0, began_ns: 0, system, made })
    }
}
