//! Parameters changed while real processes drive.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeMap;
use std::process::Stdio;
use std::time::Duration;
use support::{Lab, PATIENCE, Running, comes_true, number, text, wait_until, whole_machine};

/// The kind of journal entry a change leaves.
const PARAM: f64 = 7.0;
/// The boxes by their numbers in messages.
const BOXES: [&str; 9] = [
    "launch",
    "planner",
    "waypoint_selector",
    "controller",
    "step_generator",
    "pose_estimator",
    "plant",
    "relay",
    "recorder",
];

/// A robot that drives straight on.
struct Robot<'l> {
    lab: &'l Lab,
    name: String,
}

impl<'l> Robot<'l> {
    fn up(lab: &'l Lab, more: &[&str]) -> Self {
        let robot = Self { lab, name: lab.robot() };
        let common = ["--set", "timing.pause_stop_ticks=0"];
        lab.hilare(&[&["up", "--detach", "--robot", &robot.name], &common[..], more].concat()).expect_code(0);
        robot
    }

    fn drive(&self) {
        let path = self.lab.straight(5.0);
        self.tell(&["follow", &path.to_string_lossy()]);
        self.tell(&["arm"]);
        self.lab.await_status(&self.name, "it drives", |status| number(status, "tick") > 200.0);
    }

    fn tell(&self, args: &[&str]) -> String {
        self.lab.hilare(&[args, &["--robot", &self.name]].concat()).expect_code(0).stdout
    }

    fn set(&self, set: &[&str]) -> Value {
        let said = self.tell(&[&["param", "set", "--json"], set].concat());
        serde_json::from_str(&said).expect("JSON")
    }

    /// A request that is refused, in one line.
    fn refused(&self, code: i32, args: &[&str]) -> String {
        let ended = self.lab.hilare(&[args, &["--robot", &self.name]].concat()).expect_code(code);
        assert_eq!((ended.complaints().len(), &*ended.stdout), (1, ""), "one line: {ended:#?}");
        ended.stderr
    }

    fn status(&self) -> Value {
        self.lab.status(&self.name).expect("it is up")
    }

    fn parameters(&self) -> Value {
        serde_json::from_str(&self.tell(&["param", "list", "--json"])).expect("JSON")
    }

    fn moves_on(&self) {
        let at = |status: &Value| status["pose"][0].as_f64().unwrap_or(0.0);
        let before = at(&self.status());
        self.lab.await_status(&self.name, "it drives on", |status| at(status) > before + 0.002);
    }

    fn pid(&self, process: &str) -> i32 {
        support::pid_of(&self.status(), process)
    }

    fn down(self) {
        self.tell(&["down"]);
        self.lab.assert_nothing_left("a robot whose parameters were changed");
    }
}

