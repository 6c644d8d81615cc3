//! The container recipe: what it says is what `hilare doctor` finds where the options are missing.

mod support;

use serde_json::Value;
use std::path::Path;
use std::process::Command;
use support::{Lab, PATIENCE, Running, skip, text};

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Words that begin with two dashes.
fn options(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| c.is_whitespace() || "`,;()|".contains(c));
    words.filter(|word| word.starts_with("--") && word.len() > 2)
}

/// Runs `hilare ARGS` as a container without options would: 16 MB of shared memory, an account without
/// capabilities, hardly any locked memory.
fn in_a_bare_container(lab: &Lab, args: &[&str]) -> support::Ended {
    let script = "mount -t tmpfs -o size=16m,mode=1777 tmpfs /dev/shm && mount -t tmpfs -o mode=1777 tmpfs \"$0\" && \
        exec prlimit --rtprio=0 --memlock=65536 setpriv --reuid=990 --regid=990 --clear-groups --bounding-set=-all \
        --inh-caps=-all \"$@\"";
    // The program has to be within reach of the account.
    let program = lab.dir().join("hilare");
    if !program.exists() {
        std::fs::copy(env!("CARGO_BIN_EXE_hilare"), &program).expect("a copy of the program");
    }
    let runtime = lab.runtime_dir();
    std::fs::create_dir_all(&runtime).expect("a runtime directory");
    let mut command = lab.command_of("unshare");
    command.args(["--mount", "sh", "-c", script]).arg(runtime).arg(program).args(args);
    Running::start(command).wait(PATIENCE)
}

#[test]
fn doctor_and_the_recipe_name_the_same_cures() {
    let lab = Lab::new();
    if !rustix::process::geteuid().is_root() || Command::new("unshare").arg("--version").output().is_err() {
        return skip("doctor_and_the_recipe_name_the_same_cures", "name spaces need root and unshare");
    }
    let found = in_a_bare_container(&lab, &["doctor", "--json"]).expect_code(1);
    let found: Value = serde_json::from_str(&found.stdout).expect("JSON and nothing else");
    let recipe = read("docs/container.md");
    let run_line =
        recipe.split("docker run").nth(1).and_then(|rest| rest.split("\n\n").next()).expect("docker run");
    for (check, option) in
        [("/dev/shm", "--shm-size"), ("rtprio", "--ulimit rtprio"), ("memlock", "--ulimit memlock")]
    {
        let finding = found.as_array().expect("a list").iter().find(|one| one["check"] == check);
        let finding = finding.unwrap_or_else(|| panic!("no check {check}: {found}"));
        assert_ne!(finding["verdict"], "good", "{finding}");
        let cure = text(finding, "cure");
        let (_, docker) =
            cure.split_once("docker: ").unwrap_or_else(|| panic!("{check}: no cure for docker: {cure}"));
        let docker = docker.split([')', ';']).next().expect("a word");
        assert!(docker.starts_with(option), "{check}: {docker}");
        assert!(run_line.contains(docker), "{docker} is not in the recipe's docker run:\n{run_line}");
    }
    let refused = in_a_bare_container(&lab, &["up"]).expect_code(2);
    assert!(refused.stderr.contains("--shm-size=64m") && refused.complaints().len() == 1, "{refused:#?}");
}

#[test]
fn every_option_of_the_recipe_is_explained() {
    let recipe = read("docs/container.md");
    let run_line =
        recipe.split("docker run").nth(1).and_then(|rest| rest.split("\n\n").next()).expect("docker run");
    let explained: Vec<&str> =
        recipe.lines().filter(|line| line.starts_with('|')).flat_map(options).collect();
    for option in options(run_line) {
        let name = option.split('=').next().expect("a name");
        // Where it is, and that it goes on in the background, are no matter of the robot.
        let plain = ["--name", "--detach", "--volume", "--security-opt"].contains(&name);
        assert!(plain || explained.iter().any(|known| known.starts_with(name)), "{option} is not explained");
    }
}

#[test]
fn the_image_is_built_by_this_toolchain_and_runs_without_privilege() {
    let recipe = read("examples/container/Containerfile");
    let manifest: toml::Table = read("Cargo.toml").parse().expect("a manifest");
    let version = manifest["workspace"]["package"]["rust-version"].as_str().expect("a version");
    assert!(recipe.contains(&format!("rust:{version}-slim-bookworm AS build")), "rust-version is {version}");
    let (_, last) = recipe.rsplit_once("\nFROM ").expect("two stages");
    let user = last.lines().find_map(|line| line.strip_prefix("USER "));
    assert!(user.is_some_and(|user| !["root", "0"].contains(&user)), "{last}");
}
