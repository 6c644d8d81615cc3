//! The plan with hard bounds against two other solvers, the closed form and its own promises.

use super::super::plan::FiniteStep;
use super::*;
use proptest::prelude::*;

const T: f64 = 0.1;

fn model(along_mps: f64) -> Model {
    Model { sample_s: T, along_mps, validity_rad: 8_f64.to_radians() }
}

fn bounds(now_mps: f64, accel: f64, speed_mps: f64) -> Bounds {
    let jump_mps = accel * T;
    Bounds {
        speed_mps,
        jump_mps,
        first_jump_mps: jump_mps,
        now_mps,
        yaw_radps: 2.0,
        path_radps: 0.0,
        ends: true,
    }
}

fn solver() -> LeastEffort {
    LeastEffort::new(STEPS_CAP, 100).expect("clarabel takes the pattern")
}

/// v_x(k) of the optimum, mm/s.
struct Known {
    now_mps: f64,
    distance_m: f64,
    heading_deg: f64,
    along_mps: f64,
    steps: usize,
    turning: usize,
    accel: f64,
    speed: f64,
    v_x: &'static [f64],
}

/// OSQP 1.1.3 (ADMM, eps 1e-11, polished) on min ½|v|², rows (19), |v| ≤ v_xmax, first and last jump, jumps
/// inside; scipy 1.17.1's SLSQP from there moves no entry by more than 2e-10 m/s.
const KNOWN: [Known; 6] = [
    Known {
        now_mps: 0.0,
        distance_m: 0.01,
        heading_deg: 5.0,
        along_mps: 0.3,
        steps: 16,
        turning: 16,
        accel: 0.05,
        speed: 0.5,
        v_x: &[
            5.0, 10.0, 15.0, 20.0, 25.0, 28.65757, 28.63973, 28.62359, 28.60915, 28.59641, 28.58537, 25.0,
            20.0, 15.0, 10.0, 5.0,
        ],
    },
    Known {
        now_mps: 0.0,
        distance_m: 0.01,
        heading_deg: 5.0,
        along_mps: 0.5,
        steps: 22,
        turning: 22,
        accel: 0.05,
        speed: 0.5,
        v_x: &[
            5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 40.08944, 40.07246, 40.05674, 40.04228, 40.02907,
            40.01712, 40.0, 35.0, 30.0, 25.0, 20.0, 15.0, 10.0, 5.0,
        ],
    },
    Known {
        now_mps: 0.0,
        distance_m: 0.01,
        heading_deg: 5.0,
        along_mps: 0.3,
        steps: 12,
        turning: 3,
        accel: 0.05,
        speed: 0.5,
        v_x: &[5.0, 10.0, 15.0, 15.37921, 15.37921, 15.37921, 15.37921, 15.37921, 15.37921, 15.0, 10.0, 5.0],
    },
    Known {
        now_mps: 0.0,
        distance_m: 0.01,
        heading_deg: 5.0,
        along_mps: 0.5,
        steps: 14,
        turning: 4,
        accel: 0.05,
        speed: 0.5,
        v_x: &[
            5.0, 10.0, 15.0, 18.62835, 18.61948, 18.61948, 18.61948, 18.61948, 18.61948, 18.61948, 18.61948,
            15.0, 10.0, 5.0,
        ],
    },
    Known {
        now_mps: 0.012,
        distance_m: -0.006,
        heading_deg: -4.0,
        along_mps: 0.4,
        steps: 16,
        turning: 10,
        accel: 0.05,
        speed: 0.5,
        v_x: &[
            7.0, 2.0, -3.0, -8.0, -13.0, -18.0, -21.76599, -21.75857, -21.75327, -21.75009, -21.74903,
            -21.74903, -20.0, -15.0, -10.0, -5.0,
        ],
    },
    Known {
        now_mps: -0.02,
        distance_m: 0.004,
        heading_deg: 2.0,
        along_mps: 0.3,
        steps: 12,
        turning: 12,
        accel: 0.1,
        speed: 0.02,
        v_x: &[
            -10.0, 0.0, 10.0, 12.25997, 12.25821, 12.25665, 12.2553, 12.25416, 12.25323, 12.25251, 12.25199,
            10.0,
        ],
    },
];

#[test]
fn it_is_the_optimum_of_two_other_solvers() {
    let mut solver = solver();
    for (n, known) in KNOWN.iter().enumerate() {
        let start = Deviation { heading_rad: known.heading_deg.to_radians(), distance_m: known.distance_m };
        let turn = Turn::within(start.heading_rad, known.turning);
        let bounds = bounds(known.now_mps, known.accel, known.speed);
        let problem = Problem::new(&model(known.along_mps), start, &bounds, turn, known.steps);
        assert!(problem.can_land(), "{n}");
        let v_x = solver.solve(&problem).expect("solved");
        for (k, value) in known.v_x.iter().enumerate() {
            assert!((v_x[k] * 1e3 - value).abs() < 1e-3, "{n}, step {k}: {} {value}", v_x[k] * 1e3);
        }
    }
}

