//! Runs that are over, beside each other: figures, keys of their systems, and the tick at which they part.

use super::PastRun;
use super::Summary;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::messages::Waypoint;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// A figure of `summary.json`.
struct Figure {
    /// Its key there.
    key: &'static str,
    /// What people call it, in which unit, how much of that is one of the key's, decimals.
    shown: (&'static str, &'static str, f64, usize),
    value: fn(&Summary) -> Option<f64>,
}

const fn figure(
    key: &'static str,
    shown: (&'static str, &'static str, f64, usize),
    value: fn(&Summary) -> Option<f64>,
) -> Figure {
    Figure { key, shown, value }
}

const FIGURES: [Figure; 19] = [
    figure("duration_s", ("duration", "s", 1.0, 3), |s| Some(s.duration_s)),
    figure("cross_track_mean_m", ("cross-track mean", "mm", 1e3, 3), |s| Some(s.cross_track_mean_m)),
    figure("cross_track_max_m", ("cross-track max", "mm", 1e3, 3), |s| Some(s.cross_track_max_m)),
    figure("speed_error_mean_mps", ("speed error mean", "mm/s", 1e3, 3), |s| Some(s.speed_error_mean_mps)),
    figure("speed_error_truth_mean_mps", ("the same of the truth", "mm/s", 1e3, 3), |s| {
        Some(s.speed_error_truth_mean_mps)
    }),
    figure("clearance_min_m", ("least clearance", "mm", 1e3, 2), |s| s.clearance_min_m),
    figure("estimate_off_truth_m", ("estimate off truth", "mm", 1e3, 3), |s| {
        let (pose, truth) = (s.final_pose, s.final_truth);
        Some((pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m))
    }),
    figure("ticks_late", ("ticks late", "", 1.0, 0), |s| Some(s.ticks_late as f64)),
    figure("paused_ticks", ("ticks lost to pauses", "", 1.0, 0), |s| Some(s.paused_ticks as f64)),
    figure("paused_max_ticks", ("longest pause", "ticks", 1.0, 0), |s| Some(s.paused_max_ticks as f64)),
    figure("commands_late", ("commands late", "", 1.0, 0), |s| Some(s.commands_late as f64)),
    figure("commands_rejected", ("commands rejected", "", 1.0, 0), |s| Some(s.commands_rejected as f64)),
    figure("cycles_without_command", ("cycles without command", "", 1.0, 0), |s| {
        Some(s.cycles_without_command as f64)
    }),
    figure("swaps", ("swaps", "", 1.0, 0), |s| Some(s.swaps as f64)),
    figure("restarts", ("restarts", "", 1.0, 0), |s| Some(s.restarts as f64)),
    figure("lateness_us.p50", ("lateness p50", "us", 1.0, 1), |s| timed(s, s.lateness_us.p50)),
    figure("lateness_us.p99", ("lateness p99", "us", 1.0, 1), |s| timed(s, s.lateness_us.p99)),
    figure("lateness_us.p99_9", ("lateness p99.9", "us", 1.0, 1), |s| timed(s, s.lateness_us.p99_9)),
    figure("lateness_us.max", ("lateness max", "us", 1.0, 1), |s| timed(s, s.lateness_us.max)),
];

/// A lateness, where the clock was one that can be late.
fn timed(summary: &Summary, value_us: f64) -> Option<f64> {
    (summary.lateness_us.max > 0.0).then_some(value_us)
}

/// The keys of the systems a text lists; the rest is in the JSON.
const KEYS_SHOWN: usize = 24;

/// All that differs.
#[derive(Debug, Serialize)]
pub struct Differences {
    runs: Vec<RunLine>,
    same_scenario: bool,
    /// `null` where a path is not known.
    same_path: Option<bool>,
    figures: Vec<FigureLine>,
    /// Of every run but the first, against the first.
    poses: Vec<Poses>,
    /// Keys of the system file that are not the same everywhere; `null` where a system is not known.
    system: Option<Vec<KeyLine>>,
}

