//! A map's obstacles as outlines to fill.

use hilare_interfaces::geometry::WorldPoint;
use hilare_planner::Map;
use hilare_planner::map::{GridPoint, Layer, Obstacle};

/// Corners a disc is drawn with.
const DISC_CORNERS: usize = 32;

/// Outlines in the world frame, metres: shapes as they are, blocked cells as runs along a row.
pub fn outlines(map: &Map) -> Vec<Vec<WorldPoint>> {
    match map.layer() {
        Layer::Obstacles(obstacles) => obstacles.iter().map(|obstacle| shape(map, obstacle)).collect(),
        Layer::Cells(cells) => runs(map, cells),
    }
}

fn shape(map: &Map, obstacle: &Obstacle) -> Vec<WorldPoint> {
    let corners: Vec<[f64; 2]> = match obstacle {
        Obstacle::Box { min_m: [x0, y0], max_m: [x1, y1] } => {
            vec![[*x0, *y0], [*x1, *y0], [*x1, *y1], [*x0, *y1]]
        }
        Obstacle::Disc { centre_m: [x, y], radius_m } => (0..DISC_CORNERS)
            .map(|i| {
                let (sin, cos) = (std::f64::consts::TAU * i as f64 / DISC_CORNERS as f64).sin_cos();
                [x + radius_m * cos, y + radius_m * sin]
            })
            .collect(),
        Obstacle::Polygon { corners_m } => corners_m.clone(),
    };
    let cells = map.frame().resolution_m();
    corners.into_iter().map(|[x, y]| map.frame().to_world(GridPoint { u: x / cells, v: y / cells })).collect()
}

fn runs(map: &Map, cells: &[u8]) -> Vec<Vec<WorldPoint>> {
    let width = map.frame().width_cells().max(1);
    let mut outlines = Vec::new();
    for (row, line) in cells.chunks(width).enumerate() {
        let mut column = 0;
        while column < line.len() {
            let blocked = line[column..].iter().take_while(|cell| map.blocks(**cell)).count();
            if blocked > 0 {
                let corner =
                    |u: usize, v: usize| map.frame().to_world(GridPoint { u: u as f64, v: v as f64 });
                let end = column + blocked;
                outlines.push(vec![
                    corner(column, row),
                    corner(end, row),
                    corner(end, row + 1),
                    corner(column, row + 1),
                ]);
            }
            column += blocked.max(1);
        }
    }
    outlines
}
