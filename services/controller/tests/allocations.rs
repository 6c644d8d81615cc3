//! What a law may allocate once it is under way: nothing, but for the QP law's one a solve (the
//! timers of clarabel). Saving its state takes none, nor does loading it.
#![allow(unsafe_code, reason = "a counting allocator can only be written with it")]

use hilare_controller::prediction::{Prediction, PredictionParams};
use hilare_controller::{
    Controller, ControllerInputs, Identity, LAWS, LawInputs, LawSetup, LawSpec, TwistLimits,
};
use hilare_interfaces::block::Block;
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::{BodyTwist, WorldPose};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Pose, Reference, ReferenceState, Waypoint};
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A path with a corner, or one that goes on in arcs of both senses.
fn reference(bulge: f64) -> Reference {
    let mut reference = Reference {
        state: ReferenceState::Tracking.code(),
        index: 1,
        total: 4,
        speed_mps: 0.04,
        current: Waypoint { bulge, ..Waypoint::straight(0.1, 0.0) },
        preview_len: 2,
        ..Reference::ZERO
    };
    reference.preview[0] = Waypoint::straight(0.1, 0.3);
    reference.preview[1] = Waypoint { bulge: -bulge, ..Waypoint::straight(0.2, 0.2) };
    reference
}

/// Every law on every chassis it allows.
fn for_every_law(mut look: impl FnMut(&str, &LawSetup<'_>, &LawSpec)) {
    let every_chassis =
        [Chassis::Differential(DifferentialParams::default()), Chassis::Mecanum(MecanumParams::default())];
    for chassis in &every_chassis {
        for law in LAWS.iter().filter(|law| law.chassis.contains(&chassis.name())) {
            let setup = LawSetup {
                chassis,
                limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 0.041, omega_max_radps: 0.747 },
                acceptance_radius_m: 0.027,
                acceptance: law.acceptance,
                period_ticks: 5,
                values: &[],
            };
            look(&format!("{} on {}", law.name, chassis.name()), &setup, law);
        }
    }
}

fn pose_at(step: u32) -> WorldPose {
    WorldPose::new(5e-4 * f64::from(step), 0.001, 0.1)
}

#[test]
fn a_step_allocates_no_more_than_declared() {
    for_every_law(|name, setup, law| {
        let mut built = (law.build)(setup).expect("defaults build");
        for bulge in [0.0, 0.4] {
            let reference = reference(bulge);
            let mut acting = BodyTwist::ZERO;
            for step in 0..200 {
                let inputs = LawInputs { pose: pose_at(step), reference: &reference, acting };
                let before = COUNT.get();
                acting = built.step(inputs).twist;
                let allocated = COUNT.get() - before;
                assert!(allocated <= law.allocations, "{name}, bulge {bulge}: {allocated} at {step}");
            }
        }
    });
}

#[test]
fn saving_and_loading_a_state_allocates_nothing() {
    for_every_law(|name, setup, law| {
        let controller = || {
            let built = (law.build)(setup).expect("defaults build");
            let prediction = Prediction::new(PredictionParams::default(), setup);
            Controller::new(built, Identity { source: 1, epoch: 1 }, setup.period_ticks, prediction)
        };
        let (mut saved, mut loaded, mut room) = (controller(), controller(), [0; STATE_WORDS]);
        for step in 0..50 {
            let pose = Pose::at(5 * u64::from(step), pose_at(step));
            saved.step(pose.tick, ControllerInputs { reference: &reference(0.4), pose: &pose });
            let before = COUNT.get();
            let words = saved.save_state(&mut room).expect("room");
            assert!(loaded.load_state(&room[..words]), "{name}");
            assert_eq!(COUNT.get() - before, 0, "{name} at {step}");
        }
    });
}
