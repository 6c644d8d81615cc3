//! The operator's page in Chromium, before robots in real processes: what `tests/browser/*.mjs` state is so.
//!
//! `HILARE_PICTURES=DIR` keeps screenshots there.

mod support;

use rustix::process::Signal;
use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::time::Duration;
use support::web_socket::{self, frame};
use support::{Lab, PATIENCE, number, pid_of, text, wait_until};
use tempfile::TempDir;

/// Time a scenario may take; the longest drives a minute.
const SCENARIO: Duration = Duration::from_secs(240);

/// A browser with its driver, and the scenarios where they find it.
struct Browser {
    chromium: PathBuf,
    scenarios: TempDir,
}

impl Browser {
    /// What tests/run installs, if it is there; without it `test` is skipped.
    fn find(test: &str) -> Option<Self> {
        let on_path = |name: &str| {
            std::env::split_paths(&std::env::var_os("PATH")?)
                .map(|dir| dir.join(name))
                .find(|file| file.is_file())
        };
        let target =
            Path::new(env!("CARGO_BIN_EXE_hilare")).ancestors().nth(2).expect("target/PROFILE/hilare");
        let home = target.join("browser");
        let chromium = std::env::var_os("HILARE_CHROMIUM").map(PathBuf::from);
        let chromium = chromium.or_else(|| ["chromium", "chromium-browser"].into_iter().find_map(on_path));
        let driver = home.join("node_modules/playwright-core").is_dir();
        let (Some(chromium), Some(_), true) = (chromium, on_path("node"), driver) else {
            support::skip(
                test,
                &format!("no chromium, node or {} (tests/run installs them)", home.display()),
            );
            return None;
        };
        // Modules are looked for above the file that wants them.
        let scenarios = tempfile::Builder::new().prefix("scenarios-").tempdir_in(&home).expect("a directory");
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser");
        for file in fs::read_dir(from).expect("tests/browser").flatten() {
            if file.path().extension().is_some_and(|extension| extension == "mjs" || extension == "json") {
                fs::copy(file.path(), scenarios.path().join(file.file_name())).expect("a copy");
            }
        }
        Some(Self { chromium, scenarios })
    }

    /// Runs a scenario on a robot's page.
    fn run(&self, lab: &Lab, robot: &str, url: &str, scenario: &str, more: &[(&str, &str)]) {
        let mut command = lab.command_of("node");
        command.arg(self.scenarios.path().join(format!("{scenario}.mjs")));
        command.env("HILARE_PAGE", url).env("HILARE_BIN", env!("CARGO_BIN_EXE_hilare"));
        command.env("HILARE_TEST_ROBOT", robot).env("HILARE_CHROMIUM", &self.chromium);
        let so = Path::new(env!("CARGO_MANIFEST_DIR")).join("launch/scenarios/so.csv");
        command.env("HILARE_SO", so).env("HOME", lab.dir()).envs(more.iter().copied());
        let ended = support::Running::start(command).wait(SCENARIO);
        print!("{}", ended.stdout);
        assert_eq!(ended.code, Some(0), "{scenario}: {}{}", ended.stdout, ended.stderr);
    }
}

/// A port that nobody has at present.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("its address").port()
}

/// Brings a robot up with a page: its name and the page's address.
fn up(lab: &Lab, more: &[&str]) -> (String, String) {
    let robot = lab.robot();
    let listen = format!("127.0.0.1:{}", free_port());
    let args = [&["up", "--detach", "--robot", &robot, "--listen", &listen], more].concat();
    let ended = lab.hilare(&args).expect_code(0);
    let url = format!("http://{listen}/");
    assert!(ended.stdout.contains(&format!(", page {url};")), "{}", ended.stdout);
    (robot, url)
}

