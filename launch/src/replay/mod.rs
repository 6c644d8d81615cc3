//! A recording, run again through the same code.
//!
//! ```text
//! recording ──▶ RunLog (messages by wire and tick, processes by place) ──▶ each box, stepped as its process was
//!                                                                              └─▶ compared bit for bit: BoxReport
//! ```
//!
//! * [`collect`]: a recording read.
//! * [`log`], [`lives`], [`states`]: what was recorded, which processes there were, what successors went on from.
//! * [`boxes`]: which inputs each box took and when; [`walk`]: ticks that were not answered, or not recorded.
//! * [`ledger`], [`fields`]: recorded and replayed messages compared, and where they differ.
//! * [`closed`]: the whole drive again, with changes. [`what_if`]: both drives side by side.
//! * [`report`]: what it came to.
//! * [`in_process`]: what the journal of a run in one thread would say.
//!
//! A box with changed parameters, or a changed law, is replayed alike: what comes out is what it would have answered to
//! the same inputs. A box whose parameters change at a tick ([`lives::Changes`]) goes on there as in its
//! process, with what it knew.

pub mod boxes;
pub mod closed;
pub mod collect;
pub mod fields;
pub mod in_process;
pub mod ledger;
pub mod lives;
pub mod log;
pub mod report;
pub mod states;
pub mod walk;
pub mod what_if;

use boxes::BoxReport;
use hilare_interfaces::wires::Role;
use log::RunLog;
use states::States;

/// Feeds boxes what was recorded and compares what they answer. `measures`: also how far numbers are off.
pub fn replay(log: &RunLog, boxes: &[Role], measures: bool) -> Vec<BoxReport> {
    let mut states = States::new(log);
    let mut reports = Vec::new();
    // The step generator may have to know what they said.
    let (mut of_controllers, lost) = boxes::controller::replay(log, &mut states, measures);
    for role in Role::BOXES.into_iter().filter(|role| boxes.contains(role)) {
        let mut report = match role {
            Role::Planner => vec![boxes::planner::replay(log)],
            Role::WaypointSelector => vec![boxes::waypoint_selector::replay(log, &mut states, measures)],
            Role::Controller => std::mem::take(&mut of_controllers),
            Role::StepGenerator => vec![boxes::step_generator::replay(log, &mut states, &lost, measures)],
            Role::PoseEstimator => vec![boxes::pose_estimator::replay(log, &mut states, measures)],
            _ => vec![boxes::plant::replay(log, &mut states, measures)],
        };
        let earlier = log.lives.earlier.values().any(|earlier| *earlier == role);
        // A box may have taken nothing from outside since; a path needs no planner.
        let unknown = role != Role::Planner
            && log.lives.of_role(role).is_empty()
            && report.iter().flat_map(|report| &report.wires).any(|tally| tally.not_compared > 0);
        if role != Role::Controller && (earlier || unknown) {
            let note = "at work before the recording began: what it was then is not known, and not compared";
            report[0].notes.push(note.to_owned());
        }
        reports.append(&mut report);
    }
    reports
}

#[cfg(test)]
mod tests;
