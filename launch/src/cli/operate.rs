//! Verbs that speak to a running robot.

use super::{VerbResult, print, refused, warn};
use crate::config::{Driver, System};
use crate::manager::control::{Request, Response, ask};
use crate::manager::robot_dir::{Living, latched_robots, living_robots, log_path, unlatch_estop};
use crate::manager::{Failure, status::Status};
use clap::Args;
use std::fs::File;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Which robot.
#[derive(Args)]
pub struct RobotArgs {
    /// Its name [default: the one robot that is up]
    #[arg(long, value_name = "NAME")]
    pub(super) robot: Option<String>,
    /// Answer in JSON
    #[arg(long)]
    pub(super) json: bool,
}

/// Options of `hilare follow`.
#[derive(Args)]
pub struct FollowArgs {
    /// Waypoints: CSV with the header x,y[,bulge[,crab_rad]], metres
    #[arg(value_name = "FILE.csv")]
    file: PathBuf,
    #[command(flatten)]
    robot: RobotArgs,
}

/// Options of `hilare goal`.
#[derive(Args)]
pub struct GoalArgs {
    /// World x, metres
    #[arg(value_name = "X", allow_negative_numbers = true)]
    x_m: f64,
    /// World y, metres
    #[arg(value_name = "Y", allow_negative_numbers = true)]
    y_m: f64,
    /// Final heading, radians; no planner promises one yet, so it is refused
    #[arg(value_name = "THETA", allow_negative_numbers = true)]
    theta_rad: Option<f64>,
    #[command(flatten)]
    robot: RobotArgs,
}

/// Options of `hilare swap`.
#[derive(Args)]
pub struct SwapArgs {
    /// controller, planner or waypoint_selector
    #[arg(value_name = "BOX")]
    role: String,
    /// Control law, or an executable (a name with a /)
    #[arg(value_name = "LAW")]
    law: Option<String>,
    /// Set a key of that box alone, e.g. controller.qp.horizon=6 (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    #[command(flatten)]
    robot: RobotArgs,
}

pub(super) fn choose(robot: Option<&String>) -> Result<Living, Failure> {
    // A runtime directory of one's own is there to have robots of one's own.
    let here = std::env::var_os("HILARE_RUNTIME_DIR").filter(|_| robot.is_none());
    let mut living = living_robots();
    living.retain(|living| here.as_ref().is_none_or(|here| living.socket.starts_with(here)));
    let names = living.iter().map(|living| living.robot.as_str()).collect::<Vec<_>>().join(", ");
    match (robot, &living[..]) {
        (Some(robot), _) => living.iter().find(|living| living.robot == *robot).cloned().ok_or_else(|| {
            let others = if names.is_empty() { String::new() } else { format!("; up are: {names}") };
            refused(format!(
                "robot {robot:?} is not up{}; hilare up SYSTEM --robot {robot}{others}",
                last_log(robot)
            ))
        }),
        (None, [only]) => Ok(only.clone()),
        (None, []) => Err(refused("no robot is up; hilare up SYSTEM")),
        (None, _) => Err(refused(format!("several robots are up ({names}); say which with --robot NAME"))),
    }
}

/// Where a robot that was up in the background left its reasons.
fn last_log(robot: &str) -> String {
    let log = log_path(robot);
    if log.is_file() { format!(" (its last log: {})", log.display()) } else { String::new() }
}

pub(super) fn send(living: &Living, request: &Request) -> Result<Response, Failure> {
    ask(&living.socket, request)
        .map_err(|error| Failure::Fault(format!("robot {:?} does not answer: {error}", living.robot)))
}

/// The system a robot works with now, changes included.
pub(super) fn system_in_force(robot: &Living) -> Result<System, Failure> {
    let text = send(robot, &Request::System)?.system.ok_or_else(|| {
        Failure::Fault("launch answered without its system; another version of hilare?".to_owned())
    })?;
    System::parse(&robot.robot, &text).map_err(|error| Failure::Fault(error.to_string()))
}

pub(super) fn show(response: &Response, json: bool) -> VerbResult {
    if json {
        print(&format!("{}\n", serde_json::json!({ "ok": response.ok, "message": response.message })));
    } else if response.ok {
        print(&format!("{}\n", response.message));
    }
    match (response.ok, json) {
        (true, _) => Ok(ExitCode::SUCCESS),
        (false, true) => Ok(ExitCode::from(if response.wrong_use { 2 } else { 1 })),
        (false, false) if response.wrong_use => Err(refused(&response.message)),
        (false, false) => Err(Failure::Fault(format!("refused: {}", response.message))),
    }
}

/// A request without parameters.
pub fn order(args: &RobotArgs, request: &Request) -> VerbResult {
    let robot = choose(args.robot.as_ref())?;
    show(&send(&robot, request)?, args.json)
}

