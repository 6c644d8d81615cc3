//! Paths nobody listed, against an independent program: tests/python/reference.py computes paper 1 in
//! millimetres and shares nothing with hilare.
//!
//! Both must agree to the tick and to the step, and to rounding in everything else. There is one exception,
//! and it is no tolerance: the loop's gain is 118 rad/s a millimetre and a pulse is a threshold, so about one
//! path in 150 (2 of 300 when this was measured) has a tick where the last bit of a float decides whether a
//! pulse falls now or a tick later. Then hilare's run must equal, just as exactly, a run of the reference
//! whose start is nudged by 1e-10 mm or less.

mod support;

use serde_json::Value;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::Command;
use support::random::Random;
use support::{Lab, Running, number, skip};

type Path2 = Vec<(f64, f64)>;
type Generator = fn(&mut Random) -> Path2;

const PATHS: usize = 40;
/// Paths that may need a nudge; at one in 150, three of 40 have a probability of 0.2 %.
const NUDGED_MAX: usize = 2;

fn zigzag(random: &mut Random) -> Path2 {
    let (width, height) = (random.real(0.06, 0.25), random.real(0.05, 0.3));
    let teeth = random.whole(3, 8);
    (0..=teeth).map(|i| (i as f64 * width, (i % 2) as f64 * height + random.real(-0.01, 0.01))).collect()
}

fn star(random: &mut Random) -> Path2 {
    let points = [5, 7, 9][random.whole(0, 2) as usize];
    let skip = random.whole(2, points / 2);
    let (radius, start) = (random.real(0.1, 0.3), random.real(0.0, TAU));
    let angle = |i: u64| start + TAU * (skip * i) as f64 / points as f64;
    (0..=points).map(|i| (radius * angle(i).cos(), radius * angle(i).sin())).collect()
}

fn self_crossing(random: &mut Random) -> Path2 {
    let count = random.whole(4, 9);
    (0..count).map(|_| (random.real(0.0, 0.5), random.real(0.0, 0.5))).collect()
}

/// There and back, all but on the same line.
fn reversing(random: &mut Random) -> Path2 {
    let heading = random.real(0.0, TAU);
    let mut path = vec![(0.0, 0.0)];
    for leg in 0..random.whole(2, 5) {
        let (x, y) = path[path.len() - 1];
        let length = random.real(0.1, 0.4) * if leg % 2 == 0 { 1.0 } else { -1.0 };
        path.push((x + length * heading.cos(), y + length * heading.sin() + random.real(-0.004, 0.004)));
    }
    path
}

fn tight_spiral(random: &mut Random) -> Path2 {
    let (growth, turn) = (random.real(0.004, 0.012), [0.4, 0.6, 0.9][random.whole(0, 2) as usize]);
    let count = random.whole(12, 30);
    let at = |i: u64| {
        let (radius, angle) = (0.05 + growth * i as f64, turn * i as f64);
        (radius * angle.cos(), radius * angle.sin())
    };
    let outward = (0..count).map(at);
    if random.whole(0, 1) == 0 { outward.collect() } else { outward.rev().collect() }
}

const KINDS: [(&str, Generator); 5] = [
    ("zigzag", zigzag),
    ("star", star),
    ("self-crossing", self_crossing),
    ("reversing", reversing),
    ("tight-spiral", tight_spiral),
];

fn python_there() -> bool {
    Command::new("python3").arg("--version").output().is_ok_and(|output| output.status.success())
}

fn reference(lab: &Lab, nudge: (f64, f64), files: &[PathBuf]) -> Vec<Value> {
    let mut command = lab.command_of("python3");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/reference.py"));
    command.arg("--nudge").arg(format!("{:e},{:e}", nudge.0, nudge.1)).args(files);
    let ended = Running::start(command).wait(support::PATIENCE).expect_code(0);
    serde_json::from_str(&ended.stdout).expect("the reference prints JSON")
}

fn hilare(lab: &Lab, file: &Path, clock: &str) -> Value {
    let (file, robot) = (file.to_string_lossy(), lab.robot());
    let args = ["run", "--path", &file, "--clock", clock, "--json", "--out", "report", "--robot", &robot];
    serde_json::from_str(&lab.hilare(&args).expect_code(0).stdout).expect("JSON")
}

