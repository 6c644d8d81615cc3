//! The live view for Foxglove and Lichtblick, before robots in real processes: an independent client sees what the robot
//! says and what is recorded; hostile ones cost nothing; nobody gets in who should not.

mod support;

use rustix::process::Signal;
use serde_json::{Value, json};
use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use support::process::Ended;
use support::web_socket::{self, frame};
use support::{Lab, PATIENCE, Running, number, pid_of, python_with, text, wait_until};

/// A port that nobody has at present.
fn free_address() -> String {
    TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("its address").to_string()
}

/// Brings a robot up with a live view: its name and the view's address.
fn up(lab: &Lab, more: &[&str]) -> (String, String) {
    let (robot, address) = (lab.robot(), free_address());
    let args = [&["up", "--detach", "--robot", &robot, "--foxglove", &address], more].concat();
    let ended = lab.hilare(&args).expect_code(0);
    assert!(ended.stdout.contains(&format!(", foxglove ws://{address}/;")), "{}", ended.stdout);
    (robot, address)
}

fn down(lab: &Lab, robot: &str) {
    lab.hilare(&["down", "--robot", robot]).expect_code(0);
    lab.assert_nothing_left("a live view");
}

/// Python with all that tests/python/foxglove_client.py needs.
fn client(test: &str) -> Option<PathBuf> {
    python_with(test, "mcap_ros2, rosbags, websockets")
}

fn start(lab: &Lab, python: &Path, args: &[&str]) -> Running {
    let mut command = lab.command_of(python);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/foxglove_client.py")).args(args);
    Running::start(command)
}

fn answer(ended: Ended) -> Value {
    let ended = ended.expect_code(0);
    serde_json::from_str(&ended.stdout).expect("JSON")
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|number| number.as_f64().expect("a number")).collect()
}

fn assert_near(one: &[f64], other: &[f64], tolerance: f64) {
    let near = one.iter().zip(other).all(|(a, b)| (a - b).abs() <= tolerance);
    assert!(one.len() == other.len() && near, "{one:?} is not {other:?}");
}

#[test]
fn who_comes_late_sees_where_the_robot_is_and_its_path_and_again_after_the_process_was_killed() {
    let Some(python) = client("who_comes_late_sees_where_the_robot_is_and_its_path") else { return };
    let lab = Lab::new();
    // A wall above the path, and nothing else.
    let map = r#"{"width_m": 1.0, "height_m": 0.5, "boxes_m": [[0.0, 0.3, 1.0, 0.5]]}"#;
    let map = format!("planner.map={}", lab.file("wall.json", map).display());
    let (robot, address) = up(&lab, &["--set", &map]);
    let path = lab.file("corner.csv", "x,y\n0,0\n0.15,0\n0.15,0.1\n");
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    lab.hilare(&["follow", &path.to_string_lossy(), "--robot", &robot]).expect_code(0);
    lab.await_status(&robot, "it has arrived", |status| text(status, "path_state") == "arrived");
    // Disarmed it stays where it is.
    lab.hilare(&["stop", "--robot", &robot]).expect_code(0);
    let status = lab.await_status(&robot, "it stands", |status| {
        number(status, "speed_mps") == 0.0 && number(status, "omega_radps") == 0.0
    });
    assert_eq!(text(&status, "foxglove"), format!("ws://{address}/"));
    let told = lab.hilare(&["status", "--robot", &robot]).expect_code(0);
    assert!(told.stdout.contains(&format!("  foxglove  ws://{address}/\n")), "{}", told.stdout);

    let url = format!("ws://{address}/");
    let look = || answer(start(&lab, &python, &["look", &url]).wait(2 * PATIENCE));
    let agrees = |seen: &Value| {
        assert_eq!(text(seen, "name"), format!("hilare {robot}"));
        assert_near(&list(&seen["odom"]), &list(&status["pose"]), 1e-9);
        assert_near(&list(&seen["twist"]), &[0.0; 3], 0.0);
        assert_eq!(seen["frames"], json!([["map", "odom"], ["odom", "base_link"]]));
        assert_eq!(seen["odom_frames"], json!(["odom", "base_link"]));
        assert_eq!((text(seen, "path_frame"), text(seen, "reference_frame")), ("map", "map"));
        assert_eq!(seen["path"], json!([[0.0, 0.0], [0.15, 0.0], [0.15, 0.1]]));
        // Of the map's half square metre the wall has two fifths, all of it above y = 0.3.
        assert_near(&list(&seen["map_m"]), &[0.0, 0.0, 1.0, 0.5], 1e-6);
        assert_near(&[number(seen, "occupied_m2")], &[0.2], 0.01);
        assert!((number(seen, "occupied_from_m") - 0.3).abs() < 0.01, "{seen}");
        assert_eq!((text(seen, "footprint_frame"), number(seen, "footprint_m")), ("base_link", 0.037));
        // From the last line, x = 0.15, whose left is at smaller x.
        let aside_m = 0.15 - list(&status["pose"])[0];
        assert_near(&[number(seen, "cross_track_error")], &[aside_m], 1e-9);
    };
    let seen = look();
    agrees(&seen);
    let topics = seen["topics"].as_array().expect("topics");
    for topic in ["/odom", "/tf", "/path", "/cmd_vel", "/diagnostics", "/ground_truth", "/hilare/command"] {
        assert!(topics.contains(&topic.into()), "{topic} is not in {topics:?}");
    }
    // A successor binds the same port, and its viewers are told that it is one.
    let pid = pid_of(&status, "operator");
    support::process::signal(pid, Signal::KILL);
    lab.await_status(&robot, "it is there again", |status| {
        let again =
            status["processes"].as_array().and_then(|all| all.iter().find(|one| one["name"] == "operator"));
        again.is_some_and(|one| one["restarts"] == 1 && one["pid"].as_i64().is_some_and(|new| new > 0))
    });
    let again = look();
    agrees(&again);
    assert_ne!(again["session"], seen["session"]);
    down(&lab, &robot);
}

