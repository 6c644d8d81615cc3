//! The standard messages, field by field as their definitions have them.

use crate::recording::cdr::Writer;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::{Steps, Waypoint};
use hilare_planner::map::Grid;

/// The world; the robot's odometry, which begins there; the robot.
const MAP: &str = "map";
const ODOM: &str = "odom";
const BASE: &str = "base_link";
/// Names of the wheels, in the order of the chassis.
const TWO_WHEELS: [&str; 2] = ["right_wheel", "left_wheel"];
const FOUR_WHEELS: [&str; 4] =
    ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"];
/// An arc is told in pieces that turn by so much at most, rad.
const PIECE_RAD: f64 = 0.1;
const MAX_PIECES: f64 = 64.0;
/// A disc is told as a polygon.
const DISC_CORNERS: u32 = 24;

/// A time as ROS has it.
#[derive(Clone, Copy, Debug)]
pub struct Stamp {
    sec: i32,
    nanosec: u32,
}

impl Stamp {
    /// Of nanoseconds since 1970.
    pub fn of(time_ns: u64) -> Self {
        const NS: u64 = 1_000_000_000;
        Self { sec: i32::try_from(time_ns / NS).unwrap_or(i32::MAX), nanosec: (time_ns % NS) as u32 }
    }

    fn write(self, to: &mut Writer<'_>) {
        to.i32(self.sec);
        to.u32(self.nanosec);
    }
}

pub fn header(to: &mut Writer<'_>, stamp: Stamp, frame: &str) {
    stamp.write(to);
    to.string(frame);
}

fn vector(to: &mut Writer<'_>, vector: [f64; 3]) {
    vector.into_iter().for_each(|value| to.f64(value));
}

fn orientation(to: &mut Writer<'_>, heading_rad: f64) {
    vector(to, [0.0, 0.0, (heading_rad / 2.0).sin()]);
    to.f64((heading_rad / 2.0).cos());
}

fn pose(to: &mut Writer<'_>, pose: WorldPose) {
    vector(to, [pose.x_m, pose.y_m, 0.0]);
    orientation(to, pose.theta_rad);
}

/// Forward, sideways and yaw.
fn twist(to: &mut Writer<'_>, [vx, vy, omega]: [f64; 3]) {
    vector(to, [vx, vy, 0.0]);
    vector(to, [0.0, 0.0, omega]);
}

/// nav_msgs/Odometry.
pub fn odometry(cdr: &mut Vec<u8>, stamp: Stamp, at: WorldPose, moving: [f64; 3]) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, ODOM);
    to.string(BASE);
    pose(to, at);
    // How far it may be wrong is not known: zeros, as ROS has it.
    (0..36).for_each(|_| to.f64(0.0));
    twist(to, moving);
    (0..36).for_each(|_| to.f64(0.0));
}

/// std_msgs/Float64.
pub fn float64(cdr: &mut Vec<u8>, value: f64) {
    Writer::new(cdr).f64(value);
}

/// tf2_msgs/TFMessage.
pub fn transforms(cdr: &mut Vec<u8>, stamp: Stamp, at: WorldPose) {
    let to = &mut Writer::new(cdr);
    to.u32(2);
    for (parent, child, at) in [(MAP, ODOM, WorldPose::default()), (ODOM, BASE, at)] {
        header(to, stamp, parent);
        to.string(child);
        pose(to, at);
    }
}

/// geometry_msgs/PoseStamped.
pub fn pose_stamped(cdr: &mut Vec<u8>, stamp: Stamp, at: WorldPose) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, MAP);
    pose(to, at);
}

/// geometry_msgs/TwistStamped.
pub fn twist_stamped(cdr: &mut Vec<u8>, stamp: Stamp, moving: [f64; 3]) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, BASE);
    twist(to, moving);
}

/// sensor_msgs/JointState: where the wheels are told to be, and how fast.
pub fn joint_states(cdr: &mut Vec<u8>, stamp: Stamp, steps: &Steps, wheels: usize, count_rad: f64) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, BASE);
    let names = if wheels <= 2 { &TWO_WHEELS[..wheels] } else { &FOUR_WHEELS[..] };
    let count = names.len() as u32;
    to.u32(count);
    names.iter().for_each(|name| to.string(name));
    to.u32(count);
    steps.counts[..names.len()].iter().for_each(|counted| to.f64(*counted as f64 * count_rad));
    to.u32(count);
    steps.wheel_speed_radps[..names.len()].iter().for_each(|speed| to.f64(*speed));
    to.u32(0);
}

/// Where a waypoint is, and how the robot stands there.
pub fn waypoint_pose(last: Waypoint, waypoint: Waypoint) -> WorldPose {
    let heading_rad = waypoint.segment_from(last).heading_rad() - waypoint.crab_rad;
    WorldPose::new(waypoint.x_m, waypoint.y_m, heading_rad)
}

/// nav_msgs/Path.
pub fn path(cdr: &mut Vec<u8>, stamp: Stamp, waypoints: &[Waypoint]) {
    let mut poses: Vec<WorldPose> = Vec::with_capacity(waypoints.len());
    for (index, waypoint) in waypoints.iter().enumerate() {
        let last = if index == 0 { *waypoint } else { waypoints[index - 1] };
        let segment = waypoint.segment_from(last);
        let pieces = (segment.sweep_rad().abs() / PIECE_RAD).ceil().clamp(1.0, MAX_PIECES);
        for piece in 1..pieces as usize {
            let along = piece as f64 / pieces;
            let heading_rad = segment.start_heading_rad() + along * segment.sweep_rad() - waypoint.crab_rad;
            let point = segment.point_at(along);
            poses.push(WorldPose::new(point.x_m, point.y_m, heading_rad));
        }
        // The first is stood on, heading for the second.
        let next = waypoints.get(1).filter(|_| index == 0);
        poses.push(match next {
            Some(next) => {
                let heading_rad = next.segment_from(*waypoint).start_heading_rad() - next.crab_rad;
                WorldPose::new(waypoint.x_m, waypoint.y_m, heading_rad)
            }
            None => waypoint_pose(last, *waypoint),
        });
    }
    let to = &mut Writer::new(cdr);
    header(to, stamp, MAP);
    to.u32(poses.len() as u32);
    for at in poses {
        header(to, stamp, MAP);
        pose(to, at);
    }
}

/// nav_msgs/OccupancyGrid.
pub fn occupancy_grid(cdr: &mut Vec<u8>, stamp: Stamp, origin: WorldPose, grid: &Grid) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, MAP);
    stamp.write(to);
    to.f32(grid.resolution_m as f32);
    to.u32(grid.width as u32);
    to.u32(grid.height as u32);
    pose(to, origin);
    to.i8s(&grid.cells);
}

/// geometry_msgs/PolygonStamped: a disc around the robot.
pub fn disc(cdr: &mut Vec<u8>, stamp: Stamp, radius_m: f64) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, BASE);
    to.u32(DISC_CORNERS);
    for corner in 0..DISC_CORNERS {
        let angle_rad = f64::from(corner) / f64::from(DISC_CORNERS) * std::f64::consts::TAU;
        [angle_rad.cos(), angle_rad.sin(), 0.0].iter().for_each(|part| to.f32((radius_m * part) as f32));
    }
}
