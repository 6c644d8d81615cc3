//! The house is in order: what README and DESIGN say about the sources is true of the sources.

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use support::Lab;

const LINES_MAX: usize = 450;
const SERVICES: [&str; 9] = [
    "planner",
    "waypoint_selector",
    "controller",
    "step_generator",
    "pose_estimator",
    "plant",
    "recorder",
    "operator",
    "tuner",
];
/// Boxes on the control path, and the plant, which keeps time with them.
const PURE: [&str; 5] = ["waypoint_selector", "controller", "step_generator", "pose_estimator", "plant"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Files of the project, relative: what git tracks or would track, or else what lies there.
fn files() -> Vec<PathBuf> {
    let git = Command::new("git")
        .args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"])
        .current_dir(root())
        .output();
    if let Ok(output) = git.as_ref()
        && output.status.success()
    {
        let names = String::from_utf8_lossy(&output.stdout).into_owned();
        let names = names.split('\0').filter(|name| !name.is_empty()).map(PathBuf::from);
        return names.filter(|name| root().join(name).is_file()).collect();
    }
    let mut found = Vec::new();
    walk(root(), &mut found);
    found
}

fn walk(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).expect("a directory").flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        if path.is_dir() && name != "target" && name != "runs" && name != ".git" {
            walk(&path, found);
        } else if path.is_file() {
            found.push(path.strip_prefix(root()).expect("below the root").to_owned());
        }
    }
}

fn sources() -> Vec<PathBuf> {
    of_kinds(&["rs"])
}

/// Files whose names end so.
fn of_kinds(kinds: &[&str]) -> Vec<PathBuf> {
    let ends = |path: &PathBuf| path.extension().is_some_and(|end| kinds.iter().any(|kind| end == *kind));
    files().into_iter().filter(ends).collect()
}

/// Names of the dependencies of a manifest, dev-dependencies too.
fn dependencies(manifest: &str) -> Vec<String> {
    let table: toml::Table = manifest.parse().expect("a manifest");
    let kinds = ["dependencies", "dev-dependencies", "build-dependencies"];
    let tables = kinds.iter().filter_map(|kind| table.get(*kind)?.as_table());
    tables.flat_map(|table| table.keys().cloned()).collect()
}

#[test]
fn no_box_imports_a_box() {
    for service in SERVICES {
        let names = dependencies(&read(format!("services/{service}/Cargo.toml")));
        for name in &names {
            let foreign = name.starts_with("hilare") && name != "hilare-interfaces";
            assert!(!foreign, "services/{service} depends on {name}");
        }
    }
    let own = dependencies(&read("interfaces/Cargo.toml"));
    assert!(own.iter().all(|name| !name.starts_with("hilare")), "interfaces depends on {own:?}");
}

#[test]
fn every_service_is_listed_here() {
    let mut found: Vec<String> = fs::read_dir(root().join("services"))
        .expect("services/")
        .flatten()
        .filter(|entry| entry.path().join("Cargo.toml").is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    found.sort();
    let mut listed = SERVICES.map(str::to_owned).to_vec();
    listed.sort();
    assert_eq!(found, listed);
}

#[test]
fn the_control_path_is_pure() {
    for service in PURE {
        let names = dependencies(&read(format!("services/{service}/Cargo.toml")));
        // A QP solver needs std; everything else must do without.
        let excused = service == "controller" && names.iter().any(|name| name == "clarabel");
        let declared =
            read(format!("services/{service}/src/lib.rs")).lines().any(|line| line == "#![no_std]");
        assert!(declared || excused, "services/{service} does not declare #![no_std]");
        for name in &names {
            let known = ["hilare-interfaces", "libm", "nalgebra", "proptest"].contains(&name.as_str());
            assert!(known || excused, "services/{service} depends on {name}; keep the control path pure");
        }
    }
}

#[test]
fn only_the_transport_knows_iceoryx2() {
    let word = concat!("iceoryx2", "::");
    let mut users: Vec<PathBuf> = sources().into_iter().filter(|path| read(path).contains(word)).collect();
    // A workspace of its own, which measures iceoryx2 bare, beside other transports.
    users.retain(|user| !user.starts_with("benches/peers"));
    assert!(!users.is_empty());
    for user in users {
        assert!(
            user.starts_with("launch/src/shell") && user.to_string_lossy().contains("transport"),
            "{user:?}"
        );
    }
}

#[test]
fn files_can_be_read_in_one_sitting() {
    let long: Vec<String> = of_kinds(&["rs", "js", "mjs", "css", "html"])
        .into_iter()
        .map(|path| (read(&path).lines().count(), path))
        .filter(|(lines, _)| *lines > LINES_MAX)
        .map(|(lines, path)| format!("{}: {lines} lines", path.display()))
        .collect();
    assert!(long.is_empty(), "more than {LINES_MAX} lines:\n{}", long.join("\n"));
}

#[test]
fn no_file_names_a_machine() {
    let words =
        [concat!("/wo", "rk/"), concat!("/tmp/", "lab"), concat!("/ro", "ot/"), concat!("/ho", "me/")];
    let mut found = Vec::new();
    for path in files() {
        // Pictures and the like are no text.
        let Ok(text) = fs::read_to_string(root().join(&path)) else { continue };
        for (number, line) in text.lines().enumerate() {
            if words.iter().any(|word| line.contains(word)) {
                found.push(format!("{}:{}: {}", path.display(), number + 1, line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "paths of one machine:\n{}", found.join("\n"));
}

#[test]
fn readme_shows_the_diagram_that_is_built() {
    let readme = read("README.md");
    let (_, rest) = readme.split_once("<!-- diagram -->").expect("README.md has <!-- diagram -->");
    let (part, _) = rest.split_once("<!-- /diagram -->").expect("README.md has <!-- /diagram -->");
    let mut fences = part.split("```");
    let block = fences.nth(1).expect("a fenced block between them");
    let shown = block.split_once('\n').map_or("", |(_, text)| text);
    let printed = Lab::new().hilare(&["diagram"]).expect_code(0).stdout;
    assert_eq!(
        shown, printed,
        "README's diagram is not `hilare diagram`; paste its output between the marks"
    );
}
