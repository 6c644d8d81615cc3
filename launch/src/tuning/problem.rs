//! From a candidate to its figures: every case is driven in one thread and virtual time.

use super::objectives::{COUNT, OBJECTIVES};
use super::parameters::Tuned;
use crate::config::{Scenario, System};
use crate::shell::fast::{Candidate, FastFigures, FastPath};
use crate::shell::in_process::InProcess;
use hilare_interfaces::block::{TICK_S, TICKS_PER_SECOND, Tick};
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::Waypoint;
use std::sync::atomic::{AtomicU64, Ordering};

/// Seconds a run may take beyond twice what its path takes at the reference speed.
const GRACE_S: f64 = 10.0;
/// Longest run, s.
const LONGEST_S: f64 = 1e5;

/// A scenario with its path.
#[derive(Clone, Debug)]
pub struct Course {
    /// The scenario.
    pub scenario: Scenario,
    /// Its path.
    pub waypoints: Vec<Waypoint>,
}

/// What a run came to; where names are those of `summary.json`, so are the values.
#[derive(Clone, Copy, Debug)]
pub struct Driven {
    /// Mean distance of the truth to the tracked line, m.
    pub cross_track_mean_m: f64,
    /// Greatest such distance, m.
    pub cross_track_max_m: f64,
    /// Mean deviation of the commanded speed, m/s.
    pub speed_error_mean_mps: f64,
    /// Ticks until the arrival.
    pub ticks: Tick,
    /// How much of the motors' range the command changes by, a second.
    pub effort_per_s: f64,
    /// Share of the way that is left: 0 if it arrived.
    pub left: f64,
}

/// Figures of a candidate over all cases, in the order of [`OBJECTIVES`].
pub type Figures = [f64; COUNT];

/// Drives one robot along one path, box by box.
///
/// # Errors
///
/// If the system makes no robot.
pub fn drive(system: &System, waypoints: &[Waypoint], max_ticks: Tick) -> Result<Driven, String> {
    let mut robot = InProcess::new(system, waypoints)?;
    let mut last = BodyTwist::ZERO;
    let mut effort = 0.0;
    let figures = robot.run_for_figures(max_ticks, |steps| {
        let twist = steps.commanded_twist();
        if twist != last {
            let change = BodyTwist::new(
                twist.vx_mps - last.vx_mps,
                twist.vy_mps - last.vy_mps,
                twist.omega_radps - last.omega_radps,
            );
            effort += system.chassis.motor_use(change);
            last = twist;
        }
    });
    Ok(Driven {
        cross_track_mean_m: figures.cross_track_mean_m,
        cross_track_max_m: figures.cross_track_max_m,
        speed_error_mean_mps: figures.speed_error_mean_mps,
        ticks: figures.ticks,
        effort_per_s: effort / (figures.ticks.max(1) as f64 * TICK_S),
        left: left(figures.reached, robot.waypoint(), waypoints),
    })
}

/// Share of the way that is left to one who drove to a waypoint last.
fn left(reached: bool, waypoint: u64, waypoints: &[Waypoint]) -> f64 {
    let segments = waypoints.len().saturating_sub(1).max(1) as f64;
    let done = waypoint.saturating_sub(1) as f64;
    if reached { 0.0 } else { (1.0 - done / segments).max(1.0 / segments) }
}

/// What the fast path says of a run.
fn driven_fast(fast: &FastFigures, waypoints: &[Waypoint]) -> Driven {
    Driven {
        cross_track_mean_m: fast.cross_track_mean_m,
        cross_track_max_m: fast.cross_track_max_m,
        speed_error_mean_mps: fast.speed_error_mean_mps,
        ticks: fast.ticks,
        effort_per_s: fast.effort_per_s,
        left: left(fast.reached, fast.waypoint, waypoints),
    }
}

/// One run that every candidate has to make.
#[derive(Clone, Debug)]
struct Case {
    system: System,
    course: usize,
    max_ticks: Tick,
    /// Where it knows the robot, and all that is tuned.
    fast: Option<FastPath>,
}

/// A candidate on its way through the cases: figures so far, or what is left undone.
type Judgement = Result<Figures, f64>;

/// The courses, seeds and parameters of a search.
#[derive(Debug)]
pub struct Problem {
    courses: Vec<Course>,
    cases: Vec<Case>,
    tuned: Vec<Tuned>,
    ticks: AtomicU64,
}

