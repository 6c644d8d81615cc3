//! What the tests share: a laboratory a test (own directory, own robots, own leftovers) and the processes
//! started in it.
//!
//! Every process of a laboratory carries its runtime directory in its environment, children included, and
//! every file in shared memory its name, so "nothing is left" is a question with an exact answer, and tests
//! can run side by side.

// Every test file uses its own part.
#![allow(dead_code)]

pub mod load;
pub mod machine;
pub mod process;
pub mod random;
pub mod units;
pub mod web_socket;

pub use process::{Ended, Running};

use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Taken by tests that count missed cycles: beside another robot in real time they would measure that one.
pub fn whole_machine() -> MutexGuard<'static, ()> {
    static MACHINE: Mutex<()> = Mutex::new(());
    MACHINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How long anything may take before it counts as hung. Not a measure of speed.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Keys of a robot that is driven on a busy machine: that is no reason to stop, nor to give a process up.
pub const PATIENT: [&str; 6] = [
    "--set",
    "timing.pause_stop_ticks=0",
    "--set",
    "supervision.restart_budget=100",
    "--set",
    "supervision.hung_after_s=5",
];

/// A directory, a runtime directory and a family of robot names of its own.
pub struct Lab {
    name: String,
    dir: TempDir,
}

impl Lab {
    /// A fresh one.
    pub fn new() -> Self {
        // Another user may look into it: what is refused must be so within.
        let open = fs::Permissions::from_mode(0o755);
        // Short: sockets have at most 107 characters. Of one length: no name begins another one.
        let dir = tempfile::Builder::new().prefix("hilare-t").rand_bytes(8).permissions(open).tempdir();
        let dir = dir.expect("a directory for the test");
        let name = dir.path().file_name().expect("it has a name").to_string_lossy();
        let name = name.trim_start_matches("hilare-").to_lowercase();
        Self { name, dir }
    }

    /// Name of the test's robot.
    pub fn robot(&self) -> String {
        self.robot_named("a")
    }

    /// Name of a further robot.
    pub fn robot_named(&self, suffix: &str) -> String {
        format!("{}{suffix}", self.name)
    }

    /// Where the commands run.
    pub fn dir(&self) -> &Path {
        self.dir.path()
    }

    /// Where locks and sockets are.
    pub fn runtime_dir(&self) -> PathBuf {
        self.dir.path().join("rt")
    }

    /// Writes a file and returns its path.
    pub fn file(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.dir.path().join(name);
        fs::write(&path, text).expect("a file of the test");
        path
    }

    /// A straight path of `length_m`, at 40 mm/s.
    pub fn straight(&self, length_m: f64) -> PathBuf {
        self.file(&format!("straight-{length_m}.csv"), format!("x,y\n0,0\n{length_m},0\n"))
    }

    /// So many laps of a rectangle that begins at 0.2, 0.2 m.
    pub fn laps(&self, laps: usize) -> String {
        let lap = "0.57,0.2\n0.57,0.48\n0.2,0.48\n0.2,0.2\n";
        let path = self.file("laps.csv", format!("x,y\n0.2,0.2\n{}", lap.repeat(laps)));
        path.to_string_lossy().into_owned()
    }

    /// `program` with this laboratory's environment.
    pub fn command_of(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("HILARE_RUNTIME_DIR", self.runtime_dir()).env_remove("HILARE_LOG");
        command.current_dir(self.dir.path()).stdin(Stdio::null());
        command
    }

    /// `hilare ARGS`, not yet started.
    pub fn command<S: AsRef<std::ffi::OsStr>>(&self, args: &[S]) -> Command {
        let mut command = self.command_of(env!("CARGO_BIN_EXE_hilare"));
        command.args(args);
        command
    }

    /// Starts `hilare ARGS`.
    pub fn start<S: AsRef<std::ffi::OsStr>>(&self, args: &[S]) -> Running {
        Running::start(self.command(args))
    }

    /// Runs `hilare ARGS` to its end.
    pub fn hilare<S: AsRef<std::ffi::OsStr>>(&self, args: &[S]) -> Ended {
        self.start(args).wait(PATIENCE)
    }

    /// The status of a robot, if it is up.
    pub fn status(&self, robot: &str) -> Option<Value> {
        let ended = self.hilare(&["status", "--robot", robot, "--json"]);
        if ended.stdout.is_empty() { None } else { serde_json::from_str(&ended.stdout).ok() }
    }

    /// Waits until the status of a robot is as wanted, and returns it.
    pub fn await_status(&self, robot: &str, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let mut last = None;
        wait_until(what, || {
            last = self.status(robot);
            last.as_ref().is_some_and(&wanted)
        });
        last.expect("wait_until saw it")
    }

    /// Waits for so many ticks of a robot, from now on.
    pub fn await_ticks(&self, robot: &str, what: &str, ticks: f64) {
        let from = std::cell::Cell::new(None);
        self.await_status(robot, what, |status| {
            let tick = number(status, "tick");
            if from.get().is_none() && tick > 0.0 {
                from.set(Some(tick));
            }
            from.get().is_some_and(|from| tick > from + ticks)
        });
    }

    /// Kills a process of a robot and waits for its successor.
    pub fn replace(&self, robot: &str, process: &str) {
        let old = pid_of(&self.status(robot).expect("it is up"), process);
        process::signal(old, Signal::KILL);
        self.await_status(robot, &format!("a successor of {process}"), |status| {
            let processes = status["processes"].as_array().into_iter().flatten();
            processes.into_iter().any(|found| {
                let working = found["state"] != "starting" && found["state"] != "restarting";
                let new = found["pid"].as_i64().is_some_and(|pid| pid > 1 && pid != i64::from(old));
                found["name"] == process && working && new
            })
        });
    }

