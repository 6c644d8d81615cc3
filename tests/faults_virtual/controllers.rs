//! Controllers that die, stop, or come late: with a standby, without one.

use super::{POLICY, Random, TICKS, constrained, kill, same_bits, setup, under_way, undisturbed};
use crate::faults::plan::{Fault, Line, Plan, Process};
use crate::faults::rig::{Rig, Setup};
use crate::faults::seeds;
use crate::faults::watch::drive;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::{Command, Drive};
use std::collections::HashMap;

/// Anything that can befall the controller in charge alone, some of it at the same time.
fn against_the_active(random: &mut Random) -> Plan {
    let commands = Line::CommandOfActive;
    let mut plan = Plan::NONE;
    for _ in 0..random.whole(1, 3) {
        let fault = match random.whole(0, 9) {
            0 | 1 => kill(random).on(Process::Active),
            2 | 3 => Fault::Stop.on(Process::Active),
            4 => Fault::Drop.on(commands),
            5 => Fault::Delay(random.whole(1, 30)).on(commands),
            6 => Fault::Nan.on(commands),
            7 => Fault::Freeze.on(commands),
            8 => Fault::Delay(random.whole(1, 30))
                .on(random.pick(&[Line::PoseToActive, Line::ReferenceToActive])),
            _ => Fault::Drop.on(random.pick(&[Line::PoseToActive, Line::ReferenceToActive])),
        };
        let twice = Fault::Duplicate(random.whole(0, 40)).on(commands).lasting(random.whole(1, 100));
        let fault = fault.lasting(random.whole(1, 200));
        plan = plan.and(if random.chance(0.3) { fault.and(twice) } else { fault }.after(under_way(random)));
    }
    plan
}

#[test]
fn a_standby_of_the_same_law_leaves_no_trace_of_the_fault() {
    let row = "active controller killed, stopped, late, silent, not a number; standby of the same law";
    seeds::each(row, 100, |draw, figures| {
        let mut setup = setup(&mut draw.random, "kanayama", Some("kanayama"));
        setup.policy.respawn_ticks = draw.random.pick(&[None, Some(1), Some(20), Some(200)]);
        setup.policy.notice_ticks = draw.random.whole(0, 12);
        let drawn = against_the_active(&mut draw.random);
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        assert!(rig.run(TICKS), "it did not arrive");
        same_bits(&rig, &undisturbed(&setup));
        let cycles = rig.watch().cycles();
        assert_eq!((cycles.without, cycles.cut), (0, 0), "{cycles:?}");
        figures.sum("{} cycles lost", cycles.without as f64);
        figures.sum("{} driven by the standby's command", cycles.borrowed as f64);
        figures.sum("{} times it took charge", rig.newest().promotions as f64);
    });
}

/// Kills and stops the controllers in turn, never both at once.
fn in_turn(random: &mut Random) -> Plan {
    let mut plan = Plan::NONE;
    let mut at = under_way(random);
    for process in [Process::Active, Process::Standby, Process::Active] {
        let fault = random.pick(&[Fault::Kill, Fault::KillAmid, Fault::Stop]);
        let lasting = random.whole(10, 140);
        plan = plan.and(fault.on(process).lasting(lasting).after(at));
        // Until the successor stands by: stopped ones are replaced once the other is in charge.
        at += lasting + random.whole(60, 400);
    }
    plan
}

#[test]
fn a_law_with_memory_is_taken_over_with_all_it_remembers() {
    seeds::each("controllers of a law with memory killed or stopped in turn", 16, |draw, figures| {
        let law = draw.random.pick(&["qp", "navigation-circle"]);
        let setup = setup(&mut draw.random, law, Some(law));
        let drawn = in_turn(&mut draw.random);
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        assert!(rig.run(TICKS), "it did not arrive");
        same_bits(&rig, &undisturbed(&setup));
        assert_eq!(rig.watch().cycles().without, 0);
        figures.sum("{} driven by the standby's command", rig.watch().cycles().borrowed as f64);
        figures.sum("{} times it took charge", rig.newest().promotions as f64);
    });
}

/// Commands of all controllers, by source and the tick from which they act.
type Commands = HashMap<(u64, u64), Command>;

