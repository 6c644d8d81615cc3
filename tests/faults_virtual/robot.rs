//! The whole robot: launch, the emergency stop, the host, everything at once.

use super::{POLICY, Random, TICKS, kill, same_bits, setup, under_way, undisturbed};
use crate::faults::launch::LEASE_TICKS;
use crate::faults::plan::{Fault, Forgery, Line, Place, Plan, Process};
use crate::faults::rig::{Rig, Setup};
use crate::faults::seeds::{self, Draw};
use crate::faults::watch::drive;
use hilare::config::System;
use hilare::shell::ClockKind;
use hilare_interfaces::messages::{Drive, Mode, Waypoint};
use hilare_recorder::statistics::RunFigures;

#[test]
fn a_robot_that_hears_nothing_of_launch_stands() {
    seeds::each("launch killed, stopped or not heard", 100, |draw, figures| {
        let standby = draw.random.chance(0.5).then_some("kanayama");
        let setup = setup(&mut draw.random, "kanayama", standby);
        let at = under_way(&mut draw.random);
        let lasting = draw.random.whole(1, 400);
        let fault = match draw.random.whole(0, 2) {
            0 => Fault::Kill.on(Process::Launch),
            1 => Fault::Stop.on(Process::Launch),
            _ => Fault::Drop.on(Line::Authority),
        };
        let plan = draw.plan(fault.lasting(lasting).after(at));
        let killed = plan.0[0].fault == Fault::Kill;
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        rig.run(if killed { at + 400 } else { TICKS });
        assert!(killed || rig.arrived(), "it did not arrive");

        let silent = |tick: u64| tick >= at && (killed || tick < at + lasting);
        let late = |tick: u64| tick >= at + 100 && silent(tick);
        let moving = rig.steps().iter().find(|steps| late(steps.tick - 1) && steps.twist != [0.0; 3]);
        assert!(moving.is_none() || rig.arrived() && killed, "it still moves: {moving:?}");
        let stood = |steps: &&hilare_interfaces::messages::Steps| {
            silent(steps.tick - 1) && drive(steps) == Drive::LeaseLost && steps.twist == [0.0; 3]
        };
        if let Some(steps) = rig.steps().iter().find(stood) {
            figures.most("stands after ≤ {} ticks", (steps.tick - 1 - at) as f64);
        }
        if rig.arrived() && !rig.steps().iter().any(|steps| drive(steps) == Drive::LeaseLost) {
            same_bits(&rig, &undisturbed(&setup));
            figures.sum("{} too short to be felt: same bits", 1.0);
        }
    });
}

#[test]
fn an_emergency_stop_outlives_every_process() {
    seeds::each("e-stop, then any process killed", 60, |draw, figures| {
        let setup = setup(&mut draw.random, "kanayama", Some("kanayama"));
        let at = under_way(&mut draw.random);
        let processes = [
            Process::Active,
            Process::Standby,
            Process::WaypointSelector,
            Process::PoseEstimator,
            Process::Planner,
            Process::StepGenerator,
        ];
        let mut drawn = Plan::NONE;
        for _ in 0..draw.random.whole(1, 6) {
            let kill = kill(&mut draw.random).on(draw.random.pick(&processes));
            drawn = drawn.and(kill.after(at + draw.random.whole(0, 250)));
        }
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        while rig.now() < at {
            rig.step();
        }
        rig.want(Mode::EStop);
        let clock = Place::Process(Process::StepGenerator);
        let deaths_of_clock = plan.0.iter().filter(|event| event.place == clock).count();
        let (mut slowest, mut disarmed) = (0, 0);
        for n in 1..=400 {
            if rig.step() {
                let steps = rig.newest();
                assert_eq!(steps.twist, [0.0; 3], "{n} ticks later: {steps:?}");
                // A successor of the step generator stands as one that is not armed until launch speaks to it.
                disarmed += usize::from(drive(&steps) == Drive::Disarmed);
                assert!(
                    drive(&steps) == Drive::EStop || disarmed <= deaths_of_clock * LEASE_TICKS as usize,
                    "{n} ticks later: {steps:?}"
                );
                slowest = if slowest == 0 { n } else { slowest };
            }
            // Neither is a reset. Launch refuses the first; the step generator what launch should not say.
            let other = draw.random.pick(&[Mode::Armed, Mode::Stop]);
            match draw.random.whole(0, 39) {
                0 | 1 => rig.want(other),
                2 if deaths_of_clock == 0 => rig.insist(other),
                3 => rig.insist(Mode::EStop),
                _ => {}
            }
        }
        rig.insist(Mode::EStop);
        rig.want(Mode::Disarmed);
        rig.run(30);
        rig.want(Mode::Armed);
        assert!(rig.run(TICKS), "it did not arrive");
        if deaths_of_clock == 0 {
            figures.most("wheels stand {} tick after it is pressed, at any speed", slowest as f64);
        }
        figures.sum("latched through {} kills", plan.0.len() as f64);
    });
}

