//! `hilare demo`: what `hilare` alone does.

use super::VerbResult;
use super::run::{RunArgs, run};
use crate::operator::port;
use crate::shell::ClockKind;
use clap::Args;
use std::io::{self, Write};
use std::path::PathBuf;

/// Options of `hilare demo`.
#[derive(Args, Default)]
pub struct DemoArgs {
    /// Directory for the report [default: runs/rectangle-kanayama-real-N]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Name the robot runs under
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    /// Port of the operator's page; 0 for none [default: 7070, or none if that is taken]
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// Address and port of a live view for Foxglove and Lichtblick, e.g. 127.0.0.1:8765
    #[arg(long, value_name = "ADDR")]
    foxglove: Option<String>,
    /// Print summary.json instead of the verdict
    #[arg(long)]
    json: bool,
}

/// The port of the page of `hilare demo`.
const PORT: u16 = 7070;

/// Where the page of `hilare demo` listens. Only for one that was asked for is a port that is taken a reason not to
/// begin.
fn demo_listen(port: Option<u16>) -> Option<String> {
    let listen = |port: u16| format!("127.0.0.1:{port}");
    match port {
        Some(0) => None,
        Some(port) => Some(listen(port)),
        None => match port::check(port::LISTEN, &listen(PORT)) {
            Ok(()) => Some(listen(PORT)),
            Err(why) => {
                let _ = writeln!(io::stderr(), "hilare: no page: {why} (hilare demo --port N)");
                None
            }
        },
    }
}

/// The standard job: the closed rectangle, in real time.
pub fn demo(args: &DemoArgs) -> VerbResult {
    run(&RunArgs {
        scenario: Some("rectangle".to_owned()),
        path: None,
        start: None,
        controller: None,
        standby: None,
        listen: demo_listen(args.port),
        foxglove: args.foxglove.clone(),
        clock: ClockKind::Real,
        seed: None,
        set: Vec::new(),
        no_recording: false,
        robot: args.robot.clone(),
        out: args.out.clone(),
        json: args.json,
    })
}
