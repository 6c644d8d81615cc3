//! A load on every processor: the tick is as punctual as a bare timer loop, and the bits are the same.

use super::controllers::CORNERS;
use crate::faults::drive::{Drive, simulated, unless_spoilt};
use crate::faults::host::HostWatch;
use crate::faults::seeds;
use crate::support::load::Load;
use crate::support::{Lab, number, whole_machine};
use hilare::config::System;
use hilare::shell::realtime::CpuChoice;
use hilare_interfaces::wires::Role;
use serde_json::Value;

/// How late wake-ups were, µs: half of them at most, 99 of 100, 999 of 1000, all.
type Lateness = [f64; 4];

fn of_the_clock(summary: &Value) -> Lateness {
    ["p50", "p99", "p99_9", "max"].map(|key| number(&summary["lateness_us"], key))
}

fn of_the_bare_loop(sorted_ns: &[u64]) -> Lateness {
    let last = sorted_ns.len() - 1;
    [0.5, 0.99, 0.999, 1.0].map(|share| sorted_ns[(last as f64 * share).round() as usize] as f64 * 1e-3)
}

#[test]
fn beside_a_load_the_tick_is_as_punctual_as_a_bare_loop() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy()];
    let expected = simulated(&lab, &job);
    let clock = System::load("epuck").expect("built in").realtime(Role::StepGenerator);
    seeds::each_real("both cores loaded", 1..=10, |draw, figures| {
        let (told, bare) = unless_spoilt(figures, |attempt| {
            let _load = Load::start();
            // It wakes up on the same processor, with the same priority.
            let bare = HostWatch::start_on([CpuChoice::from_key(clock.cpu)], clock.priority);
            let robot = Drive::start(&lab, &format!("b{}x{attempt}", draw.seed()), &job, &[]);
            let told = robot.end(0).no_cycle_lost()?.same_bits(&expected)?;
            Ok((told, of_the_bare_loop(&bare.lateness_ns())))
        });
        assert_eq!(told.summary["reached"], true);
        let own = of_the_clock(&told.summary);
        println!("lateness, µs, p50 p99 p99.9 max: {own:?}, of a bare loop {bare:?}");
        let (paused, bare_ms) = (number(&told.summary, "paused_max_ticks"), bare[3] * 1e-3);
        assert!(
            paused <= bare_ms.floor() + 1.0,
            "{paused} ticks; the bare loop {bare_ms} ms: {}",
            told.summary
        );
        let ticks = number(&told.summary, "ticks");
        figures.sum("{} ticks, same bits, 0 cycles lost", ticks);
        let [p50, p99, p99_9, max] = own;
        figures.most("lateness p50 ≤ {} µs", p50);
        figures.most("p99 ≤ {} µs", p99);
        figures.most("p99.9 ≤ {} µs", p99_9);
        figures.most("max {} µs", max);
        let [p50, p99, p99_9, max] = bare;
        figures.most("of a bare loop in the same run p50 ≤ {} µs", p50);
        figures.most("of the bare loop p99 ≤ {} µs", p99);
        figures.most("of the bare loop p99.9 ≤ {} µs", p99_9);
        figures.most("of the bare loop max {} µs", max);
        figures.most("ratio p99 ≤ {}", own[1] / bare[1]);
    });
    lab.assert_nothing_left("drives beside a load");
}
