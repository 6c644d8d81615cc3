//! Hostile callers of the control socket: launch answers everybody else as before, does not grow, and the
//! robot goes on ticking. They are of our own user; nobody else gets as far as the socket.

mod support;

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use support::random::Random;
use support::{Lab, number, text, wait_until};

/// Connections of the test at once; a process has 1024 descriptors unless it asks for more.
const MANY: usize = 1000;
/// Memory that launch may need more than before, MB: unfinished requests and what they are parsed into.
const GROWTH_MAX_MB: u64 = 64;

/// A robot that drives, and what its launch had before anybody disturbed it.
struct Robot {
    lab: Lab,
    name: String,
    launch: i32,
    before: Holdings,
}

/// What a process holds.
#[derive(Debug, PartialEq, Eq)]
struct Holdings {
    descriptors: usize,
    threads: usize,
}

impl Robot {
    fn up() -> Self {
        let lab = Lab::new();
        let name = lab.robot();
        lab.hilare(&["up", "--detach", "--robot", &name]).expect_code(0);
        let path = lab.straight(30.0);
        lab.hilare(&["follow", &path.to_string_lossy(), "--robot", &name]).expect_code(0);
        let status = lab.status(&name).expect("it is up");
        let launch = i32::try_from(status["launch_pid"].as_i64().expect("a pid")).expect("a pid");
        let robot = Self { before: holdings(launch), lab, name, launch };
        robot.drives("at the start");
        robot
    }

    fn connect(&self) -> UnixStream {
        let socket: PathBuf = self.lab.runtime_dir().join(&self.name).join("control.sock");
        let stream = UnixStream::connect(socket).expect("the control socket");
        stream.set_read_timeout(Some(support::PATIENCE)).expect("a time-out");
        stream.set_write_timeout(Some(support::PATIENCE)).expect("a time-out");
        stream
    }

    /// Sends bytes and reads the answer; empty if the connection was closed without one.
    fn talk(&self, bytes: &[u8]) -> String {
        let stream = self.connect();
        // Launch may have had enough before we are done.
        let _ = (&stream).write_all(bytes);
        let mut answer = String::new();
        let _ = BufReader::new(stream).read_line(&mut answer);
        answer
    }

    /// What is no request is refused, in one short line of JSON.
    #[track_caller]
    fn refuses(&self, bytes: &[u8], why: &str) {
        let answer = self.talk(bytes);
        let shown = String::from_utf8_lossy(&bytes[..bytes.len().min(60)]).into_owned();
        let said: Value =
            serde_json::from_str(&answer).unwrap_or_else(|e| panic!("{shown:?}: {e}: {answer:?}"));
        assert_eq!(said["ok"], false, "{shown:?}: {answer}");
        assert!(text(&said, "message").contains(why) && answer.len() < 400, "{shown:?}: {answer}");
    }

    /// It answers `hilare status`, executes ticks, and can be made to drive.
    #[track_caller]
    fn drives(&self, when: &str) {
        self.lab.hilare(&["arm", "--robot", &self.name]).expect_code(0);
        let tick = |status: &Value| number(status, "tick");
        let first = tick(&self.lab.status(&self.name).unwrap_or_else(|| panic!("no status {when}")));
        self.lab.await_status(&self.name, &format!("it drives {when}"), |status| {
            assert!(status["fault"].is_null(), "{when}: {status}");
            tick(status) > first && number(status, "speed_mps") > 0.01
        });
    }

    /// Its launch holds what it held before, and is not much larger.
    #[track_caller]
    fn has_not_grown(&self, before_mb: u64) {
        let mut now = holdings(self.launch);
        let settled = || {
            now = holdings(self.launch);
            now == self.before
        };
        assert!(support::comes_true(support::PATIENCE, settled), "{now:?} instead of {:?}", self.before);
        // What it needed at most, not what it has now.
        let most_mb = memory_mb(self.launch, "VmHWM:");
        assert!(most_mb < before_mb + GROWTH_MAX_MB, "launch grew from {before_mb} MB to {most_mb} MB");
    }
}

fn holdings(pid: i32) -> Holdings {
    let entries = |what: &str| fs::read_dir(format!("/proc/{pid}/{what}")).map_or(0, Iterator::count);
    Holdings { descriptors: entries("fd"), threads: entries("task") }
}

/// A figure of a process's memory, MB.
fn memory_mb(pid: i32, which: &str) -> u64 {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).expect("launch lives");
    let line = status.lines().find(|line| line.starts_with(which)).expect("a line of its memory");
    let kb: u64 = line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("a number");
    kb >> 10
}

