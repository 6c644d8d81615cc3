//! The report as others read it.

use super::summary::LatenessUs;
use super::*;
use crate::config::Published;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::latency::Quantiles;
use hilare_interfaces::messages::Waypoint;
use hilare_recorder::statistics::RunFigures;
use hilare_recorder::trace::TraceRow;
use std::fs;

fn figures() -> RunFigures {
    RunFigures {
        reached: true,
        ticks: 34_125,
        cross_track_mean_m: 0.002_634,
        cross_track_max_m: 0.0335,
        speed_error_mean_mps: 0.002_62,
        speed_error_truth_mean_mps: 0.0028,
        steps: [9000, 8800, 0, 0],
        final_pose: [0.2, 0.2268, -std::f64::consts::FRAC_PI_2],
        final_truth: [0.2003, 0.2264, -1.571],
        ticks_late: 0,
        paused_ticks: 0,
        paused_max_ticks: 0,
        commands_late: 0,
        commands_rejected: 0,
        cycles_without_command: 0,
        state_hash: 0xab_cdef_0123,
    }
}

fn summary() -> Summary {
    let identity = RunIdentity { scenario: "rectangle", controller: "kanayama", clock: "real" };
    let lateness = Quantiles { p50_us: 4.2, p99_us: 31.0, p99_9_us: 88.5, max_us: 1203.4 };
    Summary::new(identity, &figures(), 2, Counters::default(), lateness)
}

fn published() -> [Published; 2] {
    [
        Published {
            source: "Mathew & Hiremath 2018, table 3, measured".to_owned(),
            cross_track_mean_m: Some(0.006_75),
            speed_error_mean_mps: Some(0.002_91),
            ..Published::default()
        },
        Published {
            source: "simulated".to_owned(),
            speed_error_mean_mps: Some(0.002_89),
            ..Published::default()
        },
    ]
}

#[test]
fn the_summary_has_the_keys_of_the_design_in_their_order() {
    let json = summary().to_json();
    assert!(json.ends_with("}\n"));
    let keys: Vec<&str> = json
        .lines()
        .filter_map(|line| line.trim().strip_prefix('"')?.split_once("\":").map(|(key, _)| key))
        .collect();
    let expected = "scenario controller clock reached ticks duration_s cross_track_mean_m cross_track_max_m \
        speed_error_mean_mps speed_error_truth_mean_mps steps final_pose x_m y_m theta_rad final_truth x_m y_m \
        theta_rad ticks_late paused_ticks paused_max_ticks commands_late commands_rejected \
        cycles_without_command swaps restarts lateness_us p50 p99 p99_9 max state_hash";
    assert_eq!(keys, expected.split_whitespace().collect::<Vec<_>>());
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["duration_s"], 34.125);
    assert_eq!(value["steps"], serde_json::json!([9000, 8800]));
    assert_eq!(value["state_hash"], "000000abcdef0123");
    assert_eq!(value["lateness_us"]["p99_9"], 88.5);
    assert_eq!(serde_json::from_str::<Summary>(&json).unwrap(), summary());
}

#[test]
fn the_report_is_written_whole() {
    let scratch = tempfile::tempdir().unwrap();
    let dir = scratch.path().join("deep/er");
    let rows = [row(5, 0.0, 0.0)];
    let input = PlotInput { rows: &rows, ..input() };
    let written = write_report(&dir, &summary(), &input, "tick\n5\n").unwrap();
    let mut names: Vec<_> = fs::read_dir(&dir).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["cross_track.svg", "path.csv", "path.svg", "speed.svg", "summary.json", "trace.csv"]);
    assert_eq!(written.len(), 6);
    assert_eq!(fs::read_to_string(dir.join("summary.json")).unwrap(), summary().to_json());
    assert_eq!(fs::read_to_string(dir.join("trace.csv")).unwrap(), "tick\n5\n");
}

#[test]
fn an_error_names_the_path_and_the_reason() {
    let scratch = tempfile::tempdir().unwrap();
    let file = scratch.path().join("file");
    fs::write(&file, "").unwrap();
    let error = write_report(&file.join("run"), &summary(), &input(), "").unwrap_err().to_string();
    assert!(error.contains(&format!("{}/run", file.display())) && error.contains("os error"), "{error}");
    // A directory stands where the file should go: the temporary one must not stay behind.
    fs::create_dir_all(scratch.path().join("summary.json")).unwrap();
    let error = summary().write(scratch.path()).unwrap_err().to_string();
    assert!(error.starts_with("cannot write ") && error.lines().count() == 1, "{error}");
    assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 2);
}

