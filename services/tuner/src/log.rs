//! The log of a search: every evaluation, one line each, only ever appended.
//!
//! ```text
//! # hilare-tuner 1 seed=1 swarm=50 archive=100 objectives=2 parameters=5 problem=...
//! evaluation,violation,f1,f2,k1,k2          names of objectives and parameters
//! 0,0.0,0.0027,0.0026,0.0247,2967100.0
//! ```
//!
//! A search is a function of its settings and of the outcomes, so the log is all that a resumed one needs:
//! it flies the same way again, takes logged outcomes instead of evaluating, and goes on from there with
//! the same bits. A last line that was torn by a crash is cut off.

use crate::swarm::Mopso;
use std::fmt::{self, Write as _};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Why a log cannot be used.
#[derive(Debug)]
pub enum LogError {
    /// The file cannot be read or written.
    Io(io::Error),
    /// Another process has it open.
    Busy,
    /// It is the log of another search: other settings, parameters or objective.
    Other,
    /// A line that no search has written.
    Line {
        /// Its number, from 1.
        line: usize,
        /// What is wrong with it.
        what: &'static str,
    },
}

impl fmt::Display for LogError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => write!(f, "{error}"),
            Self::Busy => write!(f, "another search is writing it"),
            Self::Other => write!(f, "the log of another search (settings, parameters or problem differ)"),
            Self::Line { line, what } => write!(f, "line {line}: {what}"),
        }
    }
}

impl std::error::Error for LogError {}

impl From<io::Error> for LogError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Lines before the first evaluation.
const HEAD_LINES: usize = 2;

/// A log that is open for appending.
#[derive(Debug)]
pub struct Log {
    file: File,
    known: u64,
    /// Of each known evaluation: violation, objectives, values.
    numbers: Vec<f64>,
    width: usize,
    text: String,
}

impl Log {
    /// Begins a log; the file must not exist. `problem` stands for whatever else the outcomes depend on, and
    /// `objectives` are their names; both without line breaks.
    pub fn create(path: &Path, search: &Mopso, problem: &str, objectives: &[&str]) -> Result<Self, LogError> {
        let mut file = OpenOptions::new().write(true).create_new(true).open(path)?;
        lock(&file)?;
        file.write_all(head(search, problem, objectives).as_bytes())?;
        let width = width(search);
        Ok(Self { file, known: 0, numbers: Vec::new(), width, text: String::new() })
    }

    /// Opens the log of a search that was stopped, to go on where it ended.
    pub fn resume(path: &Path, search: &Mopso, problem: &str, objectives: &[&str]) -> Result<Self, LogError> {
        let mut file = OpenOptions::new().read(true).write(true).open(path)?;
        lock(&file)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        // Whatever comes after the last line break is torn.
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
        let head = head(search, problem, objectives);
        let rows = bytes[..whole].strip_prefix(head.as_bytes());
        let Some(rows) = rows else {
            // Torn within its head: nothing was evaluated.
            if !head.as_bytes().starts_with(&bytes) {
                return Err(LogError::Other);
            }
            file.set_len(0)?;
            file.seek(SeekFrom::Start(0))?;
            file.write_all(head.as_bytes())?;
            let width = width(search);
            return Ok(Self { file, known: 0, numbers: Vec::new(), width, text: String::new() });
        };
        let (width, mut known, mut numbers) = (width(search), 0, Vec::new());
        for row in rows.split_inclusive(|byte| *byte == b'\n') {
            let line = HEAD_LINES + known as usize + 1;
            let wrong = |what| LogError::Line { line, what };
            let row = std::str::from_utf8(row).map_err(|_| wrong("not text"))?;
            let (number, row) = row.trim_end().split_once(',').ok_or_else(|| wrong("no numbers"))?;
            if number.parse() != Ok(known) {
                return Err(wrong("the evaluations are not in order"));
            }
            for cell in row.split(',') {
                numbers.push(cell.parse().map_err(|_| wrong("not a number"))?);
            }
            known += 1;
            if numbers.len() != known as usize * width {
                return Err(wrong("another number of columns"));
            }
        }
        file.set_len(whole as u64)?;
        file.seek(SeekFrom::End(0))?;
        Ok(Self { file, known, numbers, width, text: String::new() })
    }

    /// Evaluations that are logged.
    pub fn known(&self) -> u64 {
        self.known
    }

    /// Fills in what is known of a generation that begins at evaluation `first`: answers of how many
    /// particles. Values that differ from the logged ones are of another search.
    pub(crate) fn recall(
        &self,
        first: u64,
        values: &[f64],
        objectives: &mut [f64],
        violations: &mut [f64],
    ) -> Result<usize, LogError> {
        let count = violations.len();
        let (dimensions, width) = (values.len() / count, objectives.len() / count);
        let known = self.known.saturating_sub(first).min(count as u64) as usize;
        for particle in 0..known {
            let row = &self.numbers[(first as usize + particle) * self.width..][..self.width];
            let (outcome, logged) = row.split_at(1 + width);
            let now = &values[particle * dimensions..][..dimensions];
            if !now.iter().zip(logged).all(|(now, logged)| now.to_bits() == logged.to_bits()) {
                return Err(LogError::Line {
                    line: HEAD_LINES + first as usize + particle + 1,
                    what: "not what this search evaluates here; it is of another version or settings",
                });
            }
            violations[particle] = outcome[0];
            objectives[particle * width..][..width].copy_from_slice(&outcome[1..]);
        }
        Ok(known)
    }

    /// Appends what particles `from..to` of a generation came to.
    pub(crate) fn append(
        &mut self,
        first: u64,
        range: std::ops::Range<usize>,
        values: &[f64],
        objectives: &[f64],
        violations: &[f64],
    ) -> Result<(), LogError> {
        let count = violations.len();
        let (dimensions, width) = (values.len() / count, objectives.len() / count);
        self.text.clear();
        for particle in range {
            let _ = write!(self.text, "{},{:?}", first + particle as u64, violations[particle]);
            let objectives = &objectives[particle * width..][..width];
            for number in objectives.iter().chain(&values[particle * dimensions..][..dimensions]) {
                let _ = write!(self.text, ",{number:?}");
            }
            self.text.push('\n');
        }
        self.file.write_all(self.text.as_bytes())?;
        Ok(())
    }
}

/// Until the file is closed, or its process dies.
fn lock(file: &File) -> Result<(), LogError> {
    file.try_lock().map_err(|error| match error {
        TryLockError::WouldBlock => LogError::Busy,
        TryLockError::Error(error) => LogError::Io(error),
    })
}

/// Numbers of a line behind the evaluation's own.
fn width(search: &Mopso) -> usize {
    1 + search.settings().objectives + search.space().dimensions()
}

fn head(search: &Mopso, problem: &str, objectives: &[&str]) -> String {
    let settings = search.settings();
    let mut text = format!(
        "# hilare-tuner 1 seed={} swarm={} archive={} starts={:?} reference={:?} problem={problem}",
        settings.seed, settings.swarm, settings.archive, settings.starts, settings.reference
    );
    for parameter in search.space().parameters() {
        let _ = write!(
            text,
            " {}={:?}..{:?}:{:?}",
            parameter.name, parameter.low, parameter.high, parameter.kind
        );
    }
    text.push_str("\nevaluation,violation");
    let parameters = search.space().parameters().iter().map(|parameter| parameter.name.as_str());
    for name in objectives.iter().copied().chain(parameters) {
        let _ = write!(text, ",{name}");
    }
    text.push('\n');
    text
}
