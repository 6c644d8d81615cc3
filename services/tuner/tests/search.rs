//! What holds of every search: bounds, the same bits whatever the threads, and resuming.
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "tests have files and output")]

mod problems;

use hilare_tuner::{Batch, Budget, Ending, InLanes, Kind, Log, LogError, Mopso, Parameter, Settings, Space};
use hilare_tuner::{Objective, Random, SettingsError, Solution, hypervolume};
use problems::PROBLEMS;
use proptest::prelude::*;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

fn parameter(name: &str, low: f64, high: f64, kind: Kind) -> Parameter {
    Parameter { name: name.to_owned(), low, high, kind }
}

/// A space of all kinds.
fn mixed() -> Space {
    let parameters = vec![
        parameter("gain", 1e-6, 1e3, Kind::Logarithmic),
        parameter("count", -3.0, 12.0, Kind::Integer),
        parameter("share", -0.3, 0.7, Kind::Real),
    ];
    Space::new(parameters).expect("a space")
}

/// Wants a gain of 1 and few counts against a share of 0.4 and many; less than two of them are not feasible.
fn trade(values: &[f64], objectives: &mut [f64]) -> f64 {
    let [gain, count, share] = *values else { panic!("three parameters") };
    let off = libm::log(gain).abs();
    objectives[0] = off + (count - 2.0).abs() + share * share;
    objectives[1] = off + (count - 7.0).abs() + (share - 0.4) * (share - 0.4);
    (2.0 - count).max(0.0)
}

fn search(seed: u64) -> Mopso {
    Mopso::new(mixed(), Settings { swarm: 20, archive: 30, ..Settings::new(2, seed) }).expect("settings")
}

fn go(search: &mut Mopso, objective: &impl Objective, evaluations: u64, threads: usize) -> Vec<Solution> {
    let budget = Budget { evaluations, threads };
    let ending = search.run(objective, budget, None, &AtomicBool::new(false), |_, _| {}).expect("no log");
    assert_eq!((ending, search.evaluations()), (Ending::Done, evaluations));
    search.front()
}

fn bits(front: &[Solution]) -> Vec<u64> {
    let numbers = front.iter().flat_map(|solution| solution.values.iter().chain(&solution.objectives));
    numbers.map(|number| number.to_bits()).collect()
}

#[test]
fn it_finds_the_compromises_of_a_mixed_space() {
    let front = go(&mut search(1), &trade, 6_000, 1);
    for solution in &front {
        let [gain, count, share] = solution.values[..] else { panic!("three parameters") };
        assert!(libm::log(gain).abs() < 0.05, "{solution:?}");
        assert!((2.0..=7.0).contains(&count) && count.fract() == 0.0, "{solution:?}");
        assert!((-0.05..0.45).contains(&share), "{solution:?}");
    }
    let counts: Vec<bool> =
        (2..=7).map(|n| front.iter().any(|solution| solution.values[1] == f64::from(n))).collect();
    assert_eq!(counts, [true; 6], "every whole number from 2 to 7 is a compromise");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Whatever the objective says, candidates are inside and the archive is a front of feasible ones.
    #[test]
    fn hostile_objectives_break_nothing(seed in 0u64..1_000_000, objectives in 2usize..=3) {
        let space = mixed();
        let settings = Settings { swarm: 7, archive: 9, ..Settings::new(objectives, seed) };
        let mut search = Mopso::new(space.clone(), settings).expect("settings");
        let objective = |values: &[f64], found: &mut [f64]| {
            assert!(space.parameters().iter().zip(values).all(|(parameter, value)| parameter.allows(*value)));
            let words = values.iter().fold(seed, |word, value| word.rotate_left(9) ^ value.to_bits());
            let mut random = Random::new(words);
            let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 0.0, -0.0, 1e-300];
            for value in found.iter_mut() {
                let pick = random.below(40);
                *value = odd.get(pick).copied().unwrap_or_else(|| random.between(-1.0, 1.0));
            }
            let violations = [0.0, 0.0, 0.0, 1.0, -1.0, f64::NAN, f64::INFINITY];
            violations[random.below(violations.len())]
        };
        let front = go(&mut search, &objective, 300, 2);
        for (n, a) in front.iter().enumerate() {
            prop_assert!(a.objectives.iter().all(|value| value.is_finite()));
            let covers = |b: &Solution| b.objectives.iter().zip(&a.objectives).all(|(b, a)| b <= a);
            prop_assert!(!front.iter().enumerate().any(|(m, b)| m != n && covers(b)));
        }
    }

    /// Exact hypervolume against inclusion and exclusion: the union of boxes by its intersections.
    #[test]
    fn hypervolume_by_inclusion_and_exclusion(
        points in prop::collection::vec(prop::collection::vec(0u8..6, 3), 0..9), objectives in 2usize..=3,
    ) {
        let points: Vec<Vec<f64>> =
            points.iter().map(|point| point[..objectives].iter().map(|x| f64::from(*x)).collect()).collect();
        let mut union = 0.0;
        for subset in 1u32..1 << points.len() {
            let chosen = points.iter().enumerate().filter(|(n, _)| subset >> n & 1 == 1);
            let corner = chosen.fold(vec![0.0f64; objectives], |corner, (_, point)| {
                corner.iter().zip(point).map(|(a, b)| a.max(*b)).collect()
            });
            let common: f64 = corner.iter().map(|x| (5.0 - x).max(0.0)).product();
            union += if subset.count_ones() % 2 == 1 { common } else { -common };
        }
        let ours = hypervolume(points.iter().map(Vec::as_slice), &vec![5.0; objectives]);
        prop_assert!((ours - union).abs() < 1e-9, "{} not {}", ours, union);
    }
}

