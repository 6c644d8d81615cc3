//! The other boxes: pose estimator, waypoint selector, planner, step generator.

use super::{POLICY, STEP_M, TICKS, kill, same_bits, setup, under_way, undisturbed};
use crate::faults::plan::{Fault, Line, Plan, Process};
use crate::faults::rig::{Rig, Setup};
use crate::faults::seeds::{self, Draw};
use crate::faults::watch::drive;
use hilare::shell::build;
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::{Drive, Mode, Waypoint};
use hilare_pose_estimator::EstimatorInputs;

/// Where an estimator that never failed would think the robot is.
fn estimated_from_all_steps(rig: &Rig, setup: &Setup) -> WorldPose {
    let mut estimator = build::pose_estimator(&setup.system);
    let mut pose = setup.system.start;
    for steps in rig.steps() {
        pose = estimator.step(steps.tick, EstimatorInputs { counts: &steps.counts, fixes: &[] }).pose();
    }
    pose
}

/// An outage of a box without which no command comes: when it begins, when it is over, and what it is.
fn outage(draw: &mut Draw, setup: &mut Setup, process: Process, frozen: Plan) -> (Tick, Tick, Plan) {
    let at = under_way(&mut draw.random);
    let respawn_ticks = draw.random.pick(&[5, 20, 60, 150]);
    setup.policy.respawn_ticks = Some(respawn_ticks);
    let lasting = draw.random.whole(5, 200);
    match draw.random.whole(0, 2) {
        0 => {
            let kill = kill(&mut draw.random);
            (at, at + POLICY.notice_ticks + respawn_ticks, kill.on(process).after(at))
        }
        1 => {
            // Launch takes it for hung after a while.
            let replaced = POLICY.liveness_ticks + POLICY.notice_ticks + respawn_ticks;
            let back = at + if lasting > POLICY.liveness_ticks { replaced } else { lasting };
            (at, back, Fault::Stop.on(process).lasting(lasting).after(at))
        }
        _ => (at, at + lasting, frozen.lasting(lasting).after(at)),
    }
}

/// It stands 50 ticks after the outage began, until the box is back. The ticks it took.
fn stands_in_time(rig: &Rig, at: Tick, back: Tick) -> Option<Tick> {
    let in_outage = |tick: Tick| (at + 50..back).contains(&tick);
    let moving = rig.steps().iter().find(|steps| in_outage(steps.tick - 1) && steps.twist != [0.0; 3]);
    assert!(moving.is_none(), "it still moves: {moving:?}");
    let stands = rig.steps().iter().find(|steps| steps.tick > at && steps.twist == [0.0; 3])?.tick - 1;
    (stands < back).then(|| stands - at)
}

#[test]
fn a_robot_that_does_not_know_where_it_is_stands_and_goes_on_from_its_counts() {
    seeds::each("pose estimator killed, stopped or frozen", 100, |draw, figures| {
        let standby = draw.random.chance(0.5).then_some("kanayama");
        let mut setup = setup(&mut draw.random, "kanayama", standby);
        let frozen = Fault::Freeze
            .on(Line::PoseToSelector)
            .and(Fault::Freeze.on(Line::PoseToActive))
            .and(Fault::Freeze.on(Line::PoseToStandby));
        let (at, back, drawn) = outage(draw, &mut setup, Process::PoseEstimator, frozen);
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        assert!(rig.run(TICKS), "it did not arrive");
        if let Some(ticks) = stands_in_time(&rig, at, back) {
            figures.most("stands after ≤ {} ticks", ticks as f64);
        }
        let (pose, wanted) = (rig.pose().pose(), estimated_from_all_steps(&rig, &setup));
        assert_eq!(pose, wanted, "every step counts, in its own tick");
        figures.sum("pose that of a run without the outage, bit for bit, in {} runs", 1.0);
    });
}

