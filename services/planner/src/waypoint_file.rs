//! Waypoint files: CSV with the header `x,y`, metres, one waypoint a line; `x,y,bulge` and
//! `x,y,bulge,crab_rad` for paths with arcs and sideways moves ([`Waypoint`]).

use crate::goal::{PathRefusal, check_path};
use hilare_interfaces::messages::{MAX_WAYPOINTS, Waypoint};
use std::fmt;
use std::io::{BufRead, BufReader, Read};

/// What is wrong with a waypoint file, and on which line (from 1; 0 for the file as a whole).
#[derive(Clone, Debug, PartialEq)]
pub struct WaypointFileError {
    /// Line.
    pub line: u64,
    /// What, and what to do.
    pub message: String,
}

impl fmt::Display for WaypointFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line > 0 { write!(f, "{}: {}", self.line, self.message) } else { f.write_str(&self.message) }
    }
}

impl std::error::Error for WaypointFileError {}

fn at(line: u64, message: impl Into<String>) -> WaypointFileError {
    WaypointFileError { line, message: message.into() }
}

/// Columns of a waypoint file; the last two may be absent.
const COLUMNS: [&str; 4] = ["x", "y", "bulge", "crab_rad"];

/// Longest line that is looked at, bytes; a longer one is no waypoint.
const MAX_LINE: usize = 1024;

/// Reads waypoints (metres, world frame) from CSV. Blank lines and lines that begin with `#` are
/// passed over. Reading stops at the first mistake and at [`MAX_WAYPOINTS`], so a huge or endless
/// file costs no more than the longest allowed one.
pub fn parse(text: impl Read) -> Result<Vec<Waypoint>, WaypointFileError> {
    let mut lines = Lines { reader: BufReader::new(text), bytes: Vec::new(), number: 0 };
    let Some((number, header)) = lines.next_content()? else {
        return Err(at(0, "empty; a waypoint file is CSV with the header x,y and one waypoint a line"));
    };
    let names: Vec<&str> = header.trim_start_matches('\u{feff}').split(',').map(str::trim).collect();
    let columns = names.len();
    if columns < 2 || !COLUMNS.starts_with(&names) {
        let known = "x,y (metres), x,y,bulge or x,y,bulge,crab_rad";
        return Err(at(number, format!("the header must be {known}, not {:?}", clip(&header))));
    }
    let mut waypoints = Vec::new();
    let mut numbers = Vec::new();
    while let Some((number, line)) = lines.next_content()? {
        if waypoints.len() == MAX_WAYPOINTS {
            return Err(at(number, format!("more than {MAX_WAYPOINTS} waypoints; thin the path out")));
        }
        waypoints.push(parse_waypoint(&line, columns, number)?);
        numbers.push(number);
    }
    check_path(&waypoints).map_err(|refusal: PathRefusal| {
        at(refusal.index().map_or(0, |index| numbers[index]), refusal.to_string())
    })?;
    Ok(waypoints)
}

/// Lines of a text with their numbers, each of bounded length.
struct Lines<R> {
    reader: BufReader<R>,
    bytes: Vec<u8>,
    number: u64,
}

impl<R: Read> Lines<R> {
    /// The next line that is neither blank nor a comment.
    fn next_content(&mut self) -> Result<Option<(u64, String)>, WaypointFileError> {
        loop {
            self.bytes.clear();
            self.number += 1;
            let limit = MAX_LINE as u64 + 1;
            let read = self.reader.by_ref().take(limit).read_until(b'\n', &mut self.bytes);
            if read.map_err(|error| at(self.number, error.to_string()))? == 0 {
                return Ok(None);
            }
            let line = std::str::from_utf8(&self.bytes)
                .ok()
                .filter(|line| line.len() <= MAX_LINE && !line.contains('\0'))
                .ok_or_else(|| at(self.number, "not text; a waypoint file is CSV with the header x,y"))?
                .trim();
            if !line.is_empty() && !line.starts_with('#') {
                return Ok(Some((self.number, line.to_owned())));
            }
        }
    }
}

fn parse_waypoint(line: &str, columns: usize, number: u64) -> Result<Waypoint, WaypointFileError> {
    let values: Vec<&str> = line.split(',').map(str::trim).collect();
    if values.len() != columns {
        let wanted = COLUMNS[..columns].join(",");
        return Err(at(number, format!("{} values where {wanted} are wanted", values.len())));
    }
    let mut numbers = [0.0; COLUMNS.len()];
    for (slot, text) in numbers.iter_mut().zip(values) {
        *slot = text.parse().map_err(|_| at(number, format!("{:?} is not a number", clip(text))))?;
    }
    let [x_m, y_m, bulge, crab_rad] = numbers;
    Ok(Waypoint { x_m, y_m, bulge, crab_rad })
}

