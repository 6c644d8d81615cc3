//! One unit a process, started by hand as systemd would: workers join, die, join again, and end with launch.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use support::units::{exec_start, settings, units};
use support::{Lab, PATIENCE, Running, number, pid_of, text, wait_until};

/// The processes of a split robot, by name of the unit.
struct Split<'l> {
    lab: &'l Lab,
    robot: String,
    units: BTreeMap<String, String>,
    running: BTreeMap<String, Running>,
}

impl<'l> Split<'l> {
    /// Starts everything, in the order of the units: launch comes after its workers.
    fn up(lab: &'l Lab, more: &[&str]) -> Self {
        let robot = lab.robot();
        let mut units = units(lab, &[&["epuck", "--robot", &robot, "--split"], more].concat());
        units.retain(|name, _| name.ends_with(".service"));
        let mut split = Self { lab, robot, units, running: BTreeMap::new() };
        let launch = split.unit("launch");
        let after = settings(&split.units[&launch])["After"].clone();
        let workers: Vec<String> = split.units.keys().filter(|name| **name != launch).cloned().collect();
        for name in &workers {
            assert!(after.split(' ').any(|unit| unit == name), "launch comes after {name}: {after}");
            split.start(name);
        }
        split.start(&launch);
        split.await_mode("disarmed");
        split
    }

    fn unit(&self, process: &str) -> String {
        format!("hilare-{}-{process}.service", self.robot)
    }

    /// Starts a unit's process.
    fn start(&mut self, unit: &str) {
        let process = Running::start(exec_start(self.lab, &self.units[unit]));
        self.running.insert(unit.to_owned(), process);
    }

    fn take(&mut self, process: &str) -> Running {
        self.running.remove(&self.unit(process)).expect("it was started")
    }

    #[track_caller]
    fn await_mode(&self, mode: &str) -> Value {
        self.lab.await_status(&self.robot, mode, |status| status["mode"] == mode)
    }

    fn tell(&self, args: &[&str]) {
        self.lab.hilare(&[args, &["--robot", &self.robot]].concat()).expect_code(0);
    }

    /// All end in good order: nothing here is to be started again.
    fn down(mut self) {
        self.tell(&["down"]);
        for (name, process) in std::mem::take(&mut self.running) {
            let ended = process.wait(PATIENCE);
            assert_eq!(ended.code, Some(0), "{name}: {ended:#?}");
        }
        self.lab.assert_nothing_left("down");
    }
}

fn state<'s>(status: &'s Value, process: &str) -> &'s str {
    let processes = status["processes"].as_array().expect("processes");
    text(processes.iter().find(|one| one["name"] == process).expect("it is listed"), "state")
}

#[test]
fn a_worker_that_was_killed_joins_again_and_the_drive_goes_on() {
    let lab = Lab::new();
    let path = lab.straight(2.0);
    let mut split = Split::up(&lab, &[]);
    let status = split.await_mode("disarmed");
    for (unit, process) in &split.running {
        let name = unit.rsplit_once('-').and_then(|(_, name)| name.strip_suffix(".service")).expect("a name");
        if name != "launch" {
            assert_eq!(pid_of(&status, name), process.pid(), "{name} is the process that systemd started");
        }
    }
    split.tell(&["follow", &path.to_string_lossy()]);
    split.tell(&["arm"]);
    let drives = |status: &Value| number(status, "speed_mps") > 0.02;
    lab.await_status(&split.robot, "it drives", drives);

    let controller = split.take("controller");
    controller.signal(Signal::KILL);
    assert_eq!(controller.wait(PATIENCE).signal, Some(9));
    let stopped = lab.await_status(&split.robot, "it stops for want of commands", |status| {
        number(status, "speed_mps") == 0.0
    });
    assert_eq!(state(&stopped, "controller"), "awaited", "{stopped}");
    let unit = split.unit("controller");
    split.start(&unit);
    let on = lab.await_status(&split.robot, "it goes on", drives);
    assert_eq!(pid_of(&on, "controller"), split.running[&unit].pid());
    assert_eq!((&on["waypoint"], text(&on, "path_state")), (&stopped["waypoint"], "tracking"));
    split.down();
}

/// Process ids of the controllers: the one in charge, then the others.
fn controllers(status: &Value) -> Vec<i64> {
    let processes = status["processes"].as_array().expect("processes").iter();
    let mut all: Vec<&Value> =
        processes.filter(|one| one["name"] == "controller" && one["pid"] != 0).collect();
    all.sort_by_key(|one| one["authority"] != true);
    all.iter().map(|one| one["pid"].as_i64().expect("a pid")).collect()
}

