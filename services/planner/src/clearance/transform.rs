//! Exact Euclidean distance transform in linear time, from cell centres to blocked *squares*.
//!
//! Meijster, Roerdink, Hesselink, *A general algorithm for computing distance transforms in linear time*,
//! 2000: columns first, then the lower envelope of a parabola a column in each row; the envelope is built
//! with Felzenszwalb & Huttenlocher's stack (*Distance transforms of sampled functions*, 2012).
//! Departure: both measure from centre to centre. Here an obstacle is the whole closed square of a cell, so
//!
//! ```text
//!     D²(x) = min( V(x)²,  min over k of (x + ½ − k)² + min(V(k−1), V(k))² )
//! ```
//!
//! where V is the distance to the nearest square straight above or below, and k runs over the borders
//! between columns: the nearest point of a square in another column lies on one of its upright sides. A
//! border with V(k−1) = V(k) can be left out: from the right, column k's square is nearer than column
//! k−1's at the same height, and so on from column to column until V changes or x itself is reached; from
//! the left likewise. That empties the envelope along straight walls. All
//! is done in half cells, where every term is an integer; the envelope is exact, and only the final root is
//! rounded to f32.

/// Steps to the nearest blocked cell of the column when there is none.
const NONE: u16 = u16::MAX;

/// Key of a border without an obstacle above or below: above any other, and its double is finite.
const FAR: f64 = 1e300;

/// Distance in cells from every cell's centre to the nearest blocked square: 0 inside one, infinite when
/// nothing is blocked. Relative error of the f32 at most 2e-7. `mask` writes a row's cells, 1 where blocked,
/// else 0; neither side is above 65 000.
pub fn distance_to_squares(width: usize, height: usize, mask: impl Fn(usize, &mut [u8])) -> Vec<f32> {
    let mut steps = column_steps_down(width, height, mask);
    let mut distance = vec![0.0f32; width * height];
    let mut envelope = Envelope::new(width);
    for row in (0..height).rev() {
        let (current, above) = steps[row * width..].split_at_mut(width);
        if row + 1 < height {
            for (n, &up) in current.iter_mut().zip(&above[..width]) {
                *n = (*n).min(up.saturating_add(1));
            }
        }
        envelope.row(current, &mut distance[row * width..(row + 1) * width]);
    }
    distance
}

/// Steps down each column to the nearest blocked cell.
fn column_steps_down(width: usize, height: usize, mask: impl Fn(usize, &mut [u8])) -> Vec<u16> {
    let mut steps = vec![0u16; width * height];
    let mut blocked = vec![0u8; width];
    for row in 0..height {
        mask(row, &mut blocked);
        let (done, rest) = steps.split_at_mut(row * width);
        let current = rest[..width].iter_mut().zip(&blocked);
        // all ones where free, so that blocked cells come out zero without a branch
        let keep = |b: u8| u16::from(b).wrapping_sub(1);
        if row == 0 {
            current.for_each(|(n, &b)| *n = keep(b));
        } else {
            let below = &done[(row - 1) * width..];
            current.zip(below).for_each(|((n, &b), &down)| *n = down.saturating_add(1) & keep(b));
        }
    }
    steps
}

/// A stacked border between columns.
#[derive(Clone, Copy)]
struct Site {
    /// its number k
    border: u32,
    /// 4 k² + V²
    key: f64,
    /// first half-cell ordinate where it is the nearest
    from: f64,
}

/// Lower envelope of one row's parabolas; buffers kept between rows.
struct Envelope {
    /// 1 / (4 n), the reciprocal of the crossing's divisor
    reciprocal: Vec<f64>,
    sites: Vec<Site>,
    /// key of border k at k + 1
    keys: Vec<f64>,
    /// borders that may be on the hull
    live: Vec<u32>,
    /// a column's distance to its border, half cells
    across: Vec<f32>,
    /// a column's V² of its border, half cells
    along: Vec<f32>,
}

impl Envelope {
    fn new(width: usize) -> Self {
        let reciprocal = (0..=width + 1).map(|n| 0.25 / n as f64).collect();
        Self {
            reciprocal,
            sites: vec![Site { border: 0, key: 0.0, from: 0.0 }; width + 2],
            keys: vec![FAR; width + 3],
            live: vec![0; width + 2],
            across: vec![0.0; width],
            along: vec![0.0; width],
        }
    }

    fn row(&mut self, steps: &[u16], distance: &mut [f32]) {
        let depth = self.stack(steps);
        if depth == 0 {
            let alone = |&n: &u16| if n == 0 { 0.0 } else { f32::INFINITY };
            distance.iter_mut().zip(steps).for_each(|(d, n)| *d = alone(n));
            return;
        }
        self.spread(depth, steps.len());
        for (((d, &n), &across), &along) in distance.iter_mut().zip(steps).zip(&self.across).zip(&self.along)
        {
            let straight = (2.0 * f32::from(n) - 1.0).max(0.0);
            let square = (across * across + along).min(straight * straight);
            *d = 0.5 * square.sqrt();
        }
    }

