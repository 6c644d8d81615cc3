//! `hilare replay`: a recording, run again through the same code.

use super::{VerbResult, print, refused};
use crate::manager::Failure;
use crate::replay::collect::read;
use crate::replay::replay as replay_boxes;
use crate::replay::report::{ReplayReport, open_loop_text};
use crate::replay::what_if::{WhatIf, check_keys, compare};
use clap::Args;
use hilare_controller::{LAWS, LawSpec};
use hilare_interfaces::wires::Role;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Options of `hilare replay`.
#[derive(Args)]
pub struct ReplayArgs {
    /// Directory of a run, or a file of a recording
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Only this box (repeatable): planner, waypoint_selector, controller, step_generator, pose_estimator, plant
    #[arg(long = "box", value_name = "NAME")]
    boxes: Vec<String>,
    /// What if: set a key of the system file and drive again (repeatable); with --box, answer the recorded inputs again
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// What if: another control law in every controller
    #[arg(long, value_name = "LAW")]
    controller: Option<String>,
    /// Directory for pictures of both drives
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of the tables
    #[arg(long)]
    json: bool,
}

/// Replays, or drives again with changes.
pub fn replay(args: &ReplayArgs) -> VerbResult {
    let boxes = chosen_boxes(&args.boxes)?;
    let law = args.controller.as_deref().map(chosen_law).transpose()?;
    let changes = !args.set.is_empty() || law.is_some();
    if let (Some(law), false) = (law, boxes.contains(&Role::Controller)) {
        return Err(refused(format!(
            "--controller {}: no box that was chosen has a control law; add --box controller, or drop --box",
            law.name
        )));
    }
    if args.out.is_some() && (!changes || !args.boxes.is_empty()) {
        return Err(refused(
            "--out: pictures are drawn of a drive with changes; add --set or --controller, drop --box",
        ));
    }
    let (log, mut notes) = read(&args.run).map_err(refused)?;
    if !changes {
        let report = ReplayReport::new(&log, notes, replay_boxes(&log, &boxes, false));
        tell(args, &report, ReplayReport::to_text)?;
        return Ok(if report.equal { ExitCode::SUCCESS } else { ExitCode::from(1) });
    }
    if args.boxes.is_empty() {
        let mut compared = compare(log, &args.set, law).map_err(refused)?;
        if let Some(dir) = &args.out {
            compared.draw(dir).map_err(|error| Failure::Fault(error.to_string()))?;
        }
        compared.what_if.notes.splice(0..0, notes);
        tell(args, &compared.what_if, WhatIf::to_text)?;
        return Ok(ExitCode::SUCCESS);
    }
    check_keys(&args.set).map_err(refused)?;
    notes.append(&mut log.overruled(&args.set));
    let changed = log.changed(&args.set, law).map_err(refused)?;
    let report = ReplayReport::new(&changed, notes, replay_boxes(&changed, &boxes, true));
    tell(args, &report, open_loop_text)?;
    Ok(if report.compared > 0 { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn tell<T: Serialize>(args: &ReplayArgs, what: &T, text: fn(&T) -> String) -> Result<(), Failure> {
    if args.json {
        let json = serde_json::to_string_pretty(what).map_err(|error| Failure::Fault(error.to_string()))?;
        print(&(json + "\n"));
    } else {
        print(&text(what));
    }
    Ok(())
}

fn chosen_boxes(names: &[String]) -> Result<Vec<Role>, Failure> {
    let known = || Role::BOXES.map(Role::name).join(", ");
    let find = |name: &String| {
        let role = Role::from_name(&name.replace('-', "_")).filter(|role| Role::BOXES.contains(role));
        role.ok_or_else(|| {
            refused(format!("--box {name}: there is no such box to replay; there are {}", known()))
        })
    };
    if names.is_empty() { Ok(Role::BOXES.to_vec()) } else { names.iter().map(find).collect() }
}

fn chosen_law(name: &str) -> Result<&'static LawSpec, Failure> {
    let known = || LAWS.iter().map(|law| law.name).collect::<Vec<_>>().join(", ");
    hilare_controller::law(name)
        .ok_or_else(|| refused(format!("--controller {name}: there is no such law; there are {}", known())))
}
