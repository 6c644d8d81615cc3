//! A closed loop around one law, small enough to be run by the thousand: a selector, an ideal robot
//! with exact motion, the one-period latency of the real loop, and a pose that may be disturbed.
#![allow(dead_code, reason = "every test and benchmark takes what it needs of it")]

use hilare_controller::prediction::{Prediction, PredictionParams};
use hilare_controller::{ControlLaw, Controller, ControllerInputs, Identity, LawSetup, TwistLimits, law};
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::Block;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::{BodyTwist, WorldPose, wrap_angle_rad};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Fallback, PREVIEW, Pose, Reference, ReferenceState, Waypoint};

/// Ticks of a control period, and its length.
pub const PERIOD_TICKS: u64 = 5;
pub const PERIOD_S: f64 = 0.005;

/// The robot and its job.
#[derive(Clone, Debug)]
pub struct Course {
    pub chassis: Chassis,
    pub limits: TwistLimits,
    pub speed_mps: f64,
    pub radius_m: f64,
    pub acceptance: Acceptance,
    pub waypoints: Vec<Waypoint>,
    pub start: WorldPose,
}

impl Course {
    /// The e-puck of paper 1 at point A; the robot starts on the first waypoint, heading 0.
    pub fn epuck(points: &[(f64, f64)]) -> Self {
        Self {
            chassis: Chassis::Differential(DifferentialParams::default()),
            limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 0.041, omega_max_radps: 0.747 },
            speed_mps: 0.040,
            radius_m: 0.027,
            acceptance: Acceptance::Bisector,
            waypoints: points.iter().map(|(x, y)| Waypoint::straight(*x, *y)).collect(),
            start: WorldPose::new(points[0].0, points[0].1, 0.0),
        }
    }

    /// The default Mecanum robot at a walking pace.
    pub fn mecanum(waypoints: &[Waypoint]) -> Self {
        Self {
            chassis: Chassis::Mecanum(MecanumParams::default()),
            limits: TwistLimits { v_min_mps: -0.5, v_max_mps: 0.5, omega_max_radps: 1.5 },
            speed_mps: 0.3,
            radius_m: 0.05,
            acceptance: Acceptance::Bisector,
            waypoints: waypoints.to_vec(),
            start: WorldPose::new(waypoints[0].x_m, waypoints[0].y_m, 0.0),
        }
    }

    /// The law of a name, with its defaults but for `values`.
    pub fn law(&self, name: &str, values: &[(&'static str, f64)]) -> Box<dyn ControlLaw> {
        let spec = law(name).expect("in the registry");
        (spec.build)(&self.setup(values)).expect("the values are within bounds")
    }

    /// What a law is built from.
    pub fn setup<'a>(&'a self, values: &'a [(&'static str, f64)]) -> LawSetup<'a> {
        LawSetup {
            chassis: &self.chassis,
            limits: self.limits,
            acceptance_radius_m: self.radius_m,
            acceptance: self.acceptance,
            period_ticks: PERIOD_TICKS,
            values,
        }
    }

    /// Runs a law to the end of the path, or until it has had four times the time it should need.
    pub fn run(&self, law: Box<dyn ControlLaw>, disturbance: Disturbance) -> Run {
        self.run_watched(law, disturbance, |_, _, _| ())
    }

    /// The same; `watch` sees every reference, true pose and command.
    pub fn run_watched(
        &self,
        law: Box<dyn ControlLaw>,
        mut disturbance: Disturbance,
        mut watch: impl FnMut(&Reference, WorldPose, BodyTwist),
    ) -> Run {
        let prediction = Prediction::new(PredictionParams::default(), &self.setup(&[]));
        let mut controller = Controller::new(law, Identity { source: 1, epoch: 1 }, PERIOD_TICKS, prediction);
        let mut selector = Selector::new(self);
        let mut robot = self.start;
        let mut run = Run::new();
        let mut acting = BodyTwist::ZERO;
        let mut tick = 0;
        for _ in 0..self.patience() {
            let seen = disturbance.seen(robot, tick);
            let reference = selector.choose(seen);
            if reference.state != ReferenceState::Tracking.code() {
                run.arrived = true;
                break;
            }
            let pose = Pose::at(tick, seen);
            let command = controller.step(tick, ControllerInputs { reference, pose: &pose });
            let twist = command.twist().expect("finite");
            run.take(self, reference, robot, twist, command.fallback);
            watch(reference, robot, twist);
            robot = disturbance.moved(robot, acting);
            acting = self.constrain(twist);
            tick += PERIOD_TICKS;
        }
        run.finish(robot);
        run
    }

    fn patience(&self) -> u64 {
        let pairs = self.waypoints.windows(2);
        let length: f64 = pairs.map(|pair| pair[1].segment_from(pair[0]).length_m()).sum();
        let turns = self.waypoints.len() as f64 * 3.0 / self.limits.omega_max_radps;
        ((4.0 * length / self.speed_mps + turns + 20.0) / PERIOD_S) as u64
    }

    /// `[MH18] (9)–(24)` as the step generator has them, written again.
    pub fn constrain(&self, twist: BodyTwist) -> BodyTwist {
        let speed = libm::hypot(twist.vx_mps, twist.vy_mps);
        let shorten = if speed > self.limits.v_max_mps { self.limits.v_max_mps / speed } else { 1.0 };
        let vx_mps = match self.chassis {
            Chassis::Differential(_) => twist.vx_mps.clamp(self.limits.v_min_mps, self.limits.v_max_mps),
            Chassis::Mecanum(_) => twist.vx_mps * shorten,
        };
        let top = self.limits.omega_max_radps;
        let clamped = BodyTwist::new(vx_mps, twist.vy_mps * shorten, twist.omega_radps.clamp(-top, top));
        clamped.scaled(1.0 / self.chassis.motor_use(clamped).max(1.0))
    }
}

