//! Robots under systemd: the units are good ones, and launch speaks the service manager's protocol.

mod support;

use rustix::process::Signal;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use support::units::{settings, units};
use support::{Lab, PATIENCE, Running, wait_until};

const SYSTEMS: [&str; 3] = ["epuck", "cart", "agv"];
/// What `systemd-analyze security` may find at most, of 10. Measured: 0.8 with systemd 252, all of it what a robot
/// cannot do without (shared memory and sockets of its account, real-time scheduling). The rest is for
/// checks that other versions of systemd weigh differently.
const EXPOSURE_MAX: f64 = 1.0;
/// What launch is told of the watchdog, and so twice the time between its signs of life.
const WATCHDOG: Duration = Duration::from_millis(400);

fn has_analyze(test: &str) -> bool {
    let there = Command::new("systemd-analyze").arg("--version").output().is_ok();
    if !there {
        support::skip(test, "there is no systemd-analyze (Debian: systemd)");
    }
    there
}

/// What `systemd-analyze verify` complains about; empty if nothing.
fn complaints(lab: &Lab, user: bool, files: &[PathBuf]) -> String {
    let mut command = lab.command_of("systemd-analyze");
    // A user's units are looked for below the runtime directory.
    command.env("XDG_RUNTIME_DIR", lab.dir());
    command.args(if user { &["--user"][..] } else { &[] }).args(["verify", "--man=no"]).args(files);
    let ended = Running::start(command).wait(PATIENCE);
    if ended.code == Some(0) { ended.stderr } else { format!("{ended:#?}") }
}

#[test]
fn units_of_every_built_in_system_are_verified() {
    if !has_analyze("units_of_every_built_in_system_are_verified") {
        return;
    }
    let lab = Lab::new();
    for (number, system) in SYSTEMS.into_iter().enumerate() {
        for (kind, more) in [
            ("whole", &[][..]),
            ("user", &["--user"]),
            ("split", &["--split"]),
            ("user split", &["--user", "--split"]),
        ] {
            let out = lab.dir().join(format!("{number}-{kind}"));
            let text = out.to_string_lossy();
            let ended = lab.hilare(&[&["systemd", system, "--out", &text], more].concat()).expect_code(0);
            assert!(
                ended.stdout.contains("daemon-reload") && ended.stdout.contains("enable --now"),
                "{ended:#?}"
            );
            let files: Vec<PathBuf> =
                std::fs::read_dir(&out).expect("units").flatten().map(|e| e.path()).collect();
            assert!(!files.is_empty());
            assert_eq!(complaints(&lab, kind.contains("user"), &files), "", "{system} {kind}");
        }
    }
    let good = units(&lab, &["epuck"])["hilare-epuck.service"].clone();
    for (old, new) in
        [("WatchdogSec", "WatchdogSecs"), ("ExecStart=/", "ExecStart=/nowhere/"), ("=on-failure", "=never")]
    {
        let bad = lab.file("hilare-bad.service", good.replace(old, new));
        assert_ne!(complaints(&lab, false, &[bad]), "", "a fault is found: {new}");
    }
}

#[test]
fn a_robot_is_exposed_no_more_than_it_needs() {
    if !has_analyze("a_robot_is_exposed_no_more_than_it_needs") {
        return;
    }
    let lab = Lab::new();
    for system in SYSTEMS {
        for (name, text) in units(&lab, &[system])
            .iter()
            .chain(&units(&lab, &[system, "--split"]))
            .filter(|(name, _)| name.ends_with(".service"))
        {
            let file = lab.file(name, text);
            let mut command = lab.command_of("systemd-analyze");
            command.args(["security", "--offline=true", "--no-pager"]).arg(file);
            let ended = Running::start(command).wait(PATIENCE);
            let level = ended.stdout.split_once("Overall exposure level for ").and_then(|(_, rest)| {
                rest.split_once(": ")?.1.split_whitespace().next()?.parse::<f64>().ok()
            });
            let level = level.unwrap_or_else(|| panic!("no figure: {ended:#?}"));
            println!("{name}: exposure {level} of 10");
            assert!(level <= EXPOSURE_MAX, "{name}: {}", ended.stdout);
        }
    }
}

