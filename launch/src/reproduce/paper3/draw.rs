//! Figures 5, 6 and 9, drawn again.

use super::super::Picture;
use super::super::runs::{Driven, Job};
use super::SHOWN;
use super::plans::{STEPS, Simulated};
use crate::report::canvas::{BLUE, DARK, FAINT_BLUE, FAINT_ORANGE, GREEN, ORANGE, VERMILION};
use crate::report::chart::{Chart, Mark, Scale, Shape};
use hilare_interfaces::block::TICK_S;
use hilare_recorder::trace::TraceRow;
use plotters::style::RGBColor;
use std::io;

/// Colours of the step counts, of Okabe and Ito's.
const COLORS: [RGBColor; STEPS.len()] = [VERMILION, BLUE, GREEN, ORANGE];
/// Colours of the two speeds, of the first seed and of the others.
const SPEEDS: [(RGBColor, RGBColor); 2] = [(BLUE, FAINT_BLUE), (ORANGE, FAINT_ORANGE)];
/// What the paper leaves, mm and degrees alike.
const STEADY: f64 = 2.0;
/// Curves drawn at most of a speed.
const CURVES: usize = 21;
/// Rows, one a control period, to a point of the curves that stand back.
const THIN: usize = 4;

type Points = Vec<(f64, f64)>;

/// Figure 5 or 6: (a) distance, (b) angle.
pub fn plans(item: &'static str, simulated: &Simulated) -> io::Result<Vec<Picture>> {
    let number = item.trim_start_matches("figure ");
    let names = STEPS.map(|steps| format!("N = {steps}"));
    let speed = simulated.along_mps;
    let mut pictures = Vec::new();
    for (part, what, y_name) in
        [("a", "distance", "distance deviation e_d (mm)"), ("b", "angle", "angle deviation e_θ (°)")]
    {
        let mut marks = vec![Mark::new("", DARK, 1, Shape::Level(0.0))];
        for ((states, name), color) in simulated.states.iter().zip(&names).zip(COLORS) {
            let value = |state: &hilare_controller::finite_step::plan::Deviation| match part {
                "a" => state.distance_m * 1e3,
                _ => state.heading_rad.to_degrees(),
            };
            let points = states.iter().enumerate().map(|(k, state)| (k as f64, value(state))).collect();
            marks.push(Mark::new(name, color, 2, Shape::Dots(points)));
        }
        let title = format!("Paper 3, {item} ({part}): {what} deviation, simulated, v_τ = {speed} m/s");
        let chart =
            Chart { title: &title, x_name: "control step k (0.1 s)", y_name, scale: Scale::Own, marks };
        pictures.push(Picture {
            item,
            file: format!("paper3-figure-{number}{part}.svg"),
            caption: format!("({part}) The {what} deviation over N steps, {speed} m/s"),
            svg: chart.svg()?,
        });
    }
    Ok(pictures)
}

/// Figure 9: distance and angle of the true AGV at both speeds.
pub fn experiment(jobs: &[Job], measured: &[Vec<Driven>]) -> io::Result<Vec<Picture>> {
    let names: Vec<String> = jobs
        .iter()
        .map(|job| format!("AGV at {} m/s, seed 1", job.scenario.system.tracking.speed_mps))
        .collect();
    let distance = |row: &TraceRow| row.cross_track_m * 1e3;
    let angle = |row: &TraceRow| row.heading_error_rad.to_degrees();
    let drawn = [("distance", "mm", distance as fn(&TraceRow) -> f64), ("angle", "°", angle)];
    let mut pictures = Vec::new();
    for (what, unit, value) in drawn {
        let band = format!("published: ± {STEADY} {unit}");
        let mut marks = vec![
            Mark::new(&band, GREEN, 1, Shape::Band(-STEADY..STEADY)),
            Mark::new("published: corrected in 10 steps", VERMILION, 2, Shape::Post(10.0)),
            Mark::new("", DARK, 1, Shape::Level(0.0)),
        ];
        for (driven, (_, faint)) in measured.iter().zip(SPEEDS) {
            let others = driven
                .iter()
                .take(CURVES)
                .skip(1)
                .map(|run| curve(run.rows.iter().step_by(THIN), value))
                .collect();
            marks.push(Mark::new("further seeds", faint, 1, Shape::Curves(others)));
        }
        for ((driven, name), (color, _)) in measured.iter().zip(&names).zip(SPEEDS) {
            if let Some(run) = driven.first() {
                marks.push(Mark::new(name, color, 2, Shape::Curves(vec![curve(run.rows.iter(), value)])));
            }
        }
        let title = format!("Paper 3, figure 9: {what} deviation of the AGV, with noise, lags and slip");
        let y_name = format!("{what} deviation ({unit})");
        let chart = Chart {
            title: &title,
            x_name: "steps of 0.1 s since the deviation",
            y_name: &y_name,
            scale: Scale::Own,
            marks,
        };
        pictures.push(Picture {
            item: "figure 9",
            file: format!("paper3-figure-9-{what}.svg"),
            caption: format!("The {what} deviation of the true AGV"),
            svg: chart.svg()?,
        });
    }
    Ok(pictures)
}

fn curve<'a>(rows: impl Iterator<Item = &'a TraceRow>, value: fn(&TraceRow) -> f64) -> Points {
    let points = rows.map(|row| (row.tick as f64 * TICK_S / 0.1, value(row)));
    points.take_while(|(step, _)| *step <= SHOWN).collect()
}
