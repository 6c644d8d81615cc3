//! What the three papers print, figure by figure and table by table.
//!
//! The values are as printed, in the papers' units, with the page they stand on. What a figure only draws is
//! not in the texts we have; such a claim is [`Value::Unprinted`].

use Value::{AtMost, Between, Is, Says, Unprinted};

/// A published value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// This number.
    Is(f64),
    /// A range.
    Between(f64, f64),
    /// No more than this.
    AtMost(f64),
    /// Words.
    Says(&'static str),
    /// The paper does not print it.
    Unprinted,
}

/// One line of a figure or table.
#[derive(Clone, Copy, Debug)]
pub struct Claim {
    /// Its name within the item.
    pub key: &'static str,
    /// What it is of.
    pub what: &'static str,
    /// Unit of published and own value; empty for a pure number.
    pub unit: &'static str,
    /// Decimals it is written with.
    pub decimals: usize,
    /// What is printed.
    pub value: Value,
}

/// A figure or a table.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    /// "figure 7".
    pub name: &'static str,
    /// Page it stands on.
    pub page: &'static str,
    /// Its lines.
    pub claims: &'static [Claim],
}

/// A paper.
#[derive(Clone, Copy, Debug)]
pub struct Paper {
    /// 1, 2 or 3.
    pub number: u64,
    /// Authors, title, journal; how its pages are counted.
    pub source: &'static str,
    /// Its figures and tables, in order.
    pub items: &'static [Item],
}

const fn claim(
    key: &'static str,
    what: &'static str,
    unit: &'static str,
    decimals: usize,
    value: Value,
) -> Claim {
    Claim { key, what, unit, decimals, value }
}

/// Mathew & Hiremath 2018.
pub static PAPER_1: Paper = Paper {
    number: 1,
    source: "R. Mathew, S. S. Hiremath, *Control of Velocity-Constrained Stepper Motor-Driven Hilare Robot for \
             Waypoint Navigation*, Engineering 4 (2018) 491–499. Pages counted from the first of its Chinese edition.",
    items: &[
        Item {
            name: "table 1",
            page: "p. 6",
            claims: &[
                claim("track", "wheel track w_T", "mm", 0, Is(54.0)),
                claim("wheel", "diameter of wheel d_w", "mm", 0, Is(40.0)),
                claim("step", "step size", "mm", 2, Is(0.13)),
                claim("motor", "greatest motor speed ω1max, ω2max", "rad/s", 2, Is(3.25)),
                claim("tick", "time delay Δt", "ms", 0, Is(1.0)),
                claim("v_r", "reference linear velocity v_r", "mm/s", 0, Is(40.0)),
                claim("omega_r", "reference angular velocity ω_r", "rad/s", 0, Is(0.0)),
                claim("v_min", "least linear velocity v_min", "mm/s", 0, Is(0.0)),
                claim("omega_min", "least angular velocity ω_min", "rad/s", 0, Is(0.0)),
            ],
        },
        Item {
            name: "table 2",
            page: "p. 6",
            claims: &[
                claim("k1", "range of k1", "1/s", 0, Between(0.0, 5.0)),
                claim("k2", "range of k2", "1/mm²", 0, Between(0.0, 5.0)),
                claim("k3", "range of k3", "1/mm", 0, Between(0.0, 5.0)),
                claim("v_max", "range of v_max", "mm/s", 0, Between(40.0, 100.0)),
                claim("omega_max", "range of ω_max", "rad/s", 2, Between(0.0, 0.75)),
            ],
        },
        Item {
            name: "figure 6",
            page: "p. 6",
            claims: &[
                claim("evaluations", "evaluations of the search", "", 0, Is(20_000.0)),
                claim("front", "particles of the front", "", 0, Is(50.0)),
                claim(
                    "best_cross_track",
                    "its least cross-track error, and the velocity error there",
                    "",
                    0,
                    Unprinted,
                ),
                claim(
                    "best_speed",
                    "its least velocity error, and the cross-track error there",
                    "",
                    0,
                    Unprinted,
                ),
                claim("better", "points better than point A in both", "", 0, Unprinted),
                claim("hypervolume", "share of 6 mm × 3 mm/s it dominates", "%", 1, Unprinted),
            ],
        },
        Item {
            name: "figure 7",
            page: "p. 6–7",
            claims: &[
                claim("k1", "point A: k1", "1/s", 4, Is(0.0247)),
                claim("k2", "point A: k2", "1/mm²", 4, Is(2.9671)),
                claim("k3", "point A: k3", "1/mm", 3, Is(0.552)),
                claim("v_max", "point A: v_max", "mm/s", 0, Is(41.0)),
                claim("omega_max", "point A: ω_max", "rad/s", 3, Is(0.747)),
                claim("corners", "corners of the trapezoid", "", 0, Unprinted),
                claim("cross_track", "mean cross-track error", "mm", 2, Is(2.63)),
            ],
        },
        Item {
            name: "figure 8",
            page: "p. 7",
            claims: &[
                claim("speed", "mean linear velocity error", "mm/s", 2, Is(2.62)),
                claim("curve", "velocity over time", "", 0, Unprinted),
            ],
        },
        Item {
            name: "figure 10",
            page: "p. 8",
            claims: &[
                claim("task", "start and goal", "", 0, Says("(200, 200) → (700, 1400) mm")),
                claim("a", "(a) trajectory of the robot", "", 0, Unprinted),
                claim("b", "(b) linear velocity error over time", "", 0, Unprinted),
            ],
        },
        Item {
            name: "figure 11",
            page: "p. 8–9",
            claims: &[
                claim("task", "corners", "", 0, Says("(200, 200), (600, 200), (600, 500), (200, 500) mm")),
                claim("a", "(a) trajectory of the robot", "", 0, Unprinted),
                claim("b", "(b) linear velocity error over time", "", 0, Unprinted),
            ],
        },
        Item {
            name: "figure 12",
            page: "p. 8–9",
            claims: &[
                claim("task", "waypoints", "", 0, Says("the word “So”, clicked with the mouse")),
                claim("a", "(a) trajectory of the robot", "", 0, Unprinted),
                claim("b", "(b) linear velocity error over time", "", 0, Unprinted),
            ],
        },
        Item { name: "table 3", page: "p. 9", claims: PAPER_1_TABLE_3 },
    ],
};