#[test]
fn what_the_system_file_says_stands_in_the_unit() {
    let lab = Lab::new();
    let file = lab.file(
        "robot 50%.toml",
        "robot = \"mule\"\n[supervision]\nrestart_budget = 2\nrestart_window_s = 4.5\n",
    );
    let file = file.to_string_lossy().into_owned();
    let set = ["--set", "realtime.plant.priority=91"];
    let units = units(&lab, &[&[file.as_str()], &set[..]].concat());
    let unit = settings(&units["hilare-mule.service"]);
    let program = std::fs::canonicalize(env!("CARGO_BIN_EXE_hilare")).expect("the program");
    let start = format!(
        "{} up \"{}\" --robot mule --set realtime.plant.priority=91",
        program.display(),
        std::fs::canonicalize(&file).expect("the file").display().to_string().replace('%', "%%")
    );
    for (key, value) in [
        ("ExecStart", start.as_str()),
        ("LimitRTPRIO", "91"),
        ("LimitMEMLOCK", "infinity"),
        ("StartLimitBurst", "3"),
        ("StartLimitIntervalSec", "7500ms"),
        ("User", "hilare"),
        ("RuntimeDirectory", "hilare-mule"),
        ("Environment", "HILARE_RUNTIME_DIR=%t/hilare-mule"),
        ("RestrictRealtime", "no"),
        ("RemoveIPC", "no"),
        // The file lies in a temporary directory, which must not be hidden from the robot.
        ("PrivateTmp", "no"),
    ] {
        assert_eq!(unit.get(key).map(String::as_str), Some(value), "{key}");
    }
    assert!(!unit.contains_key("CPUAffinity"), "launch and planner may use any processor");
    let pinned: Vec<String> =
        ["planner", "waypoint_selector", "controller", "step_generator", "pose_estimator", "plant", "relay"]
            .iter()
            .enumerate()
            .flat_map(|(cpu, role)| ["--set".to_owned(), format!("realtime.{role}.cpu={}", cpu % 2 + 2)])
            .collect();
    let pinned: Vec<&str> = pinned.iter().map(String::as_str).collect();
    let unit = settings(
        &self::units(&lab, &[&["agv", "--robot", "x", "--user"], &pinned[..]].concat())["hilare-x.service"],
    );
    assert_eq!(unit["CPUAffinity"], "2 3");
    assert_eq!(unit["WantedBy"], "default.target");
    assert!(!unit.contains_key("User") && !unit.contains_key("ProtectSystem"), "{unit:?}");
}

#[test]
fn wrong_use_is_one_line() {
    let lab = Lab::new();
    lab.file("map.csv", "x,y,radius\n");
    for (args, word) in [
        (&["bogus"][..], "unknown system"),
        (&["none.toml"], "none.toml"),
        (&["--robot", "A B"], "A B"),
        (&["--run-as", "two words"], "--run-as"),
        (&["--run-as", "robot", "--user"], "--user"),
        (&["--program", "bin/hilare"], "absolute"),
        (&["--set", "planner.map=map.csv"], "absolute"),
        (&["--out", "/proc/none"], "--out"),
    ] {
        let ended = lab.hilare(&[&["systemd"], args].concat()).expect_code(2);
        assert!(ended.complaints().len() == 1 && ended.stderr.contains(word), "{args:?}: {ended:#?}");
        assert_eq!(ended.stdout, "", "{args:?}");
    }
}

/// A service manager's ear.
struct Ear {
    socket: UnixDatagram,
    path: PathBuf,
}

impl Ear {
    fn new(lab: &Lab) -> Self {
        let path = lab.dir().join("notify.sock");
        let socket = UnixDatagram::bind(&path).expect("a socket");
        Self { socket, path }
    }

    /// `hilare ARGS` as a unit of type notify with a watchdog starts it.
    fn start(&self, lab: &Lab, args: &[&str]) -> Running {
        let mut command = lab.command(args);
        command.env("NOTIFY_SOCKET", &self.path).env("WATCHDOG_USEC", WATCHDOG.as_micros().to_string());
        Running::start(command)
    }

