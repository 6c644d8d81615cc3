//! The floor: words in shared memory and a futex each way. No queue, no check, nothing to go wrong in.

use super::{Driver, Place, now, responder_ready};
use crate::Result;
use crate::messages::{COMMAND_WORDS, Command, POSE_WORDS, Pose, answer};
use crate::page::Bell;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

// The bell orders what is written before it is rung and what is read after it was heard.
fn write<const N: usize>(words: &[AtomicU64; N], values: [u64; N]) {
    words.iter().zip(values).for_each(|(word, value)| word.store(value, Relaxed));
}

fn read<const N: usize>(words: &[AtomicU64; N]) -> [u64; N] {
    std::array::from_fn(|n| words[n].load(Relaxed))
}

/// Sleeps until the bell is rung again.
fn await_ring(bell: &Bell, heard: &mut u32) {
    while bell.rung() == *heard {
        bell.wait(*heard, None);
    }
    *heard = bell.rung();
}

struct Words {
    place: Place,
    heard: u32,
}

pub fn driver(place: &Place) -> Result<Box<dyn Driver>> {
    Ok(Box::new(Words { place: place.clone(), heard: place.page.command_bell().rung() }))
}

impl Driver for Words {
    fn send(&mut self, pose: &Pose) -> Result<()> {
        write::<POSE_WORDS>(self.place.page.pose_words(), bytemuck::cast(*pose));
        self.place.page.pose_bell().ring();
        Ok(())
    }

    fn command(&mut self) -> Result<(Command, u64)> {
        await_ring(self.place.page.command_bell(), &mut self.heard);
        let command = bytemuck::cast(read::<COMMAND_WORDS>(self.place.page.command_words()));
        Ok((command, now()))
    }
}

pub fn respond(place: &Place) -> Result<()> {
    let page = &place.page;
    let mut heard = page.pose_bell().rung();
    responder_ready(place);
    loop {
        await_ring(page.pose_bell(), &mut heard);
        let pose: Pose = bytemuck::cast(read::<POSE_WORDS>(page.pose_words()));
        let command = answer(&pose, now());
        write::<COMMAND_WORDS>(page.command_words(), bytemuck::cast(command));
        page.command_bell().ring();
    }
}
