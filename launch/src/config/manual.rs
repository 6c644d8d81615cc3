//! The table of keys as a page: `docs/configuration.md`, printed by `hilare schema --markdown`.

use super::keys::{Form, Key, Section};
use super::scenario::{CORRECTION, published_specs};
use super::{System, scenario_schema, write};
use hilare_interfaces::params::ParamSpec;
use std::fmt::Write;

const HEAD: &str = "# Configuration

<!-- Printed by `hilare schema --markdown`; do not edit. -->

Every key of a system file (a robot) and of a scenario file (a job). What is left out has its default; everything is SI,
and a name ends in its unit. `--set section.key=value` sets any key of a system on the command line. A key that is not
known, a value of another type, out of its bounds or at odds with another one is refused, with file and line; a value
within its bounds that is most likely in another unit is driven with, and said (`warning: …`).

Editors complete, explain and underline keys with the schemas beside this page, which
`hilare schema` and `hilare schema --scenario` print. With Taplo (VS Code: Even Better TOML) or Tombi, the first line of a file is

    #:schema ./system.schema.json

(a path relative to the file, or an address). What no schema can say, such as two keys that contradict each other, `hilare` says
when it reads the file.

\"Built in\" lists what the built-in robots have instead of the default.

# System files
";

/// The page.
pub fn manual() -> String {
    let mut text = HEAD.to_owned();
    let mut processes: Vec<Section> = Vec::new();
    let built_in: Vec<System> =
        System::builtin_names().filter_map(|name| System::built_in(name).ok()).collect();
    for section in Section::all() {
        if let Section::Realtime(_) = section {
            processes.push(section);
        } else {
            heading(&mut text, section);
            table(&mut text, section, &built_in);
        }
    }
    realtime(&mut text, &processes);
    scenario(&mut text);
    text
}

fn heading(text: &mut String, section: Section) {
    let path = section.path();
    let title = if path.is_empty() { "Top of the file".to_owned() } else { format!("`[{path}]`") };
    let only_for: Vec<String> = section.only_for().iter().map(|condition| format!("`{condition}`")).collect();
    let only_for =
        if only_for.is_empty() { String::new() } else { format!(", if {}", only_for.join(" and ")) };
    let _ = write!(text, "\n## {title}{only_for}\n\n{}\n\n", section.doc());
}

fn table(text: &mut String, section: Section, built_in: &[System]) {
    text.push_str("| key | unit | allowed | default | what it is | built in |\n|---|---|---|---|---|---|\n");
    for key in section.keys() {
        let others: Vec<String> = built_in
            .iter()
            .filter(|system| section.fits(system))
            .map(|system| (system.robot.as_str(), write::value(system, section, &key)))
            .filter(|(_, value)| *value != default(&key))
            .map(|(robot, value)| format!("{robot} {}", cell(&value)))
            .collect();
        let _ = writeln!(text, "{} {} |", row(&key), others.join(", "));
    }
}

/// A line of a table, without what the built-in robots have.
fn row(key: &Key) -> String {
    let (unit, allowed) = match key.form {
        Form::Number(spec) => (spec.unit, allowed(spec)),
        Form::Text(spec) => {
            ("", (spec.choices)().iter().map(|choice| format!("`{choice}`")).collect::<Vec<_>>().join(" "))
        }
    };
    let allowed = if allowed.is_empty() { "text".to_owned() } else { allowed };
    format!("| `{}` | {unit} | {allowed} | {} | {} |", key.name, cell(&default(key)), key.doc())
}

fn allowed(spec: &ParamSpec) -> String {
    match spec.kind {
        hilare_interfaces::params::ParamKind::Switch => "true, false".to_owned(),
        hilare_interfaces::params::ParamKind::Integer => format!("{} to {}, whole", spec.min, spec.max),
        hilare_interfaces::params::ParamKind::Real => format!("{} to {}", spec.min, spec.max),
    }
}

fn default(key: &Key) -> String {
    match key.form {
        Form::Text(spec) => toml::Value::from(spec.default).to_string(),
        Form::Number(spec) => write::number(spec, spec.default),
    }
}

/// Values as code; text keeps its quotes.
fn cell(value: &str) -> String {
    format!("`{value}`")
}

/// The processes' sections are alike but for their defaults.
fn realtime(text: &mut String, processes: &[Section]) {
    let Some(first) = processes.first() else { return };
    text.push_str("\n## `[realtime.PROCESS]`\n\nHow each process is scheduled.\n\n");
    text.push_str("| key | allowed | what it is |\n|---|---|---|\n");
    for spec in first.specs() {
        let _ = writeln!(text, "| `{}` | {} | {} |", spec.name, allowed(spec), spec.doc.trim());
    }
    text.push_str("\nDefaults:\n\n| process |");
    first.specs().iter().for_each(|spec| text.push_str(&format!(" {} |", spec.name)));
    text.push_str("\n|---|---|---|\n");
    for section in processes {
        let path = section.path();
        let _ = write!(text, "| `{}` |", path.strip_prefix("realtime.").unwrap_or(&path));
        section.specs().iter().for_each(|spec| text.push_str(&format!(" {} |", spec.default)));
        text.push('\n');
    }
}

fn scenario(text: &mut String) {
    text.push_str("\n# Scenario files\n\n| key | what it is |\n|---|---|\n");
    let schema = scenario_schema();
    for key in super::scenario::KEYS {
        let doc = schema["properties"][*key]["description"].as_str().unwrap_or_default();
        let _ = writeln!(text, "| `{key}` | {doc} |");
    }
    text.push_str("\n`system` and one of `waypoints_m`, `waypoints_file` and `goal_m` have to be there.\n");
    for (title, specs, required) in [
        ("`[correction]`", CORRECTION.as_slice(), "`cross_track_m` has to be there."),
        ("`[[published]]`", &published_specs(), "`source` has to be there: where the values come from."),
    ] {
        let _ = write!(
            text,
            "\n## {title}\n\n{required}\n\n| key | unit | allowed | what it is |\n|---|---|---|---|\n"
        );
        for spec in specs {
            let _ = writeln!(
                text,
                "| `{}` | {} | {} | {} |",
                spec.name,
                spec.unit,
                allowed(spec),
                spec.doc.trim()
            );
        }
    }
}
