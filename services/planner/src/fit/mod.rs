//! Curves into straight lines and circular arcs, as few as the tolerance allows.
//!
//! `// [LM12]` "any complex curve is fitted by straight lines and circular arcs": paper 2 says that and no
//! more, so everything here is ours.
//!
//! **What is promised.** The curve is the polyline through the points. The fit's segments and stretches of
//! the polyline belong to each other one by one, and there is an order-preserving pairing of all points of a
//! stretch with all points of its segment in which no pair is farther apart than the tolerance (their Fréchet
//! distance). So every point of the polyline is within the tolerance of the fit, every point of the fit within
//! it of the polyline, and what the polyline does to and fro the fit does too. Ends are kept to the bit.
//! The arcs' sweep is 270° at most and their radius at least the greatest of `radius_min_m` and twice
//! the tolerance; what is flatter than `radius_max_m` must do as a line.
//!
//! **What is least.** Without `tangent` all joints are points of the input. When [`Fit::least`] is true, no
//! such fit has fewer segments: breadth-first search over the points, each pair decided by the interval of
//! bulges within the tolerance (`bulges.rs`). Two things it does not count as possible: an arc beside which the
//! chain runs back by more than the tolerance allows to one that waits at the nearest place (`follow.rs`; of the
//! interval's bulges five are asked), and an arc over a chord shorter than the tolerance. It is searched so
//! up to 2048 points, as long as noise does not make every pair a long look; beyond, joints are sought among
//! 2048 points evenly picked, and over all points by striding as far as each segment reaches; the better of the
//! two is taken. Time grows as n log n then.
//!
//! **Without corners.** With `tangent` segments meet with one heading, except at the polyline's
//! own corners sharper than `corner_rad` (`tangent.rs`). Joints then lie beside the points, within the
//! tolerance. Where no such curve has the least radius, the fit is refused and says where.
//!
//! Only + − × ÷ √ and `libm`: same points, same settings, same bits.

mod bulges;
mod chain;
mod follow;
mod least;
mod tangent;
mod vector;

use crate::goal::{PathRefusal, check_path};
use bulges::{Finder, Limits};
use chain::Chain;
use follow::Fitted;
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::messages::{MAX_WAYPOINTS, Waypoint};
use hilare_interfaces::param_group;
use hilare_interfaces::params::{ParamError, ParamGroup};
use std::fmt;
use vector::Vector;

param_group! {
    /// How a polyline becomes lines and arcs.
    FitSettings {
        /// Distance that the fit may stray from the polyline; 0: no fit, the waypoints stay as they are.
        tolerance_m: f64 = 0.0, "m", 0.0, 10.0;
        /// Segments meet without a corner.
        tangent: bool = false, "", 0, 1;
        /// With tangent: the polyline's own corners sharper than this stay corners.
        corner_rad: f64 = 0.8, "rad", 0.01, 3.2;
        /// Least radius of an arc; twice the tolerance if that is more.
        radius_min_m: f64 = 0.01, "m", 1e-4, 1000.0;
        /// Greatest radius of an arc; what is flatter is a line.
        radius_max_m: f64 = 1000.0, "m", 0.1, 1e5;
    }
}

/// Least tolerance that can be held, m: below it, rounding at the far end of the allowed coordinates shows.
const TOLERANCE_MIN_M: f64 = 1e-6;
/// Points up to which every point may be a joint of the search for the least.
const LEAST_MOST: usize = 2048;
/// Edges and boxes the search may look at before it gives up the claim: some tenths of a second.
const WORK: u64 = 30_000_000;

/// Lines and arcs in place of a polyline.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The segments' ends; the first is where the path begins.
    pub waypoints: Vec<Waypoint>,
    /// Greatest distance of a point of the polyline from its segment, metres.
    pub deviation_m: f64,
    /// Straight segments.
    pub lines: usize,
    /// Arcs.
    pub arcs: usize,
    /// True when the search was complete: no fit with joints on the input's points has fewer segments (see the
    /// module's head). False with `tangent`, above 2048 points, and where the search gave up.
    pub least: bool,
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FitError {
    /// The points cannot be followed.
    Path(PathRefusal),
    /// A setting is out of its bounds.
    Setting(&'static str, ParamError),
    /// The tolerance is zero or below what can be held.
    Tolerance(f64),
    /// No curve without corners leads on from this place.
    Corner(WorldPoint),
    /// None leads on with the least radius; it would with a tighter one.
    Radius(WorldPoint),
    /// The fit has more waypoints than a path may have.
    TooMany(usize),
}

impl fmt::Display for FitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place =
            |f: &mut fmt::Formatter<'_>, p: &WorldPoint| write!(f, " at ({:.3}, {:.3}) m; ", p.x_m, p.y_m);
        match self {
            Self::Path(refusal) => match refusal.index() {
                Some(index) => write!(f, "waypoint {index}: {refusal}"),
                None => refusal.fmt(f),
            },
            Self::Setting(name, error) => write!(f, "{name}: {error}"),
            Self::Tolerance(value) => {
                write!(f, "tolerance_m: {value} m is too small to fit with; at least {TOLERANCE_MIN_M} m")
            }
            Self::Corner(point) => {
                write!(f, "no curve without corners")?;
                place(f, point)?;
                write!(f, "raise tolerance_m or lower corner_rad")
            }
            Self::Radius(point) => {
                write!(f, "no curve without corners as wide as radius_min_m")?;
                place(f, point)?;
                write!(f, "raise tolerance_m, or lower radius_min_m or corner_rad")
            }
            Self::TooMany(n) => {
                write!(f, "more than {MAX_WAYPOINTS} waypoints ({n}) after fitting; raise tolerance_m")
            }
        }
    }
}

