//! Where the numbers of the waypoints go: beside the path, not over it or each other.

use super::canvas::text_width;

/// Numbers drawn at most; a longer path has every second, fifth, tenth, … waypoint numbered.
const MOST: usize = 60;
/// Distance of a number's middle from its waypoint, pixels.
const AWAY: f64 = 14.0;
/// Font size, pixels.
pub const SIZE: i32 = 12;

/// A number and where its middle goes, pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The waypoint's index.
    pub text: String,
    /// Middle of the text.
    pub at: (f64, f64),
}

impl Label {
    fn half_size(&self) -> (f64, f64) {
        (f64::from(text_width(&self.text, SIZE)) / 2.0 + 1.0, f64::from(SIZE) / 2.0 + 1.0)
    }

    fn covers(&self, (x, y): (f64, f64), margin: (f64, f64)) -> bool {
        let (w, h) = self.half_size();
        (x - self.at.0).abs() < w + margin.0 && (y - self.at.1).abs() < h + margin.1
    }
}

/// Places the numbers of `waypoints` (pixels). Of eight places about a waypoint the one with the
/// fewest `ink` points under it is taken; a number that finds no free one is left out.
pub fn place(waypoints: &[(f64, f64)], ink: &[(f64, f64)]) -> Vec<Label> {
    let stride = stride(waypoints.len());
    let mut placed: Vec<Label> = Vec::new();
    for index in (0..waypoints.len()).step_by(stride) {
        let here = waypoints[index];
        let neighbours = [index.checked_sub(1), Some(index + 1)]
            .map(|n| n.and_then(|n| waypoints.get(n)).map(|p| unit(here, *p)));
        let outward = outward(neighbours);
        let mut best: Option<(usize, Label)> = None;
        for turn in [0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0] {
            let direction = rotated(outward, turn * std::f64::consts::PI);
            let mut label = Label { text: index.to_string(), at: here };
            // A long number needs more room sideways.
            let sideways = AWAY + (label.half_size().0 - f64::from(SIZE) / 2.0).max(0.0);
            label.at = (here.0 + sideways * direction.0, here.1 + AWAY * direction.1);
            if placed.iter().any(|other| other.covers(label.at, label.half_size())) {
                continue;
            }
            // On a segment of the path is worse than on any trail.
            let on_path = neighbours.iter().flatten().any(|n| n.0 * direction.0 + n.1 * direction.1 > 0.8);
            let under = ink.iter().filter(|point| label.covers(**point, (1.0, 1.0))).count();
            let cost = under + if on_path { 100_000 } else { 0 };
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, label));
            }
        }
        // Where only some are numbered, one that would lie on a curve is better left out.
        placed.extend(best.filter(|(cost, _)| stride == 1 || *cost == 0).map(|(_, label)| label));
    }
    placed
}

/// 1, 2, 5, 10, 20, … so that at most [`MOST`] remain.
fn stride(count: usize) -> usize {
    (0..).flat_map(|power| [1, 2, 5].map(|n| n * 10usize.pow(power))).find(|n| count <= n * MOST).unwrap_or(1)
}

/// Away from both neighbours: the outside of a corner.
fn outward([before, after]: [Option<(f64, f64)>; 2]) -> (f64, f64) {
    let (a, b) = (before.unwrap_or_default(), after.unwrap_or_default());
    let away = unit((a.0 + b.0, a.1 + b.1), (0.0, 0.0));
    if away != (0.0, 0.0) {
        return away;
    }
    // Straight on, or alone: to the side.
    if a == (0.0, 0.0) { (0.0, -1.0) } else { (-a.1, a.0) }
}

/// Unit vector between two points; nothing when they are (nearly) the same.
fn unit(from: (f64, f64), to: (f64, f64)) -> (f64, f64) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let length = dx.hypot(dy);
    if length < 1e-6 { (0.0, 0.0) } else { (dx / length, dy / length) }
}

fn rotated((x, y): (f64, f64), angle: f64) -> (f64, f64) {
    let (sin, cos) = angle.sin_cos();
    (cos * x - sin * y, sin * x + cos * y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_numbered_on_their_outside() {
        let labels = place(&[(0.0, 0.0), (100.0, 0.0), (100.0, 100.0)], &[]);
        assert_eq!(labels.iter().map(|l| l.text.as_str()).collect::<Vec<_>>(), ["0", "1", "2"]);
        assert!(
            labels[0].at.0 < 0.0 && labels[1].at.0 > 100.0 && labels[1].at.1 < 0.0 && labels[2].at.1 > 100.0
        );
    }

    #[test]
    fn many_or_equal_waypoints_are_numbered_sparsely() {
        assert_eq!([1, 43, 60, 61, 65_536].map(stride), [1, 1, 1, 2, 2000]);
        let same = place(&[(5.0, 5.0); 50], &[]);
        assert!((1..=8).contains(&same.len()));
        for (n, label) in same.iter().enumerate() {
            assert!(same[n + 1..].iter().all(|other| !other.covers(label.at, label.half_size())));
        }
    }
}
