//! A controller that takes on the state of another goes on exactly as that one does.

use super::drives::Robot;
use super::*;
use core::f64::consts::FRAC_PI_2;
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Age of the poses, periods: so that they are moved on by what was commanded since.
const LATE: usize = 3;
/// Part of it, so that the drives lag by an uneven number of periods.
const PREDICTION: PredictionParams = PredictionParams { predict: true, drive_lag_s: 0.012 };
/// Iterations at which a predictive law stops short of its optimum most of the time.
const SHORT: &[(&str, f64)] = &[("max_iterations", 3.0)];
/// Period at whose begin another path comes.
const NEW_PATH: usize = 900;

/// A drive as a controller saw it, what it answered, and its state after each answer.
struct Drive {
    spec: &'static LawSpec,
    chassis: Chassis,
    values: &'static [(&'static str, f64)],
    seen: Vec<(Reference, Pose)>,
    commands: Vec<Command>,
    states: Vec<Vec<u64>>,
}

fn state(controller: &mut Controller) -> Vec<u64> {
    let mut room = [0; STATE_WORDS];
    let words = controller.save_state(&mut room).expect("room");
    room[..words].to_vec()
}

fn answer(controller: &mut Controller, (reference, pose): &(Reference, Pose)) -> Command {
    controller.step(pose.tick, ControllerInputs { reference, pose })
}

/// Everything of a command that is no process's own, by its bits.
fn bits(command: &Command) -> [u64; 6] {
    let [vx, vy, omega] = [command.vx_mps, command.vy_mps, command.omega_radps].map(f64::to_bits);
    [vx, vy, omega, command.fallback, command.pose_tick, command.effective_tick]
}

