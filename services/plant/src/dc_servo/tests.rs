use super::*;
use core::f64::consts::TAU;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::params::ParamGroup;
use proptest::prelude::*;

const BODY: Body = Body { track_m: 0.4, wheel_diameter_m: 0.2, counts_per_turn: 4096 };

fn cart(params: DcServoParams) -> DcServo {
    DcServo::new(BODY, params, WorldPose::default())
}

/// Holds set points, right and left, for some ticks.
fn hold(robot: &mut DcServo, right: f64, left: f64, ticks: u64) -> WorldPose {
    let mut pose = robot.pose;
    for _ in 0..ticks {
        let steps = Steps { tick: robot.tick + 1, wheel_speed_radps: [right, left, 0.0, 0.0], ..Steps::ZERO };
        pose = robot.step(&steps);
    }
    pose
}

#[test]
fn it_comes_to_rest() {
    let mut robot = cart(DcServoParams::default());
    assert_eq!(hold(&mut robot, 0.0, 0.0, 100), WorldPose::default(), "nothing moves by itself");
    hold(&mut robot, 9.0, 5.0, 1000);
    let stopped = hold(&mut robot, 0.0, 0.0, 2000);
    let counts = robot.counts();
    let later = hold(&mut robot, 0.0, 0.0, 2000);
    assert!(stopped.position().distance_m(later.position()) < 1e-4, "{stopped:?} {later:?}");
    assert!(robot.velocity[0].abs() < 1e-6 && robot.velocity[1].abs() < 1e-6, "{:?}", robot.velocity);
    assert!((0..2).all(|i| (counts[i] - robot.counts()[i]).abs() <= 1));
}

#[test]
fn without_current_it_loses_energy_all_the_way() {
    // No gain, no voltage: back-EMF, gears, tyres and casters only take. A contact's creep, a turn and
    // forwards motion exchange what they have.
    let mut robot = cart(DcServoParams { velocity_gain_vsprad: 0.0, ..DcServoParams::default() });
    robot.velocity = [1.5, 3.0];
    robot.wheels[0].speed_radps = -8.0;
    let p = robot.params;
    let energy = |robot: &DcServo| {
        let [v, omega] = robot.velocity;
        let inertia = p.yaw_inertia_kgm2 + p.mass_kg * p.com_ahead_m * p.com_ahead_m;
        let wheels: f64 = robot.wheels.iter().map(|wheel| wheel.speed_radps * wheel.speed_radps).sum();
        p.mass_kg * v * v + inertia * omega * omega + p.wheel_inertia_kgm2 * wheels
    };
    let mut before = energy(&robot);
    for _ in 0..3000 {
        hold(&mut robot, 0.0, 0.0, 1);
        assert!(energy(&robot) <= before, "{} after {before}", energy(&robot));
        before = energy(&robot);
    }
    assert!(before < 1e-12, "{before}");
}

#[test]
fn steady_speed_is_the_set_point_times_the_radius() {
    for set_point in [1.0, -4.0, 15.0] {
        let mut robot = cart(DcServoParams { caster_start_rad: 0.0, ..DcServoParams::default() });
        let from = hold(&mut robot, set_point, set_point, 3000);
        let counts = robot.counts()[0];
        let to = hold(&mut robot, set_point, set_point, 2000);
        let mps = to.x_m - from.x_m;
        assert!((mps / (2.0 * set_point * 0.1) - 1.0).abs() < 3e-3, "{mps} at {set_point}");
        let turned_rad = (robot.counts()[0] - counts) as f64 / 4096.0 * TAU;
        assert!((turned_rad / (2.0 * set_point) - 1.0).abs() < 3e-3, "{turned_rad} at {set_point}");
    }
}

#[test]
fn the_velocity_loop_answers_within_its_time_constant() {
    // A step small enough for duty and tyres; 63 % of it, for the cart as for the wheel.
    let mut robot = cart(DcServoParams::default());
    hold(&mut robot, 5.0, 5.0, 2000);
    let part = 1.0 - libm::exp(-1.0);
    let (mut wheel_ticks, mut cart_ticks) = (0, 0);
    for _ in 0..1000 {
        hold(&mut robot, 6.0, 6.0, 1);
        wheel_ticks += u64::from(wheel_ticks == 0 || robot.wheels[0].speed_radps < 5.0 + part);
        cart_ticks += u64::from(robot.velocity[0] < 0.5 + 0.1 * part);
    }
    assert!((30..60).contains(&wheel_ticks) && (30..60).contains(&cart_ticks), "{wheel_ticks} {cart_ticks}");
}

