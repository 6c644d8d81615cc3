//! The operator's page in Chromium, before robots in real processes: what `tests/browser/*.mjs` state is so.
//!
//! `HILARE_PICTURES=DIR` keeps screenshots there.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
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
            std::env::split_paths(&std::env::var_os("PATH")?).map(|dir| dir.join(name)).find(|file| file.is_file())
        };
        let target = Path::new(env!("CARGO_BIN_EXE_hilare")).ancestors().nth(2).expect("target/PROFILE/hilare");
        let home = target.join("browser");
        let chromium = std::env::var_os("HILARE_CHROMIUM").map(PathBuf::from);
        let chromium = chromium.or_else(|| ["chromium", "chromium-browser"].into_iter().find_map(on_path));
        let driver = home.join("node_modules/playwright-core").is_dir();
        let (Some(chromium), Some(_), true) = (chromium, on_path("node"), driver) else {
            support::skip(test, &format!("no chromium, node or {} (tests/run installs them)", home.display()));
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
    fn run(&self, lab: &Lab, robot: &str, url: &str, scenario: &str) {
        let mut command = lab.command_of("node");
        command.arg(self.scenarios.path().join(format!("{scenario}.mjs")));
        command.env("HILARE_PAGE", url).env("HILARE_BIN", env!("CARGO_BIN_EXE_hilare"));
        command.env("HILARE_TEST_ROBOT", robot).env("HILARE_CHROMIUM", &self.chromium);
        let so = Path::new(env!("CARGO_MANIFEST_DIR")).join("launch/scenarios/so.csv");
        command.env("HILARE_SO", so).env("HOME", lab.dir());
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
    browser.run(&lab, &robot, &url, "draw_so");
    down(&lab, &robot);
}

#[test]
fn waypoints_are_dragged_and_the_page_is_read_by_everybody() {
    let Some(browser) = Browser::find("waypoints_are_dragged_and_the_page_is_read_by_everybody") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &["--set", "planner.map=platform", "--set", "start.x_m=0.2", "--set", "start.y_m=0.2"]);
    browser.run(&lab, &robot, &url, "drag");
    browser.run(&lab, &robot, &url, "access");
    down(&lab, &robot);
}

#[test]
fn a_click_on_stop_stops_it_within_a_tenth_of_a_second() {
    let Some(browser) = Browser::find("a_click_on_stop_stops_it_within_a_tenth_of_a_second") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &[]);
    browser.run(&lab, &robot, &url, "stop");
    down(&lab, &robot);
}

#[test]
fn in_mid_drive_laws_are_swapped_and_pages_loaded_anew() {
    let Some(browser) = Browser::find("in_mid_drive_laws_are_swapped_and_pages_loaded_anew") else { return };
    let _machine = support::whole_machine();
    let lab = Lab::new();
    let (robot, url) = up(&lab, &[]);
    browser.run(&lab, &robot, &url, "swap");
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
    browser.run(&lab, &robot, &url, "fault");
    wait_until("it has ended", || lab.processes().is_empty());
}