#[test]
fn a_pause_is_waited_for_and_a_long_one_stops() {
    seeds::each("host takes the cores away", 100, |draw, figures| {
        let setup = setup(&mut draw.random, "kanayama", None);
        let long = draw.random.chance(0.3);
        let mut drawn = Plan::NONE;
        let pauses = draw.random.whole(1, 5);
        for n in 0..pauses {
            // All processes, or the clock alone; the others have their work done when it comes back.
            let all = draw.random.chance(0.5);
            let fault =
                if all { Fault::Pause.on(Place::Machine) } else { Fault::Stop.on(Process::StepGenerator) };
            let ticks = if all { draw.random.whole(1, 99) } else { draw.random.whole(1, 50) };
            drawn = drawn.and(fault.lasting(ticks).after(1 + 300 * n + draw.random.whole(0, 200)));
        }
        let longest = draw.random.whole(100, 5000);
        if long {
            drawn = drawn.and(Fault::Pause.on(Place::Machine).lasting(longest).after(1 + 300 * pauses));
        }
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        let end = plan.0.iter().map(|event| event.from + 60).max().unwrap_or(0);
        rig.run(end);
        if long && !rig.arrived() {
            rig.run(60);
            assert_eq!((drive(&rig.newest()), rig.newest().twist), (Drive::PauseStop, [0.0; 3]));
            rig.want(Mode::Stop);
            rig.run(2);
            rig.want(Mode::Armed);
        }
        assert!(rig.run(TICKS), "it did not arrive");
        if !long {
            same_bits(&rig, &undisturbed(&setup));
            figures.sum("{} with the bits of a run without pauses", 1.0);
        }
        let newest = rig.newest();
        figures.sum("{} ticks lost and none hurried", newest.paused_ticks as f64);
        let paused = plan.0.iter().filter(|event| event.from < rig.now() && event.fault == Fault::Pause);
        assert!(newest.paused_max_ticks >= paused.map(|event| event.ticks).max().unwrap_or(0));
    });
}

/// Boxes but the clock end or stand still: `at_once` of them at about the same time, again and again.
fn boxes_die(random: &mut Random, at_once: u64) -> Plan {
    let processes = [
        Process::Active,
        Process::Standby,
        Process::WaypointSelector,
        Process::PoseEstimator,
        Process::Planner,
    ];
    let mut plan = Plan::NONE;
    let mut at = random.whole(1, 400);
    for _ in 0..random.whole(1, 4) {
        // Together, or each when the one before is just back.
        let within = random.pick(&[8, 80]);
        for _ in 0..at_once {
            let fault = if random.chance(0.7) { kill(random) } else { Fault::Stop };
            let on = fault.on(random.pick(&processes)).lasting(random.whole(1, 200));
            plan = plan.and(on.after(at + random.whole(0, within)));
        }
        // Until whoever died is back.
        at += random.whole(260, 600);
    }
    plan
}

/// In lockstep, with some of the boxes killed or stopped at a time. What it came to.
fn where_time_waits(draw: &mut Draw, at_once: u64) -> (Rig, RunFigures) {
    let law = draw.random.pick(&["kanayama", "kanayama", "navigation-circle"]);
    let standby = draw.random.chance(0.5).then_some(law);
    draw.note(&format!("{law}, standby {standby:?}"));
    let mut setup = setup(&mut draw.random, law, standby);
    setup.clock = ClockKind::Lockstep;
    setup.policy.respawn_ticks = Some(draw.random.whole(1, 40));
    let drawn = boxes_die(&mut draw.random, at_once);
    let plan = draw.plan(drawn);
    let mut rig = Rig::new(&setup, &plan, draw.seed());
    assert!(rig.run(3 * TICKS), "stuck at {:?}", rig.newest());
    (rig, undisturbed(&setup))
}

#[test]
fn where_time_waits_nobody_can_tell_who_died() {
    seeds::each("any box killed in virtual time", 100, |draw, figures| {
        let (rig, expected) = where_time_waits(draw, 1);
        same_bits(&rig, &expected);
        assert_eq!(rig.watch().cycles().without, 0);
        figures.sum("same bits {} times", 1.0);
    });
}

#[test]
fn where_time_waits_it_is_never_stuck_whoever_died() {
    seeds::each("several boxes killed at once in virtual time", 100, |draw, figures| {
        let at_once = draw.random.whole(2, 5);
        let (rig, _) = where_time_waits(draw, at_once);
        let cycles = rig.watch().cycles();
        figures.sum("{} cycles lost, each counted", cycles.without as f64);
        figures.sum("of {}", (cycles.own + cycles.borrowed) as f64);
    });
}

