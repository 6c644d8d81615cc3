//! Controllers and parameters swapped while the robot drives.

mod support;

use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::hint::black_box;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use support::{Lab, Running, number, quick, text, whole_machine};

/// Swaps in one drive; `HILARE_SWAPS=1000` for a thousand.
fn swaps_wanted() -> usize {
    std::env::var("HILARE_SWAPS").ok().and_then(|number| number.parse().ok()).unwrap_or(200)
}

/// Acceleration limits of the drive, m/s² and rad/s².
const ACCEL_MPS2: f64 = 0.5;
const ACCEL_RADPS2: f64 = 10.0;

/// The e-puck's rectangle, so often that the drive outlasts the swaps.
fn laps(lab: &Lab, laps: usize) -> PathBuf {
    let mut csv = "x,y\n0.2,0.2\n".to_owned();
    for _ in 0..laps {
        csv.push_str("0.57,0.2\n0.57,0.48\n0.2,0.48\n0.2,0.2\n");
    }
    lab.file("laps.csv", csv)
}

/// What a robot's processes hold: descriptors and memory (MB) of launch and step generator, files in
/// shared memory.
#[derive(Clone, Copy, Debug)]
struct Held {
    descriptors: usize,
    resident_mb: f64,
    shm_files: usize,
}

fn held(lab: &Lab, robot: &str) -> Held {
    let status = lab.status(robot).expect("it is up");
    let launch = i32::try_from(status["launch_pid"].as_i64().expect("a pid")).expect("a pid");
    let pids =
        [launch, support::pid_of(&status, "step_generator"), support::pid_of(&status, "pose_estimator")];
    let descriptors = |pid: i32| fs::read_dir(format!("/proc/{pid}/fd")).map_or(0, Iterator::count);
    let resident_mb = |pid: i32| -> f64 {
        let text = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
        let kb = text.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or("0 kB");
        kb.trim().trim_end_matches("kB").trim().parse::<f64>().unwrap_or(0.0) / 1024.0
    };
    Held {
        descriptors: pids.into_iter().map(descriptors).sum(),
        resident_mb: pids.into_iter().map(resident_mb).sum(),
        shm_files: lab.shm_files().len(),
    }
}

/// Works on every core until told to stop.
fn load(stop: &AtomicBool) {
    let mut words = vec![1u64; 1 << 20];
    while !stop.load(Ordering::Relaxed) {
        words.iter_mut().for_each(|word| *word = word.rotate_left(7) ^ 5);
        black_box(&mut words);
    }
}

/// Greatest change of speed and yaw rate a tick between two rows of a trace.
fn steepest(trace: &Path) -> (f64, f64) {
    let text = fs::read_to_string(trace).expect("trace.csv");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let column = |name: &str| header.iter().position(|found| *found == name).expect("a column");
    let wanted = [column("tick"), column("speed_mps"), column("omega_radps")];
    let rows: Vec<[f64; 3]> = lines
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
            wanted.map(|column| numbers[column])
        })
        .collect();
    assert!(rows.len() > 1000, "{} rows", rows.len());
    rows.windows(2).fold((0.0, 0.0), |(speed, turn), pair| {
        let ticks = pair[1][0] - pair[0][0];
        let change = |n: usize| (pair[1][n] - pair[0][n]).abs() / ticks;
        (f64::max(speed, change(1)), f64::max(turn, change(2)))
    })
}

#[test]
fn hundreds_of_swaps_in_one_drive_beside_a_load() {
    if quick("hundreds_of_swaps_in_one_drive_beside_a_load") {
        return;
    }
    let _machine = whole_machine();
    let lab = Lab::new();
    let wanted = swaps_wanted();
    let robot = lab.robot();
    let path = laps(&lab, 200);
    let mut command =
        lab.command(&["run", "rectangle", "--path", &path.to_string_lossy(), "--robot", &robot]);
    command.args(["--start", "0.2,0.2,0", "--out", "report", "--set", "timing.pause_stop_ticks=0"]);
    for limit in ["accel", "stop_decel"] {
        command.args(["--set", &format!("limits.{limit}_mps2={ACCEL_MPS2}")]);
        command.args(["--set", &format!("limits.{limit}_radps2={ACCEL_RADPS2}")]);
    }
    let run = Running::start(command);
    lab.await_status(&robot, "it drives", |status| number(status, "tick") > 300.0);
    let stop = AtomicBool::new(false);
    let (mut done, mut refused, mut early) = (0, String::new(), None);
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| load(&stop));
        }
        let _stop = StopOnDrop(&stop);
        let deadline = Instant::now() + Duration::from_secs(900);
        while done < wanted && Instant::now() < deadline {
            let law = ["qp", "kanayama"][done % 2];
            let ended = lab.hilare(&["swap", "controller", law, "--robot", &robot]);
            match ended.code {
                Some(0) => done += 1,
                _ => drop(writeln!(refused, "{}", ended.stderr)),
            }
            // Pools and tables of the processes have their size after some.
            if done == wanted / 10 && early.is_none() {
                early = Some(held(&lab, &robot));
            }
        }
    });
    let (early, late) = (early.expect("a tenth of the swaps"), held(&lab, &robot));
    let status = lab.status(&robot).expect("it is up");
    run.signal(rustix::process::Signal::INT);
    let ended = run.wait(Duration::from_secs(60)).expect_code(1);
    let summary = lab.summary(&lab.dir().join("report"));
    println!("{done} swaps, refused:\n{refused}\n{early:?}\n{late:?}\n{summary:#}");

    assert_eq!(done, wanted, "refused: {refused}");
    assert_eq!(number(&summary, "swaps") as usize, wanted);
    assert_eq!(number(&summary, "restarts"), 0.0);
    // A late newcomer is refused, not taken: the drive has a command in every cycle.
    assert_eq!(number(&summary, "cycles_without_command"), 0.0, "{summary}");
    assert!(!ended.stderr.contains("ticks were lost"), "every tick was executed and seen: {}", ended.stderr);
    let (speed, turn) = steepest(&lab.dir().join("report/trace.csv"));
    assert!(speed <= ACCEL_MPS2 * 1e-3 * (1.0 + 1e-9), "{speed} m/s a tick");
    assert!(turn <= ACCEL_RADPS2 * 1e-3 * (1.0 + 1e-9), "{turn} rad/s a tick");
    // Nothing grows with the number of swaps; a controller may be leaving at one of the two looks.
    assert!(late.descriptors <= early.descriptors + 4, "{early:?} {late:?}");
    assert!(late.shm_files <= early.shm_files + 16, "{early:?} {late:?}");
    assert!(late.resident_mb < early.resident_mb + 8.0, "{early:?} {late:?}");
    assert_eq!(controllers(&status), 1, "{status}");
    lab.assert_nothing_left("all the swaps");
}

