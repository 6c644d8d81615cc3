//! Judges fits by dense sampling; shares no formula with the fitter. Arcs are drawn from their bulge by the
//! angle at the chord's start, distances are to straight segments between samples.
#![allow(dead_code, clippy::disallowed_methods, reason = "shared by tests that each use a part")]

use hilare_planner::{Fit, FitSettings, WorldPoint};

pub type Point = (f64, f64);

pub fn settings(tolerance: f64) -> FitSettings {
    FitSettings { tolerance_m: tolerance, ..FitSettings::default() }
}

pub fn world(points: &[Point]) -> Vec<WorldPoint> {
    points.iter().map(|p| WorldPoint::new(p.0, p.1)).collect()
}

pub fn plain(points: &[WorldPoint]) -> Vec<Point> {
    points.iter().map(|p| (p.x_m, p.y_m)).collect()
}

pub fn distance(a: Point, b: Point) -> f64 {
    (b.0 - a.0).hypot(b.1 - a.1)
}

/// Headings at start and end of a segment, and its length.
pub fn headings(from: Point, to: Point, bulge: f64) -> (f64, f64, f64) {
    let chord = (to.1 - from.1).atan2(to.0 - from.0);
    let half = 2.0 * bulge.atan();
    let stretch = if half.abs() > 1e-9 { half / half.sin() } else { 1.0 };
    (chord - half, chord + half, distance(from, to) * stretch)
}

/// Points of a segment, `step` apart at most, without its start: chords at half the turned angle.
pub fn draw(from: Point, to: Point, bulge: f64, step: f64, out: &mut Vec<Point>) {
    let (start, end, length) = headings(from, to, bulge);
    let n = (length / step).ceil().max(1.0);
    for k in 1..=n as usize {
        let turned = (end - start) * k as f64 / n;
        let along = length * k as f64 / n;
        let half = 0.5 * turned;
        let chord = along * if half.abs() > 1e-9 { half.sin() / half } else { 1.0 };
        let (s, c) = (start + half).sin_cos();
        out.push((from.0 + chord * c, from.1 + chord * s));
    }
}

pub fn draw_fit(fit: &Fit, step: f64) -> Vec<Point> {
    let first = fit.waypoints[0];
    let mut out = vec![(first.x_m, first.y_m)];
    for pair in fit.waypoints.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        draw((a.x_m, a.y_m), (b.x_m, b.y_m), b.bulge, step, &mut out);
    }
    out
}

pub fn draw_line(points: &[Point], step: f64) -> Vec<Point> {
    let mut out = vec![points[0]];
    for pair in points.windows(2) {
        draw(pair[0], pair[1], 0.0, step, &mut out);
    }
    out
}

/// Distance from a point to a polyline.
pub fn to_line(p: Point, line: &[Point]) -> f64 {
    let edge = |pair: &[Point]| {
        let (dx, dy) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
        let t = ((p.0 - pair[0].0) * dx + (p.1 - pair[0].1) * dy) / (dx * dx + dy * dy);
        let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 };
        distance(p, (pair[0].0 + t * dx, pair[0].1 + t * dy))
    };
    line.windows(2).map(edge).fold(f64::INFINITY, f64::min)
}

/// Whether two rows of samples can be walked hand in hand, never back, within a distance (the discrete
/// Fréchet distance): every pair that can be reached, row by row.
pub fn hand_in_hand(a: &[Point], b: &[Point], within: f64) -> bool {
    let mut row = vec![false; b.len()];
    // Places of the row that can be reached lie in here.
    let (mut first, mut last) = (0, 0);
    for (i, p) in a.iter().enumerate() {
        let mut next = vec![false; b.len()];
        let (mut low, mut high) = (usize::MAX, 0);
        for j in first..b.len() {
            let came = (i == 0 && j == 0) || row[j] || (j > 0 && (next[j - 1] || row[j - 1]));
            next[j] = came && distance(*p, b[j]) <= within;
            if next[j] {
                (low, high) = (low.min(j), j);
            } else if j > last + 1 {
                break;
            }
        }
        if low == usize::MAX {
            return false;
        }
        (row, first, last) = (next, low, high);
    }
    row[b.len() - 1]
}

/// Everything a fit promises about where it is.
pub fn judge(points: &[Point], fit: &Fit, settings: &FitSettings) {
    let tolerance = settings.tolerance_m;
    let ends = [fit.waypoints[0], fit.waypoints[fit.waypoints.len() - 1]].map(|w| (w.x_m, w.y_m));
    assert_eq!(ends, [points[0], points[points.len() - 1]], "ends moved");
    assert_eq!((fit.waypoints[0].bulge, fit.lines + fit.arcs), (0.0, fit.waypoints.len() - 1));
    assert!(fit.deviation_m <= tolerance);
    let length: f64 = points.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
    let step = (0.1 * tolerance).max(length / 2000.0);
    let (drawn, line) = (draw_fit(fit, step), draw_line(points, step));
    // A drawn arc is a polyline: its own sagitta, and rounding.
    let radius = settings.radius_min_m.max(2.0 * tolerance);
    let slack = step * step / (8.0 * radius) + 1e-9;
    let worst = |from: &[Point], to: &[Point]| from.iter().map(|p| to_line(*p, to)).fold(0.0, f64::max);
    let (out, back) = (worst(&line, &drawn), worst(&drawn, points));
    assert!(out <= tolerance + slack, "polyline strays {out} from the fit, tolerance {tolerance}");
    assert!(back <= tolerance + slack, "fit strays {back} from the polyline, tolerance {tolerance}");
    assert!(out <= fit.deviation_m + slack, "says {} but strays {out}", fit.deviation_m);
    assert!(hand_in_hand(&line, &drawn, tolerance + step), "not in order within {tolerance}");
    for pair in fit.waypoints.windows(2) {
        let (a, b) = ((pair[0].x_m, pair[0].y_m), (pair[1].x_m, pair[1].y_m));
        assert!(distance(a, b) >= 1e-6 && pair[1].crab_rad == 0.0);
        let bulge = pair[1].bulge;
        if bulge != 0.0 {
            let (start, end, length) = headings(a, b, bulge);
            assert!((end - start).abs() <= 1.5 * std::f64::consts::PI + 1e-9);
            assert!(length / (end - start).abs() >= radius * (1.0 - 1e-9), "radius below {radius}");
        }
    }
}

/// Greatest change of heading where two segments meet, and where.
pub fn corners(fit: &Fit) -> Vec<(f64, Point)> {
    let at = |k: usize| (fit.waypoints[k].x_m, fit.waypoints[k].y_m);
    let heading = |k: usize| headings(at(k - 1), at(k), fit.waypoints[k].bulge);
    let meet = |k: usize| {
        let change = heading(k + 1).0 - heading(k).1;
        (change.sin().atan2(change.cos()).abs(), at(k))
    };
    (1..fit.waypoints.len() - 1).map(meet).collect()
}
