//! What a law may allocate once it is under way: nothing, but for the QP law's one a solve (the
//! timers of clarabel).
#![allow(unsafe_code, reason = "a counting allocator can only be written with it")]

use hilare_controller::{LAWS, LawInputs, LawSetup, TwistLimits};
use hilare_interfaces::chassis::{Chassis, DifferentialParams, MecanumParams};
use hilare_interfaces::geometry::{BodyTwist, WorldPose};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Reference, ReferenceState, Waypoint};
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

#[test]
fn a_step_allocates_no_more_than_declared() {
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
            let mut built = (law.build)(&setup).expect("defaults build");
            for bulge in [0.0, 0.4] {
                let reference = reference(bulge);
                let mut acting = BodyTwist::ZERO;
                for step in 0..200 {
                    let pose = WorldPose::new(5e-4 * f64::from(step), 0.001, 0.1);
                    let before = COUNT.get();
                    acting = built.step(LawInputs { pose, reference: &reference, acting }).twist;
                    let allocated = COUNT.get() - before;
                    assert!(
                        allocated <= law.allocations,
                        "{}, bulge {bulge}: {allocated} at {step}",
                        law.name
                    );
                }
            }
        }
    }
}
