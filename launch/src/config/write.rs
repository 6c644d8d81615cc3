//! A system back into a file.

use super::System;
use super::assign::{range, text_value};
use super::keys::{Form, Key, Section};
use hilare_interfaces::params::{ParamKind, ParamSpec};
use std::fmt::Write;

/// The whole system, every key with its meaning, unit and bounds.
pub(super) fn to_toml(system: &System) -> String {
    let mut text =
        String::from("# A robot of hilare, every key. SI units; a key that is left out has its default.\n");
    let mut explained: Vec<&str> = Vec::new();
    for section in Section::all().filter(|section| section.fits(system)) {
        let path = section.path();
        if !path.is_empty() {
            let _ = write!(text, "\n[{path}]\n");
        }
        for key in section.keys() {
            // The seven real-time sections are alike: once is enough.
            if !explained.contains(&key.doc()) {
                explained.push(key.doc());
                let _ = writeln!(text, "# {}{}", key.doc(), allowed(&key));
            }
            let _ = writeln!(text, "{} = {}", key.name, value(system, section, &key));
        }
    }
    text
}

fn allowed(key: &Key) -> String {
    match key.form {
        Form::Number(ParamSpec { kind: ParamKind::Switch, .. }) => " true or false.".to_owned(),
        Form::Number(spec) => format!(" {}.", range(spec)),
        Form::Text(spec) => {
            let choices = (spec.choices)();
            if choices.is_empty() { String::new() } else { format!(" One of {}.", choices.join(", ")) }
        }
    }
}

/// The value of a key, as it stands in a file.
pub(super) fn value(system: &System, section: Section, key: &Key) -> String {
    match key.form {
        Form::Text(spec) => toml::Value::from(text_value(system, section, spec)).to_string(),
        Form::Number(spec) => number(spec, section.get(system, key.name).unwrap_or(spec.default)),
    }
}

/// A number or switch, as it stands in a file.
pub(super) fn number(spec: &ParamSpec, value: f64) -> String {
    match spec.kind {
        ParamKind::Switch => (value != 0.0).to_string(),
        ParamKind::Integer => format!("{value}"),
        // The shortest text that reads back to the same bits.
        ParamKind::Real => format!("{value:?}"),
    }
}
