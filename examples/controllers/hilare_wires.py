"""The wires of hilare. Printed by `hilare diagram --header python`; do not edit.

SI units, 64-bit integers and doubles, no padding. A wire is an iceoryx2 publish-subscribe service; both ends
compare its attribute LAYOUT_ATTRIBUTE before they talk. Of a wire with an element, the message is the user
header, and the payload a slice of elements.
"""

import ctypes
import enum
from typing import NamedTuple, Optional

# Seconds of a tick.
TICK_S = 0.001

LAYOUT_ATTRIBUTE = "layout"


class GoalKind(enum.IntEnum):
    """What a goal asks for."""

    # Go to the one point of the payload.
    POINT = 1
    # Follow the payload's waypoints.
    FOLLOW = 2


class ReferenceState(enum.IntEnum):
    """What a reference says."""

    # No path yet.
    IDLE = 0
    # Under way to waypoint k.
    TRACKING = 1
    # The last waypoint was accepted.
    ARRIVED = 2


class Mode(enum.IntEnum):
    """What the operator (through launch) wants the step generator to do."""

    # Outputs stay still until armed.
    DISARMED = 0
    # Commands of the source in authority act.
    ARMED = 1
    # Ramp to a stop within the acceleration limit and stay.
    STOP = 2
    # Stop at once; latched until reset.
    E_STOP = 3


class Fallback(enum.IntEnum):
    """What a law had to do without when it computed a command."""

    # Nothing: the command is what the law is there for.
    NONE = 0
    # The solver stopped at its iteration cap; the best feasible plan at hand is used.
    ITERATION_CAP = 1
    # The solver found no solution; the plan of the period before, inside the limits, is used.
    UNSOLVED = 2
    # The robot is told to stand, or cannot drive or turn at all.
    NO_MOTION = 3
    # The law's own plan is not within the limits; the best plan that is drives instead.
    INFEASIBLE = 4
    # The deviation is outside what the law's own plan is valid for; the best bounded plan drives.
    OUTSIDE_VALIDITY = 5
    # Reference or pose make no sense, or no law can make anything of them: the command is none.
    NO_SENSE = 6


class Refusal(enum.IntEnum):
    """Why the step generator refused a command."""

    # None has been refused.
    NONE = 0
    # Its source and epoch are those of no controller in charge, standing by or on trial.
    STRANGER = 1
    # A speed or the yaw rate is not finite.
    NOT_FINITE = 2
    # effective_tick is not a multiple of the control period.
    OFF_GRID = 3
    # effective_tick is not one control period after pose_tick.
    NOT_ONE_PERIOD = 4
    # effective_tick is more than two control periods ahead.
    TOO_FAR_AHEAD = 5
    # seq is not above that of the command before.
    OLD_SEQ = 6
    # effective_tick is not after that of the command before.
    OLD_TICK = 7


class Drive(enum.IntEnum):
    """Why the wheels turn as they do."""

    # Not armed.
    DISARMED = 0
    # A command of its own cycle acts.
    COMMAND = 1
    # Nothing new: the last command is held.
    HOLD = 2
    # Nothing for too long: ramping to zero, then still.
    RAMP = 3
    # Stop was asked for.
    STOP = 4
    # Emergency stop.
    E_STOP = 5
    # Launch's lease ran out.
    LEASE_LOST = 6
    # A single pause was longer than the policy allows.
    PAUSE_STOP = 7


class HealthState(enum.IntEnum):
    """State of a process."""

    # Opening its ports.
    STARTING = 0
    # Connected, waiting.
    READY = 1
    # At work.
    RUNNING = 2
    # At work with less than it should have; the text says what.
    DEGRADED = 3
    # Ended itself; the text says why.
    FAULT = 4


