//! The `hilare` command.

fn main() {}
