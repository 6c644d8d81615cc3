//! Percentiles, the table, and what is kept of a run.

use crate::page::Round;
use serde_json::{Value, json};
use std::fmt::Write;

/// The ends of a distribution, ns; nothing is trimmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spread {
    /// Half are no larger.
    pub p50: u64,
    /// One in a hundred is larger.
    pub p99: u64,
    /// One in a thousand is larger.
    pub p99_9: u64,
    /// The largest.
    pub max: u64,
}

impl Spread {
    /// Of at least one value, by nearest rank.
    pub fn of(mut values: Vec<u64>) -> Option<Self> {
        values.sort_unstable();
        let max = *values.last()?;
        let at = |per_mille: usize| values[(values.len() * per_mille).div_ceil(1000).max(1) - 1];
        Some(Self { p50: at(500), p99: at(990), p99_9: at(999), max })
    }

    fn cells(self) -> String {
        let cell = |ns: u64| format!(" {:.1} |", us(ns));
        [self.p50, self.p99, self.p99_9, self.max].map(cell).concat()
    }

    fn json(self) -> Value {
        json!({"p50": us(self.p50), "p99": us(self.p99), "p99_9": us(self.p99_9), "max": us(self.max)})
    }

    fn over(self, floor: Self) -> (f64, f64) {
        (self.p50 as f64 / floor.p50.max(1) as f64, self.p99 as f64 / floor.p99.max(1) as f64)
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

/// A peer that was measured.
pub struct Row {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Every round, in order.
    pub rounds: Vec<Round>,
    /// Periods left out because a round or the host took longer.
    pub skipped: u32,
    /// What the kernel granted its processes: whose, what.
    pub granted: Vec<(&'static str, String)>,
}

/// A peer that was not, and why.
pub struct Absent {
    /// Its name.
    pub name: &'static str,
    /// Why, as it came.
    pub reason: String,
}

/// A run.
pub struct Report {
    /// Kernel, processors, settings: name and value.
    pub conditions: Vec<(&'static str, String)>,
    /// Time the host took, ms, by processor.
    pub stolen_ms: Vec<(String, u64)>,
    /// Those measured, the floor among them.
    pub rows: Vec<Row>,
    /// Those not.
    pub absent: Vec<Absent>,
}

/// The peer that the others are compared with.
pub const FLOOR: &str = "futex";

impl Row {
    /// One way and round.
    fn spreads(&self) -> Option<(Spread, Spread)> {
        let one_way = Spread::of(self.rounds.iter().map(|round| round.one_way).collect())?;
        Some((one_way, Spread::of(self.rounds.iter().map(|round| round.round).collect())?))
    }

    /// Every round as a line, ns.
    pub fn csv(&self) -> String {
        let mut text = String::from("lateness_ns,one_way_ns,round_ns\n");
        for round in &self.rounds {
            let _ = writeln!(text, "{},{},{}", round.lateness, round.one_way, round.round);
        }
        text
    }
}

impl Report {
    fn floor(&self) -> Option<(Spread, Spread)> {
        self.rows.iter().find(|row| row.name == FLOOR)?.spreads()
    }

    fn stolen(&self) -> String {
        let each: Vec<String> = self.stolen_ms.iter().map(|(name, ms)| format!("{name} {ms} ms")).collect();
        each.join(", ")
    }

    /// The table and what belongs under it, in Markdown.
    pub fn markdown(&self) -> String {
        let mut text = String::from(
            "| peer | one way p50 | p99 | p99.9 | max (µs) | round p50 | p99 | p99.9 | max (µs) | round over futex p50 | p99 |\n\
             |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        );
        for row in &self.rows {
            let Some((one_way, round)) = row.spreads() else { continue };
            let _ = write!(text, "| {} |{}{}", row.name, one_way.cells(), round.cells());
            let ratio = self.floor().map(|(_, floor)| round.over(floor));
            let _ = match ratio {
                Some((p50, p99)) => writeln!(text, " {p50:.2} | {p99:.2} |"),
                None => writeln!(text, " – | – |"),
            };
        }
        let _ = writeln!(text, "\nHost steal during the run: {}. Nothing is trimmed.\n", self.stolen());
        for (name, value) in &self.conditions {
            let _ = writeln!(text, "- {name}: {value}");
        }
        for row in &self.rows {
            let samples = row.rounds.len();
            let _ = writeln!(
                text,
                "- {}: {}; {samples} samples, {} periods left out",
                row.name, row.what, row.skipped
            );
            for (whose, what) in &row.granted {
                let _ = writeln!(text, "  - {whose}: {what}");
            }
        }
        for absent in &self.absent {
            let _ = writeln!(text, "- {}: not measured: {}", absent.name, absent.reason);
        }
        text
    }

    /// The same for programs; times in µs.
    pub fn json(&self) -> Value {
        let floor = self.floor();
        let row = |row: &Row| {
            let (one_way, round) = row.spreads()?;
            let ratio = |spread: Spread, floor: Option<Spread>| {
                floor.map(|floor| spread.over(floor)).map(|(p50, p99)| json!({"p50": p50, "p99": p99}))
            };
            let granted: serde_json::Map<String, Value> =
                row.granted.iter().map(|(whose, what)| ((*whose).to_owned(), json!(what))).collect();
            Some(json!({
                "name": row.name,
                "what": row.what,
                "samples": row.rounds.len(),
                "periods_left_out": row.skipped,
                "one_way_us": one_way.json(),
                "round_us": round.json(),
                "over_futex": {
                    "one_way": ratio(one_way, floor.map(|(one_way, _)| one_way)),
                    "round": ratio(round, floor.map(|(_, round)| round)),
                },
                "granted": granted,
            }))
        };
        let pairs =
            |pairs: &mut dyn Iterator<Item = (String, Value)>| pairs.collect::<serde_json::Map<_, _>>();
        let conditions =
            pairs(&mut self.conditions.iter().map(|(name, value)| ((*name).to_owned(), json!(value))));
        let stolen = pairs(&mut self.stolen_ms.iter().map(|(name, ms)| (name.clone(), json!(ms))));
        let absent: Vec<Value> =
            self.absent.iter().map(|absent| json!({"name": absent.name, "reason": absent.reason})).collect();
        json!({
            "conditions": conditions,
            "steal_ms": stolen,
            "peers": self.rows.iter().filter_map(row).collect::<Vec<_>>(),
            "absent": absent,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_by_nearest_rank_and_keep_the_largest() {
        let spread = Spread::of((1..=1000).rev().collect()).unwrap();
        assert_eq!(spread, Spread { p50: 500, p99: 990, p99_9: 999, max: 1000 });
        assert_eq!(Spread::of(vec![7]).unwrap(), Spread { p50: 7, p99: 7, p99_9: 7, max: 7 });
        assert_eq!(Spread::of(vec![]), None);
    }

    #[test]
    fn ratios_are_those_to_the_futex() {
        let row = |name, round| Row {
            name,
            what: "",
            rounds: vec![Round { lateness: 0, one_way: round / 2, round }],
            skipped: 0,
            granted: vec![],
        };
        let rows = vec![row(FLOOR, 4000), row("other", 10_000)];
        let absent = vec![Absent { name: "third", reason: "no such thing".to_owned() }];
        let report = Report { conditions: vec![], stolen_ms: vec![], rows, absent };
        assert!(
            report
                .markdown()
                .contains("| other | 5.0 | 5.0 | 5.0 | 5.0 | 10.0 | 10.0 | 10.0 | 10.0 | 2.50 | 2.50 |")
        );
        assert!(report.markdown().contains("third: not measured: no such thing"));
        assert_eq!(report.json()["peers"][1]["over_futex"]["round"]["p99"], 2.5);
    }
}
