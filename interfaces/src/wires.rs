//! THE diagram: which box sends what to whom, how often, how deep the buffers are.
//!
//! Ports, doorbells, start order, `hilare diagram` and the README's picture read this table; there
//! is no second list. Whoever only looks reads the wires of the relay, [`watch`].

pub mod watch;

use crate::layout::{Layout, WireMessage};
use crate::messages::{
    Answer, Authority, Command, GoalHeader, Health, PathHeader, Pose, PoseFix, Reference, Steps, Truth,
    Waypoint, Wheels,
};

/// A box of the diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Role {
    /// The process manager, with the operator behind it.
    Launch,
    /// Turns goals into paths.
    Planner,
    /// Chooses the waypoint to track.
    WaypointSelector,
    /// Turns a reference and a pose into a velocity command.
    Controller,
    /// Turns commands into steps at 1 kHz; the clock of the system.
    StepGenerator,
    /// Turns steps into a pose.
    PoseEstimator,
    /// The simulated robot.
    Plant,
    /// Repeats the wires for those who only look.
    Relay,
    /// Keeps what happened.
    Recorder,
    /// A page about the robot, where one is wanted.
    Operator,
}

impl Role {
    /// Every worker, in the diagram's order; launch is not one.
    pub const WORKERS: [Self; 9] = [
        Self::Planner,
        Self::WaypointSelector,
        Self::Controller,
        Self::StepGenerator,
        Self::PoseEstimator,
        Self::Plant,
        Self::Relay,
        Self::Recorder,
        Self::Operator,
    ];

    /// The boxes of the control diagram, the simulated robot among them, in its order.
    pub const BOXES: [Self; 6] = [
        Self::Planner,
        Self::WaypointSelector,
        Self::Controller,
        Self::StepGenerator,
        Self::PoseEstimator,
        Self::Plant,
    ];

    /// Name in commands, files and folders.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Launch => "launch",
            Self::Planner => "planner",
            Self::WaypointSelector => "waypoint_selector",
            Self::Controller => "controller",
            Self::StepGenerator => "step_generator",
            Self::PoseEstimator => "pose_estimator",
            Self::Plant => "plant",
            Self::Relay => "relay",
            Self::Recorder => "recorder",
            Self::Operator => "operator",
        }
    }

    /// Its number in messages: 0 launch, then the workers in the diagram's order.
    pub const fn code(self) -> u64 {
        self as u64
    }

    /// The role of a number.
    pub fn from_code(code: u64) -> Option<Self> {
        core::iter::once(Self::Launch).chain(Self::WORKERS).find(|role| role.code() == code)
    }

    /// The role of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        core::iter::once(Self::Launch).chain(Self::WORKERS).find(|role| role.name() == name)
    }
}

/// How often a wire carries a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Once a tick.
    EveryTick,
    /// Once a control period.
    EveryPeriod,
    /// When there is something to say.
    OnDemand,
    /// This many times a second.
    Hertz(u64),
}

/// A reader of a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reader {
    /// Who reads.
    pub role: Role,
    /// True if a message is a reason for it to wake.
    pub wakes: bool,
}

/// A wire of the diagram.
#[derive(Clone, Copy, Debug)]
pub struct Wire {
    /// Name; the service is `hilare/<name>`.
    pub name: &'static str,
    /// The message; for slices the header.
    pub message: Layout,
    /// The element if the payload is a slice.
    pub element: Option<Layout>,
    /// Layout hash of message and element together.
    pub layout_hash: u64,
    /// Writers.
    pub from: &'static [Role],
    /// Readers.
    pub to: &'static [Reader],
    /// How often.
    pub rate: Rate,
    /// Messages a reader can be behind before it loses the oldest.
    pub buffer: usize,
    /// Messages a late reader still gets: of a successor, what came while its box was away.
    pub history: usize,
    /// What it is.
    pub doc: &'static str,
}

const fn wakes(role: Role) -> Reader {
    Reader { role, wakes: true }
}

const fn polls(role: Role) -> Reader {
    Reader { role, wakes: false }
}

/// Ticks a process may be away and still find everything of them when its successor comes.
const SUCCESSOR_TICKS: usize = 768;

/// Control periods a reader's successor may still have to answer: one that its predecessor answered and did not
/// remember, one not answered, and the one that came meanwhile.
pub const SUCCESSOR_PERIODS: usize = 3;

