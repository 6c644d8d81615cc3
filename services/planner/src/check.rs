//! The one question all stages ask: may the robot's disc be here, may it go straight there.

use crate::clearance::ClearanceField;
use crate::map::GridPoint;

/// What the map's edge is to the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Border {
    /// the robot's midpoint stays on the map; its rim may reach over the edge (default, as Nav2's
    /// circular robots and a planner's bounds have it)
    #[default]
    Open,
    /// the edge is a wall: the whole disc stays on the map
    Wall,
}

/// Collision checks for one disc on one field, in cells.
#[derive(Clone, Copy)]
pub(crate) struct Checker<'a> {
    pub field: &'a ClearanceField,
    /// clearance asked for: the robot's radius and a hair for the rounding of coordinates
    pub radius: f64,
    /// how far from the edge the midpoint must stay
    pub inset: f64,
}

impl Checker<'_> {
    /// True when the midpoint may be at `p` as far as the edge is concerned.
    pub fn on_map(&self, p: GridPoint) -> bool {
        let (width, height) = self.field.size();
        let inset = self.inset;
        p.u >= inset && p.v >= inset && p.u <= width as f64 - inset && p.v <= height as f64 - inset
    }

    pub fn point(&self, p: GridPoint) -> bool {
        self.on_map(p) && self.field.point_free(p, self.radius)
    }

    /// The straight way between two points that are on the map; the edge needs no look, it is convex.
    pub fn segment(&self, a: GridPoint, b: GridPoint) -> bool {
        self.field.segment_free(a, b, self.radius)
    }
}
