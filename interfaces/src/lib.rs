//! What crosses a process border in hilare.
//!
//! * [`wires`]: the block diagram as one const table; ports, start order, documentation read it.
//! * [`messages`]: the `repr(C)` types on those wires, each with a versioned name and a layout hash.
//! * [`block`]: what a box of the diagram is; [`state`]: what it remembers, to be saved and loaded.
//! * [`geometry`], [`segment`], [`chassis`], [`motors`], [`acceptance`], [`params`], [`latency`]: the words
//!   the boxes share.
//!
//! Features: `export`, the wires as a C header and a Python module; `hostile`, for tests, messages no honest
//! program sends.
//!
//! Everything is SI (m, rad, s), axes follow ROS REP-103 (x forward, y left, counter-clockwise
//! positive). The crate is `no_std`: nothing here can reach a clock, a file or a log.
#![no_std]

pub mod acceptance;
pub mod block;
pub mod chassis;
#[cfg(feature = "export")]
pub mod export;
pub mod geometry;
#[cfg(feature = "hostile")]
pub mod hostile;
pub mod latency;
pub mod layout;
pub mod messages;
pub mod motors;
pub mod params;
pub mod segment;
pub mod state;
pub mod wires;

#[cfg(feature = "export")]
extern crate alloc;
#[cfg(any(test, feature = "hostile"))]
extern crate std;