impl Problem {
    /// Every course with every seed; without seeds as the scenario has it. `tuned` are keys that all their robots
    /// have.
    pub fn new(courses: Vec<Course>, seeds: u64, tuned: Vec<Tuned>) -> Result<Self, String> {
        let mut cases = Vec::new();
        for (course, Course { scenario, waypoints }) in courses.iter().enumerate() {
            let max_ticks = time_limit(&scenario.system, waypoints);
            for seed in 1..=seeds {
                let mut system = scenario.system.clone();
                if seeds > 1 {
                    let keys = [format!("plant.seed={seed}"), format!("camera.seed={seed}")];
                    system.set_all(&keys).map_err(|error| error.to_string())?;
                }
                let known = tuned.iter().all(|one| Candidate::KEYS.contains(&&*one.parameter.name));
                let fast = known.then(|| FastPath::of(&system, waypoints).ok()).flatten();
                cases.push(Case { system, course, max_ticks, fast });
            }
        }
        Ok(Self { courses, cases, tuned, ticks: AtomicU64::new(0) })
    }

    /// The courses.
    pub fn courses(&self) -> &[Course] {
        &self.courses
    }

    /// What is searched.
    pub fn tuned(&self) -> &[Tuned] {
        &self.tuned
    }

    /// Ticks driven so far.
    pub fn ticks(&self) -> u64 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// The values the first course's robot has.
    pub fn untuned(&self) -> Vec<f64> {
        let system = &self.courses[0].scenario.system;
        self.tuned.iter().map(|one| system.get(&one.parameter.name).unwrap_or(f64::NAN)).collect()
    }

    /// A course's robot with the values of a candidate.
    pub fn system(&self, course: usize, values: &[f64]) -> System {
        let mut system = self.courses[course].scenario.system.clone();
        self.put(&mut system, values);
        system
    }

    fn put(&self, system: &mut System, values: &[f64]) {
        for (one, value) in self.tuned.iter().zip(values) {
            system.put(&one.key, *value);
        }
    }

    /// True if the fast path drives every run: it likes many candidates at once.
    pub fn is_fast(&self) -> bool {
        self.cases.iter().all(|case| case.fast.is_some())
    }

    /// The figures of a candidate; or, if a run does not arrive or the values contradict each other, the share of
    /// the work that is left.
    pub fn figures(&self, values: &[f64]) -> Judgement {
        self.figures_of(&[values], 1).pop().unwrap_or(Err(1.0))
    }

    /// The same of several candidates; which of them are judged together, and on how many threads, makes no
    /// difference. The threads are for the fast path.
    pub fn figures_of(&self, candidates: &[&[f64]], threads: usize) -> Vec<Judgement> {
        let mut judged: Vec<Judgement> = vec![Ok([0.0; COUNT]); candidates.len()];
        for (number, case) in self.cases.iter().enumerate() {
            // What comes after the first run that does not arrive is not driven: it is too bad already.
            let on_the_way: Vec<usize> = (0..candidates.len()).filter(|n| judged[*n].is_ok()).collect();
            let systems = on_the_way.iter().map(|n| self.system_of(case, candidates[*n]));
            let runs = self.runs(case, &systems.collect::<Vec<_>>(), threads);
            for (n, run) in on_the_way.into_iter().zip(runs) {
                judged[n] = judged[n].and_then(|so_far| self.add(so_far, number, run));
            }
        }
        judged
    }

    /// A case's robot with the values of a candidate; `None` if they contradict each other.
    fn system_of(&self, case: &Case, values: &[f64]) -> Option<System> {
        let mut system = case.system.clone();
        self.put(&mut system, values);
        system.check().is_ok().then_some(system)
    }

    /// What robots come to on a case, `None` for what is no robot.
    fn runs(&self, case: &Case, systems: &[Option<System>], threads: usize) -> Vec<Option<Driven>> {
        let waypoints = &self.courses[case.course].waypoints;
        let Some(path) = &case.fast else {
            let run = |system: &Option<System>| drive(system.as_ref()?, waypoints, case.max_ticks).ok();
            return systems.iter().map(run).collect();
        };
        let candidates: Vec<Candidate> = systems.iter().flatten().map(Candidate::of).collect();
        let mut figures = vec![FastFigures::default(); candidates.len()];
        path.evaluate_with(threads, &candidates, case.max_ticks, &mut figures);
        let mut figures = figures.iter().map(|fast| driven_fast(fast, waypoints));
        systems.iter().map(|system| system.as_ref().and_then(|_| figures.next())).collect()
    }

    /// The figures of a candidate with those of one more run.
    fn add(&self, mut so_far: Figures, number: usize, run: Option<Driven>) -> Judgement {
        let (count, undone) = (self.cases.len() as f64, (self.cases.len() - number) as f64);
        let driven = run.ok_or(undone / count)?;
        self.ticks.fetch_add(driven.ticks, Ordering::Relaxed);
        if driven.left > 0.0 {
            return Err((undone - 1.0 + driven.left) / count);
        }
        for (sum, objective) in so_far.iter_mut().zip(OBJECTIVES) {
            let value = (objective.of)(&driven);
            *sum = if objective.greatest { sum.max(value) } else { *sum + value / count };
        }
        Ok(so_far)
    }