/// What stands between the true motion and what the loop believes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disturbance {
    /// Standard deviation of the pose a camera gives every 40 ms, held until the next.
    pub noise_m: f64,
    pub noise_rad: f64,
    /// Share of its motion each side loses: right and left wheel of a differential drive.
    pub slip: [f64; 2],
    pub seed: u64,
    /// What it has added since the last picture.
    pub held: [f64; 3],
}

impl Disturbance {
    pub const NONE: Self = Self { noise_m: 0.0, noise_rad: 0.0, slip: [0.0; 2], seed: 1, held: [0.0; 3] };

    /// A pose that jumps at 25 Hz.
    pub fn jumping(noise_m: f64, noise_rad: f64, seed: u64) -> Self {
        Self { noise_m, noise_rad, seed, ..Self::NONE }
    }

    fn seen(&mut self, robot: WorldPose, tick: u64) -> WorldPose {
        if tick.is_multiple_of(40) && (self.noise_m > 0.0 || self.noise_rad > 0.0) {
            self.held = [
                self.noise_m * normal(&mut self.seed),
                self.noise_m * normal(&mut self.seed),
                self.noise_rad * normal(&mut self.seed),
            ];
        }
        WorldPose::new(robot.x_m + self.held[0], robot.y_m + self.held[1], robot.theta_rad + self.held[2])
    }

    fn moved(&self, robot: WorldPose, twist: BodyTwist) -> WorldPose {
        let [right, left] = self.slip;
        let (mean, difference) = (0.5 * (right + left), right - left);
        // Wheels half the e-puck's track from the middle.
        let real = BodyTwist::new(
            twist.vx_mps * (1.0 - mean) - 0.5 * difference * twist.omega_radps * 0.027,
            twist.vy_mps * (1.0 - mean),
            twist.omega_radps * (1.0 - mean) - 0.5 * difference * twist.vx_mps / 0.027,
        );
        moved(robot, real, PERIOD_S)
    }
}

/// Where a constant twist leads: the arc of the exponential map, any chassis.
pub fn moved(pose: WorldPose, twist: BodyTwist, time_s: f64) -> WorldPose {
    let turn = twist.omega_radps * time_s;
    // sin(a)/a and (1 − cos a)/a about 0.
    let (s, c) = if turn.abs() < 1e-6 {
        (1.0, 0.5 * turn)
    } else {
        (libm::sin(turn) / turn, (1.0 - libm::cos(turn)) / turn)
    };
    let (x, y) = (twist.vx_mps * time_s, twist.vy_mps * time_s);
    let (dx, dy) = (s * x - c * y, c * x + s * y);
    let (sin, cos) = libm::sincos(pose.theta_rad);
    WorldPose::new(pose.x_m + cos * dx - sin * dy, pose.y_m + sin * dx + cos * dy, pose.theta_rad + turn)
}

/// The waypoint selector's rules, written again: one box does not import another.
struct Selector<'a> {
    course: &'a Course,
    reference: Reference,
    index: usize,
    inside: bool,
}

impl<'a> Selector<'a> {
    fn new(course: &'a Course) -> Self {
        let reference = Reference {
            state: ReferenceState::Tracking.code(),
            path_id: 1,
            total: course.waypoints.len() as u64,
            speed_mps: course.speed_mps,
            ..Reference::ZERO
        };
        let mut selector = Self { course, reference, index: 0, inside: false };
        selector.go_on();
        selector
    }

    fn go_on(&mut self) {
        self.index += 1;
        self.inside = false;
        let Some(coming) = self.course.waypoints.get(self.index + 1..) else {
            self.reference.state = ReferenceState::Arrived.code();
            return;
        };
        self.reference.index = self.index as u64;
        self.reference.last = self.course.waypoints[self.index - 1];
        self.reference.current = self.course.waypoints[self.index];
        let len = coming.len().min(PREVIEW);
        self.reference.preview_len = len as u64;
        self.reference.preview[..len].copy_from_slice(&coming[..len]);
    }

    fn choose(&mut self, pose: WorldPose) -> &Reference {
        let (robot, segment) = (pose.position(), self.reference.segment());
        let inside = robot.distance_m(segment.to) <= self.course.radius_m;
        let left = self.inside && !inside;
        self.inside = inside;
        let accepted = if self.course.acceptance == Acceptance::Rim || self.reference.preview_len == 0 {
            inside
        } else {
            let next = self.reference.preview[0].segment_from(self.reference.current);
            let nearer = next.cross_track_m(robot).abs() <= segment.cross_track_m(robot).abs();
            left || (inside && nearer)
        };
        if accepted {
            self.go_on();
        }
        &self.reference
    }
}

