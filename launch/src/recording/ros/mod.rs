//! Standard ROS 2 messages made of ours, for tools that know those: once a control period, in the frames of REP-105.
//!
//! ```text
//! map ──(they coincide: the estimate is in the world frame from the start)── odom ── base_link
//! ```
//!
//! | topic | type | of |
//! |---|---|---|
//! | `/odom` | nav_msgs/Odometry | estimated pose, commanded twist after the input constraints |
//! | `/tf` | tf2_msgs/TFMessage | map → odom → base_link |
//! | `/ground_truth` | geometry_msgs/PoseStamped | true pose of a simulated robot |
//! | `/cmd_vel` | geometry_msgs/TwistStamped | the same twist |
//! | `/joint_states` | sensor_msgs/JointState | the wheels: where they are told to be, and how fast |
//! | `/cross_track_error` | std_msgs/Float64 | distance of the estimated pose from the path, m, positive to the left of it |
//! | `/cross_track_error/truth` | std_msgs/Float64 | the same of the true pose |
//! | `/reference` | geometry_msgs/PoseStamped | current waypoint, when it changes and once a second |
//! | `/path` | nav_msgs/Path | the path, arcs in short pieces |
//! | `/map` | nav_msgs/OccupancyGrid | the planner's map, in at most 2048 × 2048 cells, once at the beginning |
//! | `/footprint` | geometry_msgs/PolygonStamped | the disc that the planner keeps clear, ten times a second |
//! | `/diagnostics` | diagnostic_msgs/DiagnosticArray | step generator and every process, once a second; states when they change |

mod definitions;
mod diagnostics;
mod messages;

use super::part::View;
use super::wires::Entry;
use crate::config::System;
use crate::look::wires::cross_track_m;
use hilare_interfaces::block::{TICKS_PER_SECOND, Tick};
use hilare_interfaces::geometry::{WorldPoint, WorldPose};
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages::{Health, Reference};
use hilare_planner::map::Grid;
use messages::{
    Stamp, disc, float64, joint_states, occupancy_grid, odometry, path, pose_stamped, transforms,
    twist_stamped, waypoint_pose,
};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Topic and type of each view.
const VIEWS: [(&str, &str); 12] = [
    ("/odom", "nav_msgs/Odometry"),
    ("/tf", "tf2_msgs/TFMessage"),
    ("/ground_truth", "geometry_msgs/PoseStamped"),
    ("/cmd_vel", "geometry_msgs/TwistStamped"),
    ("/joint_states", "sensor_msgs/JointState"),
    ("/reference", "geometry_msgs/PoseStamped"),
    ("/path", "nav_msgs/Path"),
    ("/diagnostics", "diagnostic_msgs/DiagnosticArray"),
    ("/cross_track_error", "std_msgs/Float64"),
    ("/cross_track_error/truth", "std_msgs/Float64"),
    ("/map", "nav_msgs/OccupancyGrid"),
    ("/footprint", "geometry_msgs/PolygonStamped"),
];

const ODOM: usize = 0;
const TF: usize = 1;
const GROUND_TRUTH: usize = 2;
const CMD_VEL: usize = 3;
const JOINT_STATES: usize = 4;
const REFERENCE: usize = 5;
const PATH: usize = 6;
const DIAGNOSTICS: usize = 7;
const CROSS_TRACK: usize = 8;
const CROSS_TRACK_TRUTH: usize = 9;
const MAP: usize = 10;
const FOOTPRINT: usize = 11;

/// Most cells a side of the map.
const MAP_SIDE: usize = 2048;
/// Ticks from one footprint to the next, at least.
const FOOTPRINT_TICKS: u64 = TICKS_PER_SECOND / 10;

/// Twists kept for poses that come later, and the other way round; beyond, the wire of the others is silent.
const MAX_WAITING: usize = 4096;
/// References kept for places that come later than they: as many as their wire holds.
const MAX_REFERENCES: usize = 256;

/// Channels of the views.
pub fn channels() -> Vec<View> {
    let view = |(topic, name): (&'static str, &'static str)| View {
        topic: topic.to_owned(),
        type_name: name.replace('/', "/msg/"),
        definition: definitions::definition(name),
    };
    VIEWS.into_iter().map(view).collect()
}

