//! launch: the process manager, the shell that hosts every block, the clocks and the command line.

pub mod config;
pub mod report;
