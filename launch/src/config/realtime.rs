//! How a process is scheduled.

use hilare_interfaces::params::{ParamKind, ParamSpec};
use hilare_interfaces::wires::Role;

/// CPU and real-time priority of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Realtime {
    /// CPU number; −1 the last one of the machine, −2 not pinned, −3 every one but the last.
    pub cpu: i64,
    /// SCHED_FIFO priority; 0 is not real-time.
    pub priority: u64,
}

const LAST_CPU: i64 = -1;
const NOT_PINNED: i64 = -2;
const ALL_BUT_LAST: i64 = -3;
const ROLES: usize = Role::WORKERS.len();

/// What a role has when its section is absent. The clock preempts all; then who is nearer to it in the
/// loop, and last the plant, which nobody waits for. All on one CPU: a hop is then a context switch, not an idle CPU's
/// wake.
const fn defaults(role: Role) -> Realtime {
    let priority = match role {
        Role::StepGenerator => 80,
        Role::PoseEstimator => 70,
        Role::WaypointSelector => 65,
        Role::Controller => 60,
        Role::Plant => 55,
        // Files and mappings keep the kernel busy where the clock cannot interrupt it.
        Role::Relay | Role::Recorder | Role::Operator => return Realtime { cpu: ALL_BUT_LAST, priority: 0 },
        Role::Planner | Role::Launch => return Realtime::UNBOUND,
    };
    Realtime { cpu: LAST_CPU, priority }
}

const fn specs_of(role: Role) -> [ParamSpec; 2] {
    let default = defaults(role);
    let cpu = ParamSpec {
        name: "cpu",
        kind: ParamKind::Integer,
        unit: "",
        default: default.cpu as f64,
        min: ALL_BUT_LAST as f64,
        max: 1023.0,
        doc: " CPU of the process; -1 the machine's last one, -2 not pinned, -3 all but the last.",
    };
    let priority = ParamSpec {
        name: "priority",
        default: default.priority as f64,
        min: 0.0,
        // 99 belongs to the kernel's own threads.
        max: 98.0,
        doc: " SCHED_FIFO priority; 0 is not real-time.",
        ..cpu
    };
    [cpu, priority]
}

static SPECS: [[ParamSpec; 2]; ROLES] = {
    let mut table = [specs_of(Role::Launch); ROLES];
    let mut i = 0;
    while i < ROLES {
        table[i] = specs_of(Role::WORKERS[i]);
        i += 1;
    }
    table
};

/// Place of a worker's role in [`Role::WORKERS`].
pub(super) fn index(role: Role) -> Option<usize> {
    Role::WORKERS.iter().position(|worker| *worker == role)
}

/// Parameters of a role's section.
pub(super) fn specs(role: Role) -> &'static [ParamSpec] {
    index(role).map_or(&[], |index| &SPECS[index])
}

impl Realtime {
    /// Neither pinned nor real-time.
    pub const UNBOUND: Self = Self { cpu: NOT_PINNED, priority: 0 };

    /// What a role has when its section is absent.
    pub const fn default_of(role: Role) -> Self {
        defaults(role)
    }
}
