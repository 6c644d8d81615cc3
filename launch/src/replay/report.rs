//! What a replay came to, for people and for programs.

use super::boxes::BoxReport;
use super::ledger::Tally;
use super::log::RunLog;
use serde::Serialize;
use std::fmt::Write;

/// A replay of a recording, box by box.
#[derive(Clone, Debug, Serialize)]
pub struct ReplayReport {
    /// What was recorded.
    pub run: String,
    /// Ticks of the recording.
    pub ticks: u64,
    /// Every message that was compared is the same to the last bit, and there was one.
    pub equal: bool,
    /// Messages compared.
    pub compared: u64,
    /// Those of them that differ.
    pub differing: u64,
    /// Messages whose inputs are not whole in the recording.
    pub not_compared: u64,
    /// What is to be said of the recording.
    pub notes: Vec<String>,
    /// Box by box.
    pub boxes: Vec<BoxReport>,
}

impl ReplayReport {
    /// Adds up.
    pub fn new(log: &RunLog, notes: Vec<String>, boxes: Vec<BoxReport>) -> Self {
        let sum = |of: fn(&Tally) -> u64| boxes.iter().flat_map(|report| &report.wires).map(of).sum();
        let (compared, differing) = (sum(|tally| tally.compared), sum(|tally| tally.differing));
        Self {
            run: log.title.name.clone(),
            ticks: log.end,
            equal: compared > 0 && differing == 0,
            compared,
            differing,
            not_compared: sum(|tally| tally.not_compared),
            notes,
            boxes,
        }
    }

    /// A table and what stands out.
    pub fn to_text(&self) -> String {
        let mut text = format!("{}: {} ticks\n", self.run, self.ticks);
        self.notes.iter().for_each(|note| text.push_str(&format!("  {note}\n")));
        let _ =
            writeln!(text, "  {:<34}{:<11}{:>10}{:>9}{:>14}", "", "", "compared", "differ", "not compared");
        for report in &self.boxes {
            for tally in &report.wires {
                let (name, wire) = (&report.name, &tally.wire);
                let Tally { compared, differing, not_compared, .. } = tally;
                let _ =
                    writeln!(text, "  {name:<34}{wire:<11}{compared:>10}{differing:>9}{not_compared:>14}");
            }
            if report.wires.is_empty() {
                let _ = writeln!(text, "  {:<34}nothing recorded", report.name);
            }
            report.notes.iter().for_each(|note| text.push_str(&format!("    {note}\n")));
        }
        let firsts = self.boxes.iter().flat_map(|report| {
            report.wires.iter().filter_map(move |tally| Some((report, tally, tally.first.as_ref()?)))
        });
        // The first of all leads to the others.
        let mut firsts: Vec<_> = firsts.collect();
        firsts.sort_by_key(|(.., first)| first.tick);
        for (report, tally, first) in &firsts {
            let _ =
                writeln!(text, "first difference of {}, {}: {}", report.name, tally.wire, first.in_words());
        }
        text.push_str(&self.verdict());
        text.push('\n');
        text
    }

    /// The last line: what was compared, and how much was not.
    fn verdict(&self) -> String {
        let rest = match self.not_compared {
            0 => ".".to_owned(),
            n => format!("; {n} not compared: see above."),
        };
        match (self.compared, self.differing) {
            (0, _) => format!("Nothing could be compared{rest}"),
            (n, 0) => format!("Bit for bit the same: {n} messages{rest}"),
            (n, differing) => format!("Not the same: {differing} of {n} messages differ{rest}"),
        }
    }
}

/// What boxes would have answered with other parameters or another law, to the same inputs.
pub fn open_loop_text(report: &ReplayReport) -> String {
    let mut text = format!("{}: {} ticks, what was recorded as inputs\n", report.run, report.ticks);
    report.notes.iter().for_each(|note| text.push_str(&format!("  {note}\n")));
    for of_box in &report.boxes {
        for tally in of_box.wires.iter().filter(|tally| tally.compared > 0 && tally.wire != "taken in") {
            let _ = writeln!(
                text,
                "  {}, {}: {} answers, {} others than recorded",
                of_box.name, tally.wire, tally.compared, tally.differing
            );
            if let Some(first) = &tally.first {
                let _ = writeln!(text, "    first at {}", first.in_words());
            }
            for deviation in tally.deviations.iter().filter(|deviation| deviation.max > 0.0) {
                let (field, rms, max) = (&deviation.field, deviation.rms, deviation.max);
                let _ = writeln!(text, "    {field:<24} off by {rms:.3e} (rms), {max:.3e} (max)");
            }
        }
        if of_box.compared() == 0 {
            let not_compared: u64 = of_box.wires.iter().map(|tally| tally.not_compared).sum();
            let why = match not_compared {
                0 => "nothing of it is in the recording: nothing to answer again".to_owned(),
                n => format!("what it took is not in the recording: messages not answered again: {n}"),
            };
            let _ = writeln!(text, "  {}: {why}", of_box.name);
        }
        of_box.notes.iter().for_each(|note| text.push_str(&format!("    {note}\n")));
    }
    text
}
