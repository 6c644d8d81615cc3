//! Waypoints along a path.

use crate::map::GridPoint;

/// What a path on the wire holds at most; corners are kept even beyond it.
const MOST_WAYPOINTS: usize = 65_536;

/// Divides `path` into pieces about `spacing` cells long and writes their ends into `waypoints`.
///
/// The number of pieces is the path's length over `spacing`, rounded up, or the number of legs if that is
/// more. Every corner stays a waypoint, since a chord across it would cut into the clearance; the rest are
/// dealt to the legs one by one, each to the leg with the longest pieces, so that the longest piece is as
/// short as it can be. `shares` is a buffer.
pub(crate) fn resample(
    path: &[GridPoint],
    spacing: f64,
    shares: &mut Vec<u32>,
    waypoints: &mut Vec<GridPoint>,
) {
    let legs = path.len() - 1;
    let lengths = || path.windows(2).map(|pair| pair[0].distance(pair[1]));
    // a path without length still has its legs
    let total = lengths().sum::<f64>().max(f64::MIN_POSITIVE);
    let pieces = ((total / spacing).ceil() as usize).min(MOST_WAYPOINTS - 1).max(legs);
    // start from what any fair division gives at least, then deal the rest
    shares.clear();
    shares.extend(lengths().map(|leg| ((leg / total * (pieces - legs) as f64) as u32).max(1)));
    let mut dealt: usize = shares.iter().map(|&n| n as usize).sum();
    while dealt < pieces {
        let piece = |(leg, &n): (f64, &u32)| leg / f64::from(n);
        let longest = lengths().zip(shares.iter()).map(piece).enumerate();
        let (index, _) = longest.fold((0, -1.0), |best, next| if next.1 > best.1 { next } else { best });
        shares[index] += 1;
        dealt += 1;
    }
    waypoints.clear();
    waypoints.push(path[0]);
    for (pair, &n) in path.windows(2).zip(shares.iter()) {
        waypoints.extend((1..n).map(|i| pair[0].towards(pair[1], f64::from(i) / f64::from(n))));
        waypoints.push(pair[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_corners_and_count() {
        let path = [GridPoint::new(0.0, 0.0), GridPoint::new(10.0, 0.0), GridPoint::new(10.0, 3.5)];
        let mut waypoints = Vec::new();
        resample(&path, 1.0, &mut Vec::new(), &mut waypoints);
        assert_eq!(waypoints.len(), 15);
        assert!(waypoints.contains(&path[1]));
        let longest = waypoints.windows(2).map(|p| p[0].distance(p[1])).fold(0.0, f64::max);
        assert!(longest <= 1.0 + 1e-12, "{longest}");
    }

    #[test]
    fn odd_spacings_keep_the_corners_and_the_bound() {
        let path = [GridPoint::new(0.0, 0.0), GridPoint::new(3.0, 0.0), GridPoint::new(3.0, 4.0)];
        let mut waypoints = Vec::new();
        for (spacing, expected) in [(1e-9, MOST_WAYPOINTS), (f64::MAX, 3)] {
            resample(&path, spacing, &mut Vec::new(), &mut waypoints);
            assert_eq!(waypoints.len(), expected);
        }
        let still = [GridPoint::new(1.0, 1.0); 2];
        resample(&still, 1.0, &mut Vec::new(), &mut waypoints);
        assert_eq!(waypoints, still);
    }
}
