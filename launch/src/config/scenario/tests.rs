//! Scenarios: the built-in ones, and what is wrong with others.

use super::*;

fn path(scenario: &Scenario) -> &[Waypoint] {
    match &scenario.task {
        Task::Follow(waypoints) => waypoints,
        Task::Reach(_) => panic!("{} has no path of its own", scenario.name),
    }
}
use proptest::prelude::*;
use std::path::PathBuf;
use tempfile::TempDir;

/// A folder of files that goes with the test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    fn load(&self, name: &str, text: &str) -> Result<Scenario, ConfigError> {
        Scenario::load(self.write(name, text).to_str().unwrap())
    }

    /// The error of a scenario file, without the folder.
    fn error(&self, text: &str) -> String {
        let error = self.load("job.toml", text).map(|_| text.to_owned()).expect_err("refused").to_string();
        assert!(!error.contains('\n'), "{error}");
        error.replace(&format!("{}/", self.0.path().display()), "")
    }
}

const PATH: &str = "waypoints_m = [[0, 0], [1, 0]]\n";

#[test]
fn the_built_in_scenarios_start_where_the_paper_starts() {
    let expected = [("rectangle", 5, 2), ("rectangle-open", 4, 2), ("trapezoid", 5, 2), ("so", 43, 2)];
    assert!(Scenario::builtin_names().eq(expected.map(|(name, ..)| name).into_iter().chain([
        "platform",
        "line-21deg",
        "arc-102cm",
        "agv-low",
        "agv-high",
        "agv-course"
    ])));
    let platform = Scenario::load("platform").unwrap();
    assert_eq!(platform.task, Task::Reach(WorldPoint::new(0.7, 1.4)));
    assert!(platform.system.load_map().unwrap().is_some());
    for (name, waypoints, published) in expected {
        let scenario = Scenario::load(name).unwrap();
        assert_eq!(
            (&*scenario.name, path(&scenario).len(), scenario.published.len()),
            (name, waypoints, published)
        );
        assert_eq!(scenario.system.start, WorldPose::new(0.2, 0.2, 0.0));
        assert_eq!(path(&scenario)[0], Waypoint::straight(0.2, 0.2));
        assert!(
            !scenario.description.is_empty() && scenario.published.iter().all(|row| !row.source.is_empty())
        );
        let mut system = scenario.system;
        system.start = WorldPose::default();
        assert_eq!(system, System::load("epuck").unwrap());
    }
    let rectangle = Scenario::load("rectangle").unwrap();
    assert_eq!(path(&rectangle)[4], path(&rectangle)[0]);
    assert_eq!(rectangle.published[0].cross_track_mean_m, Some(6.75e-3));
    assert_eq!(rectangle.published[1].speed_error_mean_mps, Some(2.9021e-3));
}

#[test]
fn a_scenario_changes_its_system() {
    let folder = Folder::new();
    folder.write("robots.toml", "robot = \"mine\"\n[plant]\nslip_mean = 0.1\nslip_sd = 0.2\n");
    folder.write("path.csv", "x,y\n0,0\n0,2\n");
    let text = "system = \"robots.toml\"\nwaypoints_file = \"path.csv\"\n[start]\nx_m = 1\n\
                [set]\nrobot = \"yours\"\n[set.plant]\nslip_sd = 0.3\n";
    let scenario = folder.load("square.toml", text).unwrap();
    assert_eq!((&*scenario.name, &*scenario.system.robot), ("square", "yours"));
    assert_eq!(
        (scenario.system.plant.stepper_drive.slip_mean, scenario.system.plant.stepper_drive.slip_sd),
        (0.1, 0.3)
    );
    assert_eq!(scenario.system.start, WorldPose::new(1.0, 0.0, 0.0));
    assert_eq!(path(&scenario), [Waypoint::straight(0.0, 0.0), Waypoint::straight(0.0, 2.0)]);
    assert!(scenario.description.is_empty() && scenario.published.is_empty());
}

