//! What was measured, in figures: JSON for scripts, a table for people.

use super::{Cyclictest, Measured, Suffering};
use crate::manager::{Cause, Counts, LateTick};
use hilare_interfaces::latency::LatencyHistogram;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Names of the hops, and of all of them.
pub(super) const HOP_NAMES: [&str; 4] =
    ["steps->pose", "pose->reference", "reference->command", "steps->command"];

/// Quantiles, µs; or ratios of quantiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Micros {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p99_9: f64,
    /// Largest.
    pub max: f64,
}

impl Micros {
    fn of(histogram: &LatencyHistogram) -> Self {
        let of = histogram.quantiles();
        Self { p50: of.p50_us, p99: of.p99_us, p99_9: of.p99_9_us, max: of.max_us }
    }

    fn over(self, other: Self) -> Self {
        // Nothing measured is no ratio, and no number in JSON.
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        Self {
            p50: ratio(self.p50, other.p50),
            p99: ratio(self.p99, other.p99),
            p99_9: ratio(self.p99_9, other.p99_9),
            max: ratio(self.max, other.max),
        }
    }

    fn row(self, decimals: usize) -> String {
        [self.p50, self.p99, self.p99_9, self.max]
            .iter()
            .map(|value| format!("{value:>10.decimals$}"))
            .collect()
    }
}

/// Lateness of the tick.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tick {
    /// The robot's clock.
    pub ours: Micros,
    /// A bare loop on the same processor with the same priority.
    pub bare_loop: Micros,
    /// The one over the other.
    pub ratio: Micros,
    /// cyclictest's, where it is installed; whole microseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cyclictest: Option<Micros>,
}

/// How long a message is on its way.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hop {
    /// From where to where; the last one is all of them, with what the boxes compute.
    pub name: &'static str,
    /// The robot's.
    pub ours: Micros,
    /// As many bare futex hops on the same processors.
    pub futex: Micros,
    /// As many bare iceoryx2 hops.
    pub iceoryx2: Micros,
    /// Ours over futex.
    pub ratio: Micros,
    /// Ours over iceoryx2.
    pub ratio_iceoryx2: Micros,
}

/// What kept a process from its work.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Process {
    /// Its box.
    pub name: &'static str,
    /// Over-budget steps, page faults, involuntary switches.
    #[serde(flatten)]
    pub counts: Counts,
}

/// What looking costs the tick.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Watched {
    /// Processes that observed, by turns.
    pub observers: usize,
    /// They were visitors of the page, and what they read is counted in kilobytes.
    pub visitors: bool,
    /// How often one of them joined.
    pub joins: u64,
    /// Messages they read.
    pub messages: u64,
    /// Lateness of the tick.
    pub tick: ByTurns,
    /// Lateness of the bare loop, which observers can only reach by the processor.
    pub bare_loop: ByTurns,
    /// From the tick's waking until it has told everybody.
    pub work: ByTurns,
    /// From the steps until the command they lead to is out.
    pub steps_to_command: ByTurns,
}

/// The same without and with observers, by turns in one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ByTurns {
    /// Nobody comes or goes.
    pub without: Micros,
    /// They come and go.
    pub with: Micros,
    /// The one over the other.
    pub ratio: Micros,
}

impl ByTurns {
    fn of(watched: &super::Watched, pick: fn(&Suffering) -> &LatencyHistogram) -> Self {
        let [without, with] = [&watched.without, &watched.with].map(|side| Micros::of(pick(side)));
        Self { without, with, ratio: with.over(without) }
    }
}

impl Watched {
    fn of(watched: &super::Watched) -> Self {
        Self {
            observers: watched.observers,
            visitors: watched.visitors,
            joins: watched.joins,
            messages: watched.messages,
            tick: ByTurns::of(watched, |side| &side.lateness),
            bare_loop: ByTurns::of(watched, |side| &side.bare_loop),
            work: ByTurns::of(watched, |side| &side.work),
            steps_to_command: ByTurns::of(watched, |side| &side.cycle),
        }
    }
}

