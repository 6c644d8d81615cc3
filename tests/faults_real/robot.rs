//! The whole robot: launch, the emergency stop, pauses of the host.

use super::controllers::CORNERS;
use crate::faults::cast::{Seen, Witness};
use crate::faults::drive::{Drive, simulated, sleep_ms, unless_spoilt};
use crate::faults::host::HostWatch;
use crate::faults::seeds;
use crate::faults::watch::{drive, judge, judges};
use crate::support::random::Random;
use crate::support::{Lab, PATIENCE, Running, number, pid_of, process, text, wait_until, whole_machine};
use hilare::config::System;
use hilare_interfaces::messages::{Drive as Why, Steps};
use rustix::process::Signal;
use std::time::{Duration, Instant};

/// Longest that workers may outlive launch.
const GONE: Duration = Duration::from_secs(1);

#[test]
fn a_robot_whose_launch_is_gone_stands_and_its_processes_go() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.straight(1.0).to_string_lossy().into_owned();
    seeds::each_real("launch killed, stopped or not heard", 3..=10, |draw, figures| {
        let (stood, gone_ms) = unless_spoilt(figures, |attempt| {
            let suffix = format!("k{}x{attempt}", draw.seed());
            let mut robot = Drive::start(&lab, &suffix, &["--path", &path], &[]);
            robot.await_tick(draw.random.whole(300, 1500));
            let host = HostWatch::start();
            let before = robot.witness.newest();
            let struck = Instant::now();
            robot.run.signal(Signal::KILL);
            // The witness carries the mark of the laboratory, too.
            let workers = || lab.processes().iter().filter(|(_, line)| line.contains(" service ")).count();
            wait_until("no worker", || workers() == 0);
            let gone = struck.elapsed();
            let late_ms = host.worst_ms();
            let _ = robot.run.wait(PATIENCE);
            let seen = robot.witness.end();
            // The next start of the same robot works unattended, and cleans up.
            let short = lab.straight(0.04).to_string_lossy().into_owned();
            let args = ["run", "--path", &short, "--clock", "lockstep", "--out", "next", "--robot"];
            let next = lab.hilare(&[&args[..], &[&robot.robot]].concat());
            assert_eq!((next.code, &*next.stderr), (Some(0), ""), "the next start: {next:#?}");
            let last = seen.last().expect("ticks").steps;
            assert_eq!(last.twist, [0.0; 3], "it still moves in the last tick: {last:?}");
            let moving = |steps: &Steps| steps.twist != [0.0; 3];
            let still = seen.iter().rposition(|seen| moving(&seen.steps)).expect("it drove");
            let stood = seen[still].steps.tick - before.tick;
            // The look for processes is itself as late as the machine.
            let excess = gone.saturating_sub(GONE).as_secs_f64() * 1e3;
            if excess > 0.0 && late_ms > excess {
                return Err(format!("gone after {gone:?}, the machine itself was late by {late_ms} ms"));
            }
            assert!(gone <= GONE, "workers outlive launch by {gone:?}");
            Ok((stood, gone.as_secs_f64() * 1e3))
        });
        assert!(stood <= 100, "it drove {stood} ticks without launch");
        figures.most("stands ≤ {} ticks after kill -9", stood as f64);
        figures.most("no process left after {} ms", gone_ms.round());
    });
    lab.assert_nothing_left("kill -9 of launch, and the next start");
}

#[test]
fn a_launch_that_stands_still_stops_the_robot_for_as_long() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.straight(0.2).to_string_lossy().into_owned();
    let mut robot = Drive::start(&lab, "s", &["--path", &path], &[]);
    robot.await_tick(500);
    let before = robot.witness.newest();
    robot.run.signal(Signal::STOP);
    wait_until("the lease is lost", || drive(&robot.witness.newest()) == Why::LeaseLost);
    wait_until("it stands", || robot.witness.newest().twist == [0.0; 3]);
    robot.run.signal(Signal::CONT);
    let told = robot.end(0);
    assert_eq!(told.summary["reached"], true);
    let lost = told.after(before.tick).find(|steps| steps.twist == [0.0; 3]).expect("it stood");
    assert!(lost.tick - before.tick <= 102, "it stands {} ticks after SIGSTOP", lost.tick - before.tick);
}

