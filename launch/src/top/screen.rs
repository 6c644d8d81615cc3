//! A frame as lines of text, whatever the size of the terminal. Nothing here knows a terminal.
//!
//! ```text
//! epuck  armed, command   up 00:12:34   real clock   launch 4711 (0.1.0)
//! path   tracking, waypoint 3 of 42   in charge kanayama   standby qp
//! pose   x 0.1234 m  y 0.0120 m  heading 0.123 rad   0.0400 m/s  0.012 rad/s
//! track  estimate 3.12 mm left   truth 3.40 mm left   swaps 0  restarts 0
//! count  late 0  paused 0   commands late 0 refused 0 missing 0 borrowed 0
//!
//! PROCESS ...                  a line each, the columns that fit
//!
//! wires/s  path 0  reference 200 ...
//! late us  1 . 2 - 4 # 8 ...   how late the ticks woke, a bar between two times
//! ```

use super::{Process, Shown};
use crate::logging::plain;

/// Least columns it is made for; what does not fit is cut.
pub const COLUMNS_MIN: usize = 80;
/// Longest name of a process in the table, for those who have the room.
const NAME_MAX: usize = 28;
/// Shortest one.
const NAME_MIN: usize = 20;

/// How a frame is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Style {
    /// With colours and bold letters.
    pub colour: bool,
    /// With block characters, where the terminal reads UTF-8.
    pub blocks: bool,
}

impl Style {
    /// As the environment asks: `NO_COLOR`, and the character set of the locale.
    pub fn from_environment(terminal: bool) -> Self {
        let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
        let locale = set("LC_ALL").or_else(|| set("LC_CTYPE")).or_else(|| set("LANG")).unwrap_or_default();
        let utf8 = locale.to_ascii_lowercase().replace('-', "").contains("utf8");
        Self { colour: terminal && set("NO_COLOR").is_none(), blocks: utf8 }
    }
}

/// What a piece of text means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mark {
    Plain,
    Strong,
    Good,
    Warning,
    Bad,
    Head,
}

impl Mark {
    const fn sgr(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Strong => "\x1b[1m",
            Self::Good => "\x1b[32m",
            Self::Warning => "\x1b[33m",
            Self::Bad => "\x1b[1;31m",
            Self::Head => "\x1b[7m",
        }
    }
}

/// A line in pieces, cut where the terminal ends.
struct Line {
    text: String,
    used: usize,
    width: usize,
    colour: bool,
}

impl Line {
    fn new(width: usize, style: Style) -> Self {
        Self { text: String::new(), used: 0, width, colour: style.colour }
    }

    fn put(&mut self, mark: Mark, text: &str) -> &mut Self {
        // A character a column: what is wider, or has no width, would shift what comes after it.
        let known = |c: char| if c.is_ascii() || "▁▂▃▄▅▆▇█".contains(c) { c } else { '?' };
        let fitting: String = plain(text).chars().take(self.width - self.used).map(known).collect();
        self.used += fitting.chars().count();
        if self.colour && mark != Mark::Plain && !fitting.is_empty() {
            self.text.push_str(mark.sgr());
            self.text.push_str(&fitting);
            self.text.push_str("\x1b[0m");
        } else {
            self.text.push_str(&fitting);
        }
        self
    }

    fn say(&mut self, text: &str) -> &mut Self {
        self.put(Mark::Plain, text)
    }

    /// A count, that stands out if it is not zero.
    fn count(&mut self, what: &str, count: u64) -> &mut Self {
        self.say(what).put(if count == 0 { Mark::Plain } else { Mark::Warning }, &count.to_string())
    }
}

/// The frame for a terminal of `width` columns and `height` rows; more lines than `height` never.
pub fn lines(shown: &Shown, width: usize, height: usize, style: Style) -> Vec<String> {
    let line = || Line::new(width, style);
    let mut all = vec![head(shown, line()), path(shown, line()), pose(shown, line())];
    all.push(track(shown, line()));
    all.push(counts(shown, line()));
    if let Some(fault) = &shown.fault {
        let mut fault_line = line();
        fault_line.put(Mark::Bad, "fault  ").put(Mark::Bad, fault);
        all.push(fault_line);
    }
    all.push(line());
    all.extend(table(shown, width, style));
    let mut after = line();
    if shown.processes.iter().any(|process| process.name.starts_with("plant")) {
        after.say("plant  looks every 4 ms where nobody waits for it: 2 ms late is meant");
    }
    all.push(after);
    all.extend(wires(shown, width, style));
    all.push(bars(shown, line(), style));
    let mut texts: Vec<String> = all.into_iter().map(|line| line.text).collect();
    if texts.len() > height {
        let hidden = texts.len() - height + 1;
        texts.truncate(height.saturating_sub(1));
        let mut rest = line();
        rest.put(Mark::Warning, &format!("({hidden} more lines: make the terminal taller)"));
        texts.extend((height > 0).then_some(rest.text));
    }
    texts
}

