//! What the command line prints: help, JSON, completions, the diagram; and what it does when nobody reads.

mod support;

use serde_json::Value;
use std::process::Stdio;
use support::{Lab, Running};

/// Verbs as `hilare --help` lists them.
fn verbs(lab: &Lab) -> Vec<String> {
    let help = lab.hilare(&["--help"]).expect_code(0).stdout;
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let names =
        commands.take_while(|line| !line.is_empty()).filter_map(|line| line.split_whitespace().next());
    names.map(str::to_owned).filter(|name| name != "help").collect()
}

#[test]
fn every_verb_has_an_example_and_its_exit_codes() {
    let lab = Lab::new();
    let verbs = verbs(&lab);
    let wanted = [
        "demo",
        "run",
        "up",
        "down",
        "status",
        "stop",
        "estop",
        "reset",
        "arm",
        "follow",
        "goal",
        "plan",
        "tune",
        "reproduce",
        "latency",
        "top",
        "topic",
        "diagram",
        "doctor",
        "systemd",
        "completions",
    ];
    for verb in wanted {
        assert!(verbs.iter().any(|found| found == verb), "{verb} is missing from {verbs:?}");
    }
    for verb in &verbs {
        let ended = lab.hilare(&[verb, "--help"]).expect_code(0);
        assert_eq!(ended.stderr, "", "{verb}");
        assert!(ended.stdout.contains("Example"), "{verb} has no example:\n{}", ended.stdout);
        assert!(ended.stdout.contains(&format!("hilare {verb}")), "{verb}: its example is of another verb");
        assert!(
            ended.stdout.contains("Exit codes: ") || verb == "completions",
            "{verb} hides its exit codes"
        );
    }
}

#[test]
fn json_is_alone_on_standard_output() {
    let lab = Lab::new();
    let robot = lab.robot();
    let path = lab.straight(0.1);
    let path = path.to_string_lossy();
    let run = |clock| {
        ["run", "--path", &path, "--clock", clock, "--robot", &robot, "--out", "report", "--json"]
            .map(str::to_owned)
    };
    for clock in ["in-process", "lockstep", "real"] {
        let ended = lab.hilare(&run(clock)).expect_code(0);
        let printed: Value = serde_json::from_str(&ended.stdout).expect("JSON and nothing else");
        assert_eq!(
            printed,
            lab.summary(&lab.dir().join("report")),
            "{clock}: what is printed is summary.json"
        );
        assert_eq!((&printed["clock"], &printed["reached"]), (&clock.into(), &true.into()));
    }
    for args in [&["diagram", "--json"][..], &["doctor", "--json"]] {
        let ended = lab.hilare(args);
        let list: Value =
            serde_json::from_str(&ended.stdout).unwrap_or_else(|error| panic!("{args:?}: {error}"));
        assert!(list.as_array().is_some_and(|list| !list.is_empty()), "{args:?}");
    }
    let doctor = lab.hilare(&["doctor"]);
    assert!(doctor.stdout.contains("/dev/shm") && doctor.stdout.contains("rtprio"), "{}", doctor.stdout);
    lab.assert_nothing_left("runs with --json");
}

#[test]
fn summary_json_has_the_keys_of_the_design_in_their_order() {
    let lab = Lab::new();
    let path = lab.straight(0.1);
    let args = ["run", "--path", &path.to_string_lossy(), "--clock", "in-process", "--json"];
    let printed = lab.hilare(&args).expect_code(0).stdout;
    let keys: Vec<&str> = printed
        .lines()
        .filter_map(|line| line.strip_prefix("  \"")?.split_once('"').map(|(key, _)| key))
        .collect();
    let wanted = "scenario controller clock reached ticks duration_s cross_track_mean_m cross_track_max_m \
                  speed_error_mean_mps speed_error_truth_mean_mps steps final_pose final_truth ticks_late paused_ticks \
                  paused_max_ticks commands_late commands_rejected cycles_without_command swaps restarts lateness_us \
                  state_hash";
    assert_eq!(keys, wanted.split_whitespace().collect::<Vec<_>>());
}

#[test]
fn a_report_holds_what_it_promises() {
    let lab = Lab::new();
    lab.hilare(&["run", "rectangle-open", "--clock", "in-process"]).expect_code(0);
    lab.hilare(&["run", "rectangle-open", "--clock", "in-process"]).expect_code(0);
    for n in 1..=2 {
        let report = lab.dir().join(format!("runs/rectangle-open-kanayama-in-process-{n}"));
        let plots = std::fs::read_dir(&report).expect("a report a run").flatten();
        let plots =
            plots.filter(|entry| entry.path().extension().is_some_and(|extension| extension == "svg"));
        assert!(plots.count() >= 3, "path, speed and cross-track");
        for file in ["summary.json", "system.toml", "trace.csv"] {
            assert!(report.join(file).is_file(), "{file}");
        }
    }
    // The resolved system is a system.
    let again = "runs/rectangle-open-kanayama-in-process-1/system.toml";
    lab.file("scenario.toml", format!("system = \"{again}\"\nwaypoints_m = [[0.2, 0.2], [0.3, 0.2]]\n"));
    lab.hilare(&["run", "scenario.toml", "--clock", "in-process"]).expect_code(0);
}

#[test]
fn nobody_reads_standard_output() {
    let lab = Lab::new();
    let path = lab.straight(0.1);
    let path = path.to_string_lossy();
    let mut panics = Vec::new();
    for args in [
        &["--help"][..],
        &["run", "--help"],
        &["--version"],
        &["diagram"],
        &["diagram", "--json"],
        &["doctor"],
        &["completions", "bash"],
        &["completions", "zsh"],
        &["run", "--path", &path, "--clock", "in-process"],
        &["run", "--path", &path, "--clock", "in-process", "--json"],
    ] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("/dev/full");
        for (what, stdout) in [("closed", Stdio::from(writer)), ("full", Stdio::from(full))] {
            let mut command = lab.command(args);
            command.stdout(stdout).stderr(Stdio::piped());
            let ended = Running::start_as_is(command).wait(support::PATIENCE);
            if ended.stderr.contains("panicked") || ended.code.is_none_or(|code| code > 2) {
                panics.push(format!("{args:?} with standard output {what}: {}", ended.stderr));
            }
        }
    }
    assert!(panics.is_empty(), "{}", panics.join("\n"));
}

#[test]
fn completions_are_for_every_shell() {
    let lab = Lab::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = lab.hilare(&["completions", shell]).expect_code(0).stdout;
        for verb in ["run", "estop", "follow"] {
            assert!(script.contains(verb), "{shell}: {verb}");
        }
        assert!(!script.contains("launch-pid") || script.contains("service"), "{shell}");
    }
}
