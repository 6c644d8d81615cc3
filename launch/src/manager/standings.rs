//! Where each box stands, for a recording that is begun in mid-drive ([`crate::shell::standing`]).

use super::Manager;
use super::control::Response;
use super::member::Duty;
use crate::shell::standing::{self, Stand};
use hilare_interfaces::wires::Role;
use serde::{Deserialize, Serialize};

/// What the boxes of a robot have answered.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standings {
    /// Number of the question.
    pub asked: u64,
    /// Of each process that had begun.
    pub stands: Vec<Stand>,
    /// Places of processes whose beginning is still to come.
    pub awaited: Vec<u64>,
    /// Processes that have not answered yet, by name.
    pub silent: Vec<String>,
}

impl Manager {
    /// Asks the boxes where they stand, if `asked` is 0; else what they have answered to that question or a later one.
    pub(super) fn standings(&self, asked: u64) -> Response {
        if !self.up || self.leaving {
            return Response::later("the robot is starting or going down");
        }
        let asked = if asked == 0 { self.page.ask_standings() } else { asked };
        let mut standings = Standings { asked, ..Standings::default() };
        for (slot, member) in self.members.iter().enumerate() {
            if !Role::BOXES.contains(&member.role) || member.duty == Duty::Vacant || member.is_foreign() {
                continue;
            }
            match standing::read(&self.page, slot, member.role, asked) {
                // It may be dead by now: then the journal goes on with its successor.
                Some(Some(stand)) => standings.stands.push(stand),
                Some(None) => standings.awaited.push(slot as u64),
                None if member.running.is_none() => standings.awaited.push(slot as u64),
                None => standings.silent.push(member.name()),
            }
        }
        Response { standings: Some(standings), ..Response::done("") }
    }
}
