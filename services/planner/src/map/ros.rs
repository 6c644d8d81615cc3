//! ROS map_server maps: a YAML file that names an image and says what its pixels mean.
//!
//! | key | default | meaning |
//! |---|---|---|
//! | `image` | – | relative to the YAML file; absolute and `..` paths are followed, as map_server does |
//! | `resolution` | – | metres a pixel |
//! | `origin` | – | x, y (metres) and yaw (radians, optional) of the lower left pixel's corner |
//! | `mode` | `trinary` | `trinary`, `scale` or `raw` |
//! | `negate` | 0 | integer or boolean |
//! | `occupied_thresh` | 0.65 | |
//! | `free_thresh` | 0.196 | keeps the usual unknown grey 205 (p = 0.19608) unknown; 0.25 would free it |
//!
//! Other keys are ignored, as map_server does. Following any image path means that a YAML file can name any
//! file the user may read; only its pixels can come back, never its text. Read maps from people you trust.

use super::error::{Fault, MapError};
use super::occupancy::{Mode, PixelRule};
use super::{Layer, LoadOptions, Map, MapFrame, open, pgm, png, read_text};
use hilare_interfaces::geometry::WorldPoint;
use serde::Deserialize;
use serde::de::{self, Visitor};
use serde_saphyr::Spanned;
use std::io::BufRead;
use std::path::Path;

#[derive(Deserialize)]
struct Keys {
    image: Spanned<String>,
    resolution: Spanned<f64>,
    origin: Spanned<Vec<f64>>,
    mode: Option<Spanned<String>>,
    #[serde(default)]
    negate: Flag,
    occupied_thresh: Option<Spanned<f64>>,
    free_thresh: Option<Spanned<f64>>,
}

/// What a map YAML says, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct RosMeta {
    /// image path as written
    pub image: String,
    /// metres a pixel
    pub resolution_m: f64,
    /// lower left corner
    pub origin: WorldPoint,
    /// turn of the image against the world, radians
    pub yaw_rad: f64,
    /// what a pixel means
    pub rule: PixelRule,
    resolution_line: usize,
}

pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Map, MapError> {
    let in_yaml = |fault: Fault| fault.in_file(path);
    let text = read_text(path).map_err(in_yaml)?;
    let meta = parse_meta(&text).map_err(in_yaml)?;
    let image_path = path.parent().unwrap_or(Path::new("")).join(&meta.image);
    let in_image = |fault: Fault| fault.in_file(&image_path);
    let (file, bytes) = open(&image_path).map_err(in_image)?;
    let raster = read_image(file, bytes, &meta.rule, options).map_err(in_image)?;
    from_raster(&meta, raster, options).map_err(in_yaml)
}

/// Reads PGM or PNG, told apart by their first bytes as image libraries do, not by the file's name.
pub(crate) fn read_image(
    mut reader: impl BufRead + std::io::Seek,
    file_bytes: u64,
    rule: &PixelRule,
    options: &LoadOptions,
) -> Result<pgm::Raster, Fault> {
    let is_png = reader.fill_buf().map_err(|e| Fault::io(&e))?.starts_with(b"\x89PNG");
    if is_png {
        png::read(reader, file_bytes, rule, options)
    } else {
        pgm::read(reader, file_bytes, rule, options)
    }
}

pub(crate) fn from_raster(
    meta: &RosMeta,
    mut raster: pgm::Raster,
    options: &LoadOptions,
) -> Result<Map, Fault> {
    super::flip_rows(&mut raster.cells, raster.width);
    let frame =
        MapFrame::new("map", meta.origin, meta.yaw_rad, meta.resolution_m, raster.width, raster.height)
            .ok_or_else(|| {
                Fault::at(
                    meta.resolution_line,
                    "origin and resolution do not make a frame",
                    "give usual numbers",
                )
            })?;
    Ok(Map {
        frame,
        layer: Layer::Cells(raster.cells),
        unknown: options.unknown,
        blocked_from_percent: options.blocked_from_percent,
        job: None,
    })
}

