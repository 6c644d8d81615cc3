//! A robot for Prometheus: <https://prometheus.io/docs/instrumenting/exposition_formats>, and OpenMetrics 1.0.

mod text;

use crate::robot::{Measured, Process, Robot};
use hilare_interfaces::latency::LatencyHistogram;
pub use text::Format;
use text::{Kind, Labels, Text};

/// Modes of a robot, as `hilare status` has them; one of them is in force.
const MODES: [&str; 5] = ["starting", "disarmed", "armed", "stop", "e-stop"];

/// Everything there is to know of a robot, as text.
pub fn render(robot: &Robot, format: Format) -> String {
    let mut text = Text::new(format);
    about(robot, &mut text);
    ticks(robot, &mut text);
    drive(robot, &mut text);
    processes(robot, &mut text);
    text.family(
        "hilare_wire_messages",
        Kind::Counter,
        "Messages that came over a wire since the page looks.",
    );
    for (wire, messages) in &robot.wires {
        text.sample(&[("wire", wire)], *messages as f64);
    }
    text.end()
}

fn about(robot: &Robot, text: &mut Text) {
    let labels: &Labels<'_> = &[("robot", &robot.name), ("version", &robot.version), ("clock", &robot.clock)];
    text.single(
        "hilare_build_info",
        Kind::Gauge,
        "Robot, version of hilare, what drives the ticks; always 1.",
        labels,
        1.0,
    );
    text.single(
        "hilare_uptime_seconds",
        Kind::Gauge,
        "Time since the robot was launched.",
        &[],
        robot.uptime_s,
    );
    text.family("hilare_mode", Kind::Gauge, "What the operator wants: 1 for the mode in force.");
    for mode in MODES {
        text.sample(&[("mode", mode)], flag(robot.mode == mode));
    }
    let fault = "1 if the robot cannot go on, or not before it is armed again.";
    text.single("hilare_fault", Kind::Gauge, fault, &[], flag(robot.fault));
}

fn ticks(robot: &Robot, text: &mut Text) {
    for (name, help, count) in [
        ("hilare_ticks", "Ticks executed, of 1 ms.", robot.tick),
        ("hilare_ticks_late", "Wake-ups of the clock a tick or more late.", robot.ticks_late),
        ("hilare_paused_ticks", "Whole ticks lost to such pauses.", robot.paused_ticks),
        ("hilare_commands_late", "Commands that came after the tick they were for.", robot.commands_late),
        (
            "hilare_commands_rejected",
            "Commands refused: invalid, old, of nobody who may drive.",
            robot.commands_rejected,
        ),
        ("hilare_commands_missing", "Control cycles without a command.", robot.cycles_without_command),
        (
            "hilare_commands_borrowed",
            "Control cycles driven by the standby's command.",
            robot.commands_borrowed,
        ),
        ("hilare_promotions", "Times the standby took charge.", robot.promotions),
        ("hilare_swaps", "Controllers and boxes swapped.", robot.swaps),
    ] {
        text.single(name, Kind::Counter, help, &[], count as f64);
    }
}

fn drive(robot: &Robot, text: &mut Text) {
    let tracking = |state: &str| flag(robot.path_state == state);
    text.single(
        "hilare_path_tracking",
        Kind::Gauge,
        "1 while a path is followed.",
        &[],
        tracking("tracking"),
    );
    text.single(
        "hilare_path_arrived",
        Kind::Gauge,
        "1 when its last waypoint is accepted.",
        &[],
        tracking("arrived"),
    );
    text.single(
        "hilare_waypoint_index",
        Kind::Gauge,
        "Current waypoint; 0 is where the path begins.",
        &[],
        robot.waypoint as f64,
    );
    text.single(
        "hilare_waypoints",
        Kind::Gauge,
        "Waypoints of the path, the start (waypoint 0) included.",
        &[],
        robot.waypoints as f64,
    );
    text.single("hilare_speed_meters_per_second", Kind::Gauge, "Commanded speed.", &[], robot.speed_mps);
    text.single(
        "hilare_yaw_rate_radians_per_second",
        Kind::Gauge,
        "Commanded yaw rate.",
        &[],
        robot.omega_radps,
    );
    let poses = [("estimate", robot.pose), ("truth", robot.truth)];
    let known = || poses.iter().filter_map(|(of, pose)| Some((*of, (*pose)?)));
    text.family("hilare_position_meters", Kind::Gauge, "Position in the world frame, estimated and true.");
    for (of, [x, y, _]) in known() {
        text.sample(&[("of", of), ("axis", "x")], x);
        text.sample(&[("of", of), ("axis", "y")], y);
    }
    text.family("hilare_heading_radians", Kind::Gauge, "Heading in the world frame, estimated and true.");
    for (of, [_, _, theta]) in known() {
        text.sample(&[("of", of)], theta);
    }
    let help = "Distance from the line or arc under way, positive to the left.";
    text.family("hilare_cross_track_meters", Kind::Gauge, help);
    for (of, aside) in [("estimate", robot.cross_track_m), ("truth", robot.cross_track_truth_m)] {
        if let Some(aside) = aside {
            text.sample(&[("of", of)], aside);
        }
    }
}

