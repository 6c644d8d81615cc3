//! Rows: what a paper prints, what we find, how they differ, and why.

use super::published::{Claim, Item, Paper, Value};
use serde::Serialize;

/// What we find, in the unit of the claim.
#[derive(Clone, Debug, PartialEq)]
pub enum Ours {
    /// A number.
    One(f64),
    /// A number a run.
    Many(Vec<f64>),
    /// A range.
    Range(f64, f64),
    /// Words.
    Text(String),
}

/// A published value beside ours; its JSON has the same keys whatever they are.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// "table 3".
    pub item: &'static str,
    /// Its name within the item.
    pub key: &'static str,
    /// What it is of.
    pub what: &'static str,
    /// Unit of the numbers; empty for a pure number or words.
    pub unit: &'static str,
    /// What is printed.
    pub published: PublishedCell,
    /// What we find.
    pub ours: OursCell,
    /// Ours less the published number, or how far ours is outside the published range; `null` without numbers.
    pub difference: Option<f64>,
    /// The same for people.
    pub difference_text: String,
    /// Why it differs, or what is behind it.
    pub why: String,
}

/// A published value: a number has `low` = `high`, a bound has no `low`, words have neither.
#[derive(Clone, Debug, Serialize)]
pub struct PublishedCell {
    /// Least.
    pub low: Option<f64>,
    /// Greatest.
    pub high: Option<f64>,
    /// For people.
    pub text: String,
    /// Page of the paper.
    pub page: &'static str,
}

/// Our value: of several runs their mean and extremes.
#[derive(Clone, Debug, Serialize)]
pub struct OursCell {
    /// Mean of the runs, or the number.
    pub mean: Option<f64>,
    /// Least.
    pub min: Option<f64>,
    /// Greatest.
    pub max: Option<f64>,
    /// Runs it is of; 0 where it is no figure of runs.
    pub runs: usize,
    /// For people.
    pub text: String,
}

/// How near a row comes to what is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nearness {
    /// Nothing to compare: words on one side, or nothing printed.
    NoNumber,
    /// The printed number, to its last digit, or inside the printed bounds in every run.
    Met,
    /// Within a tenth of the printed number.
    WithinATenth,
    /// Farther from the number, or not inside the bounds in every run.
    Off,
}

impl Row {
    /// How near it comes.
    pub fn nearness(&self) -> Nearness {
        let Some(difference) = self.difference else { return Nearness::NoNumber };
        let (low, high) = (self.published.low.unwrap_or(f64::NEG_INFINITY), self.published.high);
        let high = high.unwrap_or(f64::INFINITY);
        if low == high {
            return match difference {
                _ if self.difference_text.starts_with(NOTHING) => Nearness::Met,
                off if off.abs() <= 0.1 * high.abs() => Nearness::WithinATenth,
                _ => Nearness::Off,
            };
        }
        let inside = |value: Option<f64>| value.is_some_and(|value| (low..=high).contains(&value));
        if inside(self.ours.min) && inside(self.ours.max) { Nearness::Met } else { Nearness::Off }
    }
}

/// The difference of what is equal as far as it is written.
const NOTHING: &str = "none";

/// An answer to a claim.
struct Answer {
    item: String,
    key: String,
    ours: Ours,
    why: String,
}

/// The rows of a paper as they come to be known.
pub struct Rows {
    paper: &'static Paper,
    given: Vec<Answer>,
}

impl Rows {
    /// None known.
    pub const fn new(paper: &'static Paper) -> Self {
        Self { paper, given: Vec::new() }
    }

    /// Our value of a claim, and why it differs.
    pub fn give(&mut self, item: &str, key: &str, ours: Ours, why: impl Into<String>) {
        self.given.push(Answer { item: item.to_owned(), key: key.to_owned(), ours, why: why.into() });
    }

    /// In the paper's order. An error if a claim has no answer, or an answer no claim.
    pub fn finish(mut self) -> Result<Vec<Row>, String> {
        let mut rows = Vec::new();
        for item in self.paper.items {
            for claim in item.claims {
                let its = |answer: &Answer| answer.item == item.name && answer.key == claim.key;
                let found = self.given.iter().position(its).ok_or_else(|| {
                    format!("paper {}, {}: nothing is found of {}", self.paper.number, item.name, claim.key)
                })?;
                let Answer { ours, why, .. } = self.given.swap_remove(found);
                rows.push(row(item, claim, &ours, why));
            }
        }
        match self.given.first() {
            Some(Answer { item, key, .. }) => {
                Err(format!("paper {}, {item}: {key} is no claim", self.paper.number))
            }
            None => Ok(rows),
        }
    }
}

