//! One value into one key, whatever door it comes through.

use super::document::{Document, Entry, Value};
use super::error::{ConfigError, quoted};
use super::keys::{Form, Section, join, keys};
use super::texts::{
    AS_THE_LAW_ASKS, EXEC, FOXGLOVE, FOXGLOVE_ORIGINS, GO_ON, LAW, ON_LOST, STANDBY, STOP, TextSpec,
};
use super::{System, conflict, suggest, units};
use hilare_controller::law;
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::motors::{Motors, ServoParams, StepperParams};
use hilare_interfaces::params::{ParamError, ParamKind, ParamSpec};
use hilare_pose_estimator::EstimatorKind;

/// Applies a file's entries to a system and checks the outcome. Text goes first, because the kind of the
/// chassis decides which keys there are.
pub(super) fn apply(
    system: &mut System,
    file: &Document<'_>,
    entries: Vec<Entry<'_>>,
) -> Result<(), ConfigError> {
    let (texts, others): (Vec<_>, Vec<_>) =
        entries.into_iter().partition(|entry| is_text_key(&entry.section, entry.name));
    for entry in texts.iter().chain(&others) {
        assign(system, entry).map_err(|what| file.error(entry.offset, what))?;
        system.places.note(join(&entry.section, entry.name), || file.place(entry.offset));
    }
    let Some(conflict) = conflict::find(system) else { return Ok(()) };
    let guilty = texts.iter().chain(&others).filter(|entry| conflict.involves(&entry.section, entry.name));
    Err(match guilty.map(|entry| entry.offset).max() {
        Some(offset) => file.error(offset, conflict.what),
        None => file.error_of_file(conflict.what),
    })
}

/// Applies `KEY=VALUE` assignments to a system and checks the outcome.
pub(super) fn apply_assignments<S: AsRef<str>>(
    system: &mut System,
    assignments: &[S],
) -> Result<(), ConfigError> {
    let mut parsed = Vec::new();
    for assignment in assignments {
        let assignment = assignment.as_ref();
        let place = format!("--set {assignment}");
        let Some((key, value)) = assignment.split_once('=') else {
            return Err(ConfigError::new(place, "write KEY=VALUE, for example plant.slip_mean=0.05"));
        };
        let (section, name) = split_key(key.trim());
        let value = Value::Word(value.trim());
        parsed.push((place, Entry { prefix: "", section: section.to_owned(), name, value, offset: 0 }));
    }
    let (texts, others): (Vec<_>, Vec<_>) =
        parsed.into_iter().partition(|(_, entry)| is_text_key(&entry.section, entry.name));
    for (place, entry) in texts.iter().chain(&others) {
        assign(system, entry).map_err(|what| ConfigError::new(place, what))?;
        system.places.note(join(&entry.section, entry.name), || place.clone());
    }
    let conflict = conflict::find(system).or_else(|| conflict::programs(system));
    let Some(conflict) = conflict else { return Ok(()) };
    let guilty =
        texts.iter().chain(&others).rfind(|(_, entry)| conflict.involves(&entry.section, entry.name));
    Err(match guilty {
        Some((place, _)) => ConfigError::new(place, conflict.what),
        None => ConfigError::new(&system.robot, conflict.what),
    })
}

/// Checks a system that did not come from a file, or says what is wrong with it.
pub(super) fn check_all(system: &System) -> Result<(), String> {
    check_robot_name(&system.robot)?;
    for key in keys().filter(|key| key.section.fits(system)) {
        if let Form::Number(spec) = key.form {
            let value = key.section.get(system, key.name).unwrap_or(f64::NAN);
            spec.check(value).map_err(|error| format!("{}: {}", key.path(), refusal(spec, error)))?;
        }
    }
    conflict::find(system).map_or(Ok(()), |conflict| Err(conflict.what))
}

/// Section and name of a full key.
pub(super) fn split_key(key: &str) -> (&str, &str) {
    key.rsplit_once('.').unwrap_or(("", key))
}

fn is_text_key(section: &str, name: &str) -> bool {
    Section::all().any(|known| known.path() == section && known.text(name).is_some())
}

