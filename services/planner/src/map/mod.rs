//! Maps: a typed value with frame, resolution and extent, read from every format users have.
//!
//! | file | format |
//! |---|---|
//! | `.yaml`, `.yml` | ROS map_server, image PGM (P2, P5) or PNG beside it ([`ros`]) |
//! | `.map` | Moving AI benchmark grid ([`moving_ai`]) |
//! | `.toml`, `.json` | obstacle list: boxes, discs, polygons ([`obstacles`]) |
//! | `.csv` | discs `x,y,radius`, metres ([`obstacles`]) |
//!
//! Memory while loading: images and `.map` files are streamed row by row into the one byte a cell that is
//! kept, so the peak is that grid plus one image row. A header's size is believed only as far as the
//! file's own length can carry it.

pub(crate) mod error;
mod frame;
mod grid;
pub mod moving_ai;
pub mod obstacles;
pub(crate) mod occupancy;
pub(crate) mod pgm;
mod picture;
pub(crate) mod png;
pub mod ros;

pub use error::MapError;
pub use frame::{GridPoint, MapFrame};
pub use grid::Grid;
pub use obstacles::{MapJob, Obstacle};
pub use picture::Picture;

use error::Fault;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// How unknown space (ROS value −1) is planned through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Unknown {
    /// unknown cells are obstacles (default)
    #[default]
    Blocked,
    /// unknown cells are free
    Free,
}

/// Choices a map file does not carry.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// what unknown space counts as
    pub unknown: Unknown,
    /// least occupancy in percent that blocks a cell (matters in modes `scale` and `raw` only); 1–100
    pub blocked_from_percent: u8,
    /// largest accepted grid, cells
    pub max_cells: usize,
    /// metres a cell of a Moving AI map, which names none
    pub moving_ai_resolution_m: f64,
    /// raster of an obstacle list, metres a cell; `None` chooses one from extent and smallest obstacle
    pub raster_m: Option<f64>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            unknown: Unknown::Blocked,
            blocked_from_percent: 65,
            max_cells: 1 << 27,
            moving_ai_resolution_m: 1.0,
            raster_m: None,
        }
    }
}

/// What fills the map's extent.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer {
    /// one byte a cell, row 0 at the lowest y: 0–100 occupancy in percent, [`UNKNOWN`] unknown
    Cells(Vec<u8>),
    /// exact shapes, metres from the map's lower left corner along its axes
    Obstacles(Vec<Obstacle>),
}

/// Occupancy byte of an unknown cell.
pub const UNKNOWN: u8 = 255;

/// A loaded map.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    pub(crate) frame: MapFrame,
    pub(crate) layer: Layer,
    pub(crate) unknown: Unknown,
    pub(crate) blocked_from_percent: u8,
    pub(crate) job: Option<MapJob>,
}

impl Map {
    /// Loads the map at `path`; the file's extension picks the format (see the module).
    ///
    /// # Errors
    /// One line with file, line where known, what is wrong and what to do.
    pub fn load(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, MapError> {
        let path = path.as_ref();
        let in_file = |fault: Fault| fault.in_file(path);
        check_options(options).map_err(in_file)?;
        match Format::of(path).map_err(in_file)? {
            Format::Ros => ros::load(path, options),
            Format::MovingAi => {
                let (file, bytes) = open(path).map_err(in_file)?;
                moving_ai::read_map(file, bytes, options).map_err(in_file)
            }
            list => read_text(path).and_then(|text| list.parse_list(&text, options)).map_err(in_file),
        }
    }

    /// Reads a map other than ROS's from memory; `name` is a file name, whose extension picks the format.
    ///
    /// # Errors
    /// As [`Map::load`].
    pub fn from_bytes(name: &str, bytes: &[u8], options: &LoadOptions) -> Result<Self, MapError> {
        let parse = || match (check_options(options), Format::of(Path::new(name))?) {
            (Err(fault), _) => Err(fault),
            (_, Format::Ros) => Err(Fault::new("a ROS map is two files", "use from_ros_bytes")),
            (_, Format::MovingAi) => moving_ai::read_map(bytes, bytes.len() as u64, options),
            (_, list) => list.parse_list(utf8(bytes)?, options),
        };
        parse().map_err(|fault| fault.in_file(Path::new(name)))
    }

    /// Reads a ROS map from memory: the YAML file's bytes and the image's. The YAML's image path is unused.
    ///
    /// # Errors
    /// As [`Map::load`].
    pub fn from_ros_bytes(yaml: &[u8], image: &[u8], options: &LoadOptions) -> Result<Self, MapError> {
        let parse = || {
            check_options(options)?;
            let meta = ros::parse_meta(utf8(yaml)?)?;
            let image = std::io::Cursor::new(image);
            let bytes = image.get_ref().len() as u64;
            ros::from_raster(&meta, ros::read_image(image, bytes, &meta.rule, options)?, options)
        };
        parse().map_err(|fault: Fault| fault.in_file(Path::new("(memory)")))
    }

    /// A map from occupancy bytes (see [`Layer::Cells`]).
    ///
    /// # Errors
    /// When `cells` does not hold exactly the frame's cells.
    pub fn from_cells(frame: MapFrame, cells: Vec<u8>, unknown: Unknown) -> Result<Self, MapError> {
        if cells.len() != frame.width_cells() * frame.height_cells() {
            let what = format!(
                "{} cells for a {} x {} grid",
                cells.len(),
                frame.width_cells(),
                frame.height_cells()
            );
            return Err(Fault::new(what, "give one byte a cell").in_file(Path::new("(cells)")));
        }
        let blocked_from_percent = LoadOptions::default().blocked_from_percent;
        Ok(Self { frame, layer: Layer::Cells(cells), unknown, blocked_from_percent, job: None })
    }

    /// Frame, resolution and extent.
    pub fn frame(&self) -> &MapFrame {
        &self.frame
    }

    /// Cells or shapes.
    pub fn layer(&self) -> &Layer {
        &self.layer
    }

    /// Robot radius, start and goal, where an obstacle list names them.
    pub fn job(&self) -> Option<&MapJob> {
        self.job.as_ref()
    }

    /// True when an occupancy byte counts as an obstacle under this map's choices.
    pub fn blocks(&self, occupancy: u8) -> bool {
        self.blocking_range().contains(&occupancy)
    }

    /// The occupancy bytes that count as obstacles: [`UNKNOWN`] is the largest, so they are one range.
    pub(crate) fn blocking_range(&self) -> std::ops::RangeInclusive<u8> {
        let last = if self.unknown == Unknown::Blocked { UNKNOWN } else { UNKNOWN - 1 };
        self.blocked_from_percent..=last
    }
}

/// The formats told apart by a file's extension.
#[derive(Clone, Copy, Debug)]
enum Format {
    Ros,
    MovingAi,
    Toml,
    Json,
    Csv,
}

impl Format {
    fn of(path: &Path) -> Result<Self, Fault> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        match extension.as_str() {
            "yaml" | "yml" => Ok(Self::Ros),
            "map" => Ok(Self::MovingAi),
            "toml" => Ok(Self::Toml),
            "json" => Ok(Self::Json),
            "csv" => Ok(Self::Csv),
            _ => Err(Fault::new(
                format!("unknown map format \".{extension}\""),
                "give a ROS .yaml, a Moving AI .map, or obstacles as .toml, .json or .csv",
            )),
        }
    }

