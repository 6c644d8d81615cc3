//! What the boxes of the rig remember beyond their death: the shared page of the real processes.

use super::plan::Process;
use hilare::config::System;
use hilare::shell::checkpoint::StateRoom;
use hilare::shell::page::SharedPage;
use hilare_interfaces::block::Tick;
use hilare_interfaces::state::Stateful;

/// The page.
pub struct Memory {
    page: SharedPage,
    room: StateRoom,
}

impl Memory {
    /// Empty.
    pub fn new() -> Self {
        Self { page: SharedPage::create().expect("a page of shared memory"), room: StateRoom::default() }
    }

    /// Keeps the state of a box after `tick`, unless it is not one that could be loaded.
    pub fn remember(&mut self, process: Process, key: u64, tick: Tick, of: &mut impl Stateful) {
        if let Some(len) = of.save_state(self.room.all()) {
            self.page.area(process as usize).store(key, tick, self.room.first(len));
        }
    }

    /// The newest state that `process` has left of a wanted tick, into a box; its tick.
    pub fn recall(
        &mut self,
        process: Process,
        key: u64,
        wanted: impl Fn(Tick) -> bool,
        into: &mut impl Stateful,
    ) -> Option<Tick> {
        let (tick, len) = self.page.area(process as usize).load(key, wanted, &mut self.room)?;
        assert!(into.load_state(self.room.first(len)), "{process:?}: a state that is none");
        Some(tick)
    }

    /// A box as its predecessor left it, and the tick of that; or a new one.
    pub fn resume<B: Stateful>(
        &mut self,
        process: Process,
        key: u64,
        system: &System,
        build: impl Fn(&System) -> B,
    ) -> (B, Option<Tick>) {
        let mut built = build(system);
        let tick = self.recall(process, key, |_| true, &mut built);
        (built, tick)
    }
}
