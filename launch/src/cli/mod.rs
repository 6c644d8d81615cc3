//! The `hilare` command line, one file a group of verbs.
//!
//! Exit codes: 0 done, 1 fault during the run, 2 wrong use or bad input. Errors are one line on
//! standard error; with `--json`, standard output carries JSON and nothing else.

mod compare;
mod compare_runs;
mod demo;
mod diagram;
mod doctor;
mod ending;
mod fit;
pub(crate) mod flags;
mod latency;
mod operate;
mod param;
mod plan;
mod plot;
mod record;
mod replay;
mod reproduce;
pub(crate) mod run;
mod schema;
mod service;
mod systemd;
mod top;
mod topic;
mod tune;
mod up;

use crate::manager::Failure;
use crate::manager::children::name_this_process;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;

const CODES: &str = "Exit codes: 0 done, 1 fault during the run, 2 wrong use or bad input.";

/// A real-time runtime for wheeled mobile robots: every block of the control diagram its own process.
#[derive(Parser)]
#[command(name = "hilare", version, after_help = CODES)]
struct Cli {
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(Subcommand)]
enum Verb {
    /// Run the standard job in real time and print a verdict (what `hilare` alone does)
    #[command(
        after_help = "Example: hilare demo\nExit codes: 0 done, 1 fault during the run, 2 wrong use or bad input."
    )]
    Demo(demo::DemoArgs),
    /// Run a scenario to its end and report
    #[command(after_help = "Examples:\n  hilare run rectangle\n  hilare run so --clock lockstep --json\n  \
        hilare run rectangle --path my.csv --set plant.slip_mean=0.03 --out runs/mine\n\
        Exit codes: 0 arrived, 1 fault or not arrived, 2 wrong use or bad input.")]
    Run(run::RunArgs),
    /// Bring a robot up and keep it up
    #[command(
        after_help = "Examples:\n  hilare up epuck --detach && hilare arm && hilare follow path.csv\n  \
        hilare up my_robot.toml\nExit codes: 0 ended by hilare down or Ctrl-C, 1 fault, 2 wrong use or bad input."
    )]
    Up(up::UpArgs),
    /// Stop the robot and end its processes
    #[command(
        after_help = "Example: hilare down --robot epuck\nExit codes: 0 done, 1 it did not end, 2 no such robot."
    )]
    Down(operate::RobotArgs),
    /// Show the robot and its processes
    #[command(
        after_help = "Example: hilare status --json\nExit codes: 0 shown, 1 the robot has a fault, 2 no such robot."
    )]
    Status(operate::RobotArgs),
    /// Ramp to a stop and stay until armed
    #[command(after_help = "Example: hilare stop\nExit codes: 0 done, 1 refused, 2 no such robot.")]
    Stop(operate::RobotArgs),
    /// Emergency stop: at once, latched until reset
    #[command(after_help = "Example: hilare estop\nExit codes: 0 done, 1 refused, 2 no such robot.")]
    Estop(operate::RobotArgs),
    /// Release the emergency stop; the robot stays disarmed
    #[command(
        after_help = "Example: hilare reset && hilare arm\nExit codes: 0 done, 1 refused, 2 no such robot."
    )]
    Reset(operate::RobotArgs),
    /// Let commands act
    #[command(after_help = "Example: hilare arm\nExit codes: 0 done, 1 refused, 2 no such robot.")]
    Arm(operate::RobotArgs),
    /// Follow the waypoints of a CSV file (header x,y, metres)
    #[command(
        after_help = "Example: hilare follow path.csv\nExit codes: 0 accepted, 1 refused, 2 bad input or no such robot."
    )]
    Follow(operate::FollowArgs),
    /// Drive to a point (metres, world frame), around the obstacles of the system's map
    #[command(
        after_help = "Example: hilare goal 0.6 0.5\nExit codes: 0 accepted, 1 refused, 2 bad input or no such robot."
    )]
    Goal(operate::GoalArgs),
    /// Plan a path on a map, without a robot
    #[command(
        after_help = "Examples:\n  hilare plan --map depot.yaml --start 2,2 --goal 20,10 --radius 0.22 --out path.csv --out plan.svg\n  \
        hilare plan --map platform.json --json\nExit codes: 0 a path was found, 1 there is none (the reason is given), 2 wrong use or bad input."
    )]
    Plan(plan::PlanArgs),
    /// Fit a curve by the fewest lines and arcs
    #[command(
        after_help = "Examples:\n  hilare fit curve.csv --tolerance 0.002 --out path.csv && hilare run --path path.csv\n  \
        hilare fit curve.csv --tolerance 0.005 --tangent --json\nExit codes: 0 fitted, 2 wrong use, bad input or no such fit (the reason is given)."
    )]
    Fit(fit::FitArgs),
    /// Draw the pictures of a run that is over, as SVG or PNG
    #[command(after_help = "Examples:\n  hilare plot runs/rectangle-kanayama-real-1\n  \
        hilare plot runs/mine --out mine.png --width 1000\n  \
        hilare plot runs/mine --what path,heading --format png --out pictures\n\
        Exit codes: 0 drawn, 1 fault, 2 wrong use, not a run, or nowhere to write.")]
    Plot(plot::PlotArgs),
    /// Compare runs that are over, or control laws on the same scenarios
    #[command(
        after_help = "Examples:\n  hilare compare runs/mine runs/yours\n  hilare compare runs/mine other.mcap --format png --out runs/beside\n  \
        hilare compare\n  hilare compare rectangle so --laws kanayama,qp --out runs/laws\n  \
        hilare compare rectangle --laws kanayama,qp --seeds 20 --set estimator.kind=ekf --set plant.slip_mean=0.05\n\
        Exit codes: 0 done (also if runs differ or a law did not arrive), 1 a report could not be written, 2 wrong use or bad input."
    )]
    Compare(compare::CompareArgs),
    /// Search for the parameters of a law: a front of the best compromises
    #[command(
        after_help = "Examples:\n  hilare tune\n  hilare tune rectangle so --held-out trapezoid --set plant.slip_sd=0.1 --seeds 3\n  \
        hilare tune --controller qp --evaluations 100 --parameter horizon=2..10 --out runs/qp\n  \
        hilare tune --resume runs/qp --evaluations 2000\n\
        Exit codes: 0 done, 1 stopped or nothing arrived, 2 wrong use or bad input."
    )]
    Tune(Box<tune::TuneArgs>),
    /// Run a recording again: the same bits? With changes: what if
    #[command(
        after_help = "Examples:\n  hilare replay runs/rectangle-kanayama-real-1\n  hilare replay runs/so-qp-real-2 --box controller --box plant\n  \
        hilare replay runs/so-kanayama-real-1 --set tracking.speed_mps=0.03 --controller qp --out runs/what-if\n\
        Exit codes: 0 what was compared is the same to the last bit (or driven again), 1 something differs or nothing could be compared, 2 wrong use or no recording."
    )]
    Replay(replay::ReplayArgs),
    /// Reproduce the three papers: figures and tables, printed values beside ours
    #[command(
        after_help = "Examples:\n  hilare reproduce\n  hilare reproduce 1 --seeds 100 --out runs/paper1\n  \
        hilare reproduce 3 --json\nExit codes: 0 done (differences are shown), 1 fault, 2 wrong use or bad input."
    )]
    Reproduce(reproduce::ReproduceArgs),
    /// Change the controller, or the parameters of a box, while the robot drives
    #[command(after_help = "Examples: hilare swap controller qp\n  \
        hilare swap controller ./my_controller.py\n  \
        hilare swap waypoint_selector --set tracking.speed_mps=0.03\n\
        Exit codes: 0 done, 1 refused (the old one stays), 2 wrong use.")]
    Swap(operate::SwapArgs),
    /// List, print and change parameters, while the robot drives
    #[command(
        after_help = "Examples:\n  hilare param list tracking\n  hilare param get tracking.speed_mps\n  \
        hilare param set tracking.speed_mps=0.03 limits.v_max_mps=0.05\n\
        Exit codes: 0 done, 1 refused by the robot (nothing was changed), 2 wrong use or no such robot."
    )]
    Param(param::ParamArgs),
    /// Measure how punctual a robot is here, beside a bare timer loop
    #[command(
        after_help = "Examples:\n  hilare latency\n  hilare latency --seconds 600 --load --out runs/latency\nExit codes: 0 measured, 1 fault, 2 wrong use."
    )]
    Latency(latency::LatencyArgs),
    /// List, print and count what the wires carry
    #[command(
        after_help = "Examples:\n  hilare topic list\n  hilare topic echo pose --rate 2\n  hilare topic hz steps --seconds 5\n\
        Exit codes: 0 done, 1 the robot went down before all was there that was asked for, 2 wrong use."
    )]
    Topic(topic::TopicArgs),
    /// Show a robot on the terminal: processes, rates, lateness, tracking
    #[command(
        after_help = "Examples:\n  hilare top\n  hilare top --once\n  hilare top --json --interval 5 >> mule.jsonl\nKeys: q or Ctrl-C ends it.\n\
        Exit codes: 0 ended, 1 the robot went down, 2 wrong use or no such robot."
    )]
    Top(top::TopArgs),
    /// Record every wire of a robot that is up (MCAP: Foxglove, ROS 2 tools, Python)
    #[command(
        after_help = "Examples:\n  hilare record --seconds 10\n  hilare record --robot epuck --out drive.mcap\n\
        Exit codes: 0 all is recorded, 1 something is missing or the robot went down before --seconds were over, 2 wrong use."
    )]
    Record(record::RecordArgs),
    /// Print the block diagram the wires are built from
    #[command(
        after_help = "Examples:\n  hilare diagram --json\n  hilare diagram --header python > hilare_wires.py\nExit codes: 0 done, 2 wrong use."
    )]
    Diagram(diagram::DiagramArgs),
    /// Print the keys of system and scenario files as a JSON Schema for editors
    #[command(
        after_help = "Examples:\n  hilare schema --out system.schema.json\n  hilare schema --scenario --out scenario.schema.json\n  \
        hilare schema --markdown\nThe first line of a system file beside it, for Taplo and VS Code's Even Better TOML:\n  \
        #:schema ./system.schema.json\nExit codes: 0 done, 2 wrong use or a file that cannot be written."
    )]
    Schema(schema::SchemaArgs),
    /// Check what this machine allows, each finding with its cure
    #[command(
        after_help = "Example: hilare doctor\nExit codes: 0 nothing stands in the way, 1 something does, 2 wrong use."
    )]
    Doctor(doctor::DoctorArgs),
    /// Write units that start a robot at boot, watch it and fence it in
    #[command(
        after_help = "Examples:\n  hilare systemd epuck\n  hilare systemd my_robot.toml --run-as robot --out units\n  \
        hilare systemd epuck --split --out units && systemd-analyze verify units/*\nExit codes: 0 done, 2 wrong use or bad input."
    )]
    Systemd(systemd::SystemdArgs),
    /// Print a completion script for a shell
    #[command(
        after_help = "Example: hilare completions bash > ~/.local/share/bash-completion/completions/hilare"
    )]
    Completions {
        /// bash, zsh, fish, elvish or powershell
        shell: clap_complete::Shell,
    },
    /// What latency measures beside the robot; started by it, not by people
    #[command(hide = true)]
    Bare(latency::BareArgs),
    /// A worker process; started by launch, not by people
    #[command(hide = true)]
    Service(service::ServiceArgs),
}

