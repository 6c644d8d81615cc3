//! A raster map as a picture.

use super::{Layer, Map, UNKNOWN};
use png::{BitDepth, ColorType, Encoder};

/// A map as a PNG: what is free is not drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The file.
    pub png: Vec<u8>,
    /// Its width, metres along the map's first axis; never less than the map's.
    pub width_m: f64,
    /// Its height.
    pub height_m: f64,
}

/// Free, unknown, blocked: red, green, blue.
const COLOURS: [[u8; 3]; 3] = [[0; 3], [128, 138, 148], [108, 120, 131]];
/// The same: how opaque.
const OPACITIES: [u8; 3] = [0, 70, 255];

impl Map {
    /// The raster as a picture of at most `most` pixels a side, its lower left corner the map's; a pixel shows the
    /// worst of its cells. `None` for a list of obstacles, which has shapes instead.
    pub fn picture(&self, most: usize) -> Option<Picture> {
        let Layer::Cells(cells) = self.layer() else { return None };
        let (width, height) = (self.frame().width_cells(), self.frame().height_cells());
        let side = width.max(height).div_ceil(most.max(1));
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
        let mut pixels = vec![0; columns * rows];
        for (index, &cell) in cells.iter().enumerate() {
            let (row, column) = (index / width / side, index % width / side);
            // Pictures begin at the highest y.
            let pixel = &mut pixels[(rows - 1 - row) * columns + column];
            let shade = if cell != UNKNOWN && self.blocks(cell) { 2 } else { u8::from(cell == UNKNOWN) };
            *pixel = shade.max(*pixel);
        }
        let mut png = Vec::new();
        let mut encoder = Encoder::new(&mut png, columns as u32, rows as u32);
        encoder.set_color(ColorType::Indexed);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_palette(COLOURS.as_flattened());
        encoder.set_trns(&OPACITIES[..]);
        encoder.write_header().and_then(|mut writer| writer.write_image_data(&pixels)).ok()?;
        let cell_m = self.frame().resolution_m() * side as f64;
        Some(Picture { png, width_m: columns as f64 * cell_m, height_m: rows as f64 * cell_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::WorldPoint;
    use crate::map::{MapFrame, Unknown};

    fn pixels(png: &[u8]) -> (u32, u32, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info.width, info.height, pixels)
    }

    #[test]
    fn the_picture_stands_upright_and_hides_nothing_when_it_is_made_smaller() {
        let frame = MapFrame::new("map", WorldPoint::new(0.0, 0.0), 0.0, 0.5, 3, 2).unwrap();
        // Below: blocked, free, free; above: free, free, unknown.
        let map = Map::from_cells(frame, vec![100, 0, 0, 0, 0, UNKNOWN], Unknown::Blocked).unwrap();
        let whole = map.picture(10).unwrap();
        assert_eq!(pixels(&whole.png), (3, 2, vec![0, 0, 1, 2, 0, 0]));
        assert_eq!((whole.width_m, whole.height_m), (1.5, 1.0));
        let small = map.picture(2).unwrap();
        assert_eq!(pixels(&small.png), (2, 1, vec![2, 1]));
        assert_eq!((small.width_m, small.height_m), (2.0, 1.0));
    }
}
