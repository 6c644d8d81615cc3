//! Whatever bits come over its wires, an estimator answers with a pose that is a number, and finds the robot
//! again when the messages make sense again.
#![allow(clippy::disallowed_methods, reason = "a test has an environment")]

use hilare_interfaces::block::Block;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams, PerWheel};
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::hostile::{cases, integer, message, some};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Pose, PoseFix};
use hilare_pose_estimator::ekf::params::EkfParams;
use hilare_pose_estimator::{EstimatorInputs, EstimatorKind, EstimatorSetup, PoseEstimator};
use proptest::prelude::*;

/// Where the robot is assumed to start.
const START: WorldPose = WorldPose::new(0.2, -0.1, 0.5);

fn estimator(kind: EstimatorKind, chassis: Chassis) -> PoseEstimator {
    // A short history, so that its end is reached.
    let ekf = EkfParams { history_ticks: 8, ..EkfParams::default() };
    let setup = EstimatorSetup { chassis, count_rad: 0.0065, start: START, ekf };
    PoseEstimator::new(kind, setup)
}

/// Ticks that mostly go on, and sometimes go anywhere.
fn tick() -> impl Strategy<Value = (bool, u64)> {
    prop_oneof![4 => (0u64..4).prop_map(|more| (true, more)), 1 => integer().prop_map(|tick| (false, tick))]
}

fn counts() -> impl Strategy<Value = PerWheel<i64>> {
    let any = [integer(), integer(), integer(), integer()].prop_map(|counts| counts.map(u64::cast_signed));
    prop_oneof![3 => proptest::array::uniform4(-40i64..40), 1 => any]
}

fn fix() -> impl Strategy<Value = PoseFix> {
    message((-1.0..1.0f64, -1.0..1.0f64, -3.0..3.0f64, 0u64..40).prop_map(|(x_m, y_m, theta_rad, tick)| {
        PoseFix { x_m, y_m, theta_rad, tick, captured_tick: tick.saturating_sub(3) }
    }))
}

fn chassis() -> [Chassis; 2] {
    [Chassis::Differential(DifferentialParams::default()), Chassis::Mecanum(MecanumParams::default())]
}

fn is_a_number(pose: &Pose) -> bool {
    pose.x_m.is_finite() && pose.y_m.is_finite() && pose.theta_rad.is_finite()
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn any_bits_end_in_a_pose_that_is_a_number(
        told in some((tick(), counts(), proptest::collection::vec(fix(), 0..3)), 40),
    ) {
        for kind in EstimatorKind::ALL {
            for chassis in chassis() {
                let mut estimator = estimator(kind, chassis);
                let mut now = 0u64;
                let mut last = Pose::at(0, START);
                for ((goes_on, tick), counts, fixes) in &told {
                    now = if *goes_on { now.saturating_add(*tick) } else { *tick };
                    let pose = estimator.step(now, EstimatorInputs { counts, fixes });
                    prop_assert!(is_a_number(&pose), "{} on {}: {:?}", kind.name(), chassis.name(), pose);
                    prop_assert!(pose.measured_tick <= pose.tick, "{:?}", pose);
                    // A clock that cannot be is answered by the last pose again.
                    prop_assert!(pose.tick == now || pose == last, "{:?} at {}", pose, now);
                    last = pose;
                }
            }
        }
    }

    /// Counts that no wheel can make, and fixes that lie, are got over: by whoever has a camera.
    #[test]
    fn who_sees_the_robot_finds_it_again(
        told in some((counts(), proptest::collection::vec(fix(), 0..3)), 20),
        place in (-5.0..5.0f64, -5.0..5.0f64, -3.0..3.0f64),
    ) {
        for kind in [EstimatorKind::Camera, EstimatorKind::Ekf] {
            for chassis in chassis() {
                let mut estimator = estimator(kind, chassis);
                for (n, (counts, fixes)) in told.iter().enumerate() {
                    // Pictures of times to come would be believed then; there are none of those.
                    let fixes: Vec<PoseFix> =
                        fixes.iter().map(|fix| PoseFix { captured_tick: n as u64, tick: n as u64, ..*fix }).collect();
                    estimator.step(n as u64, EstimatorInputs { counts, fixes: &fixes });
                }
                let (x_m, y_m, theta_rad) = place;
                let mut pose = Pose::ZERO;
                for tick in 100..200 {
                    let fix = PoseFix { tick, captured_tick: tick, x_m, y_m, theta_rad };
                    pose = estimator.step(tick, EstimatorInputs { counts: &[0; 4], fixes: &[fix] });
                }
                let off = libm::hypot(pose.x_m - x_m, pose.y_m - y_m);
                prop_assert!(off < 0.01, "{} on {}: {:?}, {:?}", kind.name(), chassis.name(), pose, place);
            }
        }
    }
}