/// What the kernel granted the clock.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Granted {
    /// `fifo` or `other`.
    pub policy: &'static str,
    /// Its priority.
    pub priority: u64,
    /// The processor it is bound to.
    pub cpu: Option<u64>,
    /// Its memory is locked.
    pub mlock: bool,
}

/// Everything, as `--json` has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// For how long it was measured.
    pub seconds: f64,
    /// Ticks.
    pub samples: u64,
    /// Beside a load.
    pub load: bool,
    /// What it consisted of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_by: Option<&'static str>,
    /// Lateness of the tick.
    pub tick: Tick,
    /// Messages on their way.
    pub hops: Vec<Hop>,
    /// From the tick's waking until it has told everybody.
    pub work: Micros,
    /// How long commands were ready before the clock took them in.
    pub command_ready: Micros,
    /// What observers cost, if there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub watched: Option<Watched>,
    /// Every process of the robot.
    pub processes: Vec<Process>,
    /// See [`Granted`].
    pub granted: Granted,
    /// Commands that came after their tick.
    pub commands_late: u64,
    /// How many of them within 50 ms of a stall of the bare loop.
    pub commands_late_beside_stalls: u64,
    /// Wake-ups of the bare loop that were late by a tick or more.
    pub bare_stalls: u64,
    /// Late wake-ups of the clock, a tenth of a tick or more, by cause.
    pub causes: BTreeMap<&'static str, u64>,
    /// The same one by one, at most a thousand.
    pub late: Vec<LateTick>,
    /// Time the host took away from the machine, s, as coarse as the kernel counts it.
    pub steal_s: f64,
}

impl Figures {
    /// Of a measurement.
    pub fn of(measured: &Measured) -> Self {
        let (ours, bare_loop) = (Micros::of(&measured.robot.lateness), Micros::of(&measured.bare_loop));
        let robot = measured.robot.hops.iter().chain([&measured.robot.cycle]);
        let futex = measured.futex.hops.iter().chain([&measured.futex.all]);
        let iceoryx2 = measured.iceoryx2.hops.iter().chain([&measured.iceoryx2.all]);
        let hops = HOP_NAMES.into_iter().zip(robot.zip(futex.zip(iceoryx2)));
        let hop = |(name, (ours, (futex, iceoryx2)))| {
            let [ours, futex, iceoryx2] = [ours, futex, iceoryx2].map(Micros::of);
            let (ratio, ratio_iceoryx2) = (ours.over(futex), ours.over(iceoryx2));
            Hop { name, ours, futex, iceoryx2, ratio, ratio_iceoryx2 }
        };
        let granted = &measured.granted;
        Self {
            seconds: measured.seconds,
            samples: measured.robot.lateness.count,
            load: measured.load.is_some(),
            load_by: measured.load,
            tick: Tick {
                ours,
                bare_loop,
                ratio: ours.over(bare_loop),
                cyclictest: measured.cyclictest.map(|Cyclictest { micros, .. }| micros),
            },
            hops: hops.map(hop).collect(),
            work: Micros::of(&measured.robot.work),
            command_ready: Micros::of(&measured.robot.ready),
            watched: measured.watched.as_ref().map(Watched::of),
            processes: measured
                .counts
                .iter()
                .map(|(role, counts)| Process { name: role.name(), counts: *counts })
                .collect(),
            granted: Granted {
                policy: if granted.fifo { "fifo" } else { "other" },
                priority: granted.priority,
                cpu: granted.cpu,
                mlock: granted.mlock,
            },
            commands_late: measured.commands_late,
            commands_late_beside_stalls: measured.commands_late_beside_stalls,
            bare_stalls: measured.bare_stalls,
            causes: measured.causes.iter().map(|(cause, count)| (cause.label(), *count)).collect(),
            late: measured.late.clone(),
            steal_s: measured.steal_s,
        }
    }

