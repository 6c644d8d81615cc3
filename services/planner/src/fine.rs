//! The last word before "no way": two floods over a lattice of half cells, from start and goal in turns.
//!
//! On a cell map every tightest place between two squares has its middle on this lattice: the nearest points
//! of two squares are corners of cells, or can be chosen so, and their middle is a multiple of half a cell. A
//! disc that fits stands there, and leaves along the middle line, which a king's or knight's move follows
//! for the usual gaps. All moves are measured against the obstacles. What may remain refused although a way
//! exists: a gap hardly wider than the disc whose middle line runs in another direction, and, on obstacle
//! lists, a gap whose slack is below about a quarter of a raster cell.

use crate::budget::{Budget, refill};
use crate::check::Checker;
use crate::map::GridPoint;

/// Lattice points a cell side.
const PER_CELL: usize = 2;

/// Points between two looks at the budget: some 100 µs.
const POINTS_PER_CHECK: usize = 64;

/// King's moves, then knight's.
const MOVES: [(i32, i32); 16] = [
    (1, 0),
    (0, 1),
    (-1, 0),
    (0, -1),
    (1, 1),
    (-1, 1),
    (-1, -1),
    (1, -1),
    (2, 1),
    (1, 2),
    (-1, 2),
    (-2, 1),
    (-2, -1),
    (-1, -2),
    (1, -2),
    (2, -1),
];

/// What the floods found out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// a way, written to the path
    Way,
    /// one flood dried up without meeting the other
    NoWay,
    /// the budget ran out first
    Unknown,
}

/// The floods' buffers: a byte a lattice point, allocated on first use.
#[derive(Debug, Default)]
pub(crate) struct Fine {
    columns: usize,
    rows: usize,
    /// 0 dry, else 1 + move + 32 × side; sources have move 16
    mark: Vec<u8>,
    front: [Vec<u32>; 2],
}

const SOURCE: u8 = 16;
const SIDE: u8 = 32;

impl Fine {
    /// Looks for a way from `start` to `goal` and writes its points into `path`.
    pub fn run(
        &mut self,
        start: GridPoint,
        goal: GridPoint,
        checker: &Checker<'_>,
        budget: &mut dyn Budget,
        path: &mut Vec<GridPoint>,
    ) -> Verdict {
        let (width, height) = checker.field.size();
        (self.columns, self.rows) = (width * PER_CELL + 1, height * PER_CELL + 1);
        if !refill(&mut self.mark, self.columns * self.rows, 0, budget) {
            return Verdict::Unknown;
        }
        for (side, source) in [start, goal].into_iter().enumerate() {
            self.front[side].clear();
            if let Some((from, to)) = self.enter(source, side, checker) {
                self.join(start, goal, (from, to), path);
                return Verdict::Way;
            }
        }
        // an index into each front instead of a queue: what is behind it is done
        let mut done = [0usize; 2];
        loop {
            for (side, done) in done.iter_mut().enumerate() {
                for _ in 0..POINTS_PER_CHECK {
                    let Some(&point) = self.front[side].get(*done) else { return Verdict::NoWay };
                    *done += 1;
                    if let Some(meeting) = self.expand(point as usize, side, checker) {
                        self.join(start, goal, meeting, path);
                        return Verdict::Way;
                    }
                }
                if budget.exhausted() {
                    return Verdict::Unknown;
                }
            }
        }
    }

    fn place(&self, index: usize) -> GridPoint {
        let step = 1.0 / PER_CELL as f64;
        GridPoint::new((index % self.columns) as f64 * step, (index / self.columns) as f64 * step)
    }

    fn neighbour(&self, index: usize, du: i32, dv: i32) -> Option<usize> {
        let column = (index % self.columns) as i64 + i64::from(du);
        let row = (index / self.columns) as i64 + i64::from(dv);
        let inside = column >= 0 && row >= 0 && column < self.columns as i64 && row < self.rows as i64;
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// Wets the lattice points around a source that it sees; tells where the other flood already is.
    fn enter(&mut self, source: GridPoint, side: usize, checker: &Checker<'_>) -> Option<(usize, usize)> {
        const NEAR: i32 = 3;
        let column = ((source.u * PER_CELL as f64).round() as usize).min(self.columns - 1);
        let row = ((source.v * PER_CELL as f64).round() as usize).min(self.rows - 1);
        for dv in -NEAR..=NEAR {
            for du in -NEAR..=NEAR {
                let Some(index) = self.neighbour(row * self.columns + column, du, dv) else { continue };
                let place = self.place(index);
                if !checker.on_map(place) || !checker.segment(source, place) {
                    continue;
                }
                if self.mark[index] != 0 {
                    return Some((index, index));
                }
                self.mark[index] = 1 + SOURCE + SIDE * side as u8;
                self.front[side].push(index as u32);
            }
        }
        None
    }

    /// Wets the dry neighbours of a point; tells a pair (start's flood, goal's flood) where the floods meet.
    fn expand(&mut self, index: usize, side: usize, checker: &Checker<'_>) -> Option<(usize, usize)> {
        let from = self.place(index);
        let mine = SIDE * side as u8;
        for (number, &(du, dv)) in MOVES.iter().enumerate() {
            let Some(other) = self.neighbour(index, du, dv) else { continue };
            let mark = self.mark[other];
            if mark != 0 && (mark - 1) & SIDE == mine {
                continue;
            }
            let place = self.place(other);
            if !checker.on_map(place) || !checker.segment(from, place) {
                continue;
            }
            if mark != 0 {
                return Some(if side == 0 { (index, other) } else { (other, index) });
            }
            self.mark[other] = 1 + number as u8 + mine;
            self.front[side].push(other as u32);
        }
        None
    }

    /// start … meeting … goal.
    fn join(&self, start: GridPoint, goal: GridPoint, meeting: (usize, usize), path: &mut Vec<GridPoint>) {
        path.clear();
        self.trace(meeting.0, path);
        path.push(start);
        path.reverse();
        self.trace(meeting.1, path);
        path.push(goal);
        path.dedup();
    }

    fn trace(&self, from: usize, path: &mut Vec<GridPoint>) {
        let mut at = from;
        loop {
            path.push(self.place(at));
            let number = (self.mark[at] - 1) & (SIDE - 1);
            if number == SOURCE {
                break;
            }
            let (du, dv) = MOVES[usize::from(number)];
            match self.neighbour(at, -du, -dv) {
                Some(back) => at = back,
                None => break,
            }
        }
    }
}
