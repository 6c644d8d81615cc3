//! Planning: `hilare plan` on map files, and robots that go around obstacles.

mod support;

use serde_json::Value;
use support::{Lab, PATIENCE, Running, number, quick, text};

/// 2 m x 1 m with a wall at x = 1 m that leaves a gap at the top.
const WALLED: &str = r#"{"width_mm": 2000, "height_mm": 1000, "boxes_mm": [[960, 0, 1040, 700]]}"#;

fn plan(lab: &Lab, args: &[&str]) -> (i32, Value) {
    let ended = lab.hilare(&[&["plan", "--json"], args].concat());
    let answer = serde_json::from_str(&ended.stdout).unwrap_or(Value::Null);
    (ended.code.unwrap_or(-1), answer)
}

#[test]
fn a_plan_goes_around_and_repeats_to_the_bit() {
    let lab = Lab::new();
    let map = lab.file("walled.json", WALLED).display().to_string();
    let ask = ["--map", &map, "--start", "0.5,0.3", "--goal", "1.5,0.3", "--radius", "0.05", "--seed", "7"];
    let (code, first) = plan(&lab, &ask);
    assert_eq!((code, &first["solved"], &first["seed"]), (0, &Value::Bool(true), &Value::from(7)));
    let waypoints = first["waypoints"].as_array().expect("waypoints");
    assert!(waypoints.iter().any(|point| point[1].as_f64().is_some_and(|y| y > 0.7)), "{first}");
    // Around the wall's upper corners at the robot's radius, worked out apart: two tangents and an arc.
    assert!((1.25..1.40).contains(&number(&first, "length_m")), "{first}");
    assert!(number(&first, "clearance_min_m") >= 0.05, "{first}");
    for key in ["load", "field", "first_solution", "smoothing"] {
        assert!(first["cpu_us"][key].as_f64().is_some_and(|us| us >= 0.0), "{key}: {first}");
    }
    let (_, again) = plan(&lab, &ask);
    assert_eq!(first["waypoints"], again["waypoints"]);
}

#[test]
fn what_has_no_path_says_why_with_exit_code_1() {
    let lab = Lab::new();
    let map = lab.file("walled.json", WALLED).display().to_string();
    let reasons = [
        ("0.5,0.3", "1.0,0.3", "0.05", "goal_in_obstacle"),
        ("1.0,0.3", "0.5,0.3", "0.05", "start_in_obstacle"),
        ("0.5,0.3", "5.0,0.3", "0.05", "goal_outside_map"),
        ("0.5,0.3", "1.5,0.3", "0.35", "no_way"),
    ];
    for (start, goal, radius, reason) in reasons {
        let (code, answer) =
            plan(&lab, &["--map", &map, "--start", start, "--goal", goal, "--radius", radius]);
        assert_eq!((code, text(&answer, "reason")), (1, reason), "{answer}");
        assert_eq!(answer["solved"], Value::Bool(false));
    }
}

#[test]
fn bad_maps_and_arguments_are_one_line() {
    let lab = Lab::new();
    let map = lab.file("walled.json", WALLED).display().to_string();
    let bomb = lab.file("bomb.pgm", "P5\n100000 100000\n255\nxx");
    let yaml = format!("image: {}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n", bomb.display());
    let bomb = lab.file("bomb.yaml", yaml).display().to_string();
    let zero = "image: bomb.pgm\nresolution: 0\norigin: [0, 0, 0]\nnegate: 0\n";
    let zero = lab.file("zero.yaml", zero).display().to_string();
    let ends = ["--start", "0.5,0.3", "--goal", "1.5,0.3"];
    for args in [
        &["--map", "nowhere.yaml"][..],
        &["--map", &bomb],
        &["--map", &zero],
        &["--map", &map, "--radius=-1"],
        &["--map", &map, "--radius", "nan"],
        &["--map", &map, "--out", "plan.txt"],
    ] {
        let ended = lab.hilare(&[&["plan"], args, &ends].concat()).expect_code(2);
        assert_eq!(ended.stderr.lines().count(), 1, "{args:?}: {}", ended.stderr);
        assert!(
            ended.stderr.starts_with("hilare: ") && ended.stdout.is_empty(),
            "{args:?}: {}",
            ended.stderr
        );
    }
    for args in
        [&["--start", "0.5", "--goal", "1,1"][..], &["--goal", "1,1"], &["--start", "a,b", "--goal", "1,1"]]
    {
        lab.hilare(&[&["plan", "--map", &map], args].concat()).expect_code(2);
    }
}

