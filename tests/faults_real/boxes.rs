//! The other boxes: pose estimator, waypoint selector, planner, step generator, recorder.

use super::controllers::CORNERS;
use crate::faults::drive::{Drive, Told, same_steps, simulated, sleep_ms, unless_spoilt};
use crate::faults::seeds::{self, Draw, Figures};
use crate::faults::watch::drive;
use crate::support::{Lab, number, process, text, wait_until, whole_machine};
use hilare::config::System;
use hilare::shell::build;
use hilare_interfaces::block::Block;
use hilare_interfaces::messages::{Drive as Why, Steps};
use hilare_pose_estimator::EstimatorInputs;
use rustix::process::Signal;
use serde_json::Value;

fn corners(lab: &Lab) -> String {
    lab.file("corners.csv", CORNERS).to_string_lossy().into_owned()
}

/// The pose at the end is the one that an estimator which never failed makes of every tick.
fn pose_of_all_steps(told: &Told) {
    let mut estimator = build::pose_estimator(&System::load("epuck").expect("built in"));
    let mut last = 0;
    let ticks = number(&told.summary, "ticks") as u64;
    let mut pose = Default::default();
    for seen in told.seen.iter().filter(|seen| seen.steps.tick <= ticks) {
        assert!(seen.steps.tick <= last + 1, "the witness has missed ticks {last} to {}", seen.steps.tick);
        last = seen.steps.tick;
        pose = estimator.step(last, EstimatorInputs { counts: &seen.steps.counts, fixes: &[] });
    }
    let found = &told.summary["final_pose"];
    let found = ["x_m", "y_m", "theta_rad"].map(|key| number(found, key));
    assert_eq!(found, [pose.x_m, pose.y_m, pose.theta_rad], "as if it had never failed");
}

/// A box without which no command comes stands still for so long that it is replaced: the robot stands 50
/// ticks later, and goes on.
fn stands_and_goes_on(name: &str, draw: &mut Draw, figures: &mut Figures, lab: &Lab, path: &str) -> Told {
    let job = ["--path", path];
    let mut robot = Drive::start(lab, &format!("{}{}", &name[..1], draw.seed()), &job, &[]);
    robot.await_tick(draw.random.whole(400, 1500));
    let stopped = robot.strike(name, Signal::STOP).tick;
    robot.await_successor(name, 1);
    sleep_ms(draw.random.whole(100, 1500));
    robot.strike(name, Signal::KILL);
    let told = robot.end(0);
    assert_eq!(
        (&told.summary["reached"], &told.summary["restarts"]),
        (&true.into(), &2.into()),
        "{}",
        told.log
    );
    let stands = told.after(stopped).find(|steps| steps.twist == [0.0; 3]).expect("it stands").tick;
    // The signal takes effect a tick or two after the one that was seen before it.
    assert!(stands <= stopped + 2 + 50, "it stands {} ticks after the signal", stands - stopped);
    figures.most("stands ≤ {} ticks after SIGSTOP", (stands - stopped) as f64);
    let outages = told.outages_ms();
    figures.most("back after ≤ {} ms when killed", outages.last().copied().unwrap_or(0.0));
    told
}

#[test]
fn a_robot_that_does_not_know_where_it_is_stands_and_loses_no_step() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    seeds::each_real("pose estimator killed, stopped or frozen", 1..=10, |draw, figures| {
        let told = stands_and_goes_on("pose_estimator", draw, figures, &lab, &path);
        pose_of_all_steps(&told);
        figures.sum("final pose that of an estimator that never failed, bit for bit, in {} runs", 1.0);
    });
    lab.assert_nothing_left("drives without an estimator");
}

#[test]
fn a_path_is_gone_on_with_at_the_same_waypoint() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    seeds::each_real("waypoint selector killed or stopped", 1..=10, |draw, figures| {
        let told = stands_and_goes_on("waypoint_selector", draw, figures, &lab, &path);
        pose_of_all_steps(&told);
        // It has driven the same way, which leads through every waypoint once.
        let expected = simulated(&lab, &["--path", &path]);
        for key in ["x_m", "y_m"] {
            let off = number(&told.summary["final_pose"], key) - number(&expected["final_pose"], key);
            assert!(off.abs() < 0.002, "{key}: {off} m beside a run without the fault");
        }
    });
    lab.assert_nothing_left("drives without a selector");
}

#[test]
fn a_path_does_not_need_its_planner() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    seeds::each_real("planner killed or stopped", 1..=10, |draw, figures| {
        unless_spoilt(figures, |attempt| {
            let mut robot = Drive::start(&lab, &format!("p{}x{attempt}", draw.seed()), &job, &[]);
            robot.await_tick(300);
            for restarts in 1..=3 {
                sleep_ms(draw.random.whole(100, 800));
                robot.strike("planner", draw.random.pick(&[Signal::KILL, Signal::ILL]));
                robot.await_successor("planner", restarts);
            }
            robot.end(0).same_bits(&expected)
        });
        figures.sum("{} kills, same bits", 3.0);
    });
    lab.assert_nothing_left("drives without a planner");
}