/// What boxes note of changes: (change, box) → ticks, one a process.
fn noted(journal: &str) -> BTreeMap<(u64, &'static str), Vec<u64>> {
    let mut noted: BTreeMap<(u64, &'static str), Vec<u64>> = BTreeMap::new();
    for line in journal.lines() {
        let entry: Value = serde_json::from_str(line).expect("an object a line");
        if number(&entry, "kind") == PARAM {
            let word = |n: usize| entry["words"][n].as_u64().expect("a word");
            assert!(word(1) > 1, "the number of a system file: {entry}");
            let role = BOXES[number(&entry, "role") as usize];
            let tick = number(&entry, "tick") as u64;
            assert!(tick == word(2) || role == "planner", "late: {entry}");
            noted.entry((word(0), role)).or_default().push(tick);
        }
    }
    noted
}

/// Each of the changes is taken on at one tick by every box that reads it, and noted; the drive does not notice.
fn changes_at_one_tick(more: &[&str], changes: &[(&[&str], &[&str])]) {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = Robot::up(&lab, more);
    let mut echo = lab.command(&["topic", "echo", "journal", "--all", "--json", "--robot", &robot.name]);
    echo.stdout(Stdio::piped());
    let echo = Running::start(echo);
    robot.drive();
    let mut answers = Vec::new();
    for (set, boxes) in changes {
        let answer = robot.set(set);
        let mut taken: Vec<&str> =
            answer["boxes"].as_array().expect("boxes").iter().map(|one| text(one, "name")).collect();
        taken.sort_unstable();
        assert_eq!(taken, *boxes, "{answer}");
        println!("{answer}");
        robot.moves_on();
        answers.push(answer);
    }
    let status = robot.status();
    assert_eq!(number(&status, "param_changes") as usize, changes.len());
    assert!(text(&status, "last_param_change").contains("from tick"), "{status}");
    assert_eq!(number(&status, "cycles_without_command"), 0.0, "{status}");
    assert_eq!(number(&status, "commands_rejected"), 0.0, "{status}");
    robot.tell(&["down"]);
    let noted = noted(&echo.wait(PATIENCE).stdout);
    lab.assert_nothing_left("a robot whose parameters were changed");
    for (n, (answer, (_, boxes))) in answers.iter().zip(changes).enumerate() {
        let tick = number(answer, "tick") as u64;
        assert_eq!(tick % 5, 0, "the beginning of a control period: {answer}");
        for name in *boxes {
            let name = name.split(' ').next().expect("a word");
            let ticks =
                noted.get(&(n as u64 + 1, name)).unwrap_or_else(|| panic!("{name} noted nothing: {noted:?}"));
            let at_it = |noted: &u64| if name == "planner" { *noted >= tick } else { *noted == tick };
            assert!(ticks.iter().all(at_it), "{name}: {ticks:?}, {answer}");
            let processes = boxes.iter().filter(|other| other.starts_with(name)).count();
            assert_eq!(ticks.len(), processes, "{name}: {answer}");
        }
    }
}

const KANAYAMA: &str = "controller (kanayama)";

#[test]
fn every_section_changes_at_one_tick_with_a_standby_beside() {
    changes_at_one_tick(
        &["--standby", "kanayama"],
        &[
            (&["tracking.speed_mps=0.03"], &["waypoint_selector"]),
            (&["limits.v_max_mps=0.035"], &[KANAYAMA, KANAYAMA, "step_generator"]),
            (&["limits.accel_mps2=0.5"], &["step_generator"]),
            (&["controller.kanayama.k1_per_s=1", "controller.predict=false"], &[KANAYAMA, KANAYAMA]),
            (&["plant.slip_mean=0.01"], &["plant"]),
            (&["planner.samples=64", "planner.fit.tolerance_m=0.002"], &["planner"]),
            (&["planner.map=platform"], &["planner"]),
            (
                &["tracking.acceptance_radius_m=0.02", "tracking.speed_mps=0.02"],
                &[KANAYAMA, KANAYAMA, "planner", "waypoint_selector"],
            ),
        ],
    );
}

#[test]
fn a_filter_its_camera_and_a_law_that_plans_change_at_one_tick() {
    changes_at_one_tick(
        &["--controller", "qp", "--set", "estimator.kind=ekf"],
        &[
            (&["estimator.camera_sd_m=0.002", "camera.sd_m=0.002"], &["plant", "pose_estimator"]),
            (&["camera.delay_ticks=100", "estimator.history_ticks=400"], &["plant", "pose_estimator"]),
            (&["controller.qp.horizon=4"], &["controller (qp)"]),
            (&["limits.omega_max_radps=0.5"], &["controller (qp)", "step_generator"]),
        ],
    );
}

#[test]
fn what_cannot_be_is_refused_in_a_line_and_changes_nothing() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let alone = |args: &[&str]| {
        let ended = lab.hilare(args).expect_code(2);
        assert_eq!(ended.complaints().len(), 1, "{ended:#?}");
        ended.stderr
    };
    let said = alone(&["param", "set", "tracking.speed_mps=0.02"]);
    assert!(said.contains("no robot is up"), "{said}");
    assert!(alone(&["param", "list"]).contains("--system"), "what works without a robot");
    assert!(alone(&["param", "get", "tracking.sped_mps", "--system", "epuck"]).contains("speed_mps"));
    let robot = Robot::up(&lab, &[]);
    robot.drive();
    let before = robot.parameters();
    let wrong: [(&[&str], &[&str]); 14] = [
        (&["tracking.speed_mps=99"], &["99 m/s is outside 0 to 10 m/s"]),
        (&["tracking.speed_mps=40mm"], &["\"40mm\" is not a number"]),
        (&["tracking.speed_mps=NaN"], &["finite"]),
        (&["planner.samples=1.5"], &["whole number"]),
        (&["controller.predict=1"], &["true or false"]),
        (&["tracking.sped_mps=0.02"], &["did you mean \"speed_mps\" (m/s)"]),
        (&["trackng.speed_mps=0.02"], &["did you mean [tracking]"]),
        (&["tracking.speed_mps"], &["write KEY=VALUE"]),
        (&["controller.law=qp"], &["hilare swap controller LAW"]),
        (&["chassis.track_m=0.06"], &["not while the robot is up", "hilare down, then up"]),
        (&["plant.seed=7"], &["read when the robot starts"]),
        (&["limits.v_min_mps=0.05"], &["v_min_mps 0.05 is above limits.v_max_mps 0.041"]),
        (&["tracking.speed_mps=0.02", "limits.v_max_mps=-1"], &["limits.v_max_mps", "-1"]),
        (&["tracking.speed_mps=0.02", "tracking.speed_mps=0.03"], &["given twice"]),
    ];
    for (set, hints) in wrong {
        let said = robot.refused(2, &[&["param", "set"], set].concat());
        assert!(hints.iter().all(|hint| said.contains(hint)), "{set:?}: {said}");
        assert_eq!(robot.parameters(), before, "{set:?}");
    }
    let answer = robot.set(&["tracking.speed_mps=0.04"]);
    assert!(text(&answer, "message").contains("nothing to change"), "{answer}");
    // What nobody reads now waits for who will.
    let answer = robot.set(&["controller.qp.horizon=4"]);
    assert!(answer["tick"].is_null() && text(&answer, "message").contains("no box"), "{answer}");
    robot.tell(&["swap", "controller", "qp"]);
    assert_eq!(robot.tell(&["param", "get", "controller.qp.horizon"]), "controller.qp.horizon 4\n");
    robot.moves_on();
    assert_eq!(number(&robot.status(), "commands_rejected"), 0.0);
    // Centimetres where metres are wanted are within the bounds; they are driven with, and said.
    for verb in [&["param", "set"][..], &["swap", "controller", "--set"]] {
        let unusual = if verb[0] == "swap" { "controller.qp.knee_m=0.05" } else { "tracking.speed_mps=4" };
        let ended = lab.hilare(&[verb, &[unusual, "--robot", &robot.name]].concat()).expect_code(0);
        assert!(
            ended.stderr.starts_with("hilare: warning: ") && ended.stderr.contains("unusual"),
            "{ended:#?}"
        );
    }
    robot.down();
}