    /// As a table.
    pub fn to_text(&self, causes: &[(Cause, u64)]) -> String {
        let mut text = String::new();
        let load = match self.load_by {
            Some(by) => format!("every core loaded ({by})"),
            None => "idle".to_owned(),
        };
        let granted = &self.granted;
        let cpu = granted.cpu.map_or("any cpu".to_owned(), |cpu| format!("cpu {cpu}"));
        let locked = if granted.mlock { "memory locked" } else { "memory not locked" };
        let _ = writeln!(
            text,
            "{} ticks in {:.0} s, {load}; the clock has {} {}, {cpu}, {locked}; the host took {:.2} s away",
            self.samples, self.seconds, granted.policy, granted.priority, self.steal_s
        );
        let tick = &self.tick;
        let mut rows = vec![("hilare", tick.ours, 1), ("bare loop", tick.bare_loop, 1)];
        rows.extend(tick.cyclictest.map(|cyclictest| ("cyclictest", cyclictest, 0)));
        rows.extend([("ratio to the bare loop", tick.ratio, 2), ("the tick's own work", self.work, 1)]);
        table(&mut text, "lateness of the tick", &rows);
        for hop in &self.hops {
            let rows = [
                ("hilare", hop.ours, 1),
                ("bare futex", hop.futex, 1),
                ("bare iceoryx2", hop.iceoryx2, 1),
                ("ratio to futex", hop.ratio, 2),
                ("ratio to iceoryx2", hop.ratio_iceoryx2, 2),
            ];
            table(&mut text, hop.name, &rows);
        }
        let _ = writeln!(
            text,
            "\n{} commands late ({} within 50 ms of a stall of the bare loop, which stalled {} times)",
            self.commands_late, self.commands_late_beside_stalls, self.bare_stalls
        );
        self.write_watched(&mut text);
        self.write_processes(&mut text);
        let late: u64 = causes.iter().map(|(_, count)| count).sum();
        let _ = writeln!(text, "{late} ticks late by 0.1 ms or more");
        for (cause, count) in causes.iter().filter(|(_, count)| *count > 0) {
            let _ = writeln!(text, "  {count:>8}  {}", cause.label());
        }
        text
    }
}

impl Figures {
    fn write_watched(&self, text: &mut String) {
        let Some(watched) = &self.watched else { return };
        let _ = writeln!(
            text,
            "\n{} {} joined {} times by turns of seconds, and read {} {}",
            watched.observers,
            if watched.visitors { "hostile pages" } else { "observers" },
            watched.joins,
            watched.messages,
            if watched.visitors { "kB" } else { "messages" }
        );
        for (title, turns) in [
            ("lateness of the tick", &watched.tick),
            ("lateness of the bare loop", &watched.bare_loop),
            ("the tick's own work", &watched.work),
            ("steps->command", &watched.steps_to_command),
        ] {
            let rows = [
                ("nobody comes or goes", turns.without, 1),
                ("they come and go", turns.with, 1),
                ("ratio", turns.ratio, 2),
            ];
            table(text, title, &rows);
        }
    }

    fn write_processes(&self, text: &mut String) {
        let heads = ["over budget", "page faults", "put aside"];
        let _ = writeln!(text, "\n{:<34}{:>14}{:>14}{:>14}", "process", heads[0], heads[1], heads[2]);
        for Process { name, counts } in &self.processes {
            let Counts { over_budget, page_faults, involuntary_switches } = counts;
            let _ =
                writeln!(text, "  {name:<32}{over_budget:>14}{page_faults:>14}{involuntary_switches:>14}");
        }
    }
}

/// A heading, and rows of a name, quantiles and their decimals.
fn table(text: &mut String, title: &str, rows: &[(&str, Micros, usize)]) {
    let title = format!("{title}, µs");
    let _ = writeln!(text, "\n{title:<34}{:>10}{:>10}{:>10}{:>10}", "p50", "p99", "p99.9", "max");
    for (name, micros, decimals) in rows {
        let _ = writeln!(text, "  {name:<32}{}", micros.row(*decimals));
    }
}
