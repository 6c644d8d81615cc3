//! From pixels to occupancy, as nav2_map_server's `map_io.cpp` and ROS 1's map_server do.

use super::UNKNOWN;

/// map_server's interpretation of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// free, occupied or unknown by the two thresholds; alpha is averaged with the colours
    Trinary,
    /// between the thresholds in proportion, 0–100; any transparency means unknown
    Scale,
    /// the pixel's value 0–100 itself, anything above means unknown; `negate` has no effect
    Raw,
}

/// The keys of the YAML file that decide what a pixel means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelRule {
    /// interpretation
    pub mode: Mode,
    /// white is occupied instead of black
    pub negate: bool,
    /// occupancy above it is occupied, 0–1
    pub occupied_thresh: f64,
    /// occupancy below it is free, 0–1
    pub free_thresh: f64,
}

impl PixelRule {
    /// Occupancy byte of a pixel: `shade` is the mean of the colour channels and `alpha` the opacity, 0–1.
    pub fn occupancy(&self, shade: f64, alpha: Option<f64>) -> u8 {
        let shade = match (self.mode, alpha) {
            (Mode::Trinary, Some(alpha)) => (3.0 * shade + alpha) / 4.0,
            _ => shade,
        };
        let occupied = if self.negate { shade } else { 1.0 - shade };
        match self.mode {
            Mode::Raw => {
                let value = (shade * 255.0).round();
                if value <= 100.0 { value as u8 } else { UNKNOWN }
            }
            Mode::Scale if alpha.is_some_and(|a| a < 1.0) => UNKNOWN,
            _ if occupied > self.occupied_thresh => 100,
            _ if occupied < self.free_thresh => 0,
            Mode::Trinary => UNKNOWN,
            Mode::Scale => {
                let span = self.occupied_thresh - self.free_thresh;
                ((occupied - self.free_thresh) / span * 100.0).round_ties_even().clamp(0.0, 100.0) as u8
            }
        }
    }

    /// Occupancy of every grey value 0 ..= `max_value` of an opaque image.
    pub fn table(&self, max_value: u16) -> Vec<u8> {
        let scale = f64::from(max_value);
        (0..=max_value).map(|value| self.occupancy(f64::from(value) / scale, None)).collect()
    }
}
