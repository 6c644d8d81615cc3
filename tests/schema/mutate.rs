//! The built-in files and what people do to them.

use hilare::config::{Form, Key, Scenario, System, keys};
use hilare_interfaces::params::{ParamKind, ParamSpec};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A system or scenario file.
pub struct File {
    /// Name in errors.
    pub name: String,
    /// True of a scenario.
    pub scenario: bool,
    /// What stands in it.
    pub text: String,
}

/// What the loader makes of a file: what it refuses, or what it warns of.
pub type Verdict = Result<Vec<String>, String>;

impl File {
    /// Every system and scenario that is built in, and every key there is: the systems written out in full.
    pub fn all() -> Vec<Self> {
        let mut files = Vec::new();
        for (folder, scenario) in [("launch/systems", false), ("launch/scenarios", true)] {
            let mut paths: Vec<PathBuf> = fs::read_dir(root().join(folder))
                .expect(folder)
                .flatten()
                .map(|entry| entry.path())
                .collect();
            paths.sort();
            for path in paths.iter().filter(|path| path.extension().is_some_and(|end| end == "toml")) {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                files.push(Self { name, scenario, text: fs::read_to_string(path).expect("a file") });
            }
        }
        // epuck.toml has every key as it is.
        for name in System::builtin_names().filter(|name| *name != "epuck") {
            let text = System::load(name).expect("built in").to_toml();
            files.push(Self { name: format!("all-of-{name}.toml"), scenario: false, text });
        }
        files
    }

    /// Written by a person, not in full by a machine.
    pub fn by_hand(&self) -> bool {
        !self.name.starts_with("all-of-")
    }

    /// Of so many mistakes one is made: files written in full have the keys of the others once more.
    pub fn stride(&self) -> usize {
        if self.by_hand() { 1 } else { 5 }
    }

    /// What the loader, and whoever loads the map, says of another text in its place.
    pub fn read(&self, text: &str) -> Verdict {
        let folder = root().join("launch/scenarios");
        let (system, warnings) = if self.scenario {
            let scenario = Scenario::parse(&self.name, text, &folder).map_err(|error| error.to_string())?;
            let warnings = scenario.warnings();
            (scenario.system, warnings)
        } else {
            let system = System::parse(&self.name, text).map_err(|error| error.to_string())?;
            let warnings = system.warnings();
            (system, warnings)
        };
        system.load_map().map_err(|error| error.to_string())?;
        Ok(warnings)
    }

    /// The robot it is about.
    pub fn system(&self) -> System {
        if self.scenario {
            let folder = root().join("launch/scenarios");
            Scenario::parse(&self.name, &self.text, &folder).expect("a scenario").system
        } else {
            System::parse(&self.name, &self.text).expect("a system")
        }
    }

    /// Its text with a piece replaced.
    pub fn with(&self, at: &Range<usize>, text: &str) -> String {
        format!("{}{text}{}", &self.text[..at.start], &self.text[at.end..])
    }

    /// Line of a place, from 1.
    pub fn line(&self, at: usize) -> usize {
        1 + self.text[..at].matches('\n').count()
    }
}

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A key of a file where it stands.
pub struct Site {
    /// Section, as it stands in the file: `set.planner`, `published`.
    pub section: String,
    /// Where the key is.
    pub name: Range<usize>,
    /// Where its value is.
    pub value: Range<usize>,
    /// What it takes, if it is a key of the system or one of a scenario's numbers.
    pub form: Option<Form>,
}

impl Site {
    /// Section and key as `--set` takes them.
    pub fn path(&self, file: &File) -> String {
        let section = self.section.strip_prefix("set").unwrap_or(&self.section).trim_start_matches('.');
        let name = &file.text[self.name.clone()];
        if section.is_empty() { name.to_owned() } else { format!("{section}.{name}") }
    }
}