/// Brings a robot up whose page is open to other machines: its name and the page's address here, with its token.
fn up_for_others(lab: &Lab) -> (String, String) {
    let (robot, port) = (lab.robot(), free_port());
    let listen = format!("0.0.0.0:{port}");
    let ended = lab.hilare(&["up", "--detach", "--robot", &robot, "--listen", &listen]).expect_code(0);
    let (_, token) = ended.stdout.split_once("?token=").expect("an address with a token");
    let token: String = token.chars().take_while(char::is_ascii_hexdigit).collect();
    assert_eq!(token.len(), 32, "{}", ended.stdout);
    (robot, format!("http://127.0.0.1:{port}/?token={token}"))
}

fn down(lab: &Lab, robot: &str) {
    lab.hilare(&["down", "--robot", robot]).expect_code(0);
    lab.assert_nothing_left("a page in a browser");
}

#[test]
fn so_is_drawn_with_the_mouse_driven_and_arrived_at() {
    let test = "so_is_drawn_with_the_mouse_driven_and_arrived_at";
    let Some(browser) = Browser::find(test) else { return };
    if support::quick(test) {
        return;
    }
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &["--set", "start.x_m=0.2", "--set", "start.y_m=0.2"]);
    browser.run(&lab, &robot, &url, "draw_so", &[]);
    down(&lab, &robot);
}

#[test]
fn waypoints_are_dragged_and_the_page_is_read_by_everybody() {
    let Some(browser) = Browser::find("waypoints_are_dragged_and_the_page_is_read_by_everybody") else {
        return;
    };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) =
        up(&lab, &["--set", "planner.map=platform", "--set", "start.x_m=0.2", "--set", "start.y_m=0.2"]);
    browser.run(&lab, &robot, &url, "drag", &[]);
    browser.run(&lab, &robot, &url, "access", &[]);
    down(&lab, &robot);
}

/// A map of cells in a YAML file and a PGM, turned against the world: a wall to be driven around, marks in two
/// corners, a cell nobody knows. Its start is four and a half cells to the right and up.
fn map_of_cells(lab: &Lab) -> (String, [String; 2]) {
    const ROWS: [&str; 9] = [
        "#..........?",
        "............",
        "......#.....",
        "......#.....",
        "......#.....",
        "......#.....",
        "......#.....",
        "......#.....",
        "##....#.....",
    ];
    let (cell_m, [x_m, y_m, yaw_rad]) = (0.05, [-0.2, 0.1, 0.3_f64]);
    let shades: Vec<&str> = ROWS
        .iter()
        .flat_map(|row| row.chars())
        .map(|cell| match cell {
            '#' => "0",
            '?' => "205",
            _ => "254",
        })
        .collect();
    let picture = format!("P2 {} {} 255\n{}\n", ROWS[0].len(), ROWS.len(), shades.join(" "));
    fs::write(lab.dir().join("cells.pgm"), picture).expect("a picture");
    let file = lab.dir().join("cells.yaml");
    let yaml = format!(
        "image: cells.pgm\nresolution: {cell_m}\norigin: [{x_m}, {y_m}, {yaw_rad}]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    );
    fs::write(&file, yaml).expect("a map");
    let (along_m, (sin, cos)) = (4.5 * cell_m, yaw_rad.sin_cos());
    let start = [("x", x_m + along_m * (cos - sin)), ("y", y_m + along_m * (sin + cos))];
    (file.to_string_lossy().into_owned(), start.map(|(axis, at_m)| format!("start.{axis}_m={at_m}")))
}

#[test]
fn a_map_of_cells_is_where_it_is_and_goals_are_driven_to_around_its_walls() {
    let test = "a_map_of_cells_is_where_it_is_and_goals_are_driven_to_around_its_walls";
    let Some(browser) = Browser::find(test) else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (map, [x, y]) = map_of_cells(&lab);
    let (robot, url) = up(&lab, &["--set", &format!("planner.map={map}"), "--set", &x, "--set", &y]);
    browser.run(&lab, &robot, &url, "map", &[("HILARE_MAP", &map)]);
    down(&lab, &robot);
}

#[test]
fn a_click_on_stop_stops_it_within_a_tenth_of_a_second() {
    let Some(browser) = Browser::find("a_click_on_stop_stops_it_within_a_tenth_of_a_second") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &[]);
    browser.run(&lab, &robot, &url, "stop", &[]);
    down(&lab, &robot);
}

