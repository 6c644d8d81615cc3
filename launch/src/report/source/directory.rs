//! A run's directory: `summary.json`, `system.toml`, `path.csv`, `trace.csv`, and what only its recording has.

use super::{PastRun, recording};
use crate::config::System;
use crate::recording::{RECORDING_FILE, Recording};
use crate::report::Summary;
use hilare_interfaces::messages::Waypoint;
use hilare_planner::waypoint_file;
use hilare_recorder::trace::parse_csv;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

pub(super) fn open(dir: &Path) -> Result<PastRun, String> {
    let file = dir.join("summary.json");
    let text = read(dir, "summary.json")?;
    let summary: Summary =
        serde_json::from_str(&text).map_err(|error| format!("{}: {error}", file.display()))?;
    let system_text = read(dir, "system.toml")?;
    let system = System::parse(&dir.join("system.toml").to_string_lossy(), &system_text)
        .map_err(|error| error.to_string())?;
    let mut lacking = Vec::new();
    let waypoints = path(dir)?.unwrap_or_else(|| {
        lacking.push(format!("{}: no path.csv; the planned path is not drawn", dir.display()));
        Vec::new()
    });
    // The map may have moved since; the run is still worth seeing.
    let map = system.load_map().unwrap_or_else(|error| {
        lacking.push(format!("{error}; the obstacles are not drawn"));
        None
    });
    let rows = parse_csv(&read(dir, "trace.csv")?).map_err(|error| format!("{}/{error}", dir.display()))?;
    let (mut poses, mut mishaps) = (Vec::new(), Vec::new());
    let (mut later_paths, mut reference_speeds) = (Vec::new(), Vec::new());
    if dir.join(RECORDING_FILE).exists() {
        let read = Recording::open(dir).map_err(|error| error.to_string());
        match read.and_then(|recording| recording::ticks(&recording)) {
            Ok(mut ticks) => {
                later_paths = ticks.later_paths();
                (poses, mishaps, reference_speeds) = (ticks.poses, ticks.mishaps, ticks.speeds);
            }
            // The curves are in trace.csv.
            Err(error) => lacking.push(format!("{error}; left aside")),
        }
    }
    Ok(PastRun {
        place: dir.to_owned(),
        summary,
        is_recording: false,
        waypoints,
        later_paths,
        acceptance_radius_m: system.tracking.acceptance_radius_m,
        reference_speed_mps: system.tracking.speed_mps,
        reference_speeds,
        map,
        rows,
        poses,
        mishaps,
        system: system_text,
        lacking,
    })
}

/// A file every run has.
fn read(dir: &Path, name: &str) -> Result<String, String> {
    fs::read_to_string(dir.join(name)).map_err(|error| match error.kind() {
        ErrorKind::NotFound => {
            let dir = dir.display();
            format!("{dir}: no {name} in it; name a directory that hilare run has made and finished")
        }
        ErrorKind::InvalidData => format!("{}: not UTF-8 text", dir.join(name).display()),
        _ => format!("{}: cannot be read: {error}", dir.join(name).display()),
    })
}

/// The path as it was driven; `None` of a run that has not kept it.
fn path(dir: &Path) -> Result<Option<Vec<Waypoint>>, String> {
    let file = dir.join("path.csv");
    let text = match fs::read(&file) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        read => read.map_err(|error| format!("{}: cannot be read: {error}", file.display()))?,
    };
    waypoint_file::parse(&text[..]).map(Some).map_err(|error| match error.line {
        0 => format!("{}: {error}", file.display()),
        _ => format!("{}:{error}", file.display()),
    })
}
