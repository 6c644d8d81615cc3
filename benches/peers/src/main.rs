//! The pose → command hop over several transports, side by side. README.md tells the method.

mod conductor;
mod figures;
mod host;
mod links;
mod messages;
mod page;
mod pair;
mod realtime;
mod roles;

use clap::{Parser, Subcommand};
use conductor::{Outcome, Plan};
use std::process::ExitCode;

/// Any failure: one line.
type Error = Box<dyn std::error::Error + Send + Sync>;
type Result<T> = std::result::Result<T, Error>;

/// Says whose failure it is.
fn named(who: &str) -> impl Fn(Error) -> Error {
    move |error| format!("{who}: {error}").into()
}

/// Measures the pose → command hop over several transports in one run, in turns.
///
/// Exit codes: 0 every peer was measured, 1 some were not, or a fault, 2 wrong use.
#[derive(Parser)]
#[command(name = "benches/peers/run")]
struct Cli {
    #[command(subcommand)]
    role: Option<Role>,
    #[command(flatten)]
    options: conductor::RunOptions,
}

/// What the conductor starts.
#[derive(Subcommand)]
enum Role {
    /// Sends poses.
    #[command(hide = true)]
    Drive(roles::RoleOptions),
    /// Answers them.
    #[command(hide = true)]
    Respond(roles::RoleOptions),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match &cli.role {
        Some(Role::Drive(options)) => roles::drive(options).map(|()| Outcome::Complete),
        Some(Role::Respond(options)) => roles::respond(options).map(|()| Outcome::Complete),
        None => match Plan::of(&cli.options) {
            Ok(plan) => conductor::run(&cli.options, &plan),
            Err(error) => {
                eprintln!("error: {error}");
                return ExitCode::from(2);
            }
        },
    };
    match outcome {
        Ok(Outcome::Complete) => ExitCode::SUCCESS,
        Ok(Outcome::Incomplete) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}