#[test]
fn an_emergency_stop_outlives_every_process_and_launch() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.straight(1.0).to_string_lossy().into_owned();
    seeds::each_real("e-stop, then any process killed", 1..=10, |draw, figures| {
        let robot = lab.robot_named(&format!("e{}", draw.seed()));
        let tell = |args: &[&str]| lab.hilare(&[args, &["--robot", &robot]].concat());
        let up = |with: &[&str]| Running::start(lab.command(&[&["up", "--robot", &robot], with].concat()));
        let launch = up(&["--standby", "kanayama"]);
        lab.await_status(&robot, "it is up", |status| text(status, "mode") == "disarmed");
        tell(&["follow", &path]).expect_code(0);
        let mut witness = Witness::start(&lab, &robot);
        tell(&["arm"]).expect_code(0);
        witness.await_tick(draw.random.whole(400, 1200));
        tell(&["estop"]).expect_code(0);
        wait_until("the emergency stop", || drive(&witness.newest()) == Why::EStop);

        let mut kills = 0;
        for name in ["controller", "waypoint_selector", "pose_estimator", "planner", "step_generator"] {
            let status = lab.status(&robot).expect("it is up");
            process::signal(pid_of(&status, name), Signal::KILL);
            kills += 1;
            sleep_ms(draw.random.whole(0, 150));
            tell(&["arm"]).expect_code(1);
        }
        let stopped = lab.await_status(&robot, "everybody back", |status| {
            let dead = |one: &serde_json::Value| one["state"] == "dead" || one["state"] == "starting";
            !status["processes"].as_array().is_some_and(|all| all.iter().any(dead))
        });
        assert_eq!((text(&stopped, "mode"), number(&stopped, "speed_mps")), ("e-stop", 0.0), "{stopped}");
        launch.signal(Signal::KILL);
        let _ = launch.wait(PATIENCE);
        let seen = witness.end();
        wait_until("no process", || lab.processes().is_empty());
        let first = seen.iter().position(|seen| drive(&seen.steps) == Why::EStop).expect("it stopped");
        assert_ne!(seen[first - 1].steps.twist, [0.0; 3], "it drove until then");
        assert!(seen[first..].iter().all(|seen| seen.steps.twist == [0.0; 3]), "wheels turned after it");

        // Another launch of the same robot has not forgotten.
        let again = up(&[]);
        lab.await_status(&robot, "it is up", |status| text(status, "mode") == "e-stop");
        tell(&["follow", &path]).expect_code(0);
        tell(&["arm"]).expect_code(1);
        sleep_ms(100);
        assert_eq!(number(&lab.status(&robot).expect("it is up"), "speed_mps"), 0.0);
        tell(&["reset"]).expect_code(0);
        tell(&["arm"]).expect_code(0);
        lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.02);
        tell(&["down"]).expect_code(0);
        again.wait(PATIENCE).expect_code(0);
        figures.most(
            "wheels stand in the tick it is heard; latched through {} kills and kill -9 of launch",
            f64::from(kills),
        );
    });
    lab.assert_nothing_left("emergency stops");
}

#[test]
fn a_pause_is_waited_for() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS).to_string_lossy().into_owned();
    let job = ["--path", &*path];
    let expected = simulated(&lab, &job);
    seeds::each_real("host takes the cores away", 1..=10, |draw, figures| {
        let told = unless_spoilt(figures, |attempt| {
            let mut robot = Drive::start(&lab, &format!("h{}x{attempt}", draw.seed()), &job, &[]);
            robot.await_tick(300);
            let clock = robot.pid("step_generator");
            for _ in 0..8 {
                sleep_ms(draw.random.whole(50, 400));
                process::signal(clock, Signal::STOP);
                sleep_ms(draw.random.whole(1, 60));
                process::signal(clock, Signal::CONT);
            }
            robot.end(0).same_bits(&expected)
        });
        assert!(number(&told.summary, "paused_ticks") >= 8.0, "{}", told.summary);
        for pair in told.seen.windows(2) {
            let (was, is) = (pair[0].steps, pair[1].steps);
            assert_eq!(is.tick, was.tick + 1, "a tick is missing");
            let burst = [0, 1].map(|wheel| (is.counts[wheel] - was.counts[wheel]).abs());
            assert!(burst.iter().all(|steps| *steps <= 1), "{was:?} {is:?}");
        }
        figures.sum("{} ticks lost, none hurried, same bits", number(&told.summary, "paused_ticks"));
    });
    lab.assert_nothing_left("drives with pauses");
}

#[test]
fn drivers_have_their_times_whatever_the_host_takes_away() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS).to_string_lossy().into_owned();
    let driver = [
        "motors.pulse_length_s=0.0011",
        "motors.pulse_space_s=0.0008",
        "motors.direction_setup_s=0.0092",
        "motors.direction_hold_s=0.0115",
        "motors.invert_left=true",
    ];
    let mut system = System::load("epuck").expect("built in");
    system.set_all(&driver).expect("known keys");
    let mut robot = Drive::start(&lab, "t", &["--path", &path], &driver);
    robot.await_tick(300);
    let clock = robot.pid("step_generator");
    let (from, started, mut random) = (robot.witness.newest(), Instant::now(), Random::of_seed(1));
    for _ in 0..40 {
        sleep_ms(random.whole(20, 150));
        process::signal(clock, Signal::STOP);
        sleep_ms(random.whole(1, 100));
        process::signal(clock, Signal::CONT);
    }
    let (until, took_ms) = (robot.witness.newest(), started.elapsed().as_secs_f64() * 1e3);
    let told = robot.end(0);
    let mut judges = judges(&system);
    told.seen.iter().filter(|seen| seen.steps.tick > 0).for_each(|seen| judge(&mut judges, &seen.steps));
    let turns = |wheel: usize| {
        let turned = |pair: &&[Seen]| pair[0].steps.dir_level[wheel] != pair[1].steps.dir_level[wheel];
        told.seen.windows(2).filter(turned).count()
    };
    assert!(turns(0) + turns(1) >= 4, "no wheel was turned round at the corners");
    // The robot waited: what was lost is not in the ticks. Half of it, for the witness may be late.
    let lost = (until.paused_ticks - from.paused_ticks) as f64;
    let ticks = (until.tick - from.tick) as f64;
    assert!(lost >= 40.0 && ticks <= took_ms - lost / 2.0, "{ticks} ticks in {took_ms} ms, {lost} lost");
}
