//! Completeness: a wavefront over the grid that links every roadmap node to its neighbours in the free space.
//!
//! A multi-source Dijkstra wave starts at all nodes at once and gives every free cell the node it is nearest
//! to by way of the grid: a geodesic Voronoi diagram. Where two nodes' regions touch, the two ways to their
//! nodes together are a free way between them. So after one pass, linear in cells, the roadmap has exactly
//! the connectivity of the grid, every free cell knows a way to a node, and later queries never search cells.
//!
//! Why valid centres prove the moves between them (cell maps only). All obstacles are unit squares aligned
//! with the cells. The distance to such a square, taken along one axis, is zero from the square's one side
//! to the other and linear outside, so between two neighbouring centre lines it is monotone or constant.
//! Over the unit square spanned by four neighbouring centres the least distance to any one obstacle is
//! therefore found at one of the four, as it is over the line between two of them. Hence: an axis move
//! between valid centres is valid; a diagonal one is, when all four centres are. Everything else (diagonals
//! past an invalid centre, obstacle lists) is measured.

use crate::budget::{Budget, refill};
use crate::check::Checker;
use crate::map::GridPoint;
use crate::prm::{NodeId, Roadmap};

/// Cells between two looks at the budget: some 100 µs.
const CELLS_PER_CHECK: u32 = 1024;

/// Nodes between two looks at the budget while they are placed.
const NODES_PER_CHECK: u32 = 32;

/// Cost of an axis and of a diagonal move, whose ratio 7/5 is near √2 (Borgefors, *Distance transformations
/// in digital images*, 1986).
const AXIS: u32 = 5;
const DIAGONAL: u32 = 7;

/// Moves: column, row, cost. A cell's `back` is the index of the move that came to it, plus one.
const MOVES: [(i32, i32, u32); 8] = [
    (1, 0, AXIS),
    (0, 1, AXIS),
    (-1, 0, AXIS),
    (0, -1, AXIS),
    (1, 1, DIAGONAL),
    (-1, 1, DIAGONAL),
    (-1, -1, DIAGONAL),
    (1, -1, DIAGONAL),
];

/// No node.
pub(crate) const NOBODY: NodeId = NodeId::MAX;

/// A place where two regions touch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub nodes: (NodeId, NodeId),
    pub cells: (u32, u32),
    pub cost: u32,
}

/// What the wave knows of a cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    owner: NodeId,
    cost: u32,
    /// move that led here plus one; 0 at a source or where nothing came
    back: u8,
    /// the robot fits here
    valid: bool,
    settled: bool,
}

/// The wave's state, 12 bytes a cell, allocated on first use.
#[derive(Debug, Default)]
pub(crate) struct Links {
    width: usize,
    height: usize,
    cells: Vec<Cell>,
    /// open cells by cost modulo 8 (no move costs more than 7)
    open: [Vec<u32>; 8],
    /// per node, the start of its chain in `contacts`
    first_contact: Vec<u32>,
    contacts: Vec<(Contact, u32)>,
    done: bool,
    /// valid centres prove the moves between them, see the module
    proof_by_cells: bool,
}

impl Links {
    /// Forgets everything but the memory.
    pub fn clear(&mut self) {
        self.done = false;
        self.contacts.clear();
        self.first_contact.clear();
    }

    /// True once a wave has covered the map.
    pub fn done(&self) -> bool {
        self.done
    }

    /// Number of contacts.
    pub fn contact_count(&self) -> usize {
        self.contacts.len()
    }

    /// Contact by index.
    pub fn contact(&self, index: usize) -> Contact {
        self.contacts[index].0
    }

