//! The command line: bad input is answered with one line and exit code 2 before anything is made or moves;
//! output is what it says it is.

mod support;

use serde_json::Value;
use std::path::{Path, PathBuf};
use support::{Ended, Lab, Running, skip, text};

/// One line that says `hilare: …` with all of `hints`, exit code 2, nothing on standard output.
#[track_caller]
fn assert_refused(what: &str, ended: &Ended, hints: &[&str]) {
    assert_eq!(ended.code, Some(2), "{what}: {ended:#?}");
    assert_eq!(ended.stdout, "", "{what}");
    assert_eq!(ended.complaints().len(), 1, "{what}: {ended:#?}");
    assert!(ended.stderr.starts_with("hilare: ") && ended.stderr.ends_with('\n'), "{what}: {ended:#?}");
    for hint in hints {
        assert!(ended.stderr.contains(hint), "{what}: {:?} does not say {hint:?}", ended.stderr);
    }
}

fn listing(dir: &Path) -> Vec<PathBuf> {
    let mut found: Vec<_> =
        std::fs::read_dir(dir).expect("a directory").map(|entry| entry.unwrap().path()).collect();
    found.sort();
    found
}

/// Refused, and nothing was made: no report, no runtime files, no shared memory.
#[track_caller]
fn refuse(lab: &Lab, args: &[&str], hints: &[&str]) {
    let what = format!("hilare {}", args.join(" "));
    let before = listing(lab.dir());
    let ended = lab.hilare(args);
    assert_refused(&what, &ended, hints);
    let mut after = listing(lab.dir());
    after.retain(|path| *path != lab.runtime_dir());
    assert_eq!(before, after, "{what} left something behind");
    lab.assert_nothing_left(&what);
}

#[test]
fn bad_waypoint_files() {
    let lab = Lab::new();
    let cases: [(&str, &[u8], &[&str]); 17] = [
        ("empty.csv", b"", &["empty.csv", "x,y"]),
        ("blank.csv", b"\n\n# nothing\n", &["blank.csv"]),
        ("header-only.csv", b"x,y\n", &["no waypoint"]),
        ("one.csv", b"x,y\n0.2,0.2\n", &["one waypoint"]),
        ("repeated.csv", b"x,y\n0,0\n1,1\n1,1\n", &["repeated.csv:4", "same place"]),
        ("nan.csv", b"x,y\n0,0\nnan,1\n", &["nan.csv:3", "finite"]),
        ("inf.csv", b"x,y\n0,0\n1,-inf\n", &["inf.csv:3", "finite"]),
        ("huge.csv", b"x,y\n0,0\n1e308,1\n", &["huge.csv:3", "metres"]),
        ("millimetres.csv", b"x,y\n200,200\n600000,200\n", &["millimetres.csv:3", "metres"]),
        ("header.csv", b"lat,lon\n0,0\n1,1\n", &["header.csv:1", "x,y"]),
        ("no-header.csv", b"0,0\n1,1\n", &["no-header.csv:1", "x,y"]),
        ("swapped.csv", b"y,x\n0,0\n1,1\n", &["swapped.csv:1", "x,y"]),
        ("short.csv", b"x,y\n0,0\n1\n", &["short.csv:3"]),
        ("long.csv", b"x,y\n0,0\n1,2,3\n", &["long.csv:3"]),
        ("words.csv", b"x,y\n0,0\none,two\n", &["words.csv:3", "one"]),
        ("semicolons.csv", b"x;y\n0;0\n1;1\n", &["semicolons.csv:1", "x,y"]),
        ("binary.csv", b"\x7fELF\x02\xff\xfe\x00", &["binary.csv:1"]),
    ];
    for (name, bytes, hints) in cases {
        lab.file(name, bytes);
        refuse(&lab, &["run", "--path", name], hints);
        refuse(&lab, &["run", "--path", name, "--clock", "lockstep", "--json"], hints);
        refuse(&lab, &["follow", name], hints);
    }
    refuse(&lab, &["run", "--path", "missing.csv"], &["missing.csv"]);
    refuse(&lab, &["run", "--path", "."], &["."]);
    refuse(&lab, &["follow", "missing.csv"], &["missing.csv"]);
    let longest_line = [&b"x,y\n0,0\n"[..], &[b'1'; 1 << 20], b",1\n"].concat();
    lab.file("line.csv", longest_line);
    refuse(&lab, &["run", "--path", "line.csv"], &["line.csv:3"]);
}