/// A change that waits for the planner, which is stopped.
struct Pending {
    planner: i32,
    run: Running,
}

impl Pending {
    fn start(robot: &Robot<'_>, assignment: &str) -> Self {
        let planner = robot.pid("planner");
        support::process::signal(planner, Signal::STOP);
        let run = robot.lab.start(&["param", "set", assignment, "--robot", &robot.name]);
        // It is under way when another one is refused for it.
        let busy = || {
            let ended = robot.lab.hilare(&["param", "set", "limits.accel_mps2=0.1", "--robot", &robot.name]);
            assert!(ended.code != Some(0) || ended.stdout.contains("nothing to change"), "{ended:#?}");
            ended.stderr.contains("another change is under way")
        };
        wait_until("a change under way", busy);
        Self { planner, run }
    }

    fn refused(self) -> String {
        let ended = self.run.wait(PATIENCE).expect_code(1);
        assert!(ended.stderr.contains("nothing was changed"), "{ended:#?}");
        ended.stderr
    }
}

#[test]
fn whoever_dies_over_a_change_takes_it_back_and_one_at_a_time_is_made() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let lasting = ["--set", "supervision.hung_after_s=60", "--set", "limits.accel_mps2=0.1"];
    let robot = Robot::up(&lab, &[&["--standby", "kanayama"][..], &lasting].concat());
    robot.drive();
    let before = robot.parameters();
    let change = "tracking.acceptance_radius_m=0.02";

    let pending = Pending::start(&robot, change);
    let said = robot.refused(1, &["swap", "controller", "qp"]);
    assert!(said.contains("parameters are being changed"), "{said}");
    support::process::signal(pending.planner, Signal::KILL);
    assert!(pending.refused().contains("planner was killed"), "it says who");
    assert_eq!(robot.parameters(), before);

    // The controller in charge, between its answer and the decision.
    robot.lab.await_status(&robot.name, "another planner, and a warm standby", |status| {
        let all = status["processes"].as_array().expect("processes");
        all.iter().any(|one| one["state"] == "standby")
            && all.iter().any(|one| one["name"] == "planner" && one["state"] != "starting" && one["pid"] != 0)
    });
    let pending = Pending::start(&robot, change);
    let planner = pending.planner;
    support::process::signal(robot.pid("controller"), Signal::KILL);
    assert!(pending.refused().contains("controller (kanayama) was killed"), "it says who");
    support::process::signal(planner, Signal::CONT);
    assert_eq!(robot.parameters(), before);
    robot.moves_on();

    // Who does not answer in time.
    let pending = Pending::start(&robot, change);
    assert!(pending.refused().contains("planner did not prepare it within 5s"));
    support::process::signal(planner, Signal::CONT);
    // What was taken back leaves nothing that would come into force later.
    wait_until("it is made at last", || {
        let ended = lab.hilare(&["param", "set", change, "--robot", &robot.name]);
        ended.code == Some(0)
    });
    robot.moves_on();
    let status = robot.status();
    assert_eq!(number(&status, "cycles_without_command"), 0.0, "{status}");
    robot.down();
}