#[test]
fn a_stop_that_meets_a_page_that_hangs_is_not_forgotten() {
    let Some(browser) = Browser::find("a_stop_that_meets_a_page_that_hangs_is_not_forgotten") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &[]);
    browser.run(&lab, &robot, &url, "hung", &[]);
    down(&lab, &robot);
}

#[test]
fn in_mid_drive_laws_are_swapped_and_pages_loaded_anew_and_lost() {
    let Some(browser) = Browser::find("in_mid_drive_laws_are_swapped_and_pages_loaded_anew_and_lost") else {
        return;
    };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &[]);
    browser.run(&lab, &robot, &url, "swap", &[]);
    browser.run(&lab, &robot, &url, "lost", &[]);
    down(&lab, &robot);
}

#[test]
fn robots_come_and_go_under_an_open_page() {
    let Some(browser) = Browser::find("robots_come_and_go_under_an_open_page") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &[]);
    browser.run(&lab, &robot, &url, "again", &[]);
    wait_until("it has ended", || lab.processes().is_empty());
    lab.assert_nothing_left("robots that came and went");
}

#[test]
fn a_page_without_the_token_says_so_and_what_to_do() {
    let Some(browser) = Browser::find("a_page_without_the_token_says_so_and_what_to_do") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up_for_others(&lab);
    browser.run(&lab, &robot, &url, "token", &[]);
    down(&lab, &robot);
}

#[test]
fn faults_are_shown_with_their_reason() {
    let Some(browser) = Browser::find("faults_are_shown_with_their_reason") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let set = |key: &'static str| ["--set", key];
    let more = [set("supervision.resume_by_operator=true"), set("supervision.restart_budget=1")].concat();
    let (robot, url) = up(&lab, &more);
    browser.run(&lab, &robot, &url, "fault", &[]);
    wait_until("it has ended", || lab.processes().is_empty());
}

/// A WebSocket of a page, or what it was answered.
fn socket(url: &str, headers: &str) -> Result<TcpStream, String> {
    let address = url.strip_prefix("http://").and_then(|rest| rest.split_once('/')).expect("an address").0;
    web_socket::open(address, "/ws", headers)
}

/// Waits until the page tells what is wanted.
fn hear(stream: &mut TcpStream, wanted: &str) {
    let (mut heard, mut chunk) = (Vec::<u8>::new(), vec![0; 1 << 16]);
    while !heard.windows(wanted.len()).any(|part| part == wanted.as_bytes()) {
        let read = stream.read(&mut chunk).unwrap_or(0);
        assert!(read > 0, "the end instead of {wanted}");
        let keep = heard.len().saturating_sub(wanted.len());
        heard.drain(..keep);
        heard.extend(&chunk[..read]);
    }
}

