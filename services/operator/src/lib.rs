//! The operator's page: a web server on this machine's own addresses, off the loop.
//!
//! [`robot`] is what is known of a robot, [`metrics`] writes it for Prometheus, [`server`] answers, [`address`]
//! says where. Where a robot's state comes from is the [`server::Source`]'s matter.

pub mod address;
pub mod metrics;
pub mod robot;
pub mod server;