/// Reads and checks the YAML text.
pub(crate) fn parse_meta(text: &str) -> Result<RosMeta, Fault> {
    let keys: Keys = serde_saphyr::from_str(text).map_err(|error| {
        let line = error.location().map(|l| l.line() as usize).filter(|&l| l > 0);
        let what = error.without_snippet().to_string();
        Fault { line, ..Fault::new(what, "needed: image, resolution, origin: [x, y, yaw]") }
    })?;
    let line_of = |spanned: &serde_saphyr::Location| spanned.line() as usize;
    let resolution_line = line_of(&keys.resolution.referenced);
    let resolution_m = keys.resolution.value;
    if !(resolution_m.is_finite() && resolution_m > 0.0) {
        let what = format!("resolution is {resolution_m}");
        return Err(Fault::at(resolution_line, what, "give metres a pixel, above zero"));
    }
    let (origin, yaw_rad) = match keys.origin.value[..] {
        [x_m, y_m] => (WorldPoint { x_m, y_m }, 0.0),
        [x_m, y_m, yaw] => (WorldPoint { x_m, y_m }, yaw),
        ref other => {
            let what = format!("origin has {} numbers", other.len());
            return Err(Fault::at(line_of(&keys.origin.referenced), what, "give [x, y, yaw]"));
        }
    };
    if !(origin.is_finite() && yaw_rad.is_finite()) {
        return Err(Fault::at(
            line_of(&keys.origin.referenced),
            "origin is not finite",
            "give metres and radians",
        ));
    }
    if keys.image.value.is_empty() {
        return Err(Fault::at(line_of(&keys.image.referenced), "image is empty", "name the image file"));
    }
    let rule = pixel_rule(&keys)?;
    Ok(RosMeta { image: keys.image.value, resolution_m, origin, yaw_rad, rule, resolution_line })
}

fn pixel_rule(keys: &Keys) -> Result<PixelRule, Fault> {
    const OCCUPIED_THRESH: f64 = 0.65;
    const FREE_THRESH: f64 = 0.196;
    let mode = match &keys.mode {
        None => Mode::Trinary,
        Some(mode) => match mode.value.as_str() {
            "trinary" => Mode::Trinary,
            "scale" => Mode::Scale,
            "raw" => Mode::Raw,
            other => {
                let what = format!("unknown mode \"{other}\"");
                return Err(Fault::at(mode.referenced.line() as usize, what, "use trinary, scale or raw"));
            }
        },
    };
    let thresh = |key: &Option<Spanned<f64>>, default: f64| match key {
        None => Ok(default),
        Some(t) if (0.0..=1.0).contains(&t.value) => Ok(t.value),
        Some(t) => {
            let what = format!("threshold {}", t.value);
            Err(Fault::at(t.referenced.line() as usize, what, "thresholds are within 0-1"))
        }
    };
    let occupied_thresh = thresh(&keys.occupied_thresh, OCCUPIED_THRESH)?;
    let free_thresh = thresh(&keys.free_thresh, FREE_THRESH)?;
    if mode != Mode::Raw && free_thresh >= occupied_thresh {
        let line =
            keys.free_thresh.as_ref().or(keys.occupied_thresh.as_ref()).map(|t| t.referenced.line() as usize);
        let what = format!("free_thresh {free_thresh} is not below occupied_thresh {occupied_thresh}");
        return Err(Fault { line, ..Fault::new(what, "lower free_thresh") });
    }
    Ok(PixelRule { mode, negate: keys.negate.0, occupied_thresh, free_thresh })
}

/// `negate`, which map_server accepts as integer or boolean.
#[derive(Default)]
struct Flag(bool);

impl<'de> Deserialize<'de> for Flag {
    fn deserialize<D: de::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FlagVisitor;
        impl Visitor<'_> for FlagVisitor {
            type Value = Flag;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("negate as 0, 1, true or false")
            }
            fn visit_bool<E: de::Error>(self, v: bool) -> Result<Flag, E> {
                Ok(Flag(v))
            }
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Flag, E> {
                Ok(Flag(v != 0))
            }
            fn visit_u64<E: de::Error>(self, v: u64) -> Result<Flag, E> {
                Ok(Flag(v != 0))
            }
            fn visit_str<E: de::Error>(self, v: &str) -> Result<Flag, E> {
                match v.to_ascii_lowercase().as_str() {
                    "true" | "yes" | "on" | "y" => Ok(Flag(true)),
                    "false" | "no" | "off" | "n" => Ok(Flag(false)),
                    _ => Err(E::invalid_value(de::Unexpected::Str(v), &self)),
                }
            }
        }
        deserializer.deserialize_any(FlagVisitor)
    }
}
