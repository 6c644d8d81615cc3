//! What the machine lacks, and who else uses it: refused at start with the cure, or of no effect on the tick.

use super::controllers::CORNERS;
use crate::faults::cast::{Beside, Role, Witness};
use crate::faults::drive::{Drive, late, same_steps, simulated, unless_spoilt};
use crate::faults::host::{Bystanders, fill_disk, has, may_mount, own_disk, own_mounts, shell};
use crate::faults::preload::JumpingClock;
use crate::faults::seeds::{self, Figures};
use crate::support::random::Random;
use crate::support::{Ended, Lab, PATIENCE, Running, process, skip, wait_until, whole_machine};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::io::{PipeReader, PipeWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Neither a pause nor deaths by hand are what is tested.
const SET: [&str; 2] = ["--set", "timing.pause_stop_ticks=0"];

fn corners(lab: &Lab) -> String {
    lab.file("corners.csv", CORNERS).to_string_lossy().into_owned()
}

/// Runs again what the host has spoilt: the bits of the run whose report `command` names are those of `expected`.
fn same_bits(
    lab: &Lab,
    figures: &mut Figures,
    expected: &Value,
    mut command: impl FnMut(u32) -> (Command, PathBuf),
) {
    unless_spoilt(figures, |attempt| {
        let (command, out) = command(attempt);
        let host = Bystanders::start();
        let ended = Running::start(command).wait(2 * PATIENCE);
        let stalls = host.end();
        // A shell need not wait for all of a pipeline.
        wait_until("everybody has left", || lab.processes().is_empty());
        let summary = summary_in(&out);
        let keys = ["reached", "state_hash", "ticks", "cycles_without_command"];
        let Some(key) = keys.iter().find(|key| summary[**key] != expected[**key]) else { return Ok(()) };
        let late = summary["commands_late"].as_u64().unwrap_or(0) > 0 && stalls.boxes_ever();
        // A lease that ran out is no figure of the summary; cycles without command are, and the verdict says so.
        let confesses = ended.stdout.contains("not expected to be the simulation's");
        let spoilt = late || confesses && stalls.lease();
        assert!(spoilt, "{key}: not as without the fault, {stalls:?}: {summary} {ended:#?}");
        Err(format!("{key} of {summary}"))
    });
}

fn summary_in(out: &Path) -> Value {
    let text = fs::read_to_string(out.join("summary.json")).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or(Value::Null)
}

#[track_caller]
fn refused(ended: &Ended, hints: &[&str]) {
    assert_eq!((ended.code, &*ended.stdout, ended.complaints().len()), (Some(2), "", 1), "{ended:#?}");
    for hint in hints {
        assert!(ended.stderr.contains(hint), "{:?} does not say {hint:?}", ended.stderr);
    }
}

#[test]
fn what_cannot_work_is_refused_before_the_robot_moves() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    seeds::each_real("second launch of the same robot, version mismatch", 1..=10, |draw, figures| {
        unless_spoilt(figures, |attempt| {
            let mut robot = Drive::start(&lab, &format!("c{}x{attempt}", draw.seed()), &job, &[]);
            robot.await_tick(300);
            let second = lab.hilare(&["run", "so", "--robot", &robot.robot]);
            refused(&second, &[&robot.robot, &robot.run.pid().to_string(), "hilare down"]);
            let answer = Beside::start(&lab, &robot.robot, Role::Foreigner).end();
            for hint in ["wire steps", "hilare/Steps/", "launch another one", "same build"] {
                assert!(answer.contains(hint), "{answer:?} does not say {hint:?}");
            }
            robot.end(0).same_bits(&expected)
        });
        figures.sum("both refused in one line with the cure; same bits beside them, in {} runs", 1.0);
    });
    lab.assert_nothing_left("refusals");
}

#[test]
fn a_small_dev_shm_is_refused() {
    let lab = Lab::new();
    if !may_mount(&lab) {
        return skip("a_small_dev_shm_is_refused", "mounting in a namespace of its own takes root");
    }
    seeds::each_real("/dev/shm too small", 1..=30, |draw, figures| {
        let mib = draw.random.whole(1, 30);
        let line = format!("mount -t tmpfs -o size={mib}m tmpfs /dev/shm && exec \"$@\"");
        for clock in ["real", "lockstep"] {
            let command = own_mounts(&lab, &line, &["run", "so", "--clock", clock, "--robot", &lab.robot()]);
            refused(&Running::start(command).wait(PATIENCE), &["/dev/shm", "needed", "remount"]);
        }
        figures.most("refused with the cure, up to {} MiB", mib as f64);
    });
    lab.assert_nothing_left("a small /dev/shm");
}

