//! The paper's closed rectangle, driven by Kanayama's law on the estimate.

use super::{Camera, Noise, Pulses, Robot, Wrong};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::geometry::{BodyError, BodyTwist, WorldPoint, WorldPose};
use hilare_interfaces::segment::Segment;
use hilare_pose_estimator::{EstimatorInputs, EstimatorKind, EstimatorSetup, PoseEstimator};

const CORNERS_M: [(f64, f64); 5] = [(0.2, 0.2), (0.6, 0.2), (0.6, 0.5), (0.2, 0.5), (0.2, 0.2)];
const SPEED_MPS: f64 = 0.04;
const ACCEPTANCE_M: f64 = 0.027;
const TICKS_MAX: Tick = 80_000;
/// Tick from which on the estimate has had time to settle.
pub const SETTLED: Tick = 5000;

/// What a drive round the rectangle gave.
#[derive(Debug, Clone, Copy)]
pub struct Driven {
    pub ticks: Tick,
    pub arrived: bool,
    pub cross_track_mean_m: f64,
    pub cross_track_max_m: f64,
    /// Root mean square of the position error of the estimate, from [`SETTLED`] on.
    pub estimate_rms_m: f64,
    /// Root mean square of the steps of the estimate at a fix, from [`SETTLED`] on.
    pub jump_rms_m: f64,
    pub steps: [i64; 2],
}

fn corner(k: usize) -> WorldPoint {
    WorldPoint::new(CORNERS_M[k].0, CORNERS_M[k].1)
}

/// [MH18] (5)–(7), (9)–(24) at point A.
fn command(setup: &EstimatorSetup, pose: WorldPose, segment: Segment) -> BodyTwist {
    let target = WorldPose::new(segment.to.x_m, segment.to.y_m, segment.heading_rad());
    let error = BodyError::between(pose, target);
    let (sin, cos) = libm::sincos(error.theta_rad);
    let v = (SPEED_MPS * cos + 0.0247 * error.x_m).clamp(0.0, 0.041);
    let omega = (SPEED_MPS * (2.9671e6 * error.y_m + 552.0 * sin)).clamp(-0.747, 0.747);
    let wanted = BodyTwist::new(v, 0.0, omega);
    let motor_use = setup.chassis.motor_use(wanted);
    if motor_use > 1.0 { wanted.scaled(1.0 / motor_use) } else { wanted }
}

/// Drives with `kind` and the usual camera, which is used by those that need it.
pub fn drive(kind: EstimatorKind, setup: EstimatorSetup, wrong: Wrong, seed: u64) -> Driven {
    drive_under(Camera::usual(Noise::new(2 * seed + 1)), kind, setup, wrong, seed)
}

/// Drives with `kind` under `camera`.
pub fn drive_under(
    mut camera: Camera,
    kind: EstimatorKind,
    setup: EstimatorSetup,
    wrong: Wrong,
    seed: u64,
) -> Driven {
    let mut robot = Robot::new(&setup, wrong, Noise::new(2 * seed));
    let mut estimator = PoseEstimator::new(kind, setup);
    let mut pulses = Pulses::default();
    let (mut acting, mut coming) = (BodyTwist::ZERO, BodyTwist::ZERO);
    let mut pose = setup.start;
    let mut k = 1;
    let mut jumps = 0.0;
    let mut driven = Driven {
        ticks: 0,
        arrived: false,
        cross_track_mean_m: 0.0,
        cross_track_max_m: 0.0,
        estimate_rms_m: 0.0,
        jump_rms_m: 0.0,
        steps: [0; 2],
    };
    while driven.ticks < TICKS_MAX {
        if driven.ticks.is_multiple_of(5) {
            // [MH18] (8)
            while k < CORNERS_M.len() && pose.position().distance_m(corner(k)) <= ACCEPTANCE_M {
                k += 1;
            }
            if k == CORNERS_M.len() {
                driven.arrived = true;
                break;
            }
            // A command acts a control period after its pose.
            acting = coming;
            coming = command(&setup, pose, Segment::line(corner(k - 1), corner(k)));
        }
        let segment = Segment::line(corner(k - 1), corner(k));
        driven.ticks += 1;
        robot.turn(pulses.tick(&setup, setup.chassis.wheel_speeds(acting)));
        let fix = camera.watch(driven.ticks, robot.pose);
        let inputs = EstimatorInputs { counts: &robot.counts, fixes: fix.as_slice() };
        let settled = driven.ticks >= SETTLED;
        let without = (fix.is_some() && settled).then(|| {
            estimator.clone().step(driven.ticks, EstimatorInputs { counts: &robot.counts, fixes: &[] }).pose()
        });
        pose = estimator.step(driven.ticks, inputs).pose();
        let off = segment.cross_track_m(robot.pose.position()).abs();
        driven.cross_track_mean_m += off;
        driven.cross_track_max_m = driven.cross_track_max_m.max(off);
        if let Some(without) = without {
            let jump = pose.position().distance_m(without.position());
            driven.jump_rms_m += jump * jump;
            jumps += 1.0;
        }
        if settled {
            let error = pose.position().distance_m(robot.pose.position());
            driven.estimate_rms_m += error * error;
        }
    }
    driven.cross_track_mean_m /= driven.ticks as f64;
    driven.estimate_rms_m = libm::sqrt(driven.estimate_rms_m / (driven.ticks - SETTLED + 1) as f64);
    driven.jump_rms_m = libm::sqrt(driven.jump_rms_m / f64::max(jumps, 1.0));
    driven.steps = [robot.counts[0], robot.counts[1]];
    driven
}
