//! Thins a long curve for drawing.

/// At most about `limit` of the points, in their order. Of every stretch its first, its last and its
/// extremes in x and y stay, so neither a peak nor the outline of a trail is lost.
pub fn thin(points: &[(f64, f64)], limit: usize) -> Vec<(f64, f64)> {
    /// Points a stretch may leave: two ends, four extremes.
    const KEPT: usize = 6;
    if points.len() <= limit.max(KEPT) {
        return points.to_vec();
    }
    let stretch = points.len().div_ceil((limit / KEPT).max(1));
    let mut kept = Vec::with_capacity(limit + KEPT);
    for part in points.chunks(stretch) {
        let mut at = [0; KEPT];
        at[1] = part.len() - 1;
        for (n, (x, y)) in part.iter().enumerate() {
            for (slot, beats) in [
                (2, *x < part[at[2]].0),
                (3, *x > part[at[3]].0),
                (4, *y < part[at[4]].1),
                (5, *y > part[at[5]].1),
            ] {
                if beats {
                    at[slot] = n;
                }
            }
        }
        at.sort_unstable();
        let mut last = None;
        for n in at {
            if last.replace(n) != Some(n) {
                kept.push(part[n]);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_ends_and_order_stay() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|n| (f64::from(n), f64::from(n % 7))).collect();
        points[54_321].1 = 99.0;
        points[12_345].1 = -99.0;
        let kept = thin(&points, 4000);
        assert!(kept.len() <= 4000, "{}", kept.len());
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(kept.contains(&points[54_321]) && kept.contains(&points[12_345]));
        assert_eq!((kept.first(), kept.last()), (points.first(), points.last()));
    }

    #[test]
    fn short_curves_stay_as_they_are() {
        for n in [0, 1, 5, 4000] {
            let points = vec![(1.0, 2.0); n];
            assert_eq!(thin(&points, 4000), points);
        }
        assert!(thin(&vec![(1.0, 2.0); 9000], 4000).len() <= 4000);
    }
}
