//! What a plan is measured against: the track ahead, walked at the pace of the plan before.
//!
//! ```text
//!        q_2 ●──▶ û_2 T_2          q_k   place on the track at the plan's progress at node k
//!            │ n_2 ◀               n_k   to the left of the track there
//!            ● q_1                 û_k   from q_k on at v_r for the stage's time, along the track
//!   robot    │                     h_k   tangent − crab − heading now: body turned until there
//!     ▷      ● q_0
//! ```
//!
//! Walking along the track chooses the leg of every node; on the way a leg changes into the next where
//! it ends, which is where the selector switches a robot that keeps to its path.

use super::STAGES;
use crate::qp::frame::{Leg, MAX_LEGS, Track, Vector};
use core::f64::consts::{PI, TAU};
use hilare_interfaces::geometry::wrap_angle_rad;
use hilare_interfaces::state::{StateWords, Stateful};

/// Times of the plan, in 1/ω_max: the first stage is a control period, each further one longer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// T_k.
    pub time: [f64; STAGES],
    /// Time of node k.
    pub at: [f64; STAGES + 1],
}

impl Grid {
    /// Stages that grow geometrically from `first` and add up to `horizon`; equal ones if that is short.
    pub fn new(first: f64, horizon: f64) -> Self {
        let sum = |ratio: f64| {
            let mut time = first;
            let mut sum = 0.0;
            for _ in 0..STAGES {
                sum += time;
                time *= ratio;
            }
            sum
        };
        let (mut low, mut high) = (1.0, 4.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if sum(middle) < horizon { low = middle } else { high = middle }
        }
        let mut grid = Self { time: [first; STAGES], at: [0.0; STAGES + 1] };
        for k in 0..STAGES {
            if k > 0 {
                grid.time[k] = grid.time[k - 1] * low;
            }
            grid.at[k + 1] = grid.at[k] + grid.time[k];
        }
        grid
    }

    /// `values` of the nodes (0 at the first), seen one stage later and from there.
    pub fn advance(&self, values: &[f64; STAGES + 1]) -> [f64; STAGES + 1] {
        let mut moved = [0.0; STAGES + 1];
        let mut k = 1;
        for (node, value) in moved.iter_mut().enumerate().skip(1) {
            let at = self.at[node] + self.time[0];
            while k + 1 < STAGES && self.at[k + 1] < at {
                k += 1;
            }
            let rate = (values[k + 1] - values[k]) / self.time[k];
            *value = values[k] + rate * (at - self.at[k]) - values[1];
        }
        moved
    }
}

/// Where a node should be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Node {
    /// q_k.
    pub place: Vector,
    /// n_k.
    pub normal: Vector,
    /// h_k, rad, not wrapped.
    pub turned: f64,
}

/// How a stage should be driven.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stage {
    /// û_k T_k.
    pub way: Vector,
    /// Its direction.
    pub along: Vector,
    /// Turn of the track meanwhile, corners apart, rad.
    pub turn: f64,
}

/// The whole of it.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// Nodes 0 … N.
    pub nodes: [Node; STAGES + 1],
    /// Stages 0 … N − 1.
    pub stages: [Stage; STAGES],
    /// Wanted heading less heading now where each leg ends, rad.
    headings: [f64; MAX_LEGS],
    /// The turn the heading still lacked last time; keeps a half turn going the way it began.
    lacking: f64,
}

/// A lack beyond which the heading might as well be turned the other way.
const AMBIGUOUS: f64 = 0.75 * PI;
/// Nearer than this to half a turn, it is to the left.
const TIE: f64 = 1e-6;

/// A place on the track: so far before the end of a leg.
#[derive(Clone, Copy, Debug)]
struct Place {
    leg: usize,
    left: f64,
}

impl Place {
    /// The place nearest to the robot. Behind the end of a leg it is on the next.
    fn of_robot(legs: &[Leg]) -> Self {
        let mut leg = 0;
        let mut left = -legs[0].beyond_end(Vector::default());
        while left <= 0.0 && leg + 1 < legs.len() {
            leg += 1;
            left = (-legs[leg].beyond_end(Vector::default())).min(legs[leg].length);
        }
        Self { leg, left }
    }

    fn walk(mut self, legs: &[Leg], distance: f64) -> Self {
        self.left -= distance;
        while self.left <= 0.0 && self.leg + 1 < legs.len() {
            self.leg += 1;
            self.left += legs[self.leg].length;
        }
        self
    }
}

impl Wanted {
    /// All zero.
    pub fn new() -> Self {
        Self {
            nodes: [Node::default(); STAGES + 1],
            stages: [Stage::default(); STAGES],
            headings: [0.0; MAX_LEGS],
            lacking: 0.0,
        }
    }

    /// Forgets which way the robot was turning.
    pub fn reset(&mut self) {
        self.lacking = 0.0;
    }

    /// Walks the track: `progress` of each node, from the place nearest to the robot.
    pub fn look(&mut self, track: &Track, grid: &Grid, progress: &[f64; STAGES + 1]) {
        let legs = track.legs();
        let start = Place::of_robot(legs);
        self.take_headings(legs, start);
        for (k, progress) in progress.iter().enumerate() {
            let place = start.walk(legs, *progress);
            let leg = &legs[place.leg];
            let (point, tangent) = leg.before_end(place.left);
            let turned = self.headings[place.leg] - leg.curvature * place.left;
            self.nodes[k] = Node { place: point, normal: tangent.left(), turned };
            if k < STAGES {
                let next = place.walk(legs, grid.time[k]);
                let way = legs[next.leg].before_end(next.left).0.minus(point);
                // Where the track doubles back within a stage the way has no direction of its own.
                let along = if way.norm() > 0.1 * grid.time[k] { unit(way) } else { tangent };
                self.stages[k] = Stage { way, along, turn: leg.curvature * grid.time[k] };
            }
        }
    }

    /// Unrolls the wanted headings along the legs, the turn from one to the next below half a turn.
    fn take_headings(&mut self, legs: &[Leg], start: Place) {
        let body = -legs[0].crab;
        for (l, leg) in legs.iter().enumerate() {
            let (_, from) = leg.before_end(leg.length);
            let raw = libm::atan2(from.y, from.x) - leg.crab - body;
            let at_start = if l == 0 {
                raw
            } else {
                let before = self.headings[l - 1];
                before + nearest_turn(raw - before)
            };
            self.headings[l] = at_start + leg.curvature * leg.length;
        }
        let now = self.headings[start.leg] - legs[start.leg].curvature * start.left;
        let mut lacking = nearest_turn(now);
        let ambiguous = lacking.abs() > AMBIGUOUS && self.lacking.abs() > AMBIGUOUS;
        if ambiguous && lacking * self.lacking < 0.0 {
            lacking += TAU.copysign(self.lacking);
        }
        self.lacking = lacking;
        for heading in &mut self.headings[..legs.len()] {
            *heading += lacking - now;
        }
    }
}

impl Stateful for Wanted {
    /// Everything else is looked at anew.
    fn visit_state(&mut self, words: &mut StateWords<'_>) {
        words.finite(core::slice::from_mut(&mut self.lacking));
    }
}

impl Default for Wanted {
    fn default() -> Self {
        Self::new()
    }
}

fn nearest_turn(angle: f64) -> f64 {
    let wrapped = wrap_angle_rad(angle);
    if wrapped < TIE - PI { wrapped + TAU } else { wrapped }
}

fn unit(vector: Vector) -> Vector {
    Vector::default().plus(vector, 1.0 / vector.norm())
}
