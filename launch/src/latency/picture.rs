//! What was measured, drawn: which part of the samples was later than a time. Both axes count in powers of
//! ten, so that the rare and late are seen as well as the usual.

use super::Measured;
use super::figures::HOP_NAMES;
use crate::report::curves::{Curve, tails_svg};
use hilare_interfaces::latency::{LatencyHistogram, upper_edge_ns};
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

/// Writes `lateness.svg`, `hops.svg` and the raw histograms into `dir`, which is there.
pub fn write_pictures(dir: &Path, measured: &Measured) -> io::Result<Vec<PathBuf>> {
    let robot = &measured.robot;
    let lateness = [("hilare", &robot.lateness), ("bare loop", &measured.bare_loop)];
    let hops = [
        ("hilare, steps to command", &robot.cycle),
        ("three bare futex hops", &measured.futex.all),
        ("three bare iceoryx2 hops", &measured.iceoryx2.all),
        ("the tick's own work", &robot.work),
    ];
    let beside = if measured.load.is_some() { "every core loaded" } else { "idle" };
    let seconds = measured.seconds;
    let files = [
        (
            "lateness.svg",
            tails_svg(&format!("Lateness of the tick, {seconds:.0} s, {beside}"), &lateness.map(curve))?,
        ),
        (
            "hops.svg",
            tails_svg(&format!("From the steps to the command, {seconds:.0} s, {beside}"), &hops.map(curve))?,
        ),
        ("histograms.csv", raw(measured)),
    ];
    files.into_iter().map(|(name, text)| crate::report::write_file(dir, name, &text)).collect()
}

fn curve<'a>((name, histogram): (&'a str, &LatencyHistogram)) -> Curve<'a> {
    let mut left = histogram.count;
    let mut points = Vec::new();
    for (index, count) in histogram.buckets.iter().enumerate().filter(|(_, count)| **count > 0) {
        points.push((upper_edge_ns(index as u64).min(histogram.max_ns) as f64 / 1e3, left as f64));
        left -= count;
    }
    points.iter_mut().for_each(|(_, left)| *left /= histogram.count as f64);
    Curve { name, points }
}

/// Every bucket that has samples: what it is of, its upper edge, its samples.
fn raw(measured: &Measured) -> String {
    let robot = &measured.robot;
    let mut named: Vec<(String, &LatencyHistogram)> = vec![
        ("tick lateness".into(), &robot.lateness),
        ("tick work".into(), &robot.work),
        ("command ready".into(), &robot.ready),
        ("bare loop lateness".into(), &measured.bare_loop),
    ];
    let chains = [
        ("hilare", robot.hops.iter().chain([&robot.cycle]).collect::<Vec<_>>()),
        ("futex", measured.futex.hops.iter().chain([&measured.futex.all]).collect()),
        ("iceoryx2", measured.iceoryx2.hops.iter().chain([&measured.iceoryx2.all]).collect()),
    ];
    for (kind, hops) in chains {
        named.extend(HOP_NAMES.iter().zip(hops).map(|(hop, histogram)| (format!("{kind} {hop}"), histogram)));
    }
    let mut text = String::from("what,up_to_us,samples\n");
    for (name, histogram) in named {
        for (index, count) in histogram.buckets.iter().enumerate().filter(|(_, count)| **count > 0) {
            let _ = writeln!(text, "{name},{},{count}", upper_edge_ns(index as u64) as f64 / 1e3);
        }
        let _ = writeln!(text, "{name} max,{},1", histogram.max_ns as f64 / 1e3);
    }
    text
}