#[test]
fn the_shortest_that_lands_from_rest_under_all_bounds_of_tables_1_and_2() {
    let start = Deviation { heading_rad: 5_f64.to_radians(), distance_m: 0.01 };
    // By hand: up by 5 mm/s a step and down again makes 0.5 mm times m² (N = 2m − 1) or m (m + 1) (N = 2m)
    // good; the way is 10 mm + T v_τ 5° (M + 1)/2, e_θ gone in M steps. At 0.75 rad/s M is at least 2.
    for (along, synchronous, steps) in [(0.3, true, 15), (0.5, true, 21), (0.3, false, 10), (0.5, false, 11)]
    {
        let search = Search { least: 1, most: 40, turn: 8, synchronous };
        let bounds = Bounds { yaw_radps: 0.75, ..bounds(0.0, 0.05, 0.5) };
        let problem = search.choose(&model(along), start, &bounds);
        assert!(problem.can_land());
        assert_eq!(problem.steps, steps, "{along} {synchronous}");
    }
}

/// Keeps every bound of (5), jumps at both ends included, to `slack`; what acts may be outside.
fn keeps(v_x: &PerStep, steps: usize, bounds: &Bounds, slack: f64) -> Result<(), TestCaseError> {
    let mut before = bounds.now_mps;
    for (k, v) in v_x[..steps].iter().enumerate() {
        let jump = if k == 0 { bounds.first_jump_mps } else { bounds.jump_mps };
        prop_assert!((v - before).abs() <= jump + slack, "step {}: {} after {}", k, v, before);
        // Back inside as fast as the jumps allow.
        let over = (bounds.now_mps.abs() - bounds.first_jump_mps - k as f64 * bounds.jump_mps).max(0.0);
        prop_assert!(v.abs() <= bounds.speed_mps.max(over) + slack, "step {}: {}", k, v);
        let to_rest = (steps - k) as f64 * bounds.jump_mps;
        prop_assert!(v.abs() <= to_rest.max(over) + slack, "step {}: {} cannot stop", k, v);
        before = *v;
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn where_the_closed_form_keeps_the_bounds_it_is_the_closed_form(
        heading in -0.139..0.139f64, distance in -0.05..0.05f64, along in 0.0..0.6f64, steps in 2usize..=30,
        now in -0.1..0.1f64,
    ) {
        let start = Deviation { heading_rad: heading, distance_m: distance };
        let closed = FiniteStep::new(&model(along), start, steps);
        let bounds = bounds(closed.v_x(0) + now.clamp(-0.05, 0.05), 0.6, 0.5);
        prop_assume!(closed.keeps(&bounds));
        let problem = Problem::new(&model(along), start, &bounds, closed.turn(), steps);
        prop_assert!(problem.can_land());
        let v_x = solver().solve(&problem).expect("solved");
        for (k, v) in v_x.iter().enumerate() {
            prop_assert!((v - closed.v_x(k)).abs() < 1e-6, "step {}: {} {}", k, v, closed.v_x(k));
        }
    }

    #[test]
    fn it_lands_where_that_is_possible_and_keeps_every_bound_always(
        heading in -3.1..3.1f64, distance in -0.3..0.3f64, along in 0.0..0.6f64, now in -0.3..0.3f64,
        cut in 0.05..1.0f64, accel in 0.02..0.5f64, speed in 0.02..0.5f64, least in 1usize..12, synchronous: bool,
    ) {
        let start = Deviation { heading_rad: heading, distance_m: distance };
        let mut bounds = bounds(now, accel, speed);
        bounds.first_jump_mps *= cut;
        let search = Search { least, most: 30, turn: 8, synchronous };
        let problem = search.choose(&model(along), start, &bounds);
        prop_assert!(bounds.allow_turn(problem.turn.rate_radps(0, T)));
        let mean = problem.between();
        keeps(&mean, problem.steps, &bounds, 1e-12)?;
        let solved = solver().solve(&problem);
        if let Some(v_x) = solved {
            keeps(&v_x, problem.steps, &bounds, 1e-8)?;
        }
        if problem.can_land() {
            // Carried out on the model, both land; the solver may decline only where nothing is left to choose.
            for v_x in [Some(mean), solved].into_iter().flatten() {
                let mut state = start;
                for (k, v) in v_x[..problem.steps].iter().enumerate() {
                    state = model(along).next(state, problem.turn.rate_radps(k, T), *v);
                }
                prop_assert!(state.heading_rad.abs() < 1e-9 && state.distance_m.abs() < 1e-8, "{:?}", state);
            }
            let effort = |v_x: &PerStep| v_x.iter().map(|v| v * v).sum::<f64>();
            prop_assert!(solved.is_none_or(|v_x| effort(&v_x) <= effort(&mean) + 1e-9));
        } else {
            // The envelope on the way's side: no plan within the bounds comes nearer.
            let side = if problem.way_m > problem.reach_m.1 { problem.hi } else { problem.lo };
            prop_assert!((0..problem.steps).all(|k| (mean[k] - side[k]).abs() < 1e-12));
        }
    }
}

#[test]
fn the_solver_gets_there_nearly_always_and_says_when_not() {
    let mut solver = solver();
    let (mut asked, mut declined) = (0, 0);
    for n in 0..4000_u32 {
        // A cheap spread over −1 … 1.
        let at = |step: f64| libm::sin(f64::from(n) * step * 12.9898);
        let start = Deviation { heading_rad: 0.139 * at(0.7), distance_m: 0.05 * at(1.3) };
        let problem = Search { least: 8, most: 30, turn: 8, synchronous: n % 2 == 0 }.choose(
            &model(0.25 + 0.25 * at(0.31)),
            start,
            &bounds(0.02 * at(2.1), 0.05, 0.5),
        );
        if problem.can_land() {
            asked += 1;
            declined += u32::from(solver.solve(&problem).is_none());
        }
    }
    assert!(asked > 3000 && declined * 1000 < asked, "{declined} of {asked}");
}
