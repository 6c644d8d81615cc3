//! The messages on the wires: `repr(C)`, 64-bit integers and `f64` only, versioned, layout-hashed.
//!
//! Codes are integers on the wire and enums inside; what arrives is checked where it is decoded,
//! because the other end may be any program.

use crate::block::Tick;
use crate::chassis::MAX_WHEELS;
use crate::geometry::{BodyTwist, WorldPoint, WorldPose};
use crate::segment::Segment;
use crate::wire_message;

mod codes;
pub mod sense;

pub use codes::{
    CODES, Code, CodeTable, Drive, Fallback, GoalKind, HealthState, JournalKind, Mode, ReferenceState,
    Refusal,
};

/// Coming waypoints a [`Reference`] carries beyond the current one.
pub const PREVIEW: usize = 32;
/// Most waypoints a path may have.
pub const MAX_WAYPOINTS: usize = 65_536;
/// Bytes of text in [`Health`] and [`Answer`].
pub const TEXT_BYTES: usize = 160;

wire_message! {
    /// A waypoint in the world frame, and how to get there from the one before.
    Waypoint = "hilare/Waypoint/v2" {
        /// World x, m.
        x_m: f64,
        /// World y, m.
        y_m: f64,
        /// Bulge of the segment that ends here ([`Segment`]): 0 a line.
        bulge: f64,
        /// Crab angle on that segment, rad: direction of travel minus heading. 0 is forwards; π/2
        /// sideways to the left, which only a chassis that can move sideways does.
        crab_rad: f64,
    }
}

wire_message! {
    /// Header of a goal; its payload is the waypoints to follow, or the one point to go to.
    GoalHeader = "hilare/GoalHeader/v1" {
        /// Chosen by the sender; the answer repeats it.
        goal_id: u64,
        /// A [`GoalKind`].
        kind: u64,
        /// Wanted final heading, rad; valid if `has_heading` is 1.
        heading_rad: f64,
        /// 1 if a final heading is wanted, else 0.
        has_heading: u64,
    }
}

wire_message! {
    /// The planner's answer to a goal.
    Answer = "hilare/Answer/v1" {
        /// The goal it answers.
        goal_id: u64,
        /// 1 accepted, 0 refused.
        accepted: u64,
        /// Waypoints of the path that was published.
        waypoints: u64,
        /// UTF-8 reason, zero-padded.
        text: [u8; TEXT_BYTES],
    }
}

wire_message! {
    /// Header of a path; its payload is the waypoints, the first being where the path begins.
    PathHeader = "hilare/PathHeader/v1" {
        /// Counts up with every new path of a robot.
        path_id: u64,
        /// The goal that asked for it; 0 for the system's own.
        goal_id: u64,
    }
}

wire_message! {
    /// What the robot should track, from the waypoint selector, once a control period.
    Reference = "hilare/Reference/v2" {
        /// Tick of the pose it was chosen on.
        tick: u64,
        /// A [`ReferenceState`].
        state: u64,
        /// The path it belongs to.
        path_id: u64,
        /// Index of the current waypoint, k; waypoint 0 is where the path begins.
        index: u64,
        /// Waypoints of the path.
        total: u64,
        /// Reference speed v_r, m/s.
        speed_mps: f64,
        /// Waypoint k − 1.
        last: Waypoint,
        /// Waypoint k.
        current: Waypoint,
        /// Valid entries of `preview`.
        preview_len: u64,
        /// Waypoints k + 1, k + 2, …
        preview: [Waypoint; PREVIEW],
    }
}

wire_message! {
    /// A velocity command of one controller for one control period.
    Command = "hilare/Command/v2" {
        /// Which controller.
        source: u64,
        /// The authority epoch it was started under.
        epoch: u64,
        /// Counts up by one a command.
        seq: u64,
        /// Tick of the pose it was computed from.
        pose_tick: u64,
        /// Tick from which it acts (logical execution time).
        effective_tick: u64,
        /// Forward speed, m/s, before the input constraints.
        vx_mps: f64,
        /// Sideways speed, m/s.
        vy_mps: f64,
        /// Yaw rate, rad/s.
        omega_radps: f64,
        /// A [`Fallback`]: what the law had to do without.
        fallback: u64,
    }
}

wire_message! {
    /// Who may drive, from launch to the step generator; also launch's lease.
    ///
    /// A controller process is a pair (source, epoch): source is its place in the system, epoch goes up
    /// with every process started, so that a predecessor woken up late is not mistaken for it.
    Authority = "hilare/Authority/v2" {
        /// Counts up with every message, so that a stale one is seen.
        seq: u64,
        /// A [`Mode`].
        mode: u64,
        /// Counts up whenever another controller comes into charge, here or in the step generator; who is
        /// in charge is taken from the highest.
        term: u64,
        /// The controller in charge; 0 is none.
        source: u64,
        /// Its epoch.
        epoch: u64,
        /// The standby: its command acts when that of the controller in charge is missing; 0 is none.
        standby_source: u64,
        /// Its epoch.
        standby_epoch: u64,
        /// The controller on trial: its commands are judged and never act; 0 is none.
        trial_source: u64,
        /// Its epoch.
        trial_epoch: u64,
    }
}

