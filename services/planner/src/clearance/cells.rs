//! Exact distances to blocked cells, from a bit set of the cells at the rim of obstacles.

use super::Corner;
use super::distance::Segment;
use crate::map::GridPoint;

/// Blocked cells with a free 4-neighbour: what is nearest to a free point is one of their squares.
#[derive(Debug)]
pub struct RimCells {
    width: usize,
    height: usize,
    words_per_row: usize,
    words: Vec<u64>,
}

impl RimCells {
    /// The rim of the cells that `mask` marks: it writes a row's cells, 1 where blocked, else 0.
    pub fn new(width: usize, height: usize, mask: impl Fn(usize, &mut [u8])) -> Self {
        let words_per_row = width.div_ceil(64);
        let mut words = vec![0u64; words_per_row * height];
        let mut bytes = vec![0u8; words_per_row * 64];
        let mut pack = |row: usize, out: &mut [u64]| {
            mask(row, &mut bytes[..width]);
            for (word, chunk) in out.iter_mut().zip(bytes.as_chunks::<64>().0) {
                *word = pack_bits(chunk);
            }
        };
        // three rows of plain bits travel along; beyond the map counts as blocked, nobody stands there
        let mut below = vec![u64::MAX; words_per_row];
        let mut here = vec![0u64; words_per_row];
        let mut above = vec![0u64; words_per_row];
        pack(0, &mut here);
        for row in 0..height {
            if row + 1 < height {
                pack(row + 1, &mut above);
            } else {
                above.fill(u64::MAX);
            }
            let out = &mut words[row * words_per_row..][..words_per_row];
            for i in 0..words_per_row {
                let left = here[i] << 1 | if i > 0 { here[i - 1] >> 63 } else { 1 };
                let last = (width - 1) % 64;
                let right = match here.get(i + 1) {
                    Some(next) => here[i] >> 1 | next << 63,
                    None => here[i] >> 1 | 1 << last,
                };
                out[i] = here[i] & !(left & right & below[i] & above[i]);
            }
            std::mem::swap(&mut below, &mut here);
            std::mem::swap(&mut here, &mut above);
        }
        Self { width, height, words_per_row, words }
    }

    /// The convex corners of the rim, each with the diagonal out of it.
    pub fn corners(&self, each: &mut dyn FnMut(Corner)) {
        const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
        let blocked = |column: usize, row: usize| {
            // only the rim is stored; inside an obstacle no corner is asked for
            column < self.width
                && row < self.height
                && self.words[row * self.words_per_row + column / 64] >> (column % 64) & 1 == 1
        };
        for row in 0..self.height {
            for index in 0..self.words_per_row {
                let mut bits = self.words[row * self.words_per_row + index];
                while bits != 0 {
                    let column = index * 64 + bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let right = blocked(column + 1, row);
                    let left = column > 0 && blocked(column - 1, row);
                    let above = blocked(column, row + 1);
                    let below = row > 0 && blocked(column, row - 1);
                    for (beside, over, u, v) in
                        [(right, above, 1, 1), (left, above, 0, 1), (left, below, 0, 0), (right, below, 1, 0)]
                    {
                        if !beside && !over {
                            let at = GridPoint::new((column + u) as f64, (row + v) as f64);
                            let out = |side: usize| if side == 1 { DIAGONAL } else { -DIAGONAL };
                            each(Corner { at, out: (out(u), out(v)), mitre: std::f64::consts::SQRT_2 });
                        }
                    }
                }
            }
        }
    }

    /// Least squared distance (cells²) from the segment to a rim square, or `limit2` if none is below it;
    /// returns early once below `stop2`.
    pub fn nearest2(&self, segment: &Segment, limit2: f64, stop2: f64) -> f64 {
        let reach = limit2.sqrt();
        let span = |low: f64, high: f64, cells: usize| {
            let first = (low - reach).floor().max(0.0) as usize;
            let last = (high + reach).floor().max(-1.0);
            (first, if last < 0.0 { 0 } else { (last as usize + 1).min(cells) })
        };
        let (a, b) = (segment.a, segment.b);
        let (first_row, end_row) = span(a.v.min(b.v), a.v.max(b.v), self.height);
        let (first_column, end_column) = span(a.u.min(b.u), a.u.max(b.u), self.width);
        if first_column >= end_column {
            return limit2;
        }
        let mut best = limit2;
        for row in first_row..end_row {
            let words = &self.words[row * self.words_per_row..][..self.words_per_row];
            let indices = first_column / 64..=(end_column - 1) / 64;
            for (index, &word) in indices.clone().zip(&words[indices]) {
                let base = index * 64;
                let mut bits = word;
                if base < first_column {
                    bits &= u64::MAX << (first_column - base);
                }
                if end_column - base < 64 {
                    bits &= !(u64::MAX << (end_column - base));
                }
                while bits != 0 {
                    let column = base + bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let min = [column as f64, row as f64];
                    best = best.min(segment.to_box2(min, [min[0] + 1.0, min[1] + 1.0], best));
                    if best < stop2 {
                        return best;
                    }
                }
            }
        }
        best
    }
}

/// Bit i of the result is byte i, which is 0 or 1.
fn pack_bits(bytes: &[u8; 64]) -> u64 {
    let eights = bytes.as_chunks::<8>().0.iter().enumerate();
    eights.fold(0, |word, (index, &eight)| {
        // the product gathers the lowest bits of the eight bytes in its highest byte
        let gathered = u64::from_le_bytes(eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        word | gathered << (8 * index)
    })
}