impl Drive {
    /// Round a corner, along an arc, and after [`NEW_PATH`] periods elsewhere, sideways where that can be.
    fn new(spec: &'static LawSpec, chassis: Chassis, values: &'static [(&'static str, f64)]) -> Self {
        let (seen, commands, states) = (vec![], vec![], vec![]);
        let mut drive = Self { spec, chassis, values, seen, commands, states };
        let mut controller = drive.fresh(1);
        let bend = Waypoint { bulge: 0.5, ..Waypoint::straight(0.0, 0.08) };
        let path = [Waypoint::ZERO, Waypoint::straight(0.1, 0.0), Waypoint::straight(0.1, 0.08), bend];
        let mut robot = Robot::new(&Case::new(spec, chassis), &path);
        let mut poses = vec![robot.pose];
        for period in 0.. {
            if period == NEW_PATH {
                robot.follow(&drive.new_path(robot.pose));
            }
            let Some((reference, now)) = robot.look() else { break };
            let late = period.min(LATE);
            let measured_tick = now.tick - late as u64 * PERIOD;
            let pose = Pose { measured_tick, ..Pose::at(now.tick, poses[period - late]) };
            drive.seen.push((reference, pose));
            drive.commands.push(answer(&mut controller, &drive.seen[period]));
            drive.states.push(state(&mut controller));
            robot.act(drive.commands[period].twist().expect("finite"));
            poses.push(robot.pose);
            assert!(period < 4000, "{}: does not arrive", drive.name());
        }
        assert!(drive.seen.len() > NEW_PATH + 200, "{}: {}", drive.name(), drive.seen.len());
        drive
    }

    fn new_path(&self, pose: WorldPose) -> [Waypoint; 3] {
        let crab_rad = if self.chassis.is_omnidirectional() { FRAC_PI_2 } else { 0.0 };
        let first = Waypoint::straight(pose.x_m, pose.y_m);
        let (x_m, y_m) = (pose.x_m - 0.06, pose.y_m + 0.01);
        [first, Waypoint::straight(x_m, y_m), Waypoint { x_m, y_m: y_m + 0.05, bulge: 0.0, crab_rad }]
    }

    fn fresh(&self, source: u64) -> Controller {
        Case::with(self.spec, self.chassis, self.values, PREDICTION).controller(source)
    }

    fn name(&self) -> String {
        format!("{} on {} {:?}", self.spec.name, self.chassis.name(), self.values)
    }

    /// A controller of another process with the state after answer `period`.
    fn restored(&self, period: usize) -> Controller {
        let mut controller = self.fresh(2);
        assert!(controller.load_state(&self.states[period]), "{} at {period}", self.name());
        controller
    }

    /// Its answers after answer `from` and before `until`, and its state behind each, are those of the drive.
    fn goes_on(&self, controller: &mut Controller, from: usize, until: usize) {
        for period in from + 1..until {
            let command = answer(controller, &self.seen[period]);
            let name = self.name();
            assert_eq!(bits(&command), bits(&self.commands[period]), "{name}, {from}: at {period}");
            assert!(state(controller) == self.states[period], "{name}, {from}: state at {period}");
        }
    }

    /// Answers after which something was new: the first ones, at waypoints, of a path, with a fallback and
    /// after it.
    fn turning_points(&self) -> Vec<usize> {
        let key = |n: usize| {
            let reference = &self.seen[n].0;
            (reference.path_id, reference.index)
        };
        let mut points: Vec<_> = (1..self.seen.len()).filter(|n| key(*n) != key(n - 1)).collect();
        let fallbacks = |n: &usize| self.commands[*n].fallback != Fallback::None.code();
        let first = (0..self.seen.len()).find(fallbacks);
        let last = (0..self.seen.len()).rfind(fallbacks);
        points.extend([0, 1, NEW_PATH - 1].into_iter().chain(first).chain(last));
        points
    }
}

/// Every case with its defaults, and those with a solver once more with too few iterations.
static DRIVES: LazyLock<Vec<Drive>> = LazyLock::new(|| {
    let capped = |case: &Case| case.spec.params.iter().any(|param| param.name == SHORT[0].0);
    let defaults = every_case().map(|case| Drive::new(case.spec, case.chassis, &[]));
    let short = every_case().filter(capped).map(|case| Drive::new(case.spec, case.chassis, SHORT));
    defaults.chain(short).collect()
});

#[test]
fn a_drive_goes_on_from_every_turning_point() {
    for drive in DRIVES.iter() {
        let points = drive.turning_points();
        assert!(points.len() >= 6, "{}: {points:?}", drive.name());
        for point in points {
            drive.goes_on(&mut drive.restored(point), point, drive.seen.len());
        }
    }
}

#[test]
fn the_drives_saw_what_they_are_there_for() {
    let has = |drive: &&Drive, what: Fallback| drive.commands.iter().any(|c| c.fallback == what.code());
    for drive in DRIVES.iter().filter(|drive| drive.spec.name == "qp" && drive.values == SHORT) {
        assert!(has(&drive, Fallback::IterationCap), "{}", drive.name());
    }
    for what in [Fallback::Infeasible, Fallback::IterationCap] {
        assert!(DRIVES.iter().any(|drive| drive.spec.name == "finite-step" && has(&drive, what)), "{what:?}");
    }
    // What is saved matters: without it the answers are others.
    for name in ["navigation-circle", "finite-step", "qp"] {
        let drive = DRIVES.iter().find(|drive| drive.spec.name == name).expect("a drive");
        let mut forgetful = drive.restored(700);
        forgetful.law.reset();
        let differs =
            (701..800).any(|n| bits(&answer(&mut forgetful, &drive.seen[n])) != bits(&drive.commands[n]));
        assert!(differs, "{name} has no memory");
    }
}

#[test]
fn another_law_or_robot_has_no_use_for_a_state() {
    // Laws without memory have none but the controller's.
    let memory = |spec: &LawSpec, chassis: &Chassis| match spec.name {
        "qp" => format!("qp on {}", chassis.name()),
        "navigation-circle" | "finite-step" => spec.name.to_owned(),
        _ => String::new(),
    };
    for drive in DRIVES.iter() {
        for other in every_case() {
            let name = format!("{} to {}", drive.name(), other.name());
            let alike = memory(drive.spec, &drive.chassis) == memory(other.spec, &other.chassis);
            let mut other = Case::with(other.spec, other.chassis, &[], PREDICTION).controller(2);
            assert_eq!(other.load_state(&drive.states[500]), alike, "{name}");
        }
    }
}

#[test]
fn the_state_has_room_whatever_the_period_and_the_lag() {
    for case in every_case() {
        let setup = LawSetup {
            chassis: &case.chassis,
            limits: LIMITS,
            acceptance_radius_m: ACCEPTANCE_M,
            acceptance: case.spec.acceptance,
            period_ticks: 1,
            values: &[],
        };
        let law = (case.spec.build)(&setup).expect("builds");
        let slow = PredictionParams { predict: true, drive_lag_s: 0.5 };
        let identity = Identity { source: 1, epoch: 1 };
        let mut controller = Controller::new(law, identity, 1, Prediction::new(slow, &setup));
        let reference = lines(&[(0.0, 0.0), (1.0, 0.0)]);
        answer(&mut controller, &(reference, Pose::at(5, WorldPose::new(0.0, 0.01, 0.1))));
        assert!(controller.save_state(&mut [0; STATE_WORDS]).is_some(), "{}", case.name());
    }
}

/// A word that is likely to do harm.
fn word() -> impl Strategy<Value = u64> {
    let special = [f64::NAN, f64::INFINITY, f64::MAX, -f64::MAX, f64::MIN_POSITIVE, -0.0, 1.0, -1e9];
    prop_oneof![0u64..64, any::<u64>(), proptest::sample::select(special.map(f64::to_bits).to_vec())]
}

/// A coordinate or a heading, most of them of no place on earth.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>(), proptest::sample::select(vec![f64::NAN, 1e150, 1e300, -1e9, 0.1])]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn however_often_it_is_killed_a_drive_is_the_same(
        mut killed in proptest::collection::vec(0.0..1.0f64, 1..40),
    ) {
        killed.sort_by(f64::total_cmp);
        for drive in DRIVES.iter() {
            let len = drive.seen.len();
            let mut cuts: Vec<_> = killed.iter().map(|share| (share * len as f64) as usize).collect();
            cuts.push(len - 1);
            for pair in cuts.windows(2) {
                drive.goes_on(&mut drive.restored(pair[0]), pair[0], pair[1] + 1);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn whatever_is_loaded_is_refused_or_drives_on(
        which in any::<proptest::sample::Index>(), at in any::<proptest::sample::Index>(),
        changes in proptest::collection::vec((any::<bool>(), 0usize..70, word()), 1..6),
    ) {
        let drive = &DRIVES[which.index(DRIVES.len())];
        let period = at.index(drive.seen.len() - 50);
        let mut words = drive.states[period].clone();
        for (front, place, word) in changes {
            // The law's own words are the last ones, the controller's the first.
            let len = words.len();
            words[if front { place % 8 } else { len - 1 - place }] = word;
        }
        let mut controller = drive.fresh(2);
        if controller.load_state(&words) {
            for (n, seen) in drive.seen[period + 1..period + 50].iter().enumerate() {
                let command = answer(&mut controller, seen);
                // No longer than it looks back; the step generator does without such a command.
                let healed = n < 10 || command.twist().is_some();
                prop_assert!(healed, "{}, {}: {:?}", drive.name(), n, command);
            }
        }
        // Whole states that were made up.
        let made_up: Vec<_> = words.iter().map(|word| word.rotate_left(7) ^ word).collect();
        if controller.load_state(&made_up) {
            answer(&mut controller, &drive.seen[period]);
        }
    }

    #[test]
    fn nonsense_leaves_nothing_behind_that_is_not_in_the_state(
        which in any::<proptest::sample::Index>(), at in any::<proptest::sample::Index>(),
        nonsense in proptest::collection::vec(proptest::array::uniform3(number()), 1..6),
        after in 0usize..3,
    ) {
        let drive = &DRIVES[which.index(DRIVES.len())];
        let period = at.index(drive.seen.len() - 30);
        let mut used = drive.restored(period);
        for [x_m, y_m, theta_rad] in nonsense {
            let (reference, pose) = &drive.seen[period];
            answer(&mut used, &(*reference, Pose { x_m, y_m, theta_rad, ..*pose }));
        }
        for seen in &drive.seen[period + 1..=period + after] {
            answer(&mut used, seen);
        }
        let (mut room, mut fresh) = ([0; STATE_WORDS], drive.fresh(2));
        if let Some(words) = used.save_state(&mut room) {
            prop_assert!(fresh.load_state(&room[..words]), "{}", drive.name());
            for seen in &drive.seen[period + after + 1..period + 30] {
                let (a, b) = (answer(&mut used, seen), answer(&mut fresh, seen));
                prop_assert_eq!(bits(&a), bits(&b), "{}", drive.name());
                prop_assert!(state(&mut used) == state(&mut fresh), "{}", drive.name());
            }
        }
    }
}
