//! A* on the roadmap, checking edges only when the search is about to use them.

use super::{NodeId, Roadmap, Validity};
use crate::budget::Budget;
use crate::check::Checker;
use crate::map::GridPoint;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A way to reach `node`: over half-edge `via`, in the open list.
#[derive(Clone, Copy, Debug)]
struct Open {
    estimate: f64,
    cost: f64,
    node: NodeId,
    from: NodeId,
    via: u32,
}

impl Open {
    /// Least estimate first, then the least node, then the least predecessor: a total order on what can
    /// differ, so the path found does not hang on the heap's insides.
    fn order(&self, other: &Self) -> Ordering {
        let keys = self.estimate.total_cmp(&other.estimate).then(self.node.cmp(&other.node));
        keys.then(self.from.cmp(&other.from)).then(self.via.cmp(&other.via))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.order(other).is_eq()
    }
}
impl Eq for Open {}
impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.order(self)
    }
}

#[derive(Clone, Copy, Debug)]
struct Visit {
    /// which search wrote this; anything older is void
    epoch: u32,
    closed: bool,
    parent: NodeId,
    /// least cost over edges known to be free
    bound: f64,
}

/// The search's buffers.
#[derive(Debug, Default)]
pub struct Search {
    heap: BinaryHeap<Open>,
    visits: Vec<Visit>,
    epoch: u32,
}

/// Entries taken from the open list between two looks at the budget: below 100 µs with an edge check each.
const POPS_PER_CHECK: u32 = 256;

const VOID: Visit = Visit { epoch: 0, closed: false, parent: NodeId::MAX, bound: f64::INFINITY };

impl Search {
    /// Finds the shortest way over free edges from `start` to `goal` and writes its points into `path`,
    /// start first. Checks edges as needed and remembers the outcome in `roadmap`. False when there is none,
    /// or when the budget ended first.
    ///
    /// Hart, Nilsson, Raphael 1968, with straight-line distance as the estimate. An edge is checked when its
    /// far node is taken from the open list; a blocked one is dropped and the next best way is taken.
    pub fn run(
        &mut self,
        roadmap: &mut Roadmap,
        checker: &Checker<'_>,
        (start, goal): (NodeId, NodeId),
        budget: &mut dyn Budget,
        path: &mut Vec<GridPoint>,
    ) -> bool {
        let mut taken = 0u32;
        self.begin(roadmap.len());
        let target = roadmap.point(goal);
        let estimate = roadmap.point(start).distance(target);
        self.heap.push(Open { estimate, cost: 0.0, node: start, from: start, via: u32::MAX });
        while let Some(open) = self.heap.pop() {
            taken += 1;
            if taken.is_multiple_of(POPS_PER_CHECK) && budget.exhausted() {
                return false;
            }
            if self.visit(open.node).closed {
                continue;
            }
            if open.via != u32::MAX && !is_free(roadmap, checker, &open) {
                continue;
            }
            let (epoch, parent) = (self.epoch, open.from);
            self.visits[open.node as usize] = Visit { epoch, closed: true, parent, bound: open.cost };
            if open.node == goal {
                self.trace(roadmap, start, goal, path);
                return true;
            }
            self.expand(roadmap, &open, target);
        }
        false
    }

    fn expand(&mut self, roadmap: &Roadmap, open: &Open, target: GridPoint) {
        for (via, edge) in roadmap.edges_of(open.node) {
            let validity = roadmap.validity(via);
            let visit = self.visit(edge.to);
            let cost = open.cost + edge.length;
            if visit.closed || validity == Validity::Blocked || cost >= visit.bound {
                continue;
            }
            if validity == Validity::Free {
                let epoch = self.epoch;
                self.visits[edge.to as usize] = Visit { epoch, bound: cost, ..VOID };
            }
            let estimate = cost + roadmap.point(edge.to).distance(target);
            self.heap.push(Open { estimate, cost, node: edge.to, from: open.node, via });
        }
    }

    fn begin(&mut self, nodes: usize) {
        self.heap.clear();
        if self.epoch == u32::MAX {
            self.visits.clear();
            self.epoch = 0;
        }
        self.epoch += 1;
        if self.visits.len() < nodes {
            self.visits.resize(nodes, VOID);
        }
    }

    fn visit(&self, node: NodeId) -> Visit {
        let visit = self.visits[node as usize];
        if visit.epoch == self.epoch { visit } else { VOID }
    }

    fn trace(&self, roadmap: &Roadmap, start: NodeId, goal: NodeId, path: &mut Vec<GridPoint>) {
        path.clear();
        let mut node = goal;
        while node != start {
            path.push(roadmap.point(node));
            node = self.visits[node as usize].parent;
        }
        path.push(roadmap.point(start));
        path.reverse();
    }
}

fn is_free(roadmap: &mut Roadmap, checker: &Checker<'_>, open: &Open) -> bool {
    match roadmap.validity(open.via) {
        Validity::Free => true,
        Validity::Blocked => false,
        Validity::Unknown => {
            // the same direction whoever asks, so that rounding cannot make the answer depend on it
            let (a, b) = (open.from.min(open.node), open.from.max(open.node));
            let free = checker.segment(roadmap.point(a), roadmap.point(b));
            roadmap.set_validity(open.via, if free { Validity::Free } else { Validity::Blocked });
            free
        }
    }
}
