/* The wires of hilare for C11 and C++17. Printed by `hilare diagram --header c`; do not edit.
 *
 * SI units, 64-bit integers and doubles, no padding. A wire is an iceoryx2 publish-subscribe service; both
 * ends compare its attribute HILARE_LAYOUT_ATTRIBUTE before they talk. Payload types go by their names
 * HILARE_..._NAME, which iceoryx2's C++ binding finds in IOX2_TYPE_NAME. Of a wire with two types the first
 * is the user header, the second the element of the slice. */
#ifndef HILARE_WIRES_H
#define HILARE_WIRES_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define HILARE_TYPE_NAME(name) static constexpr const char* IOX2_TYPE_NAME = name;
#else
#define HILARE_TYPE_NAME(name)
#endif

/* Seconds of a tick. */
#define HILARE_TICK_S 0.001

#define HILARE_LAYOUT_ATTRIBUTE "layout"

/* launch -> planner, relay, on demand: a point to go to, or waypoints to follow. GoalHeader, then
 * Waypoints. */
#define HILARE_GOAL_SERVICE "hilare/goal"
#define HILARE_GOAL_LAYOUT "9798f1174bf0a157 0.1.0"

/* planner -> launch, relay, on demand: accepted, or why not. Answer. */
#define HILARE_ANSWER_SERVICE "hilare/answer"
#define HILARE_ANSWER_LAYOUT "3418c0b7fef52088 0.1.0"

/* planner -> waypoint_selector, relay, on demand: waypoints in the world frame, at most 65 536.
 * PathHeader, then Waypoints. */
#define HILARE_PATH_SERVICE "hilare/path"
#define HILARE_PATH_LAYOUT "5e7b14bcbb67098e 0.1.0"

/* waypoint_selector -> controller, relay, every control period: last, current and coming waypoints,
 * index, total, speed. Reference. */
#define HILARE_REFERENCE_SERVICE "hilare/reference"
#define HILARE_REFERENCE_LAYOUT "0ef859e5d54ee1df 0.1.0"

/* controller -> step_generator, relay, every control period: body velocity with source, epoch, seq, pose
 * tick and effective tick. Command. */
#define HILARE_COMMAND_SERVICE "hilare/command"
#define HILARE_COMMAND_LAYOUT "533469003df0fb51 0.1.0"

/* launch -> step_generator, relay, 50 Hz: which source and epoch, armed / stop / e-stop; launch's lease.
 * Authority. */
#define HILARE_AUTHORITY_SERVICE "hilare/authority"
#define HILARE_AUTHORITY_LAYOUT "5fe1e47848fda10e 0.1.0"

/* step_generator -> pose_estimator, plant, relay, 1 kHz: cumulative signed counts a wheel, commanded
 * wheel speeds. Steps. */
#define HILARE_STEPS_SERVICE "hilare/steps"
#define HILARE_STEPS_LAYOUT "91db82b2e31b8da9 0.1.0"

/* plant -> pose_estimator, relay, 1 kHz: cumulative encoder counts, where the robot has encoders or a
 * camera. Wheels. */
#define HILARE_WHEELS_SERVICE "hilare/wheels"
#define HILARE_WHEELS_LAYOUT "bb9caf7b605e9700 0.1.0"

/* plant -> pose_estimator, relay, on demand: pose measured from outside, late and noisy, where there is
 * a camera. PoseFix. */
#define HILARE_FIX_SERVICE "hilare/fix"
#define HILARE_FIX_LAYOUT "5f2d70eb98eff79d 0.1.0"

/* pose_estimator -> waypoint_selector, controller, relay, 1 kHz: estimated pose in the world frame.
 * Pose. */
#define HILARE_POSE_SERVICE "hilare/pose"
#define HILARE_POSE_LAYOUT "2fa61ce500ab69a3 0.1.0"

/* plant -> relay, 1 kHz: true pose; never seen by the control path. Truth. */
#define HILARE_TRUTH_SERVICE "hilare/truth"
#define HILARE_TRUTH_LAYOUT "e165266f143c0474 0.1.0"

