//! The graph: nodes in buckets, edges as half-edge lists in one arena, a stack of temporary nodes on top.

use crate::budget::Budget;
use crate::map::GridPoint;

/// Index of a node.
pub type NodeId = u32;

/// Up to here a look at every node is quicker than a look at the buckets.
const FEW_NODES: usize = 128;

/// End of a list.
const NIL: u32 = u32::MAX;

/// What is known about an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Validity {
    Unknown,
    Free,
    Blocked,
}

/// One direction of an edge; its twin has the index with the lowest bit flipped.
#[derive(Clone, Copy, Debug)]
pub struct HalfEdge {
    pub to: NodeId,
    next: u32,
    pub length: f64,
}

/// The roadmap. Every list is an index chain in one of four arenas, so that clearing keeps the memory.
#[derive(Debug, Default)]
pub struct Roadmap {
    points: Vec<GridPoint>,
    first_edge: Vec<u32>,
    next_in_bucket: Vec<u32>,
    edges: Vec<HalfEdge>,
    validity: Vec<Validity>,
    buckets: Vec<u32>,
    columns: usize,
    rows: usize,
    bucket_side: f64,
    /// nodes that are not temporary; they come first
    permanent: usize,
    /// nearest neighbours found, least first: squared distance, node
    nearest: Vec<(f64, NodeId)>,
}

/// Nodes and edges at one moment, to return to.
#[derive(Clone, Copy, Debug)]
pub struct Mark {
    nodes: usize,
    edges: usize,
}

impl Roadmap {
    /// Empties the roadmap for an area of `width` × `height` cells and about `expected` nodes.
    pub fn clear(&mut self, width: f64, height: f64, expected: usize) {
        const NODES_PER_BUCKET: f64 = 2.0;
        self.permanent = 0;
        self.points.clear();
        self.first_edge.clear();
        self.next_in_bucket.clear();
        self.edges.clear();
        self.validity.clear();
        self.bucket_side = (width * height * NODES_PER_BUCKET / expected.max(16) as f64)
            .sqrt()
            .max(width.max(height) / 1024.0);
        self.columns = (width / self.bucket_side) as usize + 1;
        self.rows = (height / self.bucket_side) as usize + 1;
        self.buckets.clear();
        self.buckets.resize(self.columns * self.rows, NIL);
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Where a node is.
    pub fn point(&self, node: NodeId) -> GridPoint {
        self.points[node as usize]
    }

    /// All edges, for drawings: both ends and what is known.
    pub fn edges(&self) -> impl Iterator<Item = (GridPoint, GridPoint, Validity)> + '_ {
        let pairs = self.edges.as_chunks::<2>().0.iter().zip(&self.validity);
        pairs.map(|([there, back], &validity)| (self.point(back.to), self.point(there.to), validity))
    }

    /// Checks the edges of which nothing is known yet.
    pub fn check_edges(&mut self, free: impl Fn(GridPoint, GridPoint) -> bool, budget: &mut dyn Budget) {
        for index in 0..self.validity.len() {
            if self.validity[index] == Validity::Unknown && !budget.exhausted() {
                let (there, back) = (self.edges[2 * index].to, self.edges[2 * index + 1].to);
                let is_free = free(self.point(back), self.point(there));
                self.validity[index] = if is_free { Validity::Free } else { Validity::Blocked };
            }
        }
    }

    /// Adds a node that stays.
    pub fn add(&mut self, point: GridPoint) -> NodeId {
        let node = self.add_temporary(point);
        let bucket = self.bucket_of(point);
        self.next_in_bucket[node as usize] = self.buckets[bucket];
        self.buckets[bucket] = node;
        self.permanent = self.points.len();
        node
    }

    /// Adds a node that neighbour searches do not see, until [`Roadmap::truncate`].
    pub fn add_temporary(&mut self, point: GridPoint) -> NodeId {
        let node = self.points.len() as NodeId;
        self.points.push(point);
        self.first_edge.push(NIL);
        self.next_in_bucket.push(NIL);
        node
    }

    /// Adds an edge.
    pub fn connect(&mut self, a: NodeId, b: NodeId, validity: Validity) {
        let length = self.point(a).distance(self.point(b));
        let edge = self.edges.len() as u32;
        self.edges.push(HalfEdge { to: b, next: self.first_edge[a as usize], length });
        self.edges.push(HalfEdge { to: a, next: self.first_edge[b as usize], length });
        self.first_edge[a as usize] = edge;
        self.first_edge[b as usize] = edge + 1;
        self.validity.push(validity);
    }

    /// The present size.
    pub fn mark(&self) -> Mark {
        Mark { nodes: self.points.len(), edges: self.edges.len() }
    }

