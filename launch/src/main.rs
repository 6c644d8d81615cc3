//! The `hilare` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    hilare::cli::main()
}
