//! What was meant: near names, names in other sections, names with another unit.

use super::System;
use super::assign::split_key;
use super::error::{clipped, quoted};
use super::keys::{Form, Key, Section, join, keys};
use super::texts::{LAW, TextSpec};

/// Names at least this alike (1 the same, 0 nothing in common) are worth a question.
const ALIKE: f64 = 0.5;
/// The same in other sections, where a chance likeness is likelier.
const ALIKE_ELSEWHERE: f64 = 0.7;
/// Longer names are no typing error of ours.
const MAX_NAME: usize = 64;

/// Units as names end in them, the longer ones first.
const SUFFIXES: &[&str] = &[
    "_per_mm2", "_per_cm2", "_per_m2", "_per_mm", "_per_cm", "_per_ms", "_per_m", "_per_s", "_radps2",
    "_degps2", "_radps", "_degps", "_mmps2", "_mmps", "_cmps", "_kmph", "_mps2", "_ticks", "_mrad", "_kmh",
    "_mps", "_rad", "_deg", "_dps", "_rpm", "_rps", "_inch", "_mm", "_cm", "_km", "_um", "_in", "_ms", "_us",
    "_ns", "_hz", "_m", "_s",
];

/// What a name can be: `; did you mean "…"? label: …`, or only the list.
pub(super) fn choices(name: &str, label: &str, known: &[&str]) -> String {
    let list = known.join(", ");
    match nearest(name, known.iter(), |known| known, ALIKE) {
        Some(guess) => format!("; did you mean \"{guess}\"? {label}: {list}"),
        None => format!("; {label}: {list}"),
    }
}

/// The most alike of `known`, if alike enough; the first of equals.
fn nearest<T>(
    name: &str,
    known: impl Iterator<Item = T>,
    text: impl Fn(&T) -> &str,
    alike: f64,
) -> Option<T> {
    if name.len() > MAX_NAME {
        return None;
    }
    let name = name.to_lowercase();
    let mut best = None;
    for item in known {
        let score = strsim::normalized_damerau_levenshtein(&name, text(&item));
        if score >= alike && best.as_ref().is_none_or(|(best, _)| score > *best) {
            best = Some((score, item));
        }
    }
    best.map(|(_, item)| item)
}

/// About a key its section does not have.
pub(super) fn unknown_key(prefix: &str, section: Section, system: &System, name: &str) -> String {
    let path = section.path();
    let place = if path.is_empty() { String::new() } else { format!(" in [{prefix}{path}]") };
    format!("unknown key {}{place}{}", quoted(name), meant(section, system, name))
}

fn meant(section: Section, system: &System, name: &str) -> String {
    if let Some(key) = same_but_unit(name, section.keys()) {
        return format!("; the key is {}, {}", key.name, unit_in_words(&key));
    }
    let others = || keys().filter(|key| key.section != section);
    let namesake = others().find(|key| key.name == name);
    if namesake.is_none()
        && let Some(key) = nearest(name, section.keys(), |key| key.name, ALIKE)
    {
        return format!("; did you mean \"{}\"{}?", key.name, unit_in_brackets(&key));
    }
    let elsewhere = namesake
        .or_else(|| same_but_unit(name, others()))
        .or_else(|| nearest(name, others(), |key| key.name, ALIKE_ELSEWHERE));
    match elsewhere {
        Some(key) => match key.section.missing_for(system) {
            Some(condition) => format!("; \"{}\" belongs to {condition}", key.path()),
            None => format!("; did you mean \"{}\"{}?", key.path(), unit_in_brackets(&key)),
        },
        None => {
            let names: Vec<&str> = section.keys().map(|key| key.name).collect();
            let sections = if section == Section::Top {
                format!("; and the sections {}", below("").join(", "))
            } else {
                String::new()
            };
            format!("; known there: {}{sections}", names.join(", "))
        }
    }
}

