//! Paper 3: a Mecanum AGV, a guide line, the finite-step law.

use super::published::PAPER_3;
use super::rows::{Ours, Rows};
use super::runs::{Driven, Job, Trial, drive_all};
use super::{Section, fault};
use crate::manager::Failure;
use crate::report::Correction;
use hilare_interfaces::block::TICK_S;
use hilare_recorder::trace::TraceRow;

mod draw;
mod plans;

/// Its two speeds, as tables 1 and 2, figures 5 and 6, and in the keys of figure 9.
const SPEEDS: [Speed; 2] = [
    Speed { scenario: "agv-low", table: "table 1", figure: "figure 5", key: "low" },
    Speed { scenario: "agv-high", table: "table 2", figure: "figure 6", key: "high" },
];

struct Speed {
    scenario: &'static str,
    table: &'static str,
    figure: &'static str,
    key: &'static str,
}

/// Steps shown of an experiment: the paper shows thirty, ten of them before the deviation.
const SHOWN: f64 = 20.0;
/// Standard deviation of what a roller loses, share of its way.
const ROLLER_SLIP_SD: f64 = 0.02;

/// All of it.
pub fn reproduce(seeds: u64) -> Result<Section, Failure> {
    let mut rows = Rows::new(&PAPER_3);
    let mut pictures = Vec::new();
    let mut simulated = Vec::new();
    let jobs = SPEEDS.iter().map(|speed| Job::load(speed.scenario)).collect::<Result<Vec<_>, _>>()?;
    for (speed, job) in SPEEDS.iter().zip(&jobs) {
        tables_1_and_2(&mut rows, speed, job)?;
        simulated.push(plans::Simulated::of(job)?);
    }
    for (speed, simulated) in SPEEDS.iter().zip(&simulated) {
        simulated.give(&mut rows, speed.figure);
        pictures.extend(draw::plans(speed.figure, simulated).map_err(fault)?);
    }
    plans::compare(&mut rows, &simulated);
    let mut measured = Vec::new();
    for (speed, job) in SPEEDS.iter().zip(&jobs) {
        let driven = drive(job, "finite-step", ROLLER_SLIP_SD, seeds)?;
        figure_9(&mut rows, speed, job, &driven)?;
        measured.push(driven);
    }
    let set_up_9 = "0.3 and 0.5 m/s, 5°, 10 mm";
    rows.give("figure 9", "set_up", Ours::Text(set_up_9.to_owned()), "both speeds of tables 1 and 2");
    pictures.extend(draw::experiment(&jobs, &measured).map_err(fault)?);
    let pid = table_3(&mut rows, &jobs, &measured, seeds)?;
    let rows = rows.finish().map_err(Failure::Fault)?;
    let runs = measured.into_iter().flatten().chain(pid).map(|run| run.note).collect();
    Ok(Section { paper: 3, source: PAPER_3.source, set_up: set_up(&jobs[0])?, rows, pictures, runs })
}

fn set_up(job: &Job) -> Result<Vec<String>, Failure> {
    let number = |key| job.number(key);
    Ok(vec![
        "Not here: figures 1 to 4, 7 and 8, which are drawings and a photograph.".to_owned(),
        "Not printed: the step counts drawn in figures 5 and 6, dimensions and masses of the AGV, its camera, its lags, and \
         speed and deviation in figure 9; all curves are pictures the text has lost."
            .to_owned(),
        "Figures 5 and 6 are the paper's model (12) under its plan (16), (20), (21), without a robot, from the deviations of \
         tables 1 and 2. (21) is mended: as printed its ω_z does not land on zero."
            .to_owned(),
        format!(
            "Figure 9 and table 3 are drives of a simulated AGV (`launch/systems/agv.toml`): wheels of rollers with \
             friction, rollers that lose {} % (standard deviation), servos that lag {:.0} ms; a camera that measures every \
             {} ms, {} ms late, off by {} mm and {:.2}° (standard deviations; a seed a run).",
            ROLLER_SLIP_SD * 100.0,
            number("controller.drive_lag_s")? * 1e3,
            number("camera.period_ticks")?,
            number("camera.delay_ticks")?,
            number("camera.sd_m")? * 1e3,
            number("camera.sd_rad")?.to_degrees()
        ),
        "Corrected: within 2 mm and 2° for good. In table 3 the accuracy is that of the last quarter of the line. Both are of the true AGV; a \
         step is the camera's 0.1 s."
            .to_owned(),
    ])
}

fn drive(job: &Job, law: &str, slip_sd: f64, seeds: u64) -> Result<Vec<Driven>, Failure> {
    let set = vec![format!("controller.law={law}"), format!("plant.roller_slip_sd={slip_sd}")];
    let trials = (1..=seeds).map(|seed| Trial { job, set: set.clone(), seed, rows: true });
    drive_all(&trials.collect::<Vec<_>>())
}

fn tables_1_and_2(rows: &mut Rows, speed: &Speed, job: &Job) -> Result<(), Failure> {
    let scenario = format!("as printed: `launch/scenarios/{}.toml`", speed.scenario);
    let law = "as printed: default of the law";
    for (key, path, why) in [
        ("speed", "tracking.speed_mps", scenario.as_str()),
        ("distance", "start.y_m", &scenario),
        ("v_x_max", "controller.finite-step.sideways_max_mps", law),
        ("a_max", "controller.finite-step.accel_max_mps2", law),
    ] {
        rows.give(speed.table, key, Ours::One(job.number(path)?), why);
    }
    let angle = job.number("start.theta_rad")?.to_degrees();
    rows.give(speed.table, "angle", Ours::One(angle), scenario.as_str());
    Ok(())
}