    /// `summary.json` of a report directory.
    pub fn summary(&self, out: &Path) -> Value {
        let text = fs::read_to_string(out.join("summary.json")).expect("summary.json");
        serde_json::from_str(&text).expect("summary.json is JSON")
    }

    /// Processes of this laboratory: pid and command line.
    pub fn processes(&self) -> Vec<(i32, String)> {
        let mark = format!("HILARE_RUNTIME_DIR={}", self.runtime_dir().display());
        processes().into_iter().filter(|(pid, _)| environment_has(*pid, mark.as_bytes())).collect()
    }

    /// Files of this laboratory's robots in /dev/shm.
    pub fn shm_files(&self) -> Vec<PathBuf> {
        // hilare.UID.ROBOT…, locks included
        let mark = format!(".{}", self.name);
        entries(Path::new("/dev/shm"))
            .into_iter()
            .filter(|path| file_name(path).starts_with("hilare.") && file_name(path).contains(&mark))
            .collect()
    }

    /// What is in the runtime directory: locks, sockets, directories of robots.
    pub fn runtime_files(&self) -> Vec<PathBuf> {
        entries(&self.runtime_dir())
    }

    /// No process, nothing in shared memory, no socket, no lock.
    #[track_caller]
    pub fn assert_nothing_left(&self, after: &str) {
        assert_eq!(self.processes(), [], "processes left after {after}");
        assert_eq!(self.shm_files(), [] as [PathBuf; 0], "shared memory left after {after}");
        assert_eq!(self.runtime_files(), [] as [PathBuf; 0], "runtime files left after {after}");
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        // Twice: a launch may have been starting a worker.
        for _ in 0..2 {
            for (pid, _) in self.processes() {
                process::signal(pid, Signal::KILL);
            }
        }
        for file in self.shm_files() {
            let _ = fs::remove_file(file);
        }
    }
}

/// Pid and command line of every process there is.
fn processes() -> Vec<(i32, String)> {
    let line = |pid: i32| {
        let text = fs::read(format!("/proc/{pid}/cmdline")).ok()?;
        Some((pid, String::from_utf8_lossy(&text).replace('\0', " ").trim().to_owned()))
    };
    entries(Path::new("/proc"))
        .iter()
        .filter_map(|path| file_name(path).parse().ok())
        .filter_map(line)
        .collect()
}

fn environment_has(pid: i32, mark: &[u8]) -> bool {
    // What has ended and was not collected yet has no environment.
    let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
    environment.split(|byte| *byte == 0).any(|entry| entry == mark)
}

fn entries(dir: &Path) -> Vec<PathBuf> {
    fs::read_dir(dir).map(|entries| entries.flatten().map(|entry| entry.path()).collect()).unwrap_or_default()
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Waits for something that must come; panics if it does not.
#[track_caller]
pub fn wait_until(what: &str, condition: impl FnMut() -> bool) {
    assert!(comes_true(PATIENCE, condition), "waited {PATIENCE:?} in vain: {what}");
}

/// True if `condition` comes true within `limit`.
pub fn comes_true(limit: Duration, mut condition: impl FnMut() -> bool) -> bool {
    let deadline = Instant::now() + limit;
    loop {
        if condition() {
            return true;
        }
        if Instant::now() > deadline {
            return false;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The Python that has iceoryx2's binding: `HILARE_TEST_PYTHON`, or that which tests/run installs. Without one
/// `test` is skipped.
pub fn python_with_iceoryx2(test: &str) -> Option<PathBuf> {
    python_with(test, "iceoryx2, tomllib")
}

/// The same Python, if it has these modules.
pub fn python_with(test: &str, modules: &str) -> Option<PathBuf> {
    let target = Path::new(env!("CARGO_BIN_EXE_hilare")).ancestors().nth(2).expect("target/PROFILE/hilare");
    let given = std::env::var_os("HILARE_TEST_PYTHON").map(PathBuf::from);
    let python = given.unwrap_or_else(|| target.join("python/bin/python3"));
    let mut import = Command::new(&python);
    import.args(["-c", &format!("import {modules}")]).stderr(Stdio::null());
    if import.status().is_ok_and(|status| status.success()) {
        return Some(python);
    }
    skip(test, &format!("{} lacks one of {modules} (tests/run installs them)", python.display()));
    None
}

/// Says, past the test runner's capture, that something was not tested.
pub fn skip(test: &str, why: &str) {
    let _ = writeln!(std::io::stderr().lock(), "SKIPPED {test}: {why}");
}

/// True if the minute-long tests are not wanted (`HILARE_TESTS=quick`); says so.
pub fn quick(test: &str) -> bool {
    let quick = std::env::var("HILARE_TESTS").is_ok_and(|value| value == "quick");
    if quick {
        skip(test, "HILARE_TESTS=quick");
    }
    quick
}

/// A number of a JSON object.
#[track_caller]
pub fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no number {key:?} in {value}"))
}

/// A text of a JSON object.
#[track_caller]
pub fn text<'v>(value: &'v Value, key: &str) -> &'v str {
    value[key].as_str().unwrap_or_else(|| panic!("no text {key:?} in {value}"))
}

/// Pid of a worker in a status.
#[track_caller]
pub fn pid_of(status: &Value, process: &str) -> i32 {
    let processes = status["processes"].as_array().expect("a list of processes");
    let found = processes.iter().find(|entry| entry["name"] == process);
    let pid = found.and_then(|entry| entry["pid"].as_i64()).unwrap_or(0);
    assert!(pid > 1, "{process} is not running: {status}");
    i32::try_from(pid).expect("a pid")
}
