//! What a page has to know first: the robot, its laws, its map.

use crate::config::System;
use crate::shell::worker::system_file;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hilare_controller::LAWS;
use hilare_operator::message::Place;
use hilare_planner::Map;
use hilare_planner::map::{GridPoint, Layer, MapFrame, Obstacle};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// Largest side of a map's picture, pixels.
const PICTURE: usize = 2048;

/// The laws that drive the system's chassis.
pub fn laws(system: &System) -> impl Iterator<Item = &'static str> {
    let kind = system.chassis.name();
    LAWS.iter().filter(move |law| law.chassis.contains(&kind)).map(|law| law.name)
}

/// What tells a robot's launch from the one before and after it, whichever process asks: when its first file was made.
pub fn launch(runtime_dir: &Path) -> String {
    let made = fs::metadata(runtime_dir.join(system_file(1))).and_then(|file| file.modified());
    let since = made.ok().and_then(|made| made.duration_since(UNIX_EPOCH).ok());
    since.unwrap_or_default().as_nanos().to_string()
}

/// The first message to a page.
pub fn hello(system: &System, clock: &str, launch: &str) -> Value {
    // A map that cannot be loaded is the planner's complaint.
    let map = system.load_map().ok().flatten();
    json!({
        "robot": system.robot,
        "version": env!("CARGO_PKG_VERSION"),
        "clock": clock,
        "launch": launch,
        "radius_m": system.planner.robot_radius_m,
        "acceptance_m": system.tracking.acceptance_radius_m,
        "start": Place::of([system.start.x_m, system.start.y_m, system.start.theta_rad]),
        "laws": laws(system).collect::<Vec<_>>(),
        "map": map.as_ref().map(drawn),
    })
}

fn drawn(map: &Map) -> Value {
    let frame = map.frame();
    let (width, height) = (frame.width_cells() as f64, frame.height_cells() as f64);
    let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
        .map(|(u, v)| frame.to_world(GridPoint { u, v }))
        .map(|corner| [corner.x_m, corner.y_m]);
    let mut value = json!({ "corners": corners });
    if let Layer::Obstacles(obstacles) = map.layer() {
        value["obstacles"] = obstacles.iter().map(|obstacle| shape(frame, obstacle)).collect();
    }
    if let Some(picture) = map.picture(PICTURE) {
        value["image"] = format!("data:image/png;base64,{}", STANDARD.encode(&picture.png)).into();
        value["origin"] = json!([frame.origin().x_m, frame.origin().y_m, frame.yaw_rad()]);
        (value["width_m"], value["height_m"]) = (picture.width_m.into(), picture.height_m.into());
    }
    value
}

/// An obstacle in the world frame.
fn shape(frame: &MapFrame, obstacle: &Obstacle) -> Value {
    let world = |[x, y]: [f64; 2]| {
        let cells = frame.resolution_m();
        let point = frame.to_world(GridPoint { u: x / cells, v: y / cells });
        [point.x_m, point.y_m]
    };
    match obstacle {
        Obstacle::Box { min_m: [x0, y0], max_m: [x1, y1] } => {
            let corners = [[*x0, *y0], [*x1, *y0], [*x1, *y1], [*x0, *y1]].map(world);
            json!({ "polygon": corners })
        }
        Obstacle::Polygon { corners_m } => {
            let corners: Vec<[f64; 2]> = corners_m.iter().map(|corner| world(*corner)).collect();
            json!({ "polygon": corners })
        }
        Obstacle::Disc { centre_m, radius_m } => {
            let [x, y] = world(*centre_m);
            json!({ "disc": [x, y, radius_m] })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_told_the_map_in_metres_and_the_laws_of_the_chassis() {
        let mut system = System::default();
        assert_eq!(hello(&system, "real", "1")["map"], Value::Null);
        system.set("planner.map=platform").expect("built in");
        let value = hello(&system, "real", "1");
        let obstacles = value["map"]["obstacles"].as_array().expect("obstacles");
        assert!(obstacles.len() > 3 && obstacles.iter().any(|one| one["disc"].is_array()), "{value}");
        let corner = |i: usize, axis: usize| value["map"]["corners"][i][axis].as_f64().expect("a corner");
        let inside = |x: f64, y: f64| {
            x >= corner(0, 0) - 1e-9
                && x <= corner(2, 0) + 1e-9
                && y >= corner(0, 1) - 1e-9
                && y <= corner(2, 1) + 1e-9
        };
        for one in obstacles.iter().filter_map(|one| one["polygon"].as_array()).flatten() {
            assert!(inside(one[0].as_f64().expect("x"), one[1].as_f64().expect("y")), "{one}");
        }
        assert!(laws(&system).any(|law| law == "kanayama"));
        let agv = System::load("agv").expect("built in");
        assert!(laws(&agv).all(|law| law != "kanayama") && laws(&agv).count() > 0);
    }
}
