//! Obstacle lists: boxes, discs and polygons in TOML, JSON or CSV.
//!
//! TOML and JSON have the same keys; every length key exists in millimetres (`_mm`) and metres (`_m`):
//! `width`, `height` (the extent; the lower left corner is the origin), `boxes` \[\[x0, y0, x1, y1\], …\],
//! `cylinders` or `discs` \[\[x, y, radius\], …\], `polygons` \[\[\[x, y\], …\], …\], and optionally
//! `robot_radius`, `start`, `goal`. CSV has the header `x_m,y_m,r_m` and a disc a line; its extent is the
//! discs' bounding box and half its longer side all around.

use super::error::Fault;
use super::{Layer, LoadOptions, Map, MapFrame};
use hilare_interfaces::geometry::WorldPoint;
use serde::Deserialize;

/// An obstacle, metres from the map's lower left corner.
#[derive(Clone, Debug, PartialEq)]
pub enum Obstacle {
    /// axis-aligned box: least and greatest corner
    Box {
        /// x0, y0
        min_m: [f64; 2],
        /// x1, y1
        max_m: [f64; 2],
    },
    /// disc
    Disc {
        /// centre
        centre_m: [f64; 2],
        /// radius
        radius_m: f64,
    },
    /// simple polygon, at least three corners in either sense
    Polygon {
        /// corners in order
        corners_m: Vec<[f64; 2]>,
    },
}

impl Obstacle {
    /// Bounding box (least corner, greatest corner), metres.
    pub fn bounds_m(&self) -> ([f64; 2], [f64; 2]) {
        match self {
            Self::Box { min_m, max_m } => (*min_m, *max_m),
            Self::Disc { centre_m: [x, y], radius_m: r } => ([x - r, y - r], [x + r, y + r]),
            Self::Polygon { corners_m } => {
                let mut bounds = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
                for corner in corners_m {
                    for (axis, &value) in corner.iter().enumerate() {
                        bounds.0[axis] = bounds.0[axis].min(value);
                        bounds.1[axis] = bounds.1[axis].max(value);
                    }
                }
                bounds
            }
        }
    }
}

/// The job an obstacle list may name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapJob {
    /// the robot's radius, metres
    pub robot_radius_m: Option<f64>,
    /// where it starts, world frame
    pub start: Option<WorldPoint>,
    /// where it shall go, world frame
    pub goal: Option<WorldPoint>,
    /// length of the best path known, metres
    pub best_known_length_m: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct Keys {
    comment: Option<serde::de::IgnoredAny>,
    width_mm: Option<f64>,
    height_mm: Option<f64>,
    robot_radius_mm: Option<f64>,
    start_mm: Option<[f64; 2]>,
    goal_mm: Option<[f64; 2]>,
    boxes_mm: Vec<[f64; 4]>,
    #[serde(alias = "discs_mm")]
    cylinders_mm: Vec<[f64; 3]>,
    polygons_mm: Vec<Vec<[f64; 2]>>,
    best_known_length_mm: Option<f64>,
    width_m: Option<f64>,
    height_m: Option<f64>,
    robot_radius_m: Option<f64>,
    start_m: Option<[f64; 2]>,
    goal_m: Option<[f64; 2]>,
    boxes_m: Vec<[f64; 4]>,
    #[serde(alias = "discs_m")]
    cylinders_m: Vec<[f64; 3]>,
    polygons_m: Vec<Vec<[f64; 2]>>,
    best_known_length_m: Option<f64>,
}

const CURE: &str = "see the obstacle list's keys: width_mm, height_mm, boxes_mm, cylinders_mm, polygons_mm";

pub(super) fn from_toml(text: &str, options: &LoadOptions) -> Result<Map, Fault> {
    let keys: Keys = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
        Fault { line, ..Fault::new(error.message(), CURE) }
    })?;
    from_keys(keys, options)
}

pub(super) fn from_json(text: &str, options: &LoadOptions) -> Result<Map, Fault> {
    let keys: Keys =
        serde_json::from_str(text).map_err(|error| Fault::at(error.line(), error.to_string(), CURE))?;
    from_keys(keys, options)
}

fn from_keys(keys: Keys, options: &LoadOptions) -> Result<Map, Fault> {
    // dividing rounds to the nearest double of the decimal, multiplying by 0.001 would not
    const MM: f64 = 1000.0;
    let length = |mm: Option<f64>, m: Option<f64>| mm.map(|v| v / MM).or(m);
    let point = |mm: Option<[f64; 2]>, m: Option<[f64; 2]>| {
        mm.map(|[x, y]| [x / MM, y / MM]).or(m).map(|[x_m, y_m]| WorldPoint { x_m, y_m })
    };
    let extent = length(keys.width_mm, keys.width_m).zip(length(keys.height_mm, keys.height_m));
    let Some((width_m, height_m)) = extent else {
        return Err(Fault::new("width or height is missing", CURE));
    };
    let _ = keys.comment;
    let mut shapes = Vec::new();
    for (unit, boxes, discs, polygons) in [
        (MM, keys.boxes_mm, keys.cylinders_mm, keys.polygons_mm),
        (1.0, keys.boxes_m, keys.cylinders_m, keys.polygons_m),
    ] {
        let scaled = |p: [f64; 2]| p.map(|v| v / unit);
        shapes.extend(boxes.into_iter().map(|[x0, y0, x1, y1]| Obstacle::Box {
            min_m: scaled([x0.min(x1), y0.min(y1)]),
            max_m: scaled([x0.max(x1), y0.max(y1)]),
        }));
        shapes.extend(
            discs
                .into_iter()
                .map(|[x, y, r]| Obstacle::Disc { centre_m: scaled([x, y]), radius_m: r / unit }),
        );
        shapes.extend(
            polygons
                .into_iter()
                .map(|corners| Obstacle::Polygon { corners_m: corners.into_iter().map(scaled).collect() }),
        );
    }
    let job = MapJob {
        robot_radius_m: length(keys.robot_radius_mm, keys.robot_radius_m),
        start: point(keys.start_mm, keys.start_m),
        goal: point(keys.goal_mm, keys.goal_m),
        best_known_length_m: length(keys.best_known_length_mm, keys.best_known_length_m),
    };
    let map = build(WorldPoint::default(), [width_m, height_m], shapes, options)?;
    Ok(Map { job: Some(job), ..map })
}

