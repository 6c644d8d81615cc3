//! How a deviation at the start was corrected, as papers 2 and 3 report it.
//!
//! ```text
//!   cross-track
//!    │╲                     corrected: from here on never outside the band again
//!    │─╲──────────────┬──── band
//!    │  ╲    ╭───╮    │
//!    └───╲───╯───╰────┴───────▶ time, travel
//!    │────╲─╱──────────────
//!          ╰ one overshoot: outside the band on the other side
//! ```

use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_recorder::trace::TraceRow;
use serde::{Deserialize, Serialize};

/// What counts as corrected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// Greatest cross-track distance of the truth, m.
    pub cross_track_m: f64,
    /// Greatest heading error of the truth, rad; π where only the distance counts.
    pub heading_rad: f64,
}

/// How it went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correction {
    /// What counts as corrected.
    pub band: Band,
    /// Seconds until the deviation was inside the band for good; `null` if it never was.
    pub time_s: Option<f64>,
    /// The same as way of the truth, m.
    pub travel_m: Option<f64>,
    /// Times it went outside the band on the other side than before.
    pub overshoots: u64,
    /// Greatest cross-track distance in the last quarter of the run, m.
    pub steady_cross_track_m: f64,
    /// Greatest heading error in the last quarter of the run, rad.
    pub steady_heading_rad: f64,
}

impl Correction {
    /// From the rows of a run; `None` without rows.
    pub fn of(rows: &[TraceRow], band: Band) -> Option<Self> {
        if rows.is_empty() {
            return None;
        }
        let outside = |row: &TraceRow| {
            row.cross_track_m.abs() > band.cross_track_m || row.heading_error_rad.abs() > band.heading_rad
        };
        let settled = rows.iter().rposition(outside).map_or(0, |index| index + 1);
        let corrected = rows.get(settled);
        let steady = &rows[rows.len() - rows.len().div_ceil(4)..];
        let greatest =
            |value: fn(&TraceRow) -> f64| steady.iter().map(|row| value(row).abs()).fold(0.0, f64::max);
        Some(Self {
            band,
            time_s: corrected.map(|row| row.tick as f64 / TICKS_PER_SECOND as f64),
            travel_m: corrected.map(|_| travel_m(&rows[..=settled])),
            overshoots: overshoots(rows, band.cross_track_m),
            steady_cross_track_m: greatest(|row| row.cross_track_m),
            steady_heading_rad: greatest(|row| row.heading_error_rad),
        })
    }
}

fn travel_m(rows: &[TraceRow]) -> f64 {
    rows.windows(2).fold(0.0, |way, pair| way + pair[0].truth.position().distance_m(pair[1].truth.position()))
}

fn overshoots(rows: &[TraceRow], band_m: f64) -> u64 {
    let mut side = 0.0;
    let mut count = 0;
    for row in rows.iter().filter(|row| row.cross_track_m.abs() > band_m) {
        if side * row.cross_track_m < 0.0 {
            count += 1;
        }
        side = row.cross_track_m.signum();
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::geometry::WorldPose;

    fn rows(cross_track_mm: &[f64]) -> Vec<TraceRow> {
        let row = |(n, off): (usize, &f64)| TraceRow {
            tick: 100 * n as u64,
            pose: WorldPose::default(),
            truth: WorldPose::new(0.1 * n as f64, off * 1e-3, 0.0),
            speed_mps: 1.0,
            omega_radps: 0.0,
            cross_track_m: off * 1e-3,
            heading_error_rad: 0.0,
            waypoint: 1,
        };
        cross_track_mm.iter().enumerate().map(row).collect()
    }

    const BAND: Band = Band { cross_track_m: 0.01, heading_rad: 1.0 };

    #[test]
    fn it_is_corrected_once_it_stays_inside() {
        let correction =
            Correction::of(&rows(&[30.0, 5.0, -20.0, -12.0, 9.0, 1.0, -2.0, 0.5]), BAND).unwrap();
        assert_eq!(correction.time_s, Some(0.4));
        assert!((correction.travel_m.unwrap() - 0.4).abs() < 0.01);
        assert_eq!(correction.overshoots, 1);
        assert!((correction.steady_cross_track_m - 0.002).abs() < 1e-12);
    }

    #[test]
    fn what_ends_outside_was_never_corrected() {
        let correction = Correction::of(&rows(&[0.0, 0.0, 11.0]), BAND).unwrap();
        assert_eq!((correction.time_s, correction.travel_m, correction.overshoots), (None, None, 0));
        assert_eq!(Correction::of(&rows(&[0.0, 1.0]), BAND).unwrap().time_s, Some(0.0));
        let turned = |row: &TraceRow| TraceRow { heading_error_rad: 1.1, ..*row };
        let heading: Vec<TraceRow> = rows(&[0.0, 0.0]).iter().map(turned).collect();
        assert_eq!(Correction::of(&heading, BAND).unwrap().time_s, None);
        assert_eq!(Correction::of(&[], BAND), None);
    }
}
