//! Log lines of all processes: `seconds LEVEL process: message`, seconds on CLOCK_MONOTONIC, which
//! all processes of a machine share, so that merged lines sort.

use indicatif::ProgressBar;
use rustix::time::{ClockId, clock_gettime};
use std::fmt;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::registry::LookupSpan;

/// Formats one event as one line.
struct Line {
    process: &'static str,
}

/// Beginning of a line: time, level, process.
fn head(level: &str, process: &str) -> String {
    let now = clock_gettime(ClockId::Monotonic);
    format!("{:>9}.{:06} {level:<5} {process}:", now.tv_sec, now.tv_nsec / 1000)
}

impl<S, N> FormatEvent<S, N> for Line
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, _: &FmtContext<'_, S, N>, mut to: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let mut fields = Fields(String::new());
        event.record(&mut fields);
        // One event is one line, whatever the message contains.
        let text = fields.0.replace('\n', " | ");
        writeln!(to, "{}{text}", head(event.metadata().level().as_str(), self.process))
    }
}

struct Fields(String);

impl Visit for Fields {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        use fmt::Write;
        let _ = match field.name() {
            "message" => write!(self.0, " {value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

/// A worker: lines go to standard error, where launch reads them.
pub fn init_worker(process: &'static str) {
    let _ = tracing_subscriber::fmt()
        .event_format(Line { process })
        .with_max_level(max_level())
        .with_writer(io::stderr)
        .try_init();
}

/// Launch: its own lines and those of the workers go to the same sink.
pub fn init_launch(sink: &LogSink) {
    let _ = tracing_subscriber::fmt()
        .event_format(Line { process: "launch" })
        .with_max_level(max_level())
        .with_writer(sink.clone())
        .try_init();
}

fn max_level() -> Level {
    std::env::var("HILARE_LOG").ok().and_then(|level| level.parse().ok()).unwrap_or(Level::INFO)
}

/// Where merged lines go: a file with all of them, and the terminal with those that matter.
#[derive(Clone)]
pub struct LogSink(Arc<Mutex<Sink>>);

struct Sink {
    file: Option<File>,
    terminal: Level,
    bar: Option<ProgressBar>,
}

impl LogSink {
    /// Lines of `terminal` and above are shown on standard error.
    pub fn new(terminal: Level) -> Self {
        Self(Arc::new(Mutex::new(Sink { file: None, terminal, bar: None })))
    }

    fn with<R>(&self, act: impl FnOnce(&mut Sink) -> R) -> R {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// From now on every line also goes to this file.
    pub fn to_file(&self, path: &Path) -> io::Result<()> {
        let file = File::create(path)?;
        self.with(|sink| sink.file = Some(file));
        Ok(())
    }

    /// From now on lines appear above this progress bar; `None` when it is gone.
    pub fn around(&self, bar: Option<ProgressBar>) {
        self.with(|sink| sink.bar = bar);
    }

    /// A line of a worker's standard error; what is not a log line (a panic) is made one.
    pub fn worker_line(&self, process: &str, line: &str) {
        if line.trim().is_empty() {
            return;
        }
        match level_of(line) {
            Some(level) => self.line(level, line),
            None => self.line(Level::ERROR, &format!("{} {line}", head("ERROR", process))),
        }
    }

    fn line(&self, level: Level, line: &str) {
        self.with(|sink| {
            if let Some(file) = &mut sink.file {
                // A full disk costs the log, not the drive.
                let _ = writeln!(file, "{line}");
            }
            // Levels order by verbosity.
            if level <= sink.terminal {
                match &sink.bar {
                    Some(bar) if !bar.is_hidden() => bar.println(line),
                    _ => {
                        let _ = writeln!(io::stderr(), "{line}");
                    }
                }
            }
        });
    }
}

/// The level of a line in our format.
fn level_of(line: &str) -> Option<Level> {
    let mut words = line.split_whitespace();
    words.next()?.parse::<f64>().ok()?;
    words.next()?.parse().ok()
}

/// One event on its way into the sink.
pub struct SinkWriter(LogSink);

impl Write for SinkWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(bytes);
        for line in text.lines() {
            self.0.line(level_of(line).unwrap_or(Level::INFO), line);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for LogSink {
    type Writer = SinkWriter;

    fn make_writer(&'a self) -> SinkWriter {
        SinkWriter(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_lines_become_log_lines() {
        let line = format!("{} hello", head("WARN", "plant"));
        assert_eq!(level_of(&line), Some(Level::WARN));
        assert_eq!(level_of("thread 'main' panicked at src/x.rs:1"), None);
        assert_eq!(level_of(""), None);
    }
}