pub(super) fn from_csv(text: &str, options: &LoadOptions) -> Result<Map, Fault> {
    const CSV_CURE: &str = "give x,y,radius in metres a line";
    let mut discs = Vec::new();
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fields: Vec<Option<f64>> = line.split(',').map(|field| field.trim().parse().ok()).collect();
        match fields[..] {
            [Some(x), Some(y), Some(r)] if x.is_finite() && y.is_finite() && r.is_finite() => {
                for (axis, value) in [x, y].into_iter().enumerate() {
                    low[axis] = low[axis].min(value - r);
                    high[axis] = high[axis].max(value + r);
                }
                discs.push([x, y, r]);
            }
            [None, None, None] if discs.is_empty() => {} // the header
            _ => return Err(Fault::at(index + 1, format!("bad disc \"{line}\""), CSV_CURE)),
        }
    }
    if discs.is_empty() {
        return Err(Fault::new("no disc", CSV_CURE));
    }
    // discs alone name no extent: leave a way around them
    let margin = 0.5 * (high[0] - low[0]).max(high[1] - low[1]);
    let origin = WorldPoint { x_m: low[0] - margin, y_m: low[1] - margin };
    let local =
        |[x, y, r]: [f64; 3]| Obstacle::Disc { centre_m: [x - origin.x_m, y - origin.y_m], radius_m: r };
    let shapes = discs.into_iter().map(local).collect();
    let extent = [high[0] - low[0] + 2.0 * margin, high[1] - low[1] + 2.0 * margin];
    build(origin, extent, shapes, options)
}

fn build(
    origin: WorldPoint,
    extent_m: [f64; 2],
    shapes: Vec<Obstacle>,
    options: &LoadOptions,
) -> Result<Map, Fault> {
    let Some(&bad) = extent_m.iter().find(|side| !(side.is_finite() && **side > 0.0)) else {
        check_shapes(&shapes)?;
        let raster_m = options.raster_m.unwrap_or_else(|| choose_raster(extent_m, &shapes));
        let cells = extent_m.map(|side| (side / raster_m - 1e-9).ceil().max(1.0));
        if cells[0] * cells[1] > options.max_cells as f64 {
            let what = format!("{} x {} raster cells is more than {}", cells[0], cells[1], options.max_cells);
            return Err(Fault::new(what, "use a coarser raster_m"));
        }
        let frame = MapFrame::new("map", origin, 0.0, raster_m, cells[0] as usize, cells[1] as usize)
            .ok_or_else(|| Fault::new("the extent does not make a frame", "give usual numbers"))?;
        let (unknown, blocked_from_percent) = (options.unknown, options.blocked_from_percent);
        return Ok(Map { frame, layer: Layer::Obstacles(shapes), unknown, blocked_from_percent, job: None });
    };
    Err(Fault::new(format!("the extent is {bad} m"), "give width and height above zero"))
}

fn check_shapes(shapes: &[Obstacle]) -> Result<(), Fault> {
    for (index, shape) in shapes.iter().enumerate() {
        let (min, max) = shape.bounds_m();
        let finite = min.iter().chain(&max).all(|v| v.is_finite());
        let sound = match shape {
            Obstacle::Box { .. } => finite,
            Obstacle::Disc { radius_m, .. } => finite && *radius_m >= 0.0,
            Obstacle::Polygon { corners_m } => finite && corners_m.len() >= 3,
        };
        if !sound {
            let cure = "coordinates are finite, radii not negative, polygons have three corners or more";
            return Err(Fault::new(format!("obstacle {} is malformed: {shape:?}", index + 1), cure));
        }
    }
    Ok(())
}

/// A raster fine enough for the smallest obstacle, within bounds that keep the field below a few
/// milliseconds; accuracy does not hang on it, since checks near obstacles use the shapes themselves.
fn choose_raster(extent_m: [f64; 2], shapes: &[Obstacle]) -> f64 {
    const COARSEST_SIDE: f64 = 320.0;
    const FINEST_SIDE: f64 = 2048.0;
    let longest = extent_m[0].max(extent_m[1]);
    let size = |shape: &Obstacle| {
        let (min, max) = shape.bounds_m();
        (max[0] - min[0]).max(max[1] - min[1])
    };
    let smallest = shapes.iter().map(size).fold(f64::INFINITY, f64::min);
    (smallest / 4.0).clamp(longest / FINEST_SIDE, longest / COARSEST_SIDE)
}
