//! From a candidate to its figures: every case is driven in one thread and virtual time.

use super::objectives::{COUNT, OBJECTIVES};
use super::parameters::Tuned;
use crate::config::{Scenario, System};
use crate::shell::in_process::InProcess;
use hilare_interfaces::block::{TICK_S, TICKS_PER_SECOND, Tick};
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::Waypoint;
use hilare_recorder::statistics::RunFigures;
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

/// What a run came to.
#[derive(Clone, Copy, Debug)]
pub struct Driven {
    /// Its figures, those of `summary.json`.
    pub figures: RunFigures,
    /// How much of the motors' range the command changes by, a second.
    pub effort_per_s: f64,
    /// Share of the way that is left: 0 if it arrived.
    pub left: f64,
}

/// Figures of a candidate over all cases, in the order of [`OBJECTIVES`].
pub type Figures = [f64; COUNT];

/// Drives one robot along one path. Everything that judges a candidate comes through here.
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
    let segments = waypoints.len().saturating_sub(1).max(1) as f64;
    let done = robot.waypoint().saturating_sub(1) as f64;
    Ok(Driven {
        figures,
        effort_per_s: effort / (figures.ticks.max(1) as f64 * TICK_S),
        left: if figures.reached { 0.0 } else { (1.0 - done / segments).max(1.0 / segments) },
    })
}

/// One run that every candidate has to make.
#[derive(Clone, Debug)]
struct Case {
    system: System,
    course: usize,
    max_ticks: Tick,
}

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
                cases.push(Case { system, course, max_ticks });
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

    /// The figures of a candidate; or, if a run does not arrive or the values contradict each other, the share of
    /// the work that is left.
    pub fn figures(&self, values: &[f64]) -> Result<Figures, f64> {
        let count = self.cases.len() as f64;
        let mut all: Figures = [0.0; COUNT];
        for (number, case) in self.cases.iter().enumerate() {
            let mut system = case.system.clone();
            self.put(&mut system, values);
            // What comes after the first run that does not arrive is not driven: it is too bad already.
            let undone = count - number as f64;
            if system.check().is_err() {
                return Err(undone / count);
            }
            let waypoints = &self.courses[case.course].waypoints;
            let driven = drive(&system, waypoints, case.max_ticks).map_err(|_| undone / count)?;
            self.ticks.fetch_add(driven.figures.ticks, Ordering::Relaxed);
            if driven.left > 0.0 {
                return Err((undone - 1.0 + driven.left) / count);
            }
            for (sum, objective) in all.iter_mut().zip(OBJECTIVES) {
                let value = (objective.of)(&driven);
                *sum = if objective.greatest { sum.max(value) } else { *sum + value / count };
            }
        }
        Ok(all)
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
        assert_eq!(figures[0].to_bits(), run.cross_track_mean_m.to_bits());
        assert_eq!(figures[1].to_bits(), run.cross_track_max_m.to_bits());
        assert_eq!(figures[2].to_bits(), run.speed_error_mean_mps.to_bits());
        assert_eq!(figures[3], run.ticks as f64 / 1e3);
        // A command that turns at every corner, out and back: some share of the motors' range each time.
        assert!((0.05..50.0).contains(&figures[4]), "{figures:?}");
        assert_eq!(problem.ticks(), run.ticks);
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