const ALL: &[Role] = &Role::WORKERS;

/// Goals to the planner.
pub const GOAL: Wire = Wire {
    name: "goal",
    message: GoalHeader::LAYOUT,
    element: Some(Waypoint::LAYOUT),
    layout_hash: GoalHeader::LAYOUT_HASH ^ Waypoint::LAYOUT_HASH,
    from: &[Role::Launch],
    to: &[wakes(Role::Planner), polls(Role::Relay)],
    rate: Rate::OnDemand,
    buffer: 4,
    history: 0,
    doc: "a point to go to, or waypoints to follow",
};

/// The planner's answers.
pub const ANSWER: Wire = Wire {
    name: "answer",
    message: Answer::LAYOUT,
    element: None,
    layout_hash: Answer::LAYOUT_HASH,
    from: &[Role::Planner],
    to: &[polls(Role::Launch), polls(Role::Relay)],
    rate: Rate::OnDemand,
    buffer: 8,
    history: 0,
    doc: "accepted, or why not",
};

/// Paths to the waypoint selector.
pub const PATH: Wire = Wire {
    name: "path",
    message: PathHeader::LAYOUT,
    element: Some(Waypoint::LAYOUT),
    layout_hash: PathHeader::LAYOUT_HASH ^ Waypoint::LAYOUT_HASH,
    from: &[Role::Planner],
    to: &[wakes(Role::WaypointSelector), polls(Role::Relay)],
    rate: Rate::OnDemand,
    buffer: 2,
    history: 1,
    doc: "waypoints in the world frame, at most 65 536",
};

/// What to track.
pub const REFERENCE: Wire = Wire {
    name: "reference",
    message: Reference::LAYOUT,
    element: None,
    layout_hash: Reference::LAYOUT_HASH,
    from: &[Role::WaypointSelector],
    to: &[wakes(Role::Controller), polls(Role::Relay)],
    rate: Rate::EveryPeriod,
    buffer: 256,
    history: SUCCESSOR_PERIODS,
    doc: "last, current and coming waypoints, index, total, speed",
};

/// Velocity commands.
pub const COMMAND: Wire = Wire {
    name: "command",
    message: Command::LAYOUT,
    element: None,
    layout_hash: Command::LAYOUT_HASH,
    from: &[Role::Controller],
    // The real clock is never woken by it; the lockstep clock waits for it.
    to: &[wakes(Role::StepGenerator), polls(Role::Relay)],
    rate: Rate::EveryPeriod,
    // As long as a second, like the others: whoever looks may be kept from it by a busy machine. The step generator
    // lets fewer wait.
    buffer: 256,
    history: 0,
    doc: "body velocity with source, epoch, seq, pose tick and effective tick",
};

/// Who may drive.
pub const AUTHORITY: Wire = Wire {
    name: "authority",
    message: Authority::LAYOUT,
    element: None,
    layout_hash: Authority::LAYOUT_HASH,
    from: &[Role::Launch],
    to: &[polls(Role::StepGenerator), polls(Role::Relay)],
    rate: Rate::Hertz(50),
    buffer: 64,
    history: 1,
    doc: "which source and epoch, armed / stop / e-stop; launch's lease",
};

/// Steps done.
pub const STEPS: Wire = Wire {
    name: "steps",
    message: Steps::LAYOUT,
    element: None,
    layout_hash: Steps::LAYOUT_HASH,
    from: &[Role::StepGenerator],
    to: &[wakes(Role::PoseEstimator), wakes(Role::Plant), polls(Role::Relay)],
    rate: Rate::EveryTick,
    buffer: 1024,
    history: SUCCESSOR_TICKS,
    doc: "cumulative signed counts a wheel, commanded wheel speeds",
};

/// What the robot's encoders say; the pulse of the plant.
pub const WHEELS: Wire = Wire {
    name: "wheels",
    message: Wheels::LAYOUT,
    element: None,
    layout_hash: Wheels::LAYOUT_HASH,
    from: &[Role::Plant],
    to: &[wakes(Role::PoseEstimator), polls(Role::Relay)],
    rate: Rate::EveryTick,
    buffer: 1024,
    history: SUCCESSOR_TICKS,
    doc: "cumulative encoder counts, where the robot has encoders or a camera",
};

