//! A change of parameters, as launch, the clock and the boxes agree on it: a few words of the shared page.
//!
//! ```text
//!   launch            clock (step generator)         boxes that read what changes
//!   Prepare ────────────────────────────────────────▶ a thread beside the loop builds the new box
//!   ◀─────────────────────────────────────────────── Prepared, or Refused and why: then all is as it was
//!   Asked ──────────▶ at its next tick it chooses T
//!                     and writes it down: Decided ──▶ each goes on with the new box from tick T on
//!   ◀─────────────────────────────────────────────── Applied
//!   Idle
//! ```
//!
//! T is the beginning of the next control period after the tick the clock is about to execute, and is written
//! before that tick is told: no message of T or later exists before. Whoever handles one has what the clock wrote
//! before it, so nobody can be past T and no margin is needed, in real time or in virtual time. The decision is one
//! compare-and-swap: either launch takes the change back, or the clock decides it.
//!
//! On the tick a box pays one load, of the word that says where the change is.

use super::page::MAX_SLOTS;
use hilare_interfaces::block::Tick;
use hilare_interfaces::messages::TEXT_BYTES;
use rustix::thread::futex;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Where a change is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// There is none, or the last one is over.
    Idle = 0,
    /// Boxes are being built.
    Prepare = 1,
    /// The clock is to choose the tick.
    Asked = 2,
    /// The tick is chosen.
    Decided = 3,
}

/// A change and where it is, in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Turn(u64);

impl Turn {
    /// The stage of a change.
    pub const fn new(change: u64, stage: Stage) -> Self {
        Self(change << 2 | stage as u64)
    }

    /// Number of the change; 0 before the first.
    pub const fn change(self) -> u64 {
        self.0 >> 2
    }

    /// Where it is.
    pub const fn stage(self) -> Stage {
        match self.0 & 3 {
            1 => Stage::Prepare,
            2 => Stage::Asked,
            3 => Stage::Decided,
            _ => Stage::Idle,
        }
    }
}

/// What a box has come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Nothing yet.
    None,
    /// What is to come is built.
    Prepared,
    /// It cannot be, and why.
    Refused(String),
    /// The box goes on with it.
    Applied(Applied),
}

/// How a box took a change on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Applied {
    /// From this tick on.
    pub tick: Tick,
    /// Time the loop spent on it, ns.
    pub took_ns: u64,
    /// What the box had learnt did not fit the new parameters, and was forgotten.
    pub anew: bool,
}

const PREPARED: u64 = 1;
const REFUSED: u64 = 2;
const APPLIED: u64 = 3;
const APPLIED_ANEW: u64 = 4;
/// Bits of the code of an answer; above them stands the number of the change.
const CODE_BITS: u32 = 3;

#[repr(C, align(64))]
struct Reply {
    code: AtomicU64,
    tick: AtomicU64,
    took_ns: AtomicU64,
    text: [AtomicU64; TEXT_BYTES / 8],
}

/// The words; all zero is valid: there was no change yet.
#[repr(C, align(128))]
pub struct Change {
    turn: AtomicU64,
    tick: AtomicU64,
    /// Goes up with every turn launch makes: what the threads beside the loops sleep on.
    bell: AtomicU32,
    /// Places whose boxes take part, a bit each.
    slots: AtomicU64,
    /// Number of the system file.
    system: AtomicU64,
    replies: [Reply; MAX_SLOTS],
}

impl Change {
    /// Where the change is.
    #[inline]
    pub fn turn(&self) -> Turn {
        Turn(self.turn.load(Ordering::Acquire))
    }

    /// Launch: the boxes in `slots` (a bit each) are to build what the system file of a number says.
    pub fn prepare(&self, change: u64, system: u64, slots: u64) {
        self.system.store(system, Ordering::Relaxed);
        self.slots.store(slots, Ordering::Relaxed);
        self.set(Turn::new(change, Stage::Prepare));
    }

    /// Launch: everybody is prepared, the clock is to choose a tick.
    pub fn ask(&self, change: u64) {
        self.set(Turn::new(change, Stage::Asked));
    }

    /// Launch: takes the change back; false if the clock was faster, and it is decided.
    pub fn cancel(&self, change: u64) -> bool {
        let idle = Turn::new(change, Stage::Idle);
        let taken_back = [Stage::Prepare, Stage::Asked].into_iter().any(|stage| {
            let from = Turn::new(change, stage);
            self.turn.compare_exchange(from.0, idle.0, Ordering::SeqCst, Ordering::SeqCst).is_ok()
        });
        self.ring();
        taken_back
    }

    /// Launch: everybody has taken the change on.
    pub fn end(&self, change: u64) {
        self.set(Turn::new(change, Stage::Idle));
    }

    /// The tick that was chosen; of use only once it is.
    pub fn tick(&self) -> Tick {
        self.tick.load(Ordering::Relaxed)
    }

