//! PNG images through the `png` crate, streamed row by row; interlaced ones too.

use super::error::Fault;
use super::occupancy::PixelRule;
use super::pgm::Raster;
use super::{LoadOptions, checked_cells};
use png::{BitDepth, ColorType, Decoder, DecodingError, InterlaceInfo, Limits, Transformations};
use std::io::{BufRead, Seek};

/// Reads a PNG of `file_bytes` bytes.
pub fn read(
    reader: impl BufRead + Seek,
    file_bytes: u64,
    rule: &PixelRule,
    options: &LoadOptions,
) -> Result<Raster, Fault> {
    // bounds what ancillary chunks can make the decoder hold, plus two rows of the widest grid accepted
    let mut decoder = Decoder::new_with_limits(reader, Limits { bytes: 64 << 20 });
    decoder.set_transformations(Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    let info = decoder.read_header_info().map_err(fault)?;
    // DEFLATE packs at most 1032 : 1, and a pixel has at least one bit
    let fits = file_bytes.saturating_mul(1032 * 8);
    let cells = checked_cells(u64::from(info.width), u64::from(info.height), fits, options)?;
    let (width, height) = (info.width as usize, info.height as usize);
    let mut reader = decoder.read_info().map_err(fault)?;
    let (color, depth) = reader.output_color_type();
    let pixels = Pixels::new(color, depth, rule);
    let mut raster = Raster { width, height, cells: Vec::new() };
    raster.cells.reserve_exact(cells);
    let mut line = Vec::new();
    let mut rows = 0;
    while let Some(row) = reader.next_interlaced_row().map_err(fault)? {
        rows += 1;
        match *row.interlace() {
            InterlaceInfo::Null(_) => pixels.classify(row.data(), &mut raster.cells),
            InterlaceInfo::Adam7(pass) => {
                raster.cells.resize(cells, 0);
                line.clear();
                pixels.classify(row.data(), &mut line);
                png::expand_interlaced_row(&mut raster.cells, width, &line, &pass, 8);
            }
        }
        if rows > 2 * height + 8 {
            break;
        }
    }
    if raster.cells.len() != cells {
        return Err(Fault::new("the image body is shorter than its header says", "fetch the file again"));
    }
    Ok(raster)
}

fn fault(error: DecodingError) -> Fault {
    match error {
        DecodingError::IoError(e) => Fault::io(&e),
        DecodingError::LimitsExceeded => {
            Fault::new("the PNG wants too much memory", "save it without extra chunks")
        }
        other => Fault::new(format!("bad PNG: {other}"), "save the image again"),
    }
}

/// Turns decoded rows into occupancy.
struct Pixels<'a> {
    rule: &'a PixelRule,
    colors: usize,
    alpha: bool,
    sample_bytes: usize,
    /// occupancy of 8-bit opaque grey, the usual map
    grey: Vec<u8>,
}

impl<'a> Pixels<'a> {
    fn new(color: ColorType, depth: BitDepth, rule: &'a PixelRule) -> Self {
        let (colors, alpha) = match color {
            ColorType::Grayscale | ColorType::Indexed => (1, false),
            ColorType::GrayscaleAlpha => (1, true),
            ColorType::Rgb => (3, false),
            ColorType::Rgba => (3, true),
        };
        let sample_bytes = if depth == BitDepth::Sixteen { 2 } else { 1 };
        Self { rule, colors, alpha, sample_bytes, grey: rule.table(255) }
    }

    fn classify(&self, row: &[u8], out: &mut Vec<u8>) {
        if self.colors == 1 && !self.alpha && self.sample_bytes == 1 {
            out.extend(row.iter().map(|&v| self.grey[usize::from(v)]));
            return;
        }
        let channels = self.colors + usize::from(self.alpha);
        let scale = if self.sample_bytes == 2 { 65535.0 } else { 255.0 };
        for pixel in row.chunks_exact(channels * self.sample_bytes) {
            let sample = |channel: usize| match self.sample_bytes {
                2 => f64::from(u16::from_be_bytes([pixel[2 * channel], pixel[2 * channel + 1]])) / scale,
                _ => f64::from(pixel[channel]) / scale,
            };
            let shade = (0..self.colors).map(sample).sum::<f64>() / self.colors as f64;
            out.push(self.rule.occupancy(shade, self.alpha.then(|| sample(self.colors))));
        }
    }
}
