//! Moving AI benchmark grids (`.map`) and their query lists (`.scen`).
//!
//! Sturtevant, *Benchmarks for Grid-Based Pathfinding*, IEEE Trans. Comput. Intell. AI Games 4(2), 2012.
//! `.`, `G` and `S` are free; `@`, `O`, `T` and `W` are blocked. A map names no unit: a cell is
//! [`LoadOptions::moving_ai_resolution_m`] metres. Row 0 of the file is row 0 of the grid, so a query's cell
//! (x, y) is the grid's cell (x, y) and its centre (x + ½, y + ½) cells; drawn with y up the map is mirrored.

use super::error::{Fault, MapError};
use super::{Layer, LoadOptions, Map, MapFrame, checked_cells};
use hilare_interfaces::geometry::WorldPoint;
use std::io::{BufRead, Read};
use std::path::Path;

/// One query of a `.scen` file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// start cell (column, row)
    pub start: (usize, usize),
    /// goal cell (column, row)
    pub goal: (usize, usize),
    /// length of the best octile path without corner cutting, cells
    pub octile_length_cells: f64,
}

/// Reads a `.scen` file.
///
/// # Errors
/// A bad line is named with its number.
pub fn load_scenarios(path: impl AsRef<Path>) -> Result<Vec<Scenario>, MapError> {
    let path = path.as_ref();
    super::read_text(path).and_then(|text| parse_scenarios(&text)).map_err(|fault| fault.in_file(path))
}

pub(crate) fn parse_scenarios(text: &str) -> Result<Vec<Scenario>, Fault> {
    let mut lines = text.lines().enumerate();
    if !lines.next().is_some_and(|(_, first)| first.trim_start().starts_with("version")) {
        return Err(Fault::at(1, "not a .scen file", "its first line is \"version 1\""));
    }
    let filled = lines.filter(|(_, line)| !line.trim().is_empty());
    filled
        .map(|(index, line)| {
            parse_scenario(line).ok_or_else(|| {
                let cure = "expected: bucket map width height x0 y0 x1 y1 length, tab separated";
                Fault::at(index + 1, "bad query line", cure)
            })
        })
        .collect()
}

fn parse_scenario(line: &str) -> Option<Scenario> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    // a map's name may hold blanks, so count from the end
    let [_, _, .., _, _, x0, y0, x1, y1, length] = fields[..] else { return None };
    let octile_length_cells = length.parse().ok().filter(|l: &f64| l.is_finite())?;
    let cell = |x: &str, y: &str| Some((x.parse().ok()?, y.parse().ok()?));
    Some(Scenario { start: cell(x0, y0)?, goal: cell(x1, y1)?, octile_length_cells })
}

pub(crate) fn read_map(
    mut reader: impl BufRead,
    file_bytes: u64,
    options: &LoadOptions,
) -> Result<Map, Fault> {
    let mut line = Vec::new();
    let (mut width, mut height) = (None, None);
    let mut number = 0;
    loop {
        number += 1;
        let text = header_line(&mut reader, &mut line, number)?;
        let mut words = text.split_whitespace();
        match (words.next(), words.next()) {
            (Some("type"), Some(_)) | (None, _) => {}
            (Some("width"), Some(value)) => width = value.parse::<u64>().ok(),
            (Some("height"), Some(value)) => height = value.parse::<u64>().ok(),
            (Some("map"), None) => break,
            _ => {
                let what = "not a Moving AI header line";
                return Err(Fault::at(number, what, "expected: type, height, width, then map"));
            }
        }
    }
    let (Some(width), Some(height)) = (width, height) else {
        return Err(Fault::at(
            number,
            "width or height is missing or not a number",
            "give both before \"map\"",
        ));
    };
    let total = checked_cells(width, height, file_bytes, options)?;
    let mut cells = Vec::with_capacity(total);
    for _ in 0..height {
        number += 1;
        read_row(&mut reader, width as usize, &mut line, number)?;
        for &tile in &line {
            cells.push(match tile {
                b'.' | b'G' | b'S' => 0,
                b'@' | b'O' | b'T' | b'W' => 100,
                other => {
                    let what = format!("unknown tile {:?}", char::from(other));
                    return Err(Fault::at(number, what, "tiles are . G S @ O T W"));
                }
            });
        }
    }
    let (origin, resolution_m) = (WorldPoint::default(), options.moving_ai_resolution_m);
    let frame = MapFrame::new("map", origin, 0.0, resolution_m, width as usize, height as usize)
        .ok_or_else(|| Fault::new("the size does not make a frame", "give a usual size and resolution"))?;
    let (unknown, blocked_from_percent) = (options.unknown, options.blocked_from_percent);
    Ok(Map { frame, layer: Layer::Cells(cells), unknown, blocked_from_percent, job: None })
}

fn header_line<'a>(
    reader: &mut impl BufRead,
    line: &'a mut Vec<u8>,
    number: usize,
) -> Result<&'a str, Fault> {
    const MAX_BYTES: u64 = 256;
    const MAX_LINES: usize = 64;
    line.clear();
    let read = reader.take(MAX_BYTES).read_until(b'\n', line).map_err(|e| Fault::io(&e))?;
    if read == 0 || number > MAX_LINES {
        return Err(Fault::at(number, "no \"map\" line", "the file is cut short or no Moving AI map"));
    }
    std::str::from_utf8(line).map_err(|_| Fault::at(number, "not text", "give a Moving AI map"))
}

/// Reads exactly `width` tiles and the line end after them.
fn read_row(reader: &mut impl BufRead, width: usize, line: &mut Vec<u8>, number: usize) -> Result<(), Fault> {
    line.clear();
    let limit = width as u64 + 2;
    reader.take(limit).read_until(b'\n', line).map_err(|e| Fault::io(&e))?;
    while line.last().is_some_and(|&c| c == b'\n' || c == b'\r') {
        line.pop();
    }
    if line.len() != width {
        let what = format!("the row has {} tiles, the width is {width}", line.len());
        return Err(Fault::at(number, what, "make every row as long as the width"));
    }
    Ok(())
}