/// How the deviation of each run was corrected, and when; of one that never was, its end.
fn corrections(job: &Job, driven: &[Driven]) -> Result<Vec<(Correction, f64)>, Failure> {
    let none = || fault(format!("{}: it has no [correction]", job.scenario.name));
    let corrected = |run: &Driven| {
        let end_s = run.figures.ticks as f64 * TICK_S;
        run.correction.map(|correction| (correction, correction.time_s.unwrap_or(end_s)))
    };
    driven.iter().map(|run| corrected(run).ok_or_else(none)).collect()
}

fn times(corrections: &[(Correction, f64)]) -> Ours {
    Ours::Many(corrections.iter().map(|(_, time_s)| *time_s).collect())
}

fn distances(corrections: &[(Correction, f64)]) -> Ours {
    Ours::Many(corrections.iter().map(|(correction, _)| correction.steady_cross_track_m * 1e3).collect())
}

fn angles(corrections: &[(Correction, f64)]) -> Ours {
    let angle = |(correction, _): &(Correction, f64)| correction.steady_heading_rad.to_degrees();
    Ours::Many(corrections.iter().map(angle).collect())
}

/// What figure 9 shows: ten steps of correction and ten after them.
fn figure_9(rows: &mut Rows, speed: &Speed, job: &Job, driven: &[Driven]) -> Result<(), Failure> {
    let sample_s = job.number("controller.finite-step.sample_period_s")?;
    let band =
        job.scenario.correction.ok_or_else(|| fault(format!("{}: no [correction]", speed.scenario)))?;
    let step = |row: &TraceRow| row.tick as f64 * TICK_S / sample_s;
    let mut steps = Vec::new();
    let mut distances = Vec::new();
    let mut angles = Vec::new();
    for run in driven {
        let shown = &run.rows[..run.rows.partition_point(|row| step(row) <= SHOWN)];
        let after = &shown[shown.partition_point(|row| step(row) < SHOWN / 2.0)..];
        let time_s = Correction::of(shown, band).and_then(|correction| correction.time_s);
        steps.push(time_s.map_or(SHOWN, |time_s| time_s / sample_s));
        let greatest =
            |value: fn(&TraceRow) -> f64| after.iter().map(|row| value(row).abs()).fold(0.0, f64::max);
        distances.push(greatest(|row| row.cross_track_m * 1e3));
        angles.push(greatest(|row| row.heading_error_rad.to_degrees()));
    }
    let mut give = |key: &str, ours, why| rows.give("figure 9", &format!("{}/{key}", speed.key), ours, why);
    let why = "printed: from step 10 to step 20; 20 stands for one that is not within the bounds by then";
    give("steps", Ours::Many(steps), why);
    give("distance", Ours::Many(distances), "noise and lag of the camera, lag of the servos, slip");
    give("angle", Ours::Many(angles), "the same");
    Ok(())
}

/// The lines of the paper's own method.
fn give_method(rows: &mut Rows, name: &str, corrections: &[(Correction, f64)], why: &str) {
    for (key, ours) in
        [("distance", distances(corrections)), ("angle", angles(corrections)), ("time", times(corrections))]
    {
        rows.give("table 3", &format!("{name}/{key}"), ours, why);
    }
}

/// The paper's own method, and the one of the others whose law is here. Returns the runs of the latter.
fn table_3(
    rows: &mut Rows,
    jobs: &[Job],
    measured: &[Vec<Driven>],
    seeds: u64,
) -> Result<Vec<Driven>, Failure> {
    let other = "its authors' robot, whose set-up is not in this paper; no such law here";
    for key in
        ["state_feedback", "variable_structure", "fuzzy", "pso/distance", "pso/time", "improved_pso/distance"]
    {
        rows.give("table 3", key, Ours::Text("not driven".to_owned()), other);
    }
    rows.give("table 3", "improved_pso/time", Ours::Text("not driven".to_owned()), other);
    let mut all = Vec::new();
    for (job, driven) in jobs.iter().zip(measured) {
        all.extend(corrections(job, driven)?);
    }
    let late = "both speeds, over the whole line, 10 s: slip and noise that lift it over 2 mm once more, later, count";
    give_method(rows, "ours", &all, late);
    let mut exact = Vec::new();
    for job in jobs {
        exact.extend(corrections(job, &drive(job, "finite-step", 0.0, seeds)?)?);
    }
    give_method(rows, "no_slip", &exact, "camera's noise and lag and servos' lag are left");
    let mut runs = Vec::new();
    let mut pid = Vec::new();
    for job in jobs {
        let driven = drive(job, "navigation-circle", ROLLER_SLIP_SD, seeds)?;
        pid.extend(corrections(job, &driven)?);
        runs.extend(driven);
    }
    let why = "printed of another robot; ours is the PID of paper 2 on this one, both speeds";
    rows.give("table 3", "pid/distance", distances(&pid), why);
    rows.give("table 3", "pid/time", times(&pid), why);
    Ok(runs)
}