    /// The next message, unless none comes within `limit`.
    fn next(&self, limit: Duration) -> Option<String> {
        self.socket.set_read_timeout(Some(limit)).expect("a time-out");
        let mut bytes = [0; 4096];
        let length = self.socket.recv(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes[..length]).into_owned())
    }

    /// Waits for a line that begins like this; returns everything heard until then.
    #[track_caller]
    fn await_line(&self, begin: &str) -> Vec<String> {
        let mut heard = Vec::new();
        let deadline = Instant::now() + PATIENCE;
        loop {
            let message = self.next(PATIENCE);
            let lines = message.iter().flat_map(|message| message.lines()).map(str::to_owned);
            let before = heard.len();
            heard.extend(lines);
            if heard[before..].iter().any(|line| line.starts_with(begin)) {
                return heard;
            }
            assert!(Instant::now() < deadline, "no {begin:?}: {heard:#?}");
        }
    }

    /// Takes what has been said already.
    fn catch_up(&self) {
        self.socket.set_nonblocking(true).expect("a socket");
        while self.socket.recv(&mut [0; 64]).is_ok() {}
        self.socket.set_nonblocking(false).expect("a socket");
    }
}

fn count(heard: &[String], line: &str) -> usize {
    heard.iter().filter(|heard| *heard == line).count()
}

#[test]
fn launch_says_ready_alive_and_stopping() {
    let lab = Lab::new();
    let (robot, ear) = (lab.robot(), Ear::new(&lab));
    let launch = ear.start(&lab, &["up", "--robot", &robot]);
    let heard = ear.await_line("READY=1");
    assert!(
        heard.contains(&"STATUS=starting".to_owned())
            && heard.iter().any(|l| l.starts_with("STATUS=disarmed")),
        "{heard:?}"
    );
    // Ready means that every worker is at work.
    let status = lab.status(&robot).expect("it is up");
    assert!(
        status["processes"].as_array().is_some_and(|all| all.iter().all(|one| one["state"] == "ready")),
        "{status}"
    );
    let mut alive = 0;
    wait_until("signs of life while it is disarmed", || {
        alive += count(&ear.await_line("WATCHDOG=1"), "WATCHDOG=1");
        alive >= 3
    });
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    ear.await_line("STATUS=armed");
    for _ in 0..3 {
        ear.await_line("WATCHDOG=1");
    }
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    let heard = ear.await_line("STOPPING=1");
    assert_eq!(count(&heard, "READY=1"), 0, "once is enough");
    launch.wait(PATIENCE).expect_code(0);
    assert_eq!(ear.next(Duration::from_millis(1)), None, "silence after the end");
    lab.assert_nothing_left("down");
}

#[test]
fn a_launch_that_stands_still_gives_no_sign_of_life() {
    let lab = Lab::new();
    let (robot, ear) = (lab.robot(), Ear::new(&lab));
    let launch = ear.start(&lab, &["up", "--robot", &robot]);
    ear.await_line("READY=1");
    launch.signal(Signal::STOP);
    wait_until("it stands still", || process_state(launch.pid()) == Some('T'));
    ear.catch_up();
    assert_eq!(ear.next(3 * WATCHDOG), None, "systemd would end it now");
    launch.signal(Signal::CONT);
    ear.await_line("WATCHDOG=1");
    launch.signal(Signal::TERM);
    ear.await_line("STOPPING=1");
    launch.wait(PATIENCE).expect_code(0);
    lab.assert_nothing_left("a pause of launch");
}

#[test]
fn a_fault_is_told_before_the_end() {
    let lab = Lab::new();
    let (robot, ear) = (lab.robot(), Ear::new(&lab));
    let launch = ear.start(&lab, &["up", "--robot", &robot, "--set", "supervision.restart_budget=0"]);
    ear.await_line("READY=1");
    let status = lab.status(&robot).expect("it is up");
    support::process::signal(support::pid_of(&status, "controller"), Signal::KILL);
    let heard = ear.await_line("STATUS=fault: controller was killed");
    assert_eq!(count(&heard, "STOPPING=1"), 1, "{heard:?}");
    launch.wait(PATIENCE).expect_code(1);
    lab.assert_nothing_left("a fault");
}

/// State letter of a process.
fn process_state(pid: i32) -> Option<char> {
    let stat = std::fs::read_to_string(Path::new("/proc").join(pid.to_string()).join("stat")).ok()?;
    stat.rsplit_once(") ")?.1.chars().next()
}