/// A robot of any kind on a way that suits it.
fn any_robot(random: &mut Random) -> Setup {
    let (system, law, points): (_, _, &[(f64, f64)]) = match random.whole(0, 9) {
        0 => ("cart", "navigation-circle", &[(0.0, 0.0), (0.7, 0.0), (1.2, 0.4)]),
        1 => ("agv", "finite-step", &[(0.0, 0.0), (0.5, 0.0), (0.8, 0.2)]),
        _ => {
            let standby = random.pick(&["kanayama", "stanley"]);
            return setup(random, "kanayama", Some(standby));
        }
    };
    let mut built = System::load(system).expect("built in");
    let estimator = random.pick(&["ekf", "dead-reckoning"]);
    built
        .set_all(&[format!("controller.law={law}"), format!("estimator.kind={estimator}")])
        .expect("known keys");
    Setup {
        standby: Some(built.clone()),
        system: built,
        path: points.iter().map(|(x_m, y_m)| Waypoint::straight(*x_m, *y_m)).collect(),
        policy: POLICY,
        goal: None,
        clock: ClockKind::Real,
    }
}

const LINES: [Line; 13] = [
    Line::Authority,
    Line::CommandOfActive,
    Line::CommandOfStandby,
    Line::StepsToEstimator,
    Line::StepsToPlant,
    Line::StepsToLaunch,
    Line::Wheels,
    Line::Fix,
    Line::PoseToSelector,
    Line::PoseToActive,
    Line::PoseToStandby,
    Line::ReferenceToActive,
    Line::ReferenceToStandby,
];

/// A fault of any kind that leaves what is sent true.
fn honest_fault(random: &mut Random) -> Plan {
    let processes = [
        Process::Active,
        Process::Standby,
        Process::WaypointSelector,
        Process::PoseEstimator,
        Process::Planner,
        Process::StepGenerator,
    ];
    let commands = random.pick(&[Line::CommandOfActive, Line::CommandOfStandby]);
    match random.whole(0, 9) {
        0 | 1 => kill(random).on(random.pick(&processes)),
        2 | 3 => Fault::Stop.on(random.pick(&processes)),
        4 => Fault::Pause.on(Place::Machine),
        5 => Fault::Drop.on(random.pick(&LINES)),
        6 => Fault::Delay(random.whole(1, 60)).on(random.pick(&LINES)),
        7 => Fault::Duplicate(random.whole(0, 60)).on(random.pick(&LINES)),
        8 => Fault::Nan.on(commands),
        _ => Fault::Forge(random.pick(&Forgery::ALL)).on(commands),
    }
}

/// A fault that makes what is sent untrue.
fn lie(random: &mut Random) -> Plan {
    let line = random.pick(&LINES);
    match random.whole(0, 3) {
        0 => Fault::Corrupt(random.whole(1, 8)).on(line),
        1 => Fault::Nan.on(line),
        2 => Fault::Freeze.on(line),
        _ => Fault::Overdo(random.pick(&[2, 1000]))
            .on(random.pick(&[Line::CommandOfActive, Line::CommandOfStandby])),
    }
}

fn storm(random: &mut Random, lies: bool) -> Plan {
    let mut plan = Plan::NONE;
    for n in 0..random.whole(2, 10) {
        let fault = if lies && n.is_multiple_of(2) { lie(random) } else { honest_fault(random) };
        plan = plan.and(fault.lasting(random.whole(1, 150)).after(random.whole(1, 1500)));
    }
    plan
}

/// Drives on whatever happens: an operator who arms again whatever has disarmed or stopped the robot.
fn drive_through(rig: &mut Rig, until: u64) -> bool {
    while !rig.arrived() && rig.now() < until {
        rig.run(100);
        let drive = drive(&rig.newest());
        if matches!(drive, Drive::Disarmed | Drive::PauseStop | Drive::Stop) {
            rig.want(Mode::Stop);
            rig.run(2);
            rig.want(Mode::Armed);
        }
    }
    rig.arrived()
}

#[test]
fn whatever_happens_limits_are_kept_and_it_arrives() {
    seeds::each("everything at once", 150, |draw, figures| {
        let setup = any_robot(&mut draw.random);
        let drawn = storm(&mut draw.random, false);
        draw.note(&setup.system.robot);
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        assert!(drive_through(&mut rig, 20_000), "stuck: {:?}", rig.newest());
        let cycles = rig.watch().cycles();
        figures.sum("{} faults", plan.0.len() as f64);
        figures.sum("{} cycles driven by their own command", cycles.own as f64);
        figures.sum("{} by the standby's", cycles.borrowed as f64);
        figures.sum("{} held or ramped", cycles.without as f64);
    });
}

#[test]
fn whatever_is_sent_limits_are_kept() {
    seeds::each("lies on every wire", 150, |draw, figures| {
        let setup = any_robot(&mut draw.random);
        let drawn = storm(&mut draw.random, true);
        draw.note(&setup.system.robot);
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        drive_through(&mut rig, 2500);
        figures.sum("{} faults", plan.0.len() as f64);
    });
}
