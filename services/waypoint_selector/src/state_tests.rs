//! A selector that takes on the state of another goes on where that one was.

use super::*;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::state::STATE_WORDS;
use proptest::prelude::*;
use std::vec;

/// A path under an id.
type Path = (u64, Vec<Waypoint>);

fn path(path_id: u64, points: &[(f64, f64)]) -> Path {
    (path_id, points.iter().map(|(x_m, y_m)| Waypoint::straight(*x_m, *y_m)).collect())
}

fn square() -> Path {
    path(7, &[(0.0, 0.0), (0.4, 0.0), (0.4, 0.3), (0.0, 0.3), (0.0, 0.0)])
}

fn step(selector: &mut WaypointSelector, (x_m, y_m): (f64, f64), path: Option<&Path>) -> Reference {
    let header = PathHeader { path_id: path.map_or(0, |path| path.0), goal_id: 0 };
    let path = path.map(|path| NewPath { header: &header, waypoints: &path.1 });
    let pose = Pose::at(10, WorldPose::new(x_m, y_m, 0.0));
    selector.step(10, SelectorInputs { pose: &pose, path })
}

fn new(acceptance: Acceptance) -> WaypointSelector {
    WaypointSelector::new(Tracking::default(), acceptance)
}

fn state(selector: &mut WaypointSelector) -> Vec<u64> {
    let mut room = [0; STATE_WORDS];
    let words = selector.save_state(&mut room).expect("room");
    room[..words].to_vec()
}

/// Another selector, with what this one left.
fn successor(selector: &mut WaypointSelector) -> WaypointSelector {
    let mut other = new(selector.acceptance);
    assert!(other.load_state(&state(selector)));
    other
}

#[test]
fn it_waits_for_its_path_and_goes_on_where_the_other_was() {
    let (mut old, square) = (new(Acceptance::Rim), square());
    assert_eq!(state(&mut old), [0; 4]);
    assert_eq!(successor(&mut old).awaits_path(), None);
    step(&mut old, (0.0, 0.0), Some(&square));
    step(&mut old, (0.39, 0.0), None);
    let mut next = successor(&mut old);
    assert_eq!((old.awaits_path(), next.awaits_path()), (None, Some(7)));
    // However long it waits, and whatever comes that is no path.
    for _ in 0..3 {
        let reference = step(&mut next, (0.4, 0.3), Some(&path(7, &[(0.0, f64::NAN), (1.0, 1.0)])));
        assert_eq!(reference.state, ReferenceState::Idle.code());
        assert_eq!((next.awaits_path(), state(&mut next)), (Some(7), state(&mut old)));
    }
    let mut third = successor(&mut next);
    let (a, b) = (step(&mut old, (0.3, 0.0), None), step(&mut next, (0.3, 0.0), Some(&square)));
    assert_eq!((a, a.index), (b, 2));
    assert_eq!((next.awaits_path(), step(&mut third, (0.3, 0.0), Some(&square))), (None, a));
}

#[test]
fn with_its_path_it_repeats_what_the_other_said_last() {
    let (mut old, square) = (new(Acceptance::Rim), square());
    step(&mut old, (0.0, 0.0), Some(&square));
    let said: Vec<Reference> = [0.3, 0.39, 0.4].iter().map(|x| step(&mut old, (*x, 0.0), None)).collect();
    assert_eq!(said.iter().map(|reference| reference.index).collect::<Vec<_>>(), [1, 2, 2]);
    let take_up = |selector: &mut WaypointSelector, (path_id, waypoints): &Path| -> Vec<Reference> {
        let header = PathHeader { path_id: *path_id, goal_id: 0 };
        selector.take_up(NewPath { header: &header, waypoints }).collect()
    };
    assert_eq!(take_up(&mut old, &square), [], "it awaits none");
    let mut next = successor(&mut old);
    let broken = path(7, &[(0.0, f64::NAN), (0.4, 0.0), (0.4, 0.3), (0.0, 0.3), (0.0, 0.0)]);
    for other in [(8, square.1.clone()), (7, square.1[..4].to_vec()), broken] {
        assert_eq!((take_up(&mut next, &other), next.awaits_path()), (vec![], Some(7)));
    }
    assert_eq!((take_up(&mut next, &square), next.awaits_path()), (said, None));
    assert_eq!(step(&mut next, (0.4, 0.3), None), step(&mut old, (0.4, 0.3), None));
    // On arrival, too, and of a path that was new then.
    let there: Vec<Reference> = (0..9).map(|_| step(&mut old, (0.0, 0.0), None)).collect();
    assert_eq!(take_up(&mut successor(&mut old), &square), there[6..]);
    let other = path(9, &[(0.0, 0.0), (1.0, 0.0)]);
    let first = step(&mut old, (0.0, 0.0), Some(&other));
    assert_eq!(take_up(&mut successor(&mut old), &other), [first]);
}