/// What the standard messages tell of a robot that its wires do not.
#[derive(Clone, Debug, Default)]
pub struct Body {
    /// Its wheels.
    pub wheels: usize,
    /// What a wheel turns by a count, rad.
    pub count_rad: f64,
    /// Of the disc that the planner keeps clear of obstacles, m.
    pub radius_m: f64,
    /// Where it drives, and the pose of its lower left corner, if it is known.
    pub map: Option<Arc<(WorldPose, Grid)>>,
}

impl Body {
    /// As a system file has it.
    pub fn of(system: &System) -> Self {
        // A map that cannot be loaded is the planner's complaint.
        let map = system.load_map().ok().flatten();
        Self {
            wheels: system.chassis.wheels(),
            count_rad: system.count_rad(),
            radius_m: system.planner.robot_radius_m,
            map: map.map(|map| {
                let (frame, grid) = (map.frame(), map.grid(MAP_SIDE));
                Arc::new((WorldPose::new(frame.origin().x_m, frame.origin().y_m, frame.yaw_rad()), grid))
            }),
        }
    }
}

/// Makes them, message by message.
pub struct Views {
    period_ticks: u64,
    body: Body,
    map_is_told: bool,
    footprint_told: Option<Tick>,
    /// Twists of control periods whose poses are to come, and poses whose twists are.
    twists: VecDeque<(Tick, [f64; 3])>,
    poses: VecDeque<(Tick, u64, WorldPose)>,
    /// Places whose distance from the path is to come: tick, time, view; and the references it goes by.
    places: VecDeque<(Tick, u64, usize, WorldPoint)>,
    references: VecDeque<Reference>,
    /// Path and place of the waypoint told last, and when.
    told: Option<(u64, u64, Tick)>,
    /// State of each process told last, and when.
    fared: BTreeMap<u64, (u64, u64)>,
    cdr: Vec<u8>,
}

impl Views {
    /// Views of a robot.
    pub fn new(period_ticks: u64, body: Body) -> Self {
        let period_ticks = period_ticks.max(1);
        Self {
            period_ticks,
            body,
            map_is_told: false,
            footprint_told: None,
            twists: VecDeque::new(),
            poses: VecDeque::new(),
            places: VecDeque::new(),
            references: VecDeque::new(),
            fared: BTreeMap::new(),
            told: None,
            cdr: Vec::new(),
        }
    }

    /// Whoever is told from now on has not been told the map.
    pub fn begin_again(&mut self) {
        self.map_is_told = false;
    }

    /// Every view of a message, with its time, as CDR to `write`.
    pub fn of(&mut self, entry: &Entry, time_ns: u64, mut write: impl FnMut(usize, u64, &[u8])) {
        let stamp = Stamp::of(time_ns);
        let mut cdr = std::mem::take(&mut self.cdr);
        let mut tell_at = |time_ns: u64, view: usize, make: &dyn Fn(&mut Vec<u8>)| {
            cdr.clear();
            make(&mut cdr);
            write(view, time_ns, &cdr);
        };
        let mut tell = |view: usize, make: &dyn Fn(&mut Vec<u8>)| tell_at(time_ns, view, make);
        let map = self.body.map.as_ref().filter(|_| !self.map_is_told);
        if let Some((origin, grid)) = map.map(Arc::as_ref) {
            tell(MAP, &|cdr| occupancy_grid(cdr, stamp, *origin, grid));
            self.map_is_told = true;
        }
        match entry {
            Entry::Steps(steps) if self.is_due(steps.tick) => {
                keep(&mut self.twists, (steps.tick, steps.twist));
                tell(CMD_VEL, &|cdr| twist_stamped(cdr, stamp, steps.twist));
                let Body { wheels, count_rad, .. } = self.body;
                tell(JOINT_STATES, &|cdr| joint_states(cdr, stamp, steps, wheels, count_rad));
                if steps.tick.is_multiple_of(TICKS_PER_SECOND) {
                    tell(DIAGNOSTICS, &|cdr| diagnostics::of_steps(cdr, stamp, steps));
                }
            }
            Entry::Pose(pose) if self.is_due(pose.tick) => {
                keep(&mut self.poses, (pose.tick, time_ns, pose.pose()));
                tell(TF, &|cdr| transforms(cdr, stamp, pose.pose()));
                if self.footprint_told.is_none_or(|told| pose.tick.abs_diff(told) >= FOOTPRINT_TICKS) {
                    self.footprint_told = Some(pose.tick);
                    let radius_m = self.body.radius_m;
                    tell(FOOTPRINT, &|cdr| disc(cdr, stamp, radius_m));
                }
                keep(&mut self.places, (pose.tick, time_ns, CROSS_TRACK, pose.pose().position()));
            }
            Entry::Truth(truth) if self.is_due(truth.tick) => {
                tell(GROUND_TRUTH, &|cdr| pose_stamped(cdr, stamp, truth.pose()));
                keep(&mut self.places, (truth.tick, time_ns, CROSS_TRACK_TRUTH, truth.pose().position()));
            }
            Entry::Reference(reference) => {
                if self.references.len() == MAX_REFERENCES {
                    self.references.pop_front();
                }
                self.references.push_back(*reference);
                if self.is_news(reference) {
                    let pose = waypoint_pose(reference.last, reference.current);
                    tell(REFERENCE, &|cdr| pose_stamped(cdr, stamp, pose));
                }
            }
            Entry::Path(_, waypoints) => tell(PATH, &|cdr| path(cdr, stamp, waypoints)),
            other => {
                let health = Health::from_bytes(other.heard().bytes());
                let health = health.filter(|_| other.wire().wire.message.name == Health::NAME);
                if let Some(health) = health.filter(|health| self.fares_otherwise(health, time_ns)) {
                    tell(DIAGNOSTICS, &|cdr| diagnostics::of_health(cdr, stamp, &health));
                }
            }
        }
        while let Some((time_ns, pose, twist)) = self.next_pair() {
            tell_at(time_ns, ODOM, &|cdr| odometry(cdr, Stamp::of(time_ns), pose, twist));
        }
        while let Some((time_ns, view, aside_m)) = self.next_aside() {
            tell_at(time_ns, view, &|cdr| float64(cdr, aside_m));
        }
        self.cdr = cdr;
    }

