//! The system files workers read: numbered, never overwritten, because a recording names the one each worker read.

use crate::config::System;
use crate::shell::worker::system_file;
use crate::whole::write_whole;
use std::path::Path;

/// Which files there are, and which are read.
pub(super) struct SystemFiles {
    written: u64,
    /// The one workers and successors read.
    pub current: u64,
    /// The one a controller on trial reads.
    pub trial: u64,
}

impl SystemFiles {
    /// The first, in the robot's runtime directory.
    pub fn begin(dir: &Path, system: &System) -> Result<Self, String> {
        let mut files = Self { written: 0, current: 0, trial: 0 };
        files.current = files.write(dir, system)?;
        Ok(files)
    }

    /// Writes a system, whole or not at all; its number.
    pub fn write(&mut self, dir: &Path, system: &System) -> Result<u64, String> {
        let number = self.written + 1;
        let file = dir.join(system_file(number));
        write_whole(&file, system.to_toml().as_bytes()).map_err(|error| error.to_string())?;
        self.written = number;
        Ok(number)
    }
}