    fn parse_list(self, text: &str, options: &LoadOptions) -> Result<Map, Fault> {
        match self {
            Self::Toml => obstacles::from_toml(text, options),
            Self::Json => obstacles::from_json(text, options),
            _ => obstacles::from_csv(text, options),
        }
    }
}

fn utf8(bytes: &[u8]) -> Result<&str, Fault> {
    std::str::from_utf8(bytes).map_err(|_| Fault::new("not UTF-8 text", "save the file as UTF-8"))
}

fn check_options(options: &LoadOptions) -> Result<(), Fault> {
    if !(1..=100).contains(&options.blocked_from_percent) {
        return Err(Fault::new("blocked_from_percent is not within 1-100", "give a percentage"));
    }
    let raster = options.raster_m.unwrap_or(1.0);
    for (name, value) in [("raster_m", raster), ("moving_ai_resolution_m", options.moving_ai_resolution_m)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Fault::new(format!("{name} is {value}"), "give metres above zero"));
        }
    }
    Ok(())
}

/// Opens a regular file and tells its length in bytes.
pub(crate) fn open(path: &Path) -> Result<(BufReader<File>, u64), Fault> {
    #[allow(clippy::disallowed_methods, reason = "a map is a file; this is the crate's one door to them")]
    let file = File::open(path).map_err(|e| Fault::io(&e))?;
    let meta = file.metadata().map_err(|e| Fault::io(&e))?;
    if !meta.is_file() {
        return Err(Fault::new("not a regular file", "give a map file"));
    }
    Ok((BufReader::with_capacity(1 << 16, file), meta.len()))
}

/// Reads a small text file whole.
pub(crate) fn read_text(path: &Path) -> Result<String, Fault> {
    const MAX_BYTES: u64 = 64 << 20;
    let (mut file, bytes) = open(path)?;
    if bytes > MAX_BYTES {
        return Err(Fault::new(format!("{bytes} bytes of text"), "keep the file below 64 MiB"));
    }
    let mut text = String::new();
    std::io::Read::read_to_string(&mut file, &mut text).map_err(|e| Fault::io(&e))?;
    Ok(text)
}

/// Checks a header's size against the options and against what the file can hold, and gives the cell count.
pub(crate) fn checked_cells(
    width: u64,
    height: u64,
    fits: u64,
    options: &LoadOptions,
) -> Result<usize, Fault> {
    if width == 0 || height == 0 {
        return Err(Fault::new(format!("the size is {width} x {height}"), "give an image with pixels"));
    }
    let cells = width.checked_mul(height).filter(|&n| n <= options.max_cells as u64);
    let Some(cells) = cells else {
        let what = format!("{width} x {height} cells is more than {}", options.max_cells);
        return Err(Fault::new(what, "use a coarser map or raise max_cells"));
    };
    if cells > fits {
        let what = format!("the header says {width} x {height}, the file can hold at most {fits} cells");
        return Err(Fault::new(what, "the file is cut short or its header is wrong: fetch it again"));
    }
    Ok(cells as usize)
}

/// Turns a top-down raster upside down in place: images start at the highest y, grids at the lowest.
pub(crate) fn flip_rows(cells: &mut [u8], width: usize) {
    let height = cells.len() / width.max(1);
    for row in 0..height / 2 {
        let (low, high) = cells.split_at_mut((height - 1 - row) * width);
        low[row * width..(row + 1) * width].swap_with_slice(&mut high[..width]);
    }
}