#[test]
fn another_path_starts_on_its_first_waypoint_and_has_nothing_published() {
    let folder = Folder::new();
    let file = folder.write("mine.csv", "x,y\n3,4\n5,4\n");
    let scenario = Scenario::load("rectangle").unwrap().with_path(&file).unwrap();
    assert_eq!(scenario.system.start, WorldPose::new(3.0, 4.0, 0.0));
    assert_eq!((path(&scenario).len(), scenario.published.len(), &*scenario.name), (2, 0, "rectangle"));
    let wrong = folder.write("wrong.csv", "x,y\n3,4\n5,four\n");
    let error = Scenario::load("so").unwrap().with_path(&wrong).unwrap_err().to_string();
    assert_eq!(error, format!("{}:3: \"four\" is not a number", wrong.display()));
    let empty = folder.write("empty.csv", "");
    let error = Scenario::load("so").unwrap().with_path(&empty).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: empty; ", empty.display())), "{error}");
    let error = Scenario::load("so").unwrap().with_path(Path::new("nowhere.csv")).unwrap_err().to_string();
    assert_eq!(error, "nowhere.csv: cannot be read: No such file or directory (os error 2)");
}

#[test]
fn mistakes_are_one_line_with_their_place() {
    let folder = Folder::new();
    folder.write("robot.toml", "\n[plant]\nslip_men = 0.1\n");
    folder.write("path.csv", "x,y\n0,0\n0,0\n");
    let cases = [
        (PATH, "job.toml: no system; add system = \"epuck\" (built-in) or the path of a system file (.toml)"),
        (
            "system = \"epuck\"",
            "job.toml: no path; add waypoints_m = [[x, y], [x, y]], waypoints_file = \"FILE.csv\" or goal_m = [x, y]",
        ),
        ("system = 3", "job.toml:1: system: the number 3 is not text; write it in quotes"),
        (
            "\nsystem = \"epuk\"",
            "job.toml:2: unknown system \"epuk\"; did you mean \"epuck\"? built-in: epuck, cart, agv; or a path ending in .toml",
        ),
        (
            "system = \"robot.toml\"",
            "robot.toml:3: unknown key \"slip_men\" in [plant]; did you mean \"slip_mean\"?",
        ),
        ("system = \"none.toml\"", "none.toml: cannot be read: No such file or directory (os error 2)"),
        (
            "waypoints_file = \"path.csv\"",
            "path.csv:3: the same place as the waypoint before; delete one of them",
        ),
        (
            "waypoints_m = [\n[0, 0],\n[1],\n]",
            "job.toml:3: waypoints_m: waypoint 2 is not [x, y] in metres, [x, y, bulge] for an arc or [x, y, bulge, \
             crab_rad]",
        ),
        (
            "waypoints_m = [\n[0, 0],\n[1, 0],\n[1, 0],\n]",
            "job.toml:4: waypoints_m: waypoint 3: the same place as the waypoint before; delete one of them",
        ),
        (
            "waypoints_m = [[0, 0], [1, 0, 1e-9]]",
            "job.toml:1: waypoints_m: waypoint 2: an arc of a radius above 100000 m; write bulge 0 for a line",
        ),
        ("waypoints_m = [[0, 0]]", "job.toml:1: waypoints_m: only one waypoint; a path needs at least two"),
        (
            "waypoints_m = [[0, nan], [0, 0]]",
            "job.toml:1: waypoints_m: waypoint 1: coordinates must be finite numbers",
        ),
        ("waypoints_m = 3", "job.toml:1: waypoints_m: the number 3 is not an array [[x, y], [x, y]]"),
        (
            "waypoints_m = [[0, 0], [1, 0]]\nwaypoints_file = \"a.csv\"",
            "job.toml:2: more than one of waypoints_m, waypoints_file and goal_m; keep one of them",
        ),
        ("start = 3", "job.toml:1: start: the number 3 is not a section; write [start]"),
        ("[set.start]\nx_m = 1", "job.toml:1: set.start: write [start] in a scenario"),
        (
            "sistem = \"epuck\"",
            "job.toml:1: unknown key \"sistem\" in a scenario; did you mean \"system\"? known: description, system, \
             waypoints_m, waypoints_file, goal_m, start, correction, published, set; keys of the system stand in [set.SECTION]",
        ),
        ("published = 3", "job.toml:1: published: the number 3 is not a list; write [[published]]"),
        (
            "[[published]]\ncross_track_mean_m = 0.1",
            "job.toml:1: published: no source; say where the values come from",
        ),
        (
            "[[published]]\nsource = \"x\"\ncross_track_mean_m = 6.75",
            "job.toml:3: published.cross_track_mean_m: 6.75 m is outside 0 to 1 m; did you mean 0.00675 (SI, not \
             millimetres)?",
        ),
        (
            "[[published]]\nsource = \"x\"\ncross_track_m = 0.1",
            "job.toml:3: unknown key \"cross_track_m\" in [[published]]; did you mean \"cross_track_mean_m\"? known: \
             source, cross_track_mean_m, speed_error_mean_mps, correction_time_s, correction_travel_m, \
             steady_cross_track_m",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(folder.error(text), expected);
    }
}

#[test]
fn changes_are_checked_like_a_system_file() {
    let folder = Folder::new();
    let cases = [
        (
            "[set.plant]\nslip_men = 1",
            r#"4: unknown key "slip_men" in [set.plant]; did you mean "slip_mean"?"#,
        ),
        ("[set.plnt]\nslip_mean = 1", "3: unknown section [set.plnt]; did you mean [set.plant]?"),
        (
            "[set.plant]\nslip_mean = 2",
            "4: set.plant.slip_mean: 2 is outside -0.5 to 0.9; did you mean 0.02 (a share, not percent)?",
        ),
        ("[start]\nx_mm = 2", r#"4: unknown key "x_mm" in [start]; the key is x_m, in metres"#),
        (
            "[set.limits]\nv_max_mps = 1\nv_min_mps = 2",
            "5: limits.v_min_mps 2 is above limits.v_max_mps 1, so no speed is allowed; lower v_min_mps or raise \
             v_max_mps",
        ),
    ];
    for (changes, expected) in cases {
        let text = format!("system = \"epuck\"\n{PATH}{changes}\n");
        assert_eq!(folder.error(&text), format!("job.toml:{expected}"));
    }
}

#[test]
fn a_correction_says_within_what() {
    let folder = Folder::new();
    let load =
        |lines: &str| folder.load("job.toml", &format!("system = \"epuck\"\n{PATH}[correction]\n{lines}\n"));
    let band = load("cross_track_m = 0.002\nheading_rad = 0.035").unwrap().correction;
    assert_eq!(band, Some(Band { cross_track_m: 0.002, heading_rad: 0.035 }));
    assert_eq!(load("cross_track_m = 0.01").unwrap().correction.unwrap().heading_rad, std::f64::consts::PI);
    let cases = [
        (
            "heading_rad = 0.1",
            "3: correction: no cross_track_m; say within which distance a deviation is corrected",
        ),
        ("cross_track_m = 0", "4: correction.cross_track_m: 0 m is outside 0.000001 to 1 m"),
        ("cross_track_m = 0.01\nheading_rad = 4", "5: correction.heading_rad: 4 rad is outside 0.000001 to"),
        ("band_m = 0.01", "4: unknown key \"band_m\" in [correction]; known: cross_track_m, heading_rad"),
    ];
    for (lines, expected) in cases {
        let error = load(lines).unwrap_err().to_string();
        assert!(error.contains(&format!("job.toml:{expected}")), "{error}");
    }
}

#[test]
fn unknown_names_are_answered_with_the_known_ones() {
    assert_eq!(
        Scenario::load("rectangel").unwrap_err().to_string(),
        "unknown scenario \"rectangel\"; did you mean \"rectangle\"? built-in: rectangle, rectangle-open, trapezoid, \
         so, platform, line-21deg, arc-102cm, agv-low, agv-high, agv-course; or a path ending in .toml"
    );
}

proptest! {
    #[test]
    fn any_text_is_answered_in_one_line(text in "\\PC{0,80}") {
        for text in [text.clone(), format!("system = \"epuck\"\n{PATH}[[published]]\nsource = {text}"), format!("waypoints_m = {text}")] {
            if let Err(error) = parse("job", "job.toml", &text, Home::BuiltIn) {
                prop_assert!(!error.to_string().chars().any(char::is_control));
            }
        }
    }
}
