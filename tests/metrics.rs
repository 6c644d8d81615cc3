//! `/metrics`, of a robot in real processes: what Prometheus reads there is what launch says, and nobody who asks
//! does the robot any harm.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use support::{Ended, Lab, PATIENCE, number, pid_of, text, wait_until};

/// A port that nobody has at present.
fn free_port() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("its address")
}

/// Brings a robot up with a page.
fn up(lab: &Lab, more: &[&str]) -> (String, SocketAddr) {
    let (robot, address) = (lab.robot(), free_port());
    let listen = address.to_string();
    let args = [&["up", "--detach", "--robot", &robot, "--listen", &listen], more].concat();
    lab.hilare(&args).expect_code(0);
    (robot, address)
}

fn drive(lab: &Lab, robot: &str) {
    lab.hilare(&["arm", "--robot", robot]).expect_code(0);
    let path = lab.straight(3.0);
    lab.hilare(&["follow", &path.to_string_lossy(), "--robot", robot]).expect_code(0);
    lab.await_status(robot, "it drives", |status| number(status, "speed_mps") > 0.03);
}

/// What comes back for some bytes.
fn answer(address: SocketAddr, request: impl AsRef<[u8]>) -> String {
    let Ok(mut stream) = TcpStream::connect(address) else { return String::new() };
    stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
    let _ = stream.write_all(request.as_ref());
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn get(address: SocketAddr, path: &str, accept: &str) -> String {
    answer(address, format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nAccept: {accept}\r\n\r\n"))
}

/// The body of an answer that is a page.
fn scrape(address: SocketAddr, accept: &str) -> String {
    let answer = get(address, "/metrics", accept);
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no answer: {answer:?}"));
    assert!(head.starts_with("HTTP/1.1 200 "), "{answer}");
    body.to_owned()
}

/// A sample by its name and some of its labels.
fn sample(body: &str, name: &str, labels: &[&str]) -> f64 {
    let is_it = |line: &&str| {
        line.strip_prefix(name).is_some_and(|rest| rest.starts_with([' ', '{']))
            && labels.iter().all(|label| line.contains(label))
    };
    let line = body.lines().find(is_it).unwrap_or_else(|| panic!("no {name} {labels:?} in\n{body}"));
    line.rsplit_once(' ').expect("a value").1.parse().expect("a number")
}

/// The Python with Prometheus's client that tests/run installs, if it is there.
fn python(test: &str) -> Option<std::path::PathBuf> {
    let target = Path::new(env!("CARGO_BIN_EXE_hilare")).ancestors().nth(2).expect("target/PROFILE/hilare");
    let given = std::env::var_os("HILARE_TEST_PYTHON").map(std::path::PathBuf::from);
    let python = given.unwrap_or_else(|| target.join("python/bin/python3"));
    let mut import = Command::new(&python);
    import.args(["-c", "import prometheus_client"]).stderr(Stdio::null());
    if import.status().is_ok_and(|status| status.success()) {
        return Some(python);
    }
    support::skip(test, &format!("{} has no prometheus_client (tests/run installs it)", python.display()));
    None
}

/// A scrape as Prometheus's own parser has it.
fn parsed(python: &Path, body: &str, format: &str) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/metrics.py");
    let mut command = Command::new(python);
    command.arg(script).arg(format).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("python");
    child.stdin.take().expect("piped").write_all(body.as_bytes()).expect("it reads");
    let output = child.wait_with_output().expect("it ends");
    let complaints = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{format}: {complaints}\n{body}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn prometheus_reads_what_launch_says() {
    let Some(python) = python("prometheus_reads_what_launch_says") else { return };
    let lab = Lab::new();
    let (robot, address) = up(&lab, &["--standby", "kanayama"]);
    drive(&lab, &robot);
    lab.hilare(&["swap", "controller", "pure-pursuit", "--robot", &robot]).expect_code(0);
    let before = lab.status(&robot).expect("up");
    std::thread::sleep(Duration::from_millis(300));
    let body = scrape(address, "text/plain");
    let open = scrape(address, "application/openmetrics-text; version=1.0.0");
    let after = lab.status(&robot).expect("up");
    let families = parsed(&python, &body, "text");
    let same = parsed(&python, &open, "openmetrics");
    let names = |families: &Value| -> Vec<(String, String)> {
        let families = families.as_array().expect("families");
        families.iter().map(|one| (text(one, "name").to_owned(), text(one, "type").to_owned())).collect()
    };
    assert_eq!(names(&families), names(&same), "both texts say the same");
    assert!(names(&families).iter().all(|(name, _)| name.starts_with("hilare_")), "{families}");

    let all = |name: &str, labels: &[(&str, &str)]| -> Vec<f64> {
        let samples = families.as_array().expect("families").iter().flat_map(|one| one["samples"].as_array());
        let fits = |one: &&Value| {
            text(one, "name") == name && labels.iter().all(|(key, value)| one["labels"][*key] == *value)
        };
        samples.flatten().filter(fits).map(|one| number(one, "value")).collect()
    };
    let one = |name: &str, labels: &[(&str, &str)]| -> f64 {
        let found = all(name, labels);
        assert_eq!(found.len(), 1, "{name} {labels:?}: {found:?}");
        found[0]
    };
    // What only goes up lies between what launch said before and after.
    for (name, key) in [
        ("hilare_ticks_total", "tick"),
        ("hilare_ticks_late_total", "ticks_late"),
        ("hilare_paused_ticks_total", "paused_ticks"),
        ("hilare_commands_late_total", "commands_late"),
        ("hilare_commands_rejected_total", "commands_rejected"),
        ("hilare_commands_missing_total", "cycles_without_command"),
        ("hilare_commands_borrowed_total", "commands_borrowed"),
        ("hilare_uptime_seconds", "uptime_s"),
        ("hilare_swaps_total", "swaps"),
    ] {
        let (value, before, after) = (one(name, &[]), number(&before, key), number(&after, key));
        assert!((before..=after).contains(&value), "{name}: {before} {value} {after}");
    }
    assert_eq!(one("hilare_swaps_total", &[]), 1.0);
    assert_eq!((one("hilare_waypoint_index", &[]), one("hilare_waypoints", &[])), (1.0, 2.0));
    assert_eq!(
        (one("hilare_mode", &[("mode", "armed")]), one("hilare_mode", &[("mode", "stop")])),
        (1.0, 0.0)
    );
    assert_eq!(all("hilare_mode", &[]).iter().sum::<f64>(), 1.0);
    assert_eq!(one("hilare_build_info", &[("robot", &robot), ("version", env!("CARGO_PKG_VERSION"))]), 1.0);
    let x = one("hilare_position_meters", &[("of", "estimate"), ("axis", "x")]);
    let x_of = |status: &Value| status["pose"][0].as_f64().expect("a pose");
    assert!(x_of(&before) < x && x < x_of(&after), "{x}");
    let true_x = one("hilare_position_meters", &[("of", "truth"), ("axis", "x")]);
    assert!((true_x - x).abs() < 0.02, "{true_x} {x}");
    for of in ["estimate", "truth"] {
        assert!(one("hilare_cross_track_meters", &[("of", of)]).abs() < 1e-6);
    }

    // The processes are those of the status.
    for process in after["processes"].as_array().expect("processes") {
        let slot = process["slot"].to_string();
        let mut labels = vec![("role", text(process, "name")), ("slot", &*slot)];
        labels.extend(process["law"].as_str().map(|law| ("law", law)));
        assert_eq!(one("hilare_process_up", &labels), 1.0);
        assert_eq!(one("hilare_process_restarts_total", &labels), number(process, "restarts"));
        let pid = process["pid"].to_string();
        assert_eq!(one("hilare_process_info", &[&labels[..], &[("pid", &pid)]].concat()), 1.0);
        assert!(one("hilare_process_resident_memory_bytes", &labels) > 1e6);
        if process["law"].is_string() {
            assert_eq!(one("hilare_process_in_charge", &labels) == 1.0, process["authority"] == true);
        }
    }
    assert_eq!(all("hilare_process_up", &[]).len(), after["processes"].as_array().map_or(0, Vec::len) + 1);
    assert_eq!(all("hilare_process_in_charge", &[]).iter().sum::<f64>(), 1.0);
    let clock = [("role", "step_generator")];
    // Every tick had its wake-up; one of two is under way while both are read.
    let (ticks, woken) = (one("hilare_ticks_total", &[]), one("hilare_lateness_seconds_count", &clock));
    assert!((ticks - woken).abs() <= 100.0, "{ticks} ticks, {woken} wake-ups");
    assert!(one("hilare_step_seconds_count", &clock) > 0.9 * ticks);
    let sum = one("hilare_lateness_seconds_sum", &clock);
    assert!(sum > 0.0 && sum < ticks, "{sum} s in {ticks} ticks");
    for role in ["pose_estimator", "waypoint_selector", "plant"] {
        assert!(one("hilare_lateness_seconds_count", &[("role", role)]) > 0.0, "{role}");
    }
    for wire in ["steps", "pose", "truth", "reference", "command", "authority"] {
        assert!(one("hilare_wire_messages_total", &[("wire", wire)]) > 10.0, "{wire}");
    }
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("a scrape");
}

#[test]
fn hostile_visitors_harm_neither_page_nor_robot() {
    let lab = Lab::new();
    let (robot, address) = up(&lab, &[]);
    drive(&lab, &robot);
    let status = lab.status(&robot).expect("up");
    let page = pid_of(&status, "operator");
    let resident_kb = || {
        let status = std::fs::read_to_string(format!("/proc/{page}/status")).expect("the page lives");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
        line.trim_end_matches("kB").trim().parse::<u64>().expect("kB")
    };
    let fine = || scrape(address, "*/*").contains("hilare_ticks_total");
    assert!(fine());
    let before_kb = resident_kb();

    // Slow ones, that say a byte at a time and never come to the end.
    let mut slow: Vec<TcpStream> = Vec::new();
    for n in 0..100 {
        let mut stream = TcpStream::connect(address).expect("a connection");
        let _ = stream.write_all(&b"GET /metrics HTTP/1.1\r\nHost: localhost\r\nX: "[..n % 40]);
        slow.push(stream);
    }
    assert!(fine(), "beside 100 slow ones");
    let head = "GET /metrics HTTP/1.1\r\n";
    for bytes in [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".to_vec(),
        vec![0; 1 << 20],
        vec![b'A'; 4 << 20],
        format!("{head}Host: evil.example\r\n\r\n").into_bytes(),
        format!("{head}Host: localhost\r\nX: {}\r\n\r\n", "x".repeat(4 << 20)).into_bytes(),
        format!("{head}Host: localhost\r\n{}\r\n", "X: y\r\n".repeat(100_000)).into_bytes(),
        format!(
            "POST /metrics HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n{}",
            "x".repeat(1 << 20)
        )
        .into_bytes(),
        format!("GET /{} HTTP/1.1\r\nHost: localhost\r\n\r\n", "x".repeat(1 << 20)).into_bytes(),
    ] {
        for _ in 0..8 {
            let mut stream = TcpStream::connect(address).expect("a connection");
            let _ = stream.write_all(&bytes);
            let _ = stream.shutdown(Shutdown::Write);
            let mut answer = Vec::new();
            let _ = stream.take(1 << 16).read_to_end(&mut answer);
            assert!(!String::from_utf8_lossy(&answer).contains("hilare_ticks_total"));
        }
        assert!(fine(), "after {:?}", &bytes[..bytes.len().min(40)]);
    }
    // Readers who ask and do not read.
    for _ in 0..100 {
        let mut stream = TcpStream::connect(address).expect("a connection");
        let _ = stream.write_all(format!("{head}Host: localhost\r\n\r\n").as_bytes());
        slow.push(stream);
    }
    assert!(fine(), "beside 100 who do not read");
    let after_kb = resident_kb();
    assert!(after_kb < before_kb + 16_384, "{before_kb} kB, then {after_kb} kB");
    drop(slow);

    // Nothing of this has come near the robot.
    let now = lab.status(&robot).expect("up");
    assert_eq!(pid_of(&now, "operator"), page, "it is the same process");
    assert_eq!((text(&now, "mode"), &now["fault"]), ("armed", &Value::Null));
    assert!(number(&now, "tick") > number(&status, "tick"));
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("hostile visitors");
}

#[test]
fn a_page_that_dies_comes_back_and_nothing_else_happens() {
    let lab = Lab::new();
    let (robot, address) =
        up(&lab, &["--set", "supervision.restart_budget=2", "--set", "supervision.restart_window_s=3600"]);
    drive(&lab, &robot);
    let before = lab.status(&robot).expect("up");
    for kill in 1..=2 {
        support::process::signal(pid_of(&lab.status(&robot).expect("up"), "operator"), Signal::KILL);
        wait_until("the page is back", || get(address, "/metrics", "*/*").contains("hilare_ticks_total"));
        let body = scrape(address, "*/*");
        assert_eq!(sample(&body, "hilare_process_restarts_total", &["role=\"operator\""]), f64::from(kill));
    }
    let operator = |status: &Value| -> Value {
        let processes = status["processes"].as_array().expect("processes");
        processes.iter().find(|one| one["name"] == "operator").expect("a page").clone()
    };
    // Beyond its budget it is given up, and the robot drives on.
    support::process::signal(pid_of(&lab.status(&robot).expect("up"), "operator"), Signal::KILL);
    let after = lab.await_status(&robot, "it is given up", |status| operator(status)["state"] == "dead");
    assert_eq!((text(&after, "mode"), &after["fault"]), ("armed", &Value::Null));
    let ticks = number(&after, "tick");
    let after = lab.await_status(&robot, "it drives on", |status| number(status, "tick") > ticks + 300.0);
    assert_eq!(operator(&after)["state"], "dead");
    let of = |status: &Value, name: &str| pid_of(status, name);
    for name in ["controller", "step_generator", "pose_estimator", "relay", "planner"] {
        assert_eq!(of(&before, name), of(&after, name), "{name} is the same process");
    }
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("a page that died");
}

/// One complaint of one line, exit code 2.
fn refused(ended: Ended) -> String {
    let ended = ended.expect_code(2);
    assert_eq!(ended.complaints().len(), 1, "{}", ended.stderr);
    ended.stderr
}

#[test]
fn addresses_that_cannot_be_are_refused_before_anything_moves() {
    let lab = Lab::new();
    let robot = lab.robot();
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("its address").to_string();
    let holder = format!("(pid {}) has this port", std::process::id());
    for (listen, said) in [
        (&*port, &*holder),
        ("127.0.0.1:0", "--listen 127.0.0.1:0: operator.listen: 127.0.0.1:0: nobody would know the port"),
        ("127.0.0.1", "no address with a port"),
        ("robot.example:7070", "no address with a port"),
    ] {
        for detach in [&[][..], &["--detach"]] {
            let args = [&["up", "--robot", &robot, "--listen", listen], detach].concat();
            let why = refused(lab.hilare(&args));
            assert!(why.contains(said), "{listen}: {why}");
        }
        let why = refused(lab.hilare(&[
            "run",
            "rectangle",
            "--robot",
            &robot,
            "--listen",
            listen,
            "--out",
            "report",
        ]));
        assert!(why.contains(said), "{listen}: {why}");
        assert!(!lab.dir().join("report").exists(), "a run that never began leaves nothing");
    }
    let why =
        refused(lab.hilare(&["run", "rectangle", "--clock", "in-process", "--listen", "127.0.0.1:7070"]));
    assert!(why.contains("the page is a process"), "{why}");
    let file = lab.file("bad.toml", "robot = \"mule\"\n\n[operator]\nlisten = \"7070\"\n");
    let why = refused(lab.hilare(&["up", &file.to_string_lossy()]));
    assert!(why.contains("bad.toml:4: operator.listen: \"7070\" is no address with a port"), "{why}");
    lab.assert_nothing_left("addresses that cannot be");
}

#[test]
fn without_an_address_there_is_no_page_and_a_run_has_one_until_it_ends() {
    let lab = Lab::new();
    let robot = lab.robot();
    lab.hilare(&["up", "--detach", "--robot", &robot]).expect_code(0);
    let status = lab.status(&robot).expect("up");
    let processes = status["processes"].as_array().expect("processes");
    assert!(processes.iter().all(|one| one["name"] != "operator"), "{status}");
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);

    let address = free_port();
    let (path, listen) = (lab.straight(0.4), address.to_string());
    let run = lab.start(&[
        "run",
        "--path",
        &path.to_string_lossy(),
        "--robot",
        &robot,
        "--listen",
        &listen,
        "--out",
        "report",
    ]);
    let mut body = String::new();
    wait_until("the page of a run", || {
        body = get(address, "/metrics", "*/*");
        body.contains("hilare_path_tracking 1")
    });
    assert_eq!(sample(&body, "hilare_process_up", &["role=\"recorder\""]), 1.0);
    // On a busy machine the recorder may lose ticks, which ends a run with another code.
    let ended = run.wait(PATIENCE);
    assert!(ended.stdout.contains("ARRIVED"), "{ended:?}");
    assert_eq!(get(address, "/metrics", "*/*"), "", "nobody is there any more");
    lab.assert_nothing_left("a run with a page");
}