/// A family with a sample a process.
type Family = (&'static str, Kind, &'static str, fn(&Process) -> Option<f64>);

const PROCESSES: [Family; 9] = [
    ("hilare_process_up", Kind::Gauge, "1 while it runs.", |one| Some(flag(one.pid != 0))),
    ("hilare_process_in_charge", Kind::Gauge, "1 for the controller that drives.", |one| {
        one.law.is_some().then_some(flag(one.in_charge))
    }),
    ("hilare_process_restarts", Kind::Counter, "Times it was started again.", |one| {
        one.slot.map(|_| one.restarts as f64)
    }),
    (
        "hilare_process_messages_lost",
        Kind::Counter,
        "Messages missing or refused at its rim; of relay and recorder, lost ones.",
        |one| one.slot.map(|_| one.rejected as f64),
    ),
    (
        "hilare_process_over_budget",
        Kind::Counter,
        "Steps that took longer than a tenth of their period.",
        |one| one.slot.map(|_| one.over_budget as f64),
    ),
    ("hilare_process_page_faults", Kind::Counter, "Pages that were not in memory.", |one| {
        one.slot.map(|_| one.page_faults as f64)
    }),
    (
        "hilare_process_preemptions",
        Kind::Counter,
        "Times something else took the processor from it.",
        |one| one.slot.map(|_| one.involuntary_switches as f64),
    ),
    ("hilare_process_cpu_seconds", Kind::Counter, "Processor time.", |one| one.cpu_s),
    (
        "hilare_process_resident_memory_bytes",
        Kind::Gauge,
        "Memory resident, shared memory included.",
        |one| one.resident_bytes.map(|bytes| bytes as f64),
    ),
];

/// A histogram of every process that measures.
type Histogram = (&'static str, &'static str, fn(&Measured) -> &LatencyHistogram);

const HISTOGRAMS: [Histogram; 3] = [
    (
        "hilare_lateness_seconds",
        "Of step_generator, how late the clock woke; of others, how long messages were on their way to them; a plant that nobody waits for looks every 4 ms, 2 ms late in the mean.",
        |measured| &measured.lateness,
    ),
    ("hilare_step_seconds", "From waking to having told everything.", |measured| &measured.step),
    (
        "hilare_age_seconds",
        "Age of the steps an answer is based on; of step_generator, how long commands were ready before it took them in.",
        |measured| &measured.age,
    ),
];

fn processes(robot: &Robot, text: &mut Text) {
    fn labels<'p>(process: &'p Process, slot: &'p str) -> Vec<(&'static str, &'p str)> {
        let law = process.law.as_deref().map(|law| ("law", law));
        let slot = process.slot.map(|_| ("slot", slot));
        std::iter::once(("role", &*process.role)).chain(slot).chain(law).collect()
    }
    let slots: Vec<String> =
        robot.processes.iter().map(|one| one.slot.map_or(String::new(), |slot| slot.to_string())).collect();
    let all = || robot.processes.iter().zip(&slots);
    for (name, kind, help, value) in PROCESSES {
        text.family(name, kind, help);
        for (process, slot) in all() {
            if let Some(value) = value(process) {
                text.sample(&labels(process, slot), value);
            }
        }
    }
    text.family("hilare_process_info", Kind::Gauge, "Pid and state of a process; always 1.");
    for (process, slot) in all() {
        let pid = process.pid.to_string();
        text.sample(&[&labels(process, slot)[..], &[("pid", &pid), ("state", &process.state)]].concat(), 1.0);
    }
    for (name, help, of) in HISTOGRAMS {
        text.family(
            name,
            Kind::Histogram,
            &format!("{help} Sums are reckoned from buckets, within a sixteenth."),
        );
        for (process, slot) in all() {
            let Some(measured) = &process.measured else { continue };
            text.histogram(&labels(process, slot), of(measured));
        }
    }
}