/* planner, waypoint_selector, controller, step_generator, pose_estimator, plant, relay, recorder,
 * operator -> launch, relay, 20 Hz: state, reason, counters. Health. */
#define HILARE_HEALTH_SERVICE "hilare/health"
#define HILARE_HEALTH_LAYOUT "a66ca2bcb1b46bb7 0.1.0"

/* relay -> recorder, operator, observers, on demand: a point to go to, or waypoints to follow.
 * GoalHeader, then Waypoints. */
#define HILARE_WATCH_GOAL_SERVICE "hilare/watch/goal"
#define HILARE_WATCH_GOAL_LAYOUT "9798f1174bf0a157 0.1.0"

/* relay -> recorder, operator, observers, on demand: accepted, or why not. Answer. */
#define HILARE_WATCH_ANSWER_SERVICE "hilare/watch/answer"
#define HILARE_WATCH_ANSWER_LAYOUT "3418c0b7fef52088 0.1.0"

/* relay -> recorder, operator, observers, on demand: waypoints in the world frame, at most 65 536.
 * PathHeader, then Waypoints. */
#define HILARE_WATCH_PATH_SERVICE "hilare/watch/path"
#define HILARE_WATCH_PATH_LAYOUT "5e7b14bcbb67098e 0.1.0"

/* relay -> recorder, operator, launch, observers, every control period: last, current and coming
 * waypoints, index, total, speed. Reference. */
#define HILARE_WATCH_REFERENCE_SERVICE "hilare/watch/reference"
#define HILARE_WATCH_REFERENCE_LAYOUT "0ef859e5d54ee1df 0.1.0"

/* relay -> recorder, operator, observers, every control period: body velocity with source, epoch, seq,
 * pose tick and effective tick. Command. */
#define HILARE_WATCH_COMMAND_SERVICE "hilare/watch/command"
#define HILARE_WATCH_COMMAND_LAYOUT "533469003df0fb51 0.1.0"

/* relay -> recorder, operator, observers, 50 Hz: which source and epoch, armed / stop / e-stop; launch's
 * lease. Authority. */
#define HILARE_WATCH_AUTHORITY_SERVICE "hilare/watch/authority"
#define HILARE_WATCH_AUTHORITY_LAYOUT "5fe1e47848fda10e 0.1.0"

/* relay -> recorder, operator, launch, observers, 1 kHz: cumulative signed counts a wheel, commanded
 * wheel speeds. Steps. */
#define HILARE_WATCH_STEPS_SERVICE "hilare/watch/steps"
#define HILARE_WATCH_STEPS_LAYOUT "91db82b2e31b8da9 0.1.0"

/* relay -> recorder, operator, observers, 1 kHz: cumulative encoder counts, where the robot has encoders
 * or a camera. Wheels. */
#define HILARE_WATCH_WHEELS_SERVICE "hilare/watch/wheels"
#define HILARE_WATCH_WHEELS_LAYOUT "bb9caf7b605e9700 0.1.0"

/* relay -> recorder, operator, observers, on demand: pose measured from outside, late and noisy, where
 * there is a camera. PoseFix. */
#define HILARE_WATCH_FIX_SERVICE "hilare/watch/fix"
#define HILARE_WATCH_FIX_LAYOUT "5f2d70eb98eff79d 0.1.0"

/* relay -> planner, recorder, operator, launch, observers, 1 kHz: estimated pose in the world frame.
 * Pose. */
#define HILARE_WATCH_POSE_SERVICE "hilare/watch/pose"
#define HILARE_WATCH_POSE_LAYOUT "2fa61ce500ab69a3 0.1.0"

/* relay -> recorder, operator, observers, 1 kHz: true pose; never seen by the control path. Truth. */
#define HILARE_WATCH_TRUTH_SERVICE "hilare/watch/truth"
#define HILARE_WATCH_TRUTH_LAYOUT "e165266f143c0474 0.1.0"

/* relay -> recorder, operator, observers, 20 Hz: state, reason, counters. Health. */
#define HILARE_WATCH_HEALTH_SERVICE "hilare/watch/health"
#define HILARE_WATCH_HEALTH_LAYOUT "a66ca2bcb1b46bb7 0.1.0"