/// Sets one key, or says what is wrong with it.
fn assign(system: &mut System, entry: &Entry<'_>) -> Result<(), String> {
    let Entry { prefix, section: path, name, value, .. } = entry;
    if let Some(child) = Section::child(path, name) {
        return match value {
            Value::Section => Ok(()),
            _ => {
                Err(format!("{prefix}{child} is a section; write [{prefix}{child}] once and its keys below"))
            }
        };
    }
    let Some(section) = Section::of(path, system) else {
        return Err(match value {
            Value::Section => unknown_table(prefix, path, name),
            _ => suggest::unknown_in_no_section(prefix, path, name),
        });
    };
    let full = format!("{prefix}{}", join(path, name));
    let known = section.keys().any(|key| key.name == *name);
    if *value == Value::Section {
        return Err(if known {
            format!("{full} is a key, not a section; write {name} = VALUE in [{prefix}{path}]")
        } else {
            unknown_table(prefix, path, name)
        });
    }
    if let Some(text) = section.text(name) {
        return put_text(system, section, text, value).map_err(|what| format!("{full}: {what}"));
    }
    let Some(spec) = section.specs().iter().find(|spec| spec.name == *name) else {
        return Err(suggest::unknown_key(prefix, section, system, name));
    };
    let number = check_number(spec, value).map_err(|what| format!("{full}: {what}"))?;
    section.put(system, name, number);
    Ok(())
}

fn unknown_table(prefix: &str, path: &str, name: &str) -> String {
    if name.contains('.') {
        return format!("unknown section {} in quotes; dots separate only outside of quotes", quoted(name));
    }
    suggest::unknown_section(prefix, &join(path, name))
}

/// The number of a value that fits its key, or what is wrong with it.
pub(super) fn check_number(spec: &'static ParamSpec, value: &Value<'_>) -> Result<f64, String> {
    let number = match (spec.kind, value) {
        (ParamKind::Switch, Value::Switch(on)) => return Ok(f64::from(u8::from(*on))),
        (ParamKind::Switch, Value::Word("true")) => return Ok(1.0),
        (ParamKind::Switch, Value::Word("false")) => return Ok(0.0),
        (ParamKind::Switch, _) => return Err(format!("{} is not true or false", value.describe())),
        (_, Value::Number(number)) => *number,
        (_, Value::Word(word)) => match word.parse() {
            Ok(number) => number,
            Err(_) => return Err(format!("{} is not a number ({})", quoted(word), range(spec))),
        },
        (_, Value::Text(text)) => {
            return Err(format!("{} is text; write a number without quotes, {}", quoted(text), range(spec)));
        }
        (_, Value::Switch(_) | Value::Section | Value::Other(_)) => {
            return Err(format!("{} is not a number ({})", value.describe(), range(spec)));
        }
    };
    spec.check(number).map_err(|error| refusal(spec, error))
}

fn refusal(spec: &ParamSpec, error: ParamError) -> String {
    match error {
        ParamError::NotFinite | ParamError::NotInteger => format!("{error}, {}", range(spec)),
        ParamError::OutOfBounds { value, .. } => {
            let text = error.to_string();
            // What was meant may be said already.
            let hint = if text.contains("did you mean") {
                None
            } else {
                units::meant(units::unit_of(spec), value, spec.min..=spec.max)
            };
            text + &hint.unwrap_or_default()
        }
        // Pure numbers have no unit to print.
        _ => error.to_string().replace("  ", " ").trim_end().to_owned(),
    }
}

/// What a key allows.
pub(super) fn range(spec: &ParamSpec) -> String {
    format!("{} to {} {}", spec.min, spec.max, spec.unit).trim_end().to_owned()
}

