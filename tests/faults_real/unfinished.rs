//! Boxes that die in the middle of making shared memory: whoever opens it does not wait for them.

use super::controllers::CORNERS;
use crate::faults::drive::{Drive, simulated, unless_spoilt};
use crate::faults::preload::Death;
use crate::faults::seeds::{self, Draw};
use crate::support::{Lab, PATIENCE, Running, skip, wait_until, whole_machine};
use rustix::process::Signal;

/// Before it has its size, or before it is readable.
fn moment(draw: &mut Draw) -> &'static str {
    draw.random.pick(&["ftruncate", "fchmod"])
}

#[test]
fn at_start_nobody_waits_for_what_the_dead_were_making() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let Some(death) = Death::new(&lab) else {
        return skip("at_start_nobody_waits_for_what_the_dead_were_making", "there is no C compiler");
    };
    let path = lab.straight(0.04).to_string_lossy().into_owned();
    let robot = lab.robot();
    seeds::each_real("killed at start while making shared memory", 20..=300, |draw, figures| {
        let name = draw.random.pick(&["planner", "controller", "step_generator", "recorder"]);
        let (call, nth) = (moment(draw), draw.random.whole(1, 6));
        draw.note(&format!("{name} dies at {call} {nth}"));
        let mut command = lab.command(&["run", "--path", &path, "--robot", &robot, "--out", "first"]);
        death.await_for(&mut command, (name, 1), call, nth);
        let ended = Running::start(command).wait(PATIENCE);
        // If it has so many files; and whoever dies later than at the start has a successor.
        let came = death.has_come();
        assert!(ended.code == Some(0) || came && ended.code == Some(1), "{ended:#?}");
        assert!(!ended.stderr.contains("panicked"), "{ended:#?}");
        assert!(!ended.stderr.contains("does not leave"), "somebody waited for ever: {ended:#?}");
        wait_until("no process", || lab.processes().is_empty());
        let again = ["run", "--path", &path, "--clock", "lockstep", "--robot", &robot, "--out", "next"];
        let next = lab.hilare(&again);
        assert_eq!((next.code, &*next.stderr), (Some(0), ""), "the next start: {next:#?}");
        lab.assert_nothing_left("the next start");
        figures.sum("{} died at start, nobody waited, the next start worked", f64::from(u8::from(came)));
    });
}

#[test]
fn on_the_way_nobody_waits_for_what_a_successor_was_making() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let Some(death) = Death::new(&lab) else {
        return skip("on_the_way_nobody_waits_for_what_a_successor_was_making", "there is no C compiler");
    };
    let path = lab.file("corners.csv", CORNERS).to_string_lossy().into_owned();
    let job = ["--path", &*path, "--standby", "kanayama"];
    let expected = simulated(&lab, &job[..2]);
    seeds::each_real("successor killed while making shared memory", 4..=60, |draw, figures| {
        let (call, nth) = (moment(draw), draw.random.whole(1, 4));
        draw.note(&format!("the successor of the controller dies at {call} {nth}"));
        unless_spoilt(figures, |attempt| {
            let suffix = format!("u{}x{attempt}", draw.seed());
            let mut robot = Drive::start_as(&lab, &suffix, &job, &[], |mut command| {
                death.await_for(&mut command, ("controller", 2), call, nth);
                Running::start(command)
            });
            robot.await_tick(draw.random.whole(300, 1500));
            robot.await_standby();
            robot.strike("controller", Signal::KILL);
            wait_until("its successor has died, too", || death.has_come());
            robot.await_standby();
            robot.end(0).no_cycle_lost()?.same_bits(&expected)
        });
        figures.sum("{} successors died on the way; 0 cycles lost, same bits", 1.0);
    });
    lab.assert_nothing_left("drives with half-made successors");
}