/// Ticks and steps to the last one; the rest to rounding, which ten thousands of sums make 1e-9 at most.
fn differences(ours: &Value, theirs: &Value) -> Vec<String> {
    let mut differences = Vec::new();
    for key in ["reached", "ticks", "steps"] {
        if ours[key] != theirs[key] {
            differences.push(format!("{key}: {}, the reference {}", ours[key], theirs[key]));
        }
    }
    for key in ["cross_track_mean_m", "cross_track_max_m", "speed_error_mean_mps"] {
        let (a, b) = (number(ours, key), number(theirs, key));
        if (a - b).abs() > 1e-9 * b.abs() {
            differences.push(format!("{key}: {a}, the reference {b}"));
        }
    }
    for pose in ["final_pose", "final_truth"] {
        for key in ["x_m", "y_m", "theta_rad"] {
            let (a, b) = (number(&ours[pose], key), number(&theirs[pose], key));
            if (a - b).abs() > 1e-9 {
                differences.push(format!("{pose}.{key}: {a}, the reference {b}"));
            }
        }
    }
    differences
}

/// True if some nudge of the reference's start gives exactly this run.
fn is_a_matter_of_rounding(lab: &Lab, file: &Path, ours: &Value) -> bool {
    let directions = (-1..=1).flat_map(|x| (-1..=1).map(move |y| (f64::from(x), f64::from(y))));
    let nudges = directions.flat_map(|(x, y)| [1e-12, 1e-11, 1e-10].map(|size| (x * size, y * size)));
    let files = [file.to_owned()];
    let mut runs = nudges.flat_map(|nudge| reference(lab, nudge, &files));
    runs.any(|theirs| differences(ours, &theirs).is_empty())
}

#[test]
fn forty_paths_agree_with_the_reference_to_the_step() {
    if !python_there() {
        return skip(
            "forty_paths_agree_with_the_reference_to_the_step",
            "there is no python3 to run the reference",
        );
    }
    let lab = Lab::new();
    let mut random = Random::new("oracle", 20180801);
    let files: Vec<PathBuf> = (0..PATHS)
        .map(|i| {
            let (kind, path) = KINDS[i % KINDS.len()];
            let lines: String = path(&mut random).iter().map(|(x, y)| format!("{x},{y}\n")).collect();
            lab.file(&format!("{i:02}-{kind}.csv"), format!("x,y\n{lines}"))
        })
        .collect();
    let mut nudged = Vec::new();
    for (i, (file, theirs)) in files.iter().zip(reference(&lab, (0.0, 0.0), &files)).enumerate() {
        let ours = hilare(&lab, file, "in-process");
        let differences = differences(&ours, &theirs);
        if !differences.is_empty() {
            let path = std::fs::read_to_string(file).unwrap_or_default();
            let rounding = is_a_matter_of_rounding(&lab, file, &ours);
            assert!(rounding, "{}: a rule differs\n{}\n{path}", file.display(), differences.join("\n"));
            nudged.push(file);
        }
        // One of each kind as processes, too.
        if i < KINDS.len() {
            assert_eq!(
                ours["state_hash"],
                hilare(&lab, file, "lockstep")["state_hash"],
                "{}",
                file.display()
            );
        }
    }
    println!("decided by rounding: {nudged:?}");
    assert!(nudged.len() <= NUDGED_MAX, "too many paths decided by rounding: {nudged:?}");
}

#[test]
fn the_reference_gives_the_table_of_spec_1() {
    if !python_there() {
        return skip("the_reference_gives_the_table_of_spec_1", "there is no python3 to run the reference");
    }
    let lab = Lab::new();
    let so = Path::new(env!("CARGO_MANIFEST_DIR")).join("launch/scenarios/so.csv");
    let trapezoid = lab.file("trapezoid.csv", "x,y\n.2,.2\n.8,.2\n.6,.5\n.4,.5\n.2,.2\n");
    let runs = reference(&lab, (0.0, 0.0), &[so, trapezoid]);
    for (run, ticks, euler_mm) in [(&runs[0], 60420, 5.8737), (&runs[1], 37145, 2.7699)] {
        assert_eq!(run["ticks"], ticks);
        let found = number(run, "cross_track_mean_euler_m") * 1e3;
        assert!((found - euler_mm).abs() < 5e-5, "{found} is not the table's {euler_mm}");
    }
}