#[derive(Debug, Serialize)]
struct RunLine {
    name: String,
    place: String,
    scenario: String,
    controller: String,
    clock: String,
    reached: bool,
    ticks: u64,
    state_hash: String,
}

#[derive(Debug, Serialize)]
struct FigureLine {
    figure: &'static str,
    values: Vec<Option<f64>>,
    /// Less the first run's.
    differences: Vec<Option<f64>>,
    /// The same as parts of a hundred of the first run's; `null` where that is 0.
    differences_percent: Vec<Option<f64>>,
}

#[derive(Debug, Serialize)]
struct KeyLine {
    key: String,
    values: Vec<Option<String>>,
}

/// How the estimated poses of a run compare with the first run's, bit for bit.
#[derive(Debug, PartialEq, Serialize)]
struct Poses {
    run: String,
    /// The hash over the bits of every tick is that of the first run.
    same_state_hash: bool,
    /// Ticks that both have kept; 0 where they were not compared.
    ticks_compared: u64,
    /// The first of them at which a bit differs.
    first_different_tick: Option<u64>,
    /// The one before it, where the bits are still the same.
    last_same_tick: Option<u64>,
    /// What the first run says there: x (m), y (m), heading (rad).
    first_pose: Option<[f64; 3]>,
    /// What this run says there.
    pose: Option<[f64; 3]>,
}

/// A, B, C, …
pub fn letter(n: usize) -> String {
    char::from(b'A' + (n % 26) as u8).to_string()
}

impl Differences {
    /// Of at least two runs.
    pub fn of(runs: &[PastRun]) -> Self {
        let first = &runs[0];
        let paths_known = runs.iter().all(|run| !run.waypoints.is_empty());
        let same_path =
            paths_known.then(|| runs.iter().all(|run| same_bits(&run.waypoints, &first.waypoints)));
        let poses = runs.iter().enumerate().skip(1).map(|(n, run)| {
            // Where a path is not known, the scenario's name has to do.
            let known = !run.waypoints.is_empty() && !first.waypoints.is_empty();
            let same = if known {
                same_bits(&run.waypoints, &first.waypoints)
            } else {
                run.summary.scenario == first.summary.scenario
            };
            let hash = run.summary.state_hash == first.summary.state_hash;
            Poses::of(letter(n), hash, same.then(|| (first.poses(), run.poses())))
        });
        Self {
            same_scenario: runs.iter().all(|run| run.summary.scenario == first.summary.scenario),
            same_path,
            figures: FIGURES.iter().filter_map(|figure| figure.line(runs)).collect(),
            poses: poses.collect(),
            system: system_keys(runs),
            runs: runs.iter().enumerate().map(|(n, run)| RunLine::of(letter(n), run)).collect(),
        }
    }

