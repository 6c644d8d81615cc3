//! Whatever bits the steps are, the simulated robot stays somewhere.
#![allow(clippy::disallowed_methods, reason = "a test has an environment")]

use hilare_interfaces::block::Block;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::hostile::{cases, integer, message, some};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::Steps;
use hilare_interfaces::state::{STATE_WORDS, Stateful};
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

#[test]
fn in_mid_drive_a_copy_goes_on_to_the_same_bits() {
    for (n, mut plant) in plants().into_iter().enumerate() {
        let steps = |tick: u64| Steps {
            tick,
            counts: [tick as i64 / 3, tick as i64 / 4, 0, 0],
            wheel_speed_radps: [1.0 + (tick % 7) as f64, 1.5, 0.5, -0.25 * (tick % 5) as f64],
            ..Steps::ZERO
        };
        for tick in 0..400 {
            plant.step(tick, &steps(tick));
        }
        let mut room = [0; STATE_WORDS];
        let used = plant.save_state(&mut room).expect("room");
        let mut copy = plants().into_iter().nth(n).expect("a plant");
        assert!(copy.load_state(&room[..used]));
        for tick in 400..900 {
            let (one, other) = (plant.step(tick, &steps(tick)), copy.step(tick, &steps(tick)));
            assert_eq!(format!("{one:?}"), format!("{other:?}"));
        }
        // Another robot's, cut off, or with more pictures than there are words.
        assert!(!copy.load_state(&room[..used - 1]));
        let mut other = plants().into_iter().nth((n + 1) % 3).expect("a plant");
        assert!(!other.load_state(&room[..used]));
        let pictures = (0..used).filter(|at| {
            let mut words = room;
            words[*at] = 4000;
            !plants().into_iter().nth(n).expect("a plant").load_state(&words[..used])
        });
        assert_eq!(pictures.count(), 1);
    }
}
