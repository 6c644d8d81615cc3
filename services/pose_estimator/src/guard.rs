//! What is taken from the wires: ticks that can come next, and counts that wheels can make.
//!
//! Counts are cumulative, so a message that is passed over loses no way: the next one has it. One that is
//! believed wrongly would throw the robot's pose across the map, where no fix finds it again.

use hilare_interfaces::block::{TICK_S, Tick};
use hilare_interfaces::chassis::{Chassis, PerWheel};
use hilare_interfaces::messages::sense::{SPEED_MAX_MPS, TICK_MAX};
use hilare_interfaces::state::{StateWords, Stateful};

/// Ticks from one message to the next that are believed at once; of a longer silence, or of a robot that
/// has been up for long, only a second message that goes on from there is proof.
const JUMP_MAX: u64 = 50;

/// What a message is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worth {
    /// It can be so.
    Sound,
    /// No wheel turns that fast.
    CountsImpossible,
    /// Time does not go like that.
    TickImpossible,
}

/// Looks at what comes.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    /// Counts of a wheel in a tick at the highest speed there is; none where counts are not used.
    counts_max: Option<f64>,
    counts_max_in_a_tick: u64,
    /// Of the newest message that was sound.
    tick: Tick,
    counts: PerWheel<i64>,
    /// Where the message before said that the ticks have jumped to.
    jump: Option<Tick>,
    refused: u64,
}

impl Guard {
    /// Before the first message. `counted` says whether counts are used, `count_rad` is the wheel angle of one.
    pub fn new(chassis: &Chassis, count_rad: f64, counted: bool) -> Self {
        let rim_m = count_rad.abs() * chassis.wheel_radius_m();
        let counts_max = counted.then_some(SPEED_MAX_MPS * TICK_S / rim_m);
        let counts_max_in_a_tick = counts_max.map_or(0, |most| most as u64);
        Self { counts_max, counts_max_in_a_tick, tick: 0, counts: [0; 4], jump: None, refused: 0 }
    }

    /// Messages that were passed over.
    pub const fn refused(&self) -> u64 {
        self.refused
    }

    /// What the counts of a tick are worth. Repeated and older ticks are for the estimators to pass over.
    #[inline]
    pub fn look(&mut self, tick: Tick, counts: &PerWheel<i64>) -> Worth {
        let worth = self.worth(tick, counts);
        self.jump = (worth == Worth::TickImpossible).then_some(tick);
        if worth != Worth::Sound {
            self.refused = self.refused.saturating_add(1);
        } else if tick >= self.tick {
            (self.tick, self.counts) = (tick, *counts);
        }
        worth
    }

    fn worth(&self, tick: Tick, counts: &PerWheel<i64>) -> Worth {
        let silence = tick.saturating_sub(self.tick);
        let goes_on = |from: Tick| tick > from && tick - from <= JUMP_MAX;
        if tick > TICK_MAX || (silence > JUMP_MAX && !self.jump.is_some_and(goes_on)) {
            return Worth::TickImpossible;
        }
        let Some(counts_max) = self.counts_max.filter(|_| tick >= self.tick) else { return Worth::Sound };
        let most = match silence {
            0 | 1 => self.counts_max_in_a_tick,
            _ => (counts_max * silence as f64) as u64,
        };
        let turned = |wheel: usize| counts[wheel].wrapping_sub(self.counts[wheel]).unsigned_abs();
        let possible = (0..counts.len()).fold(true, |all, wheel| all & (turned(wheel) <= most));
        if possible { Worth::Sound } else { Worth::CountsImpossible }
    }
}

impl Stateful for Guard {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.tick);
        for count in &mut self.counts {
            words.signed(count);
        }
        words.option(&mut self.jump, 0, |jump, words| words.word(jump));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::chassis::DifferentialParams;

    #[test]
    fn a_garbled_message_is_passed_over_and_the_next_one_believed() {
        let chassis = Chassis::Differential(DifferentialParams::default());
        let mut guard = Guard::new(&chassis, 0.0065, true);
        let right = |count| [count, 0, 0, 0];
        assert_eq!(guard.look(5_000_000, &right(70_000)), Worth::TickImpossible, "up for long?");
        assert_eq!(guard.look(5_000_001, &right(70_001)), Worth::Sound, "it is");
        assert_eq!(guard.look(5_000_002, &right(1 << 40)), Worth::CountsImpossible);
        assert_eq!(guard.look(u64::MAX, &right(70_002)), Worth::TickImpossible);
        assert_eq!(guard.look(5_000_103, &right(70_002)), Worth::TickImpossible);
        assert_eq!(guard.look(5_000_003, &right(70_002)), Worth::Sound, "it was a lie");
        assert_eq!(guard.look(4, &right(i64::MIN)), Worth::Sound, "older: nobody uses it");
        assert_eq!(guard.look(5_000_004, &right(70_003)), Worth::Sound);
        assert_eq!(guard.refused(), 4);
    }
}