#[test]
fn a_standby_of_its_own_unit_takes_over_and_the_other_one_stands_by() {
    let lab = Lab::new();
    let path = lab.straight(2.0);
    let mut split = Split::up(&lab, &["--set", "controller.standby=kanayama"]);
    let pid = |split: &Split<'_>, name: &str| i64::from(split.running[&split.unit(name)].pid());
    split.tell(&["follow", &path.to_string_lossy()]);
    split.tell(&["arm"]);
    let status = lab.await_status(&split.robot, "it drives", |status| number(status, "speed_mps") > 0.02);
    // Whoever asked first drives.
    let pair = ["controller", "controller-2"];
    let first = *pair.iter().find(|name| pid(&split, name) == controllers(&status)[0]).expect("one drives");
    let second = pair[usize::from(first == pair[0])];

    let killed = split.take(first);
    killed.signal(Signal::KILL);
    killed.wait(PATIENCE);
    let alone = [pid(&split, second)];
    let status =
        lab.await_status(&split.robot, "the other one drives", |status| controllers(status) == alone);
    assert!(number(&status, "speed_mps") > 0.02, "without a gap: {status}");
    let unit = split.unit(first);
    split.start(&unit);
    let both = [pid(&split, second), pid(&split, first)];
    lab.await_status(&split.robot, "a pair again", |status| controllers(status) == both);
    split.down();
}

#[test]
fn what_is_swapped_in_is_launchs_own() {
    let lab = Lab::new();
    let mut split = Split::up(&lab, &[]);
    split.tell(&["arm"]);
    for (swap, process) in [
        (&["swap", "controller", "pure-pursuit"][..], "controller"),
        (&["swap", "planner", "--set", "planner.seed=7"], "planner"),
    ] {
        split.tell(swap);
        // The old one ends in good order: systemd leaves it at that.
        split.take(process).wait(PATIENCE).expect_code(0);
        let unit = split.unit(process);
        let late = Running::start(exec_start(&lab, &split.units[&unit])).wait(PATIENCE).expect_code(2);
        assert!(late.stderr.contains("launch starts its"), "{late:#?}");
        let pid = pid_of(&lab.status(&split.robot).expect("it is up"), process);
        support::process::signal(pid, Signal::KILL);
        lab.await_status(&split.robot, "launch starts it again", |status| {
            let processes = status["processes"].as_array().expect("processes");
            let one = processes.iter().find(|one| one["name"] == process).expect("it is listed");
            one["pid"] != pid && one["pid"] != 0
        });
    }
    split.down();
}

#[test]
fn workers_end_with_a_launch_that_is_killed_and_join_the_next_one() {
    let lab = Lab::new();
    let mut split = Split::up(&lab, &[]);
    split.tell(&["arm"]);
    let launch = split.take("launch");
    launch.signal(Signal::KILL);
    launch.wait(PATIENCE);
    for (name, process) in std::mem::take(&mut split.running) {
        let ended = process.wait(PATIENCE);
        // An error: systemd starts them again.
        assert_eq!(ended.code, Some(1), "{name}: {ended:#?}");
        assert!(ended.stderr.contains("launch is gone"), "{name}: {ended:#?}");
    }
    drop(split);
    Split::up(&lab, &[]).down();
}

#[test]
fn only_who_is_awaited_may_join() {
    let lab = Lab::new();
    let own = lab.robot_named("own");
    lab.hilare(&["up", "--detach", "--robot", &own]).expect_code(0);
    let ended = lab.hilare(&["service", "controller", "--join", &own]).expect_code(2);
    assert!(ended.stderr.contains("launch starts its controller itself"), "{ended:#?}");
    lab.hilare(&["down", "--robot", &own]).expect_code(0);

    let split = Split::up(&lab, &[]);
    for (role, later, word) in
        [("controller", true, "no place"), ("bogus", false, "no service"), ("launch", false, "no service")]
    {
        let answer = ask(&lab, &split.robot, &format!("{{\"join\":\"{role}\"}}\n"));
        assert!(answer["ok"] == false && answer["place"].is_null(), "{role}: {answer}");
        assert_eq!(answer["later"] == true, later, "{role}: {answer}");
        assert!(text(&answer, "message").contains(word), "{role}: {answer}");
    }
    for args in [&["service", "controller"][..], &["service", "bogus", "--join", "x"]] {
        assert_eq!(lab.hilare(args).expect_code(2).complaints().len(), 1);
    }
    split.down();
}

/// One line to a robot's control socket, and the answer.
fn ask(lab: &Lab, robot: &str, line: &str) -> Value {
    let mut stream =
        UnixStream::connect(lab.runtime_dir().join(robot).join("control.sock")).expect("its socket");
    stream.write_all(line.as_bytes()).expect("a request");
    let mut answer = String::new();
    BufReader::new(stream).read_line(&mut answer).expect("an answer");
    serde_json::from_str(&answer).expect("JSON")
}

#[test]
fn a_launch_whose_workers_do_not_come_says_who_is_missing() {
    let lab = Lab::new();
    let mut launch = lab.start(&["up", "--robot", &lab.robot(), "--workers", "joined"]);
    lab.await_status(&lab.robot(), "it waits", |status| state(status, "plant") == "awaited");
    assert!(launch.lives());
    let ended = launch.wait(PATIENCE).expect_code(1);
    assert!(ended.stderr.contains("did not join within 10s"), "{ended:#?}");
    lab.assert_nothing_left("a start in vain");
    wait_until("nobody is left", || lab.processes().is_empty());
}