/* relay -> recorder, operator, observers, on demand: what each box took from outside, and at which tick:
 * what a replay needs beside the wires. Journal. */
#define HILARE_WATCH_JOURNAL_SERVICE "hilare/watch/journal"
#define HILARE_WATCH_JOURNAL_LAYOUT "bd34c6be9381277f 0.1.0"

/* What a goal asks for. */
enum hilare_goal_kind {
    /* Go to the one point of the payload. */
    HILARE_GOAL_KIND_POINT = 1,
    /* Follow the payload's waypoints. */
    HILARE_GOAL_KIND_FOLLOW = 2,
};

/* What a reference says. */
enum hilare_reference_state {
    /* No path yet. */
    HILARE_REFERENCE_STATE_IDLE = 0,
    /* Under way to waypoint k. */
    HILARE_REFERENCE_STATE_TRACKING = 1,
    /* The last waypoint was accepted. */
    HILARE_REFERENCE_STATE_ARRIVED = 2,
};

/* What the operator (through launch) wants the step generator to do. */
enum hilare_mode {
    /* Outputs stay still until armed. */
    HILARE_MODE_DISARMED = 0,
    /* Commands of the source in authority act. */
    HILARE_MODE_ARMED = 1,
    /* Ramp to a stop within the acceleration limit and stay. */
    HILARE_MODE_STOP = 2,
    /* Stop at once; latched until reset. */
    HILARE_MODE_E_STOP = 3,
};

/* What a law had to do without when it computed a command. */
enum hilare_fallback {
    /* Nothing: the command is what the law is there for. */
    HILARE_FALLBACK_NONE = 0,
    /* The solver stopped at its iteration cap; the best feasible plan at hand is used. */
    HILARE_FALLBACK_ITERATION_CAP = 1,
    /* The solver found no solution; the plan of the period before, inside the limits, is used. */
    HILARE_FALLBACK_UNSOLVED = 2,
    /* The robot is told to stand, or cannot drive or turn at all. */
    HILARE_FALLBACK_NO_MOTION = 3,
    /* The law's own plan is not within the limits; the best plan that is drives instead. */
    HILARE_FALLBACK_INFEASIBLE = 4,
    /* The deviation is outside what the law's own plan is valid for; the best bounded plan drives. */
    HILARE_FALLBACK_OUTSIDE_VALIDITY = 5,
    /* Reference or pose make no sense, or no law can make anything of them: the command is none. */
    HILARE_FALLBACK_NO_SENSE = 6,
};

/* Why the step generator refused a command. */
enum hilare_refusal {
    /* None has been refused. */
    HILARE_REFUSAL_NONE = 0,
    /* Its source and epoch are those of no controller in charge, standing by or on trial. */
    HILARE_REFUSAL_STRANGER = 1,
    /* A speed or the yaw rate is not finite. */
    HILARE_REFUSAL_NOT_FINITE = 2,
    /* effective_tick is not a multiple of the control period. */
    HILARE_REFUSAL_OFF_GRID = 3,
    /* effective_tick is not one control period after pose_tick. */
    HILARE_REFUSAL_NOT_ONE_PERIOD = 4,
    /* effective_tick is more than two control periods ahead. */
    HILARE_REFUSAL_TOO_FAR_AHEAD = 5,
    /* seq is not above that of the command before. */
    HILARE_REFUSAL_OLD_SEQ = 6,
    /* effective_tick is not after that of the command before. */
    HILARE_REFUSAL_OLD_TICK = 7,
};

/* Why the wheels turn as they do. */
enum hilare_drive {
    /* Not armed. */
    HILARE_DRIVE_DISARMED = 0,
    /* A command of its own cycle acts. */
    HILARE_DRIVE_COMMAND = 1,
    /* Nothing new: the last command is held. */
    HILARE_DRIVE_HOLD = 2,
    /* Nothing for too long: ramping to zero, then still. */
    HILARE_DRIVE_RAMP = 3,
    /* Stop was asked for. */
    HILARE_DRIVE_STOP = 4,
    /* Emergency stop. */
    HILARE_DRIVE_E_STOP = 5,
    /* Launch's lease ran out. */
    HILARE_DRIVE_LEASE_LOST = 6,
    /* A single pause was longer than the policy allows. */
    HILARE_DRIVE_PAUSE_STOP = 7,
};

