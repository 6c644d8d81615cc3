//! What is searched: parameters, their bounds, and how a coordinate of the swarm becomes a value.
//!
//! The swarm flies in the unit cube, so that a gain of millions and one of hundredths are equally far
//! across. A coordinate u means
//!
//! ```text
//! real         low + (high − low) u
//! logarithmic  low (high/low)^u             equal ratios are equally far
//! integer      low + ⌊(high − low + 1) u⌋   every number owns an equal part
//! ```

use std::fmt;

/// How a parameter's range is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Any number, evenly.
    Real,
    /// Any number, evenly in its logarithm; both bounds are positive.
    Logarithmic,
    /// Whole numbers only; both bounds are whole.
    Integer,
}

/// One searched number.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in logs and reports.
    pub name: String,
    /// Least value.
    pub low: f64,
    /// Greatest value; above `low`.
    pub high: f64,
    /// How the range between is divided.
    pub kind: Kind,
}

/// Why a space cannot be searched.
#[derive(Clone, Debug, PartialEq)]
pub enum SpaceError {
    /// There is no parameter.
    Empty,
    /// A parameter's bounds make no range of its kind.
    Bounds {
        /// Its name.
        name: String,
        /// What they must be.
        wanted: &'static str,
    },
    /// Two parameters have one name.
    Twice(String),
}

impl fmt::Display for SpaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "there is no parameter to search"),
            Self::Bounds { name, wanted } => write!(f, "{name}: {wanted}"),
            Self::Twice(name) => write!(f, "{name}: given twice"),
        }
    }
}

impl std::error::Error for SpaceError {}

/// The parameters in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    parameters: Vec<Parameter>,
}

/// Whole numbers up to here are exact, and so is their count.
const WHOLE_MAX: f64 = 4_503_599_627_370_496.0;

impl Parameter {
    fn check(&self) -> Result<(), &'static str> {
        let Self { low, high, kind, .. } = *self;
        if !(low.is_finite() && high.is_finite() && (high - low).is_finite()) {
            return Err("the bounds must be finite numbers");
        }
        if low >= high {
            return Err("the lower bound must be below the upper one");
        }
        match kind {
            Kind::Logarithmic if low <= 0.0 => Err("a logarithmic range needs bounds above 0"),
            Kind::Integer if low.trunc() != low || high.trunc() != high => {
                Err("the bounds of a whole number must be whole")
            }
            Kind::Integer if low < -WHOLE_MAX || high > WHOLE_MAX => {
                Err("the bounds of a whole number must be within 4e15")
            }
            _ => Ok(()),
        }
    }

    /// The value of a coordinate in 0 ≤ u ≤ 1.
    fn value(&self, u: f64) -> f64 {
        let Self { low, high, kind, .. } = *self;
        // The borders to the bit, whatever the rounding between them.
        if u >= 1.0 {
            return high;
        }
        let value = match kind {
            Kind::Real => low + (high - low) * u,
            Kind::Logarithmic => low * libm::exp(u * libm::log(high / low)),
            Kind::Integer => low + ((high - low + 1.0) * u).floor(),
        };
        value.clamp(low, high)
    }

    /// A coordinate of a value within the bounds.
    fn coordinate(&self, value: f64) -> f64 {
        let Self { low, high, kind, .. } = *self;
        let u = match kind {
            Kind::Real => (value - low) / (high - low),
            Kind::Logarithmic => libm::log(value / low) / libm::log(high / low),
            // The middle of the part it owns.
            Kind::Integer => (value - low + 0.5) / (high - low + 1.0),
        };
        u.clamp(0.0, 1.0)
    }

    /// True if the parameter can have this value.
    pub fn allows(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value) && (self.kind != Kind::Integer || value.trunc() == value)
    }
}

impl Space {
    /// A space of these parameters, or what is wrong with them.
    pub fn new(parameters: Vec<Parameter>) -> Result<Self, SpaceError> {
        if parameters.is_empty() {
            return Err(SpaceError::Empty);
        }
        for (index, parameter) in parameters.iter().enumerate() {
            let name = || parameter.name.clone();
            parameter.check().map_err(|wanted| SpaceError::Bounds { name: name(), wanted })?;
            if parameters[..index].iter().any(|other| other.name == parameter.name) {
                return Err(SpaceError::Twice(name()));
            }
        }
        Ok(Self { parameters })
    }

    /// The parameters in order.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Number of parameters.
    pub fn dimensions(&self) -> usize {
        self.parameters.len()
    }

    /// The values of coordinates in the unit cube.
    #[inline]
    pub fn decode(&self, coordinates: &[f64], values: &mut [f64]) {
        for ((value, &u), parameter) in values.iter_mut().zip(coordinates).zip(&self.parameters) {
            *value = parameter.value(u);
        }
    }

    /// Coordinates of values; `None` if one is not allowed or there are not as many as parameters.
    pub fn encode(&self, values: &[f64]) -> Option<Vec<f64>> {
        if values.len() != self.parameters.len() {
            return None;
        }
        let pairs = || self.parameters.iter().zip(values);
        let fits = pairs().all(|(parameter, &value)| parameter.allows(value));
        fits.then(|| pairs().map(|(parameter, &value)| parameter.coordinate(value)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(low: f64, high: f64, kind: Kind) -> Parameter {
        Parameter { name: "p".to_owned(), low, high, kind }
    }

    #[test]
    fn integers_own_equal_parts() {
        let dice = parameter(1.0, 6.0, Kind::Integer);
        let mut seen = [0; 6];
        for n in 0..600 {
            seen[dice.value((n as f64 + 0.5) / 600.0) as usize - 1] += 1;
        }
        assert_eq!(seen, [100; 6]);
        assert_eq!((dice.value(0.0), dice.value(1.0)), (1.0, 6.0));
    }

    #[test]
    fn equal_ratios_are_equally_far() {
        let gain = parameter(1e-4, 1e4, Kind::Logarithmic);
        assert!((gain.value(0.5) - 1.0).abs() < 1e-12);
        assert!((gain.value(0.75) - 100.0).abs() < 1e-9);
        assert_eq!((gain.value(0.0), gain.value(1.0)), (1e-4, 1e4));
    }

    #[test]
    fn ranges_that_are_none_are_refused() {
        let refused = |low, high, kind| Space::new(vec![parameter(low, high, kind)]).is_err();
        assert!(refused(1.0, 1.0, Kind::Real));
        assert!(refused(f64::NAN, 1.0, Kind::Real));
        assert!(refused(f64::MIN, f64::MAX, Kind::Real), "their difference is no number");
        assert!(refused(0.0, 1.0, Kind::Logarithmic));
        assert!(refused(0.5, 2.0, Kind::Integer));
        assert!(refused(0.0, 1e16, Kind::Integer));
        assert_eq!(Space::new(Vec::new()), Err(SpaceError::Empty));
        let twice = vec![parameter(0.0, 1.0, Kind::Real); 2];
        assert_eq!(Space::new(twice), Err(SpaceError::Twice("p".to_owned())));
    }

    #[test]
    fn only_allowed_values_have_coordinates() {
        let space = Space::new(vec![parameter(0.0, 9.0, Kind::Integer)]).expect("a space");
        assert_eq!(space.encode(&[3.5]), None);
        assert_eq!(space.encode(&[10.0]), None);
        assert_eq!(space.encode(&[f64::NAN]), None);
        assert_eq!(space.encode(&[1.0, 2.0]), None);
    }
}
