//! A Mecanum robot in closed loop, for the tests of the law: ideal, or with a camera and servos.

use super::*;
use crate::prediction::{Prediction, PredictionParams};
use crate::{Controller, ControllerInputs, Identity, TwistLimits};
use hilare_interfaces::block::Block;
use hilare_interfaces::chassis::{Chassis, MecanumParams};
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Command, Pose, Reference, ReferenceState, Waypoint};
use hilare_interfaces::segment::Segment;

pub(super) const PERIOD_TICKS: u64 = 5;
/// At least as many as are reckoned with.
const REMEMBERED_PERIODS: usize = 400;
const LIMITS: TwistLimits = TwistLimits { v_min_mps: 0.0, v_max_mps: 0.8, omega_max_radps: 0.747 };

pub(super) fn chassis() -> Chassis {
    Chassis::Mecanum(MecanumParams::default())
}

const fn setup<'a>(
    chassis: &'a Chassis,
    period_ticks: u64,
    values: &'a [(&'static str, f64)],
) -> LawSetup<'a> {
    LawSetup {
        chassis,
        limits: LIMITS,
        acceptance_radius_m: 0.05,
        acceptance: Acceptance::Passed,
        period_ticks,
        values,
    }
}

pub(super) fn try_law(period_ticks: u64, values: &[(&'static str, f64)]) -> Built {
    build(&setup(&chassis(), period_ticks, values))
}

/// The robot and its senses.
#[derive(Clone, Copy)]
pub(super) struct Lags {
    pub(super) period_ticks: u64,
    /// Time from one picture to the next, and how late they come; 1 and 0: the pose is exact.
    pub(super) picture_ticks: u64,
    pub(super) delay_ticks: u64,
    /// Time constant of the drives.
    pub(super) servo_s: f64,
    /// Peak of a disturbance of each picture, m and rad.
    pub(super) noise: (f64, f64),
    /// The pose is moved on by what is known of these lags, as every law's is.
    pub(super) predict: bool,
}

pub(super) const IDEAL: Lags = Lags {
    period_ticks: PERIOD_TICKS,
    picture_ticks: 1,
    delay_ticks: 0,
    servo_s: 0.0,
    noise: (0.0, 0.0),
    predict: true,
};

/// A camera every 100 ms, late, and drives of first order.
pub(super) const fn lagged(delay_ticks: u64, noise: (f64, f64)) -> Lags {
    Lags { picture_ticks: 100, delay_ticks, servo_s: 0.05, noise, ..IDEAL }
}

/// e_d, e_θ of each tick, and the commands.
pub(super) struct Run {
    pub(super) deviations: Vec<Deviation>,
    pub(super) commands: Vec<Command>,
}

impl Run {
    /// From when on |e_d| ≤ 2 mm and |e_θ| ≤ 2° for good, s.
    pub(super) fn corrected_s(&self) -> f64 {
        let bad = |d: &Deviation| d.distance_m.abs() > 0.002 || d.heading_rad.abs() > 2_f64.to_radians();
        self.deviations.iter().rposition(bad).map_or(0.0, |tick| (tick + 1) as f64 * TICK_S)
    }

    /// Greatest |e_d| in mm and |e_θ| in degrees from a time on.
    pub(super) fn greatest(&self, from_s: f64) -> (f64, f64) {
        let from = libm::round(from_s / TICK_S) as usize;
        self.deviations[from..].iter().fold((0.0, 0.0), |(d, h): (f64, f64), e| {
            (d.max(e.distance_m.abs() * 1e3), h.max(e.heading_rad.abs().to_degrees()))
        })
    }

    /// e_d in mm, e_θ in degrees.
    pub(super) fn at(&self, time_s: f64) -> (f64, f64) {
        let e = self.deviations[libm::round(time_s / TICK_S) as usize];
        (e.distance_m * 1e3, e.heading_rad.to_degrees())
    }

    /// Commands in which the law had to do without something.
    pub(super) fn fallbacks(&self, what: Fallback) -> usize {
        self.commands.iter().filter(|command| command.fallback == what.code()).count()
    }
}

/// −1 … 1, the same every time.
fn spread(n: u64, salt: u64) -> f64 {
    let mut x = (n * 2 + salt).wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x >> 11) as f64) / ((1_u64 << 52) as f64) - 1.0
}

/// What is driven along, and how fast.
#[derive(Clone, Copy)]
pub(super) struct Path<'a> {
    pub(super) segments: &'a [Segment],
    /// Crab angle of each segment; none for what is missing.
    pub(super) crabs: &'a [f64],
    pub(super) speed_mps: f64,
}

impl Path<'_> {
    fn crab(&self, n: usize) -> f64 {
        self.crabs.get(n).copied().unwrap_or(0.0)
    }

    pub(super) fn reference(&self, index: usize) -> Reference {
        let waypoint = |n: usize| Waypoint {
            bulge: self.segments[n].bulge,
            crab_rad: self.crab(n),
            ..Waypoint::from(self.segments[n].to)
        };
        let mut reference = Reference {
            state: ReferenceState::Tracking.code(),
            path_id: 1,
            index: index as u64 + 1,
            total: self.segments.len() as u64 + 1,
            speed_mps: self.speed_mps,
            last: Waypoint::from(self.segments[index].from),
            current: waypoint(index),
            ..Reference::ZERO
        };
        for (n, next) in (index + 1..self.segments.len()).zip(reference.preview.iter_mut()) {
            *next = waypoint(n);
            reference.preview_len += 1;
        }
        reference
    }

    fn passed(&self, n: usize, pose: WorldPose) -> bool {
        n + 1 < self.segments.len() && self.segments[n].nearest(pose.position()).along > 1.0
    }
}