    /// Writes the key 4 k² + V² of every border, [`FAR`] where there is none, with one border of padding.
    fn fill_keys(&mut self, steps: &[u16]) {
        let width = steps.len();
        let key = |k: usize, left: u16, right: u16| {
            let n = left.min(right);
            let half_cells = f64::from((2 * i32::from(n) - 1).max(0));
            let k = k as i32 as f64;
            // with the same V on both sides every column has a nearer border or its own V, see the module
            if left == right { FAR } else { 4.0 * k * k + half_cells * half_cells }
        };
        self.keys[1] = key(0, NONE, steps[0]);
        let inner = self.keys[2..=width].iter_mut().zip(steps).zip(&steps[1..]);
        for (k, ((slot, &left), &right)) in (1..).zip(inner) {
            *slot = key(k, left, right);
        }
        self.keys[width + 1] = key(width, steps[width - 1], NONE);
    }

    /// Lists the borders that are not above the chord between their neighbours: the envelope of equal
    /// parabolas is the lower convex hull of the points (k, key), and this test, free of branches, throws
    /// out most of what is not on it.
    fn list_convex(&mut self) -> usize {
        let mut count = 0;
        for (k, three) in self.keys.windows(3).enumerate() {
            self.live[count] = k as u32;
            count += usize::from(three[0] + three[2] > 2.0 * three[1]);
        }
        count
    }

    /// Builds the stack of borders that are nearest somewhere; returns how many.
    fn stack(&mut self, steps: &[u16]) -> usize {
        self.fill_keys(steps);
        let count = self.list_convex();
        let reach = 2.0 * steps.len() as f64;
        let mut depth = 0usize;
        // the top of the stack, kept at hand
        let mut top = Site { border: 0, key: 0.0, from: f64::NEG_INFINITY };
        for &k in &self.live[..count] {
            let key = self.keys[k as usize + 1];
            let mut from = f64::NEG_INFINITY;
            while depth > 0 {
                from = (key - top.key) * self.reciprocal[(k - top.border) as usize];
                if from > top.from {
                    break;
                }
                depth -= 1;
                from = f64::NEG_INFINITY;
                if depth > 0 {
                    top = self.sites[depth - 1];
                }
            }
            // a border that takes over beyond the last column is never nearest
            if from < reach {
                top = Site { border: k, key, from };
                self.sites[depth] = top;
                depth += 1;
            }
        }
        depth
    }

    /// Gives every column its nearest border.
    fn spread(&mut self, depth: usize, width: usize) {
        let mut column = 0usize;
        for level in 0..depth {
            let site = self.sites[level];
            let until = match self.sites[..depth].get(level + 1) {
                // column x has half-cell ordinate 2 x + 1 and belongs to the next border above its `from`
                Some(next) => (((next.from + 1.0) * 0.5) as i64).clamp(column as i64, width as i64) as usize,
                None => width,
            };
            let k = f64::from(site.border);
            let along = (site.key - 4.0 * k * k) as f32;
            let offset = 1 - 2 * site.border as i32;
            let rest = self.across[column..until].iter_mut().zip(&mut self.along[column..until]);
            for (x, (across, height)) in (column as i32..).zip(rest) {
                *across = (2 * x + offset) as f32;
                *height = along;
            }
            column = until;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::distance_to_squares;
    use proptest::prelude::*;

    fn brute(width: usize, blocked: &[bool]) -> Vec<f64> {
        let gap = |a: usize, b: usize| (a.abs_diff(b) as f64 - 0.5).max(0.0);
        let at = |i: usize| (i % width, i / width);
        let nearest = |i: usize| {
            let (x, y) = at(i);
            let squares = (0..blocked.len()).filter(|&j| blocked[j]).map(at);
            squares
                .map(|(a, b)| gap(x, a) * gap(x, a) + gap(y, b) * gap(y, b))
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        };
        (0..blocked.len()).map(nearest).collect()
    }

    proptest! {
        #[test]
        fn equals_brute_force(width in 1usize..24, height in 1usize..24, density in 0.0f64..1.0, seed: u64) {
            let mut state = seed | 1;
            let blocked: Vec<bool> = (0..width * height)
                .map(|_| {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    ((state >> 33) as f64) < density * density * 2147483648.0
                })
                .collect();
            let ours = {
                let mask = |row: usize, out: &mut [u8]| {
                    let cells = &blocked[row * width..];
                    out.iter_mut().zip(cells).for_each(|(o, &b)| *o = u8::from(b));
                };
                distance_to_squares(width, height, mask)
            };
            for (a, b) in ours.iter().zip(brute(width, &blocked)) {
                let same = f64::from(*a) == b || (f64::from(*a) - b).abs() <= 2e-7 * b;
                prop_assert!(same, "{a} is not {b}");
            }
        }
    }
}