wire_message! {
    /// State of the step generator after a tick.
    ///
    /// A drive for steppers sets DIR to `dir_level`, then makes a pulse on STEP for each wheel whose count is not
    /// that of the message before: it differs by one. The length of the pulse and the space after it are over
    /// before the next one is told; set-up and hold of DIR are kept by the messages (`motors.direction_*`).
    Steps = "hilare/Steps/v3" {
        /// Ticks executed; message n follows the n-th tick, message 0 precedes the first.
        tick: u64,
        /// Cumulative signed steps a wheel.
        counts: [i64; MAX_WHEELS],
        /// Level of each wheel's DIR input, 1 high, 0 low, inverted where the wiring is; 0 without steppers.
        dir_level: [u64; MAX_WHEELS],
        /// Commanded wheel speeds after the input constraints, rad/s.
        wheel_speed_radps: [f64; MAX_WHEELS],
        /// Commanded twist after the input constraints: m/s, m/s, rad/s.
        twist: [f64; 3],
        /// A [`Drive`]: why the wheels turn as they do.
        drive: u64,
        /// Controller whose command acts: the one in charge, or its standby; 0 is none.
        source: u64,
        /// Term of the authority in force.
        term: u64,
        /// Controller in charge; 0 is none.
        in_charge: u64,
        /// Its epoch.
        epoch: u64,
        /// Control cycles in a row for which the standby had a valid command in time.
        standby_answers: u64,
        /// The same of the controller on trial.
        trial_answers: u64,
        /// Commands that came after their effective tick.
        commands_late: u64,
        /// Commands refused: invalid, of a controller that is neither in charge nor standby nor on trial, old.
        commands_rejected: u64,
        /// A [`Refusal`]: why the last of them was.
        refusal: u64,
        /// Who the last of them says it is of.
        refused_source: u64,
        /// Control cycles in which no command of their own acted.
        cycles_without_command: u64,
        /// Control cycles driven by the standby's command for want of one from the controller in charge.
        commands_borrowed: u64,
        /// Times the standby took charge here, after several such cycles in a row.
        promotions: u64,
        /// Wake-ups a tick or more late.
        ticks_late: u64,
        /// Whole ticks lost to such pauses.
        paused_ticks: u64,
        /// Longest single pause, ticks.
        paused_max_ticks: u64,
    }
}

wire_message! {
    /// What the robot's encoders have counted, from the plant or a drive, once a tick.
    Wheels = "hilare/Wheels/v1" {
        /// Ticks executed when the counts were taken.
        tick: u64,
        /// Cumulative signed encoder counts a wheel; zero on a robot without encoders.
        counts: [i64; MAX_WHEELS],
    }
}

wire_message! {
    /// The robot's pose as measured from outside (overhead camera, positioning system): late and noisy.
    PoseFix = "hilare/PoseFix/v1" {
        /// Tick at which it has come through camera and processing, and is used. It is sent before the
        /// [`Wheels`] of that tick.
        tick: u64,
        /// Ticks executed when the picture was taken.
        captured_tick: u64,
        /// World x, m.
        x_m: f64,
        /// World y, m.
        y_m: f64,
        /// Heading, rad, in (−π, π].
        theta_rad: f64,
    }
}

wire_message! {
    /// Estimated pose of the robot.
    Pose = "hilare/Pose/v2" {
        /// Ticks executed when the pose was reckoned.
        tick: u64,
        /// Ticks executed when the robot was where it says: `tick`, or earlier where the pose is of a
        /// picture that came late and is held.
        measured_tick: u64,
        /// World x, m.
        x_m: f64,
        /// World y, m.
        y_m: f64,
        /// Heading, rad, not wrapped.
        theta_rad: f64,
    }
}

wire_message! {
    /// True pose of the simulated robot, as the overhead camera sees it; not for the control path.
    Truth = "hilare/Truth/v1" {
        /// Ticks executed when the pose held.
        tick: u64,
        /// World x, m.
        x_m: f64,
        /// World y, m.
        y_m: f64,
        /// Heading, rad, not wrapped.
        theta_rad: f64,
    }
}

wire_message! {
    /// How a process fares, 20 times a second.
    Health = "hilare/Health/v3" {
        /// Its slot in the system.
        slot: u64,
        /// Its box: the code of a [`Role`](crate::wires::Role).
        role: u64,
        /// Its process id.
        pid: u64,
        /// A [`HealthState`].
        state: u64,
        /// Newest tick it has worked on.
        tick: u64,
        /// Steps taken.
        steps: u64,
        /// Messages that were missing or refused at the rim.
        rejected: u64,
        /// Newest path seen (planner: published); 0 before the first.
        path_id: u64,
        /// UTF-8 reason, zero-padded.
        text: [u8; TEXT_BYTES],
    }
}