#[test]
fn without_fifo_it_runs_best_effort_and_says_so() {
    let test = "without_fifo_it_runs_best_effort_and_says_so";
    let _machine = whole_machine();
    let lab = Lab::new();
    if !has("setpriv") || !has("prlimit") {
        return skip(test, "there is no setpriv or prlimit");
    }
    let path = corners(&lab);
    seeds::each_real("FIFO denied", 1..=10, |draw, figures| {
        let robot = lab.robot_named(&format!("f{}", draw.seed()));
        let out = lab.dir().join(&robot);
        let drop =
            if rustix::process::geteuid().is_root() { "setpriv --bounding-set=-sys_nice " } else { "" };
        let line = format!("exec {drop}prlimit --rtprio=0:0 \"$@\"");
        let out_text = out.to_string_lossy();
        let args = [&["run", "--path", &path, "--robot", &robot, "--out", &out_text][..], &SET].concat();
        let ended = Running::start(shell(&lab, &line, &args)).wait(2 * PATIENCE).expect_code(0);
        assert!(ended.stderr.contains("SCHED_FIFO was refused for"), "{ended:#?}");
        assert!(ended.stderr.contains("best effort") && ended.stderr.contains("ulimit -r"), "{ended:#?}");
        assert_eq!(summary_in(&out)["reached"], true);
        figures.sum("loud best effort with the cure, arrived, in {} runs", 1.0);
    });
    lab.assert_nothing_left("a run without FIFO");
}

#[test]
fn a_full_disk_has_no_effect_on_the_tick() {
    let test = "a_full_disk_has_no_effect_on_the_tick";
    let _machine = whole_machine();
    let lab = Lab::new();
    if !may_mount(&lab) {
        return skip(test, "mounting in a namespace of its own takes root");
    }
    let path = corners(&lab);
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    for dir in ["disk", "rt"] {
        fs::create_dir_all(lab.dir().join(dir)).expect("a mount point");
    }
    seeds::each_real("disk full", 1..=10, |draw, figures| {
        let (ended, seen) = unless_spoilt(figures, |attempt| {
            let robot = lab.robot_named(&format!("d{}x{attempt}", draw.seed()));
            let mount = |dir: &str| {
                format!("mount -t tmpfs -o size=4m,mode=0700 tmpfs {}", lab.dir().join(dir).display())
            };
            let line = format!("{} && {} && exec \"$@\"", mount("disk"), mount("rt"));
            let args = [&["run"][..], &job, &["--robot", &robot, "--out", "disk/report"], &SET].concat();
            let host = Bystanders::start();
            let run = Running::start(own_mounts(&lab, &line, &args));
            // Not before the disks are there.
            wait_until("its own disks", || own_disk(run.pid(), &lab.dir().join("rt")));
            let mut witness = Witness::start_in_mounts_of(run.pid(), &lab, &robot);
            witness.await_tick(draw.random.whole(300, 3000));
            let filled = ["disk", "rt"].map(|dir| fill_disk(run.pid(), &lab.dir().join(dir).join("filler")));
            assert!(filled.iter().all(|bytes| *bytes > 1 << 19), "the disks are not full: {filled:?}");
            let ended = run.wait(2 * PATIENCE);
            let stalls = host.end();
            let seen = witness.end();
            late(&seen, &stalls).map_or(Ok((ended, seen)), Err)
        });
        same_steps(&seen, &expected);
        assert_eq!(ended.code, Some(1), "{ended:#?}");
        assert!(!ended.stderr.contains("panicked") && ended.stderr.contains("No space left"), "{ended:#?}");
        figures.sum("drove on with the very steps of a run with room, and said so, in {} runs", 1.0);
    });
    wait_until("everybody has left", || lab.processes().is_empty());
}

#[test]
fn nobody_needs_to_read_what_is_printed() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    // Closed from the start, and a reader that goes away.
    let lines = ["exec \"$@\" >&- 2>&-", "exec \"$@\" 2>&1 | true"];
    seeds::each_real("stdout closed", 2..=10, |draw, figures| {
        let line = draw.random.pick(&lines);
        draw.note(line);
        same_bits(&lab, figures, &expected, |attempt| {
            let robot = lab.robot_named(&format!("o{}x{attempt}", draw.seed()));
            let out = lab.dir().join(&robot);
            let out_text = out.to_string_lossy();
            let args = [&["run"][..], &job, &["--robot", &robot, "--out", &out_text], &SET].concat();
            (shell(&lab, line, &args), out)
        });
        figures.sum("{} runs with the same bits and a whole report", 1.0);
    });
    lab.assert_nothing_left("runs that nobody listens to");
}