fn controllers(status: &Value) -> usize {
    let processes = status["processes"].as_array().expect("processes").iter();
    processes.filter(|process| process["name"] == "controller" && process["state"] != "leaving").count()
}

struct StopOnDrop<'s>(&'s AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A robot that drives straight on, under the law it was brought up with.
struct Driving<'l> {
    lab: &'l Lab,
    robot: String,
}

impl<'l> Driving<'l> {
    fn up(lab: &'l Lab, more: &[&str]) -> Self {
        let driving = Self { lab, robot: lab.robot() };
        lab.hilare(&[&["up", "--detach", "--robot", &driving.robot], more].concat()).expect_code(0);
        let path = lab.straight(5.0);
        driving.tell(&["follow", &path.to_string_lossy()]);
        driving.tell(&["arm"]);
        driving.await_status("it drives", |status| number(status, "tick") > 200.0);
        driving
    }

    fn tell(&self, args: &[&str]) -> String {
        self.lab.hilare(&[args, &["--robot", &self.robot]].concat()).expect_code(0).stdout
    }

    /// A swap. On a busy machine a newcomer may be refused for being late: it may try again.
    fn swap(&self, args: &[&str]) -> String {
        for _ in 0..5 {
            let ended = self.lab.hilare(&[&["swap"], args, &["--robot", &self.robot]].concat());
            if !ended.stderr.contains("in a row in time") {
                return ended.expect_code(0).stdout;
            }
        }
        panic!("late five times in a row");
    }

    /// A request that is refused: the one line it says.
    fn refused(&self, code: i32, args: &[&str]) -> String {
        let ended = self.lab.hilare(&[args, &["--robot", &self.robot]].concat()).expect_code(code);
        assert_eq!(ended.complaints().len(), 1, "one line: {ended:#?}");
        ended.stderr
    }

    fn status(&self) -> Value {
        self.lab.status(&self.robot).expect("it is up")
    }

    fn await_status(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        self.lab.await_status(&self.robot, what, wanted)
    }

    fn law(&self) -> String {
        let status = self.status();
        let processes = status["processes"].as_array().expect("processes");
        let in_charge = processes.iter().find(|process| process["authority"] == true).expect("one in charge");
        text(in_charge, "law").to_owned()
    }

    fn down(self) {
        self.tell(&["down"]);
        self.lab.assert_nothing_left("a robot that was swapped");
    }
}

/// A controller that is a shell script.
fn script(lab: &Lab, name: &str, text: &str) -> String {
    let file = lab.file(name, format!("#!/bin/sh\n{text}\n"));
    fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).expect("chmod");
    file.to_string_lossy().into_owned()
}