/// Room for `MANY` sockets in this process.
fn raise_descriptor_limit() {
    let limit = getrlimit(Resource::Nofile);
    let wanted = limit.maximum.unwrap_or(4096).min(4096);
    assert!(wanted > MANY as u64 + 100, "the hard limit of descriptors is {wanted}");
    setrlimit(Resource::Nofile, Rlimit { current: Some(wanted), maximum: limit.maximum })
        .expect("more descriptors");
}

#[test]
fn what_is_no_request_is_refused() {
    let robot = Robot::up();
    let before_mb = memory_mb(robot.launch, "VmRSS:");
    let deep = |open: &str| format!("{open}\n").into_bytes();
    let points = |n: usize| format!("{{\"follow\":[{}]}}\n", vec!["[0,0,0,0]"; n].join(","));
    for (bytes, why) in [
        (&b"\n"[..], "not a request"),
        (b"garbage\n", "not a request"),
        (b"\xff\xfe\x80\0\n", "not a request"),
        (b"\"sta\xfftus\"\n", "not a request"),
        (b"\0\0\0\0\0\0\0\0\n", "not a request"),
        (b"\"shutdown\"\n", "unknown variant"),
        (b"{\"status\":1}\n", "not a request"),
        (b"{\"goal\":{}}\n", "missing field"),
        (b"{\"goal\":{\"x_m\":1e999,\"y_m\":0}}\n", "out of range"),
        (b"{\"goal\":{\"x_m\":NaN,\"y_m\":0}}\n", "not a request"),
        (b"{\"goal\":{\"x_m\":0,\"y_m\":0,\"theta_rad\":null,\"more\":1}}\n", "unknown field"),
        (b"{\"follow\":[[0,0,0]]}\n", "not a request"),
        (b"{\"follow\":[[0,0,0,0,0]]}\n", "not a request"),
        (b"{\"follow\":null}\n", "not a request"),
        (&deep(&"[".repeat(100_000)), "not a request"),
        (&deep(&"{\"goal\":".repeat(100_000)), "not a request"),
        (&deep(&format!("{{\"follow\":{}", "[".repeat(100_000))), "not a request"),
        (&deep(&format!("\"{}\"", "a".repeat(1_000_000))), "unknown variant"),
        (points(65_537).as_bytes(), "65536 waypoints"),
        // A goal that is one, but of no use: the planner's word.
        (b"{\"goal\":{\"x_m\":1e300,\"y_m\":0,\"theta_rad\":null}}\n", "refused"),
        (b"{\"follow\":[]}\n", ""),
    ] {
        if why == "refused" {
            let answer: Value = serde_json::from_str(&robot.talk(bytes)).expect("JSON");
            assert_eq!(answer["ok"], false, "{answer}");
        } else {
            robot.refuses(bytes, why);
        }
    }
    // Longer than any request, with and without an end to it.
    robot.refuses(&vec![b'a'; 9 << 20], "too long");
    robot.refuses(&[&vec![b' '; 9 << 20][..], b"\"status\"\n"].concat(), "too long");
    // More after the end of the line is not looked at; an end without a line is the caller's end.
    assert!(robot.talk(b"\"status\"\n\"estop\"\n").contains("\"ok\":true"));
    let stream = robot.connect();
    (&stream).write_all(b"\"status\"").expect("a request without an end");
    stream.shutdown(Shutdown::Write).expect("half of a connection");
    let mut answer = String::new();
    (&stream).read_to_string(&mut answer).expect("an answer");
    assert!(answer.contains("\"ok\":true"), "{answer}");
    robot.drives("after garbage");
    robot.has_not_grown(before_mb);
}