fn head(shown: &Shown, mut line: Line) -> Line {
    let mode = match &*shown.mode {
        "armed" => Mark::Good,
        "e-stop" => Mark::Bad,
        _ => Mark::Warning,
    };
    let drive = if shown.drive == shown.mode { String::new() } else { format!(", {}", shown.drive) };
    let up = shown.uptime_s.max(0.0) as u64;
    let up = format!("{:02}:{:02}:{:02}", up / 3600, up / 60 % 60, up % 60);
    line.put(Mark::Strong, &shown.robot).say("  ").put(mode, &shown.mode).say(&drive);
    line.say(&format!("   up {up}   {} clock   launch {}", shown.clock, shown.launch_pid));
    line.say(&format!(" ({})", shown.version));
    line
}

fn path(shown: &Shown, mut line: Line) -> Line {
    line.say(&format!("path   {}, waypoint {} of {}", shown.path_state, shown.waypoint, shown.waypoint_last));
    match &shown.in_charge {
        Some(law) => line.say("   in charge ").put(Mark::Strong, law),
        None => line.say("   ").put(Mark::Bad, "no controller in charge"),
    };
    if let Some(law) = &shown.standby {
        line.say("   standby ").say(law);
    }
    line
}

fn pose(shown: &Shown, mut line: Line) -> Line {
    match shown.pose {
        Some([x, y, theta]) => line.say(&format!("pose   x {x:.4} m  y {y:.4} m  heading {theta:.3} rad")),
        None => line.say("pose   not known before the robot is armed"),
    };
    line.say(&format!("   {:.4} m/s  {:.3} rad/s", shown.speed_mps, shown.omega_radps));
    line
}

fn track(shown: &Shown, mut line: Line) -> Line {
    let aside = |what: &str, m: Option<f64>| {
        m.map(|m| format!("{what} {:.2} mm {}", m.abs() * 1e3, if m < 0.0 { "right" } else { "left" }))
    };
    let known = [aside("estimate", shown.cross_track_m), aside("truth", shown.cross_track_truth_m)];
    let known: Vec<String> = known.into_iter().flatten().collect();
    line.say("track  ").say(if known.is_empty() { "no path" } else { "" }).say(&known.join("   "));
    line.say(&format!("   swaps {}", shown.swaps)).count("  restarts ", shown.restarts);
    line
}

fn counts(shown: &Shown, mut line: Line) -> Line {
    line.say("count  ");
    line.count("late ", shown.ticks_late).count("  paused ", shown.paused_ticks);
    line.count("   commands late ", shown.commands_late).count(" refused ", shown.commands_rejected);
    line.count(" missing ", shown.cycles_without_command).count(" borrowed ", shown.commands_borrowed);
    line
}

/// A column of the table.
struct Column {
    head: &'static str,
    width: usize,
    /// Those with the greatest go first where there is no room.
    dispensable: u8,
    left: bool,
    text: fn(&Process) -> String,
}

const fn right(head: &'static str, width: usize, dispensable: u8, text: fn(&Process) -> String) -> Column {
    Column { head, width, dispensable, left: false, text }
}

const COLUMNS: [Column; 11] = [
    right("PID", 8, 0, |process| if process.pid == 0 { "-".to_owned() } else { process.pid.to_string() }),
    Column { head: "STATE", width: 10, dispensable: 0, left: true, text: |process| process.state.clone() },
    Column { head: "SCHED", width: 9, dispensable: 4, left: true, text: scheduling },
    right("CPU%", 6, 0, |process| number(process.cpu_percent, 1)),
    right("RSS", 6, 0, |process| memory(process.resident_bytes)),
    right("HZ", 6, 0, |process| number(process.hz, 0)),
    right("P50us", 7, 2, |process| number(process.lateness_us.p50, 0)),
    right("P99us", 7, 0, |process| number(process.lateness_us.p99, 0)),
    right("MAXus", 7, 0, |process| number(process.lateness_us.max, 0)),
    right("STEP99us", 9, 3, |process| number(process.step_us.p99, 0)),
    right(
        "RST",
        4,
        0,
        |process| if process.slot.is_some() { process.restarts.to_string() } else { "-".to_owned() },
    ),
];

