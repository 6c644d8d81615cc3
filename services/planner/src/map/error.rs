//! One error line for every bad map file: where, what, what to do.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why a map could not be loaded. Displays as one line: `file:line: what; cure`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MapError {
    /// the file at fault (the image, when the image is at fault)
    pub path: PathBuf,
    /// 1-based line, where the format has lines and the parser knows it
    pub line: Option<usize>,
    /// what is wrong
    pub what: String,
    /// what to do about it
    pub cure: String,
}

impl MapError {
    pub(crate) fn new(path: &Path, line: Option<usize>, fault: Fault) -> Self {
        Self {
            path: path.to_owned(),
            line: fault.line.or(line),
            what: one_line(&fault.what),
            cure: fault.cure,
        }
    }
}

impl fmt::Display for MapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}; {}", self.what, self.cure)
    }
}

impl std::error::Error for MapError {}

/// A fault found by a parser that does not know the file's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    pub line: Option<usize>,
    pub what: String,
    pub cure: String,
}

impl Fault {
    pub fn new(what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self { line: None, what: what.into(), cure: cure.into() }
    }

    pub fn at(line: usize, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self { line: Some(line), what: what.into(), cure: cure.into() }
    }

    pub fn io(error: &std::io::Error) -> Self {
        let cure = match error.kind() {
            std::io::ErrorKind::NotFound => "check the path",
            std::io::ErrorKind::PermissionDenied => "make the file readable",
            std::io::ErrorKind::UnexpectedEof => "the file is cut short: fetch it again",
            _ => "check the file",
        };
        Self::new(format!("cannot read: {error}"), cure)
    }

    pub fn in_file(self, path: &Path) -> MapError {
        MapError::new(path, None, self)
    }
}

/// Parser messages can span lines and quote the input; keep one bounded line of them.
fn one_line(text: &str) -> String {
    const MAX_CHARS: usize = 200;
    let mut line = String::new();
    for (count, c) in text.trim().chars().enumerate() {
        if count == MAX_CHARS {
            line.push('…');
            break;
        }
        line.push(if c.is_control() { ' ' } else { c });
    }
    line
}