    /// The clock: chooses the tick of the change that asks for one.
    pub fn decide(&self, asked: Turn, tick: Tick) {
        self.tick.store(tick, Ordering::Relaxed);
        let decided = Turn::new(asked.change(), Stage::Decided);
        let _ = self.turn.compare_exchange(asked.0, decided.0, Ordering::AcqRel, Ordering::Relaxed);
    }

    /// True if the box in a place takes part.
    pub fn concerns(&self, slot: usize) -> bool {
        self.slots.load(Ordering::Relaxed) >> slot & 1 == 1
    }

    /// Number of the system file.
    pub fn system(&self) -> u64 {
        self.system.load(Ordering::Relaxed)
    }

    /// A box: what it has come to.
    pub fn reply(&self, slot: usize, change: u64, answer: &Answer) {
        let reply = &self.replies[slot % MAX_SLOTS];
        let code = match answer {
            Answer::None => return,
            Answer::Prepared => PREPARED,
            Answer::Refused(why) => {
                let field = hilare_interfaces::messages::text_field(why);
                for (place, bytes) in reply.text.iter().zip(field.as_chunks().0) {
                    place.store(u64::from_ne_bytes(*bytes), Ordering::Relaxed);
                }
                REFUSED
            }
            Answer::Applied(applied) => {
                reply.tick.store(applied.tick, Ordering::Relaxed);
                reply.took_ns.store(applied.took_ns, Ordering::Relaxed);
                if applied.anew { APPLIED_ANEW } else { APPLIED }
            }
        };
        reply.code.store(change << CODE_BITS | code, Ordering::Release);
    }

    /// Launch: what the box in a place has come to.
    pub fn answer(&self, slot: usize, change: u64) -> Answer {
        let reply = &self.replies[slot % MAX_SLOTS];
        let code = reply.code.load(Ordering::Acquire);
        if code >> CODE_BITS != change {
            return Answer::None;
        }
        match code & ((1 << CODE_BITS) - 1) {
            PREPARED => Answer::Prepared,
            REFUSED => {
                let mut field = [0; TEXT_BYTES];
                for (bytes, place) in field.as_chunks_mut().0.iter_mut().zip(&reply.text) {
                    *bytes = place.load(Ordering::Relaxed).to_ne_bytes();
                }
                Answer::Refused(hilare_interfaces::messages::field_text(&field).to_owned())
            }
            code @ (APPLIED | APPLIED_ANEW) => Answer::Applied(Applied {
                tick: reply.tick.load(Ordering::Relaxed),
                took_ns: reply.took_ns.load(Ordering::Relaxed),
                anew: code == APPLIED_ANEW,
            }),
            _ => Answer::None,
        }
    }

    fn set(&self, turn: Turn) {
        self.turn.store(turn.0, Ordering::SeqCst);
        self.ring();
    }

    fn ring(&self) {
        self.bell.fetch_add(1, Ordering::SeqCst);
        let _ = futex::wake(&self.bell, futex::Flags::empty(), i32::MAX as u32);
    }

    /// The bell; read it before looking, then give it to [`Self::wait`].
    pub fn bell(&self) -> u32 {
        self.bell.load(Ordering::SeqCst)
    }

    /// A thread beside a loop: sleeps until launch makes a turn, or for no reason.
    pub fn wait(&self, seen: u32) {
        let _ = futex::wait(&self.bell, futex::Flags::empty(), seen, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::page::SharedPage;

    #[test]
    fn a_change_is_decided_or_taken_back_and_never_both() {
        let page = SharedPage::create().unwrap();
        let change = page.change();
        assert_eq!((change.turn(), change.turn().stage()), (Turn::default(), Stage::Idle));
        for n in 1..2000 {
            change.prepare(n, n + 7, 0b101);
            change.ask(n);
            let (taken_back, turn) = std::thread::scope(|scope| {
                let clock = scope.spawn(|| {
                    let turn = change.turn();
                    if turn.stage() == Stage::Asked {
                        change.decide(turn, 5 * n);
                    }
                });
                let taken_back = change.cancel(n);
                clock.join().unwrap();
                (taken_back, change.turn())
            });
            let stage = if taken_back { Stage::Idle } else { Stage::Decided };
            assert_eq!((turn.change(), turn.stage()), (n, stage));
            assert!(taken_back || change.tick() == 5 * n);
        }
    }

    #[test]
    fn answers_are_of_their_change_and_say_why() {
        let page = SharedPage::create().unwrap();
        let change = page.change();
        change.prepare(3, 9, 1 << 4);
        assert!(change.concerns(4) && !change.concerns(3) && change.system() == 9);
        assert_eq!(change.answer(4, 3), Answer::None);
        let why = "µ is not a number".to_owned();
        let applied = Applied { tick: 1235, took_ns: 900, anew: true };
        for answer in [Answer::Prepared, Answer::Refused(why), Answer::Applied(applied)] {
            change.reply(4, 3, &answer);
            assert_eq!(change.answer(4, 3), answer);
            assert_eq!(change.answer(4, 4), Answer::None, "of another change");
            assert_eq!(change.answer(5, 3), Answer::None, "of another place");
        }
    }
}
