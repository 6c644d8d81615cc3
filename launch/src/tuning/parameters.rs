//! What is searched: the parameters in the law's spec, the limits where its paper tunes them, and what
//! `--parameter` adds or changes.

use crate::config::{Form, Key, System};
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::params::{ParamKind, ParamSpec};
use hilare_tuner::{Kind, Parameter};

/// A range whose ends are this far apart, and above 0, is searched by ratios unless it says otherwise.
const LOGARITHMIC_FROM: f64 = 100.0;
/// Sections a tuner may change. The others say what the robot is, or do nothing to one run.
const TUNABLE: [&str; 4] = ["controller", "limits", "tracking", "estimator"];

/// A key of the system and the range it is searched in.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// The key.
    pub key: Key,
    /// Its full name, range and kind.
    pub parameter: Parameter,
}

/// The parameters to search: those of the system's law, as `given` (`KEY=LOW..HIGH[:log|:int]`) changes and
/// extends them, less those that `fixed` (`KEY=VALUE`) sets.
pub fn parameters(system: &System, given: &[String], fixed: &[String]) -> Result<Vec<Tuned>, String> {
    let law = system.controller.law;
    let section = format!("controller.{}", law.name);
    let mut tuned = Vec::new();
    for spec in law.params {
        let name = format!("{section}.{}", spec.name);
        let key = system.number_key(&name).ok_or_else(|| format!("{name}: not a key of this robot"))?;
        let parameter = Parameter { name, low: spec.min, high: spec.max, kind: usual_kind(spec) };
        tuned.push(Tuned { key, parameter });
    }
    if law.tunes_limits {
        tuned.extend(paper_limits(system));
    }
    let is_fixed = |name: &str| {
        fixed.iter().any(|assignment| assignment.split('=').next().is_some_and(|key| key.trim() == name))
    };
    tuned.retain(|one| !is_fixed(&one.parameter.name));
    for text in given {
        let one = parse(system, text, &section)?;
        let name = &one.parameter.name;
        if is_fixed(name) {
            return Err(format!("--parameter {text}: --set sets {name}; it is searched or set, not both"));
        }
        match tuned.iter_mut().find(|known| known.parameter.name == *name) {
            Some(known) => *known = one,
            None => tuned.push(one),
        }
    }
    if tuned.is_empty() {
        return Err(format!("{}: nothing is left to tune; add --parameter KEY=LOW..HIGH", law.name));
    }
    Ok(tuned)
}

/// [MH18] table 2: v_max 40–100 mm/s and ω_max 0–0.75 rad/s, for v_r = 40 mm/s and w_T = 54 mm. For other robots
/// in the same proportions to v_r and v_r/w_T.
fn paper_limits(system: &System) -> impl Iterator<Item = Tuned> {
    let Chassis::Differential(wheels) = &system.chassis else { return Vec::new().into_iter() };
    let speed = system.tracking.speed_mps / 0.040;
    let ranges = [
        ("limits.v_max_mps", 0.040 * speed, 0.100 * speed),
        ("limits.omega_max_radps", 0.0, 0.75 * speed * (0.054 / wheels.track_m)),
    ];
    let tuned = ranges.into_iter().filter_map(|(name, low, high)| {
        let key = system.number_key(name)?;
        let Form::Number(spec) = key.form else { return None };
        let parameter = Parameter { name: name.to_owned(), low, high: high.min(spec.max), kind: Kind::Real };
        Some(Tuned { key, parameter })
    });
    tuned.collect::<Vec<_>>().into_iter()
}

fn usual_kind(spec: &ParamSpec) -> Kind {
    match spec.kind {
        ParamKind::Integer | ParamKind::Switch => Kind::Integer,
        ParamKind::Real if spec.min > 0.0 && spec.max / spec.min >= LOGARITHMIC_FROM => Kind::Logarithmic,
        ParamKind::Real => Kind::Real,
    }
}

