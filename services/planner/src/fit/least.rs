//! The fewest steps from the first of n places to the last.

/// Goes from place 0 to place n − 1 in the fewest steps that `step(from, to)` allows: breadth first, each
/// pair of places asked about once at most. `None` where there is no way, or when `tired` says so before
/// the end.
pub(super) fn fewest<T>(
    n: usize,
    step: &mut impl FnMut(usize, usize) -> Option<T>,
    tired: &mut impl FnMut() -> bool,
) -> Option<Vec<(usize, T)>> {
    if let Some(found) = step(0, n - 1) {
        return Some(vec![(n - 1, found)]);
    }
    let mut came: Vec<Option<(usize, T)>> = (0..n).map(|_| None).collect();
    let (mut level, mut next) = (vec![0], Vec::new());
    // Places not reached yet, the farthest first.
    let mut open: Vec<usize> = (1..n - 1).rev().collect();
    while !level.is_empty() {
        for &from in level.iter().rev() {
            for &to in &open[..open.partition_point(|&to| to > from)] {
                if tired() {
                    return None;
                }
                let Some(found) = step(from, to) else { continue };
                came[to] = Some((from, found));
                // No place of a level before this one leads to the end, so the first that does is best.
                if let Some(found) = step(to, n - 1) {
                    came[n - 1] = Some((to, found));
                    return Some(unwind(came));
                }
                next.push(to);
            }
            open.retain(|&to| came[to].is_none());
        }
        next.sort_unstable();
        std::mem::swap(&mut level, &mut next);
        next.clear();
    }
    None
}

fn unwind<T>(mut came: Vec<Option<(usize, T)>>) -> Vec<(usize, T)> {
    let mut steps = Vec::new();
    let mut at = came.len() - 1;
    while let Some((from, found)) = came[at].take() {
        steps.push((at, found));
        at = from;
    }
    steps.reverse();
    steps
}

/// Goes from place to place, each time as far as doubling and halving strides find: O(log n) questions a
/// step. Reach need not be monotone, so this is a heuristic. `Err` is the place from which no step leads on.
pub(super) fn farthest<T>(
    n: usize,
    step: &mut impl FnMut(usize, usize) -> Option<T>,
) -> Result<Vec<(usize, T)>, usize> {
    let mut steps = Vec::new();
    let mut at = 0;
    while at + 1 < n {
        let (mut best, mut beyond, mut misses, mut stride) = (None, n, 0, 1);
        while at + stride < n && (misses < MISSES || best.is_none()) {
            match step(at, at + stride) {
                Some(found) => (best, beyond, misses) = (Some((at + stride, found)), n, 0),
                None => {
                    beyond = beyond.min(at + stride);
                    misses += 1;
                }
            }
            stride = (stride + stride.div_ceil(2)).max(stride + 1);
        }
        let mut reach = best.as_ref().map_or(at, |(to, _)| *to);
        while reach + 1 < beyond {
            let middle = usize::midpoint(reach, beyond);
            match step(at, middle) {
                Some(found) => (reach, best) = (middle, Some((middle, found))),
                None => beyond = middle,
            }
        }
        steps.push(best.ok_or(at)?);
        at = reach;
    }
    Ok(steps)
}

/// Strides that fail in a row before the search turns back.
const MISSES: u32 = 8;