#[test]
fn what_is_seen_of_a_run_is_what_is_recorded_of_it() {
    let Some(python) = client("what_is_seen_of_a_run_is_what_is_recorded_of_it") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, address, out) = (lab.robot(), free_address(), lab.dir().join("report"));
    let path = lab.file("corner.csv", "x,y\n0,0\n0.15,0\n0.15,0.1\n");
    let (path, dir) = (path.to_string_lossy().into_owned(), out.to_string_lossy().into_owned());
    let follow = start(&lab, &python, &["follow", &format!("ws://{address}/"), &dir]);
    let args = ["run", "--path", &path, "--robot", &robot, "--foxglove", &address, "--out", &dir];
    let ended = lab.start(&args).wait(2 * PATIENCE).expect_code(0);
    assert!(ended.stdout.contains(&format!("foxglove: ws://{address}/\n")), "{}", ended.stdout);
    let seen = answer(follow.wait(2 * PATIENCE));
    let summary = lab.summary(&out);
    // The drive takes 6 s, 25 messages a second: a good part of them has come, none nearer than 40 ticks to the next.
    for topic in ["/hilare/pose", "/hilare/steps", "/hilare/truth", "/hilare/reference"] {
        assert!(number(&seen["compared"], topic) > 50.0, "{seen}");
    }
    assert!(number(&seen, "least_ticks_between") >= 40.0, "{seen}");
    // At 40 mm/s it has moved 3 mm since the last message, and turned no more than it may.
    let end = &summary["final_pose"];
    let end = [number(end, "x_m"), number(end, "y_m"), number(end, "theta_rad")];
    let last = list(&seen["last"]);
    assert!(number(&summary, "ticks") - number(&seen, "last_tick") < 1000.0, "{seen}");
    assert_near(&last[..2], &end[..2], 0.05);
    let most_m = number(&summary, "cross_track_max_m");
    assert!(number(&seen, "cross_track_error_max_m") <= most_m + 0.02, "{seen} {most_m}");
    lab.assert_nothing_left("a run with a live view");
}

/// A WebSocket of a viewer, or what it was answered.
fn socket(address: &str, headers: &str) -> Result<TcpStream, String> {
    let protocols = "Sec-WebSocket-Protocol: foxglove.websocket.v1, foxglove.sdk.v1\r\n";
    web_socket::open(address, "/", &format!("{protocols}{headers}"))
}

/// Subscribes to the first channels.
fn subscribe(channels: u32) -> Vec<u8> {
    let all: Vec<Value> = (0..channels).map(|id| json!({ "id": id, "channelId": id })).collect();
    frame(0x81, json!({ "op": "subscribe", "subscriptions": all }).to_string().as_bytes())
}

/// Waits until the server says what is wanted.
fn hear(stream: &mut TcpStream, wanted: &[u8]) {
    let (mut heard, mut chunk) = (Vec::<u8>::new(), vec![0; 1 << 16]);
    while !heard.windows(wanted.len()).any(|part| part == wanted) {
        let read = stream.read(&mut chunk).unwrap_or(0);
        assert!(read > 0, "the end instead of {wanted:?}");
        let keep = heard.len().saturating_sub(wanted.len());
        heard.drain(..keep);
        heard.extend(&chunk[..read]);
    }
}

