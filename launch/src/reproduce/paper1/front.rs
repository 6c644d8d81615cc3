//! Figure 6: the search for gains, and its front.

use super::super::rows::{Ours, Rows};
use super::super::runs::Job;
use super::super::{Picture, fault};
use crate::manager::Failure;
use crate::tuning::judge::Judge;
use crate::tuning::objectives::{STANDARD, parse};
use crate::tuning::parameters::parameters;
use crate::tuning::picture::{Front, front_svg};
use crate::tuning::problem::{Course, Problem};
use hilare_tuner::{Budget, Mopso, Settings, Space, hypervolume};
use std::sync::atomic::AtomicBool;

const FIGURE: &str = "figure 6";
/// As printed.
const EVALUATIONS: u64 = 20_000;
const FRONT: usize = 50;
const SEED: u64 = 1;
/// Up to where a front counts, m and m/s.
const REFERENCE: [f64; 2] = [0.006, 0.003];

/// Searches as the paper did, in the ranges of table 2, from random candidates.
pub fn search(rows: &mut Rows, pictures: &mut Vec<Picture>, job: &Job) -> Result<(), Failure> {
    let course = Course { scenario: job.scenario.clone(), waypoints: job.waypoints.clone() };
    let tuned = parameters(&job.scenario.system, &[], &[]).map_err(fault)?;
    let space = Space::new(tuned.iter().map(|one| one.parameter.clone()).collect()).map_err(fault)?;
    let problem = Problem::new(vec![course], 1, tuned).map_err(fault)?;
    let point_a = problem.figures(&problem.untuned()).map_err(|_| fault("point A does not arrive"))?;
    let judge = Judge::new(problem, parse(STANDARD).map_err(fault)?);
    let point_a = judge.of(&point_a);
    let settings = Settings { archive: FRONT, reference: Some(REFERENCE.to_vec()), ..Settings::new(2, SEED) };
    let mut search = Mopso::new(space, settings).map_err(fault)?;
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let budget = Budget { evaluations: EVALUATIONS, threads };
    judge.search(&mut search, budget, None, &AtomicBool::new(false), |_, _| {}).map_err(fault)?;
    let front: Vec<Vec<f64>> = search.front().into_iter().map(|solution| solution.objectives).collect();
    give(rows, search.evaluations(), &front, &point_a)?;
    let drawn = Front {
        title: "Paper 1, figure 6: the front of the search for gains",
        objectives: &judge.objectives,
        points: &front,
        chosen: None,
        untuned: Some((&point_a, "point A")),
        reference: &REFERENCE,
    };
    pictures.push(Picture {
        item: FIGURE,
        file: "paper1-figure-6.svg".to_owned(),
        caption: "The front of the search for gains on the trapezoid, and point A simulated on it".to_owned(),
        svg: front_svg(&drawn).map_err(fault)?,
    });
    Ok(())
}

fn give(rows: &mut Rows, evaluations: u64, front: &[Vec<f64>], point_a: &[f64]) -> Result<(), Failure> {
    let (Some(first), Some(last)) = (front.first(), front.last()) else {
        return Err(fault("no candidate arrives"));
    };
    let both = |point: &[f64]| format!("{:.2} mm, {:.2} mm/s", point[0] * 1e3, point[1] * 1e3);
    let why = "`hilare tune` on our trapezoid, whose corners are chosen; seed 1";
    rows.give(FIGURE, "evaluations", Ours::One(evaluations as f64), "as printed");
    rows.give(FIGURE, "front", Ours::One(front.len() as f64), "as printed: the archive has room for so many");
    rows.give(FIGURE, "best_cross_track", Ours::Text(both(first)), why);
    rows.give(FIGURE, "best_speed", Ours::Text(both(last)), why);
    let better = front.iter().filter(|point| point.iter().zip(point_a).all(|(ours, a)| ours < a)).count();
    let text = format!("{better} of {}; point A here: {}", front.len(), both(point_a));
    rows.give(FIGURE, "better", Ours::Text(text), "point A is not on the front of the rebuilt simulation");
    let volume = hypervolume(front.iter().map(Vec::as_slice), &REFERENCE);
    let share = volume / (REFERENCE[0] * REFERENCE[1]) * 100.0;
    rows.give(FIGURE, "hypervolume", Ours::One(share), "a measure of our own: the paper gives none");
    Ok(())
}
