use super::*;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::params::ParamGroup;
use proptest::prelude::*;

const BODY: Body =
    Body { half_wheelbase_m: 0.2, half_track_m: 0.15, wheel_radius_m: 0.05, counts_per_turn: 4096 };

fn still() -> WorldPose {
    WorldPose::default()
}

/// Holds set points for some ticks.
fn hold(robot: &mut Mecanum, set_points: [f64; 4], ticks: u64) -> WorldPose {
    let mut pose = robot.pose;
    for _ in 0..ticks {
        let steps = Steps { tick: robot.tick + 1, wheel_speed_radps: set_points, ..Steps::ZERO };
        pose = robot.step(&steps);
    }
    pose
}

fn free_rolling() -> MecanumPlantParams {
    MecanumPlantParams { roller_friction: 0.0, ..MecanumPlantParams::default() }
}

/// [Qian18] (1) by hand, its y turned to the left; wheels front left, front right, rear left, rear right.
fn by_hand(x: f64, y: f64, omega: f64) -> [f64; 4] {
    let arm = BODY.half_wheelbase_m + BODY.half_track_m;
    [
        (x - y - arm * omega) / BODY.wheel_radius_m,
        (x + y + arm * omega) / BODY.wheel_radius_m,
        (x + y - arm * omega) / BODY.wheel_radius_m,
        (x - y + arm * omega) / BODY.wheel_radius_m,
    ]
}

#[test]
fn set_points_move_it_where_they_should() {
    let drive = |set_points| hold(&mut Mecanum::new(BODY, Default::default(), still()), set_points, 1000);
    let ahead = drive([5.0; 4]);
    assert!(ahead.x_m > 0.2 && ahead.y_m.abs() < 1e-9 && ahead.theta_rad.abs() < 1e-9, "{ahead:?}");
    let left = drive([-5.0, 5.0, 5.0, -5.0]);
    assert!(left.y_m > 0.2 && left.x_m.abs() < 1e-9 && left.theta_rad.abs() < 1e-9, "{left:?}");
    let turn = drive([-5.0, 5.0, -5.0, 5.0]);
    assert!(turn.theta_rad > 0.5 && turn.x_m.abs() < 1e-9 && turn.y_m.abs() < 1e-9, "{turn:?}");
}

