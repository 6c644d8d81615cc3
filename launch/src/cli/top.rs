//! `hilare top`: a robot on a terminal. Joins the relay's wires only, and asks launch: looking costs the robot
//! nothing.

use super::operate::{RobotArgs, choose};
use super::{VerbResult, print, refused};
use crate::logging::plain;
use crate::look::Told;
use crate::look::wires::Wires;
use crate::manager::Failure;
use crate::manager::robot_dir::{Living, living_robots};
use crate::shell::realtime;
use crate::shell::transport::Domain;
use crate::top::screen::{COLUMNS_MIN, Style, cut, lines};
use crate::top::terminal::Terminal;
use crate::top::{Glance, Shown};
use clap::Args;
use crossbeam_channel::{Receiver, bounded};
use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two looks at wires, keys and signals.
const LOOK: Duration = Duration::from_millis(20);
/// Time launch may take to answer before that is said.
const SILENCE: Duration = Duration::from_secs(2);
/// Rows of a frame that goes to no terminal: all of it.
const ALL_ROWS: usize = 1000;
/// Columns of a frame that goes to no terminal.
const WIDE: usize = 132;
/// Time from the first look to the second on a screen.
const FIRST: Duration = Duration::from_millis(300);

/// Options of `hilare top`.
#[derive(Args)]
pub struct TopArgs {
    /// Time between two frames, seconds
    #[arg(long, value_name = "S", default_value_t = 1.0, allow_negative_numbers = true)]
    interval: f64,
    /// Print one frame, of the time until --interval is over, and end
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    robot: RobotArgs,
}

/// Shows a robot until q, Ctrl-C, or its end.
pub fn top(args: &TopArgs) -> VerbResult {
    if !(args.interval >= 0.1 && args.interval <= 3600.0) {
        return Err(refused(format!("--interval {}: 0.1 to 3600 seconds are wanted", args.interval)));
    }
    let robot = choose(args.robot.robot.as_ref())?;
    let told_to_end = Arc::new(AtomicBool::new(false));
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&told_to_end))
            .map_err(|e| Failure::Fault(e.to_string()))?;
    }
    realtime::leave_the_control_path();
    let dir = robot.socket.parent().unwrap_or(robot.socket.as_path());
    let domain = Domain::join(dir, "top").map_err(refused)?;
    let wires = Wires::open(&domain).map_err(refused)?;
    let on_screen = !args.once && !args.robot.json;
    let terminal = if on_screen {
        Terminal::take_over().map_err(|error| Failure::Fault(format!("the terminal: {error}")))?
    } else {
        None
    };
    let style = Style::from_environment(io::stdout().is_terminal());
    let look = Look { robot, wires, asked: None, due: Instant::now(), before: None };
    Show { args, style, look, terminal, shown: None, note: None }.until(&told_to_end)
}

/// A robot that is looked at again and again.
struct Look {
    robot: Living,
    wires: Wires,
    /// Launch is asked in a thread of its own: it may not answer, and keys are to be heard meanwhile.
    asked: Option<(Instant, Receiver<Result<Told, String>>)>,
    /// When it is to be asked again.
    due: Instant,
    before: Option<Glance>,
}

/// What a look came to.
enum Seen {
    Nothing,
    /// What there is to show.
    Frame(Box<Shown>),
    /// Why there is nothing new.
    Note(String),
    RobotDown,
}

impl Look {
    /// Takes in what has come; `first` is the time from the first look to the second, of which the first frame is.
    fn look(&mut self, first: Duration, between: Duration) -> Seen {
        self.wires.look();
        let now = Instant::now();
        let Some((since, answer)) = &self.asked else {
            if now >= self.due {
                self.asked = Some((now, ask(self.robot.socket.clone())));
            }
            return Seen::Nothing;
        };
        match answer.try_recv() {
            Ok(Ok(told)) => {
                self.asked = None;
                let glance = Glance::new(told, self.wires.heard());
                let shown = self.before.as_ref().map(|before| Box::new(Shown::between(before, &glance)));
                self.due = now + if shown.is_some() { between } else { first };
                self.before = Some(glance);
                shown.map_or(Seen::Nothing, Seen::Frame)
            }
            Ok(Err(why)) => {
                self.asked = None;
                self.due = now + SILENCE / 10;
                self.unless_down(why)
            }
            Err(_) if now - *since > SILENCE => {
                let seconds = (now - *since).as_secs();
                self.unless_down(format!("launch has not answered for {seconds} s"))
            }
            Err(_) => Seen::Nothing,
        }
    }

