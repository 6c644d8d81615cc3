//! The wires for programs in other languages: a header for C and C++, a module of ctypes structures for Python.
//!
//! Written from the wire table and the layouts of its messages; there is no second list. What a field is
//! stands beside it, in the words of its documentation. `hilare diagram --header` prints them. A feature of this
//! crate (`export`), because text needs a heap and the boxes have none.

mod c;
mod python;

use crate::layout::Layout;
use crate::wires::{Rate, WIRES, Wire};
use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

pub use c::text as c;
pub use python::text as python;

/// Columns of a line.
const WIDTH: usize = 108;

/// Name of a wire's service.
pub fn service_of(wire: &Wire) -> String {
    format!("hilare/{}", wire.name)
}

/// The service attribute both ends of a wire compare before they talk.
pub const LAYOUT: &str = "layout";

/// Its value: the layout hash of the wire's messages, and the version.
pub fn layout_value(wire: &Wire) -> String {
    format!("{:016x} {}", wire.layout_hash, env!("CARGO_PKG_VERSION"))
}

/// How often a wire carries a message, in words.
pub fn rate(wire: &Wire) -> String {
    match wire.rate {
        Rate::EveryTick => "1 kHz".to_owned(),
        Rate::EveryPeriod => "every control period".to_owned(),
        Rate::OnDemand => "on demand".to_owned(),
        Rate::Hertz(hertz) => format!("{hertz} Hz"),
    }
}

/// Every message of the wires once, those that others consist of first.
fn messages() -> Vec<Layout> {
    let mut found = Vec::new();
    for wire in WIRES {
        collect(wire.message, &mut found);
        wire.element.into_iter().for_each(|element| collect(element, &mut found));
    }
    found
}

fn collect(message: Layout, found: &mut Vec<Layout>) {
    for nested in message.fields.iter().filter_map(|field| field.nested) {
        collect(*nested, found);
    }
    if !found.contains(&message) {
        found.push(message);
    }
}

/// Who writes a wire, who reads it, how often, what it is.
fn about(wire: &Wire) -> String {
    let writers: Vec<_> = wire.from.iter().map(|role| role.name()).collect();
    let observers = wire.is_watch().then_some("observers");
    let readers: Vec<_> = wire.to.iter().map(|reader| reader.role.name()).chain(observers).collect();
    let payload = wire.element.map_or(String::new(), |element| format!(", then {}s", element.ident));
    format!(
        "{} -> {}, {}: {}. {}{payload}.",
        writers.join(", "),
        readers.join(", "),
        rate(wire),
        wire.doc,
        wire.message.ident
    )
}

/// Documentation without its mark-up, in lines of at most `width` columns.
fn plain(doc: &str, width: usize) -> Vec<String> {
    let text = doc.replace("[`", "").replace("`]", "").replace('`', "");
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// `PoseFix` as `pose_fix`.
fn snake(ident: &str) -> String {
    let mut name = String::new();
    for (i, letter) in ident.chars().enumerate() {
        if letter.is_uppercase() && i > 0 {
            name.push('_');
        }
        name.extend(letter.to_lowercase());
    }
    name
}

/// `PoseFix` as `POSE_FIX`, `watch/pose` as `WATCH_POSE`.
fn shout(ident: &str) -> String {
    snake(ident).replace('/', "_").to_uppercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::CODES;

    #[test]
    fn messages_come_after_those_they_consist_of() {
        let messages = messages();
        for (i, message) in messages.iter().enumerate() {
            let nested = message.fields.iter().filter_map(|field| field.nested);
            for inner in nested {
                assert!(messages[..i].contains(inner), "{} before {}", message.ident, inner.ident);
            }
            assert!(messages[..i].iter().all(|other| other.ident != message.ident), "{}", message.ident);
        }
    }

    #[test]
    fn every_code_a_field_speaks_of_is_in_the_table() {
        let fields: Vec<_> = messages().iter().flat_map(|message| message.fields).collect();
        let spoken: Vec<_> =
            fields.iter().filter_map(|field| field.doc.trim().strip_prefix("A [`")).collect();
        assert!(spoken.len() > 4, "a field with a code says so: {spoken:?}");
        for doc in spoken {
            let ident = doc.split('`').next();
            assert!(CODES.iter().any(|table| Some(table.ident) == ident), "{doc}: not in CODES");
        }
    }

    #[test]
    fn text_is_wrapped_and_without_markup() {
        assert_eq!(plain(" A [`Mode`]: `stop`\n or not.\n", 12), ["A Mode: stop", "or not."]);
        assert_eq!((snake("EStop"), shout("PoseFix")), ("e_stop".to_owned(), "POSE_FIX".to_owned()));
    }
}
