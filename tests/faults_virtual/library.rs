//! The library itself: plans are what they print, and without faults the rig is the run of one thread.

use super::{Random, TICKS, setup};
use crate::faults::plan::{Event, Fault, Forgery, Line, Place, Plan, Process};
use crate::faults::rig::Rig;
use hilare::shell::in_process::InProcess;

#[test]
fn a_plan_is_what_it_prints() {
    let plan = Fault::Stop
        .on(Process::Active)
        .lasting(40)
        .and(Fault::Delay(7).on(Line::CommandOfStandby).lasting(3).after(100))
        .and(Fault::Forge(Forgery::OldSeq).on(Line::CommandOfActive))
        .and(Fault::ClockStep(-7).on(Place::Machine))
        .after(1200);
    let text = "stop active @1200+40; delay:7 command<standby @1300+3; forge:3 command<active @1200; \
                clock-step:-7 machine @1200";
    assert_eq!(plan.to_string(), text);
    assert_eq!(text.parse(), Ok(plan.clone()));
    assert_eq!(Plan::NONE.to_string().parse(), Ok(Plan::NONE));
    assert_eq!(plan.begins(), Some(1200));
    assert!("kill nobody @3".parse::<Plan>().is_err() && "kill active".parse::<Plan>().is_err());
    let event: Event = "drop authority @5+2".parse().expect("an event");
    assert_eq!([4, 5, 6, 7].map(|tick| event.lasts_at(tick)), [false, true, true, false]);
}

#[test]
fn without_faults_the_rig_is_the_run_of_one_thread() {
    let mut random = Random::of_seed(1);
    for (law, standby) in [("kanayama", None), ("kanayama", Some("kanayama")), ("qp", Some("kanayama"))] {
        let setup = setup(&mut random, law, standby);
        let alone = InProcess::new(&setup.system, &setup.path).expect("a robot").run(TICKS);
        let mut rig = Rig::new(&setup, &Plan::NONE, 1);
        assert!(rig.run(TICKS));
        let (ours, theirs) = (rig.statistics().figures(), alone.statistics.figures());
        assert_eq!(ours, theirs, "{law}, {standby:?}");
        let cycles = rig.watch().cycles();
        assert_eq!((cycles.borrowed, cycles.without, cycles.cut), (0, 0, 0), "{law}, {standby:?}");
    }
}
