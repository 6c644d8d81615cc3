//! What went over the wires, kept in files: MCAP, as Foxglove, Lichtblick and Python read it.
//!
//! ```text
//! recorder's loop ──hear──▶ Tape ══queue, bounded in bytes══▶ writer's thread ──▶ run.mcap, run-0001.mcap, …
//!                             └─ audit: what is missing, by ticks and sequence numbers
//! ```
//!
//! * [`wires`]: what is recorded, the one table; a channel `/hilare/<wire>` each, every message, bit for bit.
//! * [`schemas`], [`cdr`]: how our messages are told and laid out (`ros2msg`, CDR).
//! * [`ros`]: standard ROS 2 messages made of them, once a control period: `/odom`, `/tf`, `/path`, …
//! * [`inside`], [`standings`]: files in it, and where each box stood when a recording was begun in mid-drive.
//! * [`dating`]: when a message was.
//! * [`tape`]: the end that never waits for the disk; [`part`]: one file; [`audit`]: what is missing.
//! * [`reader`]: a recording read back, message by message.
//!
//! Time in a recording (`log_time`, `publish_time`, stamps) is the clock on the wall when its first tick was heard, and
//! a millisecond a tick from there on; what comes without a tick has the time of the newest tick heard. So it is free
//! of the machine's jitter, the same in every clock, and a pause of the robot takes no time.
//!
//! The live view for Foxglove (`crate::operator::viewer`) has the same channels from the same tables.

pub mod audit;
pub mod cdr;
mod damage;
pub mod dating;
pub mod info;
pub mod inside;
pub mod part;
pub mod reader;
pub mod ros;
pub mod schemas;
pub mod settings;
pub mod standings;
pub mod tape;
pub mod wires;
mod writer;

#[cfg(test)]
mod tests;

pub use audit::{Report, WireReport};
pub use info::RunInfo;
pub use reader::{Recording, Timed};
pub use settings::{Order, RecordingParams, Settings};
pub use standings::Standings;
pub use tape::Tape;
pub use wires::{Entry, Heard};

use std::fmt;
use std::path::Path;

/// Name of a run's recording in its directory; further parts are `run-0001.mcap`, …
pub const RECORDING_FILE: &str = "run.mcap";
/// The system file within a recording.
pub const SYSTEM_ATTACHMENT: &str = "system.toml";
/// Where each box stood when a recording was begun in mid-drive.
pub const STANDINGS_ATTACHMENT: &str = "standings.json";
/// The metadata record that says what was recorded.
const METADATA: &str = "hilare";

/// Why a recording cannot be read or written: one line with the file, the cause, what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingError(String);

impl RecordingError {
    fn new(file: &Path, what: impl fmt::Display) -> Self {
        Self(format!("{}: {what}", file.display()))
    }
}

impl fmt::Display for RecordingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for RecordingError {}
