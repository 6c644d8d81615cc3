//! What a search came to: `tune.json`, `front.csv`, `front.svg`, a robot and a job with the chosen values.

use super::objectives::{OBJECTIVES, Objective};
use super::picture::{Front, front_svg};
use super::problem::{Course, Figures, Problem};
use crate::report::write_file;
use hilare_interfaces::messages::Waypoint;
use hilare_tuner::{Solution, hypervolume};
use serde::Serialize;
use serde_json::{Map, Value};
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// The file of the chosen robot, and of a job for it.
pub const SYSTEM_FILE: &str = "system.toml";
/// A job that `hilare run` takes.
pub const SCENARIO_FILE: &str = "scenario.toml";

/// What a search came to.
#[derive(Debug)]
pub struct Tuned<'a> {
    /// What was searched.
    pub problem: &'a Problem,
    /// By what.
    pub objectives: &'a [&'static Objective],
    /// Up to where hypervolume counts.
    pub reference: &'a [f64],
    /// The front, ascending in the first objective.
    pub front: &'a [Solution],
    /// Place of the chosen member.
    pub chosen: Option<usize>,
    /// Figures of the robot as it was, if it arrives.
    pub untuned: Option<Figures>,
    /// What the robot as it was is called.
    pub untuned_name: &'a str,
    /// Scenarios that were not searched on: figures as it was and with the chosen values.
    pub held_out: &'a [HeldOut],
    /// Evaluations, those before a stop included.
    pub evaluations: u64,
    /// Time of this search, s, since it was last resumed.
    pub seconds: f64,
    /// It was stopped before its end.
    pub stopped: bool,
}

/// A scenario that was not searched on.
#[derive(Debug)]
pub struct HeldOut {
    /// Its name.
    pub scenario: String,
    /// Figures of the robot as it was, if it arrives.
    pub untuned: Option<Figures>,
    /// Figures with the chosen values.
    pub chosen: Option<Figures>,
}

#[derive(Serialize)]
struct Point {
    objectives: Map<String, Value>,
    parameters: Map<String, Value>,
}

fn named<'k>(pairs: impl Iterator<Item = (&'k str, f64)>) -> Map<String, Value> {
    pairs.map(|(key, value)| (key.to_owned(), Value::from(value))).collect()
}

fn all_figures(figures: Option<Figures>) -> Value {
    let pairs = |figures: Figures| named(OBJECTIVES.iter().map(|objective| objective.key).zip(figures));
    figures.map_or(Value::Null, |figures| Value::Object(pairs(figures)))
}