/// The robot and what is seen of it.
struct Agv {
    lags: Lags,
    truth: WorldPose,
    /// What its drives do, in its own frame.
    servo: BodyTwist,
    /// Its poses, from before the start on; a picture is taken of some.
    past: Vec<WorldPose>,
    /// Poses before the start.
    before: u64,
}

impl Agv {
    /// Where it starts, having come there with `twist` all the time.
    fn new(truth: WorldPose, twist: BodyTwist, lags: Lags) -> Self {
        let before = lags.delay_ticks + lags.picture_ticks;
        let past = (0..before).rev().map(|age| moved(truth, twist, -((age + 1) as f64) * TICK_S));
        Self { lags, truth, servo: twist, past: past.collect(), before }
    }

    /// The newest picture that has come through at `tick`, counted from `before` ticks ago.
    fn seen(&self, tick: u64) -> Pose {
        let lags = &self.lags;
        let taken = (tick + self.before - lags.delay_ticks) / lags.picture_ticks * lags.picture_ticks;
        let pose = self.past[taken as usize];
        Pose {
            tick: tick + self.before,
            x_m: pose.x_m + lags.noise.0 * spread(taken, 0),
            y_m: pose.y_m + lags.noise.0 * spread(taken, 1),
            theta_rad: pose.theta_rad + lags.noise.1 * spread(taken, 7),
            measured_tick: taken,
        }
    }

    fn tick(&mut self, acting: BodyTwist) {
        let share = if self.lags.servo_s > 0.0 { 1.0 - libm::exp(-TICK_S / self.lags.servo_s) } else { 1.0 };
        self.servo = BodyTwist::new(
            self.servo.vx_mps + share * (acting.vx_mps - self.servo.vx_mps),
            self.servo.vy_mps + share * (acting.vy_mps - self.servo.vy_mps),
            self.servo.omega_radps + share * (acting.omega_radps - self.servo.omega_radps),
        );
        self.truth = moved(self.truth, self.servo, TICK_S);
    }
}

/// Drives for `time_s`, from `start` relative to the path's start. The robot has come there straight on at
/// full speed.
pub(super) fn drive(
    values: &[(&'static str, f64)],
    path: Path<'_>,
    start: Deviation,
    time_s: f64,
    lags: Lags,
) -> Run {
    let first = path.segments[0];
    let tangent = first.start_heading_rad();
    let (sin, cos) = libm::sincos(tangent);
    let (x, y) = (first.from.x_m - start.distance_m * sin, first.from.y_m + start.distance_m * cos);
    let before = BodyTwist::new(path.speed_mps, 0.0, 0.0).turned(path.crab(0));
    let pose = WorldPose::new(x, y, tangent + start.heading_rad - path.crab(0));
    let mut agv = Agv::new(pose, before, lags);
    let mut controller = controller(values, before, lags);
    let (mut acting, mut commanded) = (before, before);
    // The segment the robot is on, and the one the selector takes it to be on.
    let (mut on, mut index) = (0, 0);
    let (mut deviations, mut commands) = (Vec::new(), Vec::new());
    for tick in 0..libm::round(time_s / TICK_S) as u64 {
        on += usize::from(path.passed(on, agv.truth));
        let station = path.segments[on].nearest(agv.truth.position());
        deviations.push(Deviation {
            heading_rad: wrap_angle_rad(agv.truth.theta_rad + path.crab(on) - station.heading_rad),
            distance_m: station.cross_track_m,
        });
        agv.past.push(agv.truth);
        if tick % lags.period_ticks == 0 {
            acting = commanded;
            let pose = agv.seen(tick);
            index += usize::from(path.passed(index, pose.pose()));
            let reference = path.reference(index);
            let command = controller.step(pose.tick, ControllerInputs { reference: &reference, pose: &pose });
            commanded = command.twist().expect("finite commands");
            commands.push(command);
        }
        agv.tick(acting);
    }
    Run { deviations, commands }
}

/// The law behind what every law is spared, on a robot that has been told `acting` for long.
fn controller(values: &[(&'static str, f64)], acting: BodyTwist, lags: Lags) -> Controller {
    let chassis = chassis();
    let setup = setup(&chassis, lags.period_ticks, values);
    let drive_lag_s = if lags.predict { lags.servo_s } else { 0.0 };
    let mut prediction = Prediction::new(PredictionParams { predict: lags.predict, drive_lag_s }, &setup);
    (0..REMEMBERED_PERIODS).for_each(|_| prediction.note(acting));
    let law = build(&setup).expect("builds");
    let identity = Identity { source: 1, epoch: 1 };
    Controller { acting, ..Controller::new(law, identity, lags.period_ticks, prediction) }
}