#[test]
fn nobody_waits_for_those_who_look() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    seeds::each_real("recorder or relay killed or stopped", 1..=10, |draw, figures| {
        let told = unless_spoilt(figures, |attempt| {
            let mut robot = Drive::start(&lab, &format!("r{}x{attempt}", draw.seed()), &job, &[]);
            robot.await_tick(draw.random.whole(300, 3000));
            let observer = draw.random.pick(&["recorder", "relay"]);
            robot.strike(observer, draw.random.pick(&[Signal::KILL, Signal::STOP]));
            let told = robot.end(1);
            told.spoilt().map_or(Ok(told), Err)
        });
        same_steps(&told.seen, &expected);
        figures.sum("{} runs with the very steps of one that is looked at; 0 cycles lost", 1.0);
    });
    lab.assert_nothing_left("drives nobody looks at");
}

/// True if every process works, or has nothing to do.
fn at_work(status: &Value) -> bool {
    let working = |one: &Value| {
        let idle = one["state"] == "ready" && one["name"] == "planner";
        idle || ["running", "standby", "degraded"].iter().any(|state| one["state"] == *state)
    };
    status["processes"].as_array().is_some_and(|all| all.iter().all(working))
}

#[test]
fn in_lockstep_time_waits_for_any_successor_and_the_bits_are_the_same() {
    // Not to measure: it would take the machine from those that do.
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.straight(3.0).to_string_lossy().into_owned();
    let job = ["--path", &*path, "--standby", "kanayama"];
    let expected = simulated(&lab, &job);
    seeds::each_real("any box killed in virtual time", 6..=50, |draw, figures| {
        let robot = lab.robot_named(&format!("v{}", draw.seed()));
        let mut command = lab.command(&["run"]);
        command.args(job).args(["--clock", "lockstep", "--json", "--robot", &robot]);
        command.args(["--set", "supervision.restart_budget=10000"]);
        let mut run = crate::support::Running::start(command);
        let mut kills = 0;
        // Whoever was killed before is back, or those who come back are killed amid it.
        let one_at_a_time = draw.seed().is_multiple_of(2);
        while run.lives() && kills < 8 {
            let name = draw.random.pick(&["controller", "planner", "waypoint_selector", "pose_estimator"]);
            let status = lab.status(&robot).filter(|status| number(status, "tick") > 0.0);
            let status = status.filter(|status| !one_at_a_time || at_work(status));
            let found = status.as_ref().and_then(|status| status["processes"].as_array());
            let Some(one) =
                found.and_then(|all| all.iter().find(|one| one["name"] == name && one["pid"] != 0))
            else {
                continue;
            };
            draw.note(&format!("{name} killed"));
            process::signal(number(one, "pid") as i32, Signal::KILL);
            kills += 1;
            sleep_ms(if one_at_a_time { draw.random.whole(20, 80) } else { draw.random.whole(1, 50) });
        }
        let ended = run.wait(2 * crate::support::PATIENCE).expect_code(0);
        let summary: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        for key in ["state_hash", "ticks", "steps", "final_pose", "cycles_without_command"] {
            assert_eq!(summary[key], expected[key], "{key} after {kills} kills: {ended:#?}");
        }
        figures.sum("{} kills, same bits", f64::from(kills));
    });
    lab.assert_nothing_left("lockstep runs with kills");
}

#[test]
fn without_its_clock_the_robot_stands_until_it_is_armed_again() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = corners(&lab);
    seeds::each_real("step generator killed", 1..=10, |draw, figures| {
        let robot = lab.robot_named(&format!("g{}", draw.seed()));
        let tell = |args: &[&str]| lab.hilare(&[args, &["--robot", &robot]].concat()).expect_code(0);
        tell(&["up", "--detach"]);
        tell(&["follow", &path]);
        let mut witness = crate::faults::cast::Witness::start(&lab, &robot);
        tell(&["arm"]);
        witness.await_tick(draw.random.whole(500, 2000));
        let status = lab.status(&robot).expect("it is up");
        process::signal(crate::support::pid_of(&status, "step_generator"), Signal::KILL);
        lab.await_status(&robot, "a disarmed successor", |status| {
            text(status, "mode") == "disarmed" && text(status, "drive") == "disarmed"
        });
        sleep_ms(200);
        let still = witness.newest();
        tell(&["arm"]);
        lab.await_status(&robot, "the arrival", |status| status["path_state"] == "arrived");
        wait_until("rest", || witness.newest().twist == [0.0; 3]);
        tell(&["down"]);
        let seen = witness.end();
        let disarmed = |steps: &Steps| steps.tick > 0 && drive(steps) == Why::Disarmed;
        let first_still = seen.iter().position(|seen| disarmed(&seen.steps)).expect("it was disarmed");
        let before = seen[first_still - 1].steps;
        let off = [0, 1].map(|wheel| (still.counts[wheel] - before.counts[wheel]).abs());
        // The last tick may have been done and not sent any more; its successor tells of it.
        assert!(off.iter().all(|steps| *steps <= 1), "it moved by {off:?} steps while it was disarmed");
        let between = seen[first_still..].iter().take_while(|seen| seen.steps.tick <= still.tick);
        assert!(between.into_iter().all(|seen| seen.steps.twist == [0.0; 3]), "it moved by itself");
        for pair in seen.windows(2).filter(|pair| pair[1].steps.tick > pair[0].steps.tick) {
            let ticks = (pair[1].steps.tick - pair[0].steps.tick) as i64;
            let jump = (pair[1].steps.counts[0] - pair[0].steps.counts[0]).abs();
            assert!(jump <= ticks, "counts jump: {pair:?}");
        }
        figures.sum("still until armed, counts go on, arrived, in {} runs", 1.0);
    });
    lab.assert_nothing_left("a robot whose step generator was killed");
}
