//! What our own messages are, in the words of ROS 2 (`ros2msg`): text made of their layouts, so that there is no second
//! list of fields.

use super::part::View;
use super::wires::Recorded;
use hilare_interfaces::layout::{Field, Layout};

/// The language, as channels name it.
pub const LANGUAGE: &str = "ros2msg";
/// Package of our own messages.
const PACKAGE: &str = "hilare_msgs";
/// What stands between a definition and those it needs.
const RULE: &str = "================================================================================";

/// The channel of a recorded wire.
pub fn view(recorded: &Recorded) -> View {
    View { topic: recorded.topic(), type_name: name(recorded), definition: definition(recorded) }
}

/// Name of the message of a recorded wire: `hilare_msgs/msg/Pose`.
pub fn name(recorded: &Recorded) -> String {
    format!("{PACKAGE}/msg/{}", recorded.ident)
}

/// Its definition, with those of the messages in it.
pub fn definition(recorded: &Recorded) -> String {
    let wire = recorded.wire;
    let mut text = String::new();
    let mut needed: Vec<&Layout> = Vec::new();
    describe(&wire.message, &mut text, &mut needed);
    if let Some(element) = &wire.element {
        text.push_str(&format!("\n# What follows.\n{} elements\n", list_of(element.ident, None)));
        need(element, &mut needed);
    }
    let mut done = 0;
    while done < needed.len() {
        let layout = needed[done];
        done += 1;
        text.push_str(&format!("{RULE}\nMSG: {PACKAGE}/{}\n", layout.ident));
        describe(layout, &mut text, &mut needed);
    }
    text
}

fn need<'l>(layout: &'l Layout, needed: &mut Vec<&'l Layout>) {
    if !needed.iter().any(|known| known.name == layout.name) {
        needed.push(layout);
    }
}

fn describe(layout: &Layout, text: &mut String, needed: &mut Vec<&'static Layout>) {
    comment(&format!("{}\n{}", layout.name, layout.doc), text);
    for field in layout.fields {
        text.push('\n');
        comment(field.doc, text);
        text.push_str(&format!("{} {}\n", type_of(field), field.name));
        if let Some(nested) = field.nested {
            need(nested, needed);
        }
    }
}

fn comment(doc: &str, text: &mut String) {
    for line in doc.trim_end().lines() {
        let line = line.replace("[`", "").replace("`]", "").replace('`', "");
        text.push_str(&format!("# {}\n", line.trim()));
    }
}

fn type_of(field: &Field) -> String {
    let many = (field.len > 1).then_some(field.len);
    match (field.nested, field.type_name) {
        (Some(nested), _) => {
            many.map_or_else(|| qualified(nested.ident), |len| list_of(nested.ident, Some(len)))
        }
        (None, scalar) => {
            let scalar = match scalar {
                "u8" => "uint8",
                "u64" => "uint64",
                "i64" => "int64",
                _ => "float64",
            };
            many.map_or_else(|| scalar.to_owned(), |len| format!("{scalar}[{len}]"))
        }
    }
}

fn qualified(ident: &str) -> String {
    format!("{PACKAGE}/{ident}")
}

fn list_of(ident: &str, len: Option<usize>) -> String {
    format!("{}[{}]", qualified(ident), len.map_or(String::new(), |len| len.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::wires::RECORDED;

    fn of(ident: &str) -> String {
        definition(RECORDED.iter().find(|recorded| recorded.ident == ident).unwrap())
    }

    /// Without comments and empty lines.
    fn bare(text: &str) -> Vec<&str> {
        text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).collect()
    }

    #[test]
    fn a_pose_in_the_words_of_ros() {
        let text = of("Pose");
        assert_eq!(
            bare(&text),
            ["uint64 tick", "uint64 measured_tick", "float64 x_m", "float64 y_m", "float64 theta_rad"]
        );
        assert!(text.contains("# hilare/Pose/v2\n# Estimated pose of the robot.\n"), "{text}");
        assert!(text.contains("# World x, m.\nfloat64 x_m\n"), "{text}");
    }

    #[test]
    fn what_lies_inside_is_defined_once() {
        let text = of("Reference");
        assert!(text.contains("\nhilare_msgs/Waypoint last\n"), "{text}");
        assert!(text.contains("\nhilare_msgs/Waypoint[32] preview\n"), "{text}");
        assert_eq!(text.matches("MSG: hilare_msgs/Waypoint\n").count(), 1, "{text}");
        let path = of("Path");
        let fields = bare(&path);
        assert_eq!(fields[..3], ["uint64 path_id", "uint64 goal_id", "hilare_msgs/Waypoint[] elements"]);
        assert_eq!(fields[4], "MSG: hilare_msgs/Waypoint");
    }
}