#[test]
fn bytes_at_random_cost_nobody_anything() {
    let robot = Robot::up();
    let before_mb = memory_mb(robot.launch, "VmRSS:");
    let mut random = Random::new("bytes_at_random_cost_nobody_anything", 3);
    let requests: [&[u8]; 4] = [
        b"\"status\"\n",
        b"{\"goal\":{\"x_m\":0.1,\"y_m\":-2e-3,\"theta_rad\":null}}\n",
        b"{\"follow\":[[0,0,0,0],[1.5,0,0.25,0],[2,1,0,-1.25]]}\n",
        b"\"stop\"\n",
    ];
    for n in 0..1500 {
        let mut bytes = requests[n % requests.len()].to_vec();
        for _ in 0..random.whole(1, 4) {
            let at = random.whole(0, bytes.len() as u64 - 1) as usize;
            match random.whole(0, 3) {
                0 => bytes[at] = random.whole(0, 255) as u8,
                1 => bytes.insert(at, random.whole(0, 255) as u8),
                2 => bytes[at] ^= 1 << random.whole(0, 7),
                _ => bytes.truncate(at + 1),
            }
        }
        let stream = robot.connect();
        (&stream).write_all(&bytes).expect("a few bytes");
        stream.shutdown(Shutdown::Write).expect("half of a connection");
        let mut answer = String::new();
        (&stream).read_to_string(&mut answer).expect("an answer in UTF-8");
        let said: Value = serde_json::from_str(&answer).unwrap_or_default();
        assert!(said["ok"].is_boolean(), "{:?}: {answer:?}", String::from_utf8_lossy(&bytes));
    }
    robot.drives("after bytes at random");
    robot.has_not_grown(before_mb);
}

#[test]
fn callers_who_do_not_finish_keep_nobody_out() {
    raise_descriptor_limit();
    let robot = Robot::up();
    let before_mb = memory_mb(robot.launch, "VmRSS:");
    // Gone before they said anything, in the middle, and before the answer.
    for _ in 0..200 {
        for part in [&b""[..], b"{\"follow\":[[0,", b"\"status\"\n"] {
            let _ = (&robot.connect()).write_all(part);
        }
    }
    // A thousand who say nothing, and as many who begin and do not go on.
    let silent: Vec<UnixStream> = (0..MANY / 2).map(|_| robot.connect()).collect();
    let half: Vec<UnixStream> = (0..MANY / 2).map(|_| robot.connect()).collect();
    for stream in &half {
        let _ = (&*stream).write_all(b"{\"follow\":[[0,0,0,0],");
    }
    robot.drives("beside a thousand callers who do not finish");
    robot.lab.hilare(&["estop", "--robot", &robot.name]).expect_code(0);
    robot.lab.hilare(&["reset", "--robot", &robot.name]).expect_code(0);
    drop((silent, half));
    // One byte at a time, from many at once.
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    let streams: Vec<UnixStream> = (0..50).map(|_| robot.connect()).collect();
                    for byte in b"{\"follow\":[[0,0,0,0],[0" {
                        for stream in &streams {
                            let _ = (&*stream).write_all(&[*byte]);
                        }
                        std::thread::sleep(Duration::from_millis(5));
                    }
                }
            });
        }
        robot.drives("beside two hundred slow callers");
        robot.lab.hilare(&["estop", "--robot", &robot.name]).expect_code(0);
        robot.lab.hilare(&["reset", "--robot", &robot.name]).expect_code(0);
        over.store(true, Ordering::Relaxed);
    });
    // Long ones that do not end: together more than is kept.
    let long: Vec<UnixStream> = (0..40).map(|_| robot.connect()).collect();
    std::thread::scope(|scope| {
        for stream in &long {
            scope.spawn(|| (&*stream).write_all(&vec![b'a'; 2 << 20]));
        }
    });
    robot.drives("beside forty long requests without an end");
    drop(long);
    robot.has_not_grown(before_mb);
}

#[test]
fn goals_by_the_hundred_are_all_answered_and_delay_no_emergency_stop() {
    let robot = Robot::up();
    let before_mb = memory_mb(robot.launch, "VmRSS:");
    let request = b"{\"goal\":{\"x_m\":0.5,\"y_m\":0.5,\"theta_rad\":null}}\n";
    let call = |_| {
        let stream = robot.connect();
        (&stream).write_all(request).expect("a goal");
        stream
    };
    let callers: Vec<UnixStream> = (0..300).map(call).collect();
    robot.lab.hilare(&["estop", "--robot", &robot.name]).expect_code(0);
    let status = robot.lab.status(&robot.name).expect("it is up");
    assert_eq!(text(&status, "mode"), "e-stop", "{status}");
    for stream in callers {
        let mut answer = String::new();
        let _ = BufReader::new(stream).read_line(&mut answer);
        let said: Value = serde_json::from_str(&answer).unwrap_or_default();
        // Accepted, overtaken by a newer one, or too many at once: but said.
        assert!(said["message"].is_string(), "{answer:?}");
    }
    robot.lab.hilare(&["reset", "--robot", &robot.name]).expect_code(0);
    wait_until("its stop is over", || {
        robot.lab.status(&robot.name).is_some_and(|status| status["mode"] == "disarmed")
    });
    robot.drives("after hundreds of goals");
    robot.has_not_grown(before_mb);
}