    fn unless_down(&self, note: String) -> Seen {
        if living_robots().contains(&self.robot) { Seen::Note(note) } else { Seen::RobotDown }
    }
}

fn ask(socket: PathBuf) -> Receiver<Result<Told, String>> {
    let (sender, answer) = bounded(1);
    std::thread::spawn(move || {
        // Nobody may be there any more to hear it.
        let _ = sender.send(Told::by(&socket));
    });
    answer
}

/// Where what is seen is shown.
struct Show<'a> {
    args: &'a TopArgs,
    style: Style,
    look: Look,
    terminal: Option<Terminal>,
    shown: Option<Box<Shown>>,
    note: Option<String>,
}

impl Show<'_> {
    fn until(mut self, told_to_end: &AtomicBool) -> VerbResult {
        let between = Duration::from_secs_f64(self.args.interval);
        // On a screen a first frame of a short time is better than none.
        let first = if self.terminal.is_some() { between.min(FIRST) } else { between };
        let mut drawn = (0, 0);
        while !told_to_end.load(Ordering::Relaxed) {
            if let Some(terminal) = &mut self.terminal {
                if terminal.wait_for_the_end(LOOK) {
                    break;
                }
            } else {
                std::thread::sleep(LOOK);
            }
            let size = self.terminal.as_ref().map_or((0, 0), Terminal::size);
            let mut fresh = size != drawn;
            match self.look.look(first, between) {
                Seen::Nothing => {}
                Seen::Frame(shown) => {
                    (self.shown, self.note, fresh) = (Some(shown), None, true);
                }
                Seen::Note(note) => {
                    fresh |= self.note.as_ref() != Some(&note);
                    self.note = Some(note);
                }
                Seen::RobotDown => {
                    let robot = self.look.robot.robot.clone();
                    return Err(Failure::Fault(format!("robot {robot:?} went down")));
                }
            }
            if fresh && !self.show(size) {
                break;
            }
            drawn = size;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// False if that was all.
    fn show(&mut self, size: (usize, usize)) -> bool {
        if let Some(terminal) = &self.terminal {
            return terminal.draw(&self.lines(size)).is_ok();
        }
        if self.note.is_some() || self.shown.is_none() {
            return true;
        }
        let heard = match &self.shown {
            Some(shown) if self.args.robot.json => {
                print(&format!("{}\n", serde_json::to_string(shown).unwrap_or_default()))
            }
            _ => {
                let end = if self.args.once { "\n" } else { "\n\n" };
                print(&format!("{}{end}", self.lines((printed_columns(), ALL_ROWS)).join("\n")))
            }
        };
        heard && !self.args.once
    }

    fn lines(&self, (columns, rows): (usize, usize)) -> Vec<String> {
        let mut all = match &self.shown {
            Some(shown) => lines(shown, columns, rows, self.style),
            None => vec![cut(&format!("looking at {} ...", self.look.robot.robot), columns)],
        };
        if let Some(note) = &self.note {
            // In place of the last line, if all are taken.
            all.truncate(rows.saturating_sub(1));
            all.push(cut(&plain(note), columns));
        }
        all
    }
}

/// Columns of a frame that is printed and stays.
fn printed_columns() -> usize {
    let known = io::stdout().is_terminal().then(crossterm::terminal::size).and_then(Result::ok);
    known.map_or(WIDE, |(columns, _)| usize::from(columns).max(COLUMNS_MIN))
}
