//! The wires as a header for C11 and C++17.

use super::{LAYOUT, WIDTH, about, layout_value, messages, plain, service_of, shout, snake};
use crate::block::TICK_S;
use crate::layout::{Field, Layout};
use crate::messages::{CODES, CodeTable};
use crate::wires::WIRES;
use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::String;

const HEAD: &str =
    "/* The wires of hilare for C11 and C++17. Printed by `hilare diagram --header c`; do not edit.
 *
 * SI units, 64-bit integers and doubles, no padding. A wire is an iceoryx2 publish-subscribe service; both
 * ends compare its attribute HILARE_LAYOUT_ATTRIBUTE before they talk. Payload types go by their names
 * HILARE_..._NAME, which iceoryx2's C++ binding finds in IOX2_TYPE_NAME. Of a wire with two types the first
 * is the user header, the second the element of the slice. */
#ifndef HILARE_WIRES_H
#define HILARE_WIRES_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define HILARE_TYPE_NAME(name) static constexpr const char* IOX2_TYPE_NAME = name;
#else
#define HILARE_TYPE_NAME(name)
#endif
";

/// The header.
pub fn text() -> String {
    let mut text = HEAD.to_owned();
    text.push_str(&format!("\n/* Seconds of a tick. */\n#define HILARE_TICK_S {TICK_S}\n"));
    text.push_str(&format!("\n#define HILARE_LAYOUT_ATTRIBUTE \"{LAYOUT}\"\n"));
    for wire in WIRES {
        let name = shout(wire.name);
        text.push_str(&format!("\n{}", comment(&about(wire), "")));
        text.push_str(&format!("#define HILARE_{name}_SERVICE \"{}\"\n", service_of(wire)));
        text.push_str(&format!("#define HILARE_{name}_LAYOUT \"{}\"\n", layout_value(wire)));
    }
    CODES.iter().for_each(|table| text.push_str(&codes(table)));
    messages().iter().for_each(|message| text.push_str(&structure(message)));
    text.push_str("\n#endif\n");
    text
}

fn comment(doc: &str, indent: &str) -> String {
    let lines = plain(doc, WIDTH - indent.len() - 6);
    format!("{indent}/* {} */\n", lines.join(&format!("\n{indent} * ")))
}

/// Fields of messages are `uint64_t` whatever they mean, so the enum only names the values.
fn codes(table: &CodeTable) -> String {
    let mut text = format!("\n{}enum hilare_{} {{\n", comment(table.doc, ""), snake(table.ident));
    for code in table.codes {
        let name = format!("HILARE_{}_{}", shout(table.ident), shout(code.ident));
        text.push_str(&format!("{}    {name} = {},\n", comment(code.doc, "    "), code.code));
    }
    text.push_str("};\n");
    text
}

fn structure(message: &Layout) -> String {
    let (name, type_name) = (shout(message.ident), format!("hilare_{}", snake(message.ident)));
    let mut text = format!("\n#define HILARE_{name}_NAME \"{}\"\n\n", message.name);
    text.push_str(&comment(message.doc, ""));
    text.push_str(&format!("typedef struct {type_name} {{\n    HILARE_TYPE_NAME(HILARE_{name}_NAME)\n"));
    for field in message.fields {
        text.push_str(&comment(field.doc, "    "));
        text.push_str(&format!("    {};\n", declaration(field)));
    }
    text.push_str(&format!("}} {type_name};\n\n"));
    let differs = "\"laid out otherwise here\"";
    text.push_str(&format!("static_assert(sizeof({type_name}) == {}, {differs});\n", message.size));
    for field in message.fields {
        text.push_str(&format!(
            "static_assert(offsetof({type_name}, {}) == {}, {differs});\n",
            field.name, field.offset
        ));
    }
    text
}

fn declaration(field: &Field) -> String {
    let type_name = match (field.nested, field.type_name) {
        (Some(nested), _) => format!("hilare_{}", snake(nested.ident)),
        // Bytes are text.
        (None, "u8") => "char".to_owned(),
        (None, "f64") => "double".to_owned(),
        (None, "i64") => "int64_t".to_owned(),
        (None, "u64") => "uint64_t".to_owned(),
        (None, other) => other.to_owned(),
    };
    let elements = if field.len == 1 { String::new() } else { format!("[{}]", field.len) };
    format!("{type_name} {}{elements}", field.name)
}