#[test]
fn a_plan_written_to_a_file_can_be_driven() {
    let lab = Lab::new();
    let map = lab.file("walled.json", WALLED).display().to_string();
    let files = ["--out", "path.csv", "--out", "plan.svg"];
    let ask = ["plan", "--map", &map, "--start", "0.5,0.3", "--goal", "1.5,0.3", "--radius", "0.06"];
    lab.hilare(&[&ask[..], &files].concat()).expect_code(0);
    let svg = std::fs::read_to_string(lab.dir().join("plan.svg")).expect("the picture");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    let run = ["run", "--path", "path.csv", "--clock", "in-process", "--out", "driven", "--json"];
    let summary: Value = serde_json::from_str(&lab.hilare(&run).expect_code(0).stdout).expect("JSON");
    assert_eq!(summary["reached"], Value::Bool(true));
}

/// Experiment 1: the planner's process and launch find the same path, and the robot touches nothing.
#[test]
fn the_platform_is_crossed_without_touching_anything() {
    let lab = Lab::new();
    let robot = lab.robot();
    let run = |clock| {
        let args = ["run", "platform", "--robot", &robot, "--clock", clock, "--out", "report", "--json"];
        let ended = Running::start(lab.command(&args)).wait(3 * PATIENCE).expect_code(0);
        serde_json::from_str::<Value>(&ended.stdout).expect("JSON")
    };
    let simulated = run("in-process");
    assert!(number(&simulated, "clearance_min_m") > 0.0, "{simulated}");
    let mut clocks = vec!["lockstep"];
    if !quick("the platform in real time") {
        clocks.push("real");
    }
    for clock in clocks {
        let summary = run(clock);
        assert_eq!(summary["reached"], Value::Bool(true));
        assert!(number(&summary, "clearance_min_m") > 0.0, "{summary}");
        if number(&summary, "commands_late") == 0.0 && number(&summary, "cycles_without_command") == 0.0 {
            assert_eq!(summary["state_hash"], simulated["state_hash"], "{clock}");
        }
    }
    let path = std::fs::read_to_string(lab.dir().join("report/path.svg")).expect("the picture");
    assert!(path.contains("obstacles"));
}

#[test]
fn a_goal_on_a_map_is_planned_around_and_a_bad_one_keeps_the_old_path() {
    let lab = Lab::new();
    let robot = lab.robot();
    lab.file("walled.json", WALLED);
    let system = "[planner]\nmap = \"walled.json\"\nrobot_radius_m = 0.05\n[start]\nx_m = 0.5\ny_m = 0.3\n";
    let system = lab.file("robot.toml", system).display().to_string();
    lab.hilare(&["up", &system, "--robot", &robot, "--detach"]).expect_code(0);
    let goal = |x: &str, y: &str| lab.hilare(&["goal", x, y, "--robot", &robot]);
    assert!(goal("1.5", "0.3").expect_code(0).stdout.contains("accepted"));
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    let waypoints = |status: &Value| number(status, "waypoints");
    let driving = lab.await_status(&robot, "it drives", |status| {
        status["path_state"] == "tracking" && number(status, "tick") > 500.0
    });
    assert!(waypoints(&driving) > 10.0, "{driving}");
    let refused = goal("1.0", "0.3").expect_code(1);
    assert!(refused.stderr.contains("touch an obstacle at the goal"), "{}", refused.stderr);
    let after = lab.status(&robot).expect("it is up");
    assert_eq!(waypoints(&after), waypoints(&driving), "the old path is kept");
    assert!(goal("0.8", "0.5").expect_code(0).stdout.contains("accepted"), "replanned from where it is");
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("goals on a map");
}