#[test]
fn hostile_viewers_cost_neither_memory_nor_the_page_nor_a_tick() {
    let lab = Lab::new();
    let listen = free_address();
    let (robot, address) = up(&lab, &["--listen", &listen]);
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    lab.hilare(&["follow", &lab.straight(3.0).to_string_lossy(), "--robot", &robot]).expect_code(0);
    let status = lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.03);
    let process = pid_of(&status, "operator");
    let resident_kb = || {
        let status = fs::read_to_string(format!("/proc/{process}/status")).expect("it lives");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
        line.trim_end_matches("kB").trim().parse::<u64>().expect("kB")
    };
    for headers in ["Origin: http://evil.example\r\n", "Origin: null\r\n"] {
        let refused = socket(&address, headers).expect_err("another site");
        assert!(refused.starts_with("HTTP/1.1 403 "), "{refused}");
    }
    drop(socket(&address, "Origin: https://app.foxglove.dev\r\n").expect("Foxglove's own page"));
    let before_kb = resident_kb();
    let garbage = vec![b'['; 1 << 20];
    let words: Vec<u8> = (0..5000).flat_map(|_| frame(0x81, b"garbage")).collect();
    let silent: Vec<TcpStream> =
        (0..50).map(|_| TcpStream::connect(&address).expect("a connection")).collect();
    let mut crowd = Vec::new();
    for n in 0..50 {
        let mut stream = socket(&address, "").expect("a WebSocket");
        // Nobody of them ever reads.
        let _ = match n % 5 {
            0 => stream.write_all(&subscribe(32)),
            1 => stream.write_all(&frame(0x81, &garbage)),
            2 => stream.write_all(&words),
            // Not final: the rest never comes.
            3 => stream.write_all(&frame(0x01, &garbage)),
            _ => stream.write_all(&frame(0x82, &garbage[..1000])),
        };
        crowd.push(stream);
    }
    let most_kb = resident_kb();
    assert!(most_kb < before_kb + 32_768, "{before_kb} kB, then {most_kb} kB");
    // Who means well gets in, is answered and told the pose.
    let mut good = socket(&address, "").expect("a WebSocket");
    good.write_all(&frame(0x81, b"{\"op\":\"setParameters\",\"parameters\":[]}")).expect("it is taken");
    hear(&mut good, b"setParameters: this is a view to look at");
    good.write_all(&subscribe(32)).expect("it is taken");
    hear(&mut good, b"base_link");
    let _ = good.write_all(&frame(0x81, &vec![b'['; 20 << 20]));
    // A close frame begins with its code, 1009.
    hear(&mut good, b"\x03\xf1a message has at most 65536 bytes");
    // Page, process and robot are as they were.
    let mut page = TcpStream::connect(&listen).expect("the page");
    page.write_all(format!("GET /metrics HTTP/1.1\r\nHost: {listen}\r\n\r\n").as_bytes())
        .expect("it is taken");
    let mut metrics = String::new();
    page.set_read_timeout(Some(PATIENCE)).expect("a time-out");
    page.read_to_string(&mut metrics).expect("an answer");
    assert!(metrics.starts_with("HTTP/1.1 200 "), "{metrics}");
    let now = lab.status(&robot).expect("up");
    assert_eq!((pid_of(&now, "operator"), text(&now, "mode")), (process, "armed"));
    assert!(now["fault"].is_null() && number(&now, "tick") > number(&status, "tick"), "{now}");
    // The log says whose page was refused, and what to do; of each once.
    let log = fs::read_to_string(lab.runtime_dir().join(format!("{robot}.log"))).expect("a log");
    let told =
        |origin: &str| log.lines().filter(|line| line.contains(&format!("page of \"{origin}\" "))).count();
    assert_eq!((told("http://evil.example"), told("null")), (1, 1), "{log}");
    drop((crowd, silent));
    down(&lab, &robot);
}

/// What it says, in one line, to whoever wanted what cannot be.
fn refused(ended: Ended) -> String {
    let ended = ended.expect_code(2);
    assert_eq!(ended.stderr.trim_end().lines().count(), 1, "{}", ended.stderr);
    ended.stderr
}

