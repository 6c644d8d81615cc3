//! The table of keys as a JSON Schema, for editors: `hilare schema`.
//!
//! Draft 7, which every editor's TOML tooling reads. Each section stands once with the keys of all robots, so that
//! completion and hovering find them; which of them go together follows in a chain of `if`, `then`, `else` over
//! the kinds of chassis and motors.

mod scenario;

pub use scenario::scenario_schema;

use super::keys::{Form, Key, Section};
use super::texts::{CHASSIS, LAW, MOTORS, STANDBY};
use super::{System, assign, conflict};
use hilare_controller::LAWS;
use hilare_interfaces::params::{ParamKind, ParamSpec};
use serde_json::{Map, Value, json};

const DRAFT: &str = "http://json-schema.org/draft-07/schema#";

/// The schema of a system file.
pub fn system_schema() -> Value {
    let mut schema = merged(object(&Section::all().collect::<Vec<_>>(), ""), chain(&variants(), &condition));
    schema["$schema"] = DRAFT.into();
    schema["title"] = "System file of hilare".into();
    schema["description"] = "A robot: what differs from the defaults, in SI units.".into();
    schema
}

/// What a number or switch takes.
pub(super) fn number(spec: &'static ParamSpec) -> Value {
    let mut schema = match spec.kind {
        ParamKind::Switch => json!({ "type": "boolean", "default": spec.default != 0.0 }),
        ParamKind::Integer => json!({ "type": "integer" }),
        ParamKind::Real => json!({ "type": "number" }),
    };
    schema["description"] = described(&Form::Number(spec)).into();
    if spec.kind != ParamKind::Switch {
        schema["minimum"] = plain(spec.min);
        schema["maximum"] = plain(spec.max);
        schema["default"] = plain(spec.default);
        schema["x-unit"] = spec.unit.into();
    }
    schema
}

/// What a key is, in a line: meaning, unit, bounds, default.
fn described(form: &Form) -> String {
    match form {
        Form::Number(spec) if spec.kind == ParamKind::Switch => spec.doc.trim().to_owned(),
        Form::Number(spec) => {
            format!("{} {}; default {}.", spec.doc.trim(), assign::range(spec), spec.default)
        }
        Form::Text(spec) => spec.doc.to_owned(),
    }
}

/// Whole numbers without a fraction, as people write them.
fn plain(value: f64) -> Value {
    if value.fract() == 0.0 && value.abs() < 9.1e15 { json!(value as i64) } else { json!(value) }
}

/// What a key takes.
fn key(key: &Key) -> Value {
    let spec = match key.form {
        Form::Number(spec) => return number(spec),
        Form::Text(spec) => spec,
    };
    let mut schema =
        json!({ "type": "string", "default": spec.default, "description": described(&key.form) });
    let choices = (spec.choices)();
    if !choices.is_empty() {
        schema["enum"] = choices.into();
    }
    if let Some(pattern) = (spec.pattern)() {
        schema["pattern"] = pattern.into();
    }
    schema
}

/// The table at `path`, with what is below it.
pub(super) fn object(sections: &[Section], path: &str) -> Value {
    let mut properties = Map::new();
    let here = sections.iter().filter(|section| section.path() == path);
    for found in here.flat_map(|section| section.keys()) {
        add(&mut properties, found.name, key(&found));
    }
    let below = if path.is_empty() { String::new() } else { format!("{path}.") };
    for known in sections.iter().map(|section| section.path()) {
        let Some(rest) = known.strip_prefix(&below).filter(|rest| !rest.is_empty()) else { continue };
        let name = rest.split('.').next().unwrap_or(rest);
        if !properties.contains_key(name) {
            properties.insert(name.to_owned(), object(sections, &format!("{below}{name}")));
        }
    }
    let mut schema = json!({ "type": "object", "properties": properties, "additionalProperties": false });
    if let Some(section) = sections.iter().find(|section| section.path() == path && !path.is_empty()) {
        schema["description"] = section.doc().into();
    }
    schema
}