/* State of a process. */
enum hilare_health_state {
    /* Opening its ports. */
    HILARE_HEALTH_STATE_STARTING = 0,
    /* Connected, waiting. */
    HILARE_HEALTH_STATE_READY = 1,
    /* At work. */
    HILARE_HEALTH_STATE_RUNNING = 2,
    /* At work with less than it should have; the text says what. */
    HILARE_HEALTH_STATE_DEGRADED = 3,
    /* Ended itself; the text says why. */
    HILARE_HEALTH_STATE_FAULT = 4,
};

/* What a box noted in its journal, and what the words of the entry are. */
enum hilare_journal_kind {
    /* The process is at work, from this tick on: incarnation; epoch; number of its system file; law of a
     * controller, by its place in the list of laws plus 1 (0 none); ticks plus 1 of the state it went on
     * from (0 none); place plus 1 of whose state that was. */
    HILARE_JOURNAL_KIND_BEGAN = 1,
    /* Authority was taken in: its seq; hash of the message. */
    HILARE_JOURNAL_KIND_AUTHORITY = 2,
    /* A command was taken in: source; epoch; seq; hash of the message. */
    HILARE_JOURNAL_KIND_COMMAND = 3,
    /* A pause before the tick: whole ticks lost. */
    HILARE_JOURNAL_KIND_PAUSE = 4,
    /* A path acts from the pose of this tick on: path id; goal id; number of waypoints. */
    HILARE_JOURNAL_KIND_PATH = 5,
    /* A goal was answered, the robot being where the pose of this tick says: goal id; 1 accepted, 0
     * refused; path id; 1 if the clock or a newer goal cut the search short. */
    HILARE_JOURNAL_KIND_GOAL = 6,
    /* Parameters were changed; from this tick on what the box does it does with the new ones: number of
     * the change; number of its system file; the tick it was meant for. */
    HILARE_JOURNAL_KIND_PARAM = 7,
};

#define HILARE_GOAL_HEADER_NAME "hilare/GoalHeader/v1"

/* Header of a goal; its payload is the waypoints to follow, or the one point to go to. */
typedef struct hilare_goal_header {
    HILARE_TYPE_NAME(HILARE_GOAL_HEADER_NAME)
    /* Chosen by the sender; the answer repeats it. */
    uint64_t goal_id;
    /* A GoalKind. */
    uint64_t kind;
    /* Wanted final heading, rad; valid if has_heading is 1. */
    double heading_rad;
    /* 1 if a final heading is wanted, else 0. */
    uint64_t has_heading;
} hilare_goal_header;

static_assert(sizeof(hilare_goal_header) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_goal_header, goal_id) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_goal_header, kind) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_goal_header, heading_rad) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_goal_header, has_heading) == 24, "laid out otherwise here");

#define HILARE_WAYPOINT_NAME "hilare/Waypoint/v2"

/* A waypoint in the world frame, and how to get there from the one before. */
typedef struct hilare_waypoint {
    HILARE_TYPE_NAME(HILARE_WAYPOINT_NAME)
    /* World x, m. */
    double x_m;
    /* World y, m. */
    double y_m;
    /* Bulge of the segment that ends here (Segment): 0 a line. */
    double bulge;
    /* Crab angle on that segment, rad: direction of travel minus heading. 0 is forwards; π/2 sideways to
     * the left, which only a chassis that can move sideways does. */
    double crab_rad;
} hilare_waypoint;

static_assert(sizeof(hilare_waypoint) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_waypoint, x_m) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_waypoint, y_m) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_waypoint, bulge) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_waypoint, crab_rad) == 24, "laid out otherwise here");

#define HILARE_ANSWER_NAME "hilare/Answer/v1"

