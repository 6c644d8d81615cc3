//! Figures 7, 8 and 10 to 12, drawn again.

use super::super::Picture;
use super::super::runs::{Driven, Job};
use crate::report::canvas::{BLUE, DARK, FAINT_BLUE, ORANGE, STONE, VERMILION};
use crate::report::chart::{Chart, Mark, Scale, Shape};
use crate::report::plots::course;
use crate::report::shapes;
use hilare_interfaces::block::TICK_S;
use hilare_recorder::trace::TraceRow;
use std::io;

/// Trails drawn at most.
const TRAILS: usize = 20;
/// Not drawn of the velocity error, s: the start from rest, beside which the rest could not be seen.
const START_S: f64 = 0.2;
/// Window of the true speed, s: about a camera's.
const WINDOW_S: f64 = 0.1;

type Points = Vec<(f64, f64)>;

fn scaled(points: impl Iterator<Item = (f64, f64)>) -> Points {
    points.map(|(x, y)| (x * 1e3, y * 1e3)).collect()
}

/// Speed of the truth over [`WINDOW_S`], mm/s, against time, s.
fn true_speed(rows: &[TraceRow]) -> Points {
    let mut from = 0;
    let mut speed = Vec::new();
    for row in rows {
        while (row.tick - rows[from].tick) as f64 * TICK_S > WINDOW_S + TICK_S / 2.0 {
            from += 1;
        }
        let seconds = (row.tick - rows[from].tick) as f64 * TICK_S;
        if seconds > WINDOW_S - TICK_S / 2.0 {
            let way_m = rows[from].truth.position().distance_m(row.truth.position());
            speed.push((row.tick as f64 * TICK_S, way_m / seconds * 1e3));
        }
    }
    speed
}

fn commanded_speed(rows: &[TraceRow]) -> Points {
    rows.iter().map(|row| (row.tick as f64 * TICK_S, row.speed_mps * 1e3)).collect()
}

/// Figures 7 and 8.
pub fn simulation(job: &Job, driven: &Driven) -> io::Result<Vec<Picture>> {
    let path = Chart {
        title: "Paper 1, figure 7: the trapezoid at point A, simulated",
        x_name: "x (mm)",
        y_name: "y (mm)",
        scale: Scale::Plane,
        marks: trail_marks(job, std::slice::from_ref(driven)),
    };
    let v_r = job.scenario.system.tracking.speed_mps * 1e3;
    let speed = Chart {
        title: "Paper 1, figure 8: velocity along the trapezoid, simulated",
        x_name: "time (s)",
        y_name: "linear velocity (mm/s)",
        scale: Scale::Own,
        marks: vec![
            Mark::new(
                "way of the robot in 0.1 s",
                FAINT_BLUE,
                1,
                Shape::Curves(vec![true_speed(&driven.rows)]),
            ),
            Mark::new("reference v_r", DARK, 1, Shape::Level(v_r)),
            Mark::new("commanded", BLUE, 2, Shape::Curves(vec![commanded_speed(&driven.rows)])),
        ],
    };
    Ok(vec![
        Picture {
            item: "figure 7",
            file: "paper1-figure-7.svg".to_owned(),
            caption: "Reference and trajectory on the trapezoid, simulated with the gains of point A"
                .to_owned(),
            svg: path.svg()?,
        },
        Picture {
            item: "figure 8",
            file: "paper1-figure-8.svg".to_owned(),
            caption: "Linear velocity on the trapezoid".to_owned(),
            svg: speed.svg()?,
        },
    ])
}