#[test]
fn threads_and_lanes_change_no_bit() {
    for problem in &PROBLEMS {
        let new = || Mopso::new(problem.space(), Settings::new(problem.objectives, 5)).expect("settings");
        let single = |values: &[f64], objectives: &mut [f64]| {
            (problem.evaluate)(values, objectives);
            0.0
        };
        let lanes = |batch: &mut Batch<'_>| {
            for index in 0..batch.len() {
                let (values, objectives, violation) = batch.lane(index);
                (problem.evaluate)(values, objectives);
                *violation = 0.0;
            }
        };
        let want = bits(&go(&mut new(), &single, 3_010, 1));
        for threads in [2, 3, 8] {
            assert_eq!(bits(&go(&mut new(), &single, 3_010, threads)), want, "{}", problem.name);
            let eight = InLanes { lanes: 8, evaluate: lanes };
            assert_eq!(bits(&go(&mut new(), &eight, 3_010, threads)), want, "{}, lanes", problem.name);
        }
        let mut other = Mopso::new(problem.space(), Settings::new(problem.objectives, 6)).expect("settings");
        assert_ne!(bits(&go(&mut other, &single, 3_010, 1)), want, "the seed does nothing");
        let volume = hypervolume(
            other.archive().members().map(|member| member.objectives),
            &vec![1.1; problem.objectives],
        );
        assert!(volume < problem.hypervolume, "3000 evaluations are not enough for {}", problem.name);
    }
}

/// Runs until `after` evaluations were asked of the objective, with a log.
fn stopped(path: &Path, fresh: bool, after: u64, threads: usize) -> (Mopso, Ending, u64) {
    let mut search = search(4);
    let names = ["few", "many"];
    let open = if fresh { Log::create } else { Log::resume };
    let mut log = open(path, &search, "trade", &names).expect("a log");
    let stop = AtomicBool::new(false);
    let asked = AtomicU64::new(0);
    let objective = |values: &[f64], objectives: &mut [f64]| {
        if asked.fetch_add(1, Ordering::Relaxed) + 1 >= after {
            stop.store(true, Ordering::Relaxed);
        }
        trade(values, objectives)
    };
    let budget = Budget { evaluations: 1_010, threads };
    let ending = search.run(&objective, budget, Some(&mut log), &stop, |_, _| {}).expect("it runs");
    (search, ending, asked.into_inner())
}

#[test]
fn a_stopped_search_resumes_with_the_same_bits() {
    let want = bits(&go(&mut search(4), &trade, 1_010, 1));
    let dir = tempfile::tempdir().expect("a directory");
    let whole = dir.path().join("whole.csv");
    let (uninterrupted, ending, _) = stopped(&whole, true, u64::MAX, 1);
    assert_eq!((ending, bits(&uninterrupted.front())), (Ending::Done, want.clone()));
    for threads in [1, 3] {
        let path = dir.path().join(format!("{threads}.csv"));
        let mut known = 0;
        // In the middle of generations, and at once.
        for (n, after) in [333, 1, 40, 111, u64::MAX].into_iter().enumerate() {
            let (search, ending, asked) = stopped(&path, n == 0, after, threads);
            known += asked;
            assert_eq!(search.evaluations(), known, "what was evaluated is logged, and never again");
            if after == u64::MAX {
                assert_eq!((ending, bits(&search.front())), (Ending::Done, want.clone()));
            } else {
                assert_eq!(ending, Ending::Stopped);
            }
        }
        assert_eq!(fs::read(&path).expect("a log"), fs::read(&whole).expect("a log"));
    }
}

