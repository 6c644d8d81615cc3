//! Whatever bits the steps are, the simulated robot stays somewhere.
#![allow(clippy::disallowed_methods, reason = "a test has an environment")]

use hilare_interfaces::block::Block;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::hostile::{cases, integer, message, some};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::Steps;
use hilare_plant::camera::{Camera, CameraParams};
use hilare_plant::dc_servo::{self, DcServo, DcServoParams};
use hilare_plant::mecanum::{self, Mecanum, MecanumPlantParams};
use hilare_plant::stepper_drive::{self, StepperDrive, StepperDriveParams};
use hilare_plant::{Plant, Robot};
use proptest::prelude::*;

fn plants() -> [Plant; 3] {
    let start = WorldPose::new(0.2, 0.1, -0.4);
    let stepper = stepper_drive::Body { track_m: 0.054, step_length_m: 0.000_13 };
    let cart = dc_servo::Body { track_m: 0.4, wheel_diameter_m: 0.15, counts_per_turn: 4096 };
    let agv = mecanum::Body {
        half_wheelbase_m: 0.2,
        half_track_m: 0.15,
        wheel_radius_m: 0.05,
        counts_per_turn: 4096,
    };
    let camera = || Camera::new(CameraParams { period_ticks: 3, delay_ticks: 5, ..CameraParams::default() });
    let slipping = StepperDriveParams { slip_sd: 0.1, ..StepperDriveParams::default() };
    [
        Robot::StepperDrive(StepperDrive::new(stepper, slipping, start)),
        Robot::DcServo(DcServo::new(cart, DcServoParams::default(), start)),
        Robot::Mecanum(Mecanum::new(agv, MecanumPlantParams::default(), start)),
    ]
    .map(|robot| Plant::new(robot, Some(camera())))
}

fn steps() -> impl Strategy<Value = Steps> {
    let sensible = (0u64..50, -20i64..20, -5.0..5.0f64).prop_map(|(tick, count, radps)| Steps {
        tick,
        counts: [count; 4],
        wheel_speed_radps: [radps; 4],
        ..Steps::ZERO
    });
    prop_oneof![2 => sensible.clone(), 3 => message(sensible)]
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn any_bits_leave_the_robot_somewhere(told in some((integer(), any::<bool>(), steps()), 24)) {
        for mut plant in plants() {
            for (tick, of_its_own, steps) in &told {
                let tick = if *of_its_own { steps.tick } else { *tick };
                let observed = plant.step(tick, steps);
                let truth = observed.truth.pose();
                let somewhere = truth.position().is_finite() && truth.theta_rad.is_finite();
                prop_assert!(somewhere, "{:?} by {:?}", truth, steps);
                if let Some(fix) = observed.fix {
                    prop_assert!(fix.pose().position().is_finite() && fix.theta_rad.is_finite(), "{:?}", fix);
                    prop_assert!(fix.captured_tick <= fix.tick && fix.tick <= tick, "{:?} at {}", fix, tick);
                }
            }
        }
    }
}
