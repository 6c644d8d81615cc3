//! One worker as launch sees it.

use super::children::Running;
use super::status::ProcessStatus;
use crate::shell::page::SlotState;
use hilare_interfaces::messages::{Health, HealthState, field_text};
use hilare_interfaces::wires::Role;
use std::collections::VecDeque;
use std::time::Instant;

/// One worker as launch sees it.
pub(super) struct Member {
    pub role: Role,
    pub running: Option<Running>,
    pub incarnation: u64,
    pub epoch: u64,
    pub health: Option<Health>,
    pub deaths: VecDeque<Instant>,
    pub restarts: u64,
    /// When to start it again.
    pub respawn_at: Option<Instant>,
    pub last_end: String,
}

impl Member {
    pub(super) fn new(role: Role) -> Self {
        Self {
            role,
            running: None,
            incarnation: 0,
            epoch: 0,
            health: None,
            deaths: VecDeque::new(),
            restarts: 0,
            respawn_at: None,
            last_end: String::new(),
        }
    }

    pub(super) fn status(&self, page_state: SlotState, authority: bool) -> ProcessStatus {
        let state = match (&self.running, page_state) {
            (None, _) => "dead",
            (_, SlotState::Empty) => HealthState::Starting.label(),
            (_, SlotState::Ready) => HealthState::Ready.label(),
            (_, SlotState::Working) => self
                .health
                .and_then(|h| HealthState::from_code(h.state))
                .map_or("running", HealthState::label),
        };
        let granted = self.health.map_or(String::new(), |health| {
            let mut granted = Vec::new();
            if health.granted_fifo == 1 {
                granted.push(format!("fifo:{}", health.granted_priority));
            }
            if health.granted_cpu > 0 {
                granted.push(format!("cpu:{}", health.granted_cpu - 1));
            }
            if health.granted_mlock == 1 {
                granted.push("mlock".to_owned());
            }
            granted.join(" ")
        });
        let text = self.health.map_or(String::new(), |health| field_text(&health.text).to_owned());
        ProcessStatus {
            name: self.role.name().to_owned(),
            pid: self.running.as_ref().map_or(0, |running| running.pid),
            state: state.to_owned(),
            reason: if self.running.is_none() { self.last_end.clone() } else { text },
            restarts: self.restarts,
            authority,
            granted,
        }
    }
}
