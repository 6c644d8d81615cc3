//! Fits points with lines and arcs: `fit TOLERANCE_M [KEY=VALUE ...] < POINTS`, a point "x y" a line, metres.
//! Writes JSON: waypoints as [x, y, bulge], counts, and the time of one fit. `benches/fit/run` reads it.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "an example has a clock, output and an environment"
)]

use hilare_interfaces::params::ParamGroup;
use hilare_planner::{FitSettings, WorldPoint, fit};
use std::io::Read;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let mut settings = FitSettings::default();
    settings
        .set("tolerance_m", args.next().ok_or("usage: fit TOLERANCE_M [KEY=VALUE ...] < POINTS")?.parse()?)?;
    for pair in args {
        let (key, value) = pair.split_once('=').ok_or("KEY=VALUE is wanted")?;
        settings.set(key, value.parse()?).map_err(|error| format!("{key}: {error}"))?;
    }
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text)?;
    let mut points = Vec::new();
    for line in text.lines() {
        let (x, y) = line.split_once(' ').ok_or("two numbers a line are wanted")?;
        points.push(WorldPoint::new(x.parse()?, y.parse()?));
    }
    let begin = Instant::now();
    let fit = fit(&points, &settings).map_err(|error| error.to_string())?;
    let seconds = begin.elapsed().as_secs_f64();
    let waypoints: Vec<_> = fit.waypoints.iter().map(|w| [w.x_m, w.y_m, w.bulge]).collect();
    let report = serde_json::json!({
        "waypoints": waypoints, "lines": fit.lines, "arcs": fit.arcs, "deviation_m": fit.deviation_m,
        "least": fit.least, "seconds": seconds,
    });
    println!("{report}");
    Ok(())
}
