//! What a scenario expects of a run: when a deviation is corrected, and what others made of the job.

use super::super::assign::check_number;
use super::super::document::{Document, Value};
use super::super::error::{ConfigError, quoted};
use super::super::suggest;
use crate::report::Band;
use hilare_interfaces::params::{ParamKind, ParamSpec};
use toml::de::DeTable;

const PUBLISHED_KEYS: &[&str] = &[
    "source",
    "cross_track_mean_m",
    "speed_error_mean_mps",
    "correction_time_s",
    "correction_travel_m",
    "steady_cross_track_m",
];
const CORRECTION_KEYS: &[&str] = &["cross_track_m", "heading_rad"];

/// Published figures are millimetres in a metre key as often as not: the bounds tell them apart.
static CROSS_TRACK: ParamSpec = ParamSpec {
    name: "cross_track_mean_m",
    kind: ParamKind::Real,
    unit: "m",
    default: 0.0,
    min: 0.0,
    max: 1.0,
    doc: "Mean cross-track error.",
};
static SPEED_ERROR: ParamSpec =
    ParamSpec { name: "speed_error_mean_mps", unit: "m/s", doc: "Mean speed error.", ..CROSS_TRACK };
static CORRECTION_TIME: ParamSpec = ParamSpec {
    name: "correction_time_s",
    unit: "s",
    max: 3600.0,
    doc: "Time to correct the deviation at the start.",
    ..CROSS_TRACK
};
static CORRECTION_TRAVEL: ParamSpec = ParamSpec {
    name: "correction_travel_m",
    max: 1000.0,
    doc: "Way to correct the deviation at the start.",
    ..CROSS_TRACK
};
static BAND: ParamSpec = ParamSpec {
    name: "cross_track_m",
    min: 1e-6,
    doc: "Cross-track distance within which a deviation is corrected.",
    ..CROSS_TRACK
};
static BAND_HEADING: ParamSpec = ParamSpec {
    name: "heading_rad",
    unit: "rad",
    default: std::f64::consts::PI,
    min: 1e-6,
    max: std::f64::consts::PI,
    doc: "Heading error within which a deviation is corrected.",
    ..CROSS_TRACK
};

static STEADY: ParamSpec = ParamSpec {
    name: "steady_cross_track_m",
    doc: "Greatest cross-track distance once the deviation is corrected.",
    ..CROSS_TRACK
};

/// The numbers of `[correction]`.
pub(in super::super) static CORRECTION: [&ParamSpec; 2] = [&BAND, &BAND_HEADING];

/// The numbers of `[[published]]`.
pub(in super::super) fn published_specs() -> [&'static ParamSpec; 5] {
    [&CROSS_TRACK, &SPEED_ERROR, &CORRECTION_TIME, &CORRECTION_TRAVEL, &STEADY]
}

/// A number as it was written.
pub(super) struct Figure {
    pub place: String,
    pub section: &'static str,
    pub spec: &'static ParamSpec,
    pub value: f64,
}

/// Values the verdict shows beside ours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Published {
    /// Where they come from.
    pub source: String,
    /// Mean cross-track error, m.
    pub cross_track_mean_m: Option<f64>,
    /// Mean speed error, m/s.
    pub speed_error_mean_mps: Option<f64>,
    /// Time to correct the deviation at the start, s.
    pub correction_time_s: Option<f64>,
    /// Way to correct it, m.
    pub correction_travel_m: Option<f64>,
    /// Greatest cross-track distance afterwards, m.
    pub steady_cross_track_m: Option<f64>,
}

/// Key, value and place of each line of a table, in the file's order, with how to say what is wrong with it.
fn lines<'t>(
    file: &'t Document<'_>,
    table: &'t DeTable<'_>,
) -> impl Iterator<Item = (&'t str, Value<'t>, String, impl Fn(String) -> ConfigError + 't)> {
    let mut items: Vec<_> = table.iter().collect();
    items.sort_by_key(|(key, _)| key.span().start);
    items.into_iter().map(move |(key, value)| {
        let offset = key.span().start;
        let error = move |what: String| file.error(offset, what);
        (key.get_ref().as_ref(), Value::new(value.get_ref()), file.place(offset), error)
    })
}

pub(super) fn correction(
    file: &Document<'_>,
    offset: usize,
    table: &DeTable<'_>,
    figures: &mut Vec<Figure>,
) -> Result<Band, ConfigError> {
    let mut cross_track_m = None;
    let mut heading_rad = BAND_HEADING.default;
    for (name, value, place, error) in lines(file, table) {
        let mut number = |spec| {
            let value =
                check_number(spec, &value).map_err(|what| error(format!("correction.{name}: {what}")))?;
            figures.push(Figure { place: place.clone(), section: "correction", spec, value });
            Ok(value)
        };
        match name {
            "cross_track_m" => cross_track_m = Some(number(&BAND)?),
            "heading_rad" => heading_rad = number(&BAND_HEADING)?,
            _ => {
                let choices = suggest::choices(name, "known", CORRECTION_KEYS);
                return Err(error(format!("unknown key {} in [correction]{choices}", quoted(name))));
            }
        }
    }
    let missing = "correction: no cross_track_m; say within which distance a deviation is corrected";
    let cross_track_m = cross_track_m.ok_or_else(|| file.error(offset, missing))?;
    Ok(Band { cross_track_m, heading_rad })
}

pub(super) fn published(
    file: &Document<'_>,
    offset: usize,
    table: &DeTable<'_>,
    figures: &mut Vec<Figure>,
) -> Result<Published, ConfigError> {
    let mut row = Published::default();
    for (name, value, place, error) in lines(file, table) {
        let mut number = |spec| {
            let value =
                check_number(spec, &value).map_err(|what| error(format!("published.{name}: {what}")))?;
            figures.push(Figure { place: place.clone(), section: "published", spec, value });
            Ok(value)
        };
        match (name, &value) {
            ("source", Value::Text(text)) => row.source = (*text).to_owned(),
            ("source", _) => {
                return Err(error(format!(
                    "published.source: {} is not text; write it in quotes",
                    value.describe()
                )));
            }
            ("cross_track_mean_m", _) => row.cross_track_mean_m = Some(number(&CROSS_TRACK)?),
            ("speed_error_mean_mps", _) => row.speed_error_mean_mps = Some(number(&SPEED_ERROR)?),
            ("correction_time_s", _) => row.correction_time_s = Some(number(&CORRECTION_TIME)?),
            ("correction_travel_m", _) => row.correction_travel_m = Some(number(&CORRECTION_TRAVEL)?),
            ("steady_cross_track_m", _) => row.steady_cross_track_m = Some(number(&STEADY)?),
            _ => {
                let choices = suggest::choices(name, "known", PUBLISHED_KEYS);
                return Err(error(format!("unknown key {} in [[published]]{choices}", quoted(name))));
            }
        }
    }
    if row.source.is_empty() {
        return Err(file.error(offset, "published: no source; say where the values come from"));
    }
    Ok(row)
}