/// Path and trails, the first run's on top.
fn trail_marks<'a>(job: &Job, driven: &[Driven]) -> Vec<Mark<'a>> {
    let mut marks = Vec::new();
    if let Some(map) = &job.map {
        let outline = |points: &Vec<_>| {
            scaled(points.iter().map(|p: &hilare_interfaces::geometry::WorldPoint| (p.x_m, p.y_m)))
        };
        let areas = shapes::outlines(map).iter().map(outline).collect();
        marks.push(Mark::new("obstacles (ours)", STONE, 1, Shape::Areas(areas)));
    }
    let trails: Vec<Points> =
        driven.iter().skip(1).take(TRAILS).map(|run| scaled(run.trail.iter().copied())).collect();
    if !trails.is_empty() {
        marks.push(Mark::new("robot, further seeds", FAINT_BLUE, 1, Shape::Curves(trails)));
    }
    let course: Points = scaled(course(&job.waypoints).map(|p| (p.x_m, p.y_m)));
    marks.push(Mark::new("reference, waypoints", DARK, 1, Shape::Dots(course)));
    if let Some(run) = driven.first() {
        let trail: Points = scaled(run.rows.iter().map(|row| (row.truth.x_m, row.truth.y_m)));
        let ends = trail.first().copied().zip(trail.last().copied());
        let name = if driven.len() > 1 { "robot, seed 1" } else { "robot" };
        marks.push(Mark::new(name, BLUE, 2, Shape::Curves(vec![trail])));
        marks.extend(ends.map(|(start, end)| Mark::new("ends", BLUE, 1, Shape::Ends(start, end))));
    }
    marks
}

/// One of figures 10 to 12: (a) the trajectory, (b) the velocity error.
pub fn experiment(item: &'static str, what: &str, job: &Job, driven: &[Driven]) -> io::Result<Vec<Picture>> {
    let number = item.trim_start_matches("figure ");
    let title = format!("Paper 1, {item} (a): {what}, trajectory");
    let path = Chart {
        title: &title,
        x_name: "x (mm)",
        y_name: "y (mm)",
        scale: Scale::Plane,
        marks: trail_marks(job, driven),
    };
    let mut pictures = vec![Picture {
        item,
        file: format!("paper1-figure-{number}a.svg"),
        caption: format!("(a) Trajectories of the true robot, {} seeds", driven.len().min(TRAILS + 1)),
        svg: path.svg()?,
    }];
    if let Some(run) = driven.first() {
        pictures.push(Picture {
            item,
            file: format!("paper1-figure-{number}b.svg"),
            caption: "(b) Linear velocity error of seed 1, without the start from rest".to_owned(),
            svg: velocity_error(item, what, job, run)?,
        });
    }
    Ok(pictures)
}

fn velocity_error(item: &str, what: &str, job: &Job, run: &Driven) -> io::Result<String> {
    let v_r = job.scenario.system.tracking.speed_mps * 1e3;
    let off = |points: Points| -> Points {
        points.into_iter().filter(|(t, _)| *t >= START_S).map(|(t, v)| (t, (v - v_r).abs())).collect()
    };
    let ours = run.figures.speed_error_truth_mean_mps * 1e3;
    let mut marks = vec![
        Mark::new("robot, over 0.1 s", FAINT_BLUE, 1, Shape::Curves(vec![off(true_speed(&run.rows))])),
        Mark::new("commanded", BLUE, 2, Shape::Curves(vec![off(commanded_speed(&run.rows))])),
    ];
    let ours_name = format!("mean of the robot {ours:.2} mm/s");
    marks.push(Mark::new(&ours_name, ORANGE, 2, Shape::Level(ours)));
    let measured = job.scenario.published.iter().find_map(|row| row.speed_error_mean_mps);
    let published = measured.map(|mps| (mps * 1e3, format!("mean published {:.2} mm/s", mps * 1e3)));
    if let Some((level, name)) = &published {
        marks.push(Mark::new(name, VERMILION, 2, Shape::Level(*level)));
    }
    let title = format!("Paper 1, {item} (b): {what}, linear velocity error |v − v_r|");
    let chart = Chart {
        title: &title,
        x_name: "time (s)",
        y_name: "linear velocity error (mm/s)",
        scale: Scale::Own,
        marks,
    };
    chart.svg()
}
