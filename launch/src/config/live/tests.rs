//! The table against the boxes themselves: a key is read by whom its value makes another one of.

use super::super::System;
use super::*;
use crate::shell::ClockKind;
use crate::shell::build;
use hilare_controller::{LawSetup, LawSpec};
use std::collections::BTreeSet;

/// Every kind of robot, with what only some of them read.
fn systems() -> Vec<System> {
    let set = |name: &str, keys: &[&str]| {
        let mut system = System::load(name).expect("built in");
        system.set_all(keys).expect("keys");
        system
    };
    vec![
        set("epuck", &[]),
        set("epuck", &["estimator.kind=ekf"]),
        set("cart", &["estimator.kind=ekf", "tracking.acceptance=rim"]),
        set("agv", &["estimator.kind=ekf"]),
        set("agv", &["estimator.kind=camera"]),
    ]
}

/// What a box is built of in a system, in words.
fn built(role: Role, system: &System, law: &'static LawSpec) -> String {
    match role {
        Controller => {
            let setup = |setup: &LawSetup<'_>| format!("{setup:?}");
            format!("{} {:?}", build::with_setup(system, law, setup), system.prediction)
        }
        StepGenerator => format!("{:?}", build::step_generator(system, ClockKind::Real)),
        WaypointSelector => format!("{:?}", build::waypoint_selector(system)),
        PoseEstimator => format!("{:?}", build::pose_estimator(system)),
        Plant => format!("{:?}", build::plant(system)),
        Planner => {
            let radius_m = system.tracking.acceptance_radius_m;
            format!("{:?} {:?} {} {radius_m}", system.planner, system.fit, system.map)
        }
        _ => String::new(),
    }
}

/// The system with another value of a key that its bounds allow, whatever the other keys say.
fn changed(system: &System, key: &Key) -> System {
    let mut other = system.clone();
    match key.form {
        Form::Number(spec) => {
            let value = key.section.get(system, key.name).expect("its value");
            let step = if spec.kind == ParamKind::Real { (spec.max - spec.min) * 0.01 } else { 1.0 };
            let value = if value + step <= spec.max { value + step } else { value - step };
            other.put(key, value);
        }
        Form::Text(_) if key.path() == "tracking.acceptance" => {
            let now = system.acceptance().name();
            let another = ["bisector", "rim"].into_iter().find(|name| *name != now).expect("another");
            other.set(&format!("tracking.acceptance={another}")).expect("a rule");
        }
        Form::Text(_) => other.map = "platform".to_owned(),
    }
    other
}

#[test]
fn every_live_key_is_read_by_the_boxes_the_table_names_and_by_no_other() {
    let mut seen = BTreeSet::new();
    for system in systems() {
        for key in system.own_keys().filter(|key| matches!(key.liveness(), Liveness::Live(_))) {
            let other = changed(&system, &key);
            let law = key.law().and_then(hilare_controller::law).unwrap_or(system.controller.law);
            let reads = |role: &Role| built(*role, &system, law) != built(*role, &other, law);
            let readers: BTreeSet<Role> = Role::WORKERS.into_iter().filter(reads).collect();
            let said: BTreeSet<Role> = key.readers(&system).iter().copied().collect();
            assert_eq!(said, readers, "{} of {}", key.path(), system.robot);
            if !said.is_empty() {
                seen.insert(key.path());
            }
        }
    }
    // None escapes for want of a robot that has it.
    let live = keys().filter(|key| matches!(key.liveness(), Liveness::Live(_))).map(|key| key.path());
    assert_eq!(live.collect::<BTreeSet<_>>(), seen);
}

#[test]
fn what_is_fixed_says_what_to_do_instead() {
    for key in keys() {
        if let Liveness::Fixed(instead) = key.liveness() {
            assert!(instead.contains("hilare "), "{}", key.path());
        }
    }
    let system = System::default();
    for path in
        ["robot", "controller.law", "controller.exec", "controller.standby", "chassis.kind", "estimator.kind"]
    {
        assert!(matches!(system.key(path).map(|key| key.liveness()), Ok(Liveness::Fixed(_))), "{path}");
    }
}

#[test]
fn keys_are_found_by_section_or_word_and_what_is_none_is_guessed_at() {
    let system = System::default();
    let paths =
        |word: &str| -> Vec<String> { system.keys_like(word).expect("keys").iter().map(Key::path).collect() };
    assert_eq!(
        paths("tracking"),
        ["tracking.acceptance", "tracking.speed_mps", "tracking.acceptance_radius_m"]
    );
    assert!(paths("planner").iter().any(|path| path.starts_with("planner.fit.")));
    assert!(paths("v_max").contains(&"limits.v_max_mps".to_owned()));
    assert_eq!(
        system.keys_like("trackng").unwrap_err(),
        "no key is called like \"trackng\"; did you mean \"tracking\"?"
    );
    let wrong = |path: &str| system.key(path).unwrap_err();
    assert!(
        wrong("tracking.sped_mps").contains("did you mean \"speed_mps\""),
        "{}",
        wrong("tracking.sped_mps")
    );
    assert!(wrong("limit.v_max_mps").contains("limits"), "{}", wrong("limit.v_max_mps"));
    assert!(wrong("controller.qp").contains("is a section"), "{}", wrong("controller.qp"));
    assert!(wrong("plant.traction").contains("motors.kind"), "{}", wrong("plant.traction"));
}