#[test]
fn wheels_against_each_other_only_slip() {
    let mut robot = Mecanum::new(BODY, Default::default(), still());
    let pose = hold(&mut robot, [10.0, 10.0, -10.0, -10.0], 2000);
    assert!(pose.x_m.abs() + pose.y_m.abs() + pose.theta_rad.abs() < 1e-9, "{pose:?}");
    let [front, .., rear] = robot.counts();
    assert!(front > 10_000 && rear < -10_000, "the encoders do not see it: {front} {rear}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn steady_rolling_is_the_ideal_one(x in -0.4..0.4f64, y in -0.4..0.4f64, omega in -1.0..1.0f64) {
        let mut robot = Mecanum::new(BODY, free_rolling(), still());
        hold(&mut robot, by_hand(x, y, omega), 1500);
        let [vx, vy, yaw] = robot.velocity;
        // What is left of the first-order lag after 1.5 s is e⁻³⁰; the centripetal force costs some creep.
        prop_assert!((vx - x).abs() < 1e-3 && (vy - y).abs() < 1e-3, "{vx} {vy}");
        prop_assert!((yaw - omega).abs() < 2e-3, "{yaw}");
        if omega.abs() < 1e-2 {
            prop_assert!((vx - x).abs() < 1e-5 && (vy - y).abs() < 1e-5, "{vx} {vy}");
        }
    }

    #[test]
    fn any_set_point_gives_finite_motion(
        runs in prop::collection::vec((prop::array::uniform4(-1e6..1e6f64), 1u64..60), 1..6),
        seed in 0u64..1000,
    ) {
        let params = MecanumPlantParams { roller_slip_sd: 0.3, seed, ..Default::default() };
        let mut robot = Mecanum::new(BODY, params, still());
        for (set_points, ticks) in runs {
            let pose = hold(&mut robot, set_points, ticks);
            prop_assert!(pose.x_m.is_finite() && pose.y_m.is_finite() && pose.theta_rad.is_finite());
            let fastest = 0.05 * 30.0 * 2.0;
            prop_assert!(robot.velocity[0].abs() < fastest && robot.velocity[1].abs() < fastest);
        }
    }

    #[test]
    fn parameters_at_their_bounds_stay_finite(
        ends in prop::collection::vec(0u8..4, MecanumPlantParams::SPECS.len()),
        set_points in prop::array::uniform4(-1e6..1e6f64),
    ) {
        let mut params = MecanumPlantParams::default();
        for (spec, end) in MecanumPlantParams::SPECS.iter().zip(ends) {
            let value = [spec.min, spec.max, spec.default, spec.default][usize::from(end)];
            params.set(spec.name, value).unwrap();
        }
        let mut robot = Mecanum::new(BODY, params, still());
        hold(&mut robot, set_points, 300);
        let pose = hold(&mut robot, [0.0; 4], 300);
        prop_assert!(pose.x_m.is_finite() && pose.y_m.is_finite() && pose.theta_rad.is_finite(), "{params:?}");
        prop_assert!(robot.velocity.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn no_number_is_taken_for_standstill() {
    let mut robot = Mecanum::new(BODY, Default::default(), still());
    assert_eq!(hold(&mut robot, [f64::NAN; 4], 100), still());
    assert!(hold(&mut robot, [f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN], 100).x_m.is_finite());
}

#[test]
fn the_servo_answers_with_its_time_constant_and_limits() {
    let params = MecanumPlantParams { servo_acceleration_max_radps2: 1e5, ..Default::default() };
    let mut robot = Mecanum::new(BODY, params, still());
    hold(&mut robot, [4.0; 4], 50);
    assert!((robot.wheels[0].speed_radps - 4.0 * (1.0 - libm::exp(-1.0))).abs() < 1e-9);
    let mut robot = Mecanum::new(BODY, Default::default(), still());
    hold(&mut robot, [1e6; 4], 50);
    assert!((robot.wheels[0].speed_radps - 200.0 * 0.05).abs() < 1e-9, "held to its acceleration");
    hold(&mut robot, [1e6; 4], 1000);
    assert!((robot.wheels[0].speed_radps - 30.0).abs() < 1e-6, "held to its speed");
}

#[test]
fn it_comes_to_rest_and_loses_energy_all_the_way() {
    let mut robot = Mecanum::new(BODY, Default::default(), still());
    robot.velocity = [0.8, -0.6, 2.0];
    let energy = |robot: &Mecanum| {
        let [x, y, turn] = robot.velocity;
        robot.params.mass_kg * (x * x + y * y) + robot.params.yaw_inertia_kgm2 * turn * turn
    };
    let mut before = energy(&robot);
    for _ in 0..2000 {
        hold(&mut robot, [0.0; 4], 1);
        assert!(energy(&robot) <= before);
        before = energy(&robot);
    }
    assert!(before < 1e-20, "{before}");
}

#[test]
fn traction_limits_the_braking() {
    // Wheels that stand: no more than μ g along the axes, which lie at 45° to the motion.
    let mut robot = Mecanum::new(BODY, free_rolling(), still());
    robot.velocity = [1.0, 0.0, 0.0];
    hold(&mut robot, [0.0; 4], 100);
    let braking = (1.0 - robot.velocity[0]) / 0.1;
    let limit = 0.6 * GRAVITY_MPS2 * FRAC_1_SQRT_2;
    assert!(braking < limit && braking > 0.95 * limit, "{braking} of {limit}");
}

#[test]
fn a_mirrored_job_ends_in_the_mirrored_pose() {
    let run = |turned: bool| {
        let mut robot = Mecanum::new(BODY, Default::default(), still());
        for [fl, fr, rl, rr] in [[8.0, 5.0, -2.0, 7.0], [3.0, 9.0, 4.0, -6.0], [-25.0, 12.0, 30.0, 1.0]] {
            hold(&mut robot, if turned { [fr, fl, rr, rl] } else { [fl, fr, rl, rr] }, 500);
        }
        robot.pose
    };
    let (pose, mirrored) = (run(false), run(true));
    assert!(pose.y_m.abs() > 0.01 && pose.theta_rad.abs() > 0.1, "{pose:?}");
    let off = [pose.x_m - mirrored.x_m, pose.y_m + mirrored.y_m, pose.theta_rad + mirrored.theta_rad];
    assert!(off.iter().all(|off| off.abs() < 1e-9), "{pose:?} {mirrored:?}");
}

#[test]
fn finer_sub_steps_change_little() {
    let run = |sub_steps| {
        let mut robot = Mecanum::new(BODY, Default::default(), still());
        robot.sub_steps = sub_steps;
        hold(&mut robot, by_hand(0.5, 0.2, 1.0), 1000);
        hold(&mut robot, by_hand(-0.2, 0.5, -2.0), 1000);
        hold(&mut robot, [0.0; 4], 500)
    };
    let (coarse, usual, fine) = (run(1), run(SUB_STEPS), run(40));
    for (pose, off) in [(coarse, 1e-3), (usual, 3e-4)] {
        let gap = pose.position().distance_m(fine.position());
        assert!(gap < off && (pose.theta_rad - fine.theta_rad).abs() < off, "{pose:?} {fine:?}");
    }
}

#[test]
fn slip_shortens_the_way_unseen_and_unequal_wheels_turn() {
    let run = |params| {
        let mut robot = Mecanum::new(BODY, params, still());
        let pose = hold(&mut robot, [5.0; 4], 2000);
        (pose, robot.counts())
    };
    let (plain, counts) = run(free_rolling());
    let (slipping, slipping_counts) = run(MecanumPlantParams { roller_slip_mean: 0.1, ..free_rolling() });
    assert_eq!(counts, slipping_counts);
    assert!((slipping.x_m / plain.x_m - 0.9).abs() < 1e-3, "{slipping:?} {plain:?}");
    let wider =
        MecanumPlantParams { wheel_error_front_right: 0.01, wheel_error_rear_right: 0.01, ..free_rolling() };
    assert!(run(wider).0.theta_rad > 0.005);
}

#[test]
fn noise_repeats_with_its_seed_and_old_messages_change_nothing() {
    let noisy =
        |seed| MecanumPlantParams { roller_slip_sd: 0.1, start_sd_m: 0.01, seed, ..Default::default() };
    let run = |seed| hold(&mut Mecanum::new(BODY, noisy(seed), still()), [5.0, 4.0, 3.0, 2.0], 500);
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
    let mut robot = Mecanum::new(BODY, noisy(3), still());
    let pose = hold(&mut robot, [5.0; 4], 100);
    let stale = Steps { tick: 100, wheel_speed_radps: [9.0; 4], ..Steps::ZERO };
    assert_eq!(robot.step(&stale), pose);
    assert_eq!(robot.step(&Steps { tick: 3, ..stale }), pose);
}

#[test]
fn lost_messages_are_made_up_for() {
    let mut one = Mecanum::new(BODY, Default::default(), still());
    let mut other = one.clone();
    let each = hold(&mut one, [5.0, 4.0, 3.0, 2.0], 40);
    let last = Steps { tick: 40, wheel_speed_radps: [5.0, 4.0, 3.0, 2.0], ..Steps::ZERO };
    assert_eq!(other.step(&last), each);
    assert_eq!(one.counts(), other.counts());
}
