//! What papers 2 and 3 measured, and what the Kalman filter and the predictive law promise beyond them.

mod support;

use serde_json::Value;
use support::random::Random;
use support::{Lab, number};

const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn run(lab: &Lab, args: &[&str]) -> Value {
    let common = ["--clock", "in-process", "--json", "--out", "report"];
    let ended = lab.hilare(&[&["run"], args, &common[..]].concat()).expect_code(0);
    serde_json::from_str(&ended.stdout).expect("JSON")
}

/// `--set KEY=VALUE` for each assignment, and a scenario and law.
fn with<'a>(head: &[&'a str], set: &[&'a str]) -> Vec<&'a str> {
    head.iter().copied().chain(set.iter().flat_map(|assignment| ["--set", assignment])).collect()
}

#[test]
fn paper_2_line_is_found_within_two_metres_and_held_within_a_centimetre() {
    let lab = Lab::new();
    for seed in 1..=5 {
        let summary = run(&lab, &["line-21deg", "--seed", &seed.to_string()]);
        let correction = &summary["correction"];
        assert!(number(correction, "travel_m") <= 2.0, "seed {seed}: {correction}");
        assert!(number(correction, "steady_cross_track_m") <= 0.01, "seed {seed}: {correction}");
    }
    let exact = ["camera.sd_m=0", "camera.sd_rad=0", "camera.period_ticks=1", "camera.delay_ticks=0"];
    let summary = run(&lab, &with(&["line-21deg"], &exact));
    assert!(number(&summary["correction"], "steady_cross_track_m") <= 0.001, "{summary}");
}

#[test]
fn paper_2_arc_is_found_within_60_degrees_with_one_overshoot() {
    let lab = Lab::new();
    let sixty_degrees_m = 1.02 * 60.0 * DEGREE;
    for seed in 1..=5 {
        let correction = run(&lab, &["arc-102cm", "--seed", &seed.to_string()])["correction"].clone();
        assert!(number(&correction, "travel_m") <= sixty_degrees_m, "seed {seed}: {correction}");
        assert_eq!(correction["overshoots"], 1, "seed {seed}: {correction}");
        assert!(number(&correction, "steady_cross_track_m") <= 0.01, "seed {seed}: {correction}");
    }
}

#[test]
fn paper_3_deviations_are_gone_within_1_2_s_and_stay_within_2_mm_and_2_degrees() {
    let lab = Lab::new();
    for scenario in ["agv-low", "agv-high"] {
        for seed in 1..=5 {
            let head = [scenario, "--seed", &seed.to_string()];
            let correction = run(&lab, &with(&head, &["plant.roller_slip_sd=0.02"]))["correction"].clone();
            let what = format!("{scenario}, seed {seed}: {correction}");
            assert!(number(&correction, "time_s") <= 1.2, "{what}");
            assert!(number(&correction, "steady_cross_track_m") <= 0.002, "{what}");
            assert!(number(&correction, "steady_heading_rad") <= 2.0 * DEGREE, "{what}");
        }
    }
}

/// Slip, unequal wheels, and a wrong start pose: 10 mm, 3 degrees.
const WRONG: [&str; 5] = [
    "plant.slip_mean=0.05",
    "plant.wheel_error_right=0.01",
    "plant.start_error_x_m=0.006",
    "plant.start_error_y_m=0.008",
    "plant.start_error_theta_rad=0.0523598775598",
];

fn cross_track_m(lab: &Lab, head: &[&str], set: &[&str]) -> f64 {
    number(&run(lab, &with(head, set)), "cross_track_mean_m")
}

#[test]
fn the_filter_is_three_times_nearer_than_dead_reckoning_and_no_worse_when_nothing_is_wrong() {
    let lab = Lab::new();
    let (mut wrong, mut right) = ((0.0, 0.0), (0.0, 0.0));
    let seeds = 10;
    for seed in 1..=seeds {
        let head = ["rectangle", "--seed", &seed.to_string()];
        for (sums, set) in [(&mut wrong, &WRONG[..]), (&mut right, &[])] {
            sums.0 += cross_track_m(&lab, &head, set);
            sums.1 += cross_track_m(&lab, &head, &[set, &["estimator.kind=ekf"]].concat());
        }
    }
    assert!(wrong.1 * 3.0 <= wrong.0, "dead reckoning {} m, filter {} m in {seeds} runs", wrong.0, wrong.1);
    // The camera's noise is all it adds: a hundredth of the law's own error.
    assert!(right.1 <= 1.02 * right.0, "dead reckoning {} m, filter {} m in {seeds} runs", right.0, right.1);
}

/// A path nobody tuned for: legs of 60 to 400 mm, turns of up to 130 degrees.
fn random_path(random: &mut Random) -> String {
    let (mut x, mut y, mut heading) = (0.0, 0.0, 0.0f64);
    let mut csv = String::from("x,y\n0,0\n");
    for _ in 0..8 {
        let length = random.real(0.06, 0.4);
        (x, y) = (x + length * heading.cos(), y + length * heading.sin());
        csv.push_str(&format!("{x},{y}\n"));
        heading += random.real(-130.0, 130.0) * DEGREE;
    }
    csv
}

#[test]
fn the_predictive_law_leads_on_paths_not_listed_disturbed_or_not() {
    let lab = Lab::new();
    let mut random = Random::new("the_predictive_law_leads", 20);
    let disturbances: [&[&str]; 3] = [
        &[],
        &["estimator.kind=ekf", "plant.slip_mean=0.03", "plant.slip_sd=0.05"],
        &[
            "estimator.kind=ekf",
            "plant.slip_mean=0.05",
            "plant.wheel_error_right=0.01",
            "plant.start_error_y_m=0.01",
            "plant.start_error_theta_rad=0.05",
        ],
    ];
    for n in 0..8 {
        let csv = random_path(&mut random);
        lab.file("path.csv", &csv);
        for set in disturbances {
            let ours = cross_track_m(&lab, &["--path", "path.csv", "--controller", "qp"], set);
            let theirs = cross_track_m(&lab, &["--path", "path.csv", "--controller", "kanayama"], set);
            assert!(ours < theirs, "path {n}, {set:?}: {ours} m, kanayama {theirs} m\n{csv}");
        }
    }
}
