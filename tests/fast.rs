//! The fast path is the in-process run: the same steps and the same estimated pose to the bit, the same figures to
//! rounding, whoever drives beside whom.
#![allow(unsafe_code, reason = "a counting allocator can only be written with it")]

mod support;

use hilare::config::{Scenario, System, Task};
use hilare::shell::fast::{Candidate, FastFigures, FastPath};
use hilare::shell::in_process::InProcess;
use hilare_controller::kanayama::KanayamaGains;
use hilare_interfaces::messages::Waypoint;
use std::alloc::{GlobalAlloc, Layout};
use std::cell::Cell;
use std::thread;
use support::random::Random;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { std::alloc::System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { std::alloc::System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Two minutes: the longest of the built-in paths takes one.
const TICKS_MAX: u64 = 120_000;
/// How far apart figures may lie that are means of the same terms, m and m/s.
const ROUNDING: f64 = 1e-12;
/// About as far as any path here leads, m.
const PATH_M: f64 = 2.0;

/// Within table 2 of the paper.
fn candidates(random: &mut Random, how_many: usize) -> Vec<Candidate> {
    let mut candidate = || Candidate {
        gains: KanayamaGains {
            k1_per_s: random.real(0.0, 5.0),
            k2_per_m2: random.real(0.0, 5e6),
            k3_per_m: random.real(0.0, 5000.0),
        },
        v_max_mps: random.real(0.04, 0.1),
        omega_max_radps: random.real(0.0, 0.75),
    };
    (0..how_many).map(|_| candidate()).collect()
}

fn job(scenario: &str) -> (System, Vec<Waypoint>) {
    let scenario = Scenario::load(scenario).expect("built in");
    let Task::Follow(waypoints) = scenario.task else { panic!("it has a path of its own") };
    (scenario.system, waypoints)
}

/// What the boxes make of a candidate, beside what the fast path says.
fn check(system: &System, waypoints: &[Waypoint], candidate: &Candidate, fast: &FastFigures, ticks_max: u64) {
    let mut system = system.clone();
    system.set_all(&candidate.keys()).expect("values within their bounds");
    let mut robot = InProcess::new(&system, waypoints).expect("a robot");
    let boxes = robot.run(ticks_max).statistics.figures();
    let what = || format!("\n{candidate:?}\n{waypoints:?}\n{boxes:?}\n{fast:?}\n{}", system.to_toml());
    assert_eq!((fast.reached, fast.ticks), (boxes.reached, boxes.ticks), "{}", what());
    assert_eq!(fast.steps, boxes.steps[..2], "{}", what());
    // Of a run without a tick the record has no pose.
    if fast.ticks == 0 {
        return;
    }
    let pose = fast.final_pose;
    assert_eq!([pose.x_m, pose.y_m, pose.theta_rad], boxes.final_pose, "not one bit: {}", what());
    let (truth, [x_m, y_m, theta_rad]) = (fast.final_truth, boxes.final_truth);
    let off_m = (truth.x_m - x_m).hypot(truth.y_m - y_m);
    // The plant adds its heading up, turn by turn: some 1e-11 rad of rounding where a robot circles for ever.
    let drift_rad = (truth.theta_rad - theta_rad).abs();
    assert!(off_m < 1e-9 && drift_rad < 1e-9, "{off_m} {drift_rad} {}", what());
    let far_m = ROUNDING + drift_rad * PATH_M;
    let apart = [
        (fast.cross_track_mean_m - boxes.cross_track_mean_m).abs() / far_m,
        (fast.cross_track_max_m - boxes.cross_track_max_m).abs() / far_m,
        (fast.speed_error_mean_mps - boxes.speed_error_mean_mps).abs() / ROUNDING,
    ];
    assert!(apart.into_iter().all(|apart| apart <= 1.0), "{apart:?} {}", what());
}

/// Every candidate on both ways. How many of them arrive.
fn compare(system: &System, waypoints: &[Waypoint], candidates: &[Candidate], ticks_max: u64) -> usize {
    let path = FastPath::of(system, waypoints).expect("it applies");
    let figures = path.evaluate(candidates, ticks_max);
    let half = candidates.len().div_ceil(2);
    thread::scope(|scope| {
        for (candidates, figures) in candidates.chunks(half).zip(figures.chunks(half)) {
            scope.spawn(move || {
                for (candidate, fast) in candidates.iter().zip(figures) {
                    check(system, waypoints, candidate, fast, ticks_max);
                }
            });
        }
    });
    figures.iter().filter(|fast| fast.reached).count()
}

#[test]
fn on_the_built_in_paths_no_bit_differs() {
    let mut random = Random::new("on_the_built_in_paths_no_bit_differs", 1);
    for (scenario, how_many) in [("trapezoid", 200), ("rectangle", 60), ("rectangle-open", 60), ("so", 60)] {
        let (system, waypoints) = job(scenario);
        let mut candidates = candidates(&mut random, how_many);
        // Point A of the paper, too.
        candidates.push(Candidate::of(&system));
        let arrived = compare(&system, &waypoints, &candidates, TICKS_MAX);
        assert!((1..candidates.len()).contains(&arrived), "{scenario}: {arrived}");
    }
}

/// From wherever the last one was; now and then on the spot.
fn random_path(random: &mut Random) -> Vec<Waypoint> {
    let (mut x_m, mut y_m) = (random.real(-1.0, 1.0), random.real(-1.0, 1.0));
    let mut path = vec![Waypoint::straight(x_m, y_m)];
    for _ in 0..random.whole(1, 5) {
        let hop_m = if random.chance(0.1) { 0.0 } else { random.real(0.02, 0.2) };
        let (sin, cos) = random.real(-3.2, 3.2).sin_cos();
        (x_m, y_m) = (x_m + hop_m * cos, y_m + hop_m * sin);
        path.push(Waypoint::straight(x_m, y_m));
    }
    path
}

/// Another robot, true and believed, that starts somewhere near a path.
fn random_robot(random: &mut Random, at: Waypoint) -> System {
    let mut system = System::default();
    let mut keys = vec![
        format!("start.x_m={}", at.x_m + random.real(-0.05, 0.05)),
        format!("start.y_m={}", at.y_m + random.real(-0.05, 0.05)),
        format!("start.theta_rad={}", random.real(-6.2, 6.2)),
        format!("timing.period_ticks={}", random.pick(&[1, 4, 5, 5, 10, 12])),
    ];
    let mut sometimes = |share: f64, key: &str, from: f64, to: f64| {
        if random.chance(share) {
            keys.push(format!("{key}={}", random.real(from, to)));
        }
    };
    sometimes(0.5, "plant.slip_mean", -0.05, 0.2);
    sometimes(0.3, "plant.wheel_error_left", -0.03, 0.03);
    sometimes(0.3, "plant.track_error", -0.1, 0.1);
    sometimes(0.3, "plant.start_error_theta_rad", -0.5, 0.5);
    sometimes(0.3, "plant.start_sd_m", 0.0, 0.02);
    sometimes(0.3, "limits.v_min_mps", -0.05, 0.03);
    sometimes(0.3, "limits.omega_min_radps", 0.0, 0.01);
    sometimes(0.3, "tracking.speed_mps", 0.0, 0.08);
    sometimes(0.3, "tracking.acceptance_radius_m", 0.002, 0.05);
    sometimes(0.3, "chassis.track_m", 0.05, 0.3);
    sometimes(0.3, "chassis.wheel_speed_max_left_radps", 1.0, 3.25);
    sometimes(0.3, "motors.step_length_m", 0.000_1, 0.000_3);
    system.set_all(&keys).expect("a robot");
    system
}

#[test]
fn on_any_path_with_any_robot_it_knows_no_bit_differs() {
    let mut random = Random::new("on_any_path_with_any_robot_it_knows_no_bit_differs", 2);
    let mut arrived = 0;
    for _ in 0..200 {
        let waypoints = random_path(&mut random);
        let system = random_robot(&mut random, waypoints[0]);
        let period = system.timing.period_ticks;
        let ticks_max = random.whole(0, 15_000).next_multiple_of(period);
        let mut candidates = candidates(&mut random, 12);
        candidates.iter_mut().for_each(|candidate| {
            candidate.omega_max_radps = candidate.omega_max_radps.max(system.limits.omega_min_radps);
        });
        arrived += compare(&system, &waypoints, &candidates, ticks_max);
    }
    assert!((100..2000).contains(&arrived), "{arrived} of 2400 arrived");
}

#[test]
fn nobody_is_disturbed_by_who_drives_beside() {
    let mut random = Random::new("nobody_is_disturbed_by_who_drives_beside", 3);
    let (system, waypoints) = job("trapezoid");
    let path = FastPath::of(&system, &waypoints).expect("it applies");
    let candidates = candidates(&mut random, 70);
    let mut together = vec![FastFigures::default(); candidates.len()];
    path.evaluate_with(1, &candidates, 45_000, &mut together);
    for threads in [0, 2, 3, 200] {
        let mut figures = vec![FastFigures::default(); candidates.len()];
        path.evaluate_with(threads, &candidates, 45_000, &mut figures);
        assert_eq!(figures, together, "{threads} threads");
    }
    let backwards: Vec<Candidate> = candidates.iter().rev().copied().collect();
    let figures = path.evaluate(&backwards, 45_000);
    assert!(figures.iter().rev().eq(&together), "in another order");
    for (candidate, together) in candidates.iter().zip(&together).step_by(7) {
        assert_eq!(path.evaluate(&[*candidate], 45_000), [*together], "alone");
    }
    assert_eq!(path.evaluate(&[], 45_000), []);
}

#[test]
fn nothing_is_allocated_while_it_evaluates() {
    let (system, waypoints) = job("rectangle");
    let path = FastPath::of(&system, &waypoints).expect("it applies");
    let candidates = candidates(&mut Random::of_seed(4), 50);
    let mut figures = vec![FastFigures::default(); candidates.len()];
    let before = ALLOCATIONS.get();
    path.evaluate_with(1, &candidates, 20_000, &mut figures);
    assert_eq!(ALLOCATIONS.get() - before, 0);
    assert!(figures.iter().all(|figures| figures.ticks > 0));
    drop(path.clone());
    assert!(ALLOCATIONS.get() > before, "what allocates is seen to");
}

#[test]
fn effort_is_what_the_command_changes_by() {
    let (system, waypoints) = job("trapezoid");
    let path = FastPath::of(&system, &waypoints).expect("it applies");
    let figures = path.evaluate(&[Candidate::of(&system)], TICKS_MAX)[0];
    let mut robot = InProcess::new(&system, &waypoints).expect("a robot");
    let (mut last, mut sum, mut ticks) = ([0.0; 3], 0.0, 0u64);
    while robot.tick() {
        let twist = robot.steps().twist;
        // The e-puck's tops: 65 mm/s straight ahead, which turning takes 27 mm for every rad/s from.
        sum += (twist[0] - last[0]).abs() / 0.065 + (twist[2] - last[2]).abs() * 0.027 / 0.065;
        last = twist;
        ticks += 1;
    }
    let effort = sum / (ticks as f64 / 1000.0);
    assert!((figures.effort_per_s - effort).abs() <= 1e-9 * effort, "{figures:?} {effort}");
    assert!(effort > 1e-3 && figures.ticks == ticks);
}

#[test]
fn what_it_does_not_know_it_refuses() {
    let (trapezoid, straight) = job("trapezoid");
    let refused = |system: &System, path: &[Waypoint]| FastPath::of(system, path).err().unwrap_or("no");
    let with = |keys: &[&str]| {
        let mut system = trapezoid.clone();
        system.set_all(keys).expect("a robot");
        refused(&system, &straight)
    };
    for (keys, why) in [
        (&["motors.kind=servo"][..], "it has other wheels"),
        (&["motors.direction_setup_s=0.001"], "its motor drivers need"),
        (&["controller.law=pure-pursuit"], "its law is not"),
        (&["controller.exec=/bin/sh"], "its law is not"),
        (&["estimator.kind=ekf"], "its controller is not told"),
        (&["controller.drive_lag_s=0.01"], "its controller is not told"),
        (&["tracking.acceptance=bisector"], "waypoints are not accepted"),
        (&["limits.accel_mps2=1"], "its accelerations are"),
        (&["limits.accel_radps2=1"], "its accelerations are"),
        (&["plant.slip_sd=0.1"], "its slip varies"),
        (&["chassis.track_m=0.006"], "its steps are large"),
        (&["plant.slip_mean=0.1"], "no"),
    ] {
        assert!(with(keys).starts_with(why), "{keys:?}: {}", with(keys));
    }
    let arc = Waypoint { bulge: 0.3, ..straight[1] };
    let sideways = Waypoint { crab_rad: 0.3, ..straight[1] };
    let nowhere = Waypoint { x_m: f64::NAN, ..straight[1] };
    for (path, why) in [
        (&[straight[0], arc][..], "the path has arcs"),
        (&[straight[0], sideways], "the path has arcs"),
        (&[straight[0], nowhere], "the path is none"),
        (&straight[..1], "the path is none"),
        (&[], "the path is none"),
    ] {
        assert!(refused(&trapezoid, path).starts_with(why), "{path:?}");
    }
}
