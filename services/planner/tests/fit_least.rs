//! No fit with joints on the points has fewer segments: every pair of points, every bulge, by sampling.
#![allow(clippy::disallowed_methods, reason = "tests may use the system's mathematics")]

mod fit_judge;

use fit_judge::*;
use hilare_planner::{FitSettings, fit};
use proptest::prelude::*;

/// How a chain may be walked beside a segment.
#[derive(Clone, Copy)]
enum Order {
    /// Never back, in any pairing (Fréchet).
    Any,
    /// Each point beside the nearest place, or waiting where the chain runs back: the rule for arcs.
    Nearest,
}

fn in_order(order: Order, line: &[Point], segment: &[Point], within: f64) -> bool {
    if matches!(order, Order::Any) {
        return hand_in_hand(line, segment, within);
    }
    let mut at = 0;
    line.iter().all(|p| {
        let off = |k: &usize| distance(*p, segment[*k]);
        let nearest = (0..segment.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        at = at.max(nearest);
        // The fitter looks at five bulges for this rule, not at all: a tenth less.
        off(&at) <= if at == nearest { within } else { 0.9 * within }
    })
}

/// Whether some line or arc between the ends of a chain stays with it, by trying bulges one by one.
fn some_piece(chain: &[Point], settings: &FitSettings, within: f64, order: Order) -> bool {
    let (from, to) = (chain[0], chain[chain.len() - 1]);
    let step = 0.08 * settings.tolerance_m;
    let line = draw_line(chain, step);
    let radius_min = settings.radius_min_m.max(2.0 * settings.tolerance_m);
    const N: i32 = 400;
    (-N..=N).any(|k| {
        let bulge = (1.5 * std::f64::consts::PI / 4.0 * f64::from(k) / f64::from(N)).tan();
        let (start, end, length) = headings(from, to, bulge);
        let radius = length / (end - start).abs();
        if bulge != 0.0 && !(radius_min..=settings.radius_max_m).contains(&radius) {
            return false;
        }
        let mut coarse = vec![from];
        draw(from, to, bulge, step, &mut coarse);
        chain.iter().all(|p| to_line(*p, &coarse) <= within) && in_order(order, &line, &coarse, within)
    })
}

/// The fewest segments, by trying all subsets of joints through a table of pairs.
fn fewest(points: &[Point], settings: &FitSettings, within: f64, order: Order) -> usize {
    let n = points.len();
    let mut count = vec![usize::MAX; n];
    count[0] = 0;
    for to in 1..n {
        for from in 0..to {
            if count[from] + 1 < count[to]
                && (to == from + 1 || some_piece(&points[from..=to], settings, within, order))
            {
                count[to] = count[from] + 1;
            }
        }
    }
    count[n - 1]
}

fn check(points: &[Point], tolerance: f64, order: Order) -> (usize, usize) {
    let settings = settings(tolerance);
    let fit = fit(&world(points), &settings).unwrap();
    judge(points, &fit, &settings);
    assert!(fit.least);
    // What the samples find within a little less, the fit finds within the tolerance.
    (fit.waypoints.len() - 1, fewest(points, &settings, 0.97 * tolerance, order))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn none_has_fewer_on_wandering_chains(
        turns in prop::collection::vec(-0.8..0.8f64, 3..9), tolerance in 0.02..0.15f64,
    ) {
        let (mut at, mut heading) = ((0.0_f64, 0.0_f64), 0.0_f64);
        let mut points = vec![at];
        for turn in turns {
            heading += turn;
            at = (at.0 + 0.2 * heading.cos(), at.1 + 0.2 * heading.sin());
            points.push(at);
        }
        let (ours, brute) = check(&points, tolerance, Order::Any);
        prop_assert!(ours <= brute, "{ours}, {brute} is possible");
    }

    #[test]
    fn none_has_fewer_on_wild_points(
        points in prop::collection::vec((-0.5..0.5f64, -0.5..0.5f64), 3..7), tolerance in 0.02..0.2f64,
    ) {
        let (ours, brute) = check(&points, tolerance, Order::Nearest);
        prop_assert!(ours <= brute, "{ours}, {brute} is possible");
    }
}

#[test]
fn the_search_by_hand_would_also_find_an_arc() {
    let arc: Vec<_> = (0..=6).map(|k| (0.4 * f64::from(k)).sin_cos()).map(|(s, c)| (c, s)).collect();
    assert_eq!(check(&arc, 0.05, Order::Any), (1, 1));
    assert_eq!(check(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], 0.05, Order::Any), (2, 2));
}
