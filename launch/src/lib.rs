//! launch: the process manager, the shell that hosts every block, the clocks and the command line.
//!
//! * [`config`]: system and scenario files.
//! * [`shell`]: what makes a block a process.
//! * [`manager`]: what makes processes a robot.
//! * [`doctor`]: what a machine allows.
//! * [`latency`]: how punctual it all is.
//! * [`look`]: a robot seen from outside.
//! * [`operator`]: the page about a robot.
//! * [`recording`]: what went over the wires, kept in files and read back.
//! * [`replay`]: a recording, run again through the same code.
//! * [`report`]: what a run came to.
//! * [`top`]: a robot on a terminal.
//! * [`topic`]: what the wires carry, for people.
//! * [`reproduce`]: what the papers print, beside what comes out here.
//! * [`systemd`]: units that start a robot at boot.
//! * [`tuning`]: parameters of a law, searched for.
//! * [`cli`]: the `hilare` command.
//! * `whole`: files that are there as a whole or not at all.
//! * `private`: what belongs to one user alone, in places that belong to everybody.

pub mod cli;
pub mod config;
pub mod doctor;
pub mod latency;
pub mod logging;
pub mod look;
pub mod manager;
pub mod operator;
mod private;
pub mod recording;
pub mod replay;
pub mod report;
pub mod reproduce;
pub mod shell;
pub mod systemd;
pub mod top;
pub mod topic;
pub mod tuning;
mod whole;
