//! Units as `hilare systemd` writes them.

use super::{Lab, text};
use serde_json::Value;
use std::collections::BTreeMap;
use std::process::Command;

/// Text of the units by name.
pub fn units(lab: &Lab, args: &[&str]) -> BTreeMap<String, String> {
    let ended = lab.hilare(&[&["systemd"], args, &["--json"]].concat()).expect_code(0);
    let answer: Value = serde_json::from_str(&ended.stdout).expect("JSON and nothing else");
    let units = answer["units"].as_array().expect("units").iter();
    let units: BTreeMap<_, _> =
        units.map(|unit| (text(unit, "name").to_owned(), text(unit, "text").to_owned())).collect();
    assert!(units.contains_key(text(&answer, "main")), "{answer}");
    units
}

/// Settings of a unit by key; those given several times are joined by a line feed.
pub fn settings(text: &str) -> BTreeMap<String, String> {
    let mut settings = BTreeMap::<String, String>::new();
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    for (key, value) in lines.filter_map(|line| line.split_once('=')) {
        let all = settings.entry(key.to_owned()).or_default();
        all.push_str(if all.is_empty() { "" } else { "\n" });
        all.push_str(value);
    }
    settings
}

/// The command of a unit's `ExecStart=`, in a laboratory's environment instead of the unit's.
pub fn exec_start(lab: &Lab, unit: &str) -> Command {
    let line = settings(unit)["ExecStart"].clone();
    assert!(!line.contains(['"', '%', '$']), "nothing of it needs quoting: {line}");
    let mut words = line.split(' ');
    let mut command = lab.command_of(words.next().expect("a program"));
    command.args(words);
    command
}
