//! The journal of a run in one thread: nobody notes it, because it follows from the messages.

use super::log::Messages;
use crate::config::System;
use hilare_controller::LAWS;
use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages::{Journal, JournalKind};
use hilare_interfaces::wires::Role;

/// What the boxes would have noted, each in a place of its own; the controller's is 0, as its source says.
pub fn journal(system: Option<&System>, messages: &Messages) -> Vec<Journal> {
    let mut journal = Vec::new();
    let law = system.and_then(|system| LAWS.iter().position(|law| law.name == system.controller.law.name));
    let mut place =
        |slot: u64, role: Role, noted: &mut dyn Iterator<Item = (Tick, JournalKind, [u64; 6])>| {
            let law = law.filter(|_| role == Role::Controller).map_or(0, |place| place as u64 + 1);
            let began = (0, JournalKind::Began, [1, 1, 1, law, 0, 0]);
            let entries = std::iter::once(began).chain(noted).zip(0..);
            journal.extend(entries.map(|((tick, kind, words), seq)| Journal {
                slot,
                role: role.code(),
                seq,
                tick,
                kind: kind.code(),
                words,
            }));
        };
    let authorities = messages
        .authorities
        .iter()
        .map(|authority| (0, JournalKind::Authority, [authority.seq, authority.content_hash(), 0, 0, 0, 0]));
    let commands = messages.commands.iter().map(|command| {
        let words = [command.source, command.epoch, command.seq, command.content_hash(), 0, 0];
        (command.pose_tick, JournalKind::Command, words)
    });
    let paths = messages.paths.iter().map(|(header, waypoints)| {
        (0, JournalKind::Path, [header.path_id, header.goal_id, waypoints.len() as u64, 0, 0, 0])
    });
    place(0, Role::Controller, &mut std::iter::empty());
    place(1, Role::WaypointSelector, &mut { paths });
    place(2, Role::StepGenerator, &mut authorities.chain(commands));
    place(3, Role::PoseEstimator, &mut std::iter::empty());
    place(4, Role::Plant, &mut std::iter::empty());
    journal
}
