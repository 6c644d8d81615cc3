//! Paper 1: an e-puck on steppers, waypoints, Kanayama's law.

use super::published::PAPER_1;
use super::rows::{Ours, Rows};
use super::runs::{Job, Trial, drive_all};
use super::{Picture, Section, fault};
use crate::manager::Failure;
use crate::tuning::parameters::{Tuned, parameters};
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::messages::Waypoint;

mod draw;
mod front;
mod measured;

/// What is searched: its name, its key, from SI to the paper's unit.
const SEARCHED: [(&str, &str, f64); 5] = [
    ("k1", "controller.kanayama.k1_per_s", 1.0),
    ("k2", "controller.kanayama.k2_per_m2", 1e-6),
    ("k3", "controller.kanayama.k3_per_m", 1e-3),
    ("v_max", "limits.v_max_mps", 1e3),
    ("omega_max", "limits.omega_max_radps", 1.0),
];

/// All of it.
pub fn reproduce(seeds: u64) -> Result<Section, Failure> {
    let mut rows = Rows::new(&PAPER_1);
    let mut pictures = Vec::new();
    let trapezoid = Job::load("trapezoid")?;
    tables_1_and_2(&mut rows, &trapezoid)?;
    front::search(&mut rows, &mut pictures, &trapezoid)?;
    simulation(&mut rows, &mut pictures, &trapezoid)?;
    let runs = measured::experiments(&mut rows, &mut pictures, seeds)?;
    let rows = rows.finish().map_err(Failure::Fault)?;
    Ok(Section { paper: 1, source: PAPER_1.source, set_up: measured::set_up(), rows, pictures, runs })
}

/// The range a key is searched in, in the paper's unit.
fn range(tuned: &[Tuned], key: &str, factor: f64) -> Result<Ours, Failure> {
    let found = tuned.iter().find(|one| one.parameter.name == key);
    let one = found.ok_or_else(|| fault(format!("{key} is not searched")))?;
    Ok(Ours::Range(one.parameter.low * factor, one.parameter.high * factor))
}

fn tables_1_and_2(rows: &mut Rows, job: &Job) -> Result<(), Failure> {
    let robot = "as printed: `launch/systems/epuck.toml`";
    for (key, path, factor) in [
        ("track", "chassis.track_m", 1e3),
        ("wheel", "chassis.wheel_diameter_m", 1e3),
        ("step", "motors.step_length_m", 1e3),
        ("motor", "chassis.wheel_speed_max_right_radps", 1.0),
        ("v_r", "tracking.speed_mps", 1e3),
        ("v_min", "limits.v_min_mps", 1e3),
        ("omega_min", "limits.omega_min_radps", 1.0),
    ] {
        rows.give("table 1", key, Ours::One(job.number(path)? * factor), robot);
    }
    rows.give("table 1", "tick", Ours::One(TICK_S * 1e3), "the tick of everything here");
    let bend = job.waypoints.windows(2).map(|pair| pair[1].segment_from(pair[0]).curvature_per_m().abs());
    let omega_r = bend.fold(0.0, f64::max) * job.number("tracking.speed_mps")?;
    rows.give(
        "table 1",
        "omega_r",
        Ours::One(omega_r),
        "v_r times the curvature of the path: lines have none",
    );
    let tuned = parameters(&job.scenario.system, &[], &[]).map_err(fault)?;
    let why = "what `hilare tune` searches";
    for (key, path, factor) in SEARCHED {
        rows.give("table 2", key, range(&tuned, path, factor)?, why);
    }
    Ok(())
}

/// Figures 7 and 8: the trapezoid at point A, nothing wrong.
fn simulation(rows: &mut Rows, pictures: &mut Vec<Picture>, job: &Job) -> Result<(), Failure> {
    for (key, path, factor) in SEARCHED {
        rows.give("figure 7", key, Ours::One(job.number(path)? * factor), "as printed");
    }
    let driven = drive_all(&[Trial { job, set: Vec::new(), seed: 1, rows: true }])?.remove(0);
    let corners = points_text(&job.waypoints);
    rows.give(
        "figure 7",
        "corners",
        Ours::Text(corners),
        "chosen: with them both printed means are met nearly",
    );
    let why = "corners chosen; here a command acts one control period (5 ms) after the pose it is made of";
    rows.give("figure 7", "cross_track", Ours::One(driven.figures.cross_track_mean_m * 1e3), why);
    rows.give("figure 8", "speed", Ours::One(driven.figures.speed_error_mean_mps * 1e3), why);
    let slowest = driven.rows.iter().map(|row| row.speed_mps).fold(f64::INFINITY, f64::min);
    let fastest = driven.rows.iter().map(|row| row.speed_mps).fold(0.0, f64::max);
    let curve = format!(
        "{:.1} s, {:.1} to {:.1} mm/s",
        driven.figures.ticks as f64 * TICK_S,
        slowest * 1e3,
        fastest * 1e3
    );
    rows.give(
        "figure 8",
        "curve",
        Ours::Text(curve),
        "where the path turns v_r cos θ_e in (7) slows the robot, to v_min where it turns by 90° or more",
    );
    pictures.extend(draw::simulation(job, &driven).map_err(fault)?);
    Ok(())
}

/// Waypoints in millimetres.
fn points_text(waypoints: &[Waypoint]) -> String {
    let point = |p: &Waypoint| format!("({:.0}, {:.0})", p.x_m * 1e3, p.y_m * 1e3);
    waypoints.iter().map(point).collect::<Vec<_>>().join(", ") + " mm"
}
