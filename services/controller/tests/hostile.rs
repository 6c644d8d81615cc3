//! Whatever bits come over its wires, a controller answers: with a command that can be carried out, or with
//! one that is marked as none. What it was told before does not make it answer worse afterwards.
#![allow(clippy::disallowed_methods, reason = "a test has an environment")]

use hilare_controller::prediction::{Prediction, PredictionParams};
use hilare_controller::{
    Controller, ControllerInputs, Identity, LAWS, LawInputs, LawSetup, LawSpec, TwistLimits,
};
use hilare_interfaces::block::Block;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::{BodyTwist, WorldPose};
use hilare_interfaces::hostile::{cases, integer, message, number, some};
use hilare_interfaces::messages::{Command, Fallback, PREVIEW, Pose, Reference, ReferenceState, Waypoint};
use proptest::prelude::*;

/// Control period, ticks.
const PERIOD: u64 = 5;

/// Every law on every chassis it drives.
fn cases_of_laws() -> Vec<(&'static LawSpec, Chassis)> {
    let chassis =
        [Chassis::Differential(DifferentialParams::default()), Chassis::Mecanum(MecanumParams::default())];
    let drives = |law: &LawSpec, chassis: &Chassis| law.chassis.contains(&chassis.name());
    LAWS.iter()
        .flat_map(|law| chassis.map(|chassis| (law, chassis)))
        .filter(|(law, chassis)| drives(law, chassis))
        .collect()
}

fn with_setup<T>(law: &LawSpec, chassis: &Chassis, make: impl FnOnce(&LawSetup<'_>) -> T) -> T {
    make(&LawSetup {
        chassis,
        limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 0.3, omega_max_radps: 1.5 },
        acceptance_radius_m: 0.05,
        acceptance: law.acceptance,
        period_ticks: PERIOD,
        values: &[],
    })
}

fn controller(law: &LawSpec, chassis: &Chassis) -> Controller {
    let built = with_setup(law, chassis, law.build).expect("defaults build");
    let params = PredictionParams { drive_lag_s: 0.05, ..PredictionParams::default() };
    let prediction = with_setup(law, chassis, |setup| Prediction::new(params, setup));
    Controller::new(built, Identity { source: 1, epoch: 1 }, PERIOD, prediction)
}

/// Under way on a path of lines and arcs.
fn reference() -> impl Strategy<Value = Reference> {
    let points = proptest::collection::vec((-2.0..2.0f64, -2.0..2.0f64, -1.5..1.5f64), 8);
    (points, 0u64..7, 0.0..0.3f64, any::<bool>()).prop_map(|(points, preview_len, speed_mps, straight)| {
        let waypoint = |n: usize| {
            let (x_m, y_m, bulge) = points[n % points.len()];
            Waypoint { x_m, y_m, bulge: if straight { 0.0 } else { bulge }, crab_rad: 0.0 }
        };
        Reference {
            state: ReferenceState::Tracking.code(),
            path_id: 1,
            index: 1,
            total: preview_len + 2,
            speed_mps,
            last: waypoint(0),
            current: waypoint(1),
            preview_len,
            preview: core::array::from_fn::<_, PREVIEW, _>(|n| waypoint(n + 2)),
            tick: 0,
        }
    })
}

fn pose() -> impl Strategy<Value = Pose> {
    (-2.0..2.0f64, -2.0..2.0f64, -9.0..9.0f64)
        .prop_map(|(x, y, theta)| Pose::at(0, WorldPose::new(x, y, theta)))
}

fn twist() -> impl Strategy<Value = BodyTwist> {
    (number(), number(), number()).prop_map(|(vx, vy, omega)| BodyTwist::new(vx, vy, omega))
}

/// It can be carried out, or says that it cannot.
fn judge(command: &Command, what: &str) -> Result<(), TestCaseError> {
    let fallback = Fallback::from_code(command.fallback);
    prop_assert!(fallback.is_some(), "{what}: {command:?}");
    match command.twist() {
        Some(_) => prop_assert!(fallback != Some(Fallback::NoSense), "{what}: {command:?}"),
        None => prop_assert_eq!(fallback, Some(Fallback::NoSense), "{}: {:?}", what, command),
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(150))]

    #[test]
    fn any_bits_end_in_a_command_or_in_none_that_says_so(
        told in some((integer(), message(reference()), message(pose())), 12),
        later in some((reference(), pose()), 4),
    ) {
        for (law, chassis) in cases_of_laws() {
            let what = format!("{} on {}", law.name, chassis.name());
            let mut controller = controller(law, &chassis);
            for (tick, reference, pose) in &told {
                let command = controller.step(*tick, ControllerInputs { reference, pose });
                judge(&command, &what)?;
                let under_way = reference.state == ReferenceState::Tracking.code();
                let sense = reference.makes_sense() && pose.makes_sense();
                if under_way && !sense {
                    prop_assert!(command.twist().is_none(), "{}: {:?}", what, command);
                }
            }
            // No trace is left: what makes sense is answered.
            for (reference, pose) in &later {
                let command = controller.step(1000, ControllerInputs { reference, pose });
                judge(&command, &what)?;
                prop_assert!(command.twist().is_some(), "{}: {:?}", what, command);
            }
        }
    }

    /// The laws themselves, at the edge of what makes sense.
    #[test]
    fn nothing_that_makes_sense_makes_a_law_panic(
        told in some((message(reference()), message(pose()), twist()), 8),
    ) {
        for (law, chassis) in cases_of_laws() {
            let mut built = with_setup(law, &chassis, law.build).expect("defaults build");
            for (reference, pose, acting) in &told {
                if reference.makes_sense() && pose.makes_sense() && acting.is_finite() {
                    built.step(LawInputs { pose: pose.pose(), reference, acting: *acting });
                }
            }
        }
    }
}
