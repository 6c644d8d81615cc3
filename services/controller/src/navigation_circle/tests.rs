//! The published runs of paper 2, on a small model of its cart, and what the mended points promise.

use super::*;
use hilare_interfaces::chassis::DifferentialParams;
use hilare_interfaces::geometry::WorldPoint;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Waypoint};

/// Radians.
const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// Control period of the cart, ticks; T_S.
const PERIOD: u64 = 10;
/// Half its track, L.
const HALF_TRACK_M: f64 = 0.2;

/// What the cart's pose comes from.
#[derive(Clone, Copy)]
struct Positioning {
    every_ticks: usize,
    delay_ticks: usize,
    noise_m: f64,
    noise_rad: f64,
}

const EXACT: Positioning = Positioning { every_ticks: 1, delay_ticks: 0, noise_m: 0.0, noise_rad: 0.0 };
/// 30 Hz, 40 ms late, 5 mm and 0.5° of standard deviation, and nothing that fuses it with odometry.
const CAMERA: Positioning =
    Positioning { every_ticks: 33, delay_ticks: 40, noise_m: 0.005, noise_rad: 0.5 * DEGREE };

/// Two wheels whose speeds lag the commanded ones to first order.
struct Cart {
    pose: WorldPose,
    /// Rim speeds, left and right, m/s.
    wheels: [f64; 2],
    /// Factor on the left wheel's speed: an unequal diameter.
    left: f64,
    lag_s: f64,
    past: Vec<WorldPose>,
    seen: WorldPose,
    random: u64,
}

impl Cart {
    fn new(pose: WorldPose, speed_mps: f64, seed: u64) -> Self {
        let random = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        Self { pose, wheels: [speed_mps; 2], left: 1.0, lag_s: 0.045, past: vec![], seen: pose, random }
    }