wire_message! {
    /// What a box took from outside, and at which tick: with the wires, all a replay needs.
    Journal = "hilare/Journal/v1" {
        /// Place of its process in the system.
        slot: u64,
        /// Its box: 0 launch, then the workers in the diagram's order.
        role: u64,
        /// Counts up by one with every entry of a place, over restarts, too.
        seq: u64,
        /// Ticks the box had executed, or the tick of the pose it answered with what it took.
        tick: u64,
        /// A [`JournalKind`].
        kind: u64,
        /// What was taken; which word is what, the kind says.
        words: [u64; 6],
    }
}

impl Waypoint {
    /// Reached on a straight line, heading along it.
    pub const fn straight(x_m: f64, y_m: f64) -> Self {
        Self { x_m, y_m, bulge: 0.0, crab_rad: 0.0 }
    }

    /// As a point.
    pub const fn point(self) -> WorldPoint {
        WorldPoint::new(self.x_m, self.y_m)
    }

    /// The segment from `last` that ends here.
    pub const fn segment_from(self, last: Self) -> Segment {
        Segment::new(last.point(), self.point(), self.bulge)
    }

    /// True when every number is finite.
    pub fn is_finite(self) -> bool {
        self.point().is_finite() && self.bulge.is_finite() && self.crab_rad.is_finite()
    }
}

impl From<WorldPoint> for Waypoint {
    fn from(point: WorldPoint) -> Self {
        Self::straight(point.x_m, point.y_m)
    }
}

impl Reference {
    /// The segment under way: from waypoint k − 1 to waypoint k.
    pub const fn segment(&self) -> Segment {
        self.current.segment_from(self.last)
    }

    /// The waypoints ahead, the current one first.
    pub fn ahead(&self) -> impl Iterator<Item = &Waypoint> {
        let coming = (self.preview_len as usize).min(PREVIEW);
        core::iter::once(&self.current).chain(&self.preview[..coming])
    }
}

impl Command {
    /// The commanded twist, `None` unless every component is finite.
    pub fn twist(&self) -> Option<BodyTwist> {
        let twist = BodyTwist::new(self.vx_mps, self.vy_mps, self.omega_radps);
        twist.is_finite().then_some(twist)
    }
}

impl Steps {
    /// The commanded twist after the input constraints.
    pub const fn commanded_twist(&self) -> BodyTwist {
        BodyTwist::new(self.twist[0], self.twist[1], self.twist[2])
    }
}

impl Pose {
    /// A pose of the tick at which it was reckoned.
    pub const fn at(tick: Tick, pose: WorldPose) -> Self {
        Self { tick, measured_tick: tick, x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad }
    }

    /// As a geometric pose.
    pub const fn pose(&self) -> WorldPose {
        WorldPose::new(self.x_m, self.y_m, self.theta_rad)
    }
}

impl PoseFix {
    /// As a geometric pose.
    pub const fn pose(&self) -> WorldPose {
        WorldPose::new(self.x_m, self.y_m, self.theta_rad)
    }
}

impl Truth {
    /// A true pose at a tick.
    pub const fn at(tick: Tick, pose: WorldPose) -> Self {
        Self { tick, x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad }
    }

    /// As a geometric pose.
    pub const fn pose(&self) -> WorldPose {
        WorldPose::new(self.x_m, self.y_m, self.theta_rad)
    }
}

/// Text as a zero-padded field, cut at a character border.
pub fn text_field(text: &str) -> [u8; TEXT_BYTES] {
    let mut field = [0; TEXT_BYTES];
    let mut end = text.len().min(TEXT_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    field[..end].copy_from_slice(&text.as_bytes()[..end]);
    field
}

/// The text of a field up to its first zero; invalid UTF-8 ends it.
pub fn field_text(field: &[u8; TEXT_BYTES]) -> &str {
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(TEXT_BYTES);
    match core::str::from_utf8(&field[..end]) {
        Ok(text) => text,
        Err(error) => core::str::from_utf8(&field[..error.valid_up_to()]).unwrap_or(""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{WireMessage, layout_hash};

    #[test]
    fn swapped_fields_change_the_layout_hash() {
        let mut fields: std::vec::Vec<_> = Pose::FIELDS.to_vec();
        assert_eq!(layout_hash(Pose::NAME, &fields), Pose::LAYOUT_HASH);
        let (a, b) = (fields[1].name, fields[2].name);
        fields[1].name = b;
        fields[2].name = a;
        assert_ne!(layout_hash(Pose::NAME, &fields), Pose::LAYOUT_HASH);
    }

    #[test]
    fn codes_decode_or_are_refused() {
        assert_eq!(Mode::from_code(Mode::EStop.code()), Some(Mode::EStop));
        assert_eq!(Mode::from_code(99), None);
    }

    #[test]
    fn text_is_cut_at_a_character() {
        let long: std::string::String = "µ".repeat(TEXT_BYTES);
        assert_eq!(field_text(&text_field(&long)), &long[..TEXT_BYTES]);
        let odd = std::format!("x{long}");
        assert_eq!(field_text(&text_field(&odd)).len(), TEXT_BYTES - 1);
        let mut broken = text_field("fine");
        broken[2] = 0xff;
        assert_eq!(field_text(&broken), "fi");
    }
}
