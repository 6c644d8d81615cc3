//! What a page asks for, and who does it.

use super::hello::laws;
use super::predict::{predict, with_law};
use super::roadmap::roadmap;
use super::{Shared, lock};
use crate::config::System;
use crate::manager::control::{Request, ask};
use crate::shell::worker::system_file;
use hilare_interfaces::messages::Waypoint;
use hilare_operator::message::{Answer, Order, Point};
use hilare_planner::ClearanceField;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Carries an order out.
pub fn carry_out(shared: &Shared, order: &Order, cancelled: &AtomicBool) -> Answer {
    let asked = |request: Request| match ask(&shared.socket, &request) {
        Ok(response) if response.ok => Answer::done(response.message),
        Ok(response) => Answer::refused(response.message),
        Err(error) => Answer::refused(format!("the robot's launch does not answer: {error}")),
    };
    let answer = match order {
        Order::Stop => asked(Request::Stop),
        Order::Estop => asked(Request::Estop),
        Order::Arm => asked(Request::Arm),
        Order::Reset => asked(Request::Reset),
        Order::Follow(points) => asked(Request::Follow(points.clone())),
        Order::Goal([x_m, y_m]) => asked(Request::Goal { x_m: *x_m, y_m: *y_m, theta_rad: None }),
        Order::Swap(law) => swap(shared, law).map_or_else(Answer::refused, asked),
        Order::Predict(points) => foretell(shared, points, cancelled).unwrap_or_else(Answer::refused),
        Order::Roadmap => system(shared)
            .and_then(|system| roadmap(&system, cancelled))
            .map_or_else(Answer::refused, |edges| {
                Answer::done(format!("{} edges that are free", edges.len())).with("edges", edges)
            }),
    };
    // They come from anywhere.
    Answer { message: for_page(&answer.message), ..answer }
}

/// Words of launch for somebody with buttons instead of a command line, without what a terminal would obey.
pub fn for_page(text: &str) -> String {
    crate::logging::plain(text).replace("hilare arm", "Arm").replace("hilare reset", "Reset")
}

/// The system in force.
fn system(shared: &Shared) -> Result<System, String> {
    let file = shared.runtime_dir.join(system_file(lock(&shared.slow).system));
    System::load(&file.to_string_lossy()).map_err(|error| error.to_string())
}

/// A page chooses among the laws that there are: it starts no program.
fn swap(shared: &Shared, law: &str) -> Result<Request, String> {
    let system = system(shared)?;
    match laws(&system).find(|known| *known == law) {
        Some(law) => {
            Ok(Request::Swap { role: "controller".to_owned(), driver: Some(law.to_owned()), set: Vec::new() })
        }
        None => {
            let known = laws(&system).collect::<Vec<_>>().join(", ");
            Err(format!("there is no such law for this chassis; there are {known}"))
        }
    }
}

fn foretell(shared: &Shared, points: &[Point], cancelled: &AtomicBool) -> Result<Answer, String> {
    let system = with_law(system(shared)?, lock(&shared.slow).law.as_deref())?;
    let waypoints: Vec<Waypoint> =
        points.iter().map(|&[x_m, y_m, bulge, crab_rad]| Waypoint { x_m, y_m, bulge, crab_rad }).collect();
    let pose = lock(&shared.heard).pose;
    let told = predict(&system, field(shared, &system).as_deref(), &waypoints, pose, cancelled)?;
    Ok(Answer::done("")
        .with("reached", told.reached)
        .with("duration_s", told.duration_s)
        .with("mean_m", told.mean_m)
        .with("max_m", told.max_m)
        .with("cross_track_max_m", told.cross_track_max_m)
        .with("touched", told.touched))
}

/// Distances on the map in force: made once for each system, for it takes a while. A map that cannot be loaded is the
/// planner's complaint.
fn field(shared: &Shared, system: &System) -> Option<Arc<ClearanceField>> {
    let number = lock(&shared.slow).system;
    let mut kept = lock(&shared.field);
    if kept.0 != Some(number) {
        let map = system.load_map().ok().flatten();
        *kept = (Some(number), map.map(|map| Arc::new(ClearanceField::new(&map))));
    }
    kept.1.clone()
}
