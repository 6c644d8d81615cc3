//! `hilare record`: every wire of a robot that is up, into files.

use super::operate::{RobotArgs, choose, send, system_in_force};
use super::{VerbResult, print, refused};
use crate::logging;
use crate::manager::Failure;
use crate::manager::control::Request;
use crate::manager::robot_dir::{Living, living_robots};
use crate::recording::wires::taps;
use crate::recording::{RECORDING_FILE, Report, RunInfo, Settings, Standings, Tape};
use crate::shell::observer::survive_the_file_size_limit;
use crate::shell::realtime;
use crate::shell::transport::Domain;
use clap::Args;
use serde_json::json;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Time between two looks at the wires.
const LOOK: Duration = Duration::from_millis(10);
/// Time between two looks whether the robot is still up.
const LIFE: Duration = Duration::from_millis(500);
/// Time for which the wires are heard before the boxes are asked where they stand.
const HEARD_BEFORE: Duration = Duration::from_millis(300);
/// Time between two looks at their answers.
const ASK_AGAIN: Duration = Duration::from_millis(50);
/// Time a box has for its answer: a planner in the middle of a search sees no question.
const ANSWER_PATIENCE: Duration = Duration::from_secs(5);
/// Time the disk has for what waits for it at the end.
const DISK_PATIENCE: Duration = Duration::from_secs(30);
/// Longest recording that can be asked for, s.
const LONGEST_S: f64 = 1e7;
/// Where recordings go that were given no place.
const RUNS: &str = "runs";

/// Options of `hilare record`.
#[derive(Args)]
pub struct RecordArgs {
    /// File, or directory to write run.mcap into [default: runs/ROBOT-recorded-N]
    #[arg(long, value_name = "FILE.mcap|DIR")]
    out: Option<PathBuf>,
    /// End after so long; otherwise with Ctrl-C, or with the robot
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seconds: Option<f64>,
    #[command(flatten)]
    robot: RobotArgs,
}

/// Records until told to end, and says what it came to.
pub fn record(args: &RecordArgs) -> VerbResult {
    if let Some(seconds) = args.seconds
        && !(seconds > 0.0 && seconds <= LONGEST_S)
    {
        return Err(refused(format!("--seconds {seconds}: above 0 and at most {LONGEST_S} are wanted")));
    }
    let robot = choose(args.robot.robot.as_ref())?;
    logging::init_worker("record");
    let told_to_end = Arc::new(AtomicBool::new(false));
    for signal in [libc::SIGINT, libc::SIGTERM] {
        // So that the file gets its end, and the node is taken down in good order.
        signal_hook::flag::register(signal, Arc::clone(&told_to_end))
            .map_err(|e| Failure::Fault(e.to_string()))?;
    }
    survive_the_file_size_limit().map_err(Failure::Fault)?;
    realtime::leave_the_control_path();
    let dir = robot.socket.parent().unwrap_or(robot.socket.as_path());
    let system = system_in_force(&robot)?;
    let clock = send(&robot, &Request::Status)?.status.map_or_else(String::new, |status| status.clock);
    let domain = Domain::join(dir, "record").map_err(refused)?;
    let taps = taps(&domain).map_err(refused)?;
    let path = place(args.out.as_deref(), &robot.robot)?;
    let info = RunInfo::new(&system, "", &clock);
    let settings = Settings::of(&system, path.clone(), false);
    let mut tape = Tape::begin(settings, info, system.to_toml()).map_err(refused)?;
    tape.keep_systems_of(dir);
    let until = args.seconds.map_or("Ctrl-C ends it".to_owned(), |seconds| format!("for {seconds} s"));
    let _ = writeln!(io::stderr(), "hilare: recording {:?} into {}; {until}", robot.robot, path.display());

    let (began, mut asked, mut went_down) = (Instant::now(), Instant::now(), false);
    let mut standings = Asking::begin();
    let enough = || args.seconds.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds);
    while !told_to_end.load(Ordering::Relaxed) && !enough() && !went_down && !tape.has_failed() {
        if asked.elapsed() > LIFE {
            asked = Instant::now();
            went_down = !living_robots().contains(&robot);
        }
        for tap in &taps {
            while tap.hear(&mut |heard| tape.hear(heard)) {}
        }
        if let Some(told) = standings.look(&robot) {
            let _ = writeln!(io::stderr(), "hilare: {}", in_words(&told));
            tape.keep_standings(&told.0);
        }
        tape.hand_over();
        sleep(LOOK);
    }
    if standings.next.is_some() {
        let why = "it ended before the boxes had said where they stand: a replay of it compares those that began later only";
        let _ = writeln!(io::stderr(), "hilare: {why}");
    }
    let report = tape.finish(Some(DISK_PATIENCE));
    tell(&path, &report, args.robot.json);
    if !report.complete {
        return Err(Failure::Fault(format!("the recording is not complete: {}", report.why)));
    }
    if went_down && args.seconds.is_some() {
        return Err(Failure::Fault(format!("robot {:?} went down", robot.robot)));
    }
    Ok(ExitCode::SUCCESS)
}