/// Parses the command line, runs the verb, answers with its exit code.
pub fn main() -> ExitCode {
    name_this_process();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    let result = match cli.verb {
        None => demo::demo(&demo::DemoArgs::default()),
        Some(Verb::Demo(args)) => demo::demo(&args),
        Some(Verb::Run(args)) => run::run(&args),
        Some(Verb::Up(args)) => up::up(&args),
        Some(Verb::Down(args)) => operate::down(&args),
        Some(Verb::Status(args)) => operate::status(&args),
        Some(Verb::Stop(args)) => operate::order(&args, &crate::manager::control::Request::Stop),
        Some(Verb::Estop(args)) => operate::order(&args, &crate::manager::control::Request::Estop),
        Some(Verb::Reset(args)) => operate::reset(&args),
        Some(Verb::Arm(args)) => operate::order(&args, &crate::manager::control::Request::Arm),
        Some(Verb::Follow(args)) => operate::follow(&args),
        Some(Verb::Goal(args)) => operate::goal(&args),
        Some(Verb::Swap(args)) => operate::swap(&args),
        Some(Verb::Param(args)) => param::param(&args),
        Some(Verb::Plan(args)) => plan::plan(&args),
        Some(Verb::Fit(args)) => fit::fit(&args),
        Some(Verb::Plot(args)) => plot::plot(&args),
        Some(Verb::Compare(args)) => compare::compare(&args),
        Some(Verb::Tune(args)) => tune::tune(&args),
        Some(Verb::Replay(args)) => replay::replay(&args),
        Some(Verb::Reproduce(args)) => reproduce::reproduce(&args),
        Some(Verb::Latency(args)) => latency::latency(&args),
        Some(Verb::Topic(args)) => topic::topic(&args),
        Some(Verb::Top(args)) => top::top(&args),
        Some(Verb::Record(args)) => record::record(&args),
        Some(Verb::Bare(args)) => latency::bare(&args),
        Some(Verb::Diagram(args)) => diagram::diagram(&args),
        Some(Verb::Schema(args)) => schema::schema(&args),
        Some(Verb::Doctor(args)) => doctor::doctor(&args),
        Some(Verb::Systemd(args)) => systemd::systemd(&args),
        Some(Verb::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "hilare", &mut script);
            print(&String::from_utf8_lossy(&script));
            Ok(ExitCode::SUCCESS)
        }
        Some(Verb::Service(args)) => service::service(&args),
    };
    result.unwrap_or_else(|failure| {
        let (message, code) = match failure {
            Failure::Refused(message) => (message, 2),
            Failure::Fault(message) => (message, 1),
            Failure::Interrupted => ("interrupted while starting".to_owned(), 1),
        };
        let _ = writeln!(io::stderr(), "hilare: {message}");
        ExitCode::from(code)
    })
}