/// `KEY=LOW..HIGH`, with `:log` or `:int` behind it. A name without a section is one of the law's.
fn parse(system: &System, text: &str, law_section: &str) -> Result<Tuned, String> {
    let wrong = |what: &str| format!("--parameter {text:?}: {what}");
    let wanted = "write KEY=LOW..HIGH, KEY=LOW..HIGH:log or :int, such as limits.v_max_mps=0.04..0.1";
    let (name, range) = text.split_once('=').ok_or_else(|| wrong(wanted))?;
    let name = name.trim();
    let name = if name.contains('.') { name.to_owned() } else { format!("{law_section}.{name}") };
    let key = system.number_key(&name);
    let key = key.ok_or_else(|| wrong(&format!("this robot has no number {name:?} to tune")))?;
    let Form::Number(spec) = key.form else { return Err(wrong(wanted)) };
    let top = name.split('.').next().unwrap_or_default();
    let another_law = name.starts_with("controller.")
        && name.matches('.').count() > 1
        && !name.starts_with(&format!("{law_section}."));
    if another_law {
        return Err(wrong(&format!("it is not of the law that drives ({law_section})")));
    }
    if !TUNABLE.contains(&top) {
        return Err(wrong(&format!("of these sections only: {}", TUNABLE.join(", "))));
    }
    let (range, kind) = match range.rsplit_once(':') {
        None => (range, if spec.kind == ParamKind::Real { Kind::Real } else { Kind::Integer }),
        Some((range, "log")) if spec.kind == ParamKind::Real => (range, Kind::Logarithmic),
        Some((range, "int")) => (range, Kind::Integer),
        Some((_, "log")) => return Err(wrong("it is a whole number, which is not searched by ratios")),
        Some(_) => return Err(wrong(wanted)),
    };
    let (low, high) = range.split_once("..").ok_or_else(|| wrong(wanted))?;
    let bound = |text: &str| -> Result<f64, String> {
        let number = text.trim().parse().map_err(|_| wrong(wanted))?;
        spec.check(number).map_err(|error| wrong(&error.to_string()))
    };
    let parameter = Parameter { low: bound(low)?, high: bound(high)?, name, kind };
    hilare_tuner::Space::new(vec![parameter.clone()]).map_err(|error| wrong(&error.to_string()))?;
    Ok(Tuned { key, parameter })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Scenario;

    fn system(name: &str, law: &str) -> System {
        let mut system = Scenario::load(name).expect("built in").system;
        system.set(&format!("controller.law={law}")).expect("a law");
        system
    }

    fn ranges(system: &System, given: &[&str], fixed: &[&str]) -> Result<Vec<(String, f64, f64)>, String> {
        let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let tuned = parameters(system, &owned(given), &owned(fixed))?;
        Ok(tuned.into_iter().map(|one| (one.parameter.name, one.parameter.low, one.parameter.high)).collect())
    }

    #[test]
    fn kanayama_on_the_e_puck_is_table_2() {
        let found = ranges(&system("trapezoid", "kanayama"), &[], &[]).expect("ranges");
        let table = [
            ("controller.kanayama.k1_per_s", 0.0, 5.0),
            ("controller.kanayama.k2_per_m2", 0.0, 5e6),
            ("controller.kanayama.k3_per_m", 0.0, 5e3),
            ("limits.v_max_mps", 0.04, 0.1),
            ("limits.omega_max_radps", 0.0, 0.75),
        ];
        assert_eq!(found, table.map(|(name, low, high)| (name.to_owned(), low, high)));
    }

    #[test]
    fn given_ranges_replace_and_extend_and_set_keys_are_not_searched() {
        let e_puck = system("trapezoid", "kanayama");
        let given = ["k1_per_s=0.01..1:log", "tracking.speed_mps=0.03..0.05"];
        let found =
            ranges(&e_puck, &given, &["limits.v_max_mps=0.05", "plant.slip_mean=0.1"]).expect("ranges");
        let names: Vec<&str> =
            found.iter().map(|(name, ..)| name.rsplit('.').next().expect("a name")).collect();
        assert_eq!(names, ["k1_per_s", "k2_per_m2", "k3_per_m", "omega_max_radps", "speed_mps"]);
        assert_eq!((found[0].1, found[0].2), (0.01, 1.0));
        let wrong = [
            "k1_per_s",
            "k1_per_s=1",
            "k1_per_s=2..1",
            "k1_per_s=0..1:log",
            "k1_per_s=0..9",
            "k1_per_s=0..x",
            "k1_per_s=0..1:lin",
            "k9=0..1",
            "controller.law=0..1",
            "controller.qp.horizon=1..2",
            "chassis.track_m=0.05..0.06",
            "plant.slip_mean=0..0.1",
        ];
        for text in wrong {
            let error = ranges(&e_puck, &[text], &[]).expect_err(text);
            assert!(
                error.starts_with(&format!("--parameter {text:?}: ")) && !error.contains('\n'),
                "{error}"
            );
        }
        assert!(ranges(&e_puck, &["k1_per_s=0..1"], &["controller.kanayama.k1_per_s=1"]).is_err());
    }

    #[test]
    fn every_law_has_ranges_on_the_robots_it_drives() {
        for (name, chassis) in [("trapezoid", "differential"), ("agv-low", "mecanum")] {
            for law in hilare_controller::LAWS.iter().filter(|law| law.chassis.contains(&chassis)) {
                let system = system(name, law.name);
                let tuned = parameters(&system, &[], &[]).expect("ranges");
                let space = tuned.iter().map(|one| one.parameter.clone()).collect();
                hilare_tuner::Space::new(space).expect("a space");
                for one in tuned {
                    let now = system.get(&one.parameter.name).expect("a number");
                    assert!(one.parameter.allows(now), "{name} {}: {now}", one.parameter.name);
                }
            }
        }
    }
}
