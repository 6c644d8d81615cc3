//! What a fit promises, by dense sampling, on random and on awkward curves.
#![allow(clippy::disallowed_methods, reason = "tests may use the system's mathematics")]

mod fit_judge;

use fit_judge::*;
use hilare_planner::{FitError, FitSettings, PathRefusal, WorldPoint, fit};
use proptest::prelude::*;

/// A chain of lines and arcs with headings that run on or break, sampled with its joints among the samples.
fn pieces(parts: &[(f64, f64, f64)], step: f64) -> Vec<Point> {
    let (mut at, mut heading) = ((0.0_f64, 0.0_f64), 0.3_f64);
    let mut out = vec![at];
    for (turn, length, corner) in parts {
        let (sweep, half) = (*turn, 0.5 * turn);
        let chord = length * if half.abs() > 1e-9 { half.sin() / half } else { 1.0 };
        heading += corner;
        let to = (at.0 + chord * (heading + half).cos(), at.1 + chord * (heading + half).sin());
        draw(at, to, (0.25 * sweep).tan(), step, &mut out);
        heading += sweep;
        at = to;
    }
    out
}

/// A wandering chain: short edges, turning a little at each.
fn wander(turns: &[f64], edge: f64) -> Vec<Point> {
    let (mut at, mut heading) = ((0.0_f64, 0.0_f64), 0.0_f64);
    let mut out = vec![at];
    for turn in turns {
        heading += turn;
        at = (at.0 + edge * heading.cos(), at.1 + edge * heading.sin());
        out.push(at);
    }
    out
}

fn run(points: &[Point], settings: &FitSettings) -> usize {
    let fit = fit(&world(points), settings).unwrap();
    judge(points, &fit, settings);
    fit.waypoints.len() - 1
}