#[test]
fn ten_million_waypoints() {
    let lab = Lab::new();
    let mut bytes = b"x,y\n".to_vec();
    bytes.extend(b"0.1,0.2\n0.3,0.4\n".repeat(5_000_000));
    lab.file("many.csv", bytes);
    refuse(&lab, &["run", "--path", "many.csv"], &["65536"]);
}

#[test]
fn bad_names_and_values() {
    let lab = Lab::new();
    let cases: [(&[&str], &[&str]); 27] = [
        (&["run", "rectangel"], &["rectangel", "did you mean \"rectangle\""]),
        (&["run", "figure-eight"], &["figure-eight", "trapezoid"]),
        (&["run", "missing.toml"], &["missing.toml"]),
        (&["up", "epuk"], &["did you mean \"epuck\""]),
        (&["up", "missing.toml"], &["missing.toml"]),
        (&["run", "so", "--set", "plant.slip_meen=0.1"], &["slip_meen", "did you mean \"slip_mean\""]),
        (&["run", "so", "--set", "plnt.slip_mean=0.1"], &["plnt", "plant"]),
        (&["run", "so", "--set", "wheels=3"], &["wheels"]),
        (&["run", "so", "--set", "chassis.track_m=54"], &["54 m", "0.054", "millimetres"]),
        (&["run", "so", "--set", "limits.v_max_mps=41"], &["41 m/s", "0.041", "millimetres"]),
        (&["run", "so", "--set", "limits.v_max_mps=-1"], &["-1", "0 to 10 m/s"]),
        (&["run", "so", "--set", "limits.omega_max_radps=-0.7"], &["-0.7"]),
        (&["run", "so", "--set", "limits.v_min_mps=0.05"], &["v_min_mps", "v_max_mps"]),
        (&["run", "so", "--set", "limits.v_max_mps=nan"], &["finite"]),
        (&["run", "so", "--set", "limits.v_max_mps=fast"], &["fast", "not a number"]),
        (&["run", "so", "--set", "limits.v_max_mps"], &["KEY=VALUE"]),
        (&["run", "so", "--set", "timing.period_ticks=0"], &["period_ticks"]),
        (&["run", "so", "--controller", "kanayma"], &["kanayma", "kanayama"]),
        (&["run", "so", "--set", "chassis.kind=mecanum"], &["kanayama", "mecanum"]),
        (&["run", "so", "--start", "1,2"], &["X,Y,THETA"]),
        (&["run", "so", "--start", "nan,0,0"], &["finite"]),
        (&["run", "so", "--start", "0,0,90"], &["90"]),
        (&["run", "so", "--robot", "Bad Name"], &["Bad Name", "a-z"]),
        (&["run", "so", "--robot", "../../etc"], &["../../etc"]),
        (&["run", "so", "--robot", "a23456789012345678901234567890123"], &["32"]),
        (&["goal", "nan", "0"], &["finite"]),
        (&["goal", "1", "inf"], &["finite"]),
    ];
    for (args, hints) in cases {
        refuse(&lab, args, hints);
    }
}

