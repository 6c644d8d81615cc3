//! A step of an estimator allocates nothing, whatever comes; nor does saving or loading its state.
#![allow(unsafe_code, reason = "a counting allocator can only be written with it")]

mod support;

use hilare_interfaces::block::Block;
use hilare_interfaces::state::{STATE_WORDS, Stateful};
use hilare_pose_estimator::ekf::params::EkfParams;
use hilare_pose_estimator::{EstimatorInputs, EstimatorKind, PoseEstimator};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use support::{Camera, Noise, Robot, Wrong, differential};

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

#[test]
fn neither_a_step_nor_saving_nor_loading_allocates() {
    // Short, so that the history runs over whenever the robot is carried away.
    let setup = differential(EkfParams { history_ticks: 80, ..EkfParams::default() });
    for kind in EstimatorKind::ALL {
        let mut robot = Robot::new(&setup, Wrong::default(), Noise::new(1));
        let mut camera = Camera::usual(Noise::new(2));
        let mut estimator = PoseEstimator::new(kind, setup);
        let (mut successor, mut room) = (PoseEstimator::new(kind, setup), [0; STATE_WORDS]);
        for tick in 1..20_000 {
            robot.turn([1, (tick % 3 == 0).into(), 0, 0]);
            if tick % 5000 == 0 {
                robot.pose.x_m += 1.0;
            }
            let fix = camera.watch(tick, robot.pose).filter(|fix| fix.captured_tick % 3000 < 2000);
            let before = COUNT.get();
            estimator.step(tick, EstimatorInputs { counts: &robot.counts, fixes: fix.as_slice() });
            let words = estimator.save_state(&mut room).expect("room");
            assert!(successor.load_state(&room[..words]), "{} at tick {tick}", kind.name());
            assert_eq!(COUNT.get() - before, 0, "{} at tick {tick}", kind.name());
        }
        if let Some(fixes) = estimator.fixes() {
            assert!(fixes.restarts >= 3, "{fixes:?}");
        }
    }
}
