//! Log lines of all processes: `seconds LEVEL process: message`, seconds on CLOCK_MONOTONIC, which
//! all processes of a machine share, so that merged lines sort.

mod outlet;
mod recent;

use indicatif::{ProgressBar, ProgressDrawTarget};
use outlet::Outlet;
use recent::Recent;
pub use recent::Said;
use rustix::time::{ClockId, clock_gettime};
use std::fmt;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
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
        let text = plain(&fields.0.replace('\n', " | "));
        writeln!(to, "{}{text}", head(event.metadata().level().as_str(), self.process))
    }
}

/// Text without what a terminal would obey: it may be of any program.
pub fn plain(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\t' { char::REPLACEMENT_CHARACTER } else { c }).collect()
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
    file: Option<Outlet>,
    terminal: Outlet,
    /// Lines of this level and above are for the terminal.
    shown: Level,
    bar: Option<ProgressBar>,
    /// The newest lines, for whoever asks.
    recent: Recent,
    /// What each worker has said of late.
    talk: Vec<Talk>,
}

/// Lines a worker may write in a second: more would fill the disk with it.
const LINES_MAX: u32 = 200;

/// The lines of a worker in the second under way.
struct Talk {
    slot: usize,
    since: Instant,
    lines: u32,
}

impl Talk {
    /// Counts a line; the lines left out before it if a new second begins, and whether it is one too many.
    fn count(&mut self, now: Instant) -> (u32, bool) {
        let mut left_out = 0;
        if now.duration_since(self.since) >= Duration::from_secs(1) {
            left_out = self.lines.saturating_sub(LINES_MAX);
            (self.since, self.lines) = (now, 0);
        }
        self.lines = self.lines.saturating_add(1);
        (left_out, self.lines > LINES_MAX)
    }
}

impl LogSink {
    /// Lines of `shown` and above are shown on standard error.
    pub fn new(shown: Level) -> io::Result<Self> {
        let terminal = Outlet::new(io::stderr())?;
        let sink =
            Sink { file: None, terminal, shown, bar: None, recent: Recent::default(), talk: Vec::new() };
        Ok(Self(Arc::new(Mutex::new(sink))))
    }

    fn with<R>(&self, act: impl FnOnce(&mut Sink) -> R) -> R {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// From now on every line also goes to this file.
    pub fn to_file(&self, path: &Path) -> io::Result<()> {
        let file = Outlet::new(File::create(path)?)?;
        self.with(|sink| sink.file = Some(file));
        Ok(())
    }

    /// Where a progress bar is to be drawn.
    pub fn draw_target(&self) -> ProgressDrawTarget {
        self.with(|sink| sink.terminal.draw_target())
    }

    /// Whatever is said until this goes is written then.
    pub fn written_at_end(&self) -> WrittenAtEnd<'_> {
        WrittenAtEnd(self)
    }

    /// Waits until what was said is written; not for ever.
    pub fn flush(&self) {
        let (file, terminal) = self.with(|sink| (sink.file.clone(), sink.terminal.clone()));
        file.iter().chain([&terminal]).for_each(Outlet::flush);
    }

    /// The lines after the first `after` there have been, as many as one answer holds; and how many that makes.
    pub fn since(&self, after: u64) -> (u64, Vec<Said>) {
        self.with(|sink| sink.recent.since(after))
    }

    /// From now on lines appear above this progress bar; `None` when it is gone.
    pub fn around(&self, bar: Option<ProgressBar>) {
        self.with(|sink| sink.bar = bar);
    }

    /// A line of a worker's standard error; what is not a log line (a panic) is made one. Of a worker that
    /// floods its log the rest of the second is left out, and how much that was is said.
    pub fn worker_line(&self, slot: usize, process: &str, line: &str) {
        if line.trim().is_empty() {
            return;
        }
        let (left_out, too_many) = self.with(|sink| sink.talk_of(slot).count(Instant::now()));
        if left_out > 0 {
            self.line(Level::WARN, &format!("{} {left_out} lines left out", head("WARN", process)));
        }
        if too_many {
            return;
        }
        let line = plain(line);
        match level_of(&line) {
            Some(level) => self.line(level, &line),
            None => self.line(Level::ERROR, &format!("{} {line}", head("ERROR", process))),
        }
    }

    fn line(&self, level: Level, line: &str) {
        self.with(|sink| {
            sink.recent.add(line);
            if let Some(file) = &sink.file {
                file.line(line);
            }
            // Levels order by verbosity.
            if level <= sink.shown {
                match &sink.bar {
                    Some(bar) if !bar.is_hidden() => bar.println(line),
                    _ => sink.terminal.line(line),
                }
            }
        });
    }
}

impl Sink {
    fn talk_of(&mut self, slot: usize) -> &mut Talk {
        let place = self.talk.iter().position(|talk| talk.slot == slot).unwrap_or_else(|| {
            self.talk.push(Talk { slot, since: Instant::now(), lines: 0 });
            self.talk.len() - 1
        });
        &mut self.talk[place]
    }
}

/// The level of a line in our format.
fn level_of(line: &str) -> Option<Level> {
    let mut words = line.split_whitespace();
    words.next()?.parse::<f64>().ok()?;
    words.next()?.parse().ok()
}

/// Sees to it that all is written when it goes.
pub struct WrittenAtEnd<'a>(&'a LogSink);

impl Drop for WrittenAtEnd<'_> {
    fn drop(&mut self) {
        self.0.flush();
    }
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

    #[test]
    fn what_a_worker_says_cannot_move_the_cursor() {
        let shown = plain("x\u{1b}[2J\r\u{7}\u{9b}31m\ty\u{7f}");
        assert_eq!(shown, "x\u{fffd}[2J\u{fffd}\u{fffd}\u{fffd}31m\ty\u{fffd}");
    }

    #[test]
    fn a_flood_is_cut_and_counted_and_the_next_second_is_another() {
        let start = Instant::now();
        let mut talk = Talk { slot: 0, since: start, lines: 0 };
        let kept = (0..1000).filter(|_| talk.count(start) == (0, false)).count();
        assert_eq!(kept, LINES_MAX as usize);
        assert_eq!(talk.count(start + Duration::from_secs(1)), (1000 - LINES_MAX, false));
        assert_eq!(talk.count(start + Duration::from_secs(1)), (0, false));
    }
}
