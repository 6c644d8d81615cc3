//! Where the world is, which way it lies, and whether it is seen in a mirror makes no difference; nor
//! does a crab angle.

use super::*;
use core::f64::consts::{FRAC_PI_2, PI};
use proptest::prelude::*;

/// The plane turned by `turn`, then moved by (`x`, `y`).
#[derive(Clone, Copy, Debug)]
struct Motion {
    turn: f64,
    x: f64,
    y: f64,
}

impl Motion {
    fn point(self, x: f64, y: f64) -> (f64, f64) {
        let (sin, cos) = libm::sincos(self.turn);
        (self.x + cos * x - sin * y, self.y + sin * x + cos * y)
    }

    fn pose(self, pose: WorldPose) -> WorldPose {
        let (x, y) = self.point(pose.x_m, pose.y_m);
        WorldPose::new(x, y, pose.theta_rad + self.turn)
    }

    fn waypoint(self, waypoint: Waypoint) -> Waypoint {
        let (x_m, y_m) = self.point(waypoint.x_m, waypoint.y_m);
        Waypoint { x_m, y_m, ..waypoint }
    }
}

fn mirrored(waypoint: &Waypoint) -> Waypoint {
    Waypoint { y_m: -waypoint.y_m, bulge: -waypoint.bulge, ..*waypoint }
}

/// A robot near the first segment of a path of lines and arcs that keeps going on.
fn scenes() -> impl Strategy<Value = (WorldPose, Vec<Waypoint>)> {
    let waypoint = (0.1..0.4f64, -0.3..0.3f64, proptest::sample::select(vec![0.0, 0.0, 0.3, -0.7, 1.2]));
    let pose = (-0.3..0.5f64, -0.2..0.2f64, -1.5..1.5f64);
    (pose, proptest::collection::vec(waypoint, 1..4)).prop_map(|((x, y, theta), ways)| {
        let mut path = vec![Waypoint::straight(0.0, 0.0)];
        for (dx, dy, bulge) in ways {
            let last = path[path.len() - 1];
            path.push(Waypoint { x_m: last.x_m + dx, y_m: last.y_m + dy, bulge, crab_rad: 0.0 });
        }
        (WorldPose::new(x, y, theta), path)
    })
}

fn with_fast_wheels(chassis: Chassis) -> Chassis {
    match chassis {
        Chassis::Mecanum(robot) => Chassis::Mecanum(MecanumParams { wheel_speed_max_radps: 20.0, ..robot }),
        other => other,
    }
}

fn alike(a: BodyTwist, b: BodyTwist) -> bool {
    (a.vx_mps - b.vx_mps).abs() < ALIKE
        && (a.vy_mps - b.vy_mps).abs() < ALIKE
        && (a.omega_radps - b.omega_radps).abs() < ALIKE * a.omega_radps.abs().max(1.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn a_mirrored_world_gives_mirrored_commands((pose, waypoints) in scenes()) {
        for mut case in every_case() {
            let a = case.answer(pose, &reference(&waypoints));
            let mirror = waypoints.iter().map(mirrored).collect::<Vec<_>>();
            let b = case.answer(WorldPose::new(pose.x_m, -pose.y_m, -pose.theta_rad), &reference(&mirror));
            let b = BodyTwist::new(b.vx_mps, -b.vy_mps, -b.omega_radps);
            prop_assert!(alike(a, b), "{}: {:?} {:?}", case.name(), a, b);
        }
    }

    #[test]
    fn a_turned_and_moved_world_gives_the_same_commands(
        (pose, waypoints) in scenes(), turn in -3.0..3.0f64, x in -20.0..20.0f64, y in -20.0..20.0f64,
    ) {
        let motion = Motion { turn, x, y };
        for mut case in every_case() {
            let a = case.answer(pose, &reference(&waypoints));
            let there = waypoints.iter().map(|waypoint| motion.waypoint(*waypoint)).collect::<Vec<_>>();
            let b = case.answer(motion.pose(pose), &reference(&there));
            prop_assert!(alike(a, b), "{}: {:?} {:?}", case.name(), a, b);
        }
    }

    #[test]
    fn a_whole_turn_of_the_heading_changes_nothing((pose, waypoints) in scenes(), turns in -3..4i32) {
        let wound = WorldPose::new(pose.x_m, pose.y_m, pose.theta_rad + 2.0 * PI * f64::from(turns));
        for mut case in every_case() {
            let reference = reference(&waypoints);
            let (a, b) = (case.answer(pose, &reference), case.answer(wound, &reference));
            prop_assert!(alike(a, b), "{}: {:?} {:?}", case.name(), a, b);
        }
    }

    #[test]
    fn with_a_crab_angle_the_robot_moves_in_the_world_as_without(
        (pose, waypoints) in scenes(), crab_rad in -PI..PI,
    ) {
        let omnidirectional = |case: &Case| case.chassis.is_omnidirectional();
        for case in every_case().filter(omnidirectional) {
            // The wheels' limits are of the body: a law that plans with them may well drive otherwise where
            // they bind, so here they do not.
            let chassis = with_fast_wheels(case.chassis);
            let case = Case::new(case.spec, chassis);
            let name = case.name();
            let crabbed = waypoints.iter().map(|w| Waypoint { crab_rad, ..*w }).collect::<Vec<_>>();
            let again = Case::new(case.spec, chassis);
            let command = |case: Case, pose, path: &[Waypoint]| {
                let pose = Pose::at(0, pose);
                let twist = case.controller(1).step(0, ControllerInputs { reference: &reference(path), pose: &pose }).twist();
                twist.expect("finite").turned(pose.theta_rad)
            };
            // The crabbed robot points away from where the other one heads, by the crab angle.
            let a = command(case, pose, &waypoints);
            let b = command(again, WorldPose::new(pose.x_m, pose.y_m, pose.theta_rad - crab_rad), &crabbed);
            prop_assert!(alike(a, b), "{}: {:?} {:?}", name, a, b);
        }
    }
}

#[test]
fn a_quarter_crab_angle_drives_sideways() {
    let path = [0.0, 1.0, 2.0].map(|x_m| Waypoint { x_m, crab_rad: FRAC_PI_2, ..Waypoint::ZERO });
    for case in every_case().filter(|case| case.chassis.is_omnidirectional()) {
        let name = case.name();
        // On the line along world x, heading along world −y: to the left is world x.
        let pose = Pose::at(0, WorldPose::new(0.5, 0.0, -FRAC_PI_2));
        let mut controller = case.controller(1);
        controller.acting = BodyTwist::new(0.0, SPEED, 0.0);
        let command = controller.step(0, ControllerInputs { reference: &reference(&path), pose: &pose });
        assert!((command.vy_mps - SPEED).abs() < ALIKE, "{name}: {command:?}");
        assert!(command.vx_mps.abs() < ALIKE && command.omega_radps.abs() < ALIKE, "{name}: {command:?}");
    }
}