/// `hilare reset`: an emergency stop may be on of a robot that is not up.
pub fn reset(args: &RobotArgs) -> VerbResult {
    let failure = match choose(args.robot.as_ref()) {
        Ok(robot) => return show(&send(&robot, &Request::Reset)?, args.json),
        Err(failure) => failure,
    };
    let latched = latched_robots();
    let robot = match (&args.robot, &latched[..]) {
        (Some(robot), _) if latched.contains(robot) => robot,
        (None, [only]) => only,
        _ => return Err(failure),
    };
    unlatch_estop(robot).map_err(refused)?;
    show(&Response::done(format!("emergency stop of {robot} released; it is not up")), args.json)
}

/// `hilare status`.
pub fn status(args: &RobotArgs) -> VerbResult {
    let robot = choose(args.robot.as_ref())?;
    let status: Status = send(&robot, &Request::Status)?.status.ok_or_else(|| {
        Failure::Fault("launch answered without a status; another version of hilare?".to_owned())
    })?;
    if args.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&status).unwrap_or_default()));
    } else {
        print(&status.to_text());
    }
    Ok(if status.fault.is_some() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// `hilare down`: returns when the robot's launch is gone.
pub fn down(args: &RobotArgs) -> VerbResult {
    let robot = choose(args.robot.as_ref())?;
    let response = send(&robot, &Request::Down)?;
    let deadline = Instant::now() + Duration::from_secs(10);
    while living_robots().iter().any(|living| living.robot == robot.robot) {
        if Instant::now() > deadline {
            return Err(Failure::Fault(format!("robot {:?} did not end within 10 s", robot.robot)));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    show(
        &Response::done(if response.ok { format!("{} is down", robot.robot) } else { response.message }),
        args.json,
    )
}

/// `hilare follow`: the file is checked here, so that its own line numbers can be named.
pub fn follow(args: &FollowArgs) -> VerbResult {
    let file = args.file.display();
    let text = File::open(&args.file).map_err(|error| refused(format!("{file}: cannot be read: {error}")))?;
    let waypoints = hilare_planner::waypoint_file::parse(text).map_err(|error| match error.line {
        0 => refused(format!("{file}: {}", error.message)),
        line => refused(format!("{file}:{line}: {}", error.message)),
    })?;
    let points = waypoints.iter().map(|point| [point.x_m, point.y_m, point.bulge, point.crab_rad]).collect();
    order(&args.robot, &Request::Follow(points))
}

/// `hilare swap`.
pub fn swap(args: &SwapArgs) -> VerbResult {
    // A law that there is not is known here: that is wrong use, not a fault of the robot.
    if let Some(law) = args.law.as_deref().filter(|law| Driver::of(law).is_none()) {
        let mut probe = System::default();
        probe.set_all(&Driver::keys(law)).map_err(|error| {
            let error = error.to_string();
            refused(error.split_once(": ").map_or(error.clone(), |(_, what)| what.to_owned()))
        })?;
    }
    // The robot's launch has another working directory, perhaps.
    let driver = match args.law.as_deref() {
        Some(program) if program.contains('/') => {
            let program = std::path::absolute(program).map_err(refused)?;
            Some(program.to_string_lossy().into_owned())
        }
        law => law.map(str::to_owned),
    };
    let set = args.set.iter().map(|assignment| with_map_found(assignment)).collect::<Result<_, _>>()?;
    let request = Request::Swap { role: args.role.clone(), driver, set };
    let robot = choose(args.robot.robot.as_ref())?;
    let response = send(&robot, &request)?;
    if response.ok {
        warn_of(&robot, &args.set);
    }
    show(&response, args.robot.json)
}

/// Says what is unusual of what was set, as it is said of a system file.
pub(super) fn warn_of(robot: &Living, set: &[String]) {
    let Ok(mut system) = system_in_force(robot) else { return };
    if system.set_all(set).is_err() {
        return;
    }
    let said = system.warnings();
    let of_these = set.iter().filter_map(|assignment| {
        said.iter().find_map(|line| line.strip_prefix(&format!("--set {assignment}: ")))
    });
    warn(&of_these.map(str::to_owned).collect::<Vec<_>>());
}

/// An assignment as launch is to read it: a map is looked for, and looked at, here.
pub(super) fn with_map_found(assignment: &str) -> Result<String, Failure> {
    if assignment.split('=').next().map(str::trim) != Some("planner.map") {
        return Ok(assignment.to_owned());
    }
    let mut probe = System::default();
    probe.set_all(&[assignment]).map_err(refused)?;
    probe.load_map().map_err(refused)?;
    Ok(format!("planner.map={}", probe.map))
}

/// `hilare goal`.
pub fn goal(args: &GoalArgs) -> VerbResult {
    let numbers = [args.x_m, args.y_m, args.theta_rad.unwrap_or(0.0)];
    if !numbers.iter().all(|number| number.is_finite()) {
        return Err(refused("goal: finite numbers are wanted, metres and radians"));
    }
    order(&args.robot, &Request::Goal { x_m: args.x_m, y_m: args.y_m, theta_rad: args.theta_rad })
}
