//! All that a step generator remembers, for whoever steps it again from the middle of a drive.
//!
//! A successor takes on counts and counters only, and stands still ([`StepGenerator`]'s own state). A replay goes on
//! in the very motion: with authority, commands that wait, what acts, and the wheels' speeds.

use crate::{COUNTED_MAX, StepGenerator};
use hilare_interfaces::messages::Drive;
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
        let state = &mut generator.state;
        words.finite(&mut state.wheel_speed_radps);
        words.word(&mut state.drive);
        words.require(Drive::from_code(state.drive).is_some());
        if words.is_loading() && words.is_sound() {
            let twist = generator.twist;
            state.twist = [twist.vx_mps, twist.vy_mps, twist.omega_radps];
            // What hangs on them; the speeds themselves are those that were told.
            generator.pulses.set_speeds(generator.chassis.wheel_speeds(twist));
            generator.gate.report(state);
        }
    }
}
