//! Tuning: the parameters of a law, searched for on scenarios.
//!
//! ```text
//!   scenarios × seeds ─┐
//!   parameters ────────┼─▶ [`problem`] ──closure──▶ hilare_tuner ──front──▶ [`choice`] ──▶ [`report`]
//!   objectives ────────┘   candidate → figures
//! ```
//!
//! * [`objectives`]: what can be minimised, by name.
//! * [`parameters`]: what is searched, from the law's spec.
//! * [`problem`]: the one function from a candidate to its figures.
//! * [`judge`]: what a search asks it.
//! * [`choice`]: a point of the front.
//! * [`report`], [`picture`]: what it came to.

pub mod choice;
pub mod judge;
pub mod objectives;
pub mod parameters;
pub mod picture;
pub mod problem;
pub mod report;
