//! Which messages each box is stepped with, and what becomes of its answer.

pub mod controller;
mod plant;
mod pose_estimator;
mod waypoint_selector;

pub use controller::ControllerProcess;
pub use plant::PlantProcess;
pub use pose_estimator::{EstimatorProcess, Reckoner};
pub use waypoint_selector::SelectorProcess;

use super::ClockKind;
use hilare_interfaces::block::Tick;
use std::time::Duration;

/// True if a tick comes after what is done.
fn is_new(done: Option<Tick>, tick: Tick) -> bool {
    done.is_none_or(|done| tick > done)
}

/// How long the relay sleeps between two looks.
pub fn relay_interval(clock: ClockKind) -> Duration {
    match clock {
        ClockKind::Real => Duration::from_millis(5),
        ClockKind::Lockstep | ClockKind::InProcess => observer_interval(clock),
    }
}

/// How long an observer sleeps between two looks.
pub fn observer_interval(clock: ClockKind) -> Duration {
    match clock {
        ClockKind::Real => Duration::from_millis(10),
        // The lockstep clock waits for the recorder; let it not wait long.
        ClockKind::Lockstep | ClockKind::InProcess => Duration::from_micros(250),
    }
}
