//! What every law of the registry must do, on every chassis it allows. A law that departs from a rule
//! says so in its [`LawSpec`].

mod answers;
mod drives;
mod restore;
mod symmetry;

use super::*;
use crate::prediction::PredictionParams;
use hilare_interfaces::chassis::{DifferentialParams, MecanumParams};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{PREVIEW, Waypoint};

/// The e-puck's, paper 1 table 1.
const LIMITS: TwistLimits = TwistLimits { v_min_mps: 0.0, v_max_mps: 0.041, omega_max_radps: 0.747 };
/// v_r of most references here, m/s.
const SPEED: f64 = 0.04;
/// d_T.
const ACCEPTANCE_M: f64 = 0.027;
/// Control period, ticks.
const PERIOD: u64 = 5;
/// What acts while a law thinks: v_r, straight on.
const ACTING: BodyTwist = BodyTwist::new(SPEED, 0.0, 0.0);
/// How alike answers must be that differ by rounding only, m/s and rad/s. A predictive law iterates
/// until its optimum is this well known, and no further.
const ALIKE: f64 = 1e-6;

/// A law on a chassis.
struct Case {
    spec: &'static LawSpec,
    chassis: Chassis,
    law: Box<dyn ControlLaw>,
    prediction: Prediction,
}

impl Case {
    fn new(spec: &'static LawSpec, chassis: Chassis) -> Self {
        Self::with(spec, chassis, &[], PredictionParams::default())
    }

    fn with(
        spec: &'static LawSpec,
        chassis: Chassis,
        values: &[(&'static str, f64)],
        prediction: PredictionParams,
    ) -> Self {
        let setup = LawSetup {
            chassis: &chassis,
            limits: LIMITS,
            acceptance_radius_m: ACCEPTANCE_M,
            acceptance: spec.acceptance,
            period_ticks: PERIOD,
            values,
        };
        let law = (spec.build)(&setup).expect("builds");
        let prediction = Prediction::new(prediction, &setup);
        Self { spec, chassis, law, prediction }
    }

    fn name(&self) -> String {
        format!("{} on {}", self.spec.name, self.chassis.name())
    }

    fn step(&mut self, pose: WorldPose, reference: &Reference, acting: BodyTwist) -> BodyTwist {
        self.law.step(LawInputs { pose, reference, acting }).twist
    }

    /// As it would be the first thing asked.
    fn answer(&mut self, pose: WorldPose, reference: &Reference) -> BodyTwist {
        self.law.reset();
        self.step(pose, reference, ACTING)
    }

    fn controller(self, source: u64) -> Controller {
        Controller::new(self.law, Identity { source, epoch: 1 }, PERIOD, self.prediction)
    }
}

/// Every chassis, as large as an e-puck.
fn every_chassis() -> [Chassis; 2] {
    let mecanum = MecanumParams {
        half_wheelbase_m: 0.0135,
        half_track_m: 0.0135,
        wheel_radius_m: 0.02,
        wheel_speed_max_radps: 3.25,
    };
    [Chassis::Differential(DifferentialParams::default()), Chassis::Mecanum(mecanum)]
}

/// Every law on every chassis it allows.
fn every_case() -> impl Iterator<Item = Case> {
    LAWS.iter().flat_map(|spec| {
        let allowed = every_chassis().into_iter().filter(|chassis| spec.chassis.contains(&chassis.name()));
        allowed.map(move |chassis| Case::new(spec, chassis))
    })
}

/// A reference to the second of `waypoints`, the rest in its preview.
fn reference(waypoints: &[Waypoint]) -> Reference {
    let coming = &waypoints[2..waypoints.len().min(2 + PREVIEW)];
    let mut reference = Reference {
        state: ReferenceState::Tracking.code(),
        path_id: 1,
        index: 1,
        total: waypoints.len() as u64,
        speed_mps: SPEED,
        last: waypoints[0],
        current: waypoints[1],
        preview_len: coming.len() as u64,
        ..Reference::ZERO
    };
    reference.preview[..coming.len()].copy_from_slice(coming);
    reference
}

/// A reference along straight lines.
fn lines(points: &[(f64, f64)]) -> Reference {
    let waypoints = points.iter().map(|(x_m, y_m)| Waypoint::straight(*x_m, *y_m)).collect::<Vec<_>>();
    reference(&waypoints)
}

#[test]
fn every_law_can_drive_something() {
    for spec in LAWS {
        assert!(every_case().any(|case| case.spec.name == spec.name), "{}: {:?}", spec.name, spec.chassis);
    }
}

#[test]
fn commands_are_stamped_and_stand_still_without_a_path() {
    let case = every_case().next().expect("a law");
    let mut controller = Controller::new(case.law, Identity { source: 2, epoch: 9 }, 5, case.prediction);
    let pose = Pose::at(20, WorldPose::new(0.0, 0.0, 0.0));
    let idle = controller.step(20, ControllerInputs { reference: &Reference::ZERO, pose: &pose });
    assert_eq!((idle.source, idle.epoch, idle.seq, idle.pose_tick, idle.effective_tick), (2, 9, 1, 20, 25));
    assert_eq!(idle.twist(), Some(BodyTwist::ZERO));
    let reference = lines(&[(0.0, 0.0), (1.0, 0.0)]);
    let moving = controller.step(25, ControllerInputs { reference: &reference, pose: &pose });
    assert!(moving.vx_mps > 0.03 && moving.seq == 2);
}