/* The planner's answer to a goal. */
typedef struct hilare_answer {
    HILARE_TYPE_NAME(HILARE_ANSWER_NAME)
    /* The goal it answers. */
    uint64_t goal_id;
    /* 1 accepted, 0 refused. */
    uint64_t accepted;
    /* Waypoints of the path that was published. */
    uint64_t waypoints;
    /* UTF-8 reason, zero-padded. */
    char text[160];
} hilare_answer;

static_assert(sizeof(hilare_answer) == 184, "laid out otherwise here");
static_assert(offsetof(hilare_answer, goal_id) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_answer, accepted) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_answer, waypoints) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_answer, text) == 24, "laid out otherwise here");

#define HILARE_PATH_HEADER_NAME "hilare/PathHeader/v1"

/* Header of a path; its payload is the waypoints, the first being where the path begins. */
typedef struct hilare_path_header {
    HILARE_TYPE_NAME(HILARE_PATH_HEADER_NAME)
    /* Counts up with every new path of a robot. */
    uint64_t path_id;
    /* The goal that asked for it; 0 for the system's own. */
    uint64_t goal_id;
} hilare_path_header;

static_assert(sizeof(hilare_path_header) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_path_header, path_id) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_path_header, goal_id) == 8, "laid out otherwise here");

#define HILARE_REFERENCE_NAME "hilare/Reference/v2"

/* What the robot should track, from the waypoint selector, once a control period. */
typedef struct hilare_reference {
    HILARE_TYPE_NAME(HILARE_REFERENCE_NAME)
    /* Tick of the pose it was chosen on. */
    uint64_t tick;
    /* A ReferenceState. */
    uint64_t state;
    /* The path it belongs to. */
    uint64_t path_id;
    /* Index of the current waypoint, k; waypoint 0 is where the path begins. */
    uint64_t index;
    /* Waypoints of the path. */
    uint64_t total;
    /* Reference speed v_r, m/s. */
    double speed_mps;
    /* Waypoint k − 1. */
    hilare_waypoint last;
    /* Waypoint k. */
    hilare_waypoint current;
    /* Valid entries of preview. */
    uint64_t preview_len;
    /* Waypoints k + 1, k + 2, … */
    hilare_waypoint preview[32];
} hilare_reference;

static_assert(sizeof(hilare_reference) == 1144, "laid out otherwise here");
static_assert(offsetof(hilare_reference, tick) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_reference, state) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_reference, path_id) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_reference, index) == 24, "laid out otherwise here");
static_assert(offsetof(hilare_reference, total) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_reference, speed_mps) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_reference, last) == 48, "laid out otherwise here");
static_assert(offsetof(hilare_reference, current) == 80, "laid out otherwise here");
static_assert(offsetof(hilare_reference, preview_len) == 112, "laid out otherwise here");
static_assert(offsetof(hilare_reference, preview) == 120, "laid out otherwise here");

#define HILARE_COMMAND_NAME "hilare/Command/v2"

/* A velocity command of one controller for one control period. */
typedef struct hilare_command {
    HILARE_TYPE_NAME(HILARE_COMMAND_NAME)
    /* Which controller. */
    uint64_t source;
    /* The authority epoch it was started under. */
    uint64_t epoch;
    /* Counts up by one a command. */
    uint64_t seq;
    /* Tick of the pose it was computed from. */
    uint64_t pose_tick;
    /* Tick from which it acts (logical execution time). */
    uint64_t effective_tick;
    /* Forward speed, m/s, before the input constraints. */
    double vx_mps;
    /* Sideways speed, m/s. */
    double vy_mps;
    /* Yaw rate, rad/s. */
    double omega_radps;
    /* A Fallback: what the law had to do without. */
    uint64_t fallback;
} hilare_command;

static_assert(sizeof(hilare_command) == 72, "laid out otherwise here");
static_assert(offsetof(hilare_command, source) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_command, epoch) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_command, seq) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_command, pose_tick) == 24, "laid out otherwise here");
static_assert(offsetof(hilare_command, effective_tick) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_command, vx_mps) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_command, vy_mps) == 48, "laid out otherwise here");
static_assert(offsetof(hilare_command, omega_radps) == 56, "laid out otherwise here");
static_assert(offsetof(hilare_command, fallback) == 64, "laid out otherwise here");

