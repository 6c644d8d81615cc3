//! The planner: one map, one robot radius, a roadmap that is kept, and queries.

use crate::budget::Budget;
use crate::check::{Border, Checker};
use crate::clearance::ClearanceField;
use crate::fine::{Fine, Verdict};
use crate::links::Links;
use crate::map::GridPoint;
use crate::params::PlannerParams;
use crate::plan::{Method, Plan, Refusal};
use crate::prm::{CornerSamples, NodeId, Roadmap, Search, Sequence, Validity};
use crate::smooth::{Smoother, length};
use crate::waypoints::resample;
use hilare_interfaces::geometry::WorldPoint;
use std::sync::Arc;

/// Plans on one map for one robot; keeps the roadmap and all buffers between queries.
#[derive(Debug)]
pub struct Planner {
    field: Arc<ClearanceField>,
    params: PlannerParams,
    roadmap: Roadmap,
    sequence: Sequence,
    corners: CornerSamples,
    /// samples drawn, free or not
    drawn: usize,
    /// free samples in the roadmap
    samples: usize,
    search: Search,
    links: Links,
    /// contacts of the wave already turned into edges
    linked: usize,
    fine: Fine,
    smoother: Smoother,
    path: Vec<GridPoint>,
    best: Vec<GridPoint>,
    walk: Vec<GridPoint>,
    waypoints: Vec<GridPoint>,
    shares: Vec<u32>,
}

impl Planner {
    /// A planner on `field`. A radius that is negative or NaN counts as zero; with such a spacing, or zero,
    /// the corners alone are waypoints.
    pub fn new(field: impl Into<Arc<ClearanceField>>, params: PlannerParams) -> Self {
        let mut planner = Self {
            field: field.into(),
            sequence: Sequence::new(params.seed),
            params,
            roadmap: Roadmap::default(),
            corners: CornerSamples::default(),
            drawn: 0,
            samples: 0,
            search: Search::default(),
            links: Links::default(),
            linked: 0,
            fine: Fine::default(),
            smoother: Smoother::default(),
            path: Vec::new(),
            best: Vec::new(),
            walk: Vec::new(),
            waypoints: Vec::new(),
            shares: Vec::new(),
        };
        let field = Arc::clone(&planner.field);
        planner.corners = CornerSamples::new(&planner.checker(&field));
        planner.reset(planner.params.seed);
        planner
    }

    /// Forgets the roadmap and starts over with another seed; memory is kept.
    pub fn reset(&mut self, seed: u64) {
        let (width, height) = self.field.size();
        self.params.seed = seed;
        self.sequence = Sequence::new(seed);
        self.corners.restart(seed);
        (self.drawn, self.samples, self.linked) = (0, 0, 0);
        self.roadmap.clear(width as f64, height as f64, self.params.samples);
        self.links.clear();
    }

    /// The field planned on.
    pub fn field(&self) -> &ClearanceField {
        &self.field
    }

    /// The choices in force.
    pub fn params(&self) -> &PlannerParams {
        &self.params
    }

    /// Draws every sample and checks every edge, for drawings; a query does so only as far as it has to.
    pub fn complete_roadmap(&mut self, budget: &mut dyn Budget) {
        let field = Arc::clone(&self.field);
        let checker = self.checker(&field);
        while !self.full() && !budget.exhausted() {
            self.grow(&checker);
        }
        self.roadmap.check_edges(|a, b| checker.segment(a, b), budget);
    }

