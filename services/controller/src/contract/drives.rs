//! Whole drives of a perfect robot: every law arrives.

use super::*;
use core::f64::consts::FRAC_PI_2;
use hilare_interfaces::acceptance::Acceptance;
use hilare_interfaces::block::TICK_S;
use hilare_interfaces::geometry::WorldPoint;

/// A robot that does what it is told, within its limits, the selector's rule included.
pub(super) struct Robot {
    chassis: Chassis,
    rule: Acceptance,
    path: Vec<Waypoint>,
    path_id: u64,
    index: usize,
    was_inside: bool,
    pub(super) pose: WorldPose,
    /// The commands of this period and the next, as the step generator lets them through.
    acting: BodyTwist,
    next: BodyTwist,
    pub(super) periods: u64,
    /// Distances to the segment under way, one a period, m.
    off: Vec<f64>,
}

impl Robot {
    /// On the first waypoint, heading along world x.
    pub(super) fn new(case: &Case, path: &[Waypoint]) -> Self {
        Self {
            chassis: case.chassis,
            rule: case.spec.acceptance,
            path: path.to_vec(),
            path_id: 1,
            index: 1,
            was_inside: false,
            pose: WorldPose::new(path[0].x_m, path[0].y_m, 0.0),
            acting: BodyTwist::ZERO,
            next: BodyTwist::ZERO,
            periods: 0,
            off: vec![],
        }
    }

    /// `[MH18] (8)` and the rules beside it.
    fn accepts(&mut self, robot: WorldPoint) -> bool {
        let segment = self.path[self.index].segment_from(self.path[self.index - 1]);
        let inside = robot.distance_m(segment.to) <= ACCEPTANCE_M;
        let left = self.was_inside && !inside;
        self.was_inside = inside;
        let passed = self.rule == Acceptance::Passed && segment.nearest(robot).along >= 1.0;
        let Some(next) = self.path.get(self.index + 1).filter(|_| self.rule != Acceptance::Rim) else {
            return inside || passed;
        };
        let next = next.segment_from(self.path[self.index]);
        let nearer = next.cross_track_m(robot).abs() <= segment.cross_track_m(robot).abs();
        left || passed || (inside && nearer)
    }

    /// Follows another path from here on.
    pub(super) fn follow(&mut self, path: &[Waypoint]) {
        self.path = path.to_vec();
        self.index = 1;
        self.was_inside = false;
        self.path_id += 1;
    }

    /// What a controller sees in this control period, or `None` once it has arrived.
    pub(super) fn look(&mut self) -> Option<(Reference, Pose)> {
        if self.accepts(self.pose.position()) {
            self.index += 1;
            self.was_inside = false;
        }
        if self.index >= self.path.len() {
            return None;
        }
        let mut reference = reference(&self.path[self.index - 1..]);
        (reference.path_id, reference.index) = (self.path_id, self.index as u64);
        self.off.push(reference.segment().cross_track_m(self.pose.position()).abs());
        Some((reference, Pose::at(self.periods * PERIOD, self.pose)))
    }

    /// Carries a command out, from the next period on.
    pub(super) fn act(&mut self, command: BodyTwist) {
        self.acting = self.next;
        self.next = LIMITS.carried_out(&self.chassis, command);
        self.pose = moved(self.pose, self.acting, PERIOD as f64 * TICK_S);
        self.periods += 1;
    }

    /// One control period; the command given in it, or `None` once it has arrived.
    pub(super) fn period(&mut self, controller: &mut Controller) -> Option<BodyTwist> {
        let (reference, pose) = self.look()?;
        let inputs = ControllerInputs { reference: &reference, pose: &pose };
        let command = controller.step(pose.tick, inputs).twist().expect("finite");
        self.act(command);
        Some(command)
    }
}

