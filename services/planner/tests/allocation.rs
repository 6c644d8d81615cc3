//! Memory: repeated queries allocate nothing, and loading a map peaks below twice its grid.
#![allow(unsafe_code, reason = "a counting allocator cannot be written without")]
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have files, clocks, output and an environment"
)]

use hilare_planner::map::{MapFrame, Unknown};
use hilare_planner::{ClearanceField, LoadOptions, Map, Plan, Planner, PlannerParams, Unlimited, WorldPoint};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
    static LIVE: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

struct Counting;

fn note(bytes: isize) {
    let live = LIVE.get() + bytes;
    LIVE.set(live);
    PEAK.set(PEAK.get().max(live));
    COUNT.set(COUNT.get() + usize::from(bytes > 0));
}

// SAFETY: every call is passed on unchanged to the system's allocator; the counters do not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note(layout.size() as isize);
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        note(-(layout.size() as isize));
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Rooms of 20 cells with doors two cells wide.
fn rooms() -> Map {
    let width = 201;
    let door = |at: usize| (8..10).contains(&(at % 20));
    let cell = |i: usize, j: usize| i.is_multiple_of(20) && !door(j) || j.is_multiple_of(20) && !door(i);
    let cells = (0..width * width).map(|c| if cell(c % width, c / width) { 100 } else { 0 }).collect();
    let frame = MapFrame::new("map", WorldPoint::default(), 0.0, 0.1, width, width).unwrap();
    Map::from_cells(frame, cells, Unknown::Blocked).unwrap()
}

#[test]
fn repeated_queries_do_not_allocate() {
    let map = rooms();
    let params = PlannerParams { radius_m: 0.06, spacing_m: 0.2, ..Default::default() };
    let mut planner = Planner::new(ClearanceField::new(&map), params);
    let mut plan = Plan::default();
    let room = |n: usize| map.frame().cell_centre(10 + 20 * (n % 10), 10 + 20 * (n / 10 % 10));
    let mut all = |planner: &mut Planner| {
        (0..100)
            .filter(|&n| planner.plan_into(room(n), room(n * 37 + 5), &mut Unlimited, &mut plan).is_ok())
            .count()
    };
    assert_eq!(all(&mut planner), 100);
    let before = COUNT.get();
    assert_eq!(all(&mut planner), 100);
    assert_eq!(COUNT.get() - before, 0, "allocations in 100 repeated queries");
}

fn peak_of(load: impl FnOnce() -> Map) -> (usize, Map) {
    let before = LIVE.get();
    PEAK.set(before);
    let map = load();
    ((PEAK.get() - before) as usize, map)
}

#[test]
fn loading_peaks_below_twice_the_grid() {
    const SIDE: usize = 1500;
    const YAML: &[u8] = b"image: x\nresolution: 0.05\norigin: [0, 0, 0]\n";
    let options = LoadOptions::default();
    let mut binary = format!("P5 {SIDE} {SIDE} 255 ").into_bytes();
    binary.extend((0..SIDE * SIDE).map(|i| (i * 7) as u8));
    let deep = {
        let mut image = format!("P5 {SIDE} {SIDE} 65535 ").into_bytes();
        image.extend((0..2 * SIDE * SIDE).map(|i| (i * 7) as u8));
        image
    };
    let text = format!("P2 {SIDE} {SIDE} 255\n{}", "254 ".repeat(SIDE * SIDE)).into_bytes();
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, SIDE as u32, SIDE as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&vec![200; 4 * SIDE * SIDE]).unwrap();
    for image in [binary, deep, text, png] {
        let (peak, _) = peak_of(|| Map::from_ros_bytes(YAML, &image, &options).unwrap());
        assert!(peak < 2 * SIDE * SIDE, "{peak} bytes for {} cells", SIDE * SIDE);
    }
    let tiles =
        format!("type octile\nheight {SIDE}\nwidth {SIDE}\nmap\n{}", (".".repeat(SIDE) + "\n").repeat(SIDE));
    let (peak, _) = peak_of(|| Map::from_bytes("a.map", tiles.as_bytes(), &options).unwrap());
    assert!(peak < 2 * SIDE * SIDE, "{peak}");
    // a header that lies about the body costs nothing
    let bomb = b"P5 11000 11000 255 short";
    let before = LIVE.get();
    PEAK.set(before);
    assert!(Map::from_ros_bytes(YAML, bomb, &options).is_err());
    assert!(PEAK.get() - before < 1 << 20);
}