fn flag(on: bool) -> f64 {
    f64::from(u8::from(on))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn robot() -> Robot {
        let mut lateness = LatencyHistogram::ZERO;
        [500, 1500, 3_000_000].into_iter().for_each(|ns| lateness.record(ns));
        let measured = Measured { lateness, ..Measured::default() };
        let clock = Process {
            slot: Some(7),
            role: "step_generator".to_owned(),
            pid: 77,
            state: "running".to_owned(),
            restarts: 2,
            measured: Some(Box::new(measured)),
            ..Process::default()
        };
        let launch = Process { role: "launch".to_owned(), pid: 70, cpu_s: Some(1.25), ..Process::default() };
        Robot {
            name: "mu\"le\\\n".to_owned(),
            mode: "armed".to_owned(),
            tick: 1_000_000,
            pose: Some([0.5, f64::NAN, f64::NEG_INFINITY]),
            cross_track_m: Some(-0.003),
            processes: vec![launch, clock],
            wires: vec![("pose".to_owned(), 5)],
            ..Robot::default()
        }
    }

    #[test]
    fn families_have_their_lines_in_the_order_prometheus_wants() {
        let text = render(&robot(), Format::Prometheus);
        for lines in [
            "# HELP hilare_ticks_total Ticks executed, of 1 ms.\n# TYPE hilare_ticks_total counter\nhilare_ticks_total 1000000\n",
            "hilare_build_info{robot=\"mu\\\"le\\\\\\n\",version=\"\",clock=\"\"} 1\n",
            "hilare_mode{mode=\"armed\"} 1\n",
            "hilare_mode{mode=\"stop\"} 0\n",
            "hilare_position_meters{of=\"estimate\",axis=\"y\"} NaN\n",
            "hilare_heading_radians{of=\"estimate\"} -Inf\n",
            "hilare_cross_track_meters{of=\"estimate\"} -0.003\n",
            "hilare_process_cpu_seconds_total{role=\"launch\"} 1.25\n",
            "hilare_process_restarts_total{role=\"step_generator\",slot=\"7\"} 2\n",
            "# TYPE hilare_lateness_seconds histogram\n",
            "hilare_lateness_seconds_bucket{role=\"step_generator\",slot=\"7\",le=\"0.000001024\"} 1\n",
            "hilare_lateness_seconds_bucket{role=\"step_generator\",slot=\"7\",le=\"0.000002048\"} 2\n",
            "hilare_lateness_seconds_bucket{role=\"step_generator\",slot=\"7\",le=\"0.134217728\"} 3\n",
            "hilare_lateness_seconds_bucket{role=\"step_generator\",slot=\"7\",le=\"+Inf\"} 3\n",
            "hilare_lateness_seconds_count{role=\"step_generator\",slot=\"7\"} 3\n",
            "hilare_wire_messages_total{wire=\"pose\"} 5\n",
        ] {
            assert!(text.contains(lines), "{lines:?} is not in\n{text}");
        }
        assert!(!text.contains("of=\"truth\"") && !text.contains("# EOF"), "{text}");
    }

    #[test]
    fn open_metrics_names_families_without_total_and_ends() {
        let text = render(&robot(), Format::OpenMetrics);
        assert!(
            text.contains("# TYPE hilare_ticks counter\n") && text.contains("\nhilare_ticks_total 1000000\n")
        );
        assert!(text.ends_with("\n# EOF\n"), "{text}");
    }

    #[test]
    fn a_sum_is_within_a_sixteenth_of_the_truth() {
        let text = render(&robot(), Format::Prometheus);
        let sum = text.lines().find_map(|line| {
            line.strip_prefix("hilare_lateness_seconds_sum{role=\"step_generator\",slot=\"7\"} ")
        });
        let sum: f64 = sum.expect("a sum").parse().expect("a number");
        assert!((sum / 3.002e-3 - 1.0).abs() < 1.0 / 16.0, "{sum}");
    }

    proptest! {
        #[test]
        fn every_line_is_a_sample_or_a_comment_whatever_the_words(words in ".{0,40}", number: f64) {
            let mut robot = robot();
            robot.name = words.clone();
            robot.processes[1].law = Some(words.clone());
            robot.processes[0].state = words;
            robot.speed_mps = number;
            for line in render(&robot, Format::Prometheus).lines() {
                let ended = line.starts_with("# ") || line.rsplit_once(' ').is_some_and(|(_, value)| {
                    ["NaN", "+Inf", "-Inf"].contains(&value) || value.parse::<f64>().is_ok()
                });
                prop_assert!(line.starts_with("# ") || line.starts_with("hilare_"), "{line:?}");
                prop_assert!(ended, "{line:?}");
            }
        }
    }
}