/// The robot seen from outside.
pub const FIX: Wire = Wire {
    name: "fix",
    message: PoseFix::LAYOUT,
    element: None,
    layout_hash: PoseFix::LAYOUT_HASH,
    from: &[Role::Plant],
    // The wheels of the same tick wake it.
    to: &[polls(Role::PoseEstimator), polls(Role::Relay)],
    rate: Rate::OnDemand,
    buffer: 1024,
    history: 64,
    doc: "pose measured from outside, late and noisy, where there is a camera",
};

/// Where the robot thinks it is.
pub const POSE: Wire = Wire {
    name: "pose",
    message: Pose::LAYOUT,
    element: None,
    layout_hash: Pose::LAYOUT_HASH,
    from: &[Role::PoseEstimator],
    to: &[
        wakes(Role::WaypointSelector),
        // The reference that answers a pose wakes it.
        polls(Role::Controller),
        polls(Role::Relay),
    ],
    rate: Rate::EveryTick,
    buffer: 1024,
    // Those of as many references, and more: periods differ.
    history: 64,
    doc: "estimated pose in the world frame",
};

/// Where the robot is.
pub const TRUTH: Wire = Wire {
    name: "truth",
    message: Truth::LAYOUT,
    element: None,
    layout_hash: Truth::LAYOUT_HASH,
    from: &[Role::Plant],
    to: &[polls(Role::Relay)],
    rate: Rate::EveryTick,
    buffer: 1024,
    history: 0,
    doc: "true pose; never seen by the control path",
};

/// How everybody fares.
pub const HEALTH: Wire = Wire {
    name: "health",
    message: Health::LAYOUT,
    element: None,
    layout_hash: Health::LAYOUT_HASH,
    from: ALL,
    to: &[polls(Role::Launch), polls(Role::Relay)],
    rate: Rate::Hertz(20),
    buffer: 4,
    history: 1,
    doc: "state, reason, counters",
};

/// Every wire, in the diagram's order.
pub const WIRES: [&Wire; 25] = [
    &GOAL,
    &ANSWER,
    &PATH,
    &REFERENCE,
    &COMMAND,
    &AUTHORITY,
    &STEPS,
    &WHEELS,
    &FIX,
    &POSE,
    &TRUTH,
    &HEALTH,
    &watch::GOAL,
    &watch::ANSWER,
    &watch::PATH,
    &watch::REFERENCE,
    &watch::COMMAND,
    &watch::AUTHORITY,
    &watch::STEPS,
    &watch::WHEELS,
    &watch::FIX,
    &watch::POSE,
    &watch::TRUTH,
    &watch::HEALTH,
    &watch::JOURNAL,
];

impl Wire {
    /// True if `role` writes this wire.
    pub fn written_by(&self, role: Role) -> bool {
        self.from.contains(&role)
    }

    /// True if `role` reads this wire.
    pub fn read_by(&self, role: Role) -> bool {
        self.to.iter().any(|reader| reader.role == role)
    }

    /// True if this is a wire of the relay, for whoever wants to look.
    pub const fn is_watch(&self) -> bool {
        matches!(self.from, [Role::Relay])
    }

    /// True if a message on this wire wakes `role`.
    pub fn wakes(&self, role: Role) -> bool {
        self.to.iter().any(|reader| reader.role == role && reader.wakes)
    }
}

/// The order in which launch starts the workers: readers before the writers they wait for, the
/// clock (step generator) last, so that the first tick finds everybody listening. Derived from the
/// table: of the boxes left, next is the one with the fewest readers not yet started.
pub fn start_order() -> [Role; Role::WORKERS.len()] {
    // Launch is there before all others, the clock comes after them.
    let outside = [Role::Launch, Role::StepGenerator];
    let mut order = Role::WORKERS;
    for done in 0..order.len() {
        let (started, left) = order.split_at_mut(done);
        let waiting = |role: Role| {
            WIRES
                .iter()
                .filter(|wire| wire.written_by(role))
                .flat_map(|wire| wire.to)
                .filter(|reader| {
                    reader.wakes && !outside.contains(&reader.role) && !started.contains(&reader.role)
                })
                .count()
        };
        let clock = |role: Role| usize::from(role == Role::StepGenerator);
        let next = (0..left.len()).min_by_key(|i| (clock(left[*i]), waiting(left[*i]), *i)).unwrap_or(0);
        left[..=next].rotate_right(1);
    }
    order
}

#[cfg(test)]
mod tests;
