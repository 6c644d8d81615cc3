//! The fault table with real processes: real memory, real signals, bounds in ticks executed.
//!
//!     cargo test --test faults_real                                        a few minutes
//!     HILARE_FAULT_SEEDS=100 cargo test --release --test faults_real       as at night
//!
//! A run that the host has spoilt, by what the run itself measured, is run again; no bound is wider for it.

#[path = "../faults/mod.rs"]
mod faults;
#[path = "../support/mod.rs"]
mod support;

mod boxes;
mod controllers;
mod load;
mod machine;
mod robot;
mod unfinished;

/// Not a test: what the others start beside their robots.
#[test]
#[ignore = "a process of the other tests, started by them"]
fn a_process_beside_a_robot() {
    faults::cast::play();
}