/// What acts when another controller's command begins to act: what acted before, changed at most as one of the
/// two changes its own commands (the limits may cut that), and not faster than a stop beside that. How often
/// there was such a change.
fn without_a_jump(rig: &Rig, setup: &Setup, commands: &Commands) -> usize {
    let limits = &setup.system.limits;
    let period = setup.system.timing.period_ticks;
    let target = |source: u64, cycle: u64| {
        let command = commands.get(&(source, cycle))?;
        Some(constrained(&setup.system, command.twist()?))
    };
    let mut changes = 0;
    for pair in rig.steps().windows(2).filter(|pair| pair[0].source != pair[1].source && pair[0].source != 0)
    {
        changes += 1;
        let cycle = pair[1].tick - 1;
        let jump = |part: fn(BodyTwist) -> f64, most: f64| {
            let change = part(pair[1].commanded_twist()) - part(pair[0].commanded_twist());
            let own = [pair[0].source, pair[1].source].into_iter().filter_map(|source| {
                Some(part(target(source, cycle)?) - part(target(source, cycle - period)?))
            });
            let beside = |own: f64| (change - change.clamp(own.min(0.0), own.max(0.0))).abs();
            let beside = own.map(beside).fold(change.abs(), f64::min);
            assert!(beside <= most * TICK_S + 1e-9, "a jump of {beside} at tick {cycle}: {pair:?}");
        };
        jump(|twist| twist.vx_mps, limits.stop_decel_mps2);
        jump(|twist| twist.omega_radps, limits.stop_decel_radps2);
    }
    changes
}

fn another_law(row: &'static str, laws: [&'static str; 2], short: u64) {
    seeds::each(row, short, |draw, figures| {
        let law = draw.random.pick(&laws);
        let setup = setup(&mut draw.random, "kanayama", Some(law));
        let drawn = in_turn(&mut draw.random);
        let plan = draw.plan(drawn);
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        let mut commands = Commands::new();
        while !rig.arrived() && rig.now() < 2 * TICKS {
            rig.step();
            let sent = rig.posts.iter().filter_map(|post| post.last());
            commands.extend(sent.map(|command| ((command.source, command.effective_tick), *command)));
        }
        assert!(rig.arrived(), "it did not arrive");
        let cycles = rig.watch().cycles();
        assert_eq!((cycles.without, cycles.cut), (0, 0), "{cycles:?}");
        let changes = without_a_jump(&rig, &setup, &commands);
        figures.sum("{} cycles lost", cycles.without as f64);
        figures.sum("{} changes of controller without a jump", changes as f64);
    });
}

#[test]
fn a_standby_of_another_law_takes_over_without_a_jump() {
    let row = "active controller killed or stopped; standby of another law";
    another_law(row, ["pure-pursuit", "stanley"], 60);
}

#[test]
fn a_predictive_standby_takes_over_without_a_jump() {
    let row = "active controller killed or stopped; standby is the predictive law";
    another_law(row, ["qp", "qp"], 12);
}

#[test]
fn alone_it_holds_and_ramps_and_drives_on() {
    let row = "active controller killed or stopped; no standby";
    seeds::each(row, 100, |draw, figures| {
        let mut setup = setup(&mut draw.random, "kanayama", None);
        let respawn_ticks = draw.random.whole(20, 80);
        setup.policy.respawn_ticks = Some(respawn_ticks);
        let fault = draw.random.pick(&[Fault::Kill, Fault::Stop]);
        let at = under_way(&mut draw.random);
        let outage = draw.random.whole(25, 120);
        let plan = draw.plan(fault.on(Process::Active).lasting(outage).after(at));
        let mut rig = Rig::new(&setup, &plan, draw.seed());
        assert!(rig.run(TICKS), "it did not arrive");

        let period = setup.system.timing.period_ticks;
        let unanswered = at.div_ceil(period) * period;
        let first = |wanted: Drive, from: u64| {
            let found = rig.steps().iter().find(|steps| steps.tick > from && drive(steps) == wanted);
            found.unwrap_or_else(|| panic!("never {wanted:?} after {from}")).tick - 1
        };
        let (hold, ramp) = (first(Drive::Hold, at), first(Drive::Ramp, at));
        assert_eq!(hold, unanswered + period, "the command before it acts for its period");
        assert!(ramp - unanswered <= 15, "the ramp starts {} ticks after the pose", ramp - unanswered);
        let held = &rig.steps()[hold as usize - 1..ramp as usize];
        if setup.system.limits.accel_mps2 == 0.0 {
            assert!(held.iter().all(|steps| steps.twist == held[0].twist), "held: {held:?}");
        }
        let back = at + if fault == Fault::Kill { POLICY.notice_ticks + respawn_ticks } else { outage };
        let again = first(Drive::Command, ramp);
        assert!(again < back + 2 * period, "it drives {} ticks after it was back", again - back);
        figures
            .most("ramp starts ≤ {} ticks after the first pose left unanswered", (ramp - unanswered) as f64);
        figures.most("≤ {} after the fault", (ramp - at) as f64);
        figures.most("commanded again ≤ {} ticks after the controller is back", (again - back) as f64);
    });
}