    /// Drops all temporary nodes and the edges added since `mark`.
    pub fn truncate(&mut self, mark: Mark) {
        while self.edges.len() > mark.edges {
            let (back, there) = (self.edges.pop(), self.edges.pop());
            if let (Some(back), Some(there)) = (back, there) {
                // lists grow at their heads, so undoing in reverse order restores them
                self.first_edge[there.to as usize] = back.next;
                self.first_edge[back.to as usize] = there.next;
            }
        }
        self.validity.truncate(mark.edges / 2);
        self.points.truncate(mark.nodes);
        debug_assert!(self.permanent <= mark.nodes);
        self.first_edge.truncate(mark.nodes);
        self.next_in_bucket.truncate(mark.nodes);
    }

    /// The half-edges that leave a node.
    pub fn edges_of(&self, node: NodeId) -> impl Iterator<Item = (u32, HalfEdge)> + '_ {
        let mut index = self.first_edge[node as usize];
        std::iter::from_fn(move || {
            let edge = *self.edges.get(index as usize)?;
            let this = index;
            index = edge.next;
            Some((this, edge))
        })
    }

    /// What is known about the edge of a half-edge.
    pub fn validity(&self, half_edge: u32) -> Validity {
        self.validity[half_edge as usize / 2]
    }

    /// Remembers the outcome of a check.
    pub fn set_validity(&mut self, half_edge: u32, validity: Validity) {
        self.validity[half_edge as usize / 2] = validity;
    }

    /// The edge between two nodes, if there is one.
    pub fn find_edge(&self, a: NodeId, b: NodeId) -> Option<u32> {
        self.edges_of(a).find(|(_, edge)| edge.to == b).map(|(index, _)| index)
    }

    fn bucket_of(&self, p: GridPoint) -> usize {
        let column = ((p.u / self.bucket_side) as usize).min(self.columns - 1);
        let row = ((p.v / self.bucket_side) as usize).min(self.rows - 1);
        row * self.columns + column
    }

    /// The (up to) `count` nodes nearest to `p`, nearest first; of equally near ones the older first.
    ///
    /// The list stays until the next search; read it with [`Roadmap::neighbour`] while adding edges.
    pub fn find_nearest(&mut self, p: GridPoint, count: usize) {
        let mut found = std::mem::take(&mut self.nearest);
        found.clear();
        if self.permanent <= FEW_NODES {
            for (node, &q) in self.points[..self.permanent].iter().enumerate() {
                insert_sorted(&mut found, count, (square(p, q), node as NodeId));
            }
            self.nearest = found;
            return;
        }
        let column = (p.u / self.bucket_side) as usize;
        let row = (p.v / self.bucket_side) as usize;
        let longest = self.columns.max(self.rows);
        for ring in 0..=longest {
            // all nodes of further rings are at least this far
            let safe = (ring as f64 - 1.0).max(0.0) * self.bucket_side;
            if found.len() == count && found[count - 1].0 <= safe * safe {
                break;
            }
            self.visit_ring(column, row, ring, |bucket| {
                let mut node = self.buckets[bucket];
                while node != NIL {
                    let q = self.points[node as usize];
                    insert_sorted(&mut found, count, (square(p, q), node));
                    node = self.next_in_bucket[node as usize];
                }
            });
        }
        self.nearest = found;
    }

    /// The `index`-th of the nodes found by [`Roadmap::find_nearest`].
    pub fn neighbour(&self, index: usize) -> Option<NodeId> {
        self.nearest.get(index).map(|&(_, node)| node)
    }

    fn visit_ring(&self, column: usize, row: usize, ring: usize, mut visit: impl FnMut(usize)) {
        let low = row.saturating_sub(ring);
        let high = (row + ring).min(self.rows - 1);
        for r in low..=high {
            let whole = r + ring == row || r == row + ring;
            let step = if whole || ring == 0 { 1 } else { 2 * ring };
            for c in (0..=2 * ring).step_by(step) {
                if let Some(c) = (column + c).checked_sub(ring).filter(|&c| c < self.columns) {
                    visit(r * self.columns + c);
                }
            }
        }
    }
}

fn square(p: GridPoint, q: GridPoint) -> f64 {
    let (du, dv) = (q.u - p.u, q.v - p.v);
    du * du + dv * dv
}

fn insert_sorted(found: &mut Vec<(f64, NodeId)>, count: usize, item: (f64, NodeId)) {
    let before = |a: &(f64, NodeId), b: &(f64, NodeId)| a.0 < b.0 || a.0 == b.0 && a.1 < b.1;
    if found.len() == count {
        match found.last() {
            Some(last) if before(&item, last) => found.pop(),
            _ => return,
        };
    }
    let mut at = found.len();
    found.push(item);
    while at > 0 && before(&item, &found[at - 1]) {
        found[at] = found[at - 1];
        at -= 1;
    }
    found[at] = item;
}