#[test]
fn the_verdict_reads_well() {
    let text = verdict_text(&summary(), &published(), None, false);
    assert!(text.starts_with("rectangle, kanayama, real clock\n\n"), "{text}");
    for line in [
        "                                               2018, table 3,",
        "                                  this run         measured *          simulated",
        "cross-track mean                   2.63 mm            6.75 mm                  -",
        "cross-track max                   33.50 mm",
        "speed error mean                 2.62 mm/s          2.91 mm/s          2.89 mm/s",
        "duration                          34.125 s",
        "final x, y                 200.0, 226.8 mm",
        "final heading                    -90.0 deg",
        "estimate off truth         0.5 mm, 0.0 deg",
        "lateness  p50 4.2 us, p99 31.0 us, p99.9 88.5 us, max 1203.4 us",
        "pauses    none",
        "hash      000000abcdef0123",
        "ARRIVED after 34.125 s, 2.63 mm off the line in the mean, 33.50 mm at most",
    ] {
        assert!(text.lines().any(|have| have == line), "no line {line:?} in\n{text}");
    }
    assert!(
        text.contains("* measured on a real robot")
            && !text.contains("not expected")
            && !text.contains('\x1b')
    );
    assert!(verdict_text(&summary(), &published(), None, true).contains("\x1b[1;32mARRIVED"));
}

#[test]
fn the_verdict_says_what_went_wrong() {
    let mut summary = summary();
    summary.reached = false;
    (summary.commands_late, summary.ticks_late, summary.paused_ticks, summary.paused_max_ticks) =
        (3, 2, 12, 9);
    let text = verdict_text(&summary, &[], Some("the controller's\nprocess died"), false);
    assert!(text.ends_with("\nNOT ARRIVED: the controller's process died\n"), "{text}");
    assert!(text.contains("3 late, 0 rejected") && text.contains("longest 9 ms"));
    assert!(text.contains("this hash is not expected to be the simulation's"));
    assert!(!text.contains('*'));
    assert!(verdict_text(&summary, &[], None, false).contains("NOT ARRIVED: the run ended after 34.125 s"));
    (summary.clock, summary.lateness_us) = ("lockstep".to_owned(), LatenessUs::default());
    assert!(verdict_text(&summary, &[], None, false).contains("virtual time"));
}

#[test]
fn the_verdict_fits_a_hundred_columns() {
    let mut summary = summary();
    summary.scenario = "a very long name of a scenario ".repeat(9);
    (summary.reached, summary.commands_late, summary.ticks_late) = (false, u64::MAX, u64::MAX);
    (summary.paused_ticks, summary.commands_rejected, summary.swaps) = (u64::MAX, u64::MAX, u64::MAX);
    let long = "measured".repeat(20);
    let row = Published { source: long, ..published()[0].clone() };
    for count in 0..9 {
        let text = verdict_text(&summary, &vec![row.clone(); count], Some(&"why ".repeat(80)), false);
        for line in text.lines() {
            assert!(line.chars().count() <= 100, "{count} columns: {line}");
            assert_eq!(line, line.trim_end());
        }
    }
}

// --- plots -----------------------------------------------------------------------------------------

const CORNERS: [Waypoint; 3] =
    [Waypoint::straight(0.2, 0.2), Waypoint::straight(0.6, 0.2), Waypoint::straight(0.6, 0.5)];

fn input() -> PlotInput<'static> {
    PlotInput {
        title: "rectangle <&> \"kanayama\"",
        waypoints: &CORNERS,
        later_paths: &[],
        acceptance_radius_m: 0.027,
        reference_speed_mps: 0.04,
        reference_speeds: &[],
        rows: &[],
        map: None,
        mishaps: &[],
    }
}

fn row(tick: u64, x_m: f64, y_m: f64) -> TraceRow {
    let pose = WorldPose::new(x_m, y_m, 0.0);
    let waypoint = 1 + tick / 5000;
    TraceRow {
        tick,
        pose,
        truth: pose,
        speed_mps: 0.04,
        omega_radps: 0.0,
        cross_track_m: -0.001,
        heading_error_rad: 0.0,
        waypoint,
    }
}

/// Draws into a directory of its own and returns path, cross-track and speed.
fn drawn(name: &str, input: &PlotInput<'_>) -> [String; 3] {
    let scratch = tempfile::tempdir().unwrap();
    let written = write_plots(scratch.path(), input).unwrap();
    let svgs: Vec<String> = written.iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    for svg in &svgs {
        assert_is_xml(svg);
        assert!(svg.len() < 1_000_000, "{name}: {} bytes", svg.len());
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name}");
        // A coordinate off the sheet would be one the axes do not reach.
        assert!(!svg.contains("2147483647") && !svg.contains("-2147483648"), "{name}");
    }
    svgs.try_into().unwrap()
}

/// Tags balance, attributes are quoted, no bare `&`.
fn assert_is_xml(svg: &str) {
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"), "{svg:.60}");
    let mut open: Vec<&str> = Vec::new();
    for part in svg.split('<').skip(1) {
        let (tag, text) = part.split_once('>').expect("a tag ends");
        assert!(tag.matches('"').count().is_multiple_of(2), "{tag}");
        let name = tag.split([' ', '/']).next().unwrap();
        match tag.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name)),
            None if !tag.ends_with('/') => open.push(name),
            None => {}
        }
        for (at, _) in text.match_indices('&') {
            assert!(
                ["&amp;", "&lt;", "&gt;", "&quot;", "&apos;"].iter().any(|e| text[at..].starts_with(e)),
                "{text}"
            );
        }
        assert!(text.trim().is_empty() || open.last() == Some(&"text"), "{text}");
    }
    assert!(open.is_empty());
}

