//! An estimator that takes on the state of another goes on exactly as that one does.
mod support;

use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::messages::{Pose, PoseFix};
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use hilare_pose_estimator::ekf::Ekf;
use hilare_pose_estimator::ekf::params::{EkfParams, HISTORY_TICKS_MAX};
use hilare_pose_estimator::{EstimatorInputs, EstimatorKind, EstimatorSetup, PoseEstimator};
use proptest::prelude::*;
use support::{Camera, Noise, Robot, Wrong, differential, mecanum};

const TICKS: Tick = 12_000;
/// The camera sees nothing in this time, long enough for a history to run over.
const DARK: std::ops::Range<Tick> = 4000..8500;
/// The robot is taken up and set down elsewhere at these.
const CARRIED: [Tick; 2] = [2000, 10_000];
/// Ticks whose messages are lost: some of a few, and a long stretch.
const LOST: [std::ops::Range<Tick>; 3] = [1200..1203, 3000..3009, 9000..9600];

/// What an estimator reads in one tick.
type Inputs = (Tick, [i64; 4], Option<PoseFix>);

/// What comes of a drive with every trouble there is.
fn drive(setup: &EstimatorSetup, delay: Tick, seed: u64) -> Vec<Inputs> {
    let (mut draw, mut robot) = {
        let mut noise = Noise::new(seed);
        let wrong = Wrong::drawn(&setup.ekf, setup, &mut noise);
        (noise, Robot::new(setup, wrong, Noise::new(seed + 1)))
    };
    let mut camera = Camera::new(40, delay, (0.001, 0.005), Noise::new(seed + 2));
    let most = if matches!(setup.chassis, Chassis::Mecanum(_)) { 12.0 } else { 1.0 };
    let mut goal = [0.0; 4];
    let mut inputs = vec![];
    for tick in 1..=TICKS {
        if tick % 500 == 1 {
            goal = core::array::from_fn(|_| most * (2.0 * draw.uniform() - 0.7));
        }
        let turned = goal.map(|mean| (mean + draw.uniform()).floor() as i64);
        robot.turn(if matches!(setup.chassis, Chassis::Mecanum(_)) {
            turned
        } else {
            [turned[0], turned[1], 0, 0]
        });
        if CARRIED.contains(&tick) {
            robot.pose.x_m += 0.5;
        }
        let fix = camera.watch(tick, robot.pose).filter(|fix| !DARK.contains(&fix.captured_tick));
        if !LOST.iter().any(|lost| lost.contains(&tick)) {
            inputs.push((tick, robot.counts, fix));
        }
    }
    inputs
}

fn step(estimator: &mut PoseEstimator, (tick, counts, fix): &Inputs) -> Pose {
    estimator.step(*tick, EstimatorInputs { counts, fixes: fix.as_slice() })
}

fn run(estimator: &mut PoseEstimator, inputs: &[Inputs]) {
    for input in inputs {
        step(estimator, input);
    }
}

fn bits(pose: &Pose) -> [u64; 5] {
    let [x, y, theta] = [pose.x_m, pose.y_m, pose.theta_rad].map(f64::to_bits);
    [pose.tick, pose.measured_tick, x, y, theta]
}

fn state(estimator: &mut PoseEstimator) -> Vec<u64> {
    let mut room = [0; STATE_WORDS];
    let words = estimator.save_state(&mut room).expect("room");
    room[..words].to_vec()
}

/// Steps one estimator, and beside it one that is killed after every tick of `killed` and followed by another
/// which loads what it left. Greatest number of words of a state.
fn with_successors(kind: EstimatorKind, setup: EstimatorSetup, inputs: &[Inputs], killed: &[Tick]) -> usize {
    let (mut whole, mut killable) = (PoseEstimator::new(kind, setup), PoseEstimator::new(kind, setup));
    let mut most = 0;
    for input in inputs {
        let (a, b) = (step(&mut whole, input), step(&mut killable, input));
        assert_eq!(bits(&a), bits(&b), "{} at {}", kind.name(), input.0);
        if killed.contains(&input.0) {
            let words = state(&mut killable);
            assert_eq!(state(&mut whole), words, "{} at {}", kind.name(), input.0);
            most = most.max(words.len());
            killable = PoseEstimator::new(kind, setup);
            assert!(killable.load_state(&words), "{} at {}", kind.name(), input.0);
            assert_eq!(state(&mut killable), words, "{} at {}", kind.name(), input.0);
        }
    }
    assert_eq!(state(&mut whole), state(&mut killable), "{}", kind.name());
    most
}

/// Words of what the box itself remembers: newest tick and counts, a jump if there is one, the last answer.
const RIM: usize = 11;

