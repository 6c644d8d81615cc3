//! The wires as a Python module of ctypes structures, as iceoryx2's Python binding wants them.

use super::{LAYOUT, WIDTH, about, layout_value, messages, plain, service_of, shout};
use crate::block::TICK_S;
use crate::layout::{Field, Layout};
use crate::messages::{CODES, CodeTable};
use crate::wires::{WIRES, Wire};
use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::String;

const HEAD: &str = "\"\"\"The wires of hilare. Printed by `hilare diagram --header python`; do not edit.

SI units, 64-bit integers and doubles, no padding. A wire is an iceoryx2 publish-subscribe service; both ends
compare its attribute LAYOUT_ATTRIBUTE before they talk. Of a wire with an element, the message is the user
header, and the payload a slice of elements.
\"\"\"

import ctypes
import enum
from typing import NamedTuple, Optional
";

const CHECK: &str = "

def _check(message, size, **offsets):
    found = {name: getattr(message, name).offset for name in offsets}
    if ctypes.sizeof(message) != size or found != offsets:
        raise ImportError(f\"{message.__name__} is laid out otherwise here: {found}\")
";

const WIRE: &str = "

class Wire(NamedTuple):
    \"\"\"A wire: its service, its message, its element if the payload is a slice, its layout attribute.\"\"\"

    service: str
    message: type
    element: Optional[type]
    layout: str
";

/// The module.
pub fn text() -> String {
    let mut text = HEAD.to_owned();
    text.push_str(&format!("\n# Seconds of a tick.\nTICK_S = {TICK_S}\n"));
    text.push_str(&format!("\nLAYOUT_ATTRIBUTE = \"{LAYOUT}\"\n"));
    CODES.iter().for_each(|table| text.push_str(&codes(table)));
    text.push_str(CHECK);
    messages().iter().for_each(|message| text.push_str(&structure(message)));
    text.push_str(WIRE);
    text.push('\n');
    WIRES.iter().for_each(|wire| text.push_str(&constant(wire)));
    text
}

fn docstring(doc: &str) -> String {
    let lines = plain(doc, WIDTH - 10);
    match lines.as_slice() {
        [line] => format!("    \"\"\"{line}\"\"\"\n\n"),
        lines => format!("    \"\"\"{}\n    \"\"\"\n\n", lines.join("\n    ")),
    }
}

fn comment(doc: &str, indent: &str) -> String {
    plain(doc, WIDTH - indent.len() - 2).iter().map(|line| format!("{indent}# {line}\n")).collect()
}

fn codes(table: &CodeTable) -> String {
    let mut text = format!("\n\nclass {}(enum.IntEnum):\n{}", table.ident, docstring(table.doc));
    for code in table.codes {
        text.push_str(&format!("{}    {} = {}\n", comment(code.doc, "    "), shout(code.ident), code.code));
    }
    text
}

fn structure(message: &Layout) -> String {
    let mut text = format!("\n\nclass {}(ctypes.Structure):\n{}", message.ident, docstring(message.doc));
    text.push_str("    _fields_ = [\n");
    for field in message.fields {
        text.push_str(&comment(field.doc, "        "));
        text.push_str(&format!("        (\"{}\", {}),\n", field.name, type_of(field)));
    }
    text.push_str("    ]\n\n    @staticmethod\n    def type_name() -> str:\n");
    text.push_str("        \"\"\"What iceoryx2 calls it.\"\"\"\n");
    text.push_str(&format!("        return \"{}\"\n\n\n_check(\n", message.name));
    text.push_str(&format!("    {},\n    {},\n", message.ident, message.size));
    for field in message.fields {
        text.push_str(&format!("    {}={},\n", field.name, field.offset));
    }
    text.push_str(")\n");
    text
}

fn type_of(field: &Field) -> String {
    let element = match (field.nested, field.type_name) {
        (Some(nested), _) => nested.ident,
        // Bytes are text.
        (None, "u8") => "ctypes.c_char",
        (None, "f64") => "ctypes.c_double",
        (None, "i64") => "ctypes.c_int64",
        (None, "u64") => "ctypes.c_uint64",
        (None, other) => other,
    };
    if field.len == 1 { element.to_owned() } else { format!("{element} * {}", field.len) }
}

fn constant(wire: &Wire) -> String {
    format!(
        "\n{}{} = Wire(\"{}\", {}, {}, \"{}\")\n",
        comment(&about(wire), ""),
        shout(wire.name),
        service_of(wire),
        wire.message.ident,
        wire.element.map_or("None", |element| element.ident),
        layout_value(wire)
    )
}
