//! What a run comes to: files, verdict, exit code.

use super::run::{Drive, RunArgs};
use super::{VerbResult, print};
use crate::manager::Failure;
use crate::report::drove::in_words;
use crate::report::{
    Correction, Counters, PastRun, PlotInput, RecordingSummary, RunIdentity, Summary, source, verdict_text,
    write_report,
};
use crate::shell::observer::Handover;
use hilare_interfaces::latency::Quantiles;
use hilare_planner::{ClearanceField, Map};
use hilare_recorder::trace::TraceRow;
use std::io::{self, IsTerminal};
use std::path::Path;
use std::process::ExitCode;

/// What a run came to.
pub struct End {
    /// The recorder's figures, if it lived to hand them over.
    pub handover: Option<Handover>,
    /// The curves.
    pub rows: Vec<TraceRow>,
    /// The same as a file.
    pub trace_csv: String,
    /// Of the ticks.
    pub lateness: Quantiles,
    /// Workers started again.
    pub restarts: u64,
    /// Controllers and boxes swapped.
    pub swaps: u64,
    /// Laws and programs that drove, oldest first; empty where only the one that was asked for can have.
    pub drove: Vec<String>,
    /// Paths or parameters were changed during the drive.
    pub changed: bool,
    /// Another path than the scenario's was the last.
    pub diverted: bool,
    /// Why it ended before it arrived.
    pub stopped_by: Option<String>,
    /// Something broke.
    pub fault: bool,
}

/// Least distance between the true robot's rim and an obstacle, m; negative inside one.
fn least_clearance_m(map: &Map, rows: &[TraceRow], radius_m: f64) -> Option<f64> {
    let field = ClearanceField::new(map);
    let clearances = rows.iter().filter_map(|row| field.clearance_m(row.truth.position()));
    clearances.min_by(f64::total_cmp).filter(|least| least.is_finite()).map(|least| least - radius_m)
}

/// Writes the report, prints the verdict, answers with the exit code.
pub fn report(args: &RunArgs, drive: &Drive<'_>, out: &Path, end: End) -> VerbResult {
    let scenario = drive.scenario;
    let Some(handover) = end.handover else {
        return Err(Failure::Fault(end.stopped_by.unwrap_or_default()));
    };
    let asked = scenario.system.controller.driver().short_name();
    let law = match &end.drove[..] {
        [] => asked,
        drove => in_words(drove.iter().cloned()),
    };
    let law = law.as_str();
    let mut summary = Summary::new(
        RunIdentity { scenario: &scenario.name, controller: law, clock: args.clock.name() },
        &handover.figures,
        scenario.system.chassis.wheels(),
        Counters { swaps: end.swaps, restarts: end.restarts },
        end.lateness,
    );
    let radius_m = scenario.system.planner.robot_radius_m;
    summary.clearance_min_m = drive.map.and_then(|map| least_clearance_m(map, &end.rows, radius_m));
    summary.recording = handover.recording.as_ref().map(RecordingSummary::from);
    summary.correction = scenario.correction.and_then(|band| Correction::of(&end.rows, band));
    // Most drives go as they were asked for; then there is nothing to read for.
    let changes = end.changed.then(|| PastRun::changes(out)).flatten();
    let (later_paths, reference_speeds) = changes.unwrap_or_default();
    // What was published is of the scenario's path, driven to its end.
    let published = if summary.reached && !end.diverted { &scenario.published[..] } else { &[] };
    let plots = PlotInput {
        title: &source::title(&scenario.name, law, args.clock.name()),
        waypoints: drive.waypoints,
        later_paths: &later_paths,
        map: drive.map,
        acceptance_radius_m: scenario.system.tracking.acceptance_radius_m,
        reference_speed_mps: scenario.system.tracking.speed_mps,
        reference_speeds: &reference_speeds,
        rows: &end.rows,
        mishaps: &[],
    };
    // A disk that is full is no reason to keep the verdict back.
    let written = write_report(out, &summary, &plots, &end.trace_csv);
    if args.json {
        print(&summary.to_json());
    } else {
        let color = io::stdout().is_terminal();
        print(&verdict_text(&summary, published, end.stopped_by.as_deref(), color));
        print(&format!("Report: {}\n", out.display()));
    }
    let lost = (handover.gaps > 0)
        .then(|| format!("{} ticks were lost to the recorder; the figures lack them", handover.gaps));
    let recording = handover.recording.filter(|recording| !recording.complete);
    let incomplete = recording.map(|recording| format!("the recording is not complete: {}", recording.why));
    let unwritten = written.err().map(|error| error.to_string());
    let faults: Vec<String> = [lost, incomplete, unwritten].into_iter().flatten().collect();
    if !faults.is_empty() {
        return Err(Failure::Fault(faults.join("; ")));
    }
    let arrived = summary.reached && !end.fault;
    Ok(if arrived { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