#[test]
fn bad_system_and_scenario_files() {
    let lab = Lab::new();
    let systems: [(&str, &[&str]); 8] = [
        ("[chassis]\ntrack_m = 54\n", &["bad.toml:2", "0.054"]),
        ("[chassis]\nwheel_diametre_m = 0.04\n", &["bad.toml:2", "did you mean \"wheel_diameter_m\""]),
        ("[chasis]\ntrack_m = 0.054\n", &["bad.toml:1", "did you mean [chassis]"]),
        ("[chassis]\ntrack_m = \"0.054\"\n", &["bad.toml:2", "without quotes"]),
        ("[chassis]\ntrack_m = 0.054\ntrack_m = 0.055\n", &["bad.toml:3", "second time"]),
        ("[limits]\nv_max_mps = -0.041\n", &["bad.toml:2", "-0.041"]),
        ("[limits\nv_max_mps = 0.041\n", &["bad.toml:1"]),
        ("robot = \"No\"\n", &["bad.toml:1", "No"]),
    ];
    for (system, hints) in systems {
        lab.file("bad.toml", system);
        refuse(&lab, &["up", "bad.toml"], hints);
        refuse(&lab, &["up", "bad.toml", "--detach"], hints);
    }
    let path = "waypoints_m = [[0, 0], [1, 0]]\n";
    let scenarios: [(String, &[&str]); 7] = [
        (format!("system = \"epuck\"\n{path}speed = 3\n"), &["bad.toml:3", "speed"]),
        (format!("system = \"epuck\"\n{path}[set.limits]\nv_max_mps = -3\n"), &["bad.toml:4", "-3"]),
        (format!("system = \"epuk\"\n{path}"), &["bad.toml:1", "did you mean \"epuck\""]),
        (path.to_owned(), &["bad.toml", "system"]),
        ("system = \"epuck\"\n".to_owned(), &["bad.toml", "waypoints_m"]),
        ("system = \"epuck\"\nwaypoints_m = [[0, 0]]\n".to_owned(), &["bad.toml:2", "one waypoint"]),
        ("system = \"epuck\"\nwaypoints_file = \"none.csv\"\n".to_owned(), &["none.csv"]),
    ];
    for (scenario, hints) in scenarios {
        lab.file("bad.toml", scenario);
        refuse(&lab, &["run", "bad.toml"], hints);
    }
}

#[test]
fn wrong_use() {
    let lab = Lab::new();
    let run: &[&str] = &["hilare run --help"];
    let cases: [(&[&str], &[&str]); 20] = [
        (&["rum", "so"], &["rum", "hilare --help"]),
        (&["--bogus"], &["--bogus", "hilare --help"]),
        (&["--robot", "mule", "status"], &["--robot goes behind the verb: hilare status --robot"]),
        (&["run"], run),
        (&["run", "so", "trapezoid"], run),
        (&["run", "so", "--bogus"], run),
        (&["run", "so", "--clock"], run),
        (&["run", "so", "--clock", "rael"], &["rael", "lockstep", "hilare run --help"]),
        (&["run", "so", "--seed", "-1"], run),
        (&["run", "so", "--seed", "x"], run),
        (&["run", "so", "--seed", "99999999999999999999"], run),
        (&["run", "so", "--out", ""], run),
        (&["run", "so", "--json", "--json"], run),
        (&["up", "--bogus"], &["hilare up --help"]),
        (&["goal", "1"], &["hilare goal --help"]),
        (&["goal", "x", "y"], &["hilare goal --help"]),
        (&["follow"], &["hilare follow --help"]),
        (&["diagram", "x"], &["hilare diagram --help"]),
        (&["completions", "tcsh"], &["tcsh", "bash", "hilare completions --help"]),
        (&["service"], &["hilare service --help"]),
    ];
    for (args, hints) in cases {
        refuse(&lab, args, hints);
    }
}

#[test]
fn unwritable_out() {
    let lab = Lab::new();
    lab.file("file", "");
    for out in ["file", "file/below", "/proc/hilare", "/dev/null/report"] {
        refuse(&lab, &["run", "so", "--clock", "in-process", "--out", out], &["--out", out]);
        refuse(&lab, &["run", "so", "--out", out], &["--out", out]);
    }
    refuse(&lab, &["up", "--log", "/nonexistent/log"], &["/nonexistent/log"]);
    refuse(&lab, &["up", "--detach", "--log", "/nonexistent/log"], &["/nonexistent/log"]);
}