const PAPER_1_TABLE_3: &[Claim] = &[
    claim("platform/waypoints", "planner's path: waypoints", "", 0, Is(28.0)),
    claim("platform/cross_track", "planner's path: mean cross-track error", "mm", 2, Is(12.88)),
    claim("platform/speed", "planner's path: mean linear velocity error", "mm/s", 2, Is(1.24)),
    claim("platform/commanded", "planner's path: commanded velocity error", "mm/s", 2, Is(1.24)),
    claim("platform/nothing", "planner's path: cross-track, nothing wrong", "mm", 2, Unprinted),
    claim("platform/slip", "planner's path: cross-track, slip alone", "mm", 2, Unprinted),
    claim("platform/wheels", "planner's path: cross-track, wheels and track alone", "mm", 2, Unprinted),
    claim("platform/start", "planner's path: cross-track, start alone", "mm", 2, Unprinted),
    claim("rectangle/waypoints", "rectangle: waypoints", "", 0, Is(4.0)),
    claim("rectangle/cross_track", "rectangle: mean cross-track error", "mm", 2, Is(6.75)),
    claim("rectangle/speed", "rectangle: mean linear velocity error", "mm/s", 2, Is(2.91)),
    claim("rectangle/commanded", "rectangle: commanded velocity error", "mm/s", 2, Is(2.91)),
    claim("rectangle/nothing", "rectangle: cross-track, nothing wrong", "mm", 2, Unprinted),
    claim("rectangle/slip", "rectangle: cross-track, slip alone", "mm", 2, Unprinted),
    claim("rectangle/wheels", "rectangle: cross-track, wheels and track alone", "mm", 2, Unprinted),
    claim("rectangle/start", "rectangle: cross-track, start alone", "mm", 2, Unprinted),
    claim("open/cross_track", "rectangle left open: mean cross-track error", "mm", 2, Is(6.75)),
    claim("open/speed", "rectangle left open: mean linear velocity error", "mm/s", 2, Is(2.91)),
    claim("so/waypoints", "cursive: waypoints", "", 0, Is(43.0)),
    claim("so/cross_track", "cursive: mean cross-track error", "mm", 2, Is(9.45)),
    claim("so/speed", "cursive: mean linear velocity error", "mm/s", 2, Is(2.46)),
    claim("so/commanded", "cursive: commanded velocity error", "mm/s", 2, Is(2.46)),
    claim("so/nothing", "cursive: cross-track, nothing wrong", "mm", 2, Unprinted),
    claim("so/slip", "cursive: cross-track, slip alone", "mm", 2, Unprinted),
    claim("so/wheels", "cursive: cross-track, wheels and track alone", "mm", 2, Unprinted),
    claim("so/start", "cursive: cross-track, start alone", "mm", 2, Unprinted),
    claim("order", "greatest to least cross-track error", "", 0, Says("planner's path, cursive, rectangle")),
];

