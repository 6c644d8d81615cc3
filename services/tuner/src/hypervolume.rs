//! Hypervolume: how much a front dominates, up to a reference point; exact for two and three objectives.

/// The volume that `points` dominate below `reference` (all objectives minimised). Points that are not
/// below the reference in every objective add nothing, and neither do dominated ones. Two objectives take
/// n log n steps, three n².
///
/// # Panics
///
/// If there are neither two nor three objectives, or a point has another number of them.
pub fn hypervolume<'p>(points: impl IntoIterator<Item = &'p [f64]>, reference: &[f64]) -> f64 {
    let inside = points.into_iter().filter(|point| {
        assert_eq!(point.len(), reference.len(), "objectives of a point and of the reference");
        point.iter().zip(reference).all(|(value, limit)| value < limit)
    });
    match *reference {
        [right, top] => area(inside.map(|point| [point[0], point[1]]).collect(), [right, top]),
        [right, top, far] => {
            volume(inside.map(|point| [point[0], point[1], point[2]]).collect(), [right, top, far])
        }
        _ => panic!("hypervolume of {} objectives", reference.len()),
    }
}

/// Sweeps from left to right; every point that is lower than all before adds a rectangle.
fn area(mut points: Vec<[f64; 2]>, reference: [f64; 2]) -> f64 {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut low = reference[1];
    let mut sum = 0.0;
    for [x, y] in points {
        if y < low {
            sum += (reference[0] - x) * (low - y);
            low = y;
        }
    }
    sum
}

/// Sweeps along the third objective; between two points the cross-section is the area of the
/// staircase of all points passed.
fn volume(mut points: Vec<[f64; 3]>, reference: [f64; 3]) -> f64 {
    points.sort_by(|a, b| a[2].total_cmp(&b[2]));
    // Ascending in x, descending in y.
    let mut stairs: Vec<[f64; 2]> = Vec::with_capacity(points.len());
    let mut section = 0.0;
    let mut sum = 0.0;
    for (index, &[x, y, z]) in points.iter().enumerate() {
        section += step_in(&mut stairs, [x, y], [reference[0], reference[1]]);
        let next = points.get(index + 1).map_or(reference[2], |point| point[2]);
        sum += section * (next - z);
    }
    sum
}

/// Adds a point to a staircase; what the area grows by.
fn step_in(stairs: &mut Vec<[f64; 2]>, [x, y]: [f64; 2], [right, top]: [f64; 2]) -> f64 {
    let at = stairs.partition_point(|stair| stair[0] < x);
    let before = if at > 0 { stairs[at - 1][1] } else { top };
    // Dominated by the stair before, or by the one at the same x.
    if before <= y || stairs.get(at).is_some_and(|stair| stair[0] == x && stair[1] <= y) {
        return 0.0;
    }
    let covered = stairs[at..].iter().take_while(|stair| stair[1] >= y).count();
    let end = at + covered;
    let mut grown = 0.0;
    let (mut left, mut ceiling) = (x, before);
    for &[stair_x, stair_y] in &stairs[at..end] {
        grown += (stair_x - left) * (ceiling - y);
        (left, ceiling) = (stair_x, stair_y);
    }
    let limit = stairs.get(end).map_or(right, |stair| stair[0]);
    grown += (limit - left) * (ceiling - y);
    stairs.splice(at..end, [[x, y]]);
    grown
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(points: &[&[f64]], reference: &[f64]) -> f64 {
        hypervolume(points.iter().copied(), reference)
    }

    #[test]
    fn by_hand() {
        assert_eq!(of(&[], &[1.0, 1.0]), 0.0);
        assert_eq!(of(&[&[0.0, 0.0]], &[2.0, 3.0]), 6.0);
        // An L of three squares, a point on the border and one dominated.
        assert_eq!(of(&[&[0.0, 1.0], &[1.0, 0.0], &[2.0, 0.0], &[1.5, 1.5]], &[2.0, 2.0]), 3.0);
        assert_eq!(of(&[&[0.0, 0.0, 0.0]], &[1.0, 2.0, 3.0]), 6.0);
        // Three unit boxes about the corner of a cube of two: 8 - 1.
        let three: [&[f64]; 3] = [&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]];
        assert_eq!(of(&three, &[2.0, 2.0, 2.0]), 7.0);
        // The same point twice counts once.
        assert_eq!(of(&[&[1.0, 0.0, 0.0], &[1.0, 0.0, 0.0]], &[2.0, 2.0, 2.0]), 4.0);
    }
}
