//! What a message says, read from its bytes and its layout.

use super::Message;
use hilare_interfaces::layout::{Field, Layout};
use hilare_interfaces::messages::{CODES, CodeTable};
use serde_json::{Map, Value, json};

/// Longer arrays are told by their length in a line of text.
const SHORT: usize = 4;

/// Everything a message says; the elements after a header under `elements`.
pub fn to_json(message: &Message) -> Value {
    let mut value = of_layout(message.layout, &message.bytes);
    if let (Value::Object(map), Some((layout, bytes))) = (&mut value, &message.elements) {
        let elements: Vec<Value> =
            bytes.chunks_exact(layout.size).map(|element| of_layout(layout, element)).collect();
        map.insert("elements".to_owned(), elements.into());
    }
    value
}

/// What a dotted path leads to: `x_m`, `current.x_m`, `elements.3.x_m`.
pub fn pick<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    path.split('.').try_fold(value, |value, step| match value {
        Value::Array(elements) => elements.get(step.parse::<usize>().ok()?),
        _ => value.get(step),
    })
}

/// A message in a line: names and values, codes with their meaning, long arrays by their length.
pub fn to_text(message: &Message) -> String {
    let value = to_json(message);
    let mut parts = Vec::new();
    for field in message.layout.fields {
        let said = value.get(field.name).map_or(String::new(), in_words);
        let meaning =
            meaning(field, value.get(field.name)).map_or(String::new(), |ident| format!(" ({ident})"));
        parts.push(format!("{} {said}{meaning}", field.name));
    }
    if let Some((layout, bytes)) = &message.elements {
        parts.push(format!("and {} {}s", bytes.len() / layout.size.max(1), layout.ident));
    }
    parts.join("  ")
}

/// A value without JSON's marks.
pub fn in_words(value: &Value) -> String {
    match value {
        Value::String(text) => format!("{text:?}"),
        Value::Array(elements) if elements.len() > SHORT => format!("[{} values]", elements.len()),
        Value::Array(elements) => {
            format!("[{}]", elements.iter().map(in_words).collect::<Vec<_>>().join(", "))
        }
        Value::Object(map) => {
            let fields = map.iter().map(|(name, value)| format!("{name} {}", in_words(value)));
            format!("{{{}}}", fields.collect::<Vec<_>>().join(", "))
        }
        Value::Number(number) if number.is_f64() => number.as_f64().map_or(String::new(), rounded),
        other => other.to_string(),
    }
}

/// Six decimals are a micrometre, or a microradian; JSON has them all.
fn rounded(number: f64) -> String {
    if number != 0.0 && number.abs() < 1e-3 { format!("{number:.3e}") } else { format!("{number:.6}") }
}

fn of_layout(layout: &Layout, bytes: &[u8]) -> Value {
    let mut map = Map::new();
    for field in layout.fields {
        map.insert(field.name.to_owned(), of_field(field, bytes.get(field.offset..).unwrap_or(&[])));
    }
    map.into()
}

/// The value of a field whose bytes come first.
fn of_field(field: &Field, bytes: &[u8]) -> Value {
    if field.type_name == "u8" {
        let text = bytes.get(..field.len).unwrap_or(bytes);
        let text = text.split(|byte| *byte == 0).next().unwrap_or(&[]);
        return String::from_utf8_lossy(text).into_owned().into();
    }
    let size = field.nested.map_or(8, |nested| nested.size);
    let mut elements = bytes.chunks_exact(size).take(field.len).map(|element| match field.nested {
        Some(nested) => of_layout(nested, element),
        None => scalar(field.type_name, element),
    });
    if field.len == 1 { elements.next().unwrap_or(Value::Null) } else { elements.collect() }
}

fn scalar(type_name: &str, bytes: &[u8]) -> Value {
    let Ok(bytes) = <[u8; 8]>::try_from(bytes) else { return Value::Null };
    match type_name {
        // JSON has no NaN: null, as in every other answer.
        "f64" => json!(f64::from_ne_bytes(bytes)),
        "i64" => json!(i64::from_ne_bytes(bytes)),
        _ => json!(u64::from_ne_bytes(bytes)),
    }
}

/// The table of a field that holds a code: its documentation begins with it.
fn codes(field: &Field) -> Option<&'static CodeTable> {
    let (_, after) = field.doc.split_once("A [`")?;
    let (ident, _) = after.split_once("`]")?;
    CODES.iter().find(|table| table.ident == ident)
}

/// What a code means.
fn meaning(field: &Field, value: Option<&Value>) -> Option<&'static str> {
    let code = value?.as_u64()?;
    codes(field)?.codes.iter().find(|known| known.code == code).map(|known| known.ident)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::{WireField, WireMessage};
    use hilare_interfaces::messages::{
        Answer, PathHeader, Pose, Reference, ReferenceState, Waypoint, text_field,
    };

    fn message<T: WireMessage>(of: &T) -> Message {
        Message { layout: &T::LAYOUT, bytes: of.as_bytes().to_vec(), elements: None }
    }

    #[test]
    fn values_are_those_of_the_message() {
        let pose = Pose { tick: 7, x_m: 0.1, y_m: -2.5e-3, theta_rad: f64::NAN, ..Pose::ZERO };
        let value = to_json(&message(&pose));
        assert_eq!((&value["tick"], &value["x_m"], &value["y_m"]), (&json!(7), &json!(0.1), &json!(-2.5e-3)));
        assert_eq!(value["theta_rad"], Value::Null);
        let answer = Answer { goal_id: 3, text: text_field("no way"), ..Answer::ZERO };
        assert_eq!(to_json(&message(&answer))["text"], "no way");
    }

    #[test]
    fn what_lies_inside_is_found_by_its_path() {
        let mut reference = Reference { state: ReferenceState::Arrived.code(), ..Reference::ZERO };
        reference.current = Waypoint::straight(1.5, 2.0);
        reference.preview[3] = Waypoint::straight(4.0, 5.0);
        let value = to_json(&message(&reference));
        assert_eq!(pick(&value, "current.x_m"), Some(&json!(1.5)));
        assert_eq!(pick(&value, "preview.3.y_m"), Some(&json!(5.0)));
        assert_eq!((pick(&value, "preview.99"), pick(&value, "nothing")), (None, None));
        let text = to_text(&message(&reference));
        assert!(text.contains("(Arrived)") && text.contains("preview [32 values]"), "{text}");
    }

    #[test]
    fn elements_follow_their_header() {
        let waypoints = [Waypoint::straight(1.0, 2.0), Waypoint::straight(3.0, 4.0)];
        let bytes: Vec<u8> = waypoints.iter().flat_map(|waypoint| waypoint.as_bytes().to_vec()).collect();
        let mut path = message(&PathHeader { path_id: 9, goal_id: 1 });
        path.elements = Some((&Waypoint::LAYOUT, bytes));
        let value = to_json(&path);
        assert_eq!(pick(&value, "elements.1.y_m"), Some(&json!(4.0)));
        assert!(to_text(&path).ends_with("and 2 Waypoints"));
    }
}