/// Douglas and Peucker's subdivision; the count of its lines.
fn douglas_peucker(points: &[Point], tolerance: f64) -> usize {
    let last = points.len() - 1;
    let off = |p: &Point| to_line(*p, &[points[0], points[last]]);
    let worst = (1..last).max_by(|a, b| off(&points[*a]).total_cmp(&off(&points[*b])));
    match worst {
        Some(k) if off(&points[k]) > tolerance => {
            douglas_peucker(&points[..=k], tolerance) + douglas_peucker(&points[k..], tolerance)
        }
        _ => 1,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn wandering_chains_are_kept_to(
        turns in prop::collection::vec(-0.5..0.5f64, 2..120), tolerance in 0.002..0.05f64,
    ) {
        run(&wander(&turns, 0.03), &settings(tolerance));
    }

    #[test]
    fn wild_points_are_kept_to(
        points in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 2..25), tolerance in 0.01..0.5f64,
    ) {
        run(&points, &settings(tolerance));
    }

    #[test]
    fn lines_and_arcs_are_found_again(
        parts in prop::collection::vec((-4.5..4.5f64, 0.3..1.0f64, -1.0..1.0f64), 1..6), straight: u8,
    ) {
        let part = |(k, p): (usize, &(f64, f64, f64))| {
            // Radius above the least, and some parts straight.
            let turn = if straight >> k & 1 == 1 { 0.0 } else { p.0 };
            (turn, p.1.max(0.05 * turn.abs()), p.2)
        };
        let parts: Vec<_> = parts.iter().enumerate().map(part).collect();
        let points = pieces(&parts, 0.01);
        // Sagitta of the samples on the tightest radius, 0.3/4.5 m, is 0.19 mm.
        let count = run(&points, &settings(5e-4));
        prop_assert!(count <= parts.len(), "{count} for {}", parts.len());
    }

    #[test]
    fn never_more_than_douglas_and_peucker(
        slopes in prop::collection::vec(-0.9..0.9f64, 2..200), tolerance in 0.002..0.05f64,
    ) {
        // Slopes below 1: the chain runs along each of its chords, where their measure and ours agree.
        let mut points = vec![(0.0, 0.0)];
        for (k, slope) in slopes.iter().enumerate() {
            points.push((0.02 * (k + 1) as f64, points[k].1 + 0.02 * slope));
        }
        let ours = run(&points, &settings(tolerance));
        let theirs = douglas_peucker(&points, tolerance);
        prop_assert!(ours <= theirs, "{ours} > {theirs}");
    }

    #[test]
    fn the_count_knows_no_direction(
        turns in prop::collection::vec(-0.5..0.5f64, 2..80), tolerance in 0.002..0.05f64, angle in -3.0..3.0f64,
    ) {
        let points = wander(&turns, 0.03);
        let settings = settings(tolerance);
        let count = |points: &[Point]| fit(&world(points), &settings).unwrap().waypoints.len();
        let (s, c) = angle.sin_cos();
        let turned: Vec<_> = points.iter().map(|p| (c * p.0 - s * p.1 + 3.0, s * p.0 + c * p.1 - 2.0)).collect();
        let mirrored: Vec<_> = points.iter().map(|p| (p.0, -p.1)).collect();
        prop_assert_eq!(count(&points), count(&turned));
        prop_assert_eq!(count(&points), count(&mirrored));
    }

    #[test]
    fn without_corners_headings_run_on(
        turns in prop::collection::vec(-0.25..0.25f64, 2..150), tolerance in 0.002..0.02f64,
    ) {
        let points = wander(&turns, 0.03);
        let settings = FitSettings { tangent: true, ..settings(tolerance) };
        match fit(&world(&points), &settings) {
            Ok(fit) => {
                judge(&points, &fit, &settings);
                for (change, place) in corners(&fit) {
                    prop_assert!(change < 1e-7, "{change} rad at {place:?}");
                }
            }
            Err(FitError::Radius(_)) => {
                // Only where a bend is too sharp to round: R = τ / (sec(θ/2) − 1).
                let bend = turns[1..].iter().fold(0.0_f64, |most, turn| most.max(turn.abs()));
                let radius = tolerance / (1.0 / (0.5 * bend).cos() - 1.0);
                prop_assert!(radius < 20.0 * settings.radius_min_m, "refused though a bend has {radius} m");
            }
            Err(error) => prop_assert!(false, "{error}"),
        }
    }

    #[test]
    fn anything_finite_is_answered(
        points in prop::collection::vec((any::<f64>(), any::<f64>()), 0..12),
        small in prop::collection::vec((-3i8..3, -3i8..3), 0..40),
        tolerance: f64, tangent: bool, scale in -6..4i32,
    ) {
        let scale = 10f64.powi(scale);
        let grid: Vec<_> = small.iter().map(|p| (f64::from(p.0) * scale, f64::from(p.1) * scale)).collect();
        let settings = FitSettings { tangent, ..settings(tolerance) };
        let _ = fit(&world(&points), &settings);
        for tolerance in [1e-6, 1e-3, 0.1 * scale, scale, 10.0] {
            let settings = FitSettings { tolerance_m: tolerance, ..settings };
            if let Ok(fit) = fit(&world(&grid), &settings) {
                let ends = [fit.waypoints[0], fit.waypoints[fit.waypoints.len() - 1]].map(|w| (w.x_m, w.y_m));
                prop_assert_eq!(ends, [grid[0], grid[grid.len() - 1]]);
                prop_assert!(fit.waypoints.iter().all(|w| w.is_finite()));
            }
        }
    }
}

#[test]
fn awkward_curves() {
    let turn = std::f64::consts::TAU;
    let circle = |turns: f64, n: usize| -> Vec<Point> {
        (0..=n).map(|k| (turns * turn * k as f64 / n as f64).sin_cos()).map(|(s, c)| (c, s)).collect()
    };
    let close = settings(1e-3);
    assert_eq!(run(&[(0.0, 0.0), (0.3, 0.1)], &close), 1, "two points");
    let row: Vec<_> = (0..50).map(|k| (0.1 * f64::from(k), 0.05 * f64::from(k))).collect();
    assert_eq!(run(&row, &close), 1, "collinear");
    assert_eq!(run(&circle(1.0, 400), &close), 2, "a full circle is 270° and the rest");
    assert_eq!(run(&circle(2.5, 1000), &close), 4, "900° in 270° at most");
    assert_eq!(run(&circle(0.75, 300), &close), 1, "270°");
    let there_and_back = [(0.0, 0.0), (1.0, 0.0), (0.2, 0.0), (0.9, 0.0)];
    assert_eq!(run(&there_and_back, &close), 3, "to and fro is driven");
    let spike = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.4), (0.5, 0.0005), (1.0, 0.0)];
    assert_eq!(run(&spike, &close), 4, "a spike stays");
    let eight: Vec<_> =
        (0..=400).map(|k| turn * f64::from(k) / 400.0).map(|t| (t.sin(), t.sin() * t.cos())).collect();
    assert!(run(&eight, &close) < 30, "a lemniscate crosses itself");
    let closed = [(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)];
    assert_eq!(run(&closed, &settings(10.0)), 2, "closed paths keep two segments");
}

