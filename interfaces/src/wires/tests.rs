use super::*;

#[test]
fn every_wire_has_both_ends_and_its_own_name() {
    for (i, wire) in WIRES.iter().enumerate() {
        // Those of the relay are for whoever comes.
        assert!(!wire.from.is_empty() && (!wire.to.is_empty() || wire.is_watch()), "{}", wire.name);
        // The relay repeats its own health with that of the others.
        let itself = |reader: &Reader| wire.written_by(reader.role) && wire.name != HEALTH.name;
        assert!(!wire.to.iter().any(itself), "{}", wire.name);
        assert!(WIRES[..i].iter().all(|other| other.name != wire.name), "{}", wire.name);
    }
}

#[test]
fn the_control_path_never_sees_the_truth() {
    let outside = [Role::Relay, Role::Recorder, Role::Operator, Role::Launch];
    for wire in [&TRUTH, &watch::TRUTH] {
        assert!(wire.to.iter().all(|reader| outside.contains(&reader.role)), "{:?}", wire.to);
    }
}

#[test]
fn the_clock_starts_last_and_readers_before_the_writers_that_wake_them() {
    let order = start_order();
    assert_eq!(order[order.len() - 1], Role::StepGenerator);
    for role in Role::WORKERS {
        assert_eq!(order.iter().filter(|r| **r == role).count(), 1);
    }
    let place = |role| order.iter().position(|r| *r == role).unwrap();
    assert!(place(Role::Controller) < place(Role::WaypointSelector));
    assert!(place(Role::WaypointSelector) < place(Role::PoseEstimator));
    assert!(place(Role::WaypointSelector) < place(Role::Planner));
}

#[test]
fn nobody_on_the_tick_waits_for_an_observer() {
    for wire in WIRES {
        let observers = [Role::Relay, Role::Recorder, Role::Operator, Role::Launch];
        assert!(!observers.iter().any(|role| wire.wakes(*role)), "{}", wire.name);
    }
}

#[test]
fn who_only_looks_reads_no_wire_that_the_tick_or_the_loop_writes() {
    let loop_boxes =
        [Role::WaypointSelector, Role::Controller, Role::StepGenerator, Role::PoseEstimator, Role::Plant];
    for wire in WIRES.iter().filter(|wire| wire.from.iter().any(|from| loop_boxes.contains(from))) {
        let looks = |reader: &Reader| !loop_boxes.contains(&reader.role) && reader.role != Role::Relay;
        // Twenty times a second, and launch has to know at once.
        let allowed = if wire.name == HEALTH.name { 1 } else { 0 };
        assert_eq!(wire.to.iter().filter(|reader| looks(reader)).count(), allowed, "{}", wire.name);
    }
}

#[test]
fn the_relay_repeats_every_wire_it_reads_and_nothing_else() {
    let read = WIRES.iter().filter(|wire| wire.read_by(Role::Relay)).map(|wire| wire.name);
    let repeated = WIRES.iter().filter_map(|wire| wire.name.strip_prefix("watch/"));
    // The journal comes from no wire: the boxes keep it in memory they share with the relay.
    assert!(read.chain(["journal"]).eq(repeated));
}