/// Ctrl-S in the terminal, a pager that waits: whoever renews the lease does not wait for it.
#[test]
fn a_terminal_that_stands_still_stops_no_robot() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    seeds::each_real("terminal stopped", 1..=10, |draw, figures| {
        unless_spoilt(figures, |attempt| {
            let suffix = format!("t{}x{attempt}", draw.seed());
            let (_nobody_reads, full) = full_pipe();
            let mut robot = Drive::start_as(&lab, &suffix, &job, &[], |mut command| {
                command.stdout(Stdio::null()).stderr(full);
                Running::start_as_is(command)
            });
            // Every death is a line for the terminal.
            for restarts in 1..=3 {
                robot.await_tick(300 * restarts);
                robot.strike("planner", Signal::KILL);
                robot.await_successor("planner", restarts);
            }
            robot.end(0).same_bits(&expected)
        });
        figures.sum("{} lines nobody took, same bits", 3.0);
    });
    lab.assert_nothing_left("drives in front of a terminal that stood still");
}

/// A pipe with no room left, and its other end.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    let flags = fcntl_getfl(&writer).expect("flags");
    fcntl_setfl(&writer, flags | OFlags::NONBLOCK).expect("flags");
    while writer.write(b".").is_ok() {}
    fcntl_setfl(&writer, flags).expect("flags");
    (reader, writer)
}

#[test]
fn a_wall_clock_that_jumps_has_no_effect() {
    let test = "a_wall_clock_that_jumps_has_no_effect";
    let _machine = whole_machine();
    let lab = Lab::new();
    let Some(clock) = JumpingClock::new(&lab) else { return skip(test, "there is no C compiler") };
    let mut date = lab.command_of("date");
    date.arg("+%s");
    clock.show(&mut date);
    let shown: i64 =
        Running::start(date).wait(PATIENCE).expect_code(0).stdout.trim().parse().expect("seconds");
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    let off = shown.abs_diff(now.as_secs() as i64);
    assert!((off as i64 - 7 * 3600).abs() < 100, "the clock does not jump: off by {off} s");
    let path = corners(&lab);
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    seeds::each_real("wall clock put back and forth by hours", 1..=10, |draw, figures| {
        let before = clock.seen_by();
        same_bits(&lab, figures, &expected, |attempt| {
            let out = lab.dir().join(format!("clock-{}-{attempt}", draw.seed()));
            let mut command = lab.command(&["run"]);
            command.args(job).args(SET).args(["--standby", "kanayama", "--robot", &lab.robot()]);
            command.arg("--out").arg(&out);
            clock.show(&mut command);
            (command, out)
        });
        let seen_by = clock.seen_by() - before;
        assert!(seen_by >= 9, "{seen_by} processes only have seen the clock");
        figures.sum("{} processes under such a clock, same bits", seen_by as f64);
    });
    lab.assert_nothing_left("a run under a clock that jumps");
}

/// A worker of the laboratory, as soon as there is one; `None` if launch is gone before.
fn some_worker(lab: &Lab, launch: &mut Running, random: &mut Random, after: Duration) -> Option<i32> {
    let workers = || -> Vec<i32> {
        lab.processes()
            .into_iter()
            .filter(|(_, line)| line.contains(" service "))
            .map(|(pid, _)| pid)
            .collect()
    };
    while workers().is_empty() && launch.lives() {}
    std::thread::sleep(after);
    let found = workers();
    (!found.is_empty()).then(|| random.pick(&found))
}

#[test]
fn whoever_is_killed_while_starting_the_next_start_works_unattended() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.straight(0.04).to_string_lossy().into_owned();
    let robot = lab.robot();
    seeds::each_real("launch or a worker killed 0.5–30 ms after exec", 25..=400, |draw, figures| {
        let after = Duration::from_micros(draw.random.whole(500, 30_000));
        let mut launch = lab.start(&["run", "--path", &path, "--robot", &robot, "--out", "first"]);
        let worker = if draw.random.chance(0.6) {
            some_worker(&lab, &mut launch, &mut draw.random, after)
        } else {
            std::thread::sleep(after);
            None
        };
        draw.note(&format!(
            "{} killed after {after:?}",
            if worker.is_some() { "a worker" } else { "launch" }
        ));
        process::signal(worker.unwrap_or(launch.pid()), Signal::KILL);
        // A launch whose worker died says so, or starts another one and drives to the end.
        let ended = launch.wait(PATIENCE);
        let sound = matches!((ended.code, ended.signal), (Some(0 | 1), None) | (None, Some(9)));
        assert!(sound && !ended.stderr.contains("panicked"), "{ended:#?}");
        wait_until("no process", || lab.processes().is_empty());
        let again = ["run", "--path", &path, "--clock", "lockstep", "--robot", &robot, "--out", "next"];
        let next = lab.hilare(&again);
        assert_eq!((next.code, &*next.stderr), (Some(0), ""), "the next start: {next:#?}");
        lab.assert_nothing_left("the next start");
        figures.sum("{} workers", f64::from(u8::from(worker.is_some())));
        figures.sum(
            "{} launches killed; the next start worked every time, nothing left",
            f64::from(u8::from(worker.is_none())),
        );
    });
}
