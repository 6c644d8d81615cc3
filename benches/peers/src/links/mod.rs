//! The peers: one way each to bring a pose to another process and the command back.

mod dora;
mod futex;
mod iceoryx;
mod socket;
mod zenoh;

pub use dora::write_dataflow;
pub use iceoryx::write_config;

use crate::messages::{Command, Pose};
use crate::page::{Page, Side};
use crate::{Result, realtime};
use std::path::PathBuf;
use std::sync::Arc;

/// Where a process of a peer finds what the conductor has made for it.
#[derive(Clone)]
pub struct Place {
    /// The run's directory: sockets, configuration.
    pub directory: PathBuf,
    /// Name of the peer.
    pub peer: &'static str,
    /// The peer's page.
    pub page: Arc<Page>,
}

/// The driver's end of a link.
pub trait Driver {
    /// Sends a pose.
    fn send(&mut self, pose: &Pose) -> Result<()>;
    /// Waits for the next command; with it, when this process had it, ns on CLOCK_MONOTONIC.
    fn command(&mut self) -> Result<(Command, u64)>;
}

/// Who starts a peer's processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Launcher {
    /// The conductor.
    Conductor,
    /// dora's daemon, from a dataflow.
    Dora,
}

/// A row of the table.
pub struct Peer {
    /// Its name on the command line and in the table.
    pub name: &'static str,
    /// What it is, in words.
    pub what: &'static str,
    /// Who starts it.
    pub launcher: Launcher,
    /// Its responder returns when all shall leave; others wait in their transport, to be ended by a signal.
    pub returns: bool,
    driver: fn(&Place) -> Result<Box<dyn Driver>>,
    respond: fn(&Place) -> Result<()>,
}

impl Peer {
    /// Connects the driver's end.
    pub fn driver(&self, place: &Place) -> Result<Box<dyn Driver>> {
        (self.driver)(place)
    }

    /// Answers poses.
    pub fn respond(&self, place: &Place) -> Result<()> {
        (self.respond)(place)
    }
}

/// Every peer, the floor first.
pub const PEERS: &[Peer] = &[
    Peer {
        name: "futex",
        what: "bare futex and words in shared memory: the floor",
        launcher: Launcher::Conductor,
        returns: false,
        driver: futex::driver,
        respond: futex::respond,
    },
    Peer {
        name: "iceoryx2-futex",
        what: "iceoryx2 publish-subscribe, woken by a futex: hilare's wires",
        launcher: Launcher::Conductor,
        returns: false,
        driver: iceoryx::bell_driver,
        respond: iceoryx::bell_respond,
    },
    Peer {
        name: "iceoryx2-event",
        what: "iceoryx2 publish-subscribe, woken by its own event",
        launcher: Launcher::Conductor,
        returns: false,
        driver: iceoryx::event_driver,
        respond: iceoryx::event_respond,
    },
    Peer {
        name: "unix-dgram",
        what: "Unix datagram sockets",
        launcher: Launcher::Conductor,
        returns: false,
        driver: socket::datagram_driver,
        respond: socket::datagram_respond,
    },
    Peer {
        name: "unix-stream",
        what: "Unix stream socket",
        launcher: Launcher::Conductor,
        returns: false,
        driver: socket::stream_driver,
        respond: socket::stream_respond,
    },
    Peer {
        name: "zenoh",
        what: "zenoh, two peers over pipes, set for low latency",
        launcher: Launcher::Conductor,
        returns: true,
        driver: zenoh::driver,
        respond: zenoh::respond,
    },
    Peer {
        name: "zenoh-tcp",
        what: "zenoh, two peers over TCP on loopback, as it comes",
        launcher: Launcher::Conductor,
        returns: true,
        driver: zenoh::tcp_driver,
        respond: zenoh::tcp_respond,
    },
    Peer {
        name: "dora",
        what: "dora dataflow of two Rust nodes and its daemon",
        launcher: Launcher::Dora,
        returns: true,
        driver: dora::driver,
        respond: dora::respond,
    },
];

/// The peer of a name.
pub fn find(name: &str) -> Result<&'static Peer> {
    PEERS.iter().find(|peer| peer.name == name).ok_or_else(|| {
        let known: Vec<&str> = PEERS.iter().map(|peer| peer.name).collect();
        format!("peer {name:?}: no such peer; there are {}", known.join(", ")).into()
    })
}

/// Tells the conductor that the responder can be spoken to.
fn responder_ready(place: &Place) {
    place.page.set_ready(Side::Responder);
}

/// Now: when a message was had.
fn now() -> u64 {
    realtime::monotonic_ns()
}