    /// The oldest place for which the reference is known that was in force when the robot came there: the newest that
    /// was chosen before. Known it is as soon as a later one has come.
    fn next_aside(&mut self) -> Option<(u64, usize, f64)> {
        loop {
            let (tick, ..) = *self.places.front()?;
            let after = self.references.iter().position(|reference| reference.tick >= tick)?;
            let (_, time_ns, view, place) = self.places.pop_front()?;
            // Without one there was no path.
            let before = after.checked_sub(1).map(|before| &self.references[before]);
            if let Some(aside_m) = before.and_then(|reference| cross_track_m(reference, place)) {
                return Some((time_ns, view, aside_m));
            }
        }
    }

    fn is_due(&self, tick: Tick) -> bool {
        tick.is_multiple_of(self.period_ticks)
    }

    /// The oldest pose whose twist has come. Wires are read one after the other, so either may come first.
    fn next_pair(&mut self) -> Option<(u64, WorldPose, [f64; 3])> {
        loop {
            let ((pose_tick, time_ns, pose), (twist_tick, twist)) =
                (*self.poses.front()?, *self.twists.front()?);
            if twist_tick <= pose_tick {
                self.twists.pop_front();
            }
            if pose_tick <= twist_tick {
                self.poses.pop_front();
            }
            if pose_tick == twist_tick {
                return Some((time_ns, pose, twist));
            }
        }
    }

    /// True if a process has another state than it was told to have, and once a second.
    fn fares_otherwise(&mut self, health: &Health, time_ns: u64) -> bool {
        if self.fared.len() >= MAX_WAITING && !self.fared.contains_key(&health.slot) {
            return false;
        }
        let told = self.fared.get(&health.slot);
        let known = told.is_some_and(|(state, since)| {
            *state == health.state && time_ns.saturating_sub(*since) < 1_000_000_000
        });
        if !known {
            self.fared.insert(health.slot, (health.state, time_ns));
        }
        !known
    }

    fn is_news(&mut self, reference: &Reference) -> bool {
        let Reference { path_id, index, tick, .. } = *reference;
        let known = self.told.is_some_and(|(path, place, since)| {
            (path, place) == (path_id, index) && tick.saturating_sub(since) < TICKS_PER_SECOND
        });
        if !known {
            self.told = Some((path_id, index, tick));
        }
        !known
    }
}

fn keep<T>(queue: &mut VecDeque<T>, message: T) {
    if queue.len() == MAX_WAITING {
        queue.pop_front();
    }
    queue.push_back(message);
}
