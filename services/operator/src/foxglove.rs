//! A live view for Foxglove and Lichtblick: a server of the Foxglove WebSocket protocol, to look and nothing more.
//!
//! ```text
//!   whoever publishes ──▶ Feed: the newest of each channel ──▶ session, 30 Hz at most ──▶ Foxglove, Lichtblick
//! ```
//!
//! [`protocol`] is what is said both ways, [`feed`] keeps what there is to see, [`server`] lets in, [`session`] tells
//! one viewer. Nothing is queued for anybody: a viewer that is slow, or dead, sees less.
//!
//! The protocol's part that a server needs which publishes and is not spoken to is small. The `foxglove` crate (0.30.3) has all of it, and
//! is not used here: its server takes a connection from any web site (no `Origin`, no `Host`), closes its port for good
//! when one `accept` fails, and keeps 64 MiB of an unfinished message for each of any number of connections.

pub mod feed;
pub mod protocol;
pub mod server;
mod session;

pub use feed::{Channel, Feed};
pub use server::{Gate, serve};