fn row(item: &'static Item, claim: &'static Claim, ours: &Ours, why: String) -> Row {
    let (difference, difference_text) = difference(claim, ours);
    Row {
        item: item.name,
        key: claim.key,
        what: claim.what,
        unit: claim.unit,
        published: published_cell(claim, item.page),
        ours: ours_cell(claim, ours),
        difference,
        difference_text,
        why,
    }
}

/// A number with its unit.
fn with_unit(claim: &Claim, number: &str) -> String {
    match claim.unit {
        "" => number.to_owned(),
        "°" => format!("{number}°"),
        unit => format!("{number} {unit}"),
    }
}

fn number(claim: &Claim, value: f64) -> String {
    let text = format!("{value:.*}", claim.decimals);
    // What is rounded to nothing has no sign.
    let nothing = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.replace('-', if nothing { "" } else { "−" })
}

/// A published number as short as it is printed.
fn printed(value: f64) -> String {
    format!("{value}")
}

fn published_cell(claim: &Claim, page: &'static str) -> PublishedCell {
    let cell = |low, high, text| PublishedCell { low, high, text, page };
    match claim.value {
        Value::Is(value) => cell(Some(value), Some(value), with_unit(claim, &printed(value))),
        Value::Between(low, high) => {
            let range = format!("{} to {}", printed(low), printed(high));
            cell(Some(low), Some(high), with_unit(claim, &range))
        }
        Value::AtMost(high) => cell(None, Some(high), with_unit(claim, &format!("≤ {}", printed(high)))),
        Value::Says(text) => cell(None, None, text.to_owned()),
        Value::Unprinted => cell(None, None, "not printed".to_owned()),
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
}

fn ours_cell(claim: &Claim, ours: &Ours) -> OursCell {
    let cell = |mean, min, max, runs, text| OursCell { mean, min, max, runs, text };
    match ours {
        Ours::One(value) => {
            let text = with_unit(claim, &number(claim, *value));
            cell(Some(*value), Some(*value), Some(*value), 1, text)
        }
        Ours::Many(values) => {
            let ((low, high), middle) = (extremes(values), mean(values));
            let [least, text, greatest] = [low, middle, high].map(|value| number(claim, value));
            let spread = if least == greatest { String::new() } else { format!(" ({least} to {greatest})") };
            let text = with_unit(claim, &text) + &spread;
            cell(Some(middle), Some(low), Some(high), values.len(), text)
        }
        Ours::Range(low, high) => {
            let range = format!("{} to {}", printed(*low), printed(*high));
            cell(None, Some(*low), Some(*high), 0, with_unit(claim, &range))
        }
        Ours::Text(text) => cell(None, None, None, 0, text.clone()),
    }
}

/// How far ours is off, signed, and the same in words.
fn difference(claim: &Claim, ours: &Ours) -> (Option<f64>, String) {
    let values = match ours {
        Ours::One(value) => std::slice::from_ref(value),
        Ours::Many(values) => values,
        Ours::Range(low, high) => return (None, range_words(claim.value, *low, *high).to_owned()),
        Ours::Text(_) => return (None, "–".to_owned()),
    };
    let ours = mean(values);
    let (low, high) = match claim.value {
        Value::Is(value) => return off_a_number(claim, values, value),
        Value::Between(low, high) => (low, high),
        Value::AtMost(high) => (f64::NEG_INFINITY, high),
        Value::Says(_) | Value::Unprinted => return (None, "–".to_owned()),
    };
    let off = (ours - high).max(0.0) - (low - ours).max(0.0);
    let kept = if low.is_finite() { "inside" } else { "kept" };
    let of_runs = match values.len() {
        1 => String::new(),
        runs => {
            let count = values.iter().filter(|value| (low..=high).contains(*value)).count();
            format!(" in {count} of {runs} runs")
        }
    };
    let words = match (off == 0.0, values.len()) {
        (true, _) => format!("{kept}{of_runs}"),
        (false, 1) => signed(claim, off),
        (false, _) => format!("{}; {kept}{of_runs}", signed(claim, off)),
    };
    (Some(off), words)
}

fn range_words(published: Value, low: f64, high: f64) -> &'static str {
    match published {
        Value::Between(least, greatest) if (low, high) == (least, greatest) => NOTHING,
        Value::Between(least, greatest) if low <= least && high >= greatest => "ours is wider",
        Value::Between(..) => "ours is another range",
        _ => "–",
    }
}