/// The navigation circle, 2012.
pub static PAPER_2: Paper = Paper {
    number: 2,
    source: "*Research on algorithm of wheeled mobile robot's trajectory tracking*, Journal of Mechanical & Electrical \
             Engineering 29 (2012) 730–732. The text we have names no authors.",
    items: &[
        Item {
            name: "figure 4",
            page: "p. 732",
            claims: &[
                claim("turn", "turned by force at the start", "°", 0, Is(21.0)),
                claim("speed", "speed", "m/s", 1, Unprinted),
                claim("robot", "track, navigation circle, PID, sampling", "", 0, Unprinted),
                claim("travel", "way until corrected", "cm", 0, AtMost(200.0)),
                claim("steady", "distance to the line afterwards", "cm", 2, AtMost(1.0)),
                claim("curve", "the curve drawn", "", 0, Unprinted),
            ],
        },
        Item {
            name: "figure 5",
            page: "p. 732",
            claims: &[
                claim("centre", "centre of the arc", "", 0, Says("(103, 0) cm")),
                claim("radius", "radius", "cm", 0, Is(102.0)),
                claim("start", "distance to the arc at the start (0, 0)", "cm", 1, Is(1.0)),
                claim("speed", "speed", "m/s", 1, Is(1.5)),
                claim("overshoots", "overshoots", "", 0, Is(1.0)),
                claim("angle", "way round the arc until corrected", "°", 0, AtMost(60.0)),
                claim("steady", "distance to the arc afterwards", "cm", 2, AtMost(1.0)),
                claim("curve", "the curve drawn", "", 0, Unprinted),
            ],
        },
    ],
};

