//! Programs in other languages: the messages lie in memory as they do in Rust, and the example that looks on sees the robot's
//! own poses, to the bit.

mod support;

use hilare_interfaces::export;
use hilare_interfaces::layout::{Field, Layout, layout_hash};
use hilare_interfaces::wires::WIRES;
use rustix::process::Signal;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use support::{Lab, Running, number, python_with_iceoryx2, skip};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples")
}

/// Every message, those within others too.
fn messages() -> Vec<Layout> {
    let mut found: Vec<Layout> = Vec::new();
    let mut open: Vec<Layout> =
        WIRES.iter().flat_map(|wire| [Some(wire.message), wire.element]).flatten().collect();
    while let Some(message) = open.pop() {
        open.extend(message.fields.iter().filter_map(|field| field.nested.copied()));
        if !found.contains(&message) {
            found.push(message);
        }
    }
    assert!(found.len() > 10);
    found
}

fn size_of(field: &Field) -> usize {
    field.len * field.nested.map_or(if field.type_name == "u8" { 1 } else { 8 }, |nested| nested.size)
}

/// What the Rust types are, in the lines that the other languages print.
fn expected(hashes: bool) -> BTreeSet<String> {
    let mut lines = BTreeSet::new();
    for message in messages() {
        let hash = if hashes {
            format!(" {:016x}", layout_hash(message.name, message.fields))
        } else {
            String::new()
        };
        lines.insert(format!("{} {} {}{hash}", message.ident, message.name, message.size));
        for field in message.fields {
            let place = format!("{}.{} {} {}", message.ident, field.name, field.offset, size_of(field));
            lines.insert(format!("{place} {} {}", field.type_name, field.len));
        }
    }
    lines.extend(
        WIRES.iter().map(|wire| format!("{} {}", export::service_of(wire), export::layout_value(wire))),
    );
    lines
}

fn lines(text: &str) -> BTreeSet<String> {
    text.lines().map(str::to_owned).collect()
}

#[test]
fn in_python_the_messages_are_those_of_rust() {
    let there = Command::new("python3").arg("--version").stdout(Stdio::null()).status();
    if !there.is_ok_and(|status| status.success()) {
        return skip("in_python_the_messages_are_those_of_rust", "there is no python3");
    }
    let lab = Lab::new();
    let mut command = lab.command_of("python3");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/layouts.py"));
    command.arg(examples().join("controllers")).env("PYTHONDONTWRITEBYTECODE", "1");
    let ended = Running::start(command).wait(support::PATIENCE).expect_code(0);
    assert_eq!(lines(&ended.stdout), expected(true));
}

/// A program that prints what a C compiler makes of the header.
fn printer() -> String {
    let mut text = String::from(
        "#include <stdio.h>\n#include \"hilare_wires.h\"\n\
         #define KIND(x) _Generic((x), double: \"f64\", double*: \"f64\", uint64_t: \"u64\", uint64_t*: \"u64\", \\\n\
         int64_t: \"i64\", int64_t*: \"i64\", char*: \"u8\", hilare_waypoint: HILARE_WAYPOINT_NAME, \\\n\
         hilare_waypoint*: HILARE_WAYPOINT_NAME)\n\
         int main(void) {\n",
    );
    for message in messages() {
        let snake: String = message
            .ident
            .char_indices()
            .flat_map(|(at, c)| {
                (at > 0 && c.is_uppercase()).then_some('_').into_iter().chain(c.to_lowercase())
            })
            .collect();
        let (name, shout) = (message.ident, snake.to_uppercase());
        text.push_str(&format!(
            "{{ static hilare_{snake} m;\nprintf(\"{name} %s %zu\\n\", HILARE_{shout}_NAME, sizeof m);\n"
        ));
        for Field { name: field, nested, type_name, .. } in message.fields {
            let one = if *type_name == "u8" {
                "char".to_owned()
            } else {
                nested.map_or("double".to_owned(), |_| "hilare_waypoint".to_owned())
            };
            text.push_str(&format!(
                "printf(\"{name}.{field} %zu %zu %s %zu\\n\", offsetof(hilare_{snake}, {field}), sizeof m.{field}, \
                 KIND(m.{field}), sizeof m.{field} / sizeof({one}));\n"
            ));
        }
        text.push_str("}\n");
    }
    for wire in WIRES {
        let shout = wire.name.replace('/', "_").to_uppercase();
        text.push_str(&format!("printf(\"%s %s\\n\", HILARE_{shout}_SERVICE, HILARE_{shout}_LAYOUT);\n"));
    }
    text.push_str("return 0; }\n");
    text
}