#[test]
fn a_runtime_directory_that_will_not_do() {
    let lab = Lab::new();
    let too_long = lab.dir().join("d".repeat(100));
    for dir in [Path::new("/proc/hilare"), Path::new("/dev/null"), &too_long] {
        let mut command = lab.command(&["run", "so", "--clock", "lockstep"]);
        command.env("HILARE_RUNTIME_DIR", dir);
        let ended = Running::start(command).wait(support::PATIENCE);
        assert_refused(&dir.to_string_lossy(), &ended, &["HILARE_RUNTIME_DIR"]);
        let left: Vec<_> = listing(lab.dir()).into_iter().filter(|path| *path != too_long).collect();
        assert_eq!(left, [] as [PathBuf; 0], "left by a run in {}", dir.display());
    }
}

#[test]
fn robots_that_are_not_up() {
    let lab = Lab::new();
    lab.straight(1.0);
    for verb in ["status", "down", "stop", "estop", "reset", "arm"] {
        refuse(&lab, &[verb], &["no robot is up", "hilare up"]);
        refuse(&lab, &[verb, "--robot", "nobody", "--json"], &["nobody", "hilare up"]);
    }
    refuse(&lab, &["follow", "straight-1.csv"], &["no robot is up"]);
    refuse(&lab, &["goal", "1", "-2"], &["no robot is up"]);
}

#[test]
fn a_name_that_is_taken() {
    let lab = Lab::new();
    let robot = lab.robot();
    let path = lab.straight(5.0);
    let first = lab.start(&["run", "--path", &path.to_string_lossy(), "--robot", &robot, "--out", "first"]);
    lab.await_status(&robot, "the first run is up", |status| status["mode"] == "armed");
    let (before, pid) = (listing(lab.dir()), first.pid().to_string());
    for args in [
        &["run", "so", "--robot", &robot][..],
        &["run", "so", "--robot", &robot, "--clock", "lockstep", "--json"],
        &["demo", "--port", "0", "--robot", &robot],
        &["up", "--robot", &robot],
        &["up", "--robot", &robot, "--detach"],
    ] {
        let what = format!("{args:?} beside a run of the same robot");
        assert_refused(&what, &lab.hilare(args), &[&pid, &robot, "hilare down"]);
        assert_eq!(before, listing(lab.dir()), "{what} left something behind");
    }
    assert!(lab.status(&robot).is_some(), "the first run does not mind");
    first.signal(rustix::process::Signal::INT);
    first.wait(support::PATIENCE).expect_code(1);
    lab.assert_nothing_left("a name that is taken");
}

#[test]
fn dev_shm_too_small() {
    let test = "dev_shm_too_small";
    let lab = Lab::new();
    let mount = "mount -t tmpfs -o size=8m tmpfs /dev/shm";
    let try_it = |then: &str| {
        let mut command = lab.command_of("unshare");
        command.args(["-m", "sh", "-c", &format!("{mount} && exec {then}")]);
        Running::start(command).wait(support::PATIENCE)
    };
    if std::process::Command::new("unshare").arg("--version").output().is_err() {
        return skip(test, "there is no unshare");
    }
    if try_it("true").code != Some(0) {
        return skip(test, "mounting a small /dev/shm in a namespace of its own takes root");
    }
    let before = listing(lab.dir());
    let hilare = env!("CARGO_BIN_EXE_hilare");
    for arguments in ["run so", "run so --clock lockstep", "up", "up --detach"] {
        let ended = try_it(&format!("{hilare} {arguments} --robot {}", lab.robot()));
        assert_refused(arguments, &ended, &["/dev/shm", "needed", "remount"]);
        let mut after = listing(lab.dir());
        after.retain(|path| *path != lab.runtime_dir());
        assert_eq!(before, after, "{arguments} left something behind");
        lab.assert_nothing_left(arguments);
    }
    let doctor = try_it(&format!("{hilare} doctor --json")).expect_code(1);
    let findings: Value = serde_json::from_str(&doctor.stdout).expect("JSON");
    let shm = findings
        .as_array()
        .unwrap()
        .iter()
        .find(|finding| finding["check"] == "/dev/shm")
        .expect("a finding");
    assert!(shm["verdict"] == "bad" && text(shm, "cure").contains("remount"), "{shm}");
}