#[test]
fn long_curves_end_as_near_as_they_begin() {
    let n = 65_536;
    let spiral: Vec<_> = (0..n)
        .map(|k| 18.0 * f64::from(k) / f64::from(n - 1))
        .map(|t| ((0.2 + 0.05 * t) * t.cos(), (0.2 + 0.05 * t) * t.sin()))
        .collect();
    let fit = fit(&world(&spiral), &settings(1e-3)).unwrap();
    let short: Vec<_> = spiral.iter().step_by(64).chain(spiral.last()).copied().collect();
    let least = hilare_planner::fit(&world(&short), &settings(1e-3)).unwrap();
    assert!(least.least && !fit.least);
    assert!(
        fit.waypoints.len() <= least.waypoints.len() + 1,
        "{} {}",
        fit.waypoints.len(),
        least.waypoints.len()
    );
    judge(&short, &fit, &settings(1e-3 + 1e-5));
}

#[test]
fn a_rounded_rectangle_without_corners_and_a_sharp_one_with_its_own() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let side = |corner| [(0.0, 1.0, corner), (quarter, 0.3 * quarter, 0.0)];
    let stadium: Vec<_> = (0..4).flat_map(|_| side(0.0)).collect();
    let smooth = FitSettings { tangent: true, ..settings(1e-3) };
    let points = pieces(&stadium, 0.005);
    let fit = fit(&world(&points), &smooth).unwrap();
    judge(&points, &fit, &smooth);
    assert!(corners(&fit).iter().all(|corner| corner.0 < 1e-7));
    let sharp = [(0.0, 1.0, 0.0), (0.0, 1.0, quarter), (0.0, 1.0, quarter), (0.0, 1.0, 0.4)];
    let points = pieces(&sharp, 0.005);
    let fit = hilare_planner::fit(&world(&points), &smooth).unwrap();
    judge(&points, &fit, &smooth);
    let kept: Vec<_> = corners(&fit).into_iter().filter(|corner| corner.0 > 1e-7).collect();
    assert_eq!(kept.len(), 2, "two right angles stay, 0.4 rad is rounded: {kept:?}");
    assert!(kept.iter().all(|corner| (corner.0 - quarter).abs() < 0.1));
    let tight = FitSettings { radius_min_m: 0.4, ..smooth };
    let error = hilare_planner::fit(&world(&pieces(&stadium, 0.005)), &tight).unwrap_err();
    assert!(matches!(error, FitError::Radius(_)) && error.to_string().contains("radius_min_m"), "{error}");
}

#[test]
fn errors_say_what_to_do() {
    let a = WorldPoint::new(0.0, 0.0);
    let b = WorldPoint::new(1.0, 0.0);
    let close = settings(1e-3);
    let said = |points: &[WorldPoint], settings: &FitSettings| fit(points, settings).unwrap_err().to_string();
    assert_eq!(fit(&[], &close), Err(FitError::Path(PathRefusal::TooFew(0))));
    assert_eq!(said(&[a], &close), "only one waypoint; a path needs at least two");
    assert!(said(&[a, b, b], &close).starts_with("waypoint 2: the same place"));
    assert!(said(&[a, WorldPoint::new(f64::NAN, 0.0)], &close).contains("finite"));
    assert!(said(&[a, b], &settings(0.0)).contains("too small to fit with"));
    assert!(said(&[a, b], &settings(-1.0)).contains("tolerance_m: -1 m is outside"));
    assert!(said(&[a, b], &settings(f64::NAN)).contains("tolerance_m"));
    let flat = FitSettings { radius_min_m: 0.0, ..close };
    assert!(said(&[a, b], &flat).contains("radius_min_m"));
}
