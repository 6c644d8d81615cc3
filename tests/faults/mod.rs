//! Fault injection: what goes wrong as data, and a robot it goes wrong with.
//!
//! ```text
//! seed ──draw──▶ plan ──▶ rig (virtual time) ──▶ watch: what holds at every tick
//!                    └──▶ real processes              row: what the fault table promises
//! ```
//!
//! * [`plan`]: faults, places, times; combined, printed, read back.
//! * [`seeds`]: one row of the fault table, many seeds; a failure prints seed and plan.
//! * [`rig`]: every box of the diagram as a process in virtual time ([`motion`], [`ways`], [`controller`],
//!   [`launch`]), with [`wire`]s on which faults act, [`life`]s that end and begin again, and what the boxes
//!   remember beyond their death ([`memory`]).
//! * [`watch`]: what holds at every tick; beside it a [`judge`] of what drivers are asked for.
//! * [`drive`]: a real robot under way, with processes beside it that are no part of it ([`cast`]).
//! * [`host`]: a full disk, a closed output, a clock that jumps; and how late the machine itself is.
//! * [`report`]: the fault table with what was measured.

// Every test program uses its own part.
#![allow(dead_code)]

pub mod cast;
pub mod controller;
pub mod drive;
pub mod host;
#[path = "../../services/step_generator/tests/judge/mod.rs"]
pub mod judge;
pub mod launch;
pub mod life;
pub mod memory;
pub mod message;
pub mod motion;
pub mod plan;
pub mod preload;
pub mod report;
pub mod rig;
pub mod seeds;
pub mod watch;
pub mod ways;
pub mod wire;