#[test]
fn a_launch_killed_over_a_change_leaves_nobody() {
    let lab = Lab::new();
    let robot = Robot::up(&lab, &["--set", "supervision.hung_after_s=60", "--set", "limits.accel_mps2=0.1"]);
    robot.drive();
    let pending = Pending::start(&robot, "tracking.acceptance_radius_m=0.02");
    let launch =
        robot.status()["launch_pid"].as_i64().and_then(|pid| i32::try_from(pid).ok()).expect("a pid");
    support::process::signal(launch, Signal::KILL);
    support::process::signal(pending.planner, Signal::CONT);
    let ended = pending.run.wait(PATIENCE);
    assert_eq!(ended.code, Some(1), "{ended:#?}");
    assert!(comes_true(PATIENCE, || lab.processes().is_empty()), "{:?}", lab.processes());
}

/// Before the robot is armed for the first time no tick passes: then a change is there from the beginning. After that a
/// successor of the clock goes on by what was set.
#[test]
fn a_change_before_the_first_tick_and_one_that_outlives_the_clock() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = Robot::up(&lab, &["--controller", "pure-pursuit"]);
    let answer = robot.set(&["tracking.speed_mps=0.02", "limits.accel_mps2=0.05"]);
    assert_eq!(number(&answer, "tick"), 0.0, "{answer}");
    robot.drive();
    let slow = |status: &Value| (number(status, "speed_mps") - 0.02).abs() < 2e-3;
    lab.await_status(&robot.name, "it drives as it was told before", slow);
    robot.set(&["limits.v_max_mps=0.015"]);
    let slower = |status: &Value| (number(status, "speed_mps") - 0.015).abs() < 1e-9;
    lab.await_status(&robot.name, "its limit holds", slower);
    support::process::signal(robot.pid("step_generator"), Signal::KILL);
    lab.await_status(&robot.name, "disarmed by the death of its clock", |status| {
        status["mode"] == "disarmed"
    });
    wait_until("armed again", || lab.hilare(&["arm", "--robot", &robot.name]).code == Some(0));
    lab.await_status(&robot.name, "the limit outlives the clock", slower);
    // A selector that starts again has the speed that was set, too.
    support::process::signal(robot.pid("waypoint_selector"), Signal::KILL);
    robot.set_when_ready(&["limits.v_max_mps=0.041"]);
    lab.await_status(&robot.name, "the speed outlives the selector", slow);
    robot.down();
}

impl Robot<'_> {
    /// A change that may come while somebody is just being started.
    fn set_when_ready(&self, set: &[&str]) {
        let made = || {
            let ended = self.lab.hilare(&[&["param", "set"], set, &["--robot", &self.name]].concat());
            std::thread::sleep(Duration::from_millis(50));
            ended.code == Some(0)
        };
        wait_until("a change", made);
    }
}
