//! The judges: they share nothing with the planner but the loaded map.
#![allow(dead_code, reason = "each test binary uses its part")]

use hilare_planner::map::{Layer, Map, Obstacle};
use hilare_planner::{Plan, WorldPoint};
use std::path::PathBuf;

/// The project's shared data: `HILARE_SHARED`/data, or `shared/data` or `../shared/data` in a folder above.
pub fn shared_data() -> Option<PathBuf> {
    let found = match std::env::var_os("HILARE_SHARED") {
        Some(root) => Some(PathBuf::from(root).join("data")),
        None => std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .ancestors()
            .map(|dir| dir.join("shared/data"))
            .find(|dir| dir.join("platform.json").exists()),
    };
    if found.as_ref().is_none_or(|dir| !dir.join("platform.json").exists()) {
        eprintln!(
            "\n*** SKIPPED: no shared data found; set HILARE_SHARED to the folder that holds data/ ***\n"
        );
        return None;
    }
    found
}

/// A small linear congruential generator (Knuth's MMIX constants), so that a failing seed can be rerun.
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
}

/// Brute-force clearance on a map, world frame, metres.
pub struct Oracle<'a> {
    map: &'a Map,
}

impl<'a> Oracle<'a> {
    pub fn new(map: &'a Map) -> Self {
        Self { map }
    }

    /// Map-local metres.
    fn local(&self, p: WorldPoint) -> (f64, f64) {
        let frame = self.map.frame();
        let (s, c) = frame.yaw_rad().sin_cos();
        let (dx, dy) = (p.x_m - frame.origin().x_m, p.y_m - frame.origin().y_m);
        (dx * c + dy * s, dy * c - dx * s)
    }

    pub fn on_map(&self, p: WorldPoint) -> bool {
        let (x, y) = self.local(p);
        let (width, height) = self.map.frame().extent_m();
        x >= 0.0 && y >= 0.0 && x <= width && y <= height
    }

    /// True when no obstacle is nearer than `radius_m`.
    pub fn free(&self, p: WorldPoint, radius_m: f64) -> bool {
        let (x, y) = self.local(p);
        match self.map.layer() {
            Layer::Cells(cells) => self.cells_free(cells, x, y, radius_m),
            Layer::Obstacles(shapes) => shapes.iter().all(|shape| shape_distance(shape, x, y) >= radius_m),
        }
    }

    fn cells_free(&self, cells: &[u8], x: f64, y: f64, radius_m: f64) -> bool {
        let frame = self.map.frame();
        let res = frame.resolution_m();
        let (width, height) = (frame.width_cells() as i64, frame.height_cells() as i64);
        let reach = (radius_m / res).ceil() as i64 + 1;
        let (column, row) = ((x / res).floor() as i64, (y / res).floor() as i64);
        for j in (row - reach).max(0)..=(row + reach).min(height - 1) {
            for i in (column - reach).max(0)..=(column + reach).min(width - 1) {
                if !self.map.blocks(cells[(j * width + i) as usize]) {
                    continue;
                }
                let dx = (i as f64 * res - x).max(x - (i + 1) as f64 * res).max(0.0);
                let dy = (j as f64 * res - y).max(y - (j + 1) as f64 * res).max(0.0);
                if (dx * dx + dy * dy).sqrt() < radius_m || (dx == 0.0 && dy == 0.0) {
                    return false;
                }
            }
        }
        true
    }

    /// Panics unless the plan runs from `start` to `goal` and every point of a dense sampling of it is free.
    pub fn judge(&self, plan: &Plan, start: WorldPoint, goal: WorldPoint, radius_m: f64) {
        let points = &plan.waypoints;
        assert_eq!((points[0], points[points.len() - 1]), (start, goal), "wrong ends");
        let step = 0.1 * self.map.frame().resolution_m();
        let mut length = 0.0;
        for pair in points.windows(2) {
            let leg = pair[0].distance_m(pair[1]);
            length += leg;
            let n = (leg / step).ceil().max(1.0);
            for i in 0..=n as usize {
                let t = i as f64 / n;
                let p = WorldPoint::new(
                    pair[0].x_m + (pair[1].x_m - pair[0].x_m) * t,
                    pair[0].y_m + (pair[1].y_m - pair[0].y_m) * t,
                );
                // 1e-9 m: this judge's own rounding
                assert!(self.free(p, radius_m - 1e-9), "touches at {p:?} on the way {start:?} to {goal:?}");
                assert!(self.on_map(p), "leaves the map at {p:?}");
            }
        }
        assert!((length - plan.length_m).abs() < 1e-9 * length.max(1.0));
        assert!(plan.clearance_min_m >= radius_m - 1e-9, "says clearance {}", plan.clearance_min_m);
    }