fn off_a_number(claim: &Claim, values: &[f64], published: f64) -> (Option<f64>, String) {
    let off = mean(values) - published;
    let nothing = number(claim, off.abs()).chars().all(|c| matches!(c, '0' | '.'));
    let mut words = if nothing { NOTHING.to_owned() } else { signed(claim, off) };
    if !nothing && published != 0.0 {
        let percent = 100.0 * off / published;
        let decimals = usize::from(percent.abs() < 1.0);
        words.push_str(&format!(" ({percent:+.decimals$} %)").replace('-', "−"));
    }
    let (low, high) = extremes(values);
    if number(claim, low) != number(claim, high) {
        let inside = if (low..=high).contains(&published) { "within" } else { "outside" };
        words.push_str(&format!("; published is {inside} our spread"));
    }
    (Some(off), words)
}

fn signed(claim: &Claim, value: f64) -> String {
    let sign = if value < 0.0 { "−" } else { "+" };
    with_unit(claim, &format!("{sign}{}", number(claim, value.abs())))
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn claim(value: Value) -> Claim {
        Claim { key: "k", what: "w", unit: "mm", decimals: 2, value }
    }

    #[test]
    fn differences_are_from_a_number_or_from_the_nearer_end_of_a_range() {
        let is = |ours| difference(&claim(Value::Is(2.0)), &ours);
        assert_eq!(is(Ours::One(2.5)), (Some(0.5), "+0.50 mm (+25 %)".to_owned()));
        assert_eq!(is(Ours::One(1.5)), (Some(-0.5), "−0.50 mm (−25 %)".to_owned()));
        assert_eq!(is(Ours::One(2.001)).1, "none");
        let many = is(Ours::Many(vec![1.0, 2.0]));
        assert_eq!(many, (Some(-0.5), "−0.50 mm (−25 %); published is within our spread".to_owned()));
        assert!(is(Ours::Many(vec![3.0, 4.0])).1.ends_with("outside our spread"));
        let between = |ours| difference(&claim(Value::Between(1.0, 2.0)), &Ours::One(ours));
        assert_eq!(between(0.5), (Some(-0.5), "−0.50 mm".to_owned()));
        assert_eq!(between(2.5), (Some(0.5), "+0.50 mm".to_owned()));
        assert_eq!(between(1.5), (Some(0.0), "inside".to_owned()));
        let at_most = difference(&claim(Value::AtMost(2.0)), &Ours::Many(vec![1.0, 1.5, 2.5]));
        assert_eq!(at_most, (Some(0.0), "kept in 2 of 3 runs".to_owned()));
        assert_eq!(difference(&claim(Value::Unprinted), &Ours::One(1.0)), (None, "–".to_owned()));
    }

    #[test]
    fn a_claim_without_an_answer_and_an_answer_without_a_claim_are_errors() {
        static PAPER: Paper = Paper {
            number: 9,
            source: "",
            items: &[Item { name: "table 1", page: "p. 1", claims: &[claim(Value::Is(1.0))] }],
        };
        assert!(Rows::new(&PAPER).finish().unwrap_err().contains("nothing is found of k"));
        let mut rows = Rows::new(&PAPER);
        rows.give("table 1", "k", Ours::One(1.0), "");
        rows.give("table 1", "x", Ours::One(1.0), "");
        assert!(rows.finish().unwrap_err().contains("x is no claim"));
    }

    #[test]
    fn what_rounds_to_nothing_has_no_sign() {
        assert_eq!(number(&claim(Value::Unprinted), -0.001), "0.00");
        assert_eq!(number(&claim(Value::Unprinted), -0.1), "−0.10");
    }
}
