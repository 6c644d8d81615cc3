//! What can be minimised: figures of a run by name, those of `summary.json`.

use super::problem::Driven;

/// Names of the objectives that are taken if none are given: those of paper 1.
pub const STANDARD: &str = "cross-track-mean,speed-error";
/// Figures of a run that are objectives.
pub const COUNT: usize = OBJECTIVES.len();

/// An objective.
#[derive(Debug)]
pub struct Objective {
    /// Name on the command line.
    pub name: &'static str,
    /// Key in JSON and CSV; ends in its unit.
    pub key: &'static str,
    /// What it is called in tables and pictures, and the unit and factor used there.
    pub title: &'static str,
    /// Unit for people.
    pub unit: &'static str,
    /// From SI to it.
    pub factor: f64,
    /// Over several runs the greatest counts, not the mean.
    pub greatest: bool,
    /// Its value of a run.
    pub of: fn(&Driven) -> f64,
}

/// Every objective.
pub const OBJECTIVES: &[Objective] = &[
    Objective {
        name: "cross-track-mean",
        key: "cross_track_mean_m",
        title: "mean cross-track error",
        unit: "mm",
        factor: 1e3,
        greatest: false,
        of: |run| run.cross_track_mean_m,
    },
    Objective {
        name: "cross-track-max",
        key: "cross_track_max_m",
        title: "greatest cross-track error",
        unit: "mm",
        factor: 1e3,
        greatest: true,
        of: |run| run.cross_track_max_m,
    },
    Objective {
        name: "speed-error",
        key: "speed_error_mean_mps",
        title: "mean speed error",
        unit: "mm/s",
        factor: 1e3,
        greatest: false,
        of: |run| run.speed_error_mean_mps,
    },
    Objective {
        name: "time",
        key: "duration_s",
        title: "time",
        unit: "s",
        factor: 1.0,
        greatest: false,
        of: |run| run.ticks as f64 * hilare_interfaces::block::TICK_S,
    },
    Objective {
        name: "effort",
        key: "effort_per_s",
        title: "effort",
        unit: "1/s",
        factor: 1.0,
        greatest: false,
        of: |run| run.effort_per_s,
    },
];

/// The objectives of names separated by commas, as places in [`OBJECTIVES`]; two or three.
pub fn parse(text: &str) -> Result<Vec<usize>, String> {
    let mut chosen = Vec::new();
    for name in text.split(',').map(str::trim) {
        let index = OBJECTIVES.iter().position(|objective| objective.name == name).ok_or_else(|| {
            let known: Vec<&str> = OBJECTIVES.iter().map(|objective| objective.name).collect();
            format!("--objectives: unknown objective {name:?}; there are {}", known.join(", "))
        })?;
        if chosen.contains(&index) {
            return Err(format!("--objectives: {name} is given twice"));
        }
        chosen.push(index);
    }
    if !(2..=hilare_tuner::OBJECTIVES_MAX).contains(&chosen.len()) {
        return Err(format!("--objectives {text}: two or three are wanted, separated by commas"));
    }
    Ok(chosen)
}

/// As many numbers as there are objectives, each a finite one above 0.
pub fn parse_numbers(flag: &str, text: &str, count: usize) -> Result<Vec<f64>, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let sound = |numbers: &Vec<f64>| {
        numbers.len() == count && numbers.iter().all(|number| number.is_finite() && *number > 0.0)
    };
    numbers.filter(sound).ok_or_else(|| {
        format!("{flag} {text:?}: {count} numbers above 0 are wanted, separated by commas, one an objective")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_or_three_different_known_ones() {
        assert_eq!(parse(STANDARD), Ok(vec![0, 2]));
        assert_eq!(parse("time, effort,cross-track-max").map(|chosen| chosen.len()), Ok(3));
        for wrong in ["", "time", "time,time", "time,tme", "time,effort,speed-error,cross-track-mean"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        assert_eq!(parse_numbers("--weights", "1, 2.5", 2), Ok(vec![1.0, 2.5]));
        for wrong in ["1", "1,2,3", "1,x", "1,-2", "1,nan", "1,inf", "0,1"] {
            assert!(parse_numbers("--weights", wrong, 2).is_err(), "{wrong}");
        }
    }
}
