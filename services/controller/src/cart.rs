//! A small model of paper 2's cart, for the tests of the laws it can be driven by: two wheels on DC servos
//! at 2L = 0.4 m, its pose from a positioning system alone.

use crate::{ControlLaw, LawInputs, LawSetup, TwistLimits};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::{Chassis, DifferentialParams};
use hilare_interfaces::geometry::{BodyTwist, WorldPoint, WorldPose};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Waypoint};
use hilare_interfaces::segment::Segment;

/// Radians.
pub(crate) const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// Control period of the cart, ticks; T_S.
const PERIOD: u64 = 10;
/// Half its track, L.
pub(crate) const HALF_TRACK_M: f64 = 0.2;

/// What the cart's pose comes from.
#[derive(Clone, Copy)]
pub(crate) struct Positioning {
    every_ticks: usize,
    delay_ticks: usize,
    noise_m: f64,
    noise_rad: f64,
}

pub(crate) const EXACT: Positioning =
    Positioning { every_ticks: 1, delay_ticks: 0, noise_m: 0.0, noise_rad: 0.0 };
/// 30 Hz, 40 ms late, 5 mm and 0.5° of standard deviation, and nothing that fuses it with odometry.
pub(crate) const CAMERA: Positioning =
    Positioning { every_ticks: 33, delay_ticks: 40, noise_m: 0.005, noise_rad: 0.5 * DEGREE };

/// Two wheels whose speeds lag the commanded ones to first order.
pub(crate) struct Cart {
    pose: WorldPose,
    /// Rim speeds, left and right, m/s.
    wheels: [f64; 2],
    /// Factor on the left wheel's speed: an unequal diameter.
    pub(crate) left: f64,
    pub(crate) lag_s: f64,
    past: Vec<WorldPose>,
    seen: WorldPose,
    random: u64,
}

impl Cart {
    pub(crate) fn new(pose: WorldPose, speed_mps: f64, seed: u64) -> Self {
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
pub(crate) type Trace = Vec<(f64, f64)>;

pub(crate) fn law(name: &str, values: &[(&'static str, f64)]) -> Box<dyn ControlLaw> {
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
    (crate::law(name).expect("a law").build)(&setup).expect("parameters build")
}

pub(crate) fn drive(
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
pub(crate) fn largest_from(trace: &Trace, way_m: f64) -> f64 {
    trace.iter().filter(|(way, _)| *way >= way_m).fold(0.0, |top, (_, e)| top.max(e.abs()))
}

/// How often the error goes from beyond ±`band` on one side to beyond it on the other.
pub(crate) fn sign_changes(trace: &Trace, band: f64) -> usize {
    let sides = trace.iter().filter(|(_, e)| e.abs() > band).map(|(_, e)| e.signum()).collect::<Vec<_>>();
    sides.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

pub(crate) const X_AXIS: Segment = Segment::line(WorldPoint::new(0.0, 0.0), WorldPoint::new(8.0, 0.0));

/// Clockwise about (1.03, 0), 270° with R = 1.02 m.
pub(crate) fn circle() -> Segment {
    Segment::new(WorldPoint::new(0.01, 0.0), WorldPoint::new(1.03, -1.02), -(core::f64::consts::SQRT_2 + 1.0))
}
