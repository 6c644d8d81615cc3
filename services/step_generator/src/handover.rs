//! Another controller's commands begin to act: without a jump.
//!
//! What two controllers command differs even where both are right. At the change the difference
//! becomes an offset on the new one's commands, and fades within the acceleration limits (bumpless
//! transfer):
//!
//! ```text
//! old  ────────┐ offset = old − new, both of the same cycle: that of the change, if the old one still
//!              └──.._   answers, else the one before;    what acts = new + offset, offset → 0
//! new  - - - - - - - ──────────
//! ```
//!
//! Two controllers of the same law and the same memory command the same for the same cycle: the offset is
//! exactly zero, and the change leaves no bit behind.

use crate::authority::{Beside, Decision};
use crate::candidate::Pair;
use crate::limits::Limits;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::state::{StateWords, Stateful};

/// From a decision to the twist the wheels should have.
#[derive(Clone, Debug)]
pub struct Handover {
    /// Whose command acted last; (0, 0) after none did.
    pair: Pair,
    /// The command that acts, and what the constraints make of it.
    commanded: BodyTwist,
    constrained: BodyTwist,
    /// What was wanted of the wheels last.
    target: BodyTwist,
    offset: BodyTwist,
}

impl Handover {
    /// For a robot at rest.
    pub fn new(chassis: &Chassis, limits: &Limits) -> Self {
        Self {
            pair: (0, 0),
            commanded: BodyTwist::ZERO,
            constrained: limits.constrain(chassis, BodyTwist::ZERO),
            target: BodyTwist::ZERO,
            offset: BodyTwist::ZERO,
        }
    }

    /// The limits are others now.
    pub fn constrain_anew(&mut self, chassis: &Chassis, limits: &Limits) {
        self.constrained = limits.constrain(chassis, self.commanded);
    }

    /// No command acts; the wheels do `twist`.
    pub fn interrupt(&mut self, twist: BodyTwist) {
        self.pair = (0, 0);
        self.target = twist;
        self.offset = BodyTwist::ZERO;
    }

    /// The target of a tick in which a command acts: inside the constraints.
    #[inline]
    pub fn target(
        &mut self,
        decision: &Decision,
        beside: impl FnOnce() -> Beside,
        chassis: &Chassis,
        limits: &Limits,
    ) -> BodyTwist {
        // A command acts for several ticks: constrain it once.
        if decision.twist != self.commanded {
            self.commanded = decision.twist;
            self.constrained = limits.constrain(chassis, decision.twist);
        }
        if decision.pair != self.pair {
            self.change(decision.pair, beside(), chassis, limits);
        }
        self.target = if self.offset == BodyTwist::ZERO {
            self.constrained
        } else {
            self.offset = fade(self.offset, limits);
            limits.constrain(chassis, sum(self.constrained, self.offset))
        };
        self.target
    }

    fn change(&mut self, pair: Pair, beside: Beside, chassis: &Chassis, limits: &Limits) {
        let resumes = self.pair.0 == 0;
        // From rest a robot starts as its acceleration limits say.
        let from_rest = resumes && self.target == BodyTwist::ZERO;
        self.pair = pair;
        if from_rest {
            return;
        }
        let constrained = |twist| limits.constrain(chassis, twist);
        self.offset = match (beside.old, beside.before) {
            (Some(old), _) if !resumes => sum(self.offset, difference(constrained(old), self.constrained)),
            (None, Some(new)) if !resumes => difference(self.target, constrained(new)),
            _ => difference(self.target, self.constrained),
        };
    }
}

impl Stateful for Handover {
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.word(&mut self.pair.0);
        words.word(&mut self.pair.1);
        let twists = [&mut self.commanded, &mut self.constrained, &mut self.target, &mut self.offset];
        twists.into_iter().for_each(|twist| words.twist(twist));
    }
}

fn sum(a: BodyTwist, b: BodyTwist) -> BodyTwist {
    BodyTwist::new(a.vx_mps + b.vx_mps, a.vy_mps + b.vy_mps, a.omega_radps + b.omega_radps)
}

fn difference(a: BodyTwist, b: BodyTwist) -> BodyTwist {
    sum(a, b.scaled(-1.0))
}

/// An offset one tick later. Where a robot has no acceleration limits, those of a stop hold.
fn fade(offset: BodyTwist, limits: &Limits) -> BodyTwist {
    let rate = |accel: f64, stop: f64| TICK_S * if accel > 0.0 { accel } else { stop };
    let linear = rate(limits.accel_mps2, limits.stop_decel_mps2);
    let angular = rate(limits.accel_radps2, limits.stop_decel_radps2);
    let keep = |size: f64, loss: f64| if size > loss { 1.0 - loss / size } else { 0.0 };
    let kept = keep(libm::hypot(offset.vx_mps, offset.vy_mps), linear);
    BodyTwist::new(
        offset.vx_mps * kept,
        offset.vy_mps * kept,
        offset.omega_radps * keep(offset.omega_radps.abs(), angular),
    )
}
