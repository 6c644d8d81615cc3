//! A warm standby: the controller in charge is killed over and over, and nobody can tell afterwards.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::time::Duration;
use support::random::Random;
use support::{Lab, Running, number, quick, text, whole_machine};

/// Times the controller in charge is killed on the way along the closed rectangle.
const KILLS: usize = 100;

/// The controllers of a status: in charge, and warm standby if there is one.
fn controllers(status: &Value) -> Option<(&Value, &Value)> {
    let processes = status["processes"].as_array()?;
    let of = |wanted: &dyn Fn(&Value) -> bool| {
        processes.iter().find(|process| process["name"] == "controller" && wanted(process))
    };
    let in_charge = of(&|process| process["authority"] == true)?;
    let standby = of(&|process| process["state"] == "standby")?;
    Some((in_charge, standby))
}

fn pid(process: &Value) -> i32 {
    process["pid"].as_i64().and_then(|pid| i32::try_from(pid).ok()).expect("a pid")
}

/// One drive along the rectangle in real time with a standby of the same law; kills until it has arrived.
fn drive_and_kill(lab: &Lab, law: &str, attempt: usize, random: &mut Random) -> (Value, usize) {
    let robot = lab.robot_named(&format!("n{attempt}"));
    let out = lab.dir().join(format!("{law}-{attempt}"));
    let mut command = lab.command(&["run", "rectangle", "--controller", law, "--standby", law]);
    command.args(["--robot", &robot, "--json", "--out", &out.to_string_lossy()]);
    // Deaths by hand are no fault of the controller; a pause of a shared host shall not stop the robot.
    command.args(["--set", "supervision.restart_budget=10000", "--set", "timing.pause_stop_ticks=0"]);
    let mut run = Running::start(command);
    lab.await_status(&robot, "it drives with a warm standby", |status| {
        number(status, "tick") > 300.0 && controllers(status).is_some()
    });
    let mut killed = 0;
    while killed < KILLS && run.lives() {
        let Some(status) = lab.status(&robot) else { break };
        // The state must be the one it has now: a successor that is not warm yet is no standby.
        let Some((in_charge, _)) = controllers(&status) else { continue };
        std::thread::sleep(Duration::from_micros(random.whole(0, 5000)));
        support::process::signal(pid(in_charge), Signal::KILL);
        killed += 1;
        // Launch learns of it at once; the command line shall not be faster.
        std::thread::sleep(Duration::from_millis(20));
    }
    let ended = run.wait(Duration::from_secs(180)).expect_code(0);
    (serde_json::from_str(&ended.stdout).expect("summary.json"), killed)
}

fn simulated(lab: &Lab, law: &str) -> Value {
    let args = ["run", "rectangle", "--controller", law, "--clock", "in-process", "--json"];
    serde_json::from_str(&lab.hilare(&args).expect_code(0).stdout).expect("JSON")
}

/// `cycles_without_command` is 0 in every drive, and the bits are those of a run without faults in every
/// drive in which no command was late; a drive in which the host made one late is driven again.
fn killed_again_and_again(test: &str, law: &str) {
    if quick(test) {
        return;
    }
    let _machine = whole_machine();
    let lab = Lab::new();
    let mut random = Random::new(test, 9);
    let expected = simulated(&lab, law);
    for attempt in 1..=4 {
        let (summary, killed) = drive_and_kill(&lab, law, attempt, &mut random);
        println!("{killed} kills: {summary:#}");
        assert!(
            killed >= KILLS / 2,
            "{killed} kills only: the successors are too slow to be killed more often"
        );
        assert_eq!(number(&summary, "cycles_without_command"), 0.0, "{summary}");
        // The last one may fall together with the arrival.
        assert!((killed - 1..=killed).contains(&(number(&summary, "restarts") as usize)), "{summary}");
        assert_eq!(summary["reached"], true);
        if number(&summary, "commands_late") == 0.0 {
            for key in ["state_hash", "ticks", "steps", "final_pose", "cross_track_mean_m"] {
                assert_eq!(summary[key], expected[key], "{key}: {killed} kills left a trace");
            }
            return lab.assert_nothing_left("a drive with kills");
        }
    }
    panic!("commands were late in four drives out of four: the machine is too busy to tell");
}

#[test]
fn a_hundred_kills_leave_no_trace() {
    killed_again_and_again("a_hundred_kills_leave_no_trace", "kanayama");
}

/// A law that sums up what went wrong: what its successors know of it is its very bits. (Laws that plan, too:
/// in lockstep below, where a slow build is not late.)
#[test]
fn a_hundred_kills_of_a_law_with_a_memory_leave_no_trace() {
    killed_again_and_again("a_hundred_kills_of_a_law_with_a_memory_leave_no_trace", "navigation-circle");
}