/// About a word that is in the name of no key of a system.
pub(super) fn unknown_word(system: &System, word: &str) -> String {
    let sections: Vec<String> =
        Section::all().filter(|section| section.fits(system)).map(Section::path).collect();
    let known = sections.iter().map(String::as_str).chain(system.own_keys().map(|key| key.name));
    let meant = nearest(word, known, |name| name, ALIKE);
    let meant = meant.map_or_else(String::new, |name| format!("; did you mean \"{name}\"?"));
    format!("no key is called like {}{meant}", quoted(word))
}

/// Names of the tables right below a path.
fn below(path: &str) -> Vec<String> {
    let mut names: Vec<String> = Section::all()
        .filter_map(|section| {
            let known = section.path();
            let rest = if path.is_empty() { &known } else { known.strip_prefix(path)?.strip_prefix('.')? };
            rest.split('.').next().filter(|name| !name.is_empty()).map(str::to_owned)
        })
        .collect();
    names.dedup();
    names
}

/// About a section nobody has.
pub(super) fn unknown_section(prefix: &str, path: &str) -> String {
    let (parent, name) = split_key(path);
    let shown = format!("{prefix}{}", clipped(path));
    let siblings = below(parent);
    if siblings.is_empty() {
        return format!("unknown section [{shown}]; known: {}", below("").join(", "));
    }
    match nearest(name, siblings.iter(), |sibling| sibling, ALIKE) {
        Some(sibling) => {
            format!("unknown section [{shown}]; did you mean [{prefix}{}]?", join(parent, sibling))
        }
        None => {
            let place = if parent.is_empty() { String::new() } else { format!(" in [{prefix}{parent}]") };
            format!("unknown section [{shown}]; known{place}: {}", siblings.join(", "))
        }
    }
}

/// About a key where no section is, or one that holds sections only.
pub(super) fn unknown_in_no_section(prefix: &str, path: &str, name: &str) -> String {
    let sections = below(path);
    if sections.is_empty() {
        return unknown_section(prefix, path);
    }
    let sections = sections.join(", ");
    format!("unknown key {} in [{prefix}{path}]; only sections stand there: {sections}", quoted(name))
}

/// About a text that is none of the choices.
pub(super) fn unknown_choice(spec: &TextSpec, text: &str) -> String {
    if spec.name == LAW.name && text.contains('.') {
        return format!(
            "unknown law {}; a program is named with its folder: {}",
            quoted(text),
            quoted(&format!("./{text}"))
        );
    }
    format!("unknown {} {}{}", spec.name, quoted(text), choices(text, "known", &(spec.choices)()))
}

/// The key that is called like `name` but for the unit at its end.
fn same_but_unit(name: &str, known: impl Iterator<Item = Key>) -> Option<Key> {
    let (stem, suffix) = split_unit(name);
    let angular = ["rad", "deg", "dps", "rpm", "rps"].iter().any(|unit| suffix.contains(unit));
    let mut alike = known.filter(|key| split_unit(key.name).0 == stem && matches!(key.form, Form::Number(_)));
    let first = alike.next()?;
    // Lengths and angles may share a stem: start_sd_m, start_sd_rad.
    if unit(&first).starts_with("rad") == angular {
        return Some(first);
    }
    Some(alike.find(|key| unit(key).starts_with("rad") == angular).unwrap_or(first))
}

fn split_unit(name: &str) -> (&str, &str) {
    let cut = SUFFIXES.iter().find_map(|suffix| name.strip_suffix(suffix)).unwrap_or(name);
    name.split_at(cut.len())
}

fn unit(key: &Key) -> &'static str {
    match key.form {
        Form::Number(spec) => spec.unit,
        Form::Text(_) => "",
    }
}

fn unit_in_brackets(key: &Key) -> String {
    let unit = unit(key);
    if unit.is_empty() { String::new() } else { format!(" ({unit})") }
}

fn unit_in_words(key: &Key) -> String {
    let words = match unit(key) {
        "" => return "a pure number".to_owned(),
        "m" => "metres",
        "m/s" => "metres per second",
        "m/s^2" => "metres per second squared",
        "rad" => "radians",
        "rad/s" => "radians per second",
        "rad/s^2" => "radians per second squared",
        "s" => "seconds",
        "ticks" => "ticks of 1 ms",
        unit => unit,
    };
    format!("in {words}")
}
