//! One look at a robot from outside: what launch says, what the relay repeats, what the kernel counts.
//!
//! Nothing of it touches the loop: launch answers in its own process, the wires are those of the relay
//! ([`wires`]), processor time and memory are the kernel's ([`usage`]). `hilare top` and the operator's page
//! show what comes of it.

pub mod usage;
pub mod wires;

use crate::manager::control::{Request, ask};
use crate::manager::measured::Measured;
use crate::manager::status::Status;
use std::path::Path;

/// What launch says of a robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Told {
    /// Its state.
    pub status: Status,
    /// What its processes measure of themselves.
    pub measured: Vec<Measured>,
}

impl Told {
    /// Asks the launch behind a control socket; may take as long as an answer is waited for.
    pub fn by(socket: &Path) -> Result<Self, String> {
        let answer = ask(socket, &Request::Measured).map_err(|error| error.to_string())?;
        match (answer.status, answer.measured) {
            (Some(status), Some(measured)) => Ok(Self { status, measured }),
            _ => Err(format!("launch says: {}; is it of another version of hilare?", answer.message)),
        }
    }

    /// What the process in a slot measures of itself.
    pub fn measured(&self, slot: usize) -> Option<&Measured> {
        self.measured.iter().find(|one| one.slot == slot)
    }

    /// Times workers were started again.
    pub fn restarts(&self) -> u64 {
        self.status.processes.iter().map(|process| process.restarts).sum()
    }
}