    /// Runs the wave from every node of `roadmap`, then from `extra` points whose surroundings it did not
    /// reach (they become nodes). False when the budget ran out; a later call starts over.
    pub fn run(
        &mut self,
        roadmap: &mut Roadmap,
        extra: [GridPoint; 2],
        checker: &Checker<'_>,
        budget: &mut dyn Budget,
    ) -> bool {
        if !self.begin(checker, budget) {
            return false;
        }
        for node in 0..roadmap.len() as NodeId {
            self.seed(roadmap.point(node), node, checker);
            if node.is_multiple_of(NODES_PER_CHECK) && budget.exhausted() {
                return false;
            }
        }
        if !self.spread(checker, budget) {
            return false;
        }
        for point in extra {
            let Some(cell) = self.entry(point, checker) else { continue };
            if self.cells[cell].owner == NOBODY {
                let node = roadmap.add(point);
                self.seed(point, node, checker);
                if !self.spread(checker, budget) {
                    return false;
                }
            }
        }
        self.done = true;
        true
    }

    fn begin(&mut self, checker: &Checker<'_>, budget: &mut dyn Budget) -> bool {
        let (width, height) = checker.field.size();
        let cells = width * height;
        (self.width, self.height, self.done) = (width, height, false);
        self.proof_by_cells = checker.field.squares_only();
        self.contacts.clear();
        self.first_contact.clear();
        self.open.iter_mut().for_each(Vec::clear);
        let blank = Cell { owner: NOBODY, cost: 0, back: 0, valid: false, settled: false };
        if !refill(&mut self.cells, cells, blank, budget) {
            return false;
        }
        for index in 0..cells {
            if (index as u32).is_multiple_of(CELLS_PER_CHECK) && budget.exhausted() {
                return false;
            }
            self.cells[index].valid = if checker.field.squares_only() && checker.inset <= 0.5 {
                checker.field.at_cell(index) >= checker.radius
            } else {
                checker.point(self.centre(index))
            };
        }
        true
    }

    fn centre(&self, index: usize) -> GridPoint {
        GridPoint::new((index % self.width) as f64 + 0.5, (index / self.width) as f64 + 0.5)
    }

    /// A valid cell near `p` whose centre can be reached straight from it.
    fn entry(&self, p: GridPoint, checker: &Checker<'_>) -> Option<usize> {
        const NEAR: i64 = 2;
        let (column, row) = (p.u.floor() as i64, p.v.floor() as i64);
        let mut best: Option<(f64, usize)> = None;
        for r in (row - NEAR).max(0)..=(row + NEAR).min(self.height as i64 - 1) {
            for c in (column - NEAR).max(0)..=(column + NEAR).min(self.width as i64 - 1) {
                let index = r as usize * self.width + c as usize;
                let far = p.distance(self.centre(index));
                if self.cells[index].valid
                    && best.is_none_or(|(least, _)| far < least)
                    && checker.segment(p, self.centre(index))
                {
                    best = Some((far, index));
                }
            }
        }
        best.map(|(_, index)| index)
    }

    fn seed(&mut self, point: GridPoint, node: NodeId, checker: &Checker<'_>) {
        self.first_contact.resize(node as usize + 1, u32::MAX);
        if let Some(cell) = self.entry(point, checker).filter(|&cell| self.cells[cell].owner == NOBODY) {
            let source = &mut self.cells[cell];
            (source.owner, source.cost, source.back) = (node, 0, 0);
            self.open[0].push(cell as u32);
        }
    }

    /// Dijkstra with buckets (Dial, *Algorithm 360*, 1969).
    fn spread(&mut self, checker: &Checker<'_>, budget: &mut dyn Budget) -> bool {
        let mut work = 0u32;
        let mut cost = 0u32;
        let mut empty = 0;
        while empty < 8 {
            let mut bucket = std::mem::take(&mut self.open[cost as usize % 8]);
            empty = if bucket.is_empty() { empty + 1 } else { 0 };
            let mut next = 0;
            while let Some(&cell) = bucket.get(next) {
                next += 1;
                let cell = cell as usize;
                if !self.cells[cell].settled && self.cells[cell].cost == cost {
                    self.settle(cell, checker);
                    work += 1;
                }
                if work == CELLS_PER_CHECK {
                    work = 0;
                    if budget.exhausted() {
                        return false;
                    }
                }
            }
            bucket.clear();
            self.open[cost as usize % 8] = bucket;
            cost += 1;
        }
        true
    }