impl Tuned<'_> {
    /// What the front dominates below the reference, in the product of the objectives' SI units.
    pub fn hypervolume(&self) -> f64 {
        hypervolume(self.front.iter().map(|solution| solution.objectives.as_slice()), self.reference)
    }

    /// The same as a share of the box between zero and the reference.
    pub fn share(&self) -> f64 {
        self.hypervolume() / self.reference.iter().product::<f64>()
    }

    fn ticks_per_second(&self) -> f64 {
        self.problem.ticks() as f64 / self.seconds.max(1e-9)
    }

    fn names(&self) -> impl Iterator<Item = &str> {
        self.problem.tuned().iter().map(|one| one.parameter.name.as_str())
    }

    fn keys(&self) -> impl Iterator<Item = &'static str> {
        self.objectives.iter().map(|objective| objective.key)
    }

    fn point(&self, objectives: &[f64], values: &[f64]) -> Point {
        Point {
            objectives: named(self.keys().zip(objectives.iter().copied())),
            parameters: named(self.names().zip(values.iter().copied())),
        }
    }

    /// `tune.json`.
    pub fn to_json(&self) -> String {
        let points = self.front.iter().map(|solution| self.point(&solution.objectives, &solution.values));
        let chosen = self.chosen.map(|index| &self.front[index]);
        let chosen = chosen.map(|solution| self.point(&solution.objectives, &solution.values));
        let held_out = self.held_out.iter().map(|held| {
            serde_json::json!({
                "scenario": held.scenario,
                "untuned": all_figures(held.untuned),
                "chosen": all_figures(held.chosen),
            })
        });
        let scenarios = self.problem.courses().iter().map(|course| course.scenario.name.as_str());
        let answer = serde_json::json!({
            "scenarios": scenarios.collect::<Vec<_>>(),
            "controller": self.problem.courses()[0].scenario.system.controller.law.name,
            "evaluations": self.evaluations,
            "stopped": self.stopped,
            "seconds": self.seconds,
            "ticks_per_second": self.ticks_per_second(),
            "reference": named(self.keys().zip(self.reference.iter().copied())),
            "hypervolume": self.hypervolume(),
            "hypervolume_share": self.share(),
            "untuned": {
                "figures": all_figures(self.untuned),
                "parameters": named(self.names().zip(self.problem.untuned())),
            },
            "chosen": chosen,
            "held_out": held_out.collect::<Vec<_>>(),
            "front": points.collect::<Vec<_>>(),
        });
        format!("{answer:#}\n")
    }

    /// `front.csv`: objectives, then parameters; SI.
    pub fn to_csv(&self) -> String {
        let heads: Vec<&str> = self.keys().map(|key| -> &str { key }).chain(self.names()).collect();
        let mut text = heads.join(",") + "\n";
        for solution in self.front {
            let numbers = solution.objectives.iter().chain(&solution.values);
            let cells: Vec<String> = numbers.map(|number| format!("{number:?}")).collect();
            text.push_str(&cells.join(","));
            text.push('\n');
        }
        text
    }

    /// Writes everything into `dir`, which is there.
    pub fn write(&self, dir: &Path) -> io::Result<()> {
        let points: Vec<Vec<f64>> = self.front.iter().map(|solution| solution.objectives.clone()).collect();
        let pick = |figures: Figures| -> Vec<f64> {
            let place = |objective: &Objective| OBJECTIVES.iter().position(|one| one.name == objective.name);
            self.objectives.iter().filter_map(|one| place(one)).map(|place| figures[place]).collect()
        };
        let untuned = self.untuned.map(pick);
        let course = &self.problem.courses()[0];
        let law = course.scenario.system.controller.law.name;
        let svg = front_svg(&Front {
            title: &format!("{}, {law}, {} evaluations", self.scenarios(), self.evaluations),
            objectives: self.objectives,
            points: &points,
            chosen: self.chosen.map(|index| points[index].as_slice()),
            untuned: untuned.as_deref().map(|point| (point, self.untuned_name)),
            reference: self.reference,
        })?;
        write_file(dir, "tune.json", &self.to_json())?;
        write_file(dir, "front.csv", &self.to_csv())?;
        write_file(dir, "front.svg", &svg)?;
        if let Some(index) = self.chosen {
            write_file(dir, SYSTEM_FILE, &self.problem.system(0, &self.front[index].values).to_toml())?;
            write_file(dir, SCENARIO_FILE, &scenario_toml(course))?;
        }
        Ok(())
    }

    fn scenarios(&self) -> String {
        let names = self.problem.courses().iter().map(|course| course.scenario.name.as_str());
        names.collect::<Vec<_>>().join(", ")
    }

    /// For people.
    pub fn to_text(&self) -> String {
        let law = self.problem.courses()[0].scenario.system.controller.law.name;
        let mut text = format!(
            "{}, {law}: {} evaluations in {:.1} s, {:.1} million ticks/s\n",
            self.scenarios(),
            self.evaluations,
            self.seconds,
            self.ticks_per_second() / 1e6
        );
        let pairs = self.objectives.iter().zip(self.reference);
        let limits: Vec<String> =
            pairs.map(|(one, limit)| format!("{} {}", round(limit * one.factor), one.unit)).collect();
        let _ = writeln!(
            text,
            "  front of {}, hypervolume {:.4} of the box up to {}\n",
            self.front.len(),
            self.share(),
            limits.join(", ")
        );
        let Some(chosen) = self.chosen.map(|index| &self.front[index]) else {
            text.push_str("  no run arrived\n");
            return text;
        };
        let _ = writeln!(text, "  {:<40}{:>16}{:>16}", "", self.untuned_name, "chosen");
        let figures = self.problem.figures(&chosen.values).ok();
        text.push_str(&rows(self.untuned, figures));
        for ((name, before), after) in self.names().zip(self.problem.untuned()).zip(&chosen.values) {
            let _ = writeln!(text, "  {name:<40}{:>16}{:>16}", round(before), round(*after));
        }
        for held in self.held_out {
            let _ = writeln!(text, "\n  held out: {}", held.scenario);
            text.push_str(&rows(held.untuned, held.chosen));
        }
        text
    }
}

/// Every figure before and after.
fn rows(before: Option<Figures>, after: Option<Figures>) -> String {
    let mut text = String::new();
    for (index, objective) in OBJECTIVES.iter().enumerate() {
        let cell = |figures: Option<Figures>| {
            figures.map_or_else(
                || "not arrived".to_owned(),
                |figures| format!("{:.3} {}", figures[index] * objective.factor, objective.unit),
            )
        };
        let _ = writeln!(text, "  {:<40}{:>16}{:>16}", objective.title, cell(before), cell(after));
    }
    text
}

/// Four digits.
fn round(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = 3 - value.abs().log10().floor() as i32;
    let digits = digits.clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// The course as a scenario of the robot that lies beside it.
fn scenario_toml(course: &Course) -> String {
    let waypoint = |waypoint: &Waypoint| {
        format!(
            "    [{:?}, {:?}, {:?}, {:?}],\n",
            waypoint.x_m, waypoint.y_m, waypoint.bulge, waypoint.crab_rad
        )
    };
    let waypoints: String = course.waypoints.iter().map(waypoint).collect();
    let description = format!("{} with the tuned robot", course.scenario.name);
    format!(
        "description = {}\nsystem = \"{SYSTEM_FILE}\"\nwaypoints_m = [\n{waypoints}]\n",
        toml::Value::from(description)
    )
}

#[cfg(test)]
mod tests {
    use super::round;

    #[test]
    fn numbers_have_four_digits() {
        let written = [0.0, 0.0247, 2_967_123.4, 552.0, 0.041, 1e-5, 12.345, -0.5].map(round);
        assert_eq!(written, ["0", "0.0247", "2967123", "552", "0.041", "0.00001", "12.35", "-0.5"]);
    }
}