fn put_text(system: &mut System, section: Section, spec: &TextSpec, value: &Value<'_>) -> Result<(), String> {
    let (Value::Text(text) | Value::Word(text)) = *value else {
        return Err(format!("{} is not text; write it in quotes", value.describe()));
    };
    let unknown = || suggest::unknown_choice(spec, text);
    match section {
        Section::Top => {
            check_robot_name(text)?;
            system.robot = text.to_owned();
        }
        Section::Planner => system.map = text.to_owned(),
        Section::Operator if spec.name == ON_LOST.name => {
            system.stop_when_lost = match text {
                GO_ON => false,
                STOP => true,
                _ => return Err(unknown()),
            }
        }
        Section::Operator if spec.name == FOXGLOVE.name => {
            if !text.is_empty() {
                loopback(text)?;
            }
            system.foxglove = text.to_owned();
        }
        Section::Operator if spec.name == FOXGLOVE_ORIGINS.name => {
            origins(text)?;
            system.foxglove_origins = text.to_owned();
        }
        Section::Operator => {
            if !text.is_empty() {
                hilare_operator::address::parse(text)?;
            }
            system.listen = text.to_owned();
        }
        Section::Controller if spec.name == EXEC.name => system.controller.exec = text.to_owned(),
        Section::Controller if spec.name == STANDBY.name => {
            if !(text.is_empty() || text.contains('/')) {
                law(text).ok_or_else(|| suggest::unknown_choice(&LAW, text))?;
            }
            system.controller.standby = text.to_owned();
        }
        Section::Controller => system.controller.law = law(text).ok_or_else(unknown)?,
        Section::Estimator => system.estimator = EstimatorKind::from_name(text).ok_or_else(unknown)?,
        Section::Tracking if text == AS_THE_LAW_ASKS => system.acceptance = None,
        Section::Tracking => system.acceptance = Some(Acceptance::from_name(text).ok_or_else(unknown)?),
        Section::Stepper | Section::Servo if text == system.motors.name() => {}
        Section::Stepper | Section::Servo => {
            system.motors = match text {
                "stepper" => Motors::Stepper(StepperParams::default()),
                "servo" => Motors::Servo(ServoParams::default()),
                _ => return Err(unknown()),
            };
        }
        _ if text == system.chassis.name() => {}
        _ => {
            system.chassis = match text {
                "differential" => Chassis::Differential(DifferentialParams::default()),
                "mecanum" => Chassis::Mecanum(MecanumParams::default()),
                _ => return Err(unknown()),
            };
        }
    }
    Ok(())
}

/// The value of a text key.
pub(super) fn text_value<'s>(system: &'s System, section: Section, spec: &TextSpec) -> &'s str {
    match section {
        Section::Top => &system.robot,
        Section::Planner => &system.map,
        Section::Operator if spec.name == ON_LOST.name && system.stop_when_lost => STOP,
        Section::Operator if spec.name == ON_LOST.name => GO_ON,
        Section::Operator if spec.name == FOXGLOVE.name => &system.foxglove,
        Section::Operator if spec.name == FOXGLOVE_ORIGINS.name => &system.foxglove_origins,
        Section::Operator => &system.listen,
        Section::Controller if spec.name == EXEC.name => &system.controller.exec,
        Section::Controller if spec.name == STANDBY.name => &system.controller.standby,
        Section::Controller => system.controller.law.name,
        Section::Estimator => system.estimator.name(),
        Section::Tracking => system.acceptance.map_or(AS_THE_LAW_ASKS, Acceptance::name),
        Section::Stepper | Section::Servo => system.motors.name(),
        _ => system.chassis.name(),
    }
}

/// Refuses an address of the live view that other machines reach.
fn loopback(text: &str) -> Result<(), String> {
    // The example at the end is the page's.
    let example = |why: String| why.strip_suffix("7070").map_or(why.clone(), |why| format!("{why}8765"));
    let address = hilare_operator::address::parse(text).map_err(example)?;
    if !hilare_operator::address::is_open(address) {
        return Ok(());
    }
    let port = address.port();
    Err(format!(
        "{text}: others would reach it, and its protocol knows no password; listen on 127.0.0.1:{port}, and from \
         elsewhere come by ssh -L {port}:127.0.0.1:{port} ROBOT"
    ))
}

/// Refuses what is no list of origins.
fn origins(text: &str) -> Result<(), String> {
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
    let is_scheme = |scheme: &str| {
        scheme.starts_with(|first: char| first.is_ascii_lowercase())
            && scheme.bytes().all(|byte| plain(byte) || b"+.-".contains(&byte))
    };
    let is_host = |host: &str| {
        !host.is_empty() && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._[]:-".contains(&byte))
    };
    let is_origin = |word: &&str| {
        ["null", "file://"].contains(word)
            || word.split_once("://").is_some_and(|(scheme, host)| is_scheme(scheme) && is_host(host))
    };
    let mut words = text.split(' ').filter(|word| !word.is_empty());
    match words.find(|word| !is_origin(word)) {
        Some(word) => Err(format!(
            "{} is no origin; write scheme and host as the browser has them, no path, such as http://localhost:8080",
            quoted(word)
        )),
        None => Ok(()),
    }
}

/// Names of files and shared memory are made from it.
fn check_robot_name(name: &str) -> Result<(), String> {
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
    let fine = (1..=32).contains(&name.len())
        && name.bytes().all(|byte| plain(byte) || byte == b'-' || byte == b'_')
        && name.bytes().next().is_some_and(plain);
    if fine {
        return Ok(());
    }
    Err(format!(
        "{} is no robot name; use 1 to 32 of a-z, 0-9, - and _, the first a letter or digit",
        quoted(name)
    ))
}