#define HILARE_AUTHORITY_NAME "hilare/Authority/v2"

/* Who may drive, from launch to the step generator; also launch's lease. A controller process is a pair
 * (source, epoch): source is its place in the system, epoch goes up with every process started, so that
 * a predecessor woken up late is not mistaken for it. */
typedef struct hilare_authority {
    HILARE_TYPE_NAME(HILARE_AUTHORITY_NAME)
    /* Counts up with every message, so that a stale one is seen. */
    uint64_t seq;
    /* A Mode. */
    uint64_t mode;
    /* Counts up whenever another controller comes into charge, here or in the step generator; who is in
     * charge is taken from the highest. */
    uint64_t term;
    /* The controller in charge; 0 is none. */
    uint64_t source;
    /* Its epoch. */
    uint64_t epoch;
    /* The standby: its command acts when that of the controller in charge is missing; 0 is none. */
    uint64_t standby_source;
    /* Its epoch. */
    uint64_t standby_epoch;
    /* The controller on trial: its commands are judged and never act; 0 is none. */
    uint64_t trial_source;
    /* Its epoch. */
    uint64_t trial_epoch;
} hilare_authority;

static_assert(sizeof(hilare_authority) == 72, "laid out otherwise here");
static_assert(offsetof(hilare_authority, seq) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_authority, mode) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_authority, term) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_authority, source) == 24, "laid out otherwise here");
static_assert(offsetof(hilare_authority, epoch) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_authority, standby_source) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_authority, standby_epoch) == 48, "laid out otherwise here");
static_assert(offsetof(hilare_authority, trial_source) == 56, "laid out otherwise here");
static_assert(offsetof(hilare_authority, trial_epoch) == 64, "laid out otherwise here");

#define HILARE_STEPS_NAME "hilare/Steps/v3"

/* State of the step generator after a tick. A drive for steppers sets DIR to dir_level, then makes a
 * pulse on STEP for each wheel whose count is not that of the message before: it differs by one. The
 * length of the pulse and the space after it are over before the next one is told; set-up and hold of
 * DIR are kept by the messages (motors.direction_*). */
typedef struct hilare_steps {
    HILARE_TYPE_NAME(HILARE_STEPS_NAME)
    /* Ticks executed; message n follows the n-th tick, message 0 precedes the first. */
    uint64_t tick;
    /* Cumulative signed steps a wheel. */
    int64_t counts[4];
    /* Level of each wheel's DIR input, 1 high, 0 low, inverted where the wiring is; 0 without steppers. */
    uint64_t dir_level[4];
    /* Commanded wheel speeds after the input constraints, rad/s. */
    double wheel_speed_radps[4];
    /* Commanded twist after the input constraints: m/s, m/s, rad/s. */
    double twist[3];
    /* A Drive: why the wheels turn as they do. */
    uint64_t drive;
    /* Controller whose command acts: the one in charge, or its standby; 0 is none. */
    uint64_t source;
    /* Term of the authority in force. */
    uint64_t term;
    /* Controller in charge; 0 is none. */
    uint64_t in_charge;
    /* Its epoch. */
    uint64_t epoch;
    /* Control cycles in a row for which the standby had a valid command in time. */
    uint64_t standby_answers;
    /* The same of the controller on trial. */
    uint64_t trial_answers;
    /* Commands that came after their effective tick. */
    uint64_t commands_late;
    /* Commands refused: invalid, of a controller that is neither in charge nor standby nor on trial,
     * old. */
    uint64_t commands_rejected;
    /* A Refusal: why the last of them was. */
    uint64_t refusal;
    /* Who the last of them says it is of. */
    uint64_t refused_source;
    /* Control cycles in which no command of their own acted. */
    uint64_t cycles_without_command;
    /* Control cycles driven by the standby's command for want of one from the controller in charge. */
    uint64_t commands_borrowed;
    /* Times the standby took charge here, after several such cycles in a row. */
    uint64_t promotions;
    /* Wake-ups a tick or more late. */
    uint64_t ticks_late;
    /* Whole ticks lost to such pauses. */
    uint64_t paused_ticks;
    /* Longest single pause, ticks. */
    uint64_t paused_max_ticks;
} hilare_steps;