#[test]
fn a_path_is_held_and_gone_on_with_at_the_same_waypoint() {
    seeds::each("waypoint selector killed or stopped", 100, |draw, figures| {
        let standby = draw.random.chance(0.5).then_some("kanayama");
        let mut setup = setup(&mut draw.random, "kanayama", standby);
        let frozen =
            Fault::Freeze.on(Line::ReferenceToActive).and(Fault::Freeze.on(Line::ReferenceToStandby));
        let (at, back, drawn) = outage(draw, &mut setup, Process::WaypointSelector, frozen);
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        let total = setup.path.len() as u64;
        let mut index = 0;
        while !rig.arrived() && rig.now() < TICKS {
            rig.step();
            let reference = rig.reference();
            assert!(
                reference.index == index || reference.index == index + 1,
                "{index} to {}",
                reference.index
            );
            assert!(reference.total == total && reference.index < total, "beyond the path: {reference:?}");
            assert_eq!(reference.current, setup.path[reference.index as usize]);
            index = reference.index;
        }
        assert!(rig.arrived(), "it did not arrive");
        if let Some(ticks) = stands_in_time(&rig, at, back) {
            figures.most("stands after ≤ {} ticks", ticks as f64);
        }
        figures.sum("resumed at the same waypoint {} times", 1.0);
    });
}

#[test]
fn a_path_does_not_need_its_planner_any_more() {
    seeds::each("planner killed or stopped", 60, |draw, figures| {
        let mut setup = setup(&mut draw.random, "kanayama", Some("kanayama"));
        let undisturbed = undisturbed(&setup);
        let at = under_way(&mut draw.random);
        let fault = if draw.random.chance(0.5) { kill(&mut draw.random) } else { Fault::Stop };
        let lasting = draw.random.whole(1, 300);
        let plan = draw.plan(fault.on(Process::Planner).lasting(lasting).after(at));
        // A goal in the meantime: it is lost, or its whole path is driven.
        let goal = [(0.1, 0.1), (0.25, 0.1)].map(|(x, y)| Waypoint::straight(x, y));
        if draw.random.chance(0.5) {
            let asked = draw.random.whole(at.saturating_sub(60), at + 60);
            draw.note(&format!("goal at {asked}"));
            setup.goal = Some((asked, goal.to_vec()));
        }
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        let (mut path_id, mut paths) = (1, 1);
        while !rig.arrived() && rig.now() < 2 * TICKS {
            rig.step();
            let reference = rig.reference();
            assert!(reference.path_id >= path_id, "an older path came back");
            paths += u64::from(reference.path_id > path_id);
            path_id = reference.path_id;
            let of: &[Waypoint] = if paths == 1 { &setup.path } else { &goal };
            // The path to a goal begins where the robot is.
            let before = usize::from(paths == 2);
            let whole = reference.total == (of.len() + before) as u64
                && reference.current == of[reference.index as usize - before];
            assert!(whole, "not its whole path: waypoint {} of {}", reference.index, reference.total);
        }
        assert!(rig.arrived(), "it did not arrive");
        if paths == 1 {
            same_bits(&rig, &undisturbed);
        }
        figures.sum("{} with the bits of a run without faults", f64::from(u8::from(paths == 1)));
        figures.sum("{} to a goal asked for meanwhile", f64::from(u8::from(paths == 2)));
    });
}

#[test]
fn without_its_clock_the_robot_stands_until_it_is_armed_again() {
    seeds::each("step generator killed", 60, |draw, figures| {
        let standby = draw.random.chance(0.5).then_some("kanayama");
        let setup = setup(&mut draw.random, "kanayama", standby);
        let at = under_way(&mut draw.random);
        let armed_after = draw.random.whole(1, 400);
        draw.note(&format!("armed after {armed_after}"));
        let kill = kill(&mut draw.random);
        let plan = draw.plan(kill.on(Process::StepGenerator).after(at));
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        // Killed amid a tick: that tick is done, and its successor tells of it.
        let amid = kill == Fault::KillAmid;
        while rig.now() < at + u64::from(amid) {
            rig.step();
        }
        let (steps, truth) = (rig.newest(), *rig.truth());
        let back = at + POLICY.notice_ticks + POLICY.respawn_ticks.unwrap_or(0);
        while rig.now() < back + armed_after {
            rig.step();
            let newest = rig.newest();
            let moved = rig.truth().pose().position().distance_m(truth.pose().position());
            assert!(
                newest.counts == steps.counts && moved <= if amid { 1.001 * STEP_M } else { 0.0 },
                "it moves"
            );
            if newest.tick > steps.tick {
                assert_eq!(drive(&newest), Drive::Disarmed);
            }
        }
        rig.want(Mode::Armed);
        assert!(rig.run(TICKS), "it did not arrive");
        let (pose, wanted) = (rig.pose().pose(), estimated_from_all_steps(&rig, &setup));
        assert_eq!(pose, wanted, "a step was lost");
        figures.sum("0 steps after the kill in {} runs, none lost; still until armed", 1.0);
    });
}