/// Polylines of a colour with more than the two points of a legend's sample or a straight line.
fn curves(svg: &str, color: &str) -> usize {
    let of_color = format!("stroke=\"{color}\"");
    svg.lines()
        .filter(|line| line.starts_with("<polyline") && line.contains(&of_color))
        .filter(|line| {
            line.split_once("points=\"").is_some_and(|(_, points)| points.matches(',').count() > 2)
        })
        .count()
}

const BLUE: &str = "#0072B2";
const ORANGE: &str = "#E69F00";
const DARK: &str = "#464646";

#[test]
fn every_series_is_drawn_once() {
    let rows: Vec<TraceRow> = (0..2000).map(|n| row(n * 5, 0.2 + n as f64 * 2e-4, 0.2)).collect();
    let [path, cross_track, speed] = drawn("series", &PlotInput { rows: &rows, ..input() });
    assert_eq!([BLUE, ORANGE, DARK].map(|color| curves(&path, color)), [1, 1, 1]);
    assert_eq!(curves(&speed, BLUE), 1);
    assert_eq!(curves(&cross_track, BLUE), 1);
    assert!(path.contains("rectangle &lt;&amp;&gt;") && path.contains("d_T 27 mm"));
    assert!(path.contains("x (mm)") && speed.contains("linear speed (mm/s)"));
    assert!(speed.contains("v_r 40.0 mm/s") && cross_track.contains("mean 1.0 mm"));
    for number in ["0", "1", "2"] {
        assert!(path.lines().any(|line| line == number), "waypoint {number} is numbered");
    }
}

#[test]
fn degenerate_runs_are_drawn() {
    let same = vec![row(5, 0.2, 0.2); 3];
    let one = [row(5, 0.2, 0.2)];
    let mut broken = vec![row(5, f64::NAN, 0.2), row(10, 0.2, 0.2), row(15, 1e300, f64::NEG_INFINITY)];
    broken[1].speed_mps = f64::NAN;
    broken[2].cross_track_m = f64::INFINITY;
    for rows in [&[][..], &one, &same, &broken] {
        for waypoints in [&[][..], &CORNERS[..1], &[CORNERS[0]; 4], &CORNERS] {
            for radius in [0.027, 0.0, -1.0, f64::NAN, 1e9] {
                let speed = if radius.is_nan() { f64::NAN } else { 0.0 };
                let input = PlotInput {
                    title: "\u{1b}[1m a title that is a good deal too long for its line, again and again and again",
                    waypoints,
                    later_paths: &[],
                    acceptance_radius_m: radius,
                    reference_speed_mps: speed,
                    reference_speeds: &[],
                    rows,
                    map: None,
                    mishaps: &[],
                };
                drawn("degenerate", &input);
            }
        }
    }
}

#[test]
fn long_runs_stay_small() {
    let angle = |n: usize| n as f64 * 1e-3;
    let waypoints: Vec<Waypoint> = (0..65_536)
        .map(|n| Waypoint::straight(angle(n) * angle(n).cos(), angle(n) * angle(n).sin()))
        .collect();
    let rows: Vec<TraceRow> = (0..120_000usize)
        .map(|n| TraceRow { waypoint: n as u64 / 2, ..row(n as u64 * 10, angle(n) / 2.0, 0.1) })
        .collect();
    let [path, ..] = drawn("long", &PlotInput { rows: &rows, waypoints: &waypoints, ..input() });
    assert!(path.contains("x (m)"));
    assert_eq!(curves(&path, DARK), 1);
    let script = &waypoints[..43];
    let [path, ..] = drawn("script", &PlotInput { rows: &rows[..1], waypoints: script, ..input() });
    assert!(path.contains("x (mm)"));
}

#[test]
fn what_changed_during_the_drive_is_drawn() {
    let rows = [row(5, 0.0, 0.0), row(2000, 0.1, 0.0), row(4000, 0.2, 0.0)];
    let one = PlotInput { rows: &rows, ..input() };
    let [path, _, speed] = drawn("one path", &one);
    assert!(speed.contains("reference v_r 40.0 mm/s") && path.contains("planned path, waypoints"));
    let later = [vec![Waypoint::straight(0.2, 0.0), Waypoint::straight(0.7, 0.9)]];
    let two = PlotInput { later_paths: &later, reference_speeds: &[(1, 0.04), (2000, 0.06)], ..one };
    let [path, _, speed] = drawn("two paths", &two);
    assert!(speed.contains("reference v_r") && !speed.contains("reference v_r 40.0"), "{speed}");
    assert!(path.contains("2 planned paths, waypoints"), "{path}");
}