static_assert(sizeof(hilare_steps) == 264, "laid out otherwise here");
static_assert(offsetof(hilare_steps, tick) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_steps, counts) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_steps, dir_level) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_steps, wheel_speed_radps) == 72, "laid out otherwise here");
static_assert(offsetof(hilare_steps, twist) == 104, "laid out otherwise here");
static_assert(offsetof(hilare_steps, drive) == 128, "laid out otherwise here");
static_assert(offsetof(hilare_steps, source) == 136, "laid out otherwise here");
static_assert(offsetof(hilare_steps, term) == 144, "laid out otherwise here");
static_assert(offsetof(hilare_steps, in_charge) == 152, "laid out otherwise here");
static_assert(offsetof(hilare_steps, epoch) == 160, "laid out otherwise here");
static_assert(offsetof(hilare_steps, standby_answers) == 168, "laid out otherwise here");
static_assert(offsetof(hilare_steps, trial_answers) == 176, "laid out otherwise here");
static_assert(offsetof(hilare_steps, commands_late) == 184, "laid out otherwise here");
static_assert(offsetof(hilare_steps, commands_rejected) == 192, "laid out otherwise here");
static_assert(offsetof(hilare_steps, refusal) == 200, "laid out otherwise here");
static_assert(offsetof(hilare_steps, refused_source) == 208, "laid out otherwise here");
static_assert(offsetof(hilare_steps, cycles_without_command) == 216, "laid out otherwise here");
static_assert(offsetof(hilare_steps, commands_borrowed) == 224, "laid out otherwise here");
static_assert(offsetof(hilare_steps, promotions) == 232, "laid out otherwise here");
static_assert(offsetof(hilare_steps, ticks_late) == 240, "laid out otherwise here");
static_assert(offsetof(hilare_steps, paused_ticks) == 248, "laid out otherwise here");
static_assert(offsetof(hilare_steps, paused_max_ticks) == 256, "laid out otherwise here");

#define HILARE_WHEELS_NAME "hilare/Wheels/v1"

/* What the robot's encoders have counted, from the plant or a drive, once a tick. */
typedef struct hilare_wheels {
    HILARE_TYPE_NAME(HILARE_WHEELS_NAME)
    /* Ticks executed when the counts were taken. */
    uint64_t tick;
    /* Cumulative signed encoder counts a wheel; zero on a robot without encoders. */
    int64_t counts[4];
} hilare_wheels;

static_assert(sizeof(hilare_wheels) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_wheels, tick) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_wheels, counts) == 8, "laid out otherwise here");

#define HILARE_POSE_FIX_NAME "hilare/PoseFix/v1"

/* The robot's pose as measured from outside (overhead camera, positioning system): late and noisy. */
typedef struct hilare_pose_fix {
    HILARE_TYPE_NAME(HILARE_POSE_FIX_NAME)
    /* Tick at which it has come through camera and processing, and is used. It is sent before the Wheels
     * of that tick. */
    uint64_t tick;
    /* Ticks executed when the picture was taken. */
    uint64_t captured_tick;
    /* World x, m. */
    double x_m;
    /* World y, m. */
    double y_m;
    /* Heading, rad, in (−π, π]. */
    double theta_rad;
} hilare_pose_fix;

static_assert(sizeof(hilare_pose_fix) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_pose_fix, tick) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_pose_fix, captured_tick) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_pose_fix, x_m) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_pose_fix, y_m) == 24, "laid out otherwise here");
static_assert(offsetof(hilare_pose_fix, theta_rad) == 32, "laid out otherwise here");

#define HILARE_POSE_NAME "hilare/Pose/v2"

