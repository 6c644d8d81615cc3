//! The schema of a scenario file.

use super::{DRAFT, Section, System, merged, number, object, of_variant};
use crate::config::scenario::{CORRECTION, published_specs};
use serde_json::{Map, Value, json};

/// The schema of a scenario file.
pub fn scenario_schema() -> Value {
    let changes: Vec<Section> = Section::all().filter(|section| *section != Section::Start).collect();
    let mut set = object(&changes, "");
    set["description"] = "Keys of the system, changed: [set.SECTION].".into();
    let start = object(&[Section::Start], "start");
    let point = |most: u64| json!({ "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": most });
    let waypoints = json!({
        "type": "array",
        "items": point(4),
        "minItems": 2,
        "description": "Waypoints, m: [x, y], [x, y, bulge] for an arc (tan(sweep/4), positive to the left), or \
                        [x, y, bulge, crab_rad].",
    });
    let text = |doc: &str| json!({ "type": "string", "description": doc });
    let mut goal = point(2);
    goal["description"] = "A point to plan a way to, m.".into();
    let properties = json!({
        "description": text("One line for people."),
        "system": {
            "anyOf": [{ "enum": System::builtin_names().collect::<Vec<_>>() }, { "pattern": "\\.toml$" }],
            "type": "string",
            "description": "A built-in system or the path of a system file, relative to this one.",
        },
        "waypoints_m": waypoints,
        "waypoints_file": text("A CSV file with header x,y and metres, relative to this file."),
        "goal_m": goal,
        "start": start,
        "set": set,
        "correction": table(&CORRECTION, &["cross_track_m"], "What counts as corrected, if the job is to correct a deviation."),
        "published": {
            "type": "array",
            "items": published(),
            "description": "What others measured or computed on this path.",
        },
    });
    let only_one = ["waypoints_m", "waypoints_file", "goal_m"].map(|task| json!({ "required": [task] }));
    let schema = json!({
        "$schema": DRAFT,
        "title": "Scenario file of hilare",
        "description": "A job: a robot and what it has to drive.",
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
        "required": ["system"],
        "oneOf": only_one,
    });
    merged(schema, changes_of_built_in())
}

/// A table of numbers.
fn table(specs: &[&'static hilare_interfaces::params::ParamSpec], required: &[&str], doc: &str) -> Value {
    let properties: Map<String, Value> =
        specs.iter().map(|spec| (spec.name.to_owned(), number(spec))).collect();
    json!({
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
        "required": required,
        "description": doc,
    })
}

fn published() -> Value {
    let mut row = table(&published_specs(), &["source"], "A row of the verdict.");
    row["properties"]["source"] =
        json!({ "type": "string", "minLength": 1, "description": "Where the values come from." });
    row
}

/// Of a built-in system it is known which keys it has, as long as its kinds stay.
fn changes_of_built_in() -> Value {
    let mut rest = json!({});
    let kind_stays = json!({ "not": { "required": ["kind"] } });
    for name in System::builtin_names().collect::<Vec<_>>().into_iter().rev() {
        let Ok(system) = System::built_in(name) else { continue };
        let mut then = of_variant(&system);
        // The law that drives stands in the system.
        for asked in ["required", "controller"] {
            if let Some(object) = then.as_object_mut() {
                object.remove(asked);
            }
        }
        if let Some(controller) = then["properties"]["controller"].as_object_mut() {
            controller.remove("required");
        }
        let set = json!({ "properties": { "chassis": kind_stays, "motors": kind_stays } });
        let mut link = json!({
            "if": { "required": ["system"], "properties": { "system": { "const": name }, "set": set } },
            "then": { "properties": { "set": then } },
        });
        if rest != json!({}) {
            link["else"] = rest;
        }
        rest = link;
    }
    rest
}