/// Every key of a file, and every header of a section.
pub fn sites(file: &File) -> (Vec<Site>, Vec<Range<usize>>) {
    let (mut found, mut headers) = (Vec::new(), Vec::new());
    let system = file.system();
    let (mut section, mut offset) = (String::new(), 0);
    for line in file.text.split_inclusive('\n') {
        let (at, trimmed) = (offset, line.trim_end());
        offset += line.len();
        // Comments and what goes on over several lines.
        if trimmed.starts_with(['#', ' ', ']']) || trimmed.is_empty() {
            continue;
        }
        let code = &trimmed[..end_of_value(trimmed)];
        if code.starts_with('[') {
            let inner = code.trim_matches(['[', ']']);
            section = inner.to_owned();
            let start = at + code.find(inner).unwrap_or(0);
            headers.push(start..start + inner.len());
            continue;
        }
        let Some((name, value)) = code.split_once('=') else { panic!("{}: {line}", file.name) };
        let begin = at + name.len() + 1 + (value.len() - value.trim_start().len());
        let range = begin..begin + value.trim().len();
        if value.trim().starts_with('{') {
            let inner = format!("{section}.{}", name.trim());
            let mut at = begin + 1;
            for pair in value.trim().trim_matches(['{', '}']).split(',') {
                let (key, value) = pair.split_once('=').expect("a pair");
                let name = at + (key.len() - key.trim_start().len());
                let begin = at + key.len() + 1 + (value.len() - value.trim_start().len());
                found.push(site(
                    file,
                    &system,
                    &inner,
                    name..name + key.trim().len(),
                    begin..begin + value.trim().len(),
                ));
                at += pair.len() + 1;
            }
        }
        found.push(site(file, &system, &section, at..at + name.trim_end().len(), range));
    }
    (found, headers)
}

fn site(file: &File, system: &System, section: &str, name: Range<usize>, value: Range<usize>) -> Site {
    let mut site = Site { section: section.to_owned(), name, value, form: None };
    let path = site.path(file);
    let fits =
        |key: &Key| key.path() == path && system.number_key(&path).is_none_or(|own| own.doc() == key.doc());
    let of_system = !file.scenario || section.starts_with("set") || section == "start";
    site.form = keys().find(|key| of_system && fits(key)).map(|key| key.form);
    site
}

/// Where a comment begins, or the line ends.
fn end_of_value(line: &str) -> usize {
    let mut quoted = false;
    for (at, letter) in line.char_indices() {
        match letter {
            '"' => quoted = !quoted,
            '#' if !quoted => return line[..at].trim_end().len(),
            _ => {}
        }
    }
    line.len()
}

/// Slips of the fingers in a name: a letter too few, twice, in the other order, a capital, an underscore.
pub fn slips(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let count = letters.len();
    let mut wrong =
        vec![name.to_uppercase(), name.replace('_', "-"), name.replace('_', ""), format!("{name}_")];
    for at in 0..letters.len() {
        let edited = |edit: &dyn Fn(&mut Vec<char>)| {
            let mut letters = letters.clone();
            edit(&mut letters);
            letters.into_iter().collect::<String>()
        };
        wrong.push(edited(&|letters| {
            letters.remove(at);
        }));
        wrong.push(edited(&|letters| letters.insert(at, letters[at])));
        wrong.push(edited(&|letters| letters[at] = letters[at].to_ascii_uppercase()));
        wrong.push(edited(&|letters| letters.swap(at, (at + 1) % count)));
    }
    wrong.retain(|slip| slip != name && !slip.is_empty());
    wrong.sort();
    wrong.dedup();
    wrong
}

const UNITS: [&str; 14] = [
    "_mm", "_cm", "_deg", "_ms", "_us", "_percent", "_rpm", "_degps", "_mmps", "_kmh", "_hz", "_m", "_rad",
    "_s",
];