    /// What outcomes hang on besides the candidate, in a word: robots, paths, program.
    pub fn fingerprint(&self) -> u64 {
        // FNV-1a.
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut eat = |bytes: &[u8]| {
            for byte in bytes {
                hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        eat(env!("CARGO_PKG_VERSION").as_bytes());
        for case in &self.cases {
            eat(case.system.to_toml().as_bytes());
            eat(&case.max_ticks.to_le_bytes());
        }
        for waypoint in self.courses.iter().flat_map(|course| &course.waypoints) {
            for number in [waypoint.x_m, waypoint.y_m, waypoint.bulge, waypoint.crab_rad] {
                eat(&number.to_bits().to_le_bytes());
            }
        }
        hash
    }
}

/// Twice what the path takes at the reference speed, and some: a candidate that takes longer does not arrive.
fn time_limit(system: &System, waypoints: &[Waypoint]) -> Tick {
    let length_m: f64 = waypoints.windows(2).map(|pair| pair[1].segment_from(pair[0]).length_m()).sum();
    let seconds = GRACE_S + 2.0 * length_m / system.tracking.speed_mps.max(1e-4);
    (seconds.min(LONGEST_S) as Tick) * TICKS_PER_SECOND
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Task;
    use crate::tuning::parameters::parameters;

    fn problem(seeds: u64, set: &[&str]) -> Problem {
        let mut scenario = Scenario::load("trapezoid").expect("built in");
        scenario.system.set_all(set).expect("known keys");
        let Task::Follow(waypoints) = scenario.task.clone() else { panic!("it has a path") };
        let tuned = parameters(&scenario.system, &[], &[]).expect("ranges");
        Problem::new(vec![Course { scenario, waypoints }], seeds, tuned).expect("a problem")
    }

    #[test]
    fn the_figures_are_those_of_a_run() {
        let problem = problem(1, &[]);
        let figures = problem.figures(&problem.untuned()).expect("point A arrives");
        let mut robot = InProcess::new(&problem.system(0, &problem.untuned()), &problem.courses[0].waypoints)
            .expect("one");
        let run = robot.run(200_000).statistics.figures();
        // On the fast path, to rounding.
        assert!(problem.is_fast());
        assert!((figures[0] - run.cross_track_mean_m).abs() < 1e-12);
        assert!((figures[1] - run.cross_track_max_m).abs() < 1e-12);
        assert!((figures[2] - run.speed_error_mean_mps).abs() < 1e-12);
        assert_eq!(figures[3], run.ticks as f64 / 1e3);
        // A command that turns at every corner, out and back: some share of the motors' range each time.
        assert!((0.05..50.0).contains(&figures[4]), "{figures:?}");
        assert_eq!(problem.ticks(), run.ticks);
    }

    #[test]
    fn the_fast_path_and_the_boxes_judge_alike() {
        let fast = problem(1, &[]);
        let mut boxes = problem(1, &[]);
        boxes.cases.iter_mut().for_each(|case| case.fast = None);
        assert!(fast.is_fast() && !boxes.is_fast());
        let candidates = [
            fast.untuned(),
            vec![0.5, 2e6, 300.0, 0.05, 0.6],
            // Neither of these arrives: the one cannot turn, the other hardly.
            vec![0.5, 2e6, 300.0, 0.05, 0.0],
            vec![0.5, 2e6, 300.0, 0.1, 0.08],
        ];
        let values: Vec<&[f64]> = candidates.iter().map(Vec::as_slice).collect();
        let [fast, boxes] = [fast.figures_of(&values, 2), boxes.figures_of(&values, 1)];
        assert!(fast[..2].iter().all(Result::is_ok) && fast[2].is_err(), "{fast:?}");
        for pair in fast.iter().zip(&boxes) {
            match pair {
                (Ok(fast), Ok(boxes)) => {
                    assert!(fast.iter().zip(boxes).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs()), "{pair:?}");
                }
                (fast, boxes) => assert_eq!(fast, boxes),
            }
        }
    }

    #[test]
    fn seeds_are_runs_of_their_own() {
        let noisy = ["plant.slip_sd=0.2", "plant.start_sd_m=0.003"];
        let (one, three) = (problem(1, &noisy), problem(3, &noisy));
        let values = one.untuned();
        let (first, mean) =
            (one.figures(&values).expect("it arrives"), three.figures(&values).expect("all do"));
        assert_ne!(first, mean);
        assert!(mean[1] >= first[1], "the greatest of all runs");
        assert_ne!(one.fingerprint(), three.fingerprint());
    }

    #[test]
    fn what_does_not_arrive_is_less_feasible_the_more_is_left() {
        let problem = problem(1, &[]);
        let mut values = problem.untuned();
        // It cannot turn: it drives straight past the second corner.
        values[4] = 0.0;
        let left = problem.figures(&values).expect_err("it does not arrive");
        assert!((0.25..1.0).contains(&left), "{left}");
    }
}