#[test]
fn full_duty_gives_the_no_load_speed_and_leaves_without_windup() {
    let mut robot = cart(DcServoParams { caster_start_rad: 0.0, ..DcServoParams::default() });
    hold(&mut robot, 1e6, 1e6, 4000);
    // 24 V · 1 N·m/A / 0.8 Ω against back-EMF, gear, and half of what the casters' rolling takes.
    let rolling_nm = 0.02 * (15.0 * GRAVITY_MPS2 * 0.1 / 0.35) / 2.0 * 0.1;
    let top = (30.0 - 0.3 - rolling_nm) / (1.0 / 0.8 + 0.02);
    assert!((robot.wheels[0].speed_radps - top).abs() < 0.05, "{} {top}", robot.wheels[0].speed_radps);
    // Seconds of an error of a million rad/s leave no trace: the drive brakes in its next ticks.
    let before = robot.wheels[0].speed_radps;
    hold(&mut robot, 5.0, 5.0, 10);
    assert!(robot.wheels[0].speed_radps < before - 5.0, "{}", robot.wheels[0].speed_radps);
    hold(&mut robot, 5.0, 5.0, 1500);
    assert!((robot.velocity[0] - 0.5).abs() < 0.01);
}

#[test]
fn traction_limits_the_acceleration() {
    let mut robot = cart(DcServoParams { caster_start_rad: 0.0, ..DcServoParams::default() });
    hold(&mut robot, 1e6, 1e6, 200);
    let limit = 0.7 * GRAVITY_MPS2 * (1.0 - 0.1 / 0.35) - 0.02 * GRAVITY_MPS2 * 0.1 / 0.35;
    let mps2 = robot.velocity[0] / 0.2;
    assert!(mps2 < limit && mps2 > 0.95 * limit, "{mps2} of {limit}");
    assert!(robot.wheels[0].speed_radps * 0.1 > 1.5 * robot.velocity[0], "the wheels spin");
}

#[test]
fn casters_kick_when_it_reverses_and_then_trail() {
    let reverse = |params| {
        let mut robot = cart(params);
        hold(&mut robot, 5.0, 5.0, 1500);
        let heading = robot.pose.theta_rad;
        let (mut kick, mut fastest) = (0.0f64, 0.0f64);
        for _ in 0..4000 {
            let pose = hold(&mut robot, -5.0, -5.0, 1);
            kick = kick.max((pose.theta_rad - heading).abs());
            fastest = fastest.max(robot.velocity[1].abs());
        }
        (robot, kick, fastest)
    };
    let (robot, kick, fastest) = reverse(DcServoParams::default());
    assert!(robot.casters.iter().all(|caster| caster.rolls[0] < -0.999), "{:?}", robot.casters);
    assert!(kick > 2e-3 && kick < 0.1 && fastest > 0.03, "{kick} {fastest}");
    assert!(robot.velocity[1].abs() < 0.01 && (robot.velocity[0] + 0.5).abs() < 0.01, "{:?}", robot.velocity);
    let (_, gentle, _) = reverse(DcServoParams { caster_swivel_nm: 0.0, ..DcServoParams::default() });
    assert!(gentle < kick / 2.0, "{gentle} {kick}");
}

#[test]
fn unequal_speeds_give_the_circle_of_their_centre_of_rotation() {
    // Contact points on circles R ± L about one centre: 6/4 = (R + L)/(R − L), R = 1 m.
    let mut robot = cart(DcServoParams::default());
    let at = [2000, 900, 900].map(|ticks| hold(&mut robot, 6.0, 4.0, ticks).position());
    let [a, b, c] = [(0, 1), (1, 2), (2, 0)].map(|(i, j): (usize, usize)| at[i].distance_m(at[j]));
    let cross =
        (at[1].x_m - at[0].x_m) * (at[2].y_m - at[0].y_m) - (at[1].y_m - at[0].y_m) * (at[2].x_m - at[0].x_m);
    let radius_m = a * b * c / (2.0 * cross);
    assert!((radius_m - 1.0).abs() < 0.01, "{radius_m}");
}

#[test]
fn a_mirrored_job_ends_in_the_mirrored_pose() {
    let run = |turned: bool| {
        let mut robot = cart(DcServoParams { caster_start_rad: 0.0, ..DcServoParams::default() });
        for (one, other) in [(8.0, 5.0), (3.0, 9.0), (-4.0, 4.0)] {
            let (right, left) = if turned { (other, one) } else { (one, other) };
            hold(&mut robot, right, left, 800);
        }
        robot.pose
    };
    let (pose, mirrored) = (run(false), run(true));
    assert!(pose.y_m.abs() > 0.01 && pose.theta_rad.abs() > 0.1, "{pose:?}");
    let off = [pose.x_m - mirrored.x_m, pose.y_m + mirrored.y_m, pose.theta_rad + mirrored.theta_rad];
    assert!(off.iter().all(|off| off.abs() < 1e-6), "{pose:?} {mirrored:?}");
}

#[test]
fn finer_sub_steps_change_little() {
    let run = |sub_steps| {
        let mut robot = cart(DcServoParams::default());
        robot.sub_steps = sub_steps;
        hold(&mut robot, 10.0, 8.0, 1000);
        hold(&mut robot, -6.0, -4.0, 1500);
        hold(&mut robot, 0.0, 0.0, 1000)
    };
    let (coarse, usual, fine) = (run(1), run(SUB_STEPS), run(10));
    for (pose, off) in [(coarse, 5e-3), (usual, 1e-3)] {
        let gap = pose.position().distance_m(fine.position());
        assert!(gap < off && (pose.theta_rad - fine.theta_rad).abs() < off, "{pose:?} {fine:?}");
    }
}

