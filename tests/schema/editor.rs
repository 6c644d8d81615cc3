//! The schema an editor reads says what the loader says, and the pages made of it are current. The judge of the
//! schema is Python's jsonschema, and of TOML its tomllib.

use super::mutate::{File, other_units, root, sites, slips, wrong_values};
use super::support::random::Random;
use super::support::{self, Lab, Running, python_with};
use hilare::config::{Form, Key, System, keys};
use hilare_interfaces::params::ParamKind;
use serde_json::Value;
use std::fs;
use std::path::Path;

const COPIES: [(&str, &[&str]); 3] = [
    ("docs/system.schema.json", &["schema"]),
    ("docs/scenario.schema.json", &["schema", "--scenario"]),
    ("docs/configuration.md", &["schema", "--markdown"]),
];

#[test]
fn the_copies_are_what_the_command_prints() {
    let lab = Lab::new();
    for (copy, args) in COPIES {
        let printed = lab.hilare(args).expect_code(0).stdout;
        let text = fs::read_to_string(root().join(copy)).unwrap_or_default();
        assert!(text == printed, "{copy} is out of date: hilare {} --out {copy}", args.join(" "));
    }
    let args = ["schema", "--out", "robot.schema.json"];
    assert_eq!(lab.hilare(&args).expect_code(0).stdout, "");
    let written = fs::read_to_string(lab.dir().join("robot.schema.json")).expect("it was written");
    assert_eq!(written, lab.hilare(&["schema"]).expect_code(0).stdout);
    for wrong in [
        &["schema", "--out", "nowhere/x.json"][..],
        &["schema", "--markdown", "--scenario"],
        &["schema", "--out", "."],
    ] {
        let ended = lab.hilare(wrong).expect_code(2);
        assert_eq!((ended.complaints().len(), &*ended.stdout), (1, ""), "{wrong:?}: {ended:#?}");
    }
}

/// What the schema says of each text; `None` if there is nobody to ask.
fn judged(test: &str, lab: &Lab, scenario: bool, texts: &[String]) -> Option<Vec<String>> {
    let python = python_with(test, "jsonschema, tomllib")?;
    let copy = if scenario { COPIES[1] } else { COPIES[0] };
    let schema = lab.file("schema.json", lab.hilare(copy.1).expect_code(0).stdout);
    let lines: String = texts.iter().map(|text| format!("{}\n", Value::from(text.as_str()))).collect();
    let mut command = lab.command_of(python);
    command.arg(root().join("tests/python/schema_judge.py")).arg(schema).env("PYTHONDONTWRITEBYTECODE", "1");
    command.stdin(fs::File::open(lab.file("texts", lines)).expect("the texts"));
    let ended = Running::start(command).wait(4 * support::PATIENCE).expect_code(0);
    let answers: Vec<String> = ended.stdout.lines().map(str::to_owned).collect();
    assert_eq!(answers.len(), texts.len());
    Some(answers)
}

#[test]
fn every_built_in_file_fits_its_schema() {
    let (lab, name) = (Lab::new(), "every_built_in_file_fits_its_schema");
    for scenario in [false, true] {
        let files: Vec<File> = File::all().into_iter().filter(|file| file.scenario == scenario).collect();
        let texts: Vec<String> = files.iter().map(|file| file.text.clone()).collect();
        let Some(answers) = judged(name, &lab, scenario, &texts) else { return };
        for (file, answer) in files.iter().zip(answers) {
            assert_eq!(answer, "ok", "{}", file.name);
        }
    }
}

/// A built-in robot with every third key somewhere within its bounds, as far as the values fit each other.
fn somebody(random: &mut Random) -> System {
    let name = random.pick(&System::builtin_names().collect::<Vec<_>>());
    let mut system = System::load(name).expect("built in");
    let paths: Vec<String> = keys().map(|key| key.path()).collect();
    for path in paths {
        let Some(key) = system.number_key(&path).filter(|_| random.chance(0.3)) else { continue };
        let Form::Number(spec) = key.form else { continue };
        let at_a_bound = random.pick(&[spec.min, spec.max]);
        let value = if random.chance(0.2) { at_a_bound } else { random.real(spec.min, spec.max) };
        let value = if spec.kind == ParamKind::Real { value } else { value.round() };
        let mut changed = system.clone();
        changed.put(&key, value.clamp(spec.min, spec.max));
        if changed.check().is_ok() {
            system = changed;
        }
    }
    for (key, choices) in texts() {
        let _ = system.set(&format!("{key}={}", random.pick(&choices)));
    }
    system
}

/// Text keys with a choice, kinds of robots aside.
fn texts() -> Vec<(String, Vec<&'static str>)> {
    let of = |key: Key| match key.form {
        Form::Text(spec) if !(spec.choices)().is_empty() => Some((key.path(), (spec.choices)())),
        _ => None,
    };
    keys().filter_map(of).filter(|(key, _)| !["chassis.kind", "motors.kind"].contains(&&**key)).collect()
}