    /// Of variance 1: a sum of twelve uniform ones.
    fn normal(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            // xorshift64
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
            sum += (self.random >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    }

    fn tick(&mut self, command: BodyTwist, positioning: &Positioning) {
        let turn = HALF_TRACK_M * command.omega_radps;
        let wanted = [(command.vx_mps - turn) * self.left, command.vx_mps + turn];
        for (wheel, wanted) in self.wheels.iter_mut().zip(wanted) {
            *wheel += (wanted - *wheel) * TICK_S / self.lag_s;
        }
        let [left, right] = self.wheels;
        let (way, turn) = (0.5 * (left + right) * TICK_S, (right - left) / (2.0 * HALF_TRACK_M) * TICK_S);
        let (sin, cos) = libm::sincos(self.pose.theta_rad + turn / 2.0);
        let pose = self.pose;
        self.pose = WorldPose::new(pose.x_m + way * cos, pose.y_m + way * sin, pose.theta_rad + turn);
        self.past.push(self.pose);
        let age = positioning.delay_ticks + 1;
        if self.past.len() >= age && (self.past.len() - age).is_multiple_of(positioning.every_ticks) {
            let pose = self.past[self.past.len() - age];
            self.seen = WorldPose::new(
                pose.x_m + positioning.noise_m * self.normal(),
                pose.y_m + positioning.noise_m * self.normal(),
                pose.theta_rad + positioning.noise_rad * self.normal(),
            );
        }
    }
}

/// True cross-track error (m) over the way along the segment (m).
type Trace = Vec<(f64, f64)>;

fn law(values: &[(&'static str, f64)]) -> Box<dyn ControlLaw> {
    let chassis = Chassis::Differential(DifferentialParams {
        track_m: 2.0 * HALF_TRACK_M,
        wheel_diameter_m: 0.15,
        wheel_speed_max_right_radps: 40.0,
        wheel_speed_max_left_radps: 40.0,
    });
    let setup = LawSetup {
        chassis: &chassis,
        limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 2.5, omega_max_radps: 6.0 },
        acceptance_radius_m: 0.1,
        acceptance: Acceptance::Passed,
        period_ticks: PERIOD,
        values,
    };
    build(&setup).expect("parameters build")
}

fn drive(
    law: &mut dyn ControlLaw,
    cart: &mut Cart,
    segment: Segment,
    speed_mps: f64,
    positioning: Positioning,
) -> Trace {
    let reference = Reference {
        state: ReferenceState::Tracking.code(),
        speed_mps,
        last: segment.from.into(),
        current: Waypoint { bulge: segment.bulge, ..segment.to.into() },
        ..Reference::ZERO
    };
    let (mut acting, mut next) = (BodyTwist::new(cart.wheels[0], 0.0, 0.0), BodyTwist::ZERO);
    let mut trace = vec![];
    for tick in 0.. {
        if tick % PERIOD == 0 {
            if tick > 0 {
                acting = next;
            }
            next = law.step(LawInputs { pose: cart.seen, reference: &reference, acting }).twist;
        }
        cart.tick(acting, &positioning);
        let station = segment.nearest(cart.pose.position());
        trace.push((station.along * segment.length_m(), station.cross_track_m));
        if station.along >= 1.0 {
            break;
        }
    }
    trace
}

/// Greatest |error| from `way_m` on.
fn largest_from(trace: &Trace, way_m: f64) -> f64 {
    trace.iter().filter(|(way, _)| *way >= way_m).fold(0.0, |top, (_, e)| top.max(e.abs()))
}

/// How often the error goes from beyond ±`band` on one side to beyond it on the other.
fn sign_changes(trace: &Trace, band: f64) -> usize {
    let sides = trace.iter().filter(|(_, e)| e.abs() > band).map(|(_, e)| e.signum()).collect::<Vec<_>>();
    sides.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

const X_AXIS: Segment = Segment::line(WorldPoint::new(0.0, 0.0), WorldPoint::new(8.0, 0.0));

/// Clockwise about (1.03, 0), 270° with R = 1.02 m.
fn circle() -> Segment {
    Segment::new(WorldPoint::new(0.01, 0.0), WorldPoint::new(1.03, -1.02), -(core::f64::consts::SQRT_2 + 1.0))
}

/// Seeds of the noisy runs.
const SEEDS: core::ops::Range<u64> = 1..21;

#[test]
fn turned_by_21_degrees_it_is_back_within_2_m() {
    for (speed_mps, lag_s) in [(0.5, 0.03), (0.5, 0.06), (1.0, 0.045), (1.5, 0.03), (1.5, 0.06)] {
        let run = |positioning, seed| {
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 21.0 * DEGREE), speed_mps, seed);
            cart.lag_s = lag_s;
            drive(&mut *law(&[]), &mut cart, X_AXIS, speed_mps, positioning)
        };
        let exact = run(EXACT, 1);
        assert!(largest_from(&exact, 0.0) > 0.05, "the disturbance is none");
        assert!(
            largest_from(&exact, 2.0) < 0.002,
            "{speed_mps} m/s, {lag_s} s: {}",
            largest_from(&exact, 2.0)
        );
        assert!(largest_from(&exact, 3.5) < 0.001);
        for seed in SEEDS {
            let noisy = largest_from(&run(CAMERA, seed), 2.0);
            assert!(noisy < 0.010, "{speed_mps} m/s, {lag_s} s, seed {seed}: {noisy}");
        }
    }
}

#[test]
fn the_published_circle_has_one_overshoot_and_is_settled_within_60_degrees() {
    // 60° of R = 1.02 m.
    let way_m = 1.02 * 60.0 * DEGREE;
    for lag_s in [0.03, 0.045, 0.06] {
        let run = |positioning, seed| {
            let mut cart = Cart::new(WorldPose::new(0.0, 0.0, 90.0 * DEGREE), 0.0, seed);
            cart.lag_s = lag_s;
            drive(&mut *law(&[]), &mut cart, circle(), 1.5, positioning)
        };
        let exact = run(EXACT, 1);
        assert!((exact[0].1 - 0.01).abs() < 1e-3, "it starts 1 cm outside, to the left");
        assert_eq!(sign_changes(&exact, 1e-4), 1, "{lag_s} s");
        assert!(largest_from(&exact, way_m) < 0.001 && largest_from(&exact, 2.5) < 1e-4, "{lag_s} s");
        for seed in SEEDS {
            let noisy = largest_from(&run(CAMERA, seed), way_m);
            assert!(noisy < 0.010, "{lag_s} s, seed {seed}: {noisy}");
        }
    }
}

#[test]
fn the_integral_learns_unequal_wheels() {
    let long = Segment::line(WorldPoint::new(0.0, 0.0), WorldPoint::new(30.0, 0.0));
    let run = |values| {
        let mut cart = Cart::new(WorldPose::default(), 1.0, 1);
        cart.left = 0.98;
        largest_from(&drive(&mut *law(values), &mut cart, long, 1.0, EXACT), 25.0)
    };
    assert!(run(&[("integral_max_rad", 0.0)]) > 0.004);
    assert!(run(&[]) < 1e-4);
}

/// One step at 1 m/s.
fn step(law: &mut dyn ControlLaw, pose: WorldPose, from: (f64, f64), to: (f64, f64)) -> BodyTwist {
    let reference = Reference {
        state: ReferenceState::Tracking.code(),
        speed_mps: 1.0,
        last: Waypoint::straight(from.0, from.1),
        current: Waypoint::straight(to.0, to.1),
        ..Reference::ZERO
    };
    law.step(LawInputs { pose, reference: &reference, acting: BodyTwist::ZERO }).twist
}

#[test]
fn the_wheels_of_the_published_equations() {
    // 12 cm left of the x axis, heading 0.1 rad to the left of it: asin(0.12/0.48) = 0.252680, γ = 0.352680,
    // u = 0.9 · γ m/s: to the right, the left wheel faster by 2u.
    let twist = step(&mut *law(&[]), WorldPose::new(0.0, 0.12, 0.1), (-1.0, 0.0), (5.0, 0.0));
    let (left, right) = (1.0 + 0.317_412, 1.0 - 0.317_412);
    assert!((twist.vx_mps - 0.5 * (left + right)).abs() < 1e-9);
    assert!((twist.omega_radps - (right - left) / 0.4).abs() < 1e-5, "{twist:?}");
    // From outside the circle: straight at the path, and heading there already, no more turning.
    let twist = step(&mut *law(&[]), WorldPose::new(0.0, -3.0, 90.0 * DEGREE), (-1.0, 0.0), (5.0, 0.0));
    assert!(twist.omega_radps.abs() < 1e-9, "{twist:?}");
}

#[test]
fn a_new_segment_does_not_kick_the_derivative() {
    let (mut with, mut without) = (law(&[]), law(&[("derivative_s", 0.0)]));
    for law in [&mut with, &mut without] {
        step(&mut **law, WorldPose::new(0.99, 0.0, 0.0), (0.0, 0.0), (1.0, 0.0));
    }
    // A pure turn of the path by 90°, the robot going straight on: γ jumps, the robot has not turned.
    let corner = |law: &mut dyn ControlLaw| step(law, WorldPose::new(1.0, 0.0, 0.0), (1.0, 0.0), (1.0, 1.0));
    let (a, b) = (corner(&mut *with), corner(&mut *without));
    assert!(b.omega_radps > 5.0);
    // What is left: on the new line the centimetre driven is one of H, seen through the filter.
    let moved = 0.9 / HALF_TRACK_M * 0.05 * (0.01 / 0.48 / 0.01) * (10.0 / 60.0);
    assert!((a.omega_radps - b.omega_radps - moved).abs() < 1e-3, "{a:?} {b:?}");
}

#[test]
fn nothing_winds_up_while_it_cannot_help() {
    let fresh = step(&mut *law(&[]), WorldPose::default(), (-1.0, 0.0), (5.0, 0.0));
    // Held far outside the circle, then turned away, and a little wrong for very long.
    for (pose, most) in [
        (WorldPose::new(0.0, 3.0, -90.0 * DEGREE), 0.0),
        (WorldPose::new(0.0, 0.0, 2.0), 0.0),
        (WorldPose::new(0.0, 0.0, 0.05), 0.1),
    ] {
        let mut law = law(&[("derivative_s", 0.0)]);
        for _ in 0..10_000 {
            step(&mut *law, pose, (-1.0, 0.0), (5.0, 0.0));
        }
        let after = step(&mut *law, WorldPose::default(), (-1.0, 0.0), (5.0, 0.0));
        let learnt = (after.omega_radps - fresh.omega_radps).abs() / (0.9 / HALF_TRACK_M);
        assert!((learnt - most).abs() < 1e-9, "{pose:?}: {learnt}");
    }
}