    /// The roadmap's edges for drawings: both ends (world frame) and whether a check has found them free;
    /// edges found blocked are left out.
    pub fn roadmap_edges(&self) -> impl Iterator<Item = (WorldPoint, WorldPoint, bool)> + '_ {
        let frame = self.field.frame();
        self.roadmap
            .edges()
            .filter(|(.., validity)| *validity != Validity::Blocked)
            .map(|(a, b, validity)| (frame.to_world(a), frame.to_world(b), validity == Validity::Free))
    }

    /// Plans from `start` to `goal` (world frame).
    ///
    /// # Errors
    /// See [`Refusal`]; `NoWay` is a proof up to half a cell's lattice, `OutOfTime` is none.
    pub fn plan(
        &mut self,
        start: WorldPoint,
        goal: WorldPoint,
        budget: &mut dyn Budget,
    ) -> Result<Plan, Refusal> {
        let mut plan = Plan::default();
        self.plan_into(start, goal, budget, &mut plan)?;
        Ok(plan)
    }

    /// Like [`Planner::plan`], into a plan whose memory is used again: a repeated query does not allocate.
    ///
    /// # Errors
    /// As [`Planner::plan`]; `plan` is then unspecified.
    pub fn plan_into(
        &mut self,
        start: WorldPoint,
        goal: WorldPoint,
        budget: &mut dyn Budget,
        plan: &mut Plan,
    ) -> Result<(), Refusal> {
        let field = Arc::clone(&self.field);
        let checker = self.checker(&field);
        let began = budget.now_ns();
        let (from, to) = (field.frame().to_grid(start), field.frame().to_grid(goal));
        check_ends(start, goal, from, to, &checker)?;
        let method = self.first_way(from, to, &checker, budget)?;
        let found = budget.now_ns();
        let resolution_m = field.frame().resolution_m();
        plan.method = method;
        plan.first_length_m = length(&self.path) * resolution_m;
        plan.times.first_solution_ns = found - began;
        self.smoother.smooth(&mut self.path, &checker, budget);
        std::mem::swap(&mut self.path, &mut self.best);
        plan.times.smoothing_ns = budget.now_ns() - found;
        self.improve(from, to, &checker, budget, plan);
        let improved = budget.now_ns();
        let spacing =
            if self.params.spacing_m > 0.0 { self.params.spacing_m / resolution_m } else { f64::MAX };
        resample(&self.best, spacing, &mut self.shares, &mut self.waypoints);
        plan.times.smoothing_ns += budget.now_ns() - improved;
        self.fill(start, goal, plan);
        Ok(())
    }

    fn checker<'a>(&self, field: &'a ClearanceField) -> Checker<'a> {
        // a hair more than asked for, so that rounding to world coordinates and back cannot cost clearance
        const HAIR: f64 = 1e-9;
        // beyond any map a radius makes no difference
        const LARGEST: f64 = 1e6;
        let (width, height) = field.size();
        let asked = self.params.radius_m / field.frame().resolution_m();
        let radius = if asked > 0.0 { asked.min(LARGEST) } else { 0.0 };
        let radius = radius * (1.0 + HAIR) + HAIR * (width + height) as f64;
        let inset = if self.params.border == Border::Wall { radius } else { 0.0 };
        Checker { field, radius, inset }
    }

    /// Puts the first way found into `self.path`.
    fn first_way(
        &mut self,
        from: GridPoint,
        to: GridPoint,
        checker: &Checker<'_>,
        budget: &mut dyn Budget,
    ) -> Result<Method, Refusal> {
        if checker.segment(from, to) {
            self.path.clear();
            self.path.extend([from, to]);
            return Ok(Method::Straight);
        }
        let method = if self.links.done() { Method::LinkedPrm } else { Method::Prm };
        loop {
            if (self.samples > 0 || self.full()) && self.query(from, to, checker, budget) {
                return Ok(method);
            }
            if self.full() {
                break;
            }
            if budget.exhausted() {
                return Err(Refusal::OutOfTime);
            }
            self.grow(checker);
        }
        if self.linked_query(from, to, checker, budget)? {
            return Ok(Method::LinkedPrm);
        }
        match self.fine.run(from, to, checker, budget, &mut self.path) {
            Verdict::Way => Ok(Method::FineGrid),
            Verdict::NoWay => Err(Refusal::NoWay),
            Verdict::Unknown => Err(Refusal::OutOfTime),
        }
    }

    /// True when the roadmap has its samples, or drawing more is pointless: hardly any was free.
    fn full(&self) -> bool {
        const LEAST_FREE_SHARE: usize = 32;
        self.samples >= self.params.samples || self.drawn >= self.params.samples * LEAST_FREE_SHARE
    }

    /// Draws a batch of samples and joins the free ones to their nearest predecessors.
    fn grow(&mut self, checker: &Checker<'_>) {
        let (width, height) = checker.field.size();
        let batch = self.params.batch.max(1);
        let (mut free, mut drawn) = (0, 0);
        while free < batch && drawn < batch * 8 && !self.full() {
            drawn += 1;
            self.drawn += 1;
            // corners and open space in turns; corner samples are known to be free
            let corner = self.corners.take();
            let sample = corner.unwrap_or_else(|| self.sequence.next_in(width as f64, height as f64));
            if corner.is_none() && !checker.point(sample) {
                continue;
            }
            free += 1;
            self.samples += 1;
            self.roadmap.find_nearest(sample, self.params.neighbours);
            let node = self.roadmap.add(sample);
            self.join(node);
        }
    }

    /// Joins `node` to the nodes that were found nearest.
    fn join(&mut self, node: NodeId) {
        let mut index = 0;
        while let Some(other) = self.roadmap.neighbour(index) {
            self.roadmap.connect(node, other, Validity::Unknown);
            index += 1;
        }
    }

    /// Joins start and goal to the roadmap, searches, and takes them out again.
    fn query(
        &mut self,
        from: GridPoint,
        to: GridPoint,
        checker: &Checker<'_>,
        budget: &mut dyn Budget,
    ) -> bool {
        let mark = self.roadmap.mark();
        let count = self.params.neighbours;
        let start = self.roadmap.add_temporary(from);
        let goal = self.roadmap.add_temporary(to);
        for (node, point) in [(start, from), (goal, to)] {
            self.roadmap.find_nearest(point, count);
            self.join(node);
        }
        if self.links.done() {
            self.attach(start, checker);
            self.attach(goal, checker);
        }
        let solved = self.search.run(&mut self.roadmap, checker, (start, goal), budget, &mut self.path);
        self.roadmap.truncate(mark);
        solved
    }

    /// Joins a temporary node to the roadmap by the way the wave knows.
    fn attach(&mut self, node: NodeId, checker: &Checker<'_>) {
        let point = self.roadmap.point(node);
        let Some(owner) = self.links.walk_from(point, checker, &mut self.walk) else { return };
        self.walk.push(self.roadmap.point(owner));
        self.smoother.shortcut(&mut self.walk, checker);
        let mut last = node;
        for &via in &self.walk[1..self.walk.len() - 1] {
            let next = self.roadmap.add_temporary(via);
            self.roadmap.connect(last, next, Validity::Free);
            last = next;
        }
        self.roadmap.connect(last, owner, Validity::Free);
    }

    /// Runs the wave if it has not run yet, makes edges of its contacts, and searches again.
    fn linked_query(
        &mut self,
        from: GridPoint,
        to: GridPoint,
        checker: &Checker<'_>,
        budget: &mut dyn Budget,
    ) -> Result<bool, Refusal> {
        if !self.links.done() {
            self.linked = 0;
            if !self.links.run(&mut self.roadmap, [from, to], checker, budget) {
                return Err(Refusal::OutOfTime);
            }
        }
        while self.linked < self.links.contact_count() {
            self.link(self.linked, checker);
            self.linked += 1;
            if budget.exhausted() {
                return Err(Refusal::OutOfTime);
            }
        }
        Ok(self.query(from, to, checker, budget))
    }

    /// Makes a free way between two nodes whose regions touch: straight if it can be, else by the grid.
    fn link(&mut self, contact: usize, checker: &Checker<'_>) {
        let contact = self.links.contact(contact);
        let (a, b) = contact.nodes;
        let known = self.roadmap.find_edge(a, b);
        let straight = match known.map(|edge| self.roadmap.validity(edge)) {
            Some(Validity::Free) => return,
            Some(Validity::Blocked) => false,
            _ => checker.segment(self.roadmap.point(a), self.roadmap.point(b)),
        };
        let validity = if straight { Validity::Free } else { Validity::Blocked };
        match known {
            Some(edge) => self.roadmap.set_validity(edge, validity),
            None if straight => self.roadmap.connect(a, b, validity),
            None => {}
        }
        if straight {
            return;
        }
        self.walk.clear();
        self.links.walk(contact.cells.0 as usize, &mut self.walk);
        self.walk.push(self.roadmap.point(a));
        self.walk.reverse();
        self.links.walk(contact.cells.1 as usize, &mut self.walk);
        self.walk.push(self.roadmap.point(b));
        self.smoother.shortcut(&mut self.walk, checker);
        let mut last = a;
        for &via in &self.walk[1..self.walk.len() - 1] {
            let next = self.roadmap.add(via);
            self.roadmap.connect(last, next, Validity::Free);
            last = next;
        }
        self.roadmap.connect(last, b, Validity::Free);
    }

    /// Grows the roadmap while there is time and room, and keeps the shortest way in `self.best`.
    fn improve(
        &mut self,
        from: GridPoint,
        to: GridPoint,
        checker: &Checker<'_>,
        budget: &mut dyn Budget,
        plan: &mut Plan,
    ) {
        let began = budget.now_ns();
        let mut smoothing_ns = 0;
        if plan.method != Method::Straight {
            while !self.full() && !budget.exhausted() {
                self.grow(checker);
                if !self.query(from, to, checker, budget) {
                    continue;
                }
                let found = budget.now_ns();
                self.smoother.smooth(&mut self.path, checker, budget);
                if length(&self.path) < length(&self.best) {
                    std::mem::swap(&mut self.path, &mut self.best);
                }
                smoothing_ns += budget.now_ns() - found;
            }
        }
        plan.times.improvement_ns = budget.now_ns() - began - smoothing_ns;
        plan.times.smoothing_ns += smoothing_ns;
    }

    fn fill(&self, start: WorldPoint, goal: WorldPoint, plan: &mut Plan) {
        let frame = self.field.frame();
        let clearance =
            |least: f64, pair: &[GridPoint]| self.field.segment_clearance(pair[0], pair[1], least);
        plan.clearance_min_m = self.best.windows(2).fold(f64::INFINITY, clearance) * frame.resolution_m();
        plan.waypoints.clear();
        plan.waypoints.extend(self.waypoints.iter().map(|&p| frame.to_world(p)));
        // the ends as given, not as rounded
        if let [first, .., last] = &mut plan.waypoints[..] {
            (*first, *last) = (start, goal);
        }
        plan.length_m = plan.waypoints.windows(2).map(|pair| pair[0].distance_m(pair[1])).sum();
        plan.samples = self.samples;
    }
}

fn check_ends(
    start: WorldPoint,
    goal: WorldPoint,
    from: GridPoint,
    to: GridPoint,
    checker: &Checker<'_>,
) -> Result<(), Refusal> {
    if !(start.is_finite() && goal.is_finite()) {
        return Err(Refusal::NotFinite);
    }
    if !checker.on_map(from) {
        return Err(Refusal::StartOutsideMap);
    }
    if !checker.on_map(to) {
        return Err(Refusal::GoalOutsideMap);
    }
    if !checker.point(from) {
        return Err(Refusal::StartInObstacle);
    }
    if !checker.point(to) {
        return Err(Refusal::GoalInObstacle);
    }
    Ok(())
}