#[test]
fn slip_shortens_the_way_unseen_and_unequal_wheels_turn() {
    let plain = DcServoParams { caster_start_rad: 0.0, ..DcServoParams::default() };
    let run = |params| {
        let mut robot = cart(params);
        let from = hold(&mut robot, 5.0, 5.0, 2000);
        let counts = robot.counts()[0];
        let to = hold(&mut robot, 5.0, 5.0, 2000);
        (to.x_m - from.x_m, to.theta_rad - from.theta_rad, robot.counts()[0] - counts)
    };
    let ((way, _, counts), (short, _, same)) = (run(plain), run(DcServoParams { slip_mean: 0.1, ..plain }));
    assert!((short / way - 0.9).abs() < 2e-3 && (counts - same).abs() < 30, "{short} {way} {counts} {same}");
    let (_, turned_rad, _) = run(DcServoParams { wheel_error_right: 0.02, ..plain });
    assert!((turned_rad - 2.0 * 0.5 * 0.02 / 0.4).abs() < 3e-3, "{turned_rad}");
}

#[test]
fn noise_repeats_with_its_seed_and_old_messages_change_nothing() {
    let noisy = |seed| DcServoParams { slip_sd: 0.1, start_sd_m: 0.01, seed, ..DcServoParams::default() };
    let run = |seed| hold(&mut cart(noisy(seed)), 5.0, 4.0, 500);
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
    let mut robot = cart(noisy(3));
    let pose = hold(&mut robot, 5.0, 5.0, 100);
    let stale = Steps { tick: 100, wheel_speed_radps: [9.0; 4], ..Steps::ZERO };
    assert_eq!(robot.step(&stale), pose);
    assert_eq!(robot.step(&Steps { tick: 3, ..stale }), pose);
}

#[test]
fn lost_messages_are_made_up_for_within_bounds() {
    let mut one = cart(DcServoParams::default());
    let mut other = one.clone();
    let each = hold(&mut one, 5.0, 4.0, 40);
    let last = Steps { tick: 40, wheel_speed_radps: [5.0, 4.0, 0.0, 0.0], ..Steps::ZERO };
    assert_eq!(other.step(&last), each);
    assert_eq!(one.counts(), other.counts());
    let far = other.step(&Steps { tick: u64::MAX, ..last });
    assert!(far.position().distance_m(each.position()) < 0.06, "{far:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_set_point_gives_finite_motion(
        runs in prop::collection::vec((-1e6..1e6f64, -1e6..1e6f64, 1u64..60), 1..6),
        seed in 0u64..1000,
    ) {
        let mut robot = cart(DcServoParams { slip_sd: 0.3, seed, ..DcServoParams::default() });
        for (right, left, ticks) in runs {
            let pose = hold(&mut robot, right, left, ticks);
            prop_assert!(pose.x_m.is_finite() && pose.y_m.is_finite() && pose.theta_rad.is_finite());
            prop_assert!(robot.velocity[0].abs() < 5.0 && robot.velocity[1].abs() < 25.0);
        }
    }

    #[test]
    fn parameters_at_their_bounds_stay_finite(
        ends in prop::collection::vec(0u8..4, DcServoParams::SPECS.len()),
        right in -1e6..1e6f64, left in -1e6..1e6f64,
    ) {
        let mut params = DcServoParams::default();
        for (spec, end) in DcServoParams::SPECS.iter().zip(ends) {
            let value = [spec.min, spec.max, spec.default, spec.default][usize::from(end)];
            params.set(spec.name, value).unwrap();
        }
        let mut robot = cart(params);
        hold(&mut robot, right, left, 300);
        let pose = hold(&mut robot, 0.0, 0.0, 300);
        prop_assert!(pose.x_m.is_finite() && pose.y_m.is_finite() && pose.theta_rad.is_finite(), "{params:?}");
        prop_assert!(robot.velocity.iter().all(|v| v.is_finite()), "{params:?}");
        prop_assert!(robot.casters.iter().all(|caster| caster.rolls[0].is_finite()), "{params:?}");
        // No faster than the motors can turn the wheels.
        let no_load = params.supply_v / (params.gear_ratio * params.torque_constant_nmpa);
        let rim = 0.1 * 1.5 * 1.95 * no_load;
        prop_assert!(robot.velocity[0].abs() <= rim + 1e-6, "{params:?} {:?}", robot.velocity);
    }
}

#[test]
fn no_number_is_taken_for_standstill() {
    let mut robot = cart(DcServoParams::default());
    assert_eq!(hold(&mut robot, f64::NAN, f64::NAN, 100), WorldPose::default());
    assert!(hold(&mut robot, f64::MAX, f64::NEG_INFINITY, 100).x_m.is_finite());
}