    /// A random point where the robot fits.
    pub fn random_free(&self, random: &mut Random, radius_m: f64) -> WorldPoint {
        let frame = self.map.frame();
        let (s, c) = frame.yaw_rad().sin_cos();
        loop {
            let (x, y) = (random.unit() * frame.extent_m().0, random.unit() * frame.extent_m().1);
            let p = WorldPoint::new(frame.origin().x_m + x * c - y * s, frame.origin().y_m + x * s + y * c);
            if self.free(p, radius_m * 1.000_001 + 1e-9) {
                return p;
            }
        }
    }

    /// Flood fill over cell centres, 4-connected, the disc measured by brute force: components by cell,
    /// 0 blocked.
    pub fn components(&self, radius_m: f64) -> Vec<u32> {
        let frame = self.map.frame();
        let (width, height) = (frame.width_cells(), frame.height_cells());
        let mut component = vec![0u32; width * height];
        let mut free = vec![false; width * height];
        for (index, cell) in free.iter_mut().enumerate() {
            *cell = self.free(frame.cell_centre(index % width, index / width), radius_m * 1.000_001 + 1e-9);
        }
        let mut next = 0;
        let mut stack = Vec::new();
        for seed in 0..width * height {
            if !free[seed] || component[seed] != 0 {
                continue;
            }
            next += 1;
            component[seed] = next;
            stack.push(seed);
            while let Some(cell) = stack.pop() {
                let (i, j) = (cell % width, cell / width);
                let near = [
                    (i > 0).then(|| cell - 1),
                    (i + 1 < width).then_some(cell + 1),
                    (j > 0).then(|| cell - width),
                    (j + 1 < height).then_some(cell + width),
                ];
                for other in near.into_iter().flatten() {
                    // on shapes a thin wall may stand between two free centres
                    let middle = self.between(cell, other);
                    if free[other] && component[other] == 0 && self.free(middle, radius_m) {
                        component[other] = next;
                        stack.push(other);
                    }
                }
            }
        }
        component
    }

    fn between(&self, a: usize, b: usize) -> WorldPoint {
        let frame = self.map.frame();
        let width = frame.width_cells();
        let (p, q) = (frame.cell_centre(a % width, a / width), frame.cell_centre(b % width, b / width));
        WorldPoint::new(0.5 * (p.x_m + q.x_m), 0.5 * (p.y_m + q.y_m))
    }
}

/// Distance from a point to a filled shape.
pub fn shape_distance(shape: &Obstacle, x: f64, y: f64) -> f64 {
    match shape {
        Obstacle::Box { min_m, max_m } => {
            let dx = (min_m[0] - x).max(x - max_m[0]).max(0.0);
            let dy = (min_m[1] - y).max(y - max_m[1]).max(0.0);
            dx.hypot(dy)
        }
        Obstacle::Disc { centre_m, radius_m } => {
            ((x - centre_m[0]).hypot(y - centre_m[1]) - radius_m).max(0.0)
        }
        Obstacle::Polygon { corners_m } => {
            let n = corners_m.len();
            let mut winding = 0.0;
            let mut least = f64::INFINITY;
            for i in 0..n {
                let (a, b) = (corners_m[i], corners_m[(i + 1) % n]);
                let (ax, ay, bx, by) = (a[0] - x, a[1] - y, b[0] - x, b[1] - y);
                winding += (ax * by - ay * bx).atan2(ax * bx + ay * by);
                let (ex, ey) = (bx - ax, by - ay);
                let square = ex * ex + ey * ey;
                let t = if square > 0.0 { (-(ax * ex + ay * ey) / square).clamp(0.0, 1.0) } else { 0.0 };
                least = least.min((ax + t * ex).hypot(ay + t * ey));
            }
            if winding.abs() > std::f64::consts::PI { 0.0 } else { least }
        }
    }
}