    fn settle(&mut self, cell: usize, checker: &Checker<'_>) {
        self.cells[cell].settled = true;
        let this = self.cells[cell];
        // 32-bit division is several times quicker
        let (column, row) = (cell as u32 % self.width as u32, cell as u32 / self.width as u32);
        for (index, (du, dv, price)) in MOVES.into_iter().enumerate() {
            let (c, r) = (column as i32 + du, row as i32 + dv);
            if c < 0 || r < 0 || c >= self.width as i32 || r >= self.height as i32 {
                continue;
            }
            let other = (cell as i64 + i64::from(dv) * self.width as i64 + i64::from(du)) as usize;
            let that = self.cells[other];
            if !that.valid || that.settled && that.owner == this.owner {
                continue;
            }
            let better = that.owner == NOBODY || this.cost + price < that.cost;
            if !that.settled && !better {
                continue;
            }
            let square = price == DIAGONAL && self.open_square(cell, other, du);
            // two regions that meet across an open square also meet along one of its sides
            if that.settled && square || !square && !self.passes(cell, other, price, checker) {
                continue;
            }
            if that.settled {
                self.touch(cell, other, price);
            } else {
                let cost = this.cost + price;
                self.cells[other] = Cell { owner: this.owner, cost, back: index as u8 + 1, ..that };
                self.open[cost as usize % 8].push(other as u32);
            }
        }
    }

    /// True when the other two cells of a diagonal move's square are valid, and that proves the move.
    fn open_square(&self, from: usize, to: usize, du: i32) -> bool {
        let (a, b) = ((from as i64 + i64::from(du)) as usize, (to as i64 - i64::from(du)) as usize);
        self.proof_by_cells && self.cells[a].valid && self.cells[b].valid
    }

    /// True when the move between two valid neighbours is valid, diagonals of open squares aside.
    fn passes(&self, from: usize, to: usize, price: u32, checker: &Checker<'_>) -> bool {
        self.proof_by_cells && price == AXIS
            || checker.segment(self.centre(from.min(to)), self.centre(from.max(to)))
    }

    /// Notes the cheapest contact of two regions.
    fn touch(&mut self, cell: usize, other: usize, price: u32) {
        let cost = self.cells[cell].cost + self.cells[other].cost + price;
        let swap = self.cells[other].owner < self.cells[cell].owner;
        let (low, high) = if swap { (other, cell) } else { (cell, other) };
        let nodes = (self.cells[low].owner, self.cells[high].owner);
        let contact = Contact { nodes, cells: (low as u32, high as u32), cost };
        let mut index = self.first_contact[nodes.0 as usize];
        while let Some((known, next)) = self.contacts.get_mut(index as usize) {
            if known.nodes == nodes {
                if cost < known.cost {
                    *known = contact;
                }
                return;
            }
            index = *next;
        }
        let next = self.first_contact[nodes.0 as usize];
        self.first_contact[nodes.0 as usize] = self.contacts.len() as u32;
        self.contacts.push((contact, next));
    }

    /// The node that owns `cell`, after writing the centres on the way from `cell` to it.
    pub fn walk(&self, cell: usize, path: &mut Vec<GridPoint>) -> NodeId {
        let mut at = cell;
        loop {
            path.push(self.centre(at));
            let Some(back) = usize::from(self.cells[at].back).checked_sub(1) else { break };
            let (du, dv, _) = MOVES[back];
            at = (at as i64 - i64::from(dv) * self.width as i64 - i64::from(du)) as usize;
        }
        self.cells[cell].owner
    }

    /// The way from a free point to the node its surroundings belong to: the point itself, then centres.
    pub fn walk_from(
        &self,
        p: GridPoint,
        checker: &Checker<'_>,
        path: &mut Vec<GridPoint>,
    ) -> Option<NodeId> {
        path.clear();
        let cell = self.entry(p, checker).filter(|&cell| self.cells[cell].owner != NOBODY)?;
        path.push(p);
        Some(self.walk(cell, path))
    }
}