#[test]
fn addresses_where_it_cannot_be_are_refused_before_anything_moves() {
    let lab = Lab::new();
    let robot = lab.robot();
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("its address").to_string();
    let holder = format!("operator.foxglove {port}: ");
    let pid = format!("(pid {}) has this port", std::process::id());
    let open = "listen on 127.0.0.1:8765, and from elsewhere come by ssh -L 8765:127.0.0.1:8765 ROBOT";
    for (address, said) in [
        (&*port, [&*holder, &*pid]),
        (
            "0.0.0.0:8765",
            ["--foxglove 0.0.0.0:8765: operator.foxglove: 0.0.0.0:8765: others would reach it", open],
        ),
        ("[::]:8765", ["operator.foxglove: [::]:8765: others would reach it", open]),
        ("192.168.1.2:8765", ["its protocol knows no password", open]),
        ("127.0.0.1", ["no address with a port", "write 127.0.0.1:8765"]),
        ("127.0.0.1:0", ["nobody would know the port", "for example 127.0.0.1:8765"]),
    ] {
        for detach in [&[][..], &["--detach"]] {
            let args = [&["up", "--robot", &robot, "--foxglove", address], detach].concat();
            let why = refused(lab.hilare(&args));
            assert!(said.iter().all(|part| why.contains(part)), "{address}: {why}");
        }
        let args = ["run", "rectangle", "--robot", &robot, "--foxglove", address, "--out", "report"];
        let why = refused(lab.hilare(&args));
        assert!(said.iter().all(|part| why.contains(part)), "{address}: {why}");
        let why = refused(lab.hilare(&[
            "demo",
            "--port",
            "0",
            "--robot",
            &robot,
            "--foxglove",
            address,
            "--out",
            "report",
        ]));
        assert!(said.iter().all(|part| why.contains(part)), "{address}: {why}");
        assert!(!lab.dir().join("report").exists(), "a run that never began leaves nothing");
    }
    let why =
        refused(lab.hilare(&["run", "rectangle", "--clock", "in-process", "--foxglove", "127.0.0.1:8765"]));
    assert!(why.contains("--foxglove: the live view is a process"), "{why}");
    for (section, said) in [
        (
            "foxglove = \"10.0.0.1:8765\"",
            "bad.toml:4: operator.foxglove: 10.0.0.1:8765: others would reach it",
        ),
        (
            "listen = \"0.0.0.0:8765\"\nfoxglove = \"127.0.0.1:8765\"",
            "operator.listen and operator.foxglove are both port 8765; give the live view another one",
        ),
        (
            "foxglove_origins = \"http://localhost:8080/lichtblick\"",
            "operator.foxglove_origins: \"http://localhost:8080/lichtblick\" is no origin; write scheme and host",
        ),
        ("foxglove_origins = \"*\"", "is no origin"),
    ] {
        let file = lab.file("bad.toml", format!("robot = \"mule\"\n\n[operator]\n{section}\n"));
        let why = refused(lab.hilare(&["up", &file.to_string_lossy()]));
        assert!(why.contains(said), "{section}: {why}");
    }
    lab.assert_nothing_left("addresses that cannot be");
}

/// How many ports the processes of a laboratory listen on.
fn ports(lab: &Lab) -> usize {
    let listening: Vec<String> = ["/proc/net/tcp", "/proc/net/tcp6"]
        .iter()
        .flat_map(|table| {
            let table = fs::read_to_string(table).unwrap_or_default();
            let inode = |line: &str| {
                let fields: Vec<&str> = line.split_whitespace().collect();
                (fields.get(3) == Some(&"0A")).then(|| format!("socket:[{}]", fields[9]))
            };
            table.lines().filter_map(inode).collect::<Vec<_>>()
        })
        .collect();
    let files = lab.processes().into_iter().flat_map(|(pid, _)| {
        fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten().map(|file| file.path())
    });
    files
        .filter_map(|file| fs::read_link(file).ok())
        .filter(|target| listening.iter().any(|socket| target.as_os_str() == &**socket))
        .count()
}

#[test]
fn there_is_a_port_only_where_one_is_asked_for() {
    let lab = Lab::new();
    let (view, page) = (free_address(), free_address());
    for (more, expected) in [
        (vec![], 0),
        (vec!["--listen", &*page], 1),
        (vec!["--foxglove", &*view], 1),
        (vec!["--foxglove", &*view, "--listen", &*page], 2),
    ] {
        let robot = lab.robot();
        let args = [&["up", "--detach", "--robot", &robot], &more[..]].concat();
        lab.hilare(&args).expect_code(0);
        let status = lab.status(&robot).expect("up");
        let is_view = more.contains(&"--foxglove");
        assert_eq!(status.get("foxglove").is_some(), is_view, "{status}");
        wait_until("the ports are open", || ports(&lab) == expected);
        if is_view {
            drop(socket(&view, "").expect("a WebSocket"));
            // The page is no part of it.
            let mut stream = TcpStream::connect(&view).expect("a connection");
            stream
                .write_all(format!("POST /api/stop HTTP/1.1\r\nHost: {view}\r\n\r\n").as_bytes())
                .expect("taken");
            let mut answer = String::new();
            stream.read_to_string(&mut answer).expect("an answer");
            assert!(answer.starts_with("HTTP/1.1 426 "), "{answer}");
        }
        down(&lab, &robot);
    }
}