    /// For people; at most 100 columns but for long names.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for run in &self.runs {
            let ended = if run.reached { "" } else { ", not arrived" };
            let RunLine { name, place, scenario, controller, clock, .. } = run;
            let _ = writeln!(text, "{name}  {place}: {scenario}, {controller}, {clock} clock{ended}");
        }
        text.push_str(match (self.same_scenario, self.same_path) {
            (true, Some(true)) => "The same scenario, the same path.\n",
            (true, Some(false)) => "Scenarios of the same name, but different paths.\n",
            (true, None) => "The same scenario by its name; a path is not known.\n",
            (false, Some(true)) => "Different scenarios on the same path.\n",
            (false, _) => "Different scenarios: their figures are of different jobs.\n",
        });
        for other in 1..self.runs.len() {
            text.push('\n');
            self.table(&mut text, other);
            self.poses[other - 1].tell(&mut text);
        }
        self.tell_system(&mut text);
        text
    }

    fn table(&self, text: &mut String, other: usize) {
        let (a, b) = (&self.runs[0].name, &self.runs[other].name);
        let _ = writeln!(text, "  {:<28}{a:>16}{b:>16}{:>16}{:>10}", "", format!("{b} - {a}"), "%");
        let mut nothing: Vec<&str> = Vec::new();
        for line in &self.figures {
            let Some(figure) = FIGURES.iter().find(|figure| figure.key == line.figure) else { continue };
            let (name, unit, factor, decimals) = figure.shown;
            // Most runs have nothing to count.
            if decimals == 0 && line.values[0] == Some(0.0) && line.values[other] == Some(0.0) {
                nothing.push(name);
                continue;
            }
            let name = if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") };
            let number = |value: Option<f64>, sign: bool| match value.map(|value| value * factor) {
                None => "-".to_owned(),
                Some(value) if sign && value != 0.0 => format!("{value:+.decimals$}"),
                Some(value) => format!("{value:.decimals$}"),
            };
            let percent = match line.differences_percent[other] {
                None => "-".to_owned(),
                Some(0.0) => "0".to_owned(),
                Some(percent) => format!("{percent:+.1}"),
            };
            let (a, b) = (number(line.values[0], false), number(line.values[other], false));
            let difference = number(line.differences[other], true);
            let _ = writeln!(text, "  {name:<28}{a:>16}{b:>16}{difference:>16}{percent:>10}");
        }
        if !nothing.is_empty() {
            // As many as fit on a line.
            for (n, names) in nothing.chunks(5).enumerate() {
                let (begin, end) = (if n == 0 { "  None of: " } else { "    " }, names.join(", "));
                let _ = writeln!(
                    text,
                    "{begin}{end}{}",
                    if 5 * n + names.len() < nothing.len() { "," } else { "." }
                );
            }
        }
    }

    fn tell_system(&self, text: &mut String) {
        let Some(system) = &self.system else { return };
        if system.is_empty() {
            text.push_str("\nTheir system files are the same.\n");
            return;
        }
        let _ = writeln!(text, "\nTheir system files differ:");
        for KeyLine { key, values } in system.iter().take(KEYS_SHOWN) {
            let values: Vec<&str> = values.iter().map(|value| value.as_deref().unwrap_or("-")).collect();
            let _ = writeln!(text, "  {key:<38}{}", values.join("   "));
        }
        if system.len() > KEYS_SHOWN {
            let _ = writeln!(text, "  and {} more; compare.json has them", system.len() - KEYS_SHOWN);
        }
    }
}

impl RunLine {
    fn of(name: String, run: &PastRun) -> Self {
        let summary = &run.summary;
        Self {
            name,
            place: run.place.display().to_string(),
            scenario: summary.scenario.clone(),
            controller: summary.controller.clone(),
            clock: summary.clock.clone(),
            reached: summary.reached,
            ticks: summary.ticks,
            state_hash: summary.state_hash.clone(),
        }
    }
}

impl Figure {
    /// `None` if no run has it.
    fn line(&self, runs: &[PastRun]) -> Option<FigureLine> {
        let counted_by_launch = ["swaps", "restarts"].contains(&self.key);
        let value = |run: &PastRun| {
            if run.is_recording && counted_by_launch { None } else { (self.value)(&run.summary) }
        };
        let values: Vec<Option<f64>> = runs.iter().map(value).collect();
        values.iter().flatten().next()?;
        let first = values[0];
        let difference = |value: &Option<f64>| value.zip(first).map(|(value, first)| value - first);
        let differences: Vec<Option<f64>> = values.iter().map(difference).collect();
        let percent = |difference: &Option<f64>| {
            difference
                .zip(first)
                .filter(|(_, first)| *first != 0.0)
                .map(|(by, first)| 100.0 * by / first.abs())
        };
        let differences_percent = differences.iter().map(percent).collect();
        Some(FigureLine { figure: self.key, values, differences, differences_percent })
    }
}

