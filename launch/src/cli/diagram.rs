//! `hilare diagram`: the wire table as a picture, as JSON, and for programs in other languages.

use super::{VerbResult, print};
use clap::{Args, ValueEnum};
use hilare_interfaces::export::{self, rate, service_of};
use hilare_interfaces::wires::{Role, WIRES, Wire};
use std::process::ExitCode;

/// A language the wires can be printed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Language {
    /// A header for C11 and C++17
    C,
    /// A module of ctypes structures
    Python,
}

/// Options of `hilare diagram`.
#[derive(Args)]
pub struct DiagramArgs {
    /// The table as JSON
    #[arg(long, conflicts_with = "header")]
    json: bool,
    /// The messages as a source file for programs outside
    #[arg(long, value_name = "LANGUAGE")]
    header: Option<Language>,
}

/// Prints the diagram.
pub fn diagram(args: &DiagramArgs) -> VerbResult {
    if let Some(language) = args.header {
        print(&match language {
            Language::C => export::c(),
            Language::Python => export::python(),
        });
    } else if args.json {
        let wires: Vec<_> = WIRES.iter().map(|wire| as_json(wire)).collect();
        print(&format!("{}\n", serde_json::to_string_pretty(&wires).unwrap_or_default()));
    } else {
        print(&text());
    }
    Ok(ExitCode::SUCCESS)
}

fn as_json(wire: &Wire) -> serde_json::Value {
    serde_json::json!({
        "name": wire.name,
        "service": service_of(wire),
        "message": wire.message.name,
        "element": wire.element.map(|element| element.name),
        "layout_hash": format!("{:016x}", wire.layout_hash),
        "from": wire.from.iter().map(|role| role.name()).collect::<Vec<_>>(),
        "to": wire.to.iter().map(|reader| reader.role.name()).collect::<Vec<_>>(),
        "rate": rate(wire),
        "buffer": wire.buffer,
        "history": wire.history,
        "doc": wire.doc,
    })
}

/// The diagram as it stands in the README: a box, what it sends, to whom.
pub fn text() -> String {
    let mut text = String::new();
    for role in std::iter::once(Role::Launch).chain(Role::WORKERS) {
        let out: Vec<_> =
            WIRES.iter().filter(|wire| wire.written_by(role) && wire.name != "health").collect();
        let label = format!("[{}]", role.name());
        if out.is_empty() {
            text.push_str(&format!("{label:<20}(reads only)\n"));
        }
        for (i, wire) in out.iter().enumerate() {
            let head = if i == 0 { label.as_str() } else { "" };
            let observers = wire.is_watch().then_some("observers");
            let readers: Vec<_> = wire.to.iter().map(|reader| reader.role.name()).chain(observers).collect();
            text.push_str(&line(head, wire.name, &readers.join(", "), &rate(wire)));
        }
    }
    text.push_str(&line("[every worker]", "health", "launch", "20 Hz"));
    text
}

fn line(from: &str, wire: &str, to: &str, rate: &str) -> String {
    let arrow = format!("──{wire}──▶");
    format!("{from:<20}{arrow:<20} {to:<47} {rate}\n")
}
