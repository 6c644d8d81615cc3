//! The fault table in virtual time: every row with many seeds, its bound in ticks executed.
//!
//!     cargo test --test faults_virtual                                        a minute
//!     HILARE_FAULT_SEEDS=1000 cargo test --release --test faults_virtual      as at night

#[path = "../faults/mod.rs"]
mod faults;
#[path = "../support/mod.rs"]
mod support;

mod boxes;
mod commands;
mod controllers;
mod library;
mod robot;

use faults::launch::Policy;
use faults::plan::{Fault, Plan};
use faults::rig::{Rig, Setup};
use hilare::config::System;
use hilare::shell::ClockKind;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::messages::Waypoint;
use hilare_recorder::statistics::RunFigures;
use support::random::Random;

/// How launch is, where nothing else is said: it sees a death at once and needs 20 ticks to start a successor.
const POLICY: Policy = Policy { notice_ticks: 1, respawn_ticks: Some(20), liveness_ticks: 150 };

/// Longest that a run without faults takes.
const TICKS: u64 = 6000;

/// Rim travel of a step of the e-puck.
const STEP_M: f64 = 0.000_13;

/// Short ways with corners to the left and right, from the origin along x.
const PATHS: [&[(f64, f64)]; 4] = [
    &[(0.0, 0.0), (0.08, 0.0), (0.08, 0.06)],
    &[(0.0, 0.0), (0.06, 0.0), (0.10, -0.05)],
    &[(0.0, 0.0), (0.05, 0.02), (0.10, -0.02)],
    &[(0.0, 0.0), (0.07, 0.05)],
];

/// What the drivers of a robot ask for: no pulse sooner than at top speed, and time for DIR.
const DRIVERS: [&str; 6] = [
    "motors.pulse_length_s=0.0011",
    "motors.pulse_space_s=0.0008",
    "motors.tick_jitter_s=0.0001",
    "motors.direction_setup_s=0.0092",
    "motors.direction_hold_s=0.0115",
    "motors.invert_left=true",
];

/// The e-puck with a law; `bounded`: its accelerations are, and its drivers slow.
fn robot(law: &str, bounded: bool) -> System {
    let mut system = System::load("epuck").expect("built in");
    let mut keys = vec![format!("controller.law={law}")];
    if bounded {
        keys.extend(["limits.accel_mps2=0.8", "limits.accel_radps2=12"].map(str::to_owned));
        keys.extend(DRIVERS.map(str::to_owned));
    }
    system.set_all(&keys).expect("known keys");
    system
}

/// A robot on one of the short ways.
fn setup(random: &mut Random, law: &str, standby: Option<&str>) -> Setup {
    let bounded = random.chance(0.5);
    let path = random.pick(&PATHS);
    Setup {
        system: robot(law, bounded),
        standby: standby.map(|law| robot(law, bounded)),
        path: path.iter().map(|(x_m, y_m)| Waypoint::straight(*x_m, *y_m)).collect(),
        policy: POLICY,
        goal: None,
        clock: ClockKind::Real,
    }
}

/// The figures of a run without faults.
fn undisturbed(setup: &Setup) -> RunFigures {
    let mut rig = Rig::new(setup, &Plan::NONE, 0);
    assert!(rig.run(TICKS), "it does not arrive without any fault");
    rig.statistics().figures()
}

/// The bits of the run are those of one without faults.
#[track_caller]
fn same_bits(rig: &Rig, without: &RunFigures) {
    let figures = rig.statistics().figures();
    let of = |figures: &RunFigures| (figures.reached, figures.ticks, figures.steps, figures.state_hash);
    assert_eq!(of(&figures), of(without), "not the bits of a run without faults");
}

/// A tick at which the robot is under way on any of the short ways, and has been for a while.
fn under_way(random: &mut Random) -> u64 {
    random.whole(30, 1200)
}

/// The end of a process: between two steps, or amid one.
fn kill(random: &mut Random) -> Fault {
    random.pick(&[Fault::Kill, Fault::KillAmid])
}

/// [MH18] (9)–(24) once more, from the paper.
fn constrained(system: &System, commanded: BodyTwist) -> BodyTwist {
    let Chassis::Differential(wheels) = system.chassis else { panic!("an e-puck") };
    let v = commanded.vx_mps.clamp(system.limits.v_min_mps, system.limits.v_max_mps);
    let omega = commanded.omega_radps.clamp(-system.limits.omega_max_radps, system.limits.omega_max_radps);
    let rim = wheels.wheel_speed_max_right_radps * wheels.wheel_diameter_m / 2.0;
    let fastest = v.abs() + omega.abs() * wheels.track_m / 2.0;
    BodyTwist::new(v, 0.0, omega).scaled((rim / fastest).min(1.0))
}