#[test]
fn hostile_pages_cost_neither_memory_nor_a_tick_nor_a_stop() {
    let lab = Lab::new();
    let (robot, url) = up(&lab, &[]);
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    lab.hilare(&["follow", &lab.straight(3.0).to_string_lossy(), "--robot", &robot]).expect_code(0);
    let status = lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.03);
    let page = pid_of(&status, "operator");
    let resident_kb = || {
        let status = fs::read_to_string(format!("/proc/{page}/status")).expect("the page lives");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
        line.trim_end_matches("kB").trim().parse::<u64>().expect("kB")
    };
    let refused = socket(&url, "Origin: http://evil.example\r\n").expect_err("another site");
    assert!(refused.starts_with("HTTP/1.1 403 "), "{refused}");
    let before_kb = resident_kb();
    let garbage = frame(0x81, &vec![b'['; 1 << 20]);
    let flood: Vec<u8> = (0..400)
        .flat_map(|id| {
            frame(
                0x81,
                format!("{{\"id\":{id},\"do\":\"predict\",\"waypoints\":[[0,0,0,0],[9,0,0,0]]}}").as_bytes(),
            )
        })
        .collect();
    let mut crowd = Vec::new();
    for n in 0..100 {
        let mut stream = socket(&url, "").expect("a WebSocket");
        let _ = match n % 4 {
            0 => stream.write_all(&garbage),
            1 => stream.write_all(&frame(0x82, &garbage)),
            2 => stream.write_all(&flood),
            _ => stream.write_all(&garbage[..garbage.len() / 2]),
        };
        crowd.push(stream);
    }
    let most_kb = resident_kb();
    assert!(most_kb < before_kb + 65_536, "{before_kb} kB, then {most_kb} kB");
    // Nothing of it has come near the robot, and a page that means well stops it.
    let now = lab.status(&robot).expect("up");
    assert_eq!((pid_of(&now, "operator"), text(&now, "mode")), (page, "armed"));
    assert!(now["fault"].is_null() && number(&now, "tick") > number(&status, "tick"), "{now}");
    let mut good = socket(&url, "").expect("a WebSocket");
    good.write_all(&frame(0x81, b"{\"id\":7,\"do\":\"stop\"}")).expect("it is taken");
    hear(&mut good, "\"id\":7,\"message\":\"stopping");
    lab.await_status(&robot, "it has stopped", |status| text(status, "mode") == "stop");
    // Who is not listened to any more is told why, in the middle of it.
    let _ = good.write_all(&frame(0x81, &vec![b'['; 5 << 20]));
    hear(&mut good, "a message has at most 4194304 bytes");
    drop(crowd);
    down(&lab, &robot);
}

#[test]
fn a_page_comes_back_with_its_robot_and_a_page_that_is_lost_stops_one_that_wants_it() {
    let lab = Lab::new();
    let (robot, url) = up(&lab, &["--set", "operator.on_lost=stop"]);
    let mut stream = socket(&url, "").expect("a WebSocket");
    hear(&mut stream, "\"type\":\"hello\"");
    stream.write_all(&frame(0x81, b"{\"id\":1,\"do\":\"arm\"}")).expect("it is taken");
    hear(&mut stream, "\"id\":1,\"message\":\"armed");
    hear(&mut stream, "\"mode\":\"armed\"");
    // A relay that starts again is joined again.
    support::process::signal(pid_of(&lab.status(&robot).expect("up"), "relay"), Signal::KILL);
    hear(&mut stream, "relay was killed");
    hear(&mut stream, "\"type\":\"state\"");
    drop(stream);
    lab.await_status(&robot, "its last page is lost", |status| text(status, "mode") == "stop");
    // One that goes down says so to whoever looks.
    let mut stream = socket(&url, "").expect("a WebSocket");
    hear(&mut stream, "\"type\":\"log\"");
    let ended = lab.start(&["down", "--robot", &robot]);
    hear(&mut stream, "\"gone\":true");
    ended.wait(PATIENCE).expect_code(0);
    lab.assert_nothing_left("a robot that went down before its page");
}

#[test]
fn from_another_machine_nobody_speaks_to_the_robot_without_its_token() {
    let lab = Lab::new();
    let (robot, address) = up_for_others(&lab);
    let (url, token) = address.split_once("?token=").expect("an address with a token");
    let status = lab.status(&robot).expect("up");
    let shown = address.strip_prefix("http://127.0.0.1").expect("of this machine");
    assert!(text(&status, "page").ends_with(shown), "{status}");
    assert!(socket(url, "").expect_err("no token").starts_with("HTTP/1.1 401 "));
    assert!(socket(url, "Authorization: Bearer 0123456789abcdef0123456789abcdef\r\n").is_err());
    socket(url, &format!("Authorization: Bearer {token}\r\n")).expect("a WebSocket");
    // It stands in no log, and in no file that others can read.
    let log = fs::read_to_string(lab.runtime_dir().join(format!("{robot}.log"))).expect("a log");
    assert!(log.contains("the page is at") && !log.contains(token), "{log}");
    down(&lab, &robot);
}
