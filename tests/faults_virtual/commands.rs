//! Commands that may not act, or not as they are.

use super::{Random, TICKS, constrained, robot, same_bits, setup, under_way, undisturbed};
use crate::faults::plan::{Fault, Forgery, Line, Plan, Process};
use crate::faults::rig::{Rig, Setup};
use crate::faults::seeds;
use crate::faults::watch::drive;
use hilare::config::System;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::{Command, Drive, Fallback, Steps, Waypoint};

const NOT_HEARD: &str = "lower epoch, wrong source, old or repeated seq";
const ZOMBIE: &str = "stopped controller, woken when another is in charge";
/// Most that a tick takes in.
const COMMANDS_PER_TICK: u64 = 16;

#[test]
fn nobody_else_is_heard_and_each_attempt_is_counted_at_once() {
    seeds::each(NOT_HEARD, 60, |draw, figures| {
        let standby = draw.random.chance(0.5).then_some("kanayama");
        let setup = setup(&mut draw.random, "kanayama", standby);
        let mut drawn = Plan::NONE;
        for _ in 0..draw.random.whole(1, 4) {
            let forgery = Fault::Forge(draw.random.pick(&Forgery::ALL));
            let on = forgery.on(Line::CommandOfActive).lasting(draw.random.whole(5, 1000));
            drawn = drawn.and(on.after(draw.random.whole(0, 1200)));
        }
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        while !rig.arrived() && rig.now() < TICKS {
            if rig.step() {
                assert_eq!(rig.newest().commands_rejected, rig.posts[0].command.forged(), "at {}", rig.now());
            }
        }
        same_bits(&rig, &undisturbed(&setup));
        figures.sum(
            "{} commands of others, each counted in the tick it came",
            rig.posts[0].command.forged() as f64,
        );
    });
}

#[test]
fn a_woken_zombie_is_not_heard() {
    seeds::each(ZOMBIE, 60, |draw, figures| {
        let mut setup = setup(&mut draw.random, "kanayama", Some("kanayama"));
        // Nobody replaces it.
        setup.policy.respawn_ticks = None;
        let at = under_way(&mut draw.random);
        let asleep = draw.random.whole(20, 300);
        let plan = draw.plan(Fault::Stop.on(Process::Active).lasting(asleep).after(at));
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        let (mut waiting, mut ignored) = (0, 0);
        while !rig.arrived() && rig.now() < TICKS {
            let before = rig.newest();
            rig.step();
            let steps = rig.newest();
            if before.promotions == 1 && steps.tick > before.tick {
                waiting += rig.posts[0].sent();
                let refused = steps.commands_rejected - before.commands_rejected;
                assert_eq!(refused, waiting.min(COMMANDS_PER_TICK), "at {}", rig.now());
                waiting -= refused;
                ignored += refused;
            }
        }
        assert_eq!(rig.newest().promotions, 1);
        same_bits(&rig, &undisturbed(&setup));
        figures.sum("{} commands of zombies, each counted in the tick it was read", ignored as f64);
    });
}

#[test]
fn no_number_is_as_no_command() {
    seeds::each("command NaN, infinite", 60, |draw, figures| {
        let standby = draw.random.chance(0.3).then_some("kanayama");
        let setup = setup(&mut draw.random, "kanayama", standby);
        let (at, lasting) = (under_way(&mut draw.random), draw.random.whole(1, 120));
        let against = |fault: Fault| fault.on(Line::CommandOfActive).lasting(lasting).after(at);
        let plan = draw.plan(against(Fault::Nan));
        let mut spoilt = Rig::new(&setup, &plan, draw.seed());
        let mut silent = Rig::new(&setup, &against(Fault::Drop), draw.seed());
        let mut refused = 0;
        while !spoilt.arrived() && spoilt.now() < TICKS {
            spoilt.step();
            silent.step();
            refused += if plan.0[0].lasts_at(spoilt.now() - 1) { spoilt.posts[0].sent() } else { 0 };
            let (found, wanted) = (spoilt.newest(), silent.newest());
            assert!(found.commands_rejected >= refused, "refused in its own tick");
            let told = Steps { refusal: found.refusal, refused_source: found.refused_source, ..wanted };
            let same = Steps { commands_rejected: wanted.commands_rejected, ..found } == told;
            assert!(same, "not as without a command: {found:?} {wanted:?}");
        }
        assert!(spoilt.arrived() && refused > 0 || lasting < 5);
        figures
            .sum("{} refused in the tick they came, all else as if they had not been sent", refused as f64);
    });
}