/// `fifo:80 cpu:1 mlock` in fewer letters: `f80 c1 m`.
fn scheduling(process: &Process) -> String {
    if process.granted.is_empty() {
        return "-".to_owned();
    }
    process.granted.replace("fifo:", "f").replace("cpu:", "c").replace("mlock", "m")
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

fn memory(bytes: Option<u64>) -> String {
    bytes.map_or("-".to_owned(), |bytes| match bytes >> 20 {
        0 => format!("{}K", bytes >> 10),
        mb @ 1..10 => format!("{mb}.{}M", (bytes >> 10) % 1024 * 10 / 1024),
        mb @ 10..10_000 => format!("{mb}M"),
        mb => format!("{}G", mb >> 10),
    })
}

fn name(process: &Process) -> String {
    let mark = if process.authority { "*" } else { "" };
    match &process.law {
        Some(law) => format!("{}{mark} {law}", process.name),
        None => process.name.clone(),
    }
}

/// Cut to a width, with a mark where something is missing.
pub fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    text.chars().take(width.saturating_sub(1)).chain(['~']).collect()
}

fn table(shown: &Shown, width: usize, style: Style) -> Vec<Line> {
    let names: Vec<String> = shown.processes.iter().map(name).collect();
    let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
    let mut columns: Vec<&Column> = COLUMNS.iter().collect();
    let taken = |columns: &[&Column]| columns.iter().map(|column| column.width).sum::<usize>();
    while taken(&columns) + NAME_MIN > width {
        let most = columns.iter().map(|column| column.dispensable).max().unwrap_or(0);
        if most == 0 {
            break;
        }
        columns.retain(|column| column.dispensable < most);
    }
    let room = width.saturating_sub(taken(&columns));
    let name_width = longest.clamp(NAME_MIN, NAME_MAX).min(room.max(NAME_MIN));
    let cells = |name: &str, of: &dyn Fn(&Column) -> String| {
        let mut text = format!("{:<name_width$}", cut(name, name_width));
        for column in &columns {
            // A number that is cut is another number: it may take more room than it has.
            let cell = if column.left { cut(&of(column), column.width - 1) } else { of(column) };
            let width = column.width;
            text.push_str(&if column.left {
                format!(" {cell:<w$}", w = width - 1)
            } else {
                format!("{cell:>width$}")
            });
        }
        text
    };
    let mut head = Line::new(width, style);
    let title = cells("PROCESS", &|column| column.head.to_owned());
    // Its colour reaches to the edge.
    head.put(Mark::Head, &if style.colour { format!("{title:<width$}") } else { title });
    let mut lines = vec![head];
    for (process, name) in shown.processes.iter().zip(&names) {
        let mut line = Line::new(width, style);
        let mark = match &*process.state {
            "dead" | "fault" => Mark::Bad,
            "degraded" | "awaited" | "leaving" | "trial" => Mark::Warning,
            _ if process.authority => Mark::Strong,
            _ => Mark::Plain,
        };
        line.put(mark, &cells(name, &|column| (column.text)(process)));
        if !process.reason.is_empty() {
            line.say("  ").say(&process.reason);
        }
        lines.push(line);
    }
    lines
}

/// Rates of the wires, in as many lines as they need.
fn wires(shown: &Shown, width: usize, style: Style) -> Vec<Line> {
    let mut lines = Vec::new();
    let mut line = Line::new(width, style);
    line.say("wires/s");
    for wire in &shown.wires {
        let text = format!("  {} {:.0}", wire.name, wire.hz);
        if line.used + text.len() > width && line.used > 0 {
            let next = Line::new(width, style);
            lines.push(std::mem::replace(&mut line, next));
            line.say("       ");
        }
        line.say(&text);
    }
    lines.push(line);
    lines
}

fn bars(shown: &Shown, mut line: Line, style: Style) -> Line {
    const BLOCKS: [&str; 9] = [" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
    const LETTERS: [&str; 9] = [" ", ".", ":", "-", "=", "+", "*", "%", "#"];
    let steps = if style.blocks { BLOCKS } else { LETTERS };
    let most = shown.lateness_bars.iter().copied().max().unwrap_or(0);
    line.say("late us");
    if most == 0 {
        line.say("  no tick since the last look");
        return line;
    }
    line.say(" ");
    let last = shown.lateness_bars.len() - 1;
    for (bar, samples) in shown.lateness_bars.iter().enumerate() {
        // By its logarithm: one in a thousand is still to be seen.
        let share = (*samples as f64 + 1.0).ln() / (most as f64 + 1.0).ln();
        let step = if *samples == 0 { 0 } else { (share * 8.0).ceil().clamp(1.0, 8.0) as usize };
        let mark = if bar == last && *samples > 0 { Mark::Bad } else { Mark::Good };
        line.put(mark, &steps[step].repeat(2));
        if bar < last {
            line.say(&(1_u64 << bar).to_string());
        }
    }
    line.say(&format!("   {} ticks to {}", shown.lateness_bars.iter().sum::<u64>(), shown.tick));
    line
}

#[cfg(test)]
mod tests;
