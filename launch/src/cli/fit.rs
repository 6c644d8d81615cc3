//! `hilare fit`: a curve into lines and arcs.

use super::{VerbResult, print, refused};
use clap::Args;
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::params::ParamGroup;
use hilare_planner::{FitSettings, waypoint_file};
use serde_json::json;
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

/// Options of `hilare fit`.
#[derive(Args)]
pub struct FitArgs {
    /// Points of the curve (CSV, header x,y, metres)
    #[arg(value_name = "FILE.csv")]
    file: PathBuf,
    /// Distance the fit may stray from the curve, metres
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    tolerance: f64,
    /// Segments meet without a corner
    #[arg(long)]
    tangent: bool,
    /// With --tangent: corners of the curve sharper than this stay corners, radians [default: 0.8]
    #[arg(long, value_name = "RAD", allow_hyphen_values = true)]
    corner: Option<f64>,
    /// Least radius of an arc, metres [default: 0.01]
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    radius_min: Option<f64>,
    /// Write the waypoints here (CSV, header x,y,bulge)
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Print JSON instead of a line
    #[arg(long)]
    json: bool,
}

/// Fits a curve and says what came out.
pub fn fit(args: &FitArgs) -> VerbResult {
    let place = args.file.display();
    let file = fs::File::open(&args.file).map_err(|e| refused(format!("{place}: cannot be read: {e}")))?;
    let curve = waypoint_file::parse(file).map_err(|error| match error.line {
        0 => refused(format!("{place}: {}", error.message)),
        line => refused(format!("{place}:{line}: {}", error.message)),
    })?;
    if curve.iter().any(|waypoint| waypoint.bulge != 0.0 || waypoint.crab_rad != 0.0) {
        return Err(refused(format!(
            "{place}: it has arcs or crab angles already; a curve of points x,y is wanted"
        )));
    }
    let mut settings = FitSettings { tangent: args.tangent, ..FitSettings::default() };
    let given = [
        ("--tolerance", "tolerance_m", Some(args.tolerance)),
        ("--corner", "corner_rad", args.corner),
        ("--radius-min", "radius_min_m", args.radius_min),
    ];
    for (flag, name, value) in given {
        if let Some(value) = value {
            settings.set(name, value).map_err(|error| refused(format!("{flag} {value}: {error}")))?;
        }
    }
    let points: Vec<WorldPoint> = curve.iter().map(|waypoint| waypoint.point()).collect();
    let fitted =
        hilare_planner::fit(&points, &settings).map_err(|error| refused(format!("{place}: {error}")))?;
    if let Some(out) = &args.out {
        fs::write(out, waypoint_file::write(&fitted.waypoints))
            .map_err(|error| refused(format!("--out {}: {error}", out.display())))?;
    }
    if args.json {
        let waypoints: Vec<[f64; 3]> = fitted.waypoints.iter().map(|w| [w.x_m, w.y_m, w.bulge]).collect();
        let answer = json!({
            "points": points.len(),
            "lines": fitted.lines,
            "arcs": fitted.arcs,
            "deviation_m": fitted.deviation_m,
            "least": fitted.least,
            "waypoints": waypoints,
        });
        print(&format!("{answer:#}\n"));
    } else {
        print(&format!(
            "{} lines and {} arcs for {} points, at most {:.3} mm off{}\n",
            fitted.lines,
            fitted.arcs,
            points.len(),
            fitted.deviation_m * 1e3,
            if fitted.least { "; no fit between these points has fewer" } else { "" }
        ));
    }
    Ok(ExitCode::SUCCESS)
}