/// Asks where each box stands, so that a replay can go on from there.
///
/// Not before the wires have been heard for a while: of what a box took and said after its answer, nothing must be older
/// than the recording. What the relay still holds, and what launch said last, has come by then.
struct Asking {
    next: Option<Instant>,
    /// Number of the question, and when it was asked.
    asked: Option<(u64, Instant)>,
}

/// What was answered, and who has not answered.
type Told = (Standings, Vec<String>);

impl Asking {
    fn begin() -> Self {
        Self { next: Some(Instant::now() + HEARD_BEFORE), asked: None }
    }

    /// All answers, once they are there.
    fn look(&mut self, robot: &Living) -> Option<Told> {
        let now = Instant::now();
        self.next.filter(|next| now >= *next)?;
        self.next = Some(now + ASK_AGAIN);
        let number = self.asked.map_or(0, |(number, _)| number);
        let told = send(robot, &Request::Standings(number)).ok()?.standings?;
        let (_, since) = *self.asked.get_or_insert((told.asked, now));
        if !told.silent.is_empty() && since.elapsed() < ANSWER_PATIENCE {
            return None;
        }
        self.next = None;
        Some((Standings::new(told.stands, told.awaited), told.silent))
    }
}

fn in_words((standings, silent): &Told) -> String {
    let from = standings.stands.iter().filter_map(|stand| stand.done).max().filter(|tick| *tick > 0);
    let what = match from {
        Some(tick) => format!("a replay of it compares every box from tick {tick} on"),
        None => "a replay of it compares every box, and can drive again with changes".to_owned(),
    };
    match &silent[..] {
        [] => what,
        silent => format!("{what}, but for {}, which did not say where it stands", silent.join(", ")),
    }
}

/// The file to begin with. What is recorded already is never written over.
fn place(out: Option<&Path>, robot: &str) -> Result<PathBuf, Failure> {
    let file = match out {
        Some(file) if file.extension().is_some_and(|extension| extension == "mcap") => file.to_owned(),
        Some(dir) => dir.join(RECORDING_FILE),
        None => {
            let dirs = (1..).map(|n| Path::new(RUNS).join(format!("{robot}-recorded-{n}")));
            let free = dirs.into_iter().find(|dir| !dir.exists());
            free.unwrap_or_default().join(RECORDING_FILE)
        }
    };
    if file.exists() {
        return Err(refused(format!("{}: is there already; choose another name", file.display())));
    }
    if let Some(dir) = file.parent().filter(|dir| !dir.as_os_str().is_empty()) {
        std::fs::create_dir_all(dir)
            .map_err(|e| refused(format!("{}: {e}; choose a place you can write", dir.display())))?;
    }
    Ok(file)
}

fn tell(path: &Path, report: &Report, as_json: bool) {
    if as_json {
        let mut told = json!(report);
        told["path"] = json!(path);
        print(&format!("{}\n", serde_json::to_string_pretty(&told).unwrap_or_default()));
        return;
    }
    let mut text = format!("{:<12} {:>10} {:>10} {:>10}\n", "wire", "messages", "missing", "given up");
    for wire in &report.wires {
        let given_up = wire.dropped + wire.refused;
        let absent = if wire.absent > 0 {
            format!("  none was sent in {} control periods", wire.absent)
        } else {
            String::new()
        };
        text.push_str(&format!(
            "{:<12} {:>10} {:>10} {given_up:>10}{absent}\n",
            wire.wire, wire.messages, wire.gaps
        ));
    }
    let dir = path.parent().unwrap_or(Path::new(""));
    let files: Vec<String> = report.files.iter().map(|file| dir.join(file).display().to_string()).collect();
    text.push_str(&format!("{}: {:.1} MB\n", files.join(", "), report.bytes as f64 / 1e6));
    print(&text);
}
