//! Files that are there as a whole or not at all.

use std::path::Path;
use std::{fs, io};

/// Writes a file so that a reader sees the old one or the new one, never half of it.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    // Beside its target, because a rename is atomic only within one file system.
    let half = path.with_file_name(format!(".{name}.{}.tmp", std::process::id()));
    fs::write(&half, bytes).and_then(|()| fs::rename(&half, path)).map_err(|error| {
        // The half-written file is of no use; that it may not exist is no second fault.
        let _ = fs::remove_file(&half);
        io::Error::new(error.kind(), format!("cannot write {}: {error}", path.display()))
    })
}
