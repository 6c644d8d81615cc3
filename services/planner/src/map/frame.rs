//! The map's frame: where its grid lies in the world. Cells become metres here and nowhere else.

use hilare_interfaces::geometry::WorldPoint;

/// A point of the map's grid, in cells from the lower left corner along the map's axes:
/// cell (i, j) covers \[i, i+1\] × \[j, j+1\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GridPoint {
    /// cells along the grid's first axis
    pub u: f64,
    /// cells along the grid's second axis
    pub v: f64,
}

impl GridPoint {
    pub(crate) const fn new(u: f64, v: f64) -> Self {
        Self { u, v }
    }

    pub(crate) fn distance(self, other: Self) -> f64 {
        let (du, dv) = (other.u - self.u, other.v - self.v);
        (du * du + dv * dv).sqrt()
    }

    /// The point at fraction `t` of the way to `other`.
    pub(crate) fn towards(self, other: Self, t: f64) -> Self {
        Self { u: self.u + (other.u - self.u) * t, v: self.v + (other.v - self.v) * t }
    }
}

/// Name, pose, resolution and extent of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapFrame {
    name: String,
    origin: WorldPoint,
    yaw_rad: f64,
    cos_yaw: f64,
    sin_yaw: f64,
    resolution_m: f64,
    width_cells: usize,
    height_cells: usize,
}

impl MapFrame {
    /// A frame `name` whose lower left corner lies at `origin` (metres, world), turned by `yaw_rad`
    /// (counter-clockwise), of `width_cells` × `height_cells` squares of `resolution_m` metres.
    ///
    /// `None` when a number is not finite, the resolution is not above zero, a side has no cell or more
    /// than 65 000 (the clearance field counts cells in 16 bits), or the extent overflows.
    pub fn new(
        name: &str,
        origin: WorldPoint,
        yaw_rad: f64,
        resolution_m: f64,
        width_cells: usize,
        height_cells: usize,
    ) -> Option<Self> {
        const MAX_SIDE: usize = 65_000;
        let sides = 1..=MAX_SIDE;
        let sound = origin.is_finite()
            && yaw_rad.is_finite()
            && resolution_m > 1e-9
            && sides.contains(&width_cells)
            && sides.contains(&height_cells)
            && (resolution_m * MAX_SIDE as f64).is_finite();
        let (sin_yaw, cos_yaw) = libm::sincos(yaw_rad);
        let name = name.to_owned();
        sound.then_some(Self {
            name,
            origin,
            yaw_rad,
            cos_yaw,
            sin_yaw,
            resolution_m,
            width_cells,
            height_cells,
        })
    }

    /// The frame's name (`map` for ROS maps, as map_server publishes).
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The lower left corner of the grid, metres, world frame.
    pub fn origin(&self) -> WorldPoint {
        self.origin
    }

    /// Turn of the grid's axes against the world's, radians, counter-clockwise.
    pub fn yaw_rad(&self) -> f64 {
        self.yaw_rad
    }

    /// Side of a cell, metres.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Cells along the grid's first axis.
    pub fn width_cells(&self) -> usize {
        self.width_cells
    }

    /// Cells along the grid's second axis.
    pub fn height_cells(&self) -> usize {
        self.height_cells
    }

    /// Extent along the grid's axes (width, height), metres.
    pub fn extent_m(&self) -> (f64, f64) {
        (self.width_cells as f64 * self.resolution_m, self.height_cells as f64 * self.resolution_m)
    }

    /// World to grid.
    pub fn to_grid(&self, point: WorldPoint) -> GridPoint {
        let (dx, dy) = (point.x_m - self.origin.x_m, point.y_m - self.origin.y_m);
        GridPoint {
            u: (dx * self.cos_yaw + dy * self.sin_yaw) / self.resolution_m,
            v: (dy * self.cos_yaw - dx * self.sin_yaw) / self.resolution_m,
        }
    }

    /// Grid to world.
    pub fn to_world(&self, point: GridPoint) -> WorldPoint {
        let (a, b) = (point.u * self.resolution_m, point.v * self.resolution_m);
        WorldPoint {
            x_m: self.origin.x_m + a * self.cos_yaw - b * self.sin_yaw,
            y_m: self.origin.y_m + a * self.sin_yaw + b * self.cos_yaw,
        }
    }

    /// Centre of cell (`column`, `row`), row 0 at the lowest grid ordinate, in the world frame.
    pub fn cell_centre(&self, column: usize, row: usize) -> WorldPoint {
        self.to_world(GridPoint { u: column as f64 + 0.5, v: row as f64 + 0.5 })
    }

    /// True when the grid's closed extent holds `point`.
    pub fn contains(&self, point: WorldPoint) -> bool {
        let g = self.to_grid(point);
        g.u >= 0.0 && g.v >= 0.0 && g.u <= self.width_cells as f64 && g.v <= self.height_cells as f64
    }
}