/// Help as it is; a mistake as one line, like every other mistake.
fn usage(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        print(&error.render().to_string());
        return ExitCode::SUCCESS;
    }
    let text = error.render().to_string();
    let paragraph: Vec<&str> = text.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
    let what = paragraph.join(" ");
    let what = what.strip_prefix("error: ").unwrap_or(&what);
    let what = what
        .replace("invalid float literal", "a number is wanted, e.g. 0.5")
        .replace("cannot parse float from empty string", "a number is wanted, e.g. 0.5")
        .replace("invalid digit found in string", "a whole number is wanted, e.g. 5");
    let is_verb = |word: &String| Cli::command().find_subcommand(word).is_some();
    let first = std::env::args().nth(1).unwrap_or_default();
    let later = std::env::args().skip(2).find(is_verb).filter(|_| first.starts_with("--"));
    if let Some(verb) = later.filter(|_| error.kind() == ErrorKind::UnknownArgument) {
        let _ = writeln!(io::stderr(), "hilare: {first} goes behind the verb: hilare {verb} {first} …");
        return ExitCode::from(2);
    }
    let verb = Some(first).filter(is_verb);
    let help = verb.map_or_else(|| "hilare --help".to_owned(), |verb| format!("hilare {verb} --help"));
    let _ = writeln!(io::stderr(), "hilare: {what}; see {help}");
    ExitCode::from(2)
}

/// What a verb comes to.
type VerbResult = Result<ExitCode, Failure>;

/// Prints to standard output. A reader that went away is no fault of ours; a full disk is one, and
/// whoever waits for the output must not take it for complete.
/// False if nobody reads standard output any more.
fn print(text: &str) -> bool {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            let _ = writeln!(io::stderr(), "hilare: standard output: {error}");
            std::process::exit(1);
        }
        wrote => wrote.is_ok(),
    }
}

/// Says on standard error what is allowed and hardly meant.
fn warn(lines: &[String]) {
    for line in lines {
        let _ = writeln!(io::stderr(), "hilare: warning: {line}");
    }
}

fn refused(error: impl std::fmt::Display) -> Failure {
    Failure::Refused(error.to_string())
}