#[test]
fn a_torn_log_loses_its_last_line_only() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, torn) = (dir.path().join("whole.csv"), dir.path().join("torn.csv"));
    let (search, ..) = stopped(&path, true, u64::MAX, 1);
    let whole = fs::read(&path).expect("a log");
    for cut in [whole.len() - 1, whole.len() - 7, whole.len() / 2, 300, 40, 0] {
        fs::write(&torn, &whole[..cut]).expect("a file");
        let lines = whole[..cut].iter().filter(|byte| **byte == b'\n').count() as u64;
        let (again, ending, asked) = stopped(&torn, false, u64::MAX, 1);
        assert_eq!(ending, Ending::Done);
        assert_eq!(asked, 1_010 - lines.saturating_sub(2), "cut at {cut}");
        assert_eq!(bits(&again.front()), bits(&search.front()));
        assert_eq!(fs::read(&torn).expect("a log"), whole, "cut at {cut}");
    }
}

#[test]
fn a_log_of_another_search_is_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("log.csv");
    stopped(&path, true, 100, 1);
    let names = ["few", "many"];
    let other = Mopso::new(mixed(), Settings { swarm: 20, archive: 30, ..Settings::new(2, 5) });
    let refused = Log::resume(&path, &other.expect("settings"), "trade", &names);
    assert!(matches!(refused, Err(LogError::Other)));
    assert!(matches!(Log::resume(&path, &search(4), "another", &names), Err(LogError::Other)));
    let open = Log::resume(&path, &search(4), "trade", &names).expect("its own");
    assert!(matches!(Log::resume(&path, &search(4), "trade", &names), Err(LogError::Busy)));
    drop(open);
    assert!(matches!(Log::create(&path, &search(4), "trade", &names), Err(LogError::Io(_))));

    let text = fs::read_to_string(&path).expect("a log");
    let line = text.lines().nth(7).expect("evaluation 5");
    let meddle = |with: &str| {
        fs::write(&path, text.replace(line, with)).expect("a file");
        let mut search = search(4);
        let mut log = Log::resume(&path, &search, "trade", &names)?;
        let budget = Budget { evaluations: 1_010, threads: 1 };
        search.run(&trade, budget, Some(&mut log), &AtomicBool::new(false), |_, _| {})
    };
    let last = line.rsplit_once(',').expect("columns").0;
    for with in [format!("{last},0.125"), last.to_owned(), line.replacen("5,", "6,", 1), "5,x".to_owned()] {
        let error = meddle(&with).expect_err("a line nobody wrote");
        assert!(matches!(error, LogError::Line { line: 8, .. }), "{with}: {error}");
    }
}

#[test]
fn it_begins_with_what_is_given() {
    let start = vec![0.5, 3.0, 0.25];
    let settings = Settings { starts: vec![start.clone()], ..Settings::new(2, 1) };
    let mut search = Mopso::new(mixed(), settings).expect("settings");
    let first = std::sync::Mutex::new(Vec::new());
    let objective = |values: &[f64], objectives: &mut [f64]| {
        first.lock().expect("one thread").push(values.to_vec());
        trade(values, objectives)
    };
    go(&mut search, &objective, 1, 1);
    let shown = &first.lock().expect("one thread")[0];
    assert!(shown.iter().zip(&start).all(|(a, b)| (a - b).abs() < 1e-9), "{shown:?}");
    let refused = |settings| Mopso::new(mixed(), settings).err();
    let outside = Settings { starts: vec![vec![0.5, 3.5, 0.25]], ..Settings::new(2, 1) };
    assert_eq!(refused(outside), Some(SettingsError::Starts));
    assert_eq!(refused(Settings::new(4, 1)), Some(SettingsError::Objectives));
    assert_eq!(refused(Settings { swarm: 0, ..Settings::new(2, 1) }), Some(SettingsError::Swarm));
    assert_eq!(refused(Settings { archive: 1, ..Settings::new(2, 1) }), Some(SettingsError::Archive));
    let reference = Some(vec![1.0]);
    assert_eq!(refused(Settings { reference, ..Settings::new(2, 1) }), Some(SettingsError::Reference));
}
