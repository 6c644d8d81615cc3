//! One row of the fault table, many seeds.
//!
//! `HILARE_FAULT_SEEDS` says how many; `HILARE_TEST_SEED` which is the first. A run that fails prints both and
//! the plan; `HILARE_FAULT_PLAN` runs a plan that was written by hand in its place.

use super::plan::Plan;
use super::report::{self, Layer};
use crate::support::random::{Random, given_seed};
use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::RangeInclusive;

/// One run of a row.
pub struct Draw {
    /// Where its plan comes from.
    pub random: Random,
    seed: u64,
    row: &'static str,
    said: String,
}

impl Draw {
    /// The seed of the run.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The plan of the run: the one drawn, or one that was asked for by hand. Printed if the run fails.
    pub fn plan(&mut self, drawn: Plan) -> Plan {
        let asked_for = std::env::var("HILARE_FAULT_PLAN").ok();
        let plan = asked_for.map_or(drawn, |text| text.parse().unwrap_or_else(|why| panic!("{why}")));
        self.note(&format!("HILARE_FAULT_PLAN='{plan}'"));
        plan
    }

    /// Something else to print if the run fails.
    pub fn note(&mut self, what: &str) {
        let _ = write!(self.said, "\n    {what}");
    }
}

impl Drop for Draw {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let again = format!("HILARE_TEST_SEED={} HILARE_FAULT_SEEDS=1", self.seed);
            // Past the capture: a thread of the row may be the one that failed.
            let _ = writeln!(std::io::stderr().lock(), "{}: {again}{}", self.row, self.said);
        }
    }
}

/// What a row came to over its seeds.
pub struct Figures {
    seeds: u64,
    /// A sentence with `{}` for its number, and the number.
    numbers: Vec<(&'static str, f64)>,
}

impl Figures {
    /// The greatest value of all runs.
    pub fn most(&mut self, sentence: &'static str, value: f64) {
        self.fold(sentence, value, f64::max);
    }

    /// The sum over all runs.
    pub fn sum(&mut self, sentence: &'static str, value: f64) {
        self.fold(sentence, value, |a, b| a + b);
    }

    fn fold(&mut self, sentence: &'static str, value: f64, both: impl FnOnce(f64, f64) -> f64) {
        match self.numbers.iter_mut().find(|(known, _)| *known == sentence) {
            Some((_, number)) => *number = both(*number, value),
            None => self.numbers.push((sentence, value)),
        }
    }

    /// In one line.
    fn line(&self, runs: &str) -> String {
        let mut line = format!("{} {runs}", self.seeds);
        for (sentence, number) in &self.numbers {
            let number = match number {
                number if number.fract() == 0.0 => format!("{number}"),
                number if *number > 0.1 => format!("{number:.1}"),
                number => format!("{number:.1e}"),
            };
            let _ = write!(line, "; {}", sentence.replace("{}", &number));
        }
        line
    }
}

/// How many seeds a row has: `HILARE_FAULT_SEEDS`, `most` at most; where nobody asks, `short`.
fn count(short: u64, most: u64) -> u64 {
    let given = std::env::var("HILARE_FAULT_SEEDS").ok();
    let asked = |text: String| text.parse().unwrap_or_else(|_| panic!("HILARE_FAULT_SEEDS={text}"));
    given.map_or(short, |text| most.min(asked(text)))
}

/// Runs a row in virtual time with each of its seeds, `short` where nobody asks for more; the figures go
/// into the report.
pub fn each(row: &'static str, short: u64, run: impl FnMut(&mut Draw, &mut Figures)) {
    of_layer(Layer::Virtual, &[row], count(short, u64::MAX), run);
}

/// The same with real processes: the first of `runs` where nobody asks for more, the last at most.
pub fn each_real(row: &'static str, runs: RangeInclusive<u64>, run: impl FnMut(&mut Draw, &mut Figures)) {
    all_real(&[row], runs, run);
}

/// Several rows that the same runs show, with real processes.
pub fn all_real(rows: &[&'static str], runs: RangeInclusive<u64>, run: impl FnMut(&mut Draw, &mut Figures)) {
    of_layer(Layer::Real, rows, count(*runs.start(), *runs.end()), run);
}

fn of_layer(layer: Layer, rows: &[&'static str], seeds: u64, mut run: impl FnMut(&mut Draw, &mut Figures)) {
    let first = given_seed().unwrap_or(1);
    let mut figures = Figures { seeds, numbers: Vec::new() };
    for seed in first..first + seeds {
        let random = Random::of_seed(seed);
        run(&mut Draw { random, seed, row: rows[0], said: String::new() }, &mut figures);
    }
    let line = figures.line(if layer == Layer::Virtual { "seeds" } else { "runs" });
    for row in rows {
        println!("{row}: {line}");
        report::record(row, layer, &line);
    }
}