class JournalKind(enum.IntEnum):
    """What a box noted in its journal, and what the words of the entry are."""

    # The process is at work, from this tick on: incarnation; epoch; number of its system file; law of a
    # controller, by its place in the list of laws plus 1 (0 none); ticks plus 1 of the state it went on
    # from (0 none); place plus 1 of whose state that was.
    BEGAN = 1
    # Authority was taken in: its seq; hash of the message.
    AUTHORITY = 2
    # A command was taken in: source; epoch; seq; hash of the message.
    COMMAND = 3
    # A pause before the tick: whole ticks lost.
    PAUSE = 4
    # A path acts from the pose of this tick on: path id; goal id; number of waypoints.
    PATH = 5
    # A goal was answered, the robot being where the pose of this tick says: goal id; 1 accepted, 0 refused;
    # path id; 1 if the clock or a newer goal cut the search short.
    GOAL = 6
    # Parameters were changed; from this tick on what the box does it does with the new ones: number of the
    # change; number of its system file; the tick it was meant for.
    PARAM = 7


def _check(message, size, **offsets):
    found = {name: getattr(message, name).offset for name in offsets}
    if ctypes.sizeof(message) != size or found != offsets:
        raise ImportError(f"{message.__name__} is laid out otherwise here: {found}")


class GoalHeader(ctypes.Structure):
    """Header of a goal; its payload is the waypoints to follow, or the one point to go to."""

    _fields_ = [
        # Chosen by the sender; the answer repeats it.
        ("goal_id", ctypes.c_uint64),
        # A GoalKind.
        ("kind", ctypes.c_uint64),
        # Wanted final heading, rad; valid if has_heading is 1.
        ("heading_rad", ctypes.c_double),
        # 1 if a final heading is wanted, else 0.
        ("has_heading", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/GoalHeader/v1"


_check(
    GoalHeader,
    32,
    goal_id=0,
    kind=8,
    heading_rad=16,
    has_heading=24,
)


class Waypoint(ctypes.Structure):
    """A waypoint in the world frame, and how to get there from the one before."""

    _fields_ = [
        # World x, m.
        ("x_m", ctypes.c_double),
        # World y, m.
        ("y_m", ctypes.c_double),
        # Bulge of the segment that ends here (Segment): 0 a line.
        ("bulge", ctypes.c_double),
        # Crab angle on that segment, rad: direction of travel minus heading. 0 is forwards; π/2 sideways to
        # the left, which only a chassis that can move sideways does.
        ("crab_rad", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Waypoint/v2"


_check(
    Waypoint,
    32,
    x_m=0,
    y_m=8,
    bulge=16,
    crab_rad=24,
)


class Answer(ctypes.Structure):
    """The planner's answer to a goal."""

    _fields_ = [
        # The goal it answers.
        ("goal_id", ctypes.c_uint64),
        # 1 accepted, 0 refused.
        ("accepted", ctypes.c_uint64),
        # Waypoints of the path that was published.
        ("waypoints", ctypes.c_uint64),
        # UTF-8 reason, zero-padded.
        ("text", ctypes.c_char * 160),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Answer/v1"


_check(
    Answer,
    184,
    goal_id=0,
    accepted=8,
    waypoints=16,
    text=24,
)


class PathHeader(ctypes.Structure):
    """Header of a path; its payload is the waypoints, the first being where the path begins."""

    _fields_ = [
        # Counts up with every new path of a robot.
        ("path_id", ctypes.c_uint64),
        # The goal that asked for it; 0 for the system's own.
        ("goal_id", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/PathHeader/v1"


_check(
    PathHeader,
    16,
    path_id=0,
    goal_id=8,
)


class Reference(ctypes.Structure):
    """What the robot should track, from the waypoint selector, once a control period."""

    _fields_ = [
        # Tick of the pose it was chosen on.
        ("tick", ctypes.c_uint64),
        # A ReferenceState.
        ("state", ctypes.c_uint64),
        # The path it belongs to.
        ("path_id", ctypes.c_uint64),
        # Index of the current waypoint, k; waypoint 0 is where the path begins.
        ("index", ctypes.c_uint64),
        # Waypoints of the path.
        ("total", ctypes.c_uint64),
        # Reference speed v_r, m/s.
        ("speed_mps", ctypes.c_double),
        # Waypoint k − 1.
        ("last", Waypoint),
        # Waypoint k.
        ("current", Waypoint),
        # Valid entries of preview.
        ("preview_len", ctypes.c_uint64),
        # Waypoints k + 1, k + 2, …
        ("preview", Waypoint * 32),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Reference/v2"


_check(
    Reference,
    1144,
    tick=0,
    state=8,
    path_id=16,
    index=24,
    total=32,
    speed_mps=40,
    last=48,
    current=80,
    preview_len=112,
    preview=120,
)


class Command(ctypes.Structure):
    """A velocity command of one controller for one control period."""

    _fields_ = [
        # Which controller.
        ("source", ctypes.c_uint64),
        # The authority epoch it was started under.
        ("epoch", ctypes.c_uint64),
        # Counts up by one a command.
        ("seq", ctypes.c_uint64),
        # Tick of the pose it was computed from.
        ("pose_tick", ctypes.c_uint64),
        # Tick from which it acts (logical execution time).
        ("effective_tick", ctypes.c_uint64),
        # Forward speed, m/s, before the input constraints.
        ("vx_mps", ctypes.c_double),
        # Sideways speed, m/s.
        ("vy_mps", ctypes.c_double),
        # Yaw rate, rad/s.
        ("omega_radps", ctypes.c_double),
        # A Fallback: what the law had to do without.
        ("fallback", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Command/v2"


_check(
    Command,
    72,
    source=0,
    epoch=8,
    seq=16,
    pose_tick=24,
    effective_tick=32,
    vx_mps=40,
    vy_mps=48,
    omega_radps=56,
    fallback=64,
)


class Authority(ctypes.Structure):
    """Who may drive, from launch to the step generator; also launch's lease. A controller process is a
    pair (source, epoch): source is its place in the system, epoch goes up with every process started,
    so that a predecessor woken up late is not mistaken for it.
    """

    _fields_ = [
        # Counts up with every message, so that a stale one is seen.
        ("seq", ctypes.c_uint64),
        # A Mode.
        ("mode", ctypes.c_uint64),
        # Counts up whenever another controller comes into charge, here or in the step generator; who is in
        # charge is taken from the highest.
        ("term", ctypes.c_uint64),
        # The controller in charge; 0 is none.
        ("source", ctypes.c_uint64),
        # Its epoch.
        ("epoch", ctypes.c_uint64),
        # The standby: its command acts when that of the controller in charge is missing; 0 is none.
        ("standby_source", ctypes.c_uint64),
        # Its epoch.
        ("standby_epoch", ctypes.c_uint64),
        # The controller on trial: its commands are judged and never act; 0 is none.
        ("trial_source", ctypes.c_uint64),
        # Its epoch.
        ("trial_epoch", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Authority/v2"


_check(
    Authority,
    72,
    seq=0,
    mode=8,
    term=16,
    source=24,
    epoch=32,
    standby_source=40,
    standby_epoch=48,
    trial_source=56,
    trial_epoch=64,
)


class Steps(ctypes.Structure):
    """State of the step generator after a tick. A drive for steppers sets DIR to dir_level, then makes a
    pulse on STEP for each wheel whose count is not that of the message before: it differs by one. The
    length of the pulse and the space after it are over before the next one is told; set-up and hold
    of DIR are kept by the messages (motors.direction_*).
    """

    _fields_ = [
        # Ticks executed; message n follows the n-th tick, message 0 precedes the first.
        ("tick", ctypes.c_uint64),
        # Cumulative signed steps a wheel.
        ("counts", ctypes.c_int64 * 4),
        # Level of each wheel's DIR input, 1 high, 0 low, inverted where the wiring is; 0 without steppers.
        ("dir_level", ctypes.c_uint64 * 4),
        # Commanded wheel speeds after the input constraints, rad/s.
        ("wheel_speed_radps", ctypes.c_double * 4),
        # Commanded twist after the input constraints: m/s, m/s, rad/s.
        ("twist", ctypes.c_double * 3),
        # A Drive: why the wheels turn as they do.
        ("drive", ctypes.c_uint64),
        # Controller whose command acts: the one in charge, or its standby; 0 is none.
        ("source", ctypes.c_uint64),
        # Term of the authority in force.
        ("term", ctypes.c_uint64),
        # Controller in charge; 0 is none.
        ("in_charge", ctypes.c_uint64),
        # Its epoch.
        ("epoch", ctypes.c_uint64),
        # Control cycles in a row for which the standby had a valid command in time.
        ("standby_answers", ctypes.c_uint64),
        # The same of the controller on trial.
        ("trial_answers", ctypes.c_uint64),
        # Commands that came after their effective tick.
        ("commands_late", ctypes.c_uint64),
        # Commands refused: invalid, of a controller that is neither in charge nor standby nor on trial,
        # old.
        ("commands_rejected", ctypes.c_uint64),
        # A Refusal: why the last of them was.
        ("refusal", ctypes.c_uint64),
        # Who the last of them says it is of.
        ("refused_source", ctypes.c_uint64),
        # Control cycles in which no command of their own acted.
        ("cycles_without_command", ctypes.c_uint64),
        # Control cycles driven by the standby's command for want of one from the controller in charge.
        ("commands_borrowed", ctypes.c_uint64),
        # Times the standby took charge here, after several such cycles in a row.
        ("promotions", ctypes.c_uint64),
        # Wake-ups a tick or more late.
        ("ticks_late", ctypes.c_uint64),
        # Whole ticks lost to such pauses.
        ("paused_ticks", ctypes.c_uint64),
        # Longest single pause, ticks.
        ("paused_max_ticks", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Steps/v3"


_check(
    Steps,
    264,
    tick=0,
    counts=8,
    dir_level=40,
    wheel_speed_radps=72,
    twist=104,
    drive=128,
    source=136,
    term=144,
    in_charge=152,
    epoch=160,
    standby_answers=168,
    trial_answers=176,
    commands_late=184,
    commands_rejected=192,
    refusal=200,
    refused_source=208,
    cycles_without_command=216,
    commands_borrowed=224,
    promotions=232,
    ticks_late=240,
    paused_ticks=248,
    paused_max_ticks=256,
)


class Wheels(ctypes.Structure):
    """What the robot's encoders have counted, from the plant or a drive, once a tick."""

    _fields_ = [
        # Ticks executed when the counts were taken.
        ("tick", ctypes.c_uint64),
        # Cumulative signed encoder counts a wheel; zero on a robot without encoders.
        ("counts", ctypes.c_int64 * 4),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Wheels/v1"


_check(
    Wheels,
    40,
    tick=0,
    counts=8,
)


class PoseFix(ctypes.Structure):
    """The robot's pose as measured from outside (overhead camera, positioning system): late and noisy."""

    _fields_ = [
        # Tick at which it has come through camera and processing, and is used. It is sent before the Wheels
        # of that tick.
        ("tick", ctypes.c_uint64),
        # Ticks executed when the picture was taken.
        ("captured_tick", ctypes.c_uint64),
        # World x, m.
        ("x_m", ctypes.c_double),
        # World y, m.
        ("y_m", ctypes.c_double),
        # Heading, rad, in (−π, π].
        ("theta_rad", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/PoseFix/v1"


_check(
    PoseFix,
    40,
    tick=0,
    captured_tick=8,
    x_m=16,
    y_m=24,
    theta_rad=32,
)


class Pose(ctypes.Structure):
    """Estimated pose of the robot."""

    _fields_ = [
        # Ticks executed when the pose was reckoned.
        ("tick", ctypes.c_uint64),
        # Ticks executed when the robot was where it says: tick, or earlier where the pose is of a picture
        # that came late and is held.
        ("measured_tick", ctypes.c_uint64),
        # World x, m.
        ("x_m", ctypes.c_double),
        # World y, m.
        ("y_m", ctypes.c_double),
        # Heading, rad, not wrapped.
        ("theta_rad", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Pose/v2"


_check(
    Pose,
    40,
    tick=0,
    measured_tick=8,
    x_m=16,
    y_m=24,
    theta_rad=32,
)


class Truth(ctypes.Structure):
    """True pose of the simulated robot, as the overhead camera sees it; not for the control path."""

    _fields_ = [
        # Ticks executed when the pose held.
        ("tick", ctypes.c_uint64),
        # World x, m.
        ("x_m", ctypes.c_double),
        # World y, m.
        ("y_m", ctypes.c_double),
        # Heading, rad, not wrapped.
        ("theta_rad", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Truth/v1"


_check(
    Truth,
    32,
    tick=0,
    x_m=8,
    y_m=16,
    theta_rad=24,
)


class Health(ctypes.Structure):
    """How a process fares, 20 times a second."""

    _fields_ = [
        # Its slot in the system.
        ("slot", ctypes.c_uint64),
        # Its box: the code of a Role(crate::wires::Role).
        ("role", ctypes.c_uint64),
        # Its process id.
        ("pid", ctypes.c_uint64),
        # A HealthState.
        ("state", ctypes.c_uint64),
        # Newest tick it has worked on.
        ("tick", ctypes.c_uint64),
        # Steps taken.
        ("steps", ctypes.c_uint64),
        # Messages that were missing or refused at the rim.
        ("rejected", ctypes.c_uint64),
        # Newest path seen (planner: published); 0 before the first.
        ("path_id", ctypes.c_uint64),
        # UTF-8 reason, zero-padded.
        ("text", ctypes.c_char * 160),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Health/v3"


_check(
    Health,
    224,
    slot=0,
    role=8,
    pid=16,
    state=24,
    tick=32,
    steps=40,
    rejected=48,
    path_id=56,
    text=64,
)


class Journal(ctypes.Structure):
    """What a box took from outside, and at which tick: with the wires, all a replay needs."""

    _fields_ = [
        # Place of its process in the system.
        ("slot", ctypes.c_uint64),
        # Its box: 0 launch, then the workers in the diagram's order.
        ("role", ctypes.c_uint64),
        # Counts up by one with every entry of a place, over restarts, too.
        ("seq", ctypes.c_uint64),
        # Ticks the box had executed, or the tick of the pose it answered with what it took.
        ("tick", ctypes.c_uint64),
        # A JournalKind.
        ("kind", ctypes.c_uint64),
        # What was taken; which word is what, the kind says.
        ("words", ctypes.c_uint64 * 6),
    ]

    @staticmethod
    def type_name() -> str:
        """What iceoryx2 calls it."""
        return "hilare/Journal/v1"


_check(
    Journal,
    88,
    slot=0,
    role=8,
    seq=16,
    tick=24,
    kind=32,
    words=40,
)


class Wire(NamedTuple):
    """A wire: its service, its message, its element if the payload is a slice, its layout attribute."""

    service: str
    message: type
    element: Optional[type]
    layout: str


# launch -> planner, relay, on demand: a point to go to, or waypoints to follow. GoalHeader, then Waypoints.
GOAL = Wire("hilare/goal", GoalHeader, Waypoint, "9798f1174bf0a157 0.1.0")

# planner -> launch, relay, on demand: accepted, or why not. Answer.
ANSWER = Wire("hilare/answer", Answer, None, "3418c0b7fef52088 0.1.0")

# planner -> waypoint_selector, relay, on demand: waypoints in the world frame, at most 65 536. PathHeader,
# then Waypoints.
PATH = Wire("hilare/path", PathHeader, Waypoint, "5e7b14bcbb67098e 0.1.0")

# waypoint_selector -> controller, relay, every control period: last, current and coming waypoints, index,
# total, speed. Reference.
REFERENCE = Wire("hilare/reference", Reference, None, "0ef859e5d54ee1df 0.1.0")

# controller -> step_generator, relay, every control period: body velocity with source, epoch, seq, pose
# tick and effective tick. Command.
COMMAND = Wire("hilare/command", Command, None, "533469003df0fb51 0.1.0")

# launch -> step_generator, relay, 50 Hz: which source and epoch, armed / stop / e-stop; launch's lease.
# Authority.
AUTHORITY = Wire("hilare/authority", Authority, None, "5fe1e47848fda10e 0.1.0")

# step_generator -> pose_estimator, plant, relay, 1 kHz: cumulative signed counts a wheel, commanded wheel
# speeds. Steps.
STEPS = Wire("hilare/steps", Steps, None, "91db82b2e31b8da9 0.1.0")

# plant -> pose_estimator, relay, 1 kHz: cumulative encoder counts, where the robot has encoders or a
# camera. Wheels.
WHEELS = Wire("hilare/wheels", Wheels, None, "bb9caf7b605e9700 0.1.0")

# plant -> pose_estimator, relay, on demand: pose measured from outside, late and noisy, where there is a
# camera. PoseFix.
FIX = Wire("hilare/fix", PoseFix, None, "5f2d70eb98eff79d 0.1.0")

# pose_estimator -> waypoint_selector, controller, relay, 1 kHz: estimated pose in the world frame. Pose.
POSE = Wire("hilare/pose", Pose, None, "2fa61ce500ab69a3 0.1.0")

# plant -> relay, 1 kHz: true pose; never seen by the control path. Truth.
TRUTH = Wire("hilare/truth", Truth, None, "e165266f143c0474 0.1.0")

# planner, waypoint_selector, controller, step_generator, pose_estimator, plant, relay, recorder, operator
# -> launch, relay, 20 Hz: state, reason, counters. Health.
HEALTH = Wire("hilare/health", Health, None, "a66ca2bcb1b46bb7 0.1.0")

# relay -> recorder, operator, observers, on demand: a point to go to, or waypoints to follow. GoalHeader,
# then Waypoints.
WATCH_GOAL = Wire("hilare/watch/goal", GoalHeader, Waypoint, "9798f1174bf0a157 0.1.0")

# relay -> recorder, operator, observers, on demand: accepted, or why not. Answer.
WATCH_ANSWER = Wire("hilare/watch/answer", Answer, None, "3418c0b7fef52088 0.1.0")

# relay -> recorder, operator, observers, on demand: waypoints in the world frame, at most 65 536.
# PathHeader, then Waypoints.
WATCH_PATH = Wire("hilare/watch/path", PathHeader, Waypoint, "5e7b14bcbb67098e 0.1.0")

# relay -> recorder, operator, launch, observers, every control period: last, current and coming waypoints,
# index, total, speed. Reference.
WATCH_REFERENCE = Wire("hilare/watch/reference", Reference, None, "0ef859e5d54ee1df 0.1.0")

# relay -> recorder, operator, observers, every control period: body velocity with source, epoch, seq, pose
# tick and effective tick. Command.
WATCH_COMMAND = Wire("hilare/watch/command", Command, None, "533469003df0fb51 0.1.0")

# relay -> recorder, operator, observers, 50 Hz: which source and epoch, armed / stop / e-stop; launch's
# lease. Authority.
WATCH_AUTHORITY = Wire("hilare/watch/authority", Authority, None, "5fe1e47848fda10e 0.1.0")

# relay -> recorder, operator, launch, observers, 1 kHz: cumulative signed counts a wheel, commanded wheel
# speeds. Steps.
WATCH_STEPS = Wire("hilare/watch/steps", Steps, None, "91db82b2e31b8da9 0.1.0")

# relay -> recorder, operator, observers, 1 kHz: cumulative encoder counts, where the robot has encoders or
# a camera. Wheels.
WATCH_WHEELS = Wire("hilare/watch/wheels", Wheels, None, "bb9caf7b605e9700 0.1.0")

# relay -> recorder, operator, observers, on demand: pose measured from outside, late and noisy, where there
# is a camera. PoseFix.
WATCH_FIX = Wire("hilare/watch/fix", PoseFix, None, "5f2d70eb98eff79d 0.1.0")

# relay -> planner, recorder, operator, launch, observers, 1 kHz: estimated pose in the world frame. Pose.
WATCH_POSE = Wire("hilare/watch/pose", Pose, None, "2fa61ce500ab69a3 0.1.0")

# relay -> recorder, operator, observers, 1 kHz: true pose; never seen by the control path. Truth.
WATCH_TRUTH = Wire("hilare/watch/truth", Truth, None, "e165266f143c0474 0.1.0")

# relay -> recorder, operator, observers, 20 Hz: state, reason, counters. Health.
WATCH_HEALTH = Wire("hilare/watch/health", Health, None, "a66ca2bcb1b46bb7 0.1.0")

# relay -> recorder, operator, observers, on demand: what each box took from outside, and at which tick:
# what a replay needs beside the wires. Journal.
WATCH_JOURNAL = Wire("hilare/watch/journal", Journal, None, "bd34c6be9381277f 0.1.0")
