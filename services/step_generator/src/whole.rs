//! All that a step generator remembers, for whoever steps it again from the middle of a drive.
//!
//! A successor takes on counts and counters only, and stands still ([`StepGenerator`]'s own state). A replay goes on
//! in the very motion: with authority, commands that wait, what acts, and the wheels' speeds.

use crate::{COUNTED_MAX, StepGenerator};
use hilare_interfaces::messages::Steps;
use hilare_interfaces::state::{StateWords, Stateful};

/// A step generator in motion.
#[derive(Debug)]
pub struct Whole<'g>(pub &'g mut StepGenerator);

impl Stateful for Whole<'_> {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        let generator = &mut *self.0;
        generator.visit_state(words);
        generator.pulses.visit_waits(words, COUNTED_MAX);
        generator.gate.visit_drive(words);
        generator.handover.visit_state(words);
        words.twist(&mut generator.twist);
        let counted =
            |state: &Steps| [state.tick, state.ticks_late, state.paused_ticks, state.paused_max_ticks];
        // As it was told last: what was taken in since shows in the next message only.
        let before = counted(&generator.state);
        words.message(&mut generator.state);
        words.require(counted(&generator.state) == before);
        if words.is_loading() {
            generator.pulses.set_speeds(generator.chassis.wheel_speeds(generator.twist));
        }
    }
}