#[test]
fn whatever_the_loader_writes_fits_the_schema() {
    const NAME: &str = "whatever_the_loader_writes_fits_the_schema";
    let (lab, mut random) = (Lab::new(), Random::new(NAME, 31));
    let systems: Vec<System> = (0..300).map(|_| somebody(&mut random)).collect();
    let texts: Vec<String> = systems.iter().map(System::to_toml).collect();
    for (system, text) in systems.iter().zip(&texts) {
        assert_eq!(System::parse("robot.toml", text).as_ref(), Ok(system));
    }
    let Some(answers) = judged(NAME, &lab, false, &texts) else { return };
    for (text, answer) in texts.iter().zip(answers) {
        assert_eq!(answer, "ok", "{text}");
    }
}

/// True of what JSON Schema has no words for: keys at odds with each other, files that are not there, NaN, a path's
/// geometry.
fn beyond_schema(error: &str) -> bool {
    let at_odds = [
        "is above limits",
        "needs more than one step",
        "is above planner.fit",
        "is not below estimator",
        "whole multiple",
        "are both port",
    ];
    let geometry = ["waypoint ", "waypoints_m: ", "cannot be read", "unknown map", "is not built in"];
    let known = |words: &[&str]| words.iter().any(|word| error.contains(word));
    known(&at_odds) || known(&geometry) || error.contains("must be a finite number")
}

#[test]
fn what_the_loader_refuses_the_schema_refuses() {
    const NAME: &str = "what_the_loader_refuses_the_schema_refuses";
    let lab = Lab::new();
    for scenario in [false, true] {
        let (mut texts, mut verdicts) = (Vec::new(), Vec::new());
        for file in File::all().iter().filter(|file| file.scenario == scenario) {
            for text in mutants(file) {
                verdicts.push((file.name.clone(), file.read(&text).map(drop)));
                texts.push(text);
            }
        }
        let Some(answers) = judged(NAME, &lab, scenario, &texts) else { return };
        let mut beyond = 0;
        let mut differ = Vec::new();
        for ((file, verdict), answer) in verdicts.iter().zip(&answers) {
            match verdict {
                Ok(()) if answer == "ok" => {}
                Ok(()) => differ.push(format!("{file}: read, and the schema says {answer}")),
                Err(error) if answer == "ok" && beyond_schema(error) => beyond += 1,
                Err(error) if answer == "ok" => differ.push(format!("the schema takes it: {error}")),
                Err(error) => {
                    let syntax = error.contains("not TOML") || error.contains("a second time");
                    if (answer == "not TOML") != syntax {
                        differ.push(format!("{error}, and Python says {answer}"));
                    }
                }
            }
        }
        let shown = differ.iter().take(40).cloned().collect::<Vec<_>>().join("\n");
        assert!(differ.is_empty(), "{} of {} differ:\n{shown}", differ.len(), texts.len());
        println!("{} texts, {beyond} refused by the loader alone", texts.len());
        assert!(texts.len() > 1000 && beyond * 4 < texts.len(), "{beyond} of {}", texts.len());
    }
}

/// The file with one mistake, of every kind.
fn mutants(file: &File) -> Vec<String> {
    let (sites, headers) = sites(file);
    // The schema knows no names but those of its keys: it takes fewer slips than the loader.
    let stride = 5 * file.stride();
    let mut texts = Vec::new();
    for site in &sites {
        let (name, value) = (&file.text[site.name.clone()], &file.text[site.value.clone()]);
        texts.extend(slips(name).iter().step_by(stride).map(|slip| file.with(&site.name, slip)));
        let Some(form) = site.form else { continue };
        let (types, beyond) = wrong_values(&form, value);
        let types = types.iter().step_by(file.stride());
        texts.extend(types.chain(&beyond).map(|wrong| file.with(&site.value, wrong)));
        match form {
            Form::Number(spec) => {
                texts.extend(
                    other_units(name, spec).iter().step_by(stride).map(|other| file.with(&site.name, other)),
                );
                // Right at a bound, and a hair beyond.
                let edges = [spec.min, spec.max, spec.max.next_up(), spec.min.next_down()];
                let edges = edges.iter().filter(|_| spec.kind == ParamKind::Real);
                texts.extend(edges.map(|edge| file.with(&site.value, &format!("{edge:?}"))));
            }
            Form::Text(_) => {
                let plain = value.trim_matches('"');
                texts.extend(slips(plain).iter().map(|slip| file.with(&site.value, &format!("\"{slip}\""))));
            }
        }
    }
    for header in &headers {
        texts.extend(
            slips(&file.text[header.clone()]).iter().step_by(stride).map(|slip| file.with(header, slip)),
        );
    }
    texts
}

/// Where the repository's own files are edited, the schemas are found.
#[test]
fn the_repository_tells_taplo_where_the_schemas_are() {
    let config: toml::Table =
        fs::read_to_string(root().join(".taplo.toml")).expect("a configuration").parse().expect("TOML");
    let rules = config["rule"].as_array().expect("rules");
    for (copy, _) in &COPIES[..2] {
        assert!(rules.iter().any(|rule| rule["schema"]["path"].as_str() == Some(copy)), "{copy}");
        assert!(Path::new(root()).join(copy).is_file(), "{copy}");
    }
}