#[test]
fn a_standby_changes_no_bit_in_any_clock() {
    let lab = Lab::new();
    let expected = simulated(&lab, "navigation-circle");
    for (clock, standby) in [("lockstep", "navigation-circle"), ("lockstep", "qp"), ("in-process", "qp")] {
        let args = ["run", "rectangle", "--controller", "navigation-circle", "--clock", clock, "--json"];
        let ended = lab.hilare(&[&args[..], &["--standby", standby, "--robot", &lab.robot()]].concat());
        let summary: Value = serde_json::from_str(&ended.expect_code(0).stdout).expect("JSON");
        assert_eq!(summary["state_hash"], expected["state_hash"], "{clock} {standby}");
    }
    lab.assert_nothing_left("runs with a standby");
}

#[test]
fn in_lockstep_time_waits_for_a_lone_successor_and_the_bits_are_the_same() {
    let lab = Lab::new();
    for law in ["kanayama", "qp", "navigation-circle"] {
        let robot = lab.robot_named(law);
        // Long enough to be hit several times, at any speed of the machine.
        let path = lab.straight(5.0);
        let path = path.to_string_lossy();
        let job = ["run", "--path", &path, "--controller", law, "--json"];
        let set = ["--set", "supervision.restart_budget=10000"];
        let one_thread = lab.hilare(&[&job[..], &["--clock", "in-process"]].concat()).expect_code(0);
        let mut run = lab.start(&[&job[..], &set, &["--clock", "lockstep", "--robot", &robot]].concat());
        let mut killed = 0;
        while run.lives() && killed < 3 {
            let Some(status) = lab.status(&robot) else { continue };
            if number(&status, "tick") > 0.0 {
                let dead = support::pid_of(&status, "controller");
                support::process::signal(dead, Signal::KILL);
                killed += 1;
                support::wait_until("a successor, or the end", || {
                    // Launch may not know yet that the one before is dead.
                    let next = |one: &Value| one["name"] == "controller" && one["pid"] != dead;
                    let at_work = |one: &Value| next(one) && one["state"] == "running";
                    let status = lab.status(&robot).unwrap_or_default();
                    status["processes"].as_array().is_some_and(|all| all.iter().any(at_work)) || !run.lives()
                });
            }
        }
        let ended = run.wait(support::PATIENCE).expect_code(0);
        let of = |text: &str| -> Value { serde_json::from_str(text).expect("JSON") };
        let (expected, summary) = (of(&one_thread.stdout), of(&ended.stdout));
        println!("{law}: {killed} kills");
        assert!(killed > 0, "it was over before it could be killed");
        assert_eq!(summary["state_hash"], expected["state_hash"], "{law}, {killed} kills: {summary}");
        assert_eq!(number(&summary, "cycles_without_command"), 0.0);
    }
    lab.assert_nothing_left("lockstep runs with kills");
}

#[test]
fn a_standby_that_stops_is_replaced_and_one_of_another_law_takes_over() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = lab.robot();
    lab.hilare(&["up", "--detach", "--robot", &robot, "--standby", "qp"]).expect_code(0);
    let path = lab.straight(4.0);
    lab.hilare(&["follow", &path.to_string_lossy(), "--robot", &robot]).expect_code(0);
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    let warm = |status: &Value| number(status, "tick") > 300.0 && controllers(status).is_some();
    let status = lab.await_status(&robot, "a warm standby", warm);
    let (in_charge, standby) = controllers(&status).expect("both");
    assert_eq!((text(in_charge, "law"), text(standby, "law")), ("kanayama", "qp"));

    // A standby that hangs is found by its silence.
    support::process::signal(pid(standby), Signal::STOP);
    let hung = pid(standby);
    let status = lab.await_status(&robot, "another standby", |status| {
        controllers(status).is_some_and(|(_, standby)| pid(standby) != hung)
    });
    let (in_charge, standby) = controllers(&status).expect("both");
    assert_eq!(text(in_charge, "law"), "kanayama", "the one in charge drives on");
    let before = number(&status, "cycles_without_command");

    // One in charge that stops is found by its missing commands, within two cycles.
    support::process::signal(pid(in_charge), Signal::STOP);
    let (stopped, next) = (pid(in_charge), pid(standby));
    let status = lab.await_status(&robot, "the standby in charge", |status| {
        controllers(status)
            .is_some_and(|(in_charge, standby)| pid(in_charge) == next && pid(standby) != stopped)
    });
    let (in_charge, standby) = controllers(&status).expect("both");
    assert_eq!((text(in_charge, "law"), text(standby, "law")), ("qp", "kanayama"));
    assert_eq!(number(&status, "cycles_without_command"), before, "no cycle lost: {status}");
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("standbys that stop");
}
