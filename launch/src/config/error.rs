//! The one kind of error: a line that says where, what, and what to do.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest file that is read, bytes.
const MAX_FILE: usize = 1_000_000;
/// Longest piece of a user's text that an error repeats, characters.
const MAX_QUOTED: usize = 40;

/// What is wrong with a file, an assignment or a name; exactly one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigError(String);

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ConfigError {}

impl ConfigError {
    /// At a place.
    pub(super) fn new(place: impl fmt::Display, what: impl fmt::Display) -> Self {
        Self::bare(format!("{place}: {what}"))
    }

    /// About something that has no place, such as a name on the command line.
    pub(super) fn bare(what: impl fmt::Display) -> Self {
        let breaks = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
        let escape = |c: char| if breaks(c) { c.escape_default().to_string() } else { c.to_string() };
        Self(what.to_string().chars().map(escape).collect())
    }
}

/// A user's text, cut if long.
pub(super) fn clipped(text: &str) -> String {
    match text.char_indices().nth(MAX_QUOTED) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// The same in quotes.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", clipped(text))
}

/// The text of a file of at most [`MAX_FILE`] bytes.
pub(super) fn read_text(path: &Path) -> Result<String, ConfigError> {
    let place = path.display().to_string();
    let unreadable = |error: std::io::Error| ConfigError::new(&place, format!("cannot be read: {error}"));
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(MAX_FILE as u64 + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() > MAX_FILE {
        return Err(ConfigError::new(place, "larger than 1 MB; name a system or scenario file"));
    }
    String::from_utf8(bytes).map_err(|error| {
        let good = error.utf8_error().valid_up_to();
        let line = line_of(error.as_bytes(), good);
        ConfigError::new(format!("{place}:{line}"), "not UTF-8 text; save the file as UTF-8")
    })
}

/// Line, from 1, of a byte offset.
pub(super) fn line_of(text: &[u8], offset: usize) -> usize {
    1 + text[..offset.min(text.len())].iter().filter(|byte| **byte == b'\n').count()
}
