//! Whatever bits come over its wires, the selector answers with a reference that makes sense.
#![allow(clippy::disallowed_methods, reason = "a test has an environment")]

use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::Block;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::hostile::{cases, integer, message, some};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{MAX_WAYPOINTS, PathHeader, Pose, Reference, ReferenceState, Waypoint};
use hilare_waypoint_selector::{NewPath, SelectorInputs, Tracking, WaypointSelector};
use proptest::prelude::*;

/// A tick, a pose, and a path if one comes.
type Step = (u64, Pose, Option<(u64, Vec<Waypoint>)>);

fn pose() -> impl Strategy<Value = Pose> {
    message((-2.0..2.0f64, -2.0..2.0f64).prop_map(|(x, y)| Pose::at(0, WorldPose::new(x, y, 0.0))))
}

fn waypoint() -> impl Strategy<Value = Waypoint> {
    let sensible = (-2.0..2.0f64, -2.0..2.0f64, -2.0..2.0f64).prop_map(|(x_m, y_m, bulge)| Waypoint {
        x_m,
        y_m,
        bulge,
        crab_rad: 0.0,
    });
    prop_oneof![4 => sensible.clone(), 1 => message(sensible)]
}

fn path() -> impl Strategy<Value = (u64, Vec<Waypoint>)> {
    let long = Just(vec![Waypoint::ZERO; MAX_WAYPOINTS + 1]);
    (integer(), prop_oneof![20 => some(waypoint(), 5), 1 => Just(Vec::new()), 1 => long])
}

fn step() -> impl Strategy<Value = Step> {
    (integer(), pose(), prop_oneof![3 => Just(None), 1 => path().prop_map(Some)])
}

fn judge(reference: &Reference, known: &[Waypoint]) -> Result<(), TestCaseError> {
    prop_assert!(reference.makes_sense(), "{reference:?}");
    let state = ReferenceState::from_code(reference.state);
    prop_assert!(state.is_some(), "{reference:?}");
    prop_assert_eq!(reference.total, known.len() as u64);
    if state != Some(ReferenceState::Idle) {
        prop_assert!((1..reference.total).contains(&reference.index), "{reference:?}");
        prop_assert_eq!(reference.current, known[reference.index as usize]);
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn any_bits_end_in_a_reference_that_makes_sense(
        acceptance in proptest::sample::select(&Acceptance::ALL[..]),
        steps in some(step(), 24),
    ) {
        let mut selector = WaypointSelector::new(Tracking::default(), acceptance);
        // The newest path that could be followed.
        let mut known: Vec<Waypoint> = Vec::new();
        let mut index = 0;
        for (tick, pose, path) in &steps {
            let header = PathHeader { path_id: path.as_ref().map_or(0, |(id, _)| *id), goal_id: 0 };
            let path = path.as_ref().map(|(_, waypoints)| NewPath { header: &header, waypoints });
            let before = selector.rejected_paths();
            let reference = selector.step(*tick, SelectorInputs { pose, path });
            if let Some(path) = path && selector.rejected_paths() == before {
                known = path.waypoints.to_vec();
                index = 1;
                prop_assert_eq!(reference.path_id, header.path_id);
            }
            judge(&reference, &known)?;
            // A pose that makes no sense gets the robot nowhere.
            if !pose.makes_sense() {
                prop_assert_eq!(reference.index, index, "{:?}", pose);
            }
            index = reference.index;
        }
    }
}