#[test]
fn in_c_the_messages_are_those_of_rust() {
    let lab = Lab::new();
    let source = lab.file("print.c", printer());
    let program = lab.dir().join("print");
    let mut command = lab.command_of("cc");
    command.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-I"]).arg(examples().join("controllers"));
    command.arg("-o").arg(&program).arg(source);
    if Command::new("cc").arg("--version").stdout(Stdio::null()).status().is_err() {
        return skip("in_c_the_messages_are_those_of_rust", "there is no cc");
    }
    Running::start(command).wait(support::PATIENCE).expect_code(0);
    let ended = Running::start(lab.command_of(&program)).wait(support::PATIENCE).expect_code(0);
    assert_eq!(lines(&ended.stdout), expected(false));
}

/// The example that looks on, of a directory with the same layout as examples/.
fn observer(lab: &Lab, python: &Path, examples: &Path, args: &[&str]) -> Running {
    let mut command = lab.command_of(python);
    command.arg(examples.join("observers/pose.py")).args(args).env("PYTHONDONTWRITEBYTECODE", "1");
    Running::start(command)
}

/// Poses by tick, each as the bits of its numbers.
fn poses(text: &str) -> BTreeMap<u64, Vec<u64>> {
    let of = |line: &str| {
        // What was cut off at the end is no line.
        let pose: Value = serde_json::from_str(line).ok()?;
        let real = |name: &str| pose[name].as_f64().expect(name).to_bits();
        let values = vec![pose["measured_tick"].as_u64()?, real("x_m"), real("y_m"), real("theta_rad")];
        Some((pose["tick"].as_u64()?, values))
    };
    text.lines().filter_map(of).collect()
}

#[test]
fn an_observer_in_python_sees_the_robots_poses_until_it_goes() {
    let Some(python) = python_with_iceoryx2("an_observer_in_python_sees_the_robots_poses_until_it_goes")
    else {
        return;
    };
    let (lab, examples) = (Lab::new(), examples());
    let robot = lab.robot();
    // Before there is a robot.
    let ended = observer(&lab, &python, &examples, &[&robot]).wait(support::PATIENCE).expect_code(1);
    assert_eq!((ended.complaints().len(), &*ended.stdout), (1, ""), "{ended:#?}");
    let tell = |args: &[&str]| lab.hilare(&[args, &["--robot", &robot]].concat()).expect_code(0);
    tell(&["up", "--detach", "--set", "timing.pause_stop_ticks=0"]);
    // Made for another version: refused, with one line.
    let other = lab.dir().join("other");
    for (folder, file) in [("observers", "pose.py"), ("controllers", "hilare_wires.py")] {
        fs::create_dir_all(other.join(folder)).expect("a directory");
        let text = fs::read_to_string(examples.join(folder).join(file)).expect("the example");
        fs::write(
            other.join(folder).join(file),
            text.replace("watch/pose\", Pose, None, \"", "watch/pose\", Pose, None, \"0"),
        )
        .expect("a copy");
    }
    let ended = observer(&lab, &python, &other, &[&robot]).wait(support::PATIENCE).expect_code(1);
    assert!(ended.complaints().len() == 1 && ended.stderr.contains("of the robot's version?"), "{ended:#?}");
    // Beside hilare's own eyes on the same wire.
    let all = observer(&lab, &python, &examples, &[&robot, "--all", "--json"]);
    let some = observer(&lab, &python, &examples, &[&robot, "--rate", "20"]);
    let own = lab.start(&["topic", "echo", "pose", "--all", "--json", "--robot", &robot]);
    tell(&["follow", &lab.straight(10.0).to_string_lossy()]);
    tell(&["arm"]);
    lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.02);
    let from = number(&lab.status(&robot).expect("it is up"), "tick");
    lab.await_status(&robot, "some seconds", |status| number(status, "tick") > from + 3000.0);
    // It comes and goes while the robot drives.
    let visitor = observer(&lab, &python, &examples, &[&robot]);
    lab.await_status(&robot, "a second", |status| number(status, "tick") > from + 4000.0);
    visitor.signal(Signal::TERM);
    visitor.wait(support::PATIENCE).expect_code(0);
    tell(&["down"]);
    let [all, some, own] = [all, some, own].map(|one| one.wait(support::PATIENCE).expect_code(0));
    let (seen, own) = (poses(&all.stdout), poses(&own.stdout));
    let both: Vec<u64> = seen.keys().filter(|tick| own.contains_key(tick)).copied().collect();
    assert!(both.len() > 2000, "{} poses seen by both", both.len());
    for tick in &both {
        assert_eq!(seen[tick], own[tick], "tick {tick}");
    }
    let moved = f64::from_bits(seen[&both[both.len() - 1]][1]) - f64::from_bits(seen[&both[0]][1]);
    assert!(moved > 0.05, "it drove {moved} m");
    assert!(
        some.stdout.lines().count() > 20 && some.stdout.lines().all(|line| line.starts_with("tick ")),
        "{}",
        some.stdout
    );
    println!(
        "{} poses in Python, {} by hilare, {} by both; {}",
        seen.len(),
        own.len(),
        both.len(),
        all.stderr.trim()
    );
    lab.assert_nothing_left("an observer in Python");
}