/* Estimated pose of the robot. */
typedef struct hilare_pose {
    HILARE_TYPE_NAME(HILARE_POSE_NAME)
    /* Ticks executed when the pose was reckoned. */
    uint64_t tick;
    /* Ticks executed when the robot was where it says: tick, or earlier where the pose is of a picture
     * that came late and is held. */
    uint64_t measured_tick;
    /* World x, m. */
    double x_m;
    /* World y, m. */
    double y_m;
    /* Heading, rad, not wrapped. */
    double theta_rad;
} hilare_pose;

static_assert(sizeof(hilare_pose) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_pose, tick) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_pose, measured_tick) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_pose, x_m) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_pose, y_m) == 24, "laid out otherwise here");
static_assert(offsetof(hilare_pose, theta_rad) == 32, "laid out otherwise here");

#define HILARE_TRUTH_NAME "hilare/Truth/v1"

/* True pose of the simulated robot, as the overhead camera sees it; not for the control path. */
typedef struct hilare_truth {
    HILARE_TYPE_NAME(HILARE_TRUTH_NAME)
    /* Ticks executed when the pose held. */
    uint64_t tick;
    /* World x, m. */
    double x_m;
    /* World y, m. */
    double y_m;
    /* Heading, rad, not wrapped. */
    double theta_rad;
} hilare_truth;

static_assert(sizeof(hilare_truth) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_truth, tick) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_truth, x_m) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_truth, y_m) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_truth, theta_rad) == 24, "laid out otherwise here");

#define HILARE_HEALTH_NAME "hilare/Health/v3"

/* How a process fares, 20 times a second. */
typedef struct hilare_health {
    HILARE_TYPE_NAME(HILARE_HEALTH_NAME)
    /* Its slot in the system. */
    uint64_t slot;
    /* Its box: the code of a Role(crate::wires::Role). */
    uint64_t role;
    /* Its process id. */
    uint64_t pid;
    /* A HealthState. */
    uint64_t state;
    /* Newest tick it has worked on. */
    uint64_t tick;
    /* Steps taken. */
    uint64_t steps;
    /* Messages that were missing or refused at the rim. */
    uint64_t rejected;
    /* Newest path seen (planner: published); 0 before the first. */
    uint64_t path_id;
    /* UTF-8 reason, zero-padded. */
    char text[160];
} hilare_health;

static_assert(sizeof(hilare_health) == 224, "laid out otherwise here");
static_assert(offsetof(hilare_health, slot) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_health, role) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_health, pid) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_health, state) == 24, "laid out otherwise here");
static_assert(offsetof(hilare_health, tick) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_health, steps) == 40, "laid out otherwise here");
static_assert(offsetof(hilare_health, rejected) == 48, "laid out otherwise here");
static_assert(offsetof(hilare_health, path_id) == 56, "laid out otherwise here");
static_assert(offsetof(hilare_health, text) == 64, "laid out otherwise here");

#define HILARE_JOURNAL_NAME "hilare/Journal/v1"

/* What a box took from outside, and at which tick: with the wires, all a replay needs. */
typedef struct hilare_journal {
    HILARE_TYPE_NAME(HILARE_JOURNAL_NAME)
    /* Place of its process in the system. */
    uint64_t slot;
    /* Its box: 0 launch, then the workers in the diagram's order. */
    uint64_t role;
    /* Counts up by one with every entry of a place, over restarts, too. */
    uint64_t seq;
    /* Ticks the box had executed, or the tick of the pose it answered with what it took. */
    uint64_t tick;
    /* A JournalKind. */
    uint64_t kind;
    /* What was taken; which word is what, the kind says. */
    uint64_t words[6];
} hilare_journal;

static_assert(sizeof(hilare_journal) == 88, "laid out otherwise here");
static_assert(offsetof(hilare_journal, slot) == 0, "laid out otherwise here");
static_assert(offsetof(hilare_journal, role) == 8, "laid out otherwise here");
static_assert(offsetof(hilare_journal, seq) == 16, "laid out otherwise here");
static_assert(offsetof(hilare_journal, tick) == 24, "laid out otherwise here");
static_assert(offsetof(hilare_journal, kind) == 32, "laid out otherwise here");
static_assert(offsetof(hilare_journal, words) == 40, "laid out otherwise here");

#endif