/// Drives to the end, or as long as the way takes at half the reference speed. Mean distance, m.
fn drive(case: Case, path: &[Waypoint]) -> Option<f64> {
    let way = path.windows(2).map(|pair| pair[1].segment_from(pair[0]).length_m()).sum::<f64>();
    let most = (2.0 * way / SPEED / (PERIOD as f64 * TICK_S)) as u64;
    let mut robot = Robot::new(&case, path);
    let mut controller = case.controller(1);
    while robot.periods < most {
        if robot.period(&mut controller).is_none() {
            return Some(robot.off.iter().sum::<f64>() / robot.off.len() as f64);
        }
    }
    None
}

/// Where `twist` leads in `time_s`, its linear part turned to the middle of the turn.
fn moved(pose: WorldPose, twist: BodyTwist, time_s: f64) -> WorldPose {
    let turn = twist.omega_radps * time_s;
    let way = twist.scaled(time_s).turned(pose.theta_rad + turn / 2.0);
    WorldPose::new(pose.x_m + way.vx_mps, pose.y_m + way.vy_mps, pose.theta_rad + turn)
}

fn straight(points: &[(f64, f64)]) -> Vec<Waypoint> {
    points.iter().map(|(x_m, y_m)| Waypoint::straight(*x_m, *y_m)).collect()
}

/// The paths of paper 1, table 2 and figure 11.
pub(super) fn paths() -> [(&'static str, Vec<Waypoint>); 3] {
    let trapezoid = straight(&[(0.2, 0.2), (0.8, 0.2), (0.6, 0.5), (0.4, 0.5), (0.2, 0.2)]);
    let rectangle = straight(&[(0.0, 0.0), (0.4, 0.0), (0.4, 0.3), (0.0, 0.3), (0.0, 0.0)]);
    let so = include_str!("../../../../launch/scenarios/so.csv").lines().skip(1);
    let so = so.filter_map(|line| {
        let (x, y) = line.split_once(',')?;
        Some(Waypoint::straight(x.trim().parse().ok()?, y.trim().parse().ok()?))
    });
    [("trapezoid", trapezoid), ("rectangle", rectangle), ("so", so.collect())]
}

#[test]
fn every_law_arrives() {
    for (name, path) in paths() {
        assert!(path.len() >= 5, "{name}: {}", path.len());
        for case in every_case() {
            let law = case.name();
            let mean = drive(case, &path);
            assert!(mean.is_some_and(|mean| mean < ACCEPTANCE_M), "{law}, {name}: {mean:?}");
        }
    }
}

#[test]
fn every_law_drives_round_a_stadium() {
    // Lines of 0.3 m and half circles of R = 0.15 m, both turning senses.
    let stadium = |side: f64| {
        let bend = |x_m, y_m| Waypoint { bulge: side, ..Waypoint::straight(x_m, y_m) };
        let (to, back) = (Waypoint::straight(0.3, 0.0), Waypoint::straight(0.0, side * 0.3));
        [Waypoint::ZERO, to, bend(0.3, side * 0.3), back, bend(0.0, 0.0), to]
    };
    for side in [1.0, -1.0] {
        for case in every_case() {
            let law = case.name();
            let mean = drive(case, &stadium(side));
            assert!(mean.is_some_and(|mean| mean < 0.002), "{law}, {side}: {mean:?}");
        }
    }
}

#[test]
fn crab_angles_lead_round_a_square_without_turning() {
    let crabbed =
        |x_m, y_m, quarters: f64| Waypoint { crab_rad: quarters * FRAC_PI_2, ..Waypoint::straight(x_m, y_m) };
    let square = [
        Waypoint::ZERO,
        crabbed(0.3, 0.0, 0.0),
        crabbed(0.3, 0.3, 1.0),
        crabbed(0.0, 0.3, 2.0),
        crabbed(0.0, 0.0, -1.0),
    ];
    for case in every_case().filter(|case| case.chassis.is_omnidirectional()) {
        let law = case.name();
        let mut robot = Robot::new(&case, &square);
        let mut controller = case.controller(1);
        let mut turned: f64 = 0.0;
        while robot.period(&mut controller).is_some() {
            turned = turned.max(robot.pose.theta_rad.abs());
            assert!(robot.periods < 10_000, "{law} at {:?}", robot.pose);
        }
        assert!(turned < 0.1, "{law}: {turned} rad");
    }
}