#[test]
fn too_much_is_scaled_to_the_limits() {
    seeds::each("command over the limits", 60, |draw, figures| {
        let mut setup = setup(&mut draw.random, "kanayama", None);
        setup.system = robot("kanayama", false);
        let overdone = Fault::Overdo(draw.random.pick(&[2, 10, 1000, 1_000_000_000]));
        let (from, lasting) = (draw.random.whole(0, 900), draw.random.whole(5, 800));
        let plan = draw.plan(overdone.on(Line::CommandOfActive).lasting(lasting).after(from));
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        let (mut acting, mut coming) = (None::<Command>, None::<Command>);
        while !rig.arrived() && rig.now() < TICKS {
            rig.step();
            let tick = rig.newest().tick - 1;
            if let Some(sent) = rig.posts[0].last() {
                acting = coming.replace(*sent);
            }
            let Some(command) = acting.filter(|_| !rig.arrived() && drive(&rig.newest()) == Drive::Command)
            else {
                continue;
            };
            assert_eq!(command.effective_tick, tick / 5 * 5);
            let struck = plan.0.iter().find(|event| event.lasts_at(command.pose_tick));
            let times =
                struck.map_or(1.0, |event| if let Fault::Overdo(n) = event.fault { n as f64 } else { 1.0 });
            let wanted = constrained(
                &setup.system,
                BodyTwist::new(command.vx_mps, 0.0, command.omega_radps).scaled(times),
            );
            let [v, _, omega] = rig.newest().twist;
            let off = (v - wanted.vx_mps).abs().max((omega - wanted.omega_radps).abs());
            assert!(off < 1e-12, "tick {tick}: {v}, {omega}, not {wanted:?}");
            figures.sum(
                "{} ticks under such commands, each on the constraint set",
                f64::from(u8::from(struck.is_some())),
            );
            figures.most(
                "curvature as in the paper's equations to {} /m",
                (omega / v.max(1e-6) - wanted.omega_radps / wanted.vx_mps.max(1e-6)).abs(),
            );
        }
    });
}

/// Waypoints nobody would drive: reversals, repetitions, zigzags inside the acceptance circle, far jumps.
fn hostile_path(random: &mut Random) -> Vec<Waypoint> {
    let mut path = vec![Waypoint::straight(0.0, 0.0)];
    for _ in 0..random.whole(2, 8) {
        let last = path[path.len() - 1];
        let reach = random.pick(&[0.0, 1e-9, 0.002, 0.02, 0.05, 0.2, 100.0]);
        let (dx, dy) = (random.real(-reach, reach), random.real(-reach, reach));
        path.push(Waypoint::straight(last.x_m + dx, last.y_m + dy));
    }
    path
}

#[test]
fn a_solver_that_may_not_iterate_has_a_feasible_answer_in_the_same_cycle() {
    seeds::each("QP at its iteration cap, hostile path", 25, |draw, figures| {
        let mut system = robot("qp", draw.random.chance(0.5));
        let cap = draw.random.whole(1, 3);
        system.set(&format!("controller.qp.max_iterations={cap}")).expect("a known key");
        let path = hostile_path(&mut draw.random);
        draw.note(&format!("cap {cap}, path {path:?}"));
        let setup = Setup { path, ..setup_of(&mut draw.random, system) };
        let mut rig = Rig::new(&setup, &Plan::NONE, draw.seed());
        let mut fallbacks = 0;
        while !rig.arrived() && rig.now() < 1000 {
            rig.step();
            let Some(command) = rig.posts[0].last() else { continue };
            let twist = command.twist().expect("a finite command");
            let (limits, chassis) = (&setup.system.limits, &setup.system.chassis);
            let inside = twist.vx_mps <= limits.v_max_mps + 1e-9
                && twist.vx_mps >= limits.v_min_mps - 1e-9
                && twist.omega_radps.abs() <= limits.omega_max_radps + 1e-9
                && chassis.motor_use(twist) <= 1.0 + 1e-9;
            assert!(inside, "outside the limits: {command:?}");
            let fallback = Fallback::from_code(command.fallback).expect("a known fallback");
            assert_eq!(fallback.label().is_empty(), fallback == Fallback::None, "health says why");
            fallbacks += u64::from(fallback != Fallback::None);
        }
        let cycles = rig.watch().cycles();
        assert_eq!((cycles.without, cycles.borrowed), (0, 0), "{cycles:?}");
        assert!(fallbacks > 0 || cap > 1, "one iteration is never enough");
        figures.sum("{} fallbacks, all inside the limits", fallbacks as f64);
        figures.sum("{} cycles lost", cycles.without as f64);
    });
}

fn setup_of(random: &mut Random, system: System) -> Setup {
    Setup { system, ..setup(random, "kanayama", None) }
}
