//! Units that are taken for one another, and how much larger a number then is.

use hilare_interfaces::params::{ParamKind, ParamSpec};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// A unit that a number may have been written in, in words, and its number for a value of 1 in the key's unit.
pub(super) type Mistake = (&'static str, f64);

/// Stands for the unit of a pure number that is at most 1.
const SHARE: &str = "share";
const DEGREES: f64 = 360.0 / TAU;
const RPM: f64 = 60.0 / TAU;

/// The unit of a key in words, and those it is taken for, the likeliest first.
pub(super) fn mistakes(unit: &str) -> (&'static str, &'static [Mistake]) {
    match unit {
        "m" => ("SI", &[("millimetres", 1e3), ("centimetres", 1e2)]),
        "m/s" => ("SI", &[("mm/s", 1e3), ("cm/s", 1e2), ("km/h", 3.6)]),
        "m/s^2" => ("SI", &[("mm/s^2", 1e3), ("cm/s^2", 1e2)]),
        "rad" => ("radians", &[("degrees", DEGREES)]),
        "rad/s" => ("rad/s", &[("degrees a second", DEGREES), ("turns a minute", RPM)]),
        "rad/s^2" => ("rad/s^2", &[("degrees", DEGREES)]),
        "s" => ("seconds", &[("milliseconds", 1e3), ("microseconds", 1e6)]),
        "ticks" => ("ticks of 1 ms", &[("microseconds", 1e3), ("seconds", 1e-3)]),
        "ms" => ("milliseconds", &[("microseconds", 1e3), ("seconds", 1e-3)]),
        "us" => ("microseconds", &[("nanoseconds", 1e3), ("milliseconds", 1e-3)]),
        "Hz" => ("Hz", &[("kHz", 1e-3)]),
        "1/s" => ("1/s", &[("1/ms", 1e-3)]),
        "1/m" => ("1/m", &[("1/mm", 1e-3), ("1/cm", 1e-2)]),
        "1/m^2" => ("1/m^2", &[("1/mm^2", 1e-6), ("1/cm^2", 1e-4)]),
        "1/rad" => ("1/rad", &[("1/degree", 1.0 / DEGREES)]),
        "m/sqrt(m)" => ("SI", &[("millimetres", 1e3), ("centimetres", 1e2)]),
        "kg" => ("kilograms", &[("grams", 1e3)]),
        "kg m^2" => ("SI", &[("kg cm^2", 1e4), ("g cm^2", 1e7)]),
        "N m" => ("N m", &[("N mm", 1e3), ("N cm", 1e2)]),
        "N m/A" => ("N m/A", &[("N mm/A", 1e3)]),
        "ohm" => ("ohm", &[("milliohm", 1e3)]),
        "V" => ("volts", &[("millivolts", 1e3)]),
        SHARE => ("a share", &[("percent", 1e2)]),
        _ => ("SI", &[]),
    }
}

/// The unit of a key, [`SHARE`] where it has none and is one.
pub(super) fn unit_of(spec: &ParamSpec) -> &'static str {
    let share = spec.unit.is_empty() && spec.kind == ParamKind::Real && spec.max <= 1.0;
    if share { SHARE } else { spec.unit }
}

/// `; did you mean …?` where a value fits once it is read in a unit that the key's is taken for.
pub(super) fn meant(unit: &str, value: f64, fits: RangeInclusive<f64>) -> Option<String> {
    let (right, wrong) = mistakes(unit);
    let (name, factor) = wrong.iter().find(|(_, factor)| fits.contains(&(value / factor)))?;
    Some(question(value / factor, right, name))
}

/// The same for a value that is hardly above what is usual: of several units the one that changes it least.
pub(super) fn meant_barely(unit: &str, value: f64, fits: RangeInclusive<f64>) -> Option<String> {
    let (right, wrong) = mistakes(unit);
    let fitting = wrong.iter().filter(|(_, factor)| fits.contains(&(value / factor)));
    let (name, factor) = fitting.min_by(|one, other| one.1.total_cmp(&other.1))?;
    Some(question(value / factor, right, name))
}

fn question(meant: f64, right: &str, wrong: &str) -> String {
    // Four digits are enough to recognize it.
    let shown: f64 = format!("{meant:.3e}").parse().unwrap_or(meant);
    format!("; did you mean {shown} ({right}, not {wrong})?")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_likeliest_unit_that_fits_is_named() {
        assert_eq!(meant("m", 54.0, 0.005..=5.0).unwrap(), "; did you mean 0.054 (SI, not millimetres)?");
        assert_eq!(meant("m", 5.4, 0.05..=0.06).unwrap(), "; did you mean 0.054 (SI, not centimetres)?");
        assert_eq!(meant("rad", 90.0, -6.3..=6.3).unwrap(), "; did you mean 1.571 (radians, not degrees)?");
        assert_eq!(meant_barely("m/s", 4.1, 0.0..=0.068).unwrap(), "; did you mean 0.041 (SI, not cm/s)?");
        assert_eq!(meant("m", 1e9, 0.0..=1.0), None);
        assert_eq!(meant("N m s/rad", 1e3, 0.0..=100.0), None);
    }
}