/// A key that several robots have, each with its own meaning, takes what one of them takes.
fn add(properties: &mut Map<String, Value>, name: &str, schema: Value) {
    let Some(known) = properties.get_mut(name) else {
        properties.insert(name.to_owned(), schema);
        return;
    };
    if *known == schema {
        return;
    }
    if known.get("anyOf").is_none() {
        *known = json!({ "anyOf": [known] });
    }
    if let Some(others) = known["anyOf"].as_array_mut()
        && !others.contains(&schema)
    {
        others.push(schema);
    }
}

/// A robot of each kind of chassis and motors.
pub(super) fn variants() -> Vec<System> {
    let kinds = (CHASSIS.choices)().into_iter().flat_map(|chassis| {
        let motors = (MOTORS.choices)().into_iter();
        motors.map(move |motors| (chassis, motors))
    });
    kinds.map(|(chassis, motors)| System::of_kinds(chassis, motors)).collect()
}

/// What holds for one kind of robot: its keys and no others, its laws.
pub(super) fn of_variant(system: &System) -> Value {
    if conflict::plant_of_robot(system).is_some() {
        // The loader says it in words.
        let other = (MOTORS.choices)().into_iter().filter(|kind| *kind != system.motors.name());
        let kind =
            json!({ "required": ["kind"], "properties": { "kind": { "enum": other.collect::<Vec<_>>() } } });
        return json!({ "required": ["motors"], "properties": { "motors": kind } });
    }
    let of_kinds = |section: &Section| !section.only_for().is_empty();
    let fitting: Vec<Section> =
        Section::all().filter(|section| of_kinds(section) && section.fits(system)).collect();
    let mut then = json!({ "properties": object(&fitting, "")["properties"] });
    let chassis = system.chassis.name();
    let laws: Vec<&str> =
        LAWS.iter().filter(|law| law.chassis.contains(&chassis)).map(|law| law.name).collect();
    let default_drives = laws.contains(&LAW.default);
    let mut controller = json!({ "properties": {
        LAW.name: { "enum": laws },
        STANDBY.name: { "pattern": super::texts::law_or_program(&laws) },
    } });
    if !default_drives {
        controller["required"] = json!([LAW.name]);
        then["required"] = json!(["controller"]);
    }
    then["properties"]["controller"] = controller;
    then
}

/// The kinds of a robot, as a condition: a kind that is absent is the default.
fn condition(system: &System) -> Value {
    let is = |name: &str, default: &str| {
        let mut table = json!({ "properties": { "kind": { "const": name } } });
        if name != default {
            table["required"] = json!(["kind"]);
        }
        table
    };
    let (chassis, motors) = (system.chassis.name(), system.motors.name());
    let mut condition = json!({ "properties": {
        "chassis": is(chassis, CHASSIS.default), "motors": is(motors, MOTORS.default),
    } });
    let named = [("chassis", chassis != CHASSIS.default), ("motors", motors != MOTORS.default)];
    let required: Vec<&str> = named.iter().filter(|(_, named)| *named).map(|(name, _)| *name).collect();
    if !required.is_empty() {
        condition["required"] = json!(required);
    }
    condition
}

/// `if` a system's condition `then` what holds for it, `else` the next.
fn chain(systems: &[System], condition: &dyn Fn(&System) -> Value) -> Value {
    let mut rest = json!({});
    for system in systems.iter().rev() {
        let mut link = json!({ "if": condition(system), "then": of_variant(system) });
        if rest != json!({}) {
            link["else"] = rest;
        }
        rest = link;
    }
    rest
}

/// Two schemas that have no keyword in common as one.
fn merged(mut one: Value, other: Value) -> Value {
    if let (Value::Object(one), Value::Object(other)) = (&mut one, other) {
        one.extend(other);
    }
    one
}