#[test]
fn every_law_can_take_over_and_what_cannot_is_refused_with_the_reason() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = Driving::up(&lab, &[]);
    for law in ["navigation-circle", "pure-pursuit", "stanley", "qp", "kanayama", "kanayama"] {
        let answer = robot.swap(&["controller", law]);
        assert!(answer.contains(law) && answer.contains("is in charge"), "{answer}");
        assert_eq!(robot.law(), law);
    }
    let before = robot.status();
    let says_why = script(&lab, "says-why.sh", "echo no licence >&2\nexit 3");
    let wrong = [
        (2, &["finite-step"][..], &["finite-step", "mecanum", "differential"][..]),
        (2, &["kanayma"], &["kanayma", "did you mean", "kanayama"]),
        (2, &["./nothing"], &["nothing", "No such file"]),
        (1, &["/bin/false"], &["/bin/false", "ended with code 1", "kanayama", "stays in charge"]),
        (1, &[&says_why], &["ended with code 3: no licence", "stays in charge"]),
        (
            2,
            &["/bin/cat", "--set", "supervision.trial_timeout_s=0.5"],
            &["supervision.trial_timeout_s", "not a key of"],
        ),
        (2, &["qp", "--set", "controller.qp.horizon=-1"], &["controller.qp.horizon", "-1"]),
        (2, &["pp.py"], &["pp.py", "./pp.py"]),
        (2, &[], &["which law"]),
    ];
    for (code, args, hints) in wrong {
        let said = robot.refused(code, &[&["swap", "controller"], args].concat());
        assert!(hints.iter().all(|hint| said.contains(hint)), "{args:?}: {said}");
        assert_eq!(robot.law(), "kanayama");
    }
    let hangs = script(&lab, "hangs.sh", "exec sleep 1000");
    let said = robot.refused(1, &["swap", "controller", &hangs]);
    assert!(said.contains("did not answer") && said.contains("stays in charge"), "{said}");
    let said = robot.refused(2, &["swap", "plant"]);
    assert!(said.contains("controller, planner and waypoint_selector"), "{said}");

    let after = robot.await_status("the refused are gone", |status| controllers(status) == 1);
    for key in ["cycles_without_command", "commands_rejected"] {
        assert_eq!(number(&before, key), number(&after, key), "{key}: the drive did not notice");
    }
    robot.down();
}

#[test]
fn a_warm_standby_is_swapped_in_at_once_and_the_other_one_stands_by() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = Driving::up(&lab, &["--standby", "qp"]);
    let warm = |status: &Value| {
        status["processes"].as_array().is_some_and(|all| all.iter().any(|one| one["state"] == "standby"))
    };
    for law in ["qp", "kanayama", "qp"] {
        let before = robot.await_status("a warm standby", warm);
        let answer = robot.swap(&["controller", law]);
        assert!(answer.contains("the other one stands by"), "{answer}");
        let after = robot.status();
        assert_eq!(robot.law(), law);
        let pids = |status: &Value| -> Vec<i64> {
            let all = status["processes"].as_array().expect("processes").iter();
            all.map(|one| one["pid"].as_i64().expect("a pid")).collect()
        };
        assert_eq!(pids(&before), pids(&after), "nobody was started or ended");
        assert_eq!(number(&after, "cycles_without_command"), 0.0);
    }
    robot.down();
}

#[test]
fn parameters_of_planner_and_selector_change_under_way() {
    let lab = Lab::new();
    // A law that keeps the reference speed; Kanayama's hurries towards a waypoint far away.
    let robot = Driving::up(&lab, &["--controller", "pure-pursuit"]);
    let x_m = |status: &Value| status["pose"][0].as_f64().unwrap_or(0.0);
    let before = robot.await_status("it is under way", |status| x_m(status) > 0.02);
    robot.swap(&["waypoint_selector", "--set", "tracking.speed_mps=0.02"]);
    let after =
        robot.await_status("it drives slower", |status| (number(status, "speed_mps") - 0.02).abs() < 2e-3);
    assert!(x_m(&after) > x_m(&before), "it went on, it did not begin anew");
    assert_eq!(after["path_state"], "tracking");
    robot.swap(&["planner", "--set", "planner.samples=64"]);
    robot.swap(&["controller", "--set", "controller.pure-pursuit.lookahead_s=0.5"]);
    assert_eq!(robot.law(), "pure-pursuit");
    let said = robot.refused(2, &["swap", "waypoint_selector", "--set", "tracking.acceptance_radius_m=0.1"]);
    assert!(said.contains("not a key of waypoint_selector alone") && said.contains("hilare down"), "{said}");
    let after = robot.await_status("it drives on", |status| x_m(status) > 0.06);
    assert!((number(&after, "speed_mps") - 0.02).abs() < 2e-3, "{after}");
    robot.down();
}

/// A box that dies as soon as it is born is waited with; swapped meanwhile, it is one process, not two.
#[test]
fn a_box_that_is_about_to_be_started_again_is_started_once() {
    let lab = Lab::new();
    let robot = Driving::up(&lab, &["--set", "supervision.restart_budget=1000"]);
    let planners = || -> Vec<i32> {
        let all = lab.processes().into_iter();
        all.filter(|(_, line)| line.contains("service planner")).map(|(pid, _)| pid).collect()
    };
    for _ in 0..5 {
        // Until it is young no more, each death is followed by a longer wait.
        for _ in 0..5 {
            support::wait_until("a planner", || !planners().is_empty());
            let killed = planners();
            killed.iter().for_each(|pid| support::process::signal(*pid, rustix::process::Signal::KILL));
            support::wait_until("it is gone", || planners().iter().all(|pid| !killed.contains(pid)));
        }
        robot.swap(&["planner"]);
        // Whoever else was to be started would be there by now.
        thread::sleep(Duration::from_millis(400));
        assert_eq!(planners().len(), 1, "{}", robot.status());
    }
    robot.down();
}
