//! The operator's page: a web server, off the loop, on this machine's own addresses unless more is asked for.
//!
//! ```text
//!   Source ──▶ live: what is known now ──▶ session: a page's WebSocket, at its own pace ──▶ page/*.js
//!     ▲                                        │ orders
//!     └────────────── orders: permits ◀────────┘
//! ```
//!
//! [`robot`] is what is known of a robot, [`metrics`] writes it for Prometheus, [`live`] keeps what pages are shown,
//! [`message`] is what is said both ways, [`server`] answers, [`address`] says where. Where a robot's state comes
//! from, and who carries out orders, is the [`Source`]'s matter. [`foxglove`] is a server of its own, for other tools.
#![allow(
    clippy::disallowed_methods,
    reason = "it is no box of the control path: connections have time limits, and time is the machine's"
)]

pub mod address;
mod assets;
mod connections;
pub mod foxglove;
pub mod live;
pub mod message;
pub mod metrics;
mod mouth;
mod orders;
mod presence;
pub mod robot;
pub mod server;
mod session;

use live::Live;
use message::{Answer, Order};
use robot::Robot;
use std::net::SocketAddr;
use std::sync::atomic::AtomicBool;

/// Is told what becomes of a connection.
pub type Verdict = Box<dyn FnOnce(bool) + Send>;

/// Where a robot's state comes from, and who carries out orders.
pub trait Source: Send + Sync + 'static {
    /// A look at the robot, or why there is none. May block for seconds.
    fn look(&self) -> Result<Robot, String>;

    /// What pages are shown.
    fn live(&self) -> &Live;

    /// Carries out an order. May block for seconds; one that only computes ends early once `cancelled` is set.
    fn order(&self, order: &Order, cancelled: &AtomicBool) -> Answer;

    /// Tells `verdict`, at once or later, whether whoever is at the other end of a connection may speak to the robot.
    fn admit(&self, peer: SocketAddr, own: SocketAddr, verdict: Verdict);
}