#[test]
fn a_drive_goes_on_from_every_kind_of_moment() {
    let long = EkfParams { history_ticks: HISTORY_TICKS_MAX, ..EkfParams::default() };
    for setup in [differential(EkfParams::default()), mecanum(EkfParams::default()), differential(long)] {
        let inputs = drive(&setup, 60, 7);
        let most = |kind, killed: &[Tick]| with_successors(kind, setup, &inputs, killed);
        for kind in EstimatorKind::ALL {
            // Before and after a fix, with one under way, behind lost messages, in the dark, at the end.
            let early = [1, 2, 41, 99, 100, 101, 1203, 1210, 3009, 3015, 3990, 4100, 8499, 8600, 9600, 9610];
            most(kind, &early);
            // Once, and everything from there on.
            for once in [50, 1203, 8000, 9605] {
                most(kind, &[once]);
            }
        }
        assert_eq!(most(EstimatorKind::DeadReckoning, &[5000]), RIM + 10);
        assert_eq!(most(EstimatorKind::Camera, &[5000]), RIM + 4);
        // Nothing is left out even of the longest history; nor is a rival, while there is one.
        let history = setup.ekf.history_ticks as usize;
        assert_eq!(most(EstimatorKind::Ekf, &[8000]), RIM + 57 + history);
        let rivals = CARRIED.map(|carried| carried + 150);
        assert!(rivals.iter().all(|tick| most(EstimatorKind::Ekf, &[*tick]) > RIM + 57 + 34), "{rivals:?}");
    }
}

#[test]
fn another_estimator_has_no_use_for_a_state() {
    let setup = differential(EkfParams::default());
    let inputs = drive(&setup, 60, 3);
    for kind in EstimatorKind::ALL {
        let mut estimator = PoseEstimator::new(kind, setup);
        run(&mut estimator, &inputs[..300]);
        let words = state(&mut estimator);
        for other in EstimatorKind::ALL {
            assert_eq!(PoseEstimator::new(other, setup).load_state(&words), kind == other, "{other:?}");
        }
        // A history longer than this robot keeps.
        let short = differential(EkfParams { history_ticks: 30, ..EkfParams::default() });
        let ekf = kind == EstimatorKind::Ekf;
        assert_eq!(PoseEstimator::new(kind, short).load_state(&words), !ekf, "{kind:?}");
    }
}

#[test]
fn counts_no_wheel_makes_are_kept_as_long_as_there_is_room() {
    // The box passes such counts over; its filter can do without that.
    let setup = differential(EkfParams::default());
    let mut filter = Ekf::new(&setup, setup.ekf);
    let mut run = |ticks: std::ops::RangeInclusive<Tick>| {
        for tick in ticks {
            filter.step(tick, &[i64::MIN.wrapping_mul(tick as i64), 9000 * tick as i64, 0, -1], &[]);
        }
        let mut room = [0; STATE_WORDS];
        filter.save_state(&mut room).map(|used| room[..used].to_vec())
    };
    let words = run(1..=500).expect("room");
    let mut next = Ekf::new(&setup, setup.ekf);
    assert!(next.load_state(&words));
    let mut room = [0; STATE_WORDS];
    let used = next.save_state(&mut room).expect("room");
    assert_eq!(room[..used], words);
    assert_eq!(run(501..=2000), None);
}

/// A word that is likely to do harm.
fn word() -> impl Strategy<Value = u64> {
    let special = [f64::NAN, f64::INFINITY, f64::MAX, -f64::MAX, f64::MIN_POSITIVE, -0.0, 1.0, -1e9];
    prop_oneof![0u64..300, any::<u64>(), proptest::sample::select(special.map(f64::to_bits).to_vec())]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn however_often_it_is_killed_the_poses_are_the_same(
        killed in proptest::collection::vec(1..=TICKS, 1..60),
        delay in 0u64..300, seed in any::<u32>(), wheels in any::<bool>(),
    ) {
        let setup = if wheels { differential } else { mecanum };
        let setup = setup(EkfParams::default());
        let inputs = drive(&setup, delay, seed.into());
        for kind in EstimatorKind::ALL {
            with_successors(kind, setup, &inputs, &killed);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn whatever_is_loaded_is_refused_or_reckons_on(
        kind in proptest::sample::select(EstimatorKind::ALL.to_vec()),
        at in 100usize..3000,
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), word()), 1..6),
        torn in any::<proptest::sample::Index>(),
    ) {
        let setup = differential(EkfParams { history_ticks: 200, ..EkfParams::default() });
        let inputs = drive(&setup, 60, 5);
        let mut estimator = PoseEstimator::new(kind, setup);
        run(&mut estimator, &inputs[..at]);
        let mut words = state(&mut estimator);
        // Half of one save and half of the next, as long as both are.
        run(&mut estimator, &inputs[at..at + 40]);
        let later = state(&mut estimator);
        let torn = torn.index(words.len()).min(later.len());
        words[..torn].copy_from_slice(&later[..torn]);
        for (place, word) in &changes {
            let len = words.len();
            words[place.index(len)] = *word;
        }
        for words in [&words[..], &words[..torn]] {
            let mut next = PoseEstimator::new(kind, setup);
            if next.load_state(words) {
                prop_assert_eq!(state(&mut next), words);
                run(&mut next, &inputs[at..at + 400]);
                step(&mut next, &(Tick::MAX, [i64::MIN; 4], None));
                step(&mut next, &(Tick::MAX, [1; 4], None));
            }
        }
    }
}