/// What became of a run.
#[derive(Clone, Debug)]
pub struct Run {
    pub arrived: bool,
    pub periods: u64,
    /// Of the true pose, against the segment in force.
    pub cross_track_mean_m: f64,
    pub cross_track_max_m: f64,
    /// Of the commanded linear speed after the constraints.
    pub speed_error_mean_mps: f64,
    /// Of the body's heading against the tangent less the crab angle.
    pub heading_error_mean_rad: f64,
    /// Greatest share of the motors' range, and of v_max, a command asked for.
    pub motor_use_max: f64,
    pub speed_use_max: f64,
    /// Sum of |Δω| over the run.
    pub yaw_travel_radps: f64,
    /// Commands with a fallback.
    pub fallbacks: u64,
    pub end: WorldPose,
    /// FNV-1a of every bit of every command.
    pub hash: u64,
    omega_radps: f64,
}

impl Run {
    fn new() -> Self {
        Self {
            arrived: false,
            periods: 0,
            cross_track_mean_m: 0.0,
            cross_track_max_m: 0.0,
            speed_error_mean_mps: 0.0,
            heading_error_mean_rad: 0.0,
            motor_use_max: 0.0,
            speed_use_max: 0.0,
            yaw_travel_radps: 0.0,
            fallbacks: 0,
            end: WorldPose::default(),
            hash: 0xcbf2_9ce4_8422_2325,
            omega_radps: 0.0,
        }
    }

    fn take(
        &mut self,
        course: &Course,
        reference: &Reference,
        robot: WorldPose,
        twist: BodyTwist,
        fallback: u64,
    ) {
        let station = reference.segment().nearest(robot.position());
        let off = station.cross_track_m.abs();
        let heading = station.heading_rad - reference.current.crab_rad - robot.theta_rad;
        let carried_out = course.constrain(twist);
        let speed = libm::hypot(twist.vx_mps, twist.vy_mps);
        self.periods += 1;
        self.cross_track_mean_m += off;
        self.cross_track_max_m = self.cross_track_max_m.max(off);
        self.speed_error_mean_mps += (carried_out.speed_mps().abs() - course.speed_mps).abs();
        self.heading_error_mean_rad += wrap_angle_rad(heading).abs();
        self.motor_use_max = self.motor_use_max.max(course.chassis.motor_use(twist));
        self.speed_use_max = self.speed_use_max.max(speed / course.limits.v_max_mps);
        self.yaw_travel_radps += (carried_out.omega_radps - self.omega_radps).abs();
        self.omega_radps = carried_out.omega_radps;
        self.fallbacks += u64::from(fallback != Fallback::None.code());
        for value in [twist.vx_mps, twist.vy_mps, twist.omega_radps] {
            for byte in value.to_bits().to_le_bytes() {
                self.hash = (self.hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
    }

    fn finish(&mut self, robot: WorldPose) {
        let n = self.periods.max(1) as f64;
        self.cross_track_mean_m /= n;
        self.speed_error_mean_mps /= n;
        self.heading_error_mean_rad /= n;
        self.end = robot;
    }
}

/// Uniform in 0 … 1: splitmix64.
pub fn uniform(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *seed;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Normal, mean 0, deviation 1: Box and Muller.
pub fn normal(seed: &mut u64) -> f64 {
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - uniform(seed)));
    radius * libm::cos(core::f64::consts::TAU * uniform(seed))
}

/// A polyline of legs of 60 … 500 mm that turns by up to 150° either way.
pub fn polyline(seed: u64, legs: usize) -> Vec<(f64, f64)> {
    let mut state = seed;
    let (mut x, mut y, mut heading) = (0.0, 0.0, 0.0);
    let mut points = vec![(x, y)];
    for leg in 0..legs {
        if leg > 0 {
            heading += (2.0 * uniform(&mut state) - 1.0) * 150.0_f64.to_radians();
        }
        let length = 0.060 + 0.440 * uniform(&mut state);
        x += length * libm::cos(heading);
        y += length * libm::sin(heading);
        points.push((x, y));
    }
    points
}

pub const RECTANGLE: [(f64, f64); 5] = [(0.2, 0.2), (0.6, 0.2), (0.6, 0.5), (0.2, 0.5), (0.2, 0.2)];
pub const TRAPEZOID: [(f64, f64); 5] = [(0.2, 0.2), (0.8, 0.2), (0.6, 0.5), (0.4, 0.5), (0.2, 0.2)];

/// The points of a waypoint file `x,y`.
pub fn points_of(csv: &str) -> Vec<(f64, f64)> {
    let number = |text: &str| text.trim().parse::<f64>().expect("a number");
    let lines = csv.lines().skip(1).filter(|line| !line.is_empty());
    lines.map(|line| line.split_once(',').expect("x,y")).map(|(x, y)| (number(x), number(y))).collect()
}