impl std::error::Error for FitError {}

/// Fits a polyline by lines and arcs. Points are checked as [`check_path`] does: two at the same place in a
/// row are refused.
pub fn fit(points: &[WorldPoint], settings: &FitSettings) -> Result<Fit, FitError> {
    let waypoints: Vec<Waypoint> = points.iter().map(|point| Waypoint::from(*point)).collect();
    check_path(&waypoints).map_err(FitError::Path)?;
    for spec in FitSettings::SPECS {
        let value = settings.get(spec.name).unwrap_or(spec.default);
        spec.check(value).map_err(|error| FitError::Setting(spec.name, error))?;
    }
    if settings.tolerance_m < TOLERANCE_MIN_M {
        return Err(FitError::Tolerance(settings.tolerance_m));
    }
    let limits = Limits {
        tolerance: settings.tolerance_m,
        radius_min: settings.radius_min_m,
        radius_max: settings.radius_max_m,
    };
    let points: Vec<Vector> = points.iter().map(|point| Vector::from(*point)).collect();
    let (pieces, least) = if settings.tangent {
        let smooth = tangent::fit_smooth(&points, limits, settings.corner_rad);
        let stuck = |stuck: tangent::Stuck| {
            let place = stuck.at.world();
            if stuck.too_tight { FitError::Radius(place) } else { FitError::Corner(place) }
        };
        (smooth.map_err(stuck)?, false)
    } else {
        fit_least(points, limits)
    };
    collect(&pieces, least)
}

fn collect(pieces: &[Fitted], least: bool) -> Result<Fit, FitError> {
    if pieces.len() + 1 > MAX_WAYPOINTS {
        return Err(FitError::TooMany(pieces.len() + 1));
    }
    let start = pieces[0].piece.from.world();
    let mut waypoints = vec![Waypoint::from(start)];
    waypoints.extend(pieces.iter().map(|fitted| {
        let piece = fitted.piece;
        Waypoint { x_m: piece.to.x, y_m: piece.to.y, bulge: piece.bulge, crab_rad: 0.0 }
    }));
    let lines = pieces.iter().filter(|fitted| fitted.piece.bulge == 0.0).count();
    let deviation_m = pieces.iter().map(|fitted| fitted.deviation).fold(0.0, f64::max);
    Ok(Fit { waypoints, deviation_m, lines, arcs: pieces.len() - lines, least })
}

/// The fewest segments with joints on points, and whether that is proven.
fn fit_least(points: Vec<Vector>, limits: Limits) -> (Vec<Fitted>, bool) {
    let chain = Chain::new(points);
    let finder = Finder::new(&chain, limits);
    let n = chain.len();
    let picked = n.min(LEAST_MOST);
    let pick = |k: usize| k * (n - 1) / (picked - 1);
    let mut step = |from: usize, to: usize| finder.piece(pick(from), pick(to));
    let searched = least::fewest(picked, &mut step, &mut || finder.looks.get() > WORK);
    if let Some(steps) = &searched
        && picked == n
    {
        return (steps.iter().map(|step| step.1).collect(), true);
    }
    // A neighbour is always reached, by a line.
    let strides = least::farthest(n, &mut |from, to| finder.piece(from, to)).unwrap_or_default();
    let steps = match searched {
        Some(searched) if searched.len() < strides.len() => searched,
        _ => strides,
    };
    (steps.into_iter().map(|step| step.1).collect(), false)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points that make the search look closely: noise, to and fro, turns at the tolerance.
    fn hard(kind: usize, n: usize) -> Vec<Vector> {
        let mut state = 7_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let at = |k: usize| 6.0 * k as f64 / n as f64;
        let point = |k: usize| match kind {
            0 => Vector::new(at(k) + 2e-3 * random(), 0.3 * libm::sin(4.0 * at(k)) + 2e-3 * random()),
            1 => Vector::new(at(k) + 1.7e-3 * f64::from((k % 2) as u8), 0.0),
            2 => Vector::new(libm::cos(at(k)), libm::sin(at(k))) * (1.0 + 1.9e-3 * random()),
            _ => Vector::new(random(), random()),
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn the_work_is_bounded_whatever_the_points() {
        let limits = Limits { tolerance: 1e-3, radius_min: 0.01, radius_max: 1000.0 };
        for kind in 0..4 {
            for n in [4096, MAX_WAYPOINTS] {
                let chain = Chain::new(hard(kind, n));
                let finder = Finder::new(&chain, limits);
                let picked = |k: usize| k * (n - 1) / (LEAST_MOST - 1);
                let mut step = |from, to| finder.piece(picked(from), picked(to));
                least::fewest(LEAST_MOST, &mut step, &mut || finder.looks.get() > WORK);
                // One question may run over.
                let over = 40 * n as u64;
                assert!(finder.looks.get() <= WORK + over, "kind {kind}, {n}: {}", finder.looks.get());
                let finder = Finder::new(&chain, limits);
                assert!(least::farthest(n, &mut |from, to| finder.piece(from, to)).is_ok());
                // n log n; most is 2.2 n log₂ n, for the noise.
                let most = 4 * n as u64 * u64::from(n.ilog2());
                assert!(finder.looks.get() <= most, "kind {kind}, {n}: {} looks", finder.looks.get());
            }
        }
    }
}