impl Poses {
    /// Of two runs of one path; not compared without them.
    fn of<A, B>(run: String, same_state_hash: bool, both: Option<(A, B)>) -> Self
    where
        A: Iterator<Item = (u64, WorldPose)>,
        B: Iterator<Item = (u64, WorldPose)>,
    {
        let mut poses = Self {
            run,
            same_state_hash,
            ticks_compared: 0,
            first_different_tick: None,
            last_same_tick: None,
            first_pose: None,
            pose: None,
        };
        let Some((mut a, mut b)) = both else { return poses };
        let (mut left, mut right) = (a.next(), b.next());
        while let (Some((a_tick, a_pose)), Some((b_tick, b_pose))) = (left, right) {
            if a_tick < b_tick {
                left = a.next();
                continue;
            }
            if b_tick < a_tick {
                right = b.next();
                continue;
            }
            poses.ticks_compared += 1;
            if bits(a_pose) != bits(b_pose) {
                poses.first_different_tick = Some(a_tick);
                (poses.first_pose, poses.pose) = (Some(flat(a_pose)), Some(flat(b_pose)));
                break;
            }
            poses.last_same_tick = Some(a_tick);
            (left, right) = (a.next(), b.next());
        }
        poses
    }

    fn tell(&self, text: &mut String) {
        let run = &self.run;
        let Some(tick) = self.first_different_tick else {
            match self.last_same_tick {
                Some(_) if self.same_state_hash => {
                    text.push_str("  Estimated poses: the same bits at every tick.\n");
                }
                Some(last) => {
                    let n = self.ticks_compared;
                    let _ = writeln!(
                        text,
                        "  Estimated poses: the same bits at all {n} ticks that both have kept, up to {last}."
                    );
                }
                None => {
                    let _ = writeln!(
                        text,
                        "  Estimated poses: not compared, A and {run} have no tick of the same path in common."
                    );
                }
            }
            return;
        };
        let since =
            self.last_same_tick.map_or(String::new(), |last| format!("; at {last} they are the same"));
        let off_mm =
            self.first_pose.zip(self.pose).map_or(0.0, |(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) * 1e3);
        let at_s = tick as f64 / 1000.0;
        let _ = writeln!(
            text,
            "  Estimated poses: first different at tick {tick} ({at_s:.3} s), by {off_mm:.3e} mm{since}."
        );
    }
}

fn flat(pose: WorldPose) -> [f64; 3] {
    [pose.x_m, pose.y_m, pose.theta_rad]
}

fn bits(pose: WorldPose) -> [u64; 3] {
    flat(pose).map(f64::to_bits)
}

fn same_bits(a: &[Waypoint], b: &[Waypoint]) -> bool {
    let bits = |w: &Waypoint| [w.x_m, w.y_m, w.bulge, w.crab_rad].map(f64::to_bits);
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| bits(a) == bits(b))
}

/// Keys whose values are not the same everywhere, as their files write them.
fn system_keys(runs: &[PastRun]) -> Option<Vec<KeyLine>> {
    let systems: Vec<BTreeMap<String, String>> = runs.iter().map(|run| keys(&run.system)).collect();
    // Of a run whose system is not known nothing can be said.
    if systems.iter().any(BTreeMap::is_empty) {
        return None;
    }
    let all: BTreeSet<&String> = systems.iter().flat_map(BTreeMap::keys).collect();
    let line = |key: &String| KeyLine {
        key: key.clone(),
        values: systems.iter().map(|system| system.get(key).cloned()).collect(),
    };
    let lines = all.into_iter().map(line);
    Some(lines.filter(|line| line.values.iter().any(|value| *value != line.values[0])).collect())
}

/// `section.key` and value of a system file.
fn keys(system: &str) -> BTreeMap<String, String> {
    let mut keys = BTreeMap::new();
    if let Ok(table) = system.parse::<toml::Table>() {
        flatten("", &table, &mut keys);
    }
    keys
}

fn flatten(prefix: &str, table: &toml::Table, into: &mut BTreeMap<String, String>) {
    for (key, value) in table {
        let key = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            toml::Value::Table(table) => flatten(&key, table, into),
            value => {
                into.insert(key, value.to_string());
            }
        }
    }
}