/// The name with another unit at its end, or none.
pub fn other_units(name: &str, spec: &ParamSpec) -> Vec<String> {
    let ending = match spec.unit {
        "m" => "_m",
        "m/s" => "_mps",
        "m/s^2" => "_mps2",
        "rad" => "_rad",
        "rad/s" => "_radps",
        "rad/s^2" => "_radps2",
        "s" => "_s",
        "ticks" => "_ticks",
        "us" => "_us",
        "ms" => "_ms",
        "Hz" => "_hz",
        _ => "",
    };
    let Some(stem) = name.strip_suffix(ending).filter(|_| !ending.is_empty()) else {
        return UNITS.iter().map(|unit| format!("{name}{unit}")).collect();
    };
    let others = UNITS.iter().filter(|unit| **unit != ending).map(|unit| format!("{stem}{unit}"));
    others.chain([stem.to_owned()]).collect()
}

/// Values of a type that the key does not take, and values out of its bounds.
pub fn wrong_values(form: &Form, value: &str) -> (Vec<String>, Vec<String>) {
    let text = |values: &[&str]| values.iter().map(|value| (*value).to_owned()).collect::<Vec<_>>();
    let mut types = vec![format!("[{value}]"), format!("{{ value = {value} }}")];
    types.extend(text(&["", "1979-05-27", "nil"]));
    let Form::Number(spec) = form else {
        types.extend(text(&["1", "true", "nan"]));
        return (types, Vec::new());
    };
    types.push(format!("\"{value}\""));
    if spec.kind == ParamKind::Switch {
        types.extend(text(&["1", "0", "1.0", "\"yes\"", "yes", "True", "nan"]));
        return (types, Vec::new());
    }
    types.extend(text(&["true", "nan", "inf", "-inf", "0,5", "1_0_"]));
    types.push(format!("{value} {}", spec.unit));
    types.retain(|wrong| wrong.trim() != value);
    if spec.kind == ParamKind::Integer {
        types.push(format!("{value}.5"));
    }
    let span = spec.max - spec.min;
    let beyond = [
        spec.max + span,
        spec.max * 1e6 + span,
        spec.min - span.min(1e-3) - f64::from(u8::from(spec.kind == ParamKind::Integer)),
    ];
    (types, beyond.map(|value| format!("{value:?}")).to_vec())
}

/// How much larger the number is for a value given in a unit that the key's is taken for.
pub fn wrong_units(spec: &ParamSpec) -> &'static [(&'static str, f64)] {
    match spec.unit {
        "m" | "m/sqrt(m)" => &[("mm", 1e3), ("cm", 1e2)],
        "m/s" => &[("mm/s", 1e3), ("cm/s", 1e2)],
        "m/s^2" => &[("mm/s^2", 1e3), ("cm/s^2", 1e2)],
        "rad" => &[("degrees", 57.295_779_513)],
        "rad/s" => &[("degrees/s", 57.295_779_513), ("rpm", 9.549_296_585)],
        "rad/s^2" => &[("degrees/s^2", 57.295_779_513)],
        "s" => &[("ms", 1e3), ("us", 1e6)],
        "ticks" => &[("us", 1e3), ("s", 1e-3)],
        "ms" => &[("us", 1e3), ("s", 1e-3)],
        "us" => &[("ns", 1e3), ("ms", 1e-3)],
        "Hz" => &[("kHz", 1e-3), ("mHz", 1e3)],
        "1/s" => &[("1/ms", 1e-3)],
        "1/m" => &[("1/mm", 1e-3), ("1/cm", 1e-2)],
        "1/m^2" => &[("1/mm^2", 1e-6), ("1/cm^2", 1e-4)],
        "1/rad" => &[("1/degree", 1.0 / 57.295_779_513)],
        // Shares in percent; a weight has no unit that it could be taken for.
        "" | "1/sqrt(m)" if spec.kind == ParamKind::Real && spec.name != "smooth" => &[("percent", 1e2)],
        _ => &[],
    }
}
