//! A point of the front.

/// The place of the member with the least weighted sum of its objectives, each measured from the best to the worst
/// of the front. Members beyond `reference` do not count unless all are. With equal weights it is the knee: the
/// member farthest below the line (or plane) between the ends of the front. `None` for an empty front.
pub fn choose(front: &[Vec<f64>], reference: &[f64], weights: &[f64]) -> Option<usize> {
    let inside = |point: &[f64]| point.iter().zip(reference).all(|(value, limit)| value < limit);
    let any_inside = front.iter().any(|point| inside(point));
    let counted = || front.iter().enumerate().filter(|(_, point)| !any_inside || inside(point));
    let extent = |axis: usize| {
        let values = || counted().map(|(_, point)| point[axis]);
        let low = values().fold(f64::INFINITY, f64::min);
        (low, values().fold(low, f64::max))
    };
    let extents: Vec<(f64, f64)> = (0..weights.len()).map(extent).collect();
    let sum = |point: &[f64]| -> f64 {
        let parts = point.iter().zip(&extents).zip(weights);
        parts
            .map(
                |((value, (low, high)), weight)| {
                    if high > low { weight * (value - low) / (high - low) } else { 0.0 }
                },
            )
            .sum()
    };
    counted().min_by(|(_, a), (_, b)| sum(a).total_cmp(&sum(b))).map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent() -> Vec<Vec<f64>> {
        // In other units, so that a sum that is not scaled would take an end.
        [[0.0, 1000.0], [0.2, 500.0], [0.3, 200.0], [0.7, 100.0], [1.0, 0.0], [9.0, -1.0]]
            .map(|point| point.to_vec())
            .to_vec()
    }

    #[test]
    fn equal_weights_are_the_knee_and_others_lean() {
        let reference = [2.0, 2000.0];
        assert_eq!(choose(&bent(), &reference, &[1.0, 1.0]), Some(2));
        assert_eq!(choose(&bent(), &reference, &[100.0, 1.0]), Some(0));
        assert_eq!(choose(&bent(), &reference, &[1.0, 100.0]), Some(4), "what is beyond does not count");
    }

    #[test]
    fn small_fronts() {
        assert_eq!(choose(&[], &[1.0, 1.0], &[1.0, 1.0]), None);
        assert_eq!(choose(&[vec![5.0, 5.0]], &[1.0, 1.0], &[1.0, 1.0]), Some(0));
    }
}
