//! A map as other tools want it: one number a cell.

use super::{Layer, Map, UNKNOWN};
use crate::clearance::ClearanceField;

/// Occupancy of cells, as nav_msgs/OccupancyGrid has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Side of a cell, m.
    pub resolution_m: f64,
    /// Cells along the map's first axis.
    pub width: usize,
    /// Cells along its second axis.
    pub height: usize,
    /// Row by row from the lowest: 0–100 percent, -1 unknown.
    pub cells: Vec<i8>,
}

impl Map {
    /// Its occupancy in at most `most` cells a side, its lower left corner the map's; a cell has the worst of those
    /// that it covers: an obstacle, then unknown. Of a list of obstacles it is the planner's raster, which covers all of them.
    pub fn grid(&self, most: usize) -> Grid {
        let frame = self.frame();
        let (width, height) = (frame.width_cells(), frame.height_cells());
        let side = width.max(height).div_ceil(most.max(1));
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
        let mut cells = vec![0; columns * rows];
        let mut put = |column: usize, row: usize, occupancy: i8| {
            let cell = &mut cells[row / side * columns + column / side];
            *cell = worse(*cell, occupancy);
        };
        match self.layer() {
            Layer::Cells(bytes) => {
                for (index, &byte) in bytes.iter().enumerate() {
                    let occupancy = if byte == UNKNOWN { -1 } else { byte.min(100).cast_signed() };
                    put(index % width, index / width, occupancy);
                }
            }
            Layer::Obstacles(_) => {
                let field = ClearanceField::new(self);
                for index in (0..width * height).filter(|index| field.at_cell(*index) == 0.0) {
                    put(index % width, index / width, 100);
                }
            }
        }
        Grid { resolution_m: frame.resolution_m() * side as f64, width: columns, height: rows, cells }
    }
}

/// What is more likely an obstacle than not is worse than what nobody knows.
fn worse(one: i8, other: i8) -> i8 {
    let badness = |occupancy: i8| if occupancy < 0 { 50 } else { i16::from(occupancy) };
    if badness(one) >= badness(other) { one } else { other }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::WorldPoint;
    use crate::map::{LoadOptions, MapFrame, Unknown};

    #[test]
    fn cells_are_told_as_they_are_and_made_coarser_hide_nothing() {
        let frame = MapFrame::new("map", WorldPoint::new(0.0, 0.0), 0.0, 0.5, 3, 2).unwrap();
        let map = Map::from_cells(frame, vec![100, 0, 20, 0, 0, UNKNOWN], Unknown::Blocked).unwrap();
        let whole = map.grid(10);
        assert_eq!(whole, Grid { resolution_m: 0.5, width: 3, height: 2, cells: vec![100, 0, 20, 0, 0, -1] });
        let coarse = map.grid(2);
        assert_eq!(coarse, Grid { resolution_m: 1.0, width: 2, height: 1, cells: vec![100, -1] });
    }

    #[test]
    fn obstacles_fill_the_area_they_have() {
        let text =
            br#"{"width_m": 2, "height_m": 1, "discs_m": [[0.5, 0.5, 0.3]], "boxes_m": [[1.2, 0.2, 1.7, 0.6]]}"#;
        let options = LoadOptions { raster_m: Some(0.01), ..LoadOptions::default() };
        let grid = Map::from_bytes("two.json", text, &options).unwrap().grid(1000);
        assert_eq!((grid.width, grid.height, grid.resolution_m), (200, 100, 0.01));
        let filled = |columns: std::ops::Range<usize>| {
            let in_row = |row: &[i8]| row[columns.clone()].iter().filter(|cell| **cell == 100).count();
            grid.cells.chunks(200).map(in_row).sum::<usize>() as f64 * 1e-4
        };
        // All of it, and of the rim a cell and a half more at most.
        let (disc, block) = (filled(0..100), filled(100..200));
        for (found, area, rim) in
            [(disc, std::f64::consts::PI * 0.09, std::f64::consts::TAU * 0.3), (block, 0.2, 1.8)]
        {
            assert!((area..area + 0.015 * rim).contains(&found), "{found} m² of {area}");
        }
        assert!(grid.cells.iter().all(|cell| [0, 100].contains(cell)));
    }
}
