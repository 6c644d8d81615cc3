//! Netpbm grey maps, P5 (binary) and P2 (text), 8 and 16 bit, streamed row by row.
//!
//! Format: the Netpbm project's pgm(5). A `#` starts a comment up to the line's end anywhere in the header
//! (and in P2 bodies); header fields may share a line; 16-bit samples are big-endian.

use super::error::Fault;
use super::occupancy::PixelRule;
use super::{LoadOptions, checked_cells};
use std::io::{BufRead, ErrorKind};

/// A decoded image: size and one occupancy byte a pixel, top row first.
#[derive(Debug, PartialEq, Eq)]
pub struct Raster {
    pub width: usize,
    pub height: usize,
    pub cells: Vec<u8>,
}

/// Reads a P2 or P5 image of `file_bytes` bytes.
pub fn read(
    mut reader: impl BufRead,
    file_bytes: u64,
    rule: &PixelRule,
    options: &LoadOptions,
) -> Result<Raster, Fault> {
    let mut magic = [0u8; 2];
    reader.read_exact(&mut magic).map_err(|e| Fault::io(&e))?;
    let binary = match &magic {
        b"P5" => true,
        b"P2" => false,
        _ => return Err(Fault::at(1, "not a P5 or P2 image", "save the map as PGM or PNG")),
    };
    let mut text = Tokens { reader: &mut reader, line: 1 };
    let width = text.number("the width")?;
    let height = text.number("the height")?;
    let max_value = text.number("the maximum grey value")?;
    let max_value = u16::try_from(max_value).ok().filter(|&v| v > 0).ok_or_else(|| {
        Fault::at(text.line, format!("maximum grey value {max_value}"), "it is within 1-65535")
    })?;
    let sample_bytes = if max_value > 255 { 2 } else { 1 };
    // a text sample needs a digit and a separator, except the last
    let fits = if binary { file_bytes / sample_bytes } else { file_bytes / 2 + 1 };
    let cells = checked_cells(width, height, fits, options)?;
    let mut raster = Raster { width: width as usize, height: height as usize, cells: Vec::new() };
    raster.cells.reserve_exact(cells);
    let table = rule.table(max_value);
    let top = table[usize::from(max_value)];
    let classify = |value: usize| table.get(value).copied().unwrap_or(top);
    if binary {
        let mut row = vec![0u8; raster.width * sample_bytes as usize];
        for _ in 0..raster.height {
            reader.read_exact(&mut row).map_err(|e| short_body(&e))?;
            if sample_bytes == 1 {
                raster.cells.extend(row.iter().map(|&b| classify(usize::from(b))));
            } else {
                let samples = row.as_chunks::<2>().0;
                raster
                    .cells
                    .extend(samples.iter().map(|&pair| classify(usize::from(u16::from_be_bytes(pair)))));
            }
        }
    } else {
        for _ in 0..cells {
            let value = text.number("a grey value")?;
            raster.cells.push(classify(value as usize));
        }
    }
    Ok(raster)
}

fn short_body(error: &std::io::Error) -> Fault {
    match error.kind() {
        ErrorKind::UnexpectedEof => Fault::new(
            "the image body is shorter than its header says",
            "the file is cut short: fetch it again",
        ),
        _ => Fault::io(error),
    }
}

/// White-space separated numbers with comments, counting lines for errors.
struct Tokens<'a, R> {
    reader: &'a mut R,
    line: usize,
}

impl<R: BufRead> Tokens<'_, R> {
    fn byte(&mut self) -> Result<Option<u8>, Fault> {
        let buffer = self.reader.fill_buf().map_err(|e| Fault::io(&e))?;
        let Some(&byte) = buffer.first() else { return Ok(None) };
        self.reader.consume(1);
        self.line += usize::from(byte == b'\n');
        Ok(Some(byte))
    }

    /// The next number; consumes the one separator after it, as the format demands before a binary body.
    fn number(&mut self, what: &str) -> Result<u64, Fault> {
        let mut value: Option<u64> = None;
        loop {
            let line = self.line;
            match (self.byte()?, value) {
                (Some(b'#'), None) => while !matches!(self.byte()?, None | Some(b'\n')) {},
                (Some(b'#'), Some(v)) => {
                    while !matches!(self.byte()?, None | Some(b'\n')) {}
                    return Ok(v);
                }
                (Some(digit @ b'0'..=b'9'), v) => {
                    let next = v.unwrap_or(0) * 10 + u64::from(digit - b'0');
                    if next > u64::from(u32::MAX) {
                        return Err(Fault::at(line, format!("{what} is too large"), "check the file"));
                    }
                    value = Some(next);
                }
                (Some(c), Some(v)) if c.is_ascii_whitespace() => return Ok(v),
                (Some(c), None) if c.is_ascii_whitespace() => {}
                (Some(c), _) => {
                    let what = format!("{what} has the character {:?}", char::from(c));
                    return Err(Fault::at(line, what, "only digits belong there"));
                }
                (None, Some(v)) => return Ok(v),
                (None, None) => {
                    let what = format!("the file ends before {what}");
                    return Err(Fault::at(line, what, "the file is cut short: fetch it again"));
                }
            }
        }
    }
}
