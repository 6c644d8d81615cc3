//! Shorter paths with clearance kept: shortcuts, corner pulling, corner cutting.
//!
//! Every change replaces straight pieces by straight pieces that the checker has passed, so the path is valid
//! at every moment and its length never grows.

use crate::budget::Budget;
use crate::check::Checker;
use crate::map::GridPoint;

/// Halvings in a search along a line: the path ends within 2^-STEPS of how far it can be pulled.
const STEPS: u32 = 4;

/// Share of the way below which a pull is not worth its checks.
const LEAST: f64 = 1.0 / 32.0;

/// Times every corner is cut: a corner becomes up to four, which is within 0.3 % of the arc it stands for.
const CUTS: u32 = 2;

/// Buffers of the smoother.
#[derive(Debug, Default)]
pub(crate) struct Smoother {
    scratch: Vec<GridPoint>,
}

impl Smoother {
    /// Makes `path` shorter, until the budget ends at the latest. `path` starts and ends where it did.
    pub fn smooth(&mut self, path: &mut Vec<GridPoint>, checker: &Checker<'_>, budget: &mut dyn Budget) {
        self.shortcut(path, checker);
        for _ in 0..CUTS {
            if budget.exhausted() {
                return;
            }
            self.cut(path, checker);
            pull(path, checker);
            self.shortcut(path, checker);
        }
    }

    /// From each kept point goes straight to the furthest later point in sight, looking ahead in doubling
    /// strides and back by halves; sight need not be monotone, so this is a heuristic, not the best subset.
    pub fn shortcut(&mut self, path: &mut Vec<GridPoint>, checker: &Checker<'_>) {
        self.scratch.clear();
        let last = path.len() - 1;
        let mut at = 0;
        self.scratch.push(path[0]);
        while at < last {
            let mut sees = at + 1;
            let mut stride = 2;
            let mut blind = last + 1;
            while sees < last {
                let ahead = (at + stride).min(last);
                if !checker.segment(path[at], path[ahead]) {
                    blind = ahead;
                    break;
                }
                sees = ahead;
                stride *= 2;
            }
            while sees + 1 < blind && blind <= last {
                let middle = usize::midpoint(sees, blind);
                if checker.segment(path[at], path[middle]) {
                    sees = middle;
                } else {
                    blind = middle;
                }
            }
            at = sees;
            self.scratch.push(path[at]);
        }
        std::mem::swap(path, &mut self.scratch);
    }

    /// Replaces each corner by the longest chord across it that is free.
    fn cut(&mut self, path: &mut Vec<GridPoint>, checker: &Checker<'_>) {
        self.scratch.clear();
        self.scratch.push(path[0]);
        for index in 1..path.len() - 1 {
            let before = self.scratch[self.scratch.len() - 1];
            let (corner, after) = (path[index], path[index + 1]);
            // half of each leg is left to the neighbouring corners
            let chord = |t: f64| (corner.towards(before, 0.5 * t), corner.towards(after, 0.5 * t));
            let free = |t: f64| {
                let (p, q) = chord(t);
                checker.segment(p, q)
            };
            let t = furthest(free);
            if t > 0.0 {
                let (p, q) = chord(t);
                self.scratch.extend([p, q]);
            } else {
                self.scratch.push(corner);
            }
        }
        self.scratch.push(path[path.len() - 1]);
        std::mem::swap(path, &mut self.scratch);
    }
}

/// Pulls every corner towards the foot of its perpendicular on the line between its neighbours, as far as
/// both legs stay free.
fn pull(path: &mut [GridPoint], checker: &Checker<'_>) {
    for index in 1..path.len().saturating_sub(1) {
        let (before, corner, after) = (path[index - 1], path[index], path[index + 1]);
        let foot = nearest_on(before, after, corner);
        let free = |t: f64| {
            let p = corner.towards(foot, t);
            checker.segment(before, p) && checker.segment(p, after)
        };
        path[index] = corner.towards(foot, furthest(free));
    }
}

/// The largest t in \[0, 1\] found free by halving, 0 being free.
fn furthest(free: impl Fn(f64) -> bool) -> f64 {
    // most corners are taut already: one look tells
    if !free(LEAST) {
        return 0.0;
    }
    if free(1.0) {
        return 1.0;
    }
    let (mut good, mut bad) = (LEAST, 1.0);
    for _ in 0..STEPS {
        let middle = 0.5 * (good + bad);
        if free(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

/// The point of segment a–b nearest to `p`.
fn nearest_on(a: GridPoint, b: GridPoint, p: GridPoint) -> GridPoint {
    let (du, dv) = (b.u - a.u, b.v - a.v);
    let square = du * du + dv * dv;
    if square == 0.0 {
        return a;
    }
    a.towards(b, (((p.u - a.u) * du + (p.v - a.v) * dv) / square).clamp(0.0, 1.0))
}

/// Length of a path, cells.
pub(crate) fn length(path: &[GridPoint]) -> f64 {
    path.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}