fn clip(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Writes waypoints as a waypoint file, with no more columns than they need; reading it back gives the
/// same bits.
pub fn write(waypoints: &[Waypoint]) -> String {
    let any = |pick: fn(&Waypoint) -> f64| waypoints.iter().any(|waypoint| pick(waypoint) != 0.0);
    let columns = match (any(|waypoint| waypoint.bulge), any(|waypoint| waypoint.crab_rad)) {
        (_, true) => 4,
        (true, false) => 3,
        (false, false) => 2,
    };
    let mut text = COLUMNS[..columns].join(",");
    for waypoint in waypoints {
        let numbers = [waypoint.x_m, waypoint.y_m, waypoint.bulge, waypoint.crab_rad];
        let row: Vec<String> = numbers[..columns].iter().map(f64::to_string).collect();
        text.push('\n');
        text.push_str(&row.join(","));
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn error(text: &str) -> String {
        parse(text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        assert!(error("").starts_with("empty;"));
        assert!(error("x,y\n").starts_with("no waypoint;"));
        assert!(error("x,y\n1,2\n").starts_with("only one waypoint;"));
        assert!(error("a,b\n1,2\n").starts_with("1: the header must be x,y"));
        assert!(error("1,2\n3,4\n").starts_with("1: the header must be x,y"));
        assert!(error("x,y\n0,0\n1,one\n").starts_with("3: \"one\" is not a number"));
        assert!(error("x,y\n0,0\n\n# note\n1\n").starts_with("5: 1 values"));
        assert!(error("x,y\n0,0\n1,2,3\n").starts_with("3: 3 values"));
        assert!(error("x,y\n0,0\nnan,1\n").starts_with("3: coordinates must be finite"));
        assert!(error("x,y\n0,0\ninf,1\n").starts_with("3: coordinates must be finite"));
        assert!(error("x,y\n0,0\n1,1\n1,1\n").starts_with("4: the same place"));
        assert!(error("x,y\n0,0\n200000,1\n").starts_with("3: coordinates beyond"));
        assert!(error("x,y,crab\n1,2,3\n").starts_with("1: the header must be x,y"));
        assert!(error("x,y,bulge\n0,0,0\n1,1\n").starts_with("3: 2 values where x,y,bulge"));
        assert!(error("x,y,bulge\n0,0,0\n1,1,9\n").starts_with("3: an arc of more than 270°"));
        let binary = parse(&b"x,y\n\xff\xfe,1\n"[..]).unwrap_err();
        assert!(binary.to_string().contains("not text"), "{binary}");
    }

    #[test]
    fn a_byte_order_mark_windows_lines_and_blanks_are_fine() {
        let points = parse("\u{feff}x, y\r\n0, 0\r\n\r\n 1 ,2\r\n".as_bytes()).unwrap();
        assert_eq!(points, [Waypoint::straight(0.0, 0.0), Waypoint::straight(1.0, 2.0)]);
    }

    #[test]
    fn a_huge_file_is_refused_without_being_read_whole() {
        let body = std::iter::repeat_n("0.1,0.2\n0.3,0.4\n", 5_000_000).flat_map(|line| line.bytes());
        struct Bytes<I>(I);
        impl<I: Iterator<Item = u8>> Read for Bytes<I> {
            fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
                let mut n = 0;
                for (slot, byte) in buffer.iter_mut().zip(&mut self.0) {
                    *slot = byte;
                    n += 1;
                }
                Ok(n)
            }
        }
        let error = parse(Bytes("x,y\n".bytes().chain(body))).unwrap_err();
        assert!(error.message.starts_with("more than 65536 waypoints") && error.line < 70_000);
    }

    proptest! {
        #[test]
        fn any_bytes_are_answered(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = parse(&bytes[..]);
        }

        #[test]
        fn what_is_written_reads_back(
            points in proptest::collection::vec((-1e3..1e3f64, -1e3..1e3f64, -2.0..2.0f64), 2..50), columns in 2usize..5,
        ) {
            let points: Vec<_> = points.into_iter().map(|(x_m, y_m, z)| Waypoint {
                x_m,
                y_m,
                bulge: if columns > 2 { z } else { 0.0 },
                crab_rad: if columns > 3 { -z } else { 0.0 },
            }).collect();
            prop_assume!(check_path(&points).is_ok());
            prop_assert_eq!(parse(write(&points).as_bytes()).unwrap(), points);
        }
    }
}