#[test]
fn any_other_path_begins_anew() {
    let (mut old, square) = (new(Acceptance::Rim), square());
    step(&mut old, (0.0, 0.0), Some(&square));
    step(&mut old, (0.39, 0.0), None);
    let others = [(8, square.1.clone()), (7, square.1[..4].to_vec()), (7, square.1[..2].to_vec())];
    for other in others {
        let mut next = successor(&mut old);
        assert_eq!(step(&mut next, (0.0, 0.0), Some(&other)).index, 1);
        assert_eq!(next.awaits_path(), None);
        // The one it waited for is then any other, too.
        assert_eq!(step(&mut next, (0.0, 0.0), Some(&square)).index, 1);
    }
}

#[test]
fn a_loaded_state_takes_the_place_of_what_was_there() {
    let (mut old, mut busy) = (new(Acceptance::Rim), new(Acceptance::Rim));
    step(&mut old, (0.0, 0.0), Some(&square()));
    step(&mut busy, (0.0, 0.0), Some(&path(3, &[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])));
    assert!(busy.load_state(&state(&mut old)));
    assert_eq!(step(&mut busy, (1.0, 0.0), None).state, ReferenceState::Idle.code());
    assert_eq!((busy.awaits_path(), state(&mut busy)), (Some(7), state(&mut old)));
}

fn point() -> impl Strategy<Value = (f64, f64)> {
    // On a coarse grid and near it, so that circles are met.
    (0..4i32, 0..3i32, -0.04..0.04f64, -0.04..0.04f64)
        .prop_map(|(x, y, dx, dy)| (0.1 * f64::from(x) + dx, 0.1 * f64::from(y) + dy))
}

fn any_path() -> impl Strategy<Value = Path> {
    let bulge = proptest::sample::select(vec![0.0, 0.0, 0.5, -1.0]);
    (1u64..4, proptest::collection::vec((point(), bulge), 2..40)).prop_map(|(path_id, points)| {
        let waypoint = |((x_m, y_m), bulge)| Waypoint { bulge, ..Waypoint::straight(x_m, y_m) };
        (path_id, points.into_iter().map(waypoint).collect())
    })
}

proptest! {
    #[test]
    fn however_often_it_is_killed_the_references_are_the_same(
        acceptance in proptest::sample::select(Acceptance::ALL.to_vec()),
        periods in proptest::collection::vec(
            (point(), proptest::option::weighted(0.05, any_path()), any::<bool>()),
            1..300,
        ),
    ) {
        let (mut whole, mut killable) = (new(acceptance), new(acceptance));
        let mut current: Option<Path> = None;
        for (number, (pose, path, killed)) in (1..).zip(periods) {
            // Every path of a robot has a number of its own.
            let path = path.map(|(_, waypoints)| (number, waypoints));
            // A successor is given the path that is there, at the latest with its first pose.
            let mut given = None;
            if killed {
                killable = successor(&mut killable);
                given = current.as_ref();
            }
            let (a, b) = (
                step(&mut whole, pose, path.as_ref()),
                step(&mut killable, pose, path.as_ref().or(given)),
            );
            prop_assert_eq!(a, b);
            prop_assert_eq!(state(&mut whole), state(&mut killable));
            current = path.or(current);
        }
    }

    #[test]
    fn whatever_is_loaded_is_refused_or_selects_on(
        words in proptest::collection::vec(prop_oneof![0u64..5, any::<u64>()], 0..8),
        poses in proptest::collection::vec(point(), 1..20), path in any_path(),
        there in any::<bool>(), total in 0u64..45, index in 0u64..45,
    ) {
        let likely = [1, path.0, total, index, 0, 1];
        for words in [&words[..], &likely] {
            let mut selector = new(Acceptance::Bisector);
            if selector.load_state(words) {
                prop_assert_eq!(state(&mut selector), words);
                for pose in &poses {
                    step(&mut selector, *pose, there.then_some(&path));
                }
            }
        }
    }
}