/// The finite-step law, 2018.
pub static PAPER_3: Paper = Paper {
    number: 3,
    source: "Qian X., Zhu L., Lou P., Zhang H., *Optimal Path Tracking Control Method of Omni-directional Mobile AGV \
             Based on Pose State*, Trans. Chinese Soc. Agric. Machinery 49(4) (2018) 20–26.",
    items: &[
        Item { name: "table 1", page: "p. 24", claims: &table_of_states(0.3) },
        Item { name: "table 2", page: "p. 24", claims: &table_of_states(0.5) },
        Item {
            name: "figure 5",
            page: "p. 24",
            claims: &[
                claim("steps", "step counts N drawn", "", 0, Unprinted),
                claim("landing_distance", "|e_d| after N steps", "mm", 6, Is(0.0)),
                claim("landing_angle", "|e_θ| after N steps", "°", 6, Is(0.0)),
                claim("overshoot", "greatest |e_d|", "", 0, Says("more steps, more overshoot")),
                claim("v_x", "greatest |v_x| of a plan", "m/s", 3, AtMost(0.5)),
                claim("accel", "greatest |a| inside a plan, as (22) counts", "m/s²", 4, AtMost(0.05)),
                claim("entry", "the same from rest into a plan", "m/s²", 2, Unprinted),
                claim("printed", "e_θ after N = 10 steps of (21) as printed", "°", 1, Is(0.0)),
            ],
        },
        Item {
            name: "figure 6",
            page: "p. 25",
            claims: &[
                claim("landing_distance", "|e_d| after N steps", "mm", 6, Is(0.0)),
                claim("landing_angle", "|e_θ| after N steps", "°", 6, Is(0.0)),
                claim("overshoot", "greatest |e_d|", "", 0, Says("more speed, more overshoot")),
                claim("v_x", "greatest |v_x| of a plan", "m/s", 3, AtMost(0.5)),
                claim("accel", "greatest |a| inside a plan, as (22) counts", "m/s²", 4, AtMost(0.05)),
                claim("entry", "the same from rest into a plan", "m/s²", 2, Unprinted),
            ],
        },
        Item {
            name: "figure 9",
            page: "p. 25",
            claims: &[
                claim("set_up", "speed and deviation at the start", "", 0, Unprinted),
                claim("low/steps", "steps until corrected, 0.3 m/s", "", 1, AtMost(10.0)),
                claim("low/distance", "distance in the ten steps after, 0.3 m/s", "mm", 2, AtMost(2.0)),
                claim("low/angle", "angle in the ten steps after, 0.3 m/s", "°", 2, AtMost(2.0)),
                claim("high/steps", "steps until corrected, 0.5 m/s", "", 1, AtMost(10.0)),
                claim("high/distance", "distance in the ten steps after, 0.5 m/s", "mm", 2, AtMost(2.0)),
                claim("high/angle", "angle in the ten steps after, 0.5 m/s", "°", 2, AtMost(2.0)),
            ],
        },
        Item { name: "table 3", page: "p. 25", claims: PAPER_3_TABLE_3 },
    ],
};

/// Tables 1 and 2 of paper 3 differ in the speed alone.
const fn table_of_states(speed_mps: f64) -> [Claim; 5] {
    [
        claim("speed", "speed along the path v_τ", "m/s", 1, Is(speed_mps)),
        claim("angle", "angle deviation e_θ(0)", "°", 0, Is(5.0)),
        claim("distance", "distance deviation e_d(0)", "m", 2, Is(0.01)),
        claim("v_x_max", "greatest sideways speed v_xmax", "m/s", 1, Is(0.5)),
        claim("a_max", "greatest acceleration a_max", "m/s²", 2, Is(0.05)),
    ]
}

const PAPER_3_TABLE_3: &[Claim] = &[
    claim("state_feedback", "state feedback: accuracy", "mm", 0, AtMost(130.0)),
    claim("variable_structure", "variable structure: time", "s", 1, Between(4.0, 5.0)),
    claim("fuzzy", "fuzzy-optimal: time", "s", 0, Is(10.0)),
    claim("pid/distance", "PID: accuracy", "mm", 2, AtMost(5.5)),
    claim("pid/time", "PID: time", "s", 2, Between(6.9, 7.8)),
    claim("pso/distance", "PSO: accuracy", "mm", 0, AtMost(3.0)),
    claim("pso/time", "PSO: time", "s", 1, Between(4.0, 6.2)),
    claim("improved_pso/distance", "improved PSO: accuracy", "mm", 0, AtMost(2.0)),
    claim("improved_pso/time", "improved PSO: time", "s", 1, Between(2.7, 4.3)),
    claim("ours/distance", "the paper's method: |e_d|", "mm", 2, AtMost(2.0)),
    claim("ours/angle", "the paper's method: |e_θ|", "°", 2, AtMost(2.0)),
    claim("ours/time", "the paper's method: time", "s", 2, Between(0.8, 1.2)),
    claim("no_slip/distance", "the paper's method, no slip: |e_d|", "mm", 2, AtMost(2.0)),
    claim("no_slip/angle", "the paper's method, no slip: |e_θ|", "°", 2, AtMost(2.0)),
    claim("no_slip/time", "the paper's method, no slip: time", "s", 2, Between(0.8, 1.2)),
];
