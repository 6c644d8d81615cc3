//! Parameters as data: name, unit, default, bounds, one line of documentation.
//!
//! A box declares its parameters once with [`param_group!`](crate::param_group); the system file
//! reader, `--set`, the documentation and the tuner's bounds all read the same table.

use core::fmt;

/// How a parameter's value is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParamKind {
    /// A real number.
    Real,
    /// A whole number.
    Integer,
    /// `true` or `false` (0 or 1 inside).
    Switch,
}

/// One parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParamSpec {
    /// Key in the system file; ends in its unit.
    pub name: &'static str,
    /// How it is written.
    pub kind: ParamKind,
    /// SI unit, empty for a pure number.
    pub unit: &'static str,
    /// Value when the key is absent.
    pub default: f64,
    /// Least allowed value.
    pub min: f64,
    /// Greatest allowed value.
    pub max: f64,
    /// What it is.
    pub doc: &'static str,
}

/// Why a value was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamError {
    /// The group has no parameter of this name.
    Unknown,
    /// NaN or infinite.
    NotFinite,
    /// A whole number is wanted.
    NotInteger,
    /// Outside `spec.min..=spec.max`.
    OutOfBounds {
        /// The refused value.
        value: f64,
        /// The parameter it was meant for.
        spec: &'static ParamSpec,
    },
    /// Inside its bounds, but at odds with something else; the text says what it must be.
    Conflict(&'static str),
}

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => write!(f, "unknown parameter"),
            Self::NotFinite => write!(f, "must be a finite number"),
            Self::NotInteger => write!(f, "must be a whole number"),
            Self::Conflict(why) => write!(f, "{why}"),
            Self::OutOfBounds { value, spec } => {
                let unit = if spec.unit.is_empty() { "" } else { " " };
                let unit = format_args!("{unit}{}", spec.unit);
                write!(f, "{value}{unit} is outside {} to {}{unit}", spec.min, spec.max)?;
                // A value a thousandfold too large is nearly always millimetres in a metre key.
                let thousandth = value / 1e3;
                if spec.unit.starts_with('m') && (spec.min..=spec.max).contains(&thousandth) {
                    write!(f, "; did you mean {thousandth} (SI, not millimetres)?")?;
                }
                Ok(())
            }
        }
    }
}

impl core::error::Error for ParamError {}

impl ParamSpec {
    /// Checks a value against kind and bounds.
    pub fn check(&'static self, value: f64) -> Result<f64, ParamError> {
        if !value.is_finite() {
            return Err(ParamError::NotFinite);
        }
        if self.kind != ParamKind::Real && libm::trunc(value) != value {
            return Err(ParamError::NotInteger);
        }
        if !(self.min..=self.max).contains(&value) {
            return Err(ParamError::OutOfBounds { value, spec: self });
        }
        Ok(value)
    }
}

/// A set of parameters that belong to one box.
pub trait ParamGroup: Default + Clone {
    /// The parameters in order.
    const SPECS: &'static [ParamSpec];

    /// The value of a parameter, or `None` for an unknown name.
    fn get(&self, name: &str) -> Option<f64>;

    /// Sets a parameter after checking it.
    fn set(&mut self, name: &str, value: f64) -> Result<(), ParamError>;
}

/// A Rust type a parameter can have.
pub trait ParamValue: Copy {
    /// How it is written.
    const KIND: ParamKind;
    /// From a checked value.
    fn from_f64(value: f64) -> Self;
    /// Back again.
    fn to_f64(self) -> f64;
}

impl ParamValue for f64 {
    const KIND: ParamKind = ParamKind::Real;
    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
}

impl ParamValue for u64 {
    const KIND: ParamKind = ParamKind::Integer;
    fn from_f64(value: f64) -> Self {
        value as Self
    }
    fn to_f64(self) -> f64 {
        self as f64
    }
}

impl ParamValue for bool {
    const KIND: ParamKind = ParamKind::Switch;
    fn from_f64(value: f64) -> Self {
        value != 0.0
    }
    fn to_f64(self) -> f64 {
        f64::from(u8::from(self))
    }
}

/// Declares a parameter group: a struct, its defaults and its [`ParamSpec`] table.
///
/// ```
/// hilare_interfaces::param_group! {
///     /// Gains of an example.
///     Example {
///         /// Proportional gain.
///         gain_per_s: f64 = 2.0, "1/s", 0.0, 10.0;
///     }
/// }
/// use hilare_interfaces::params::ParamGroup;
/// let mut example = Example::default();
/// assert!(example.set("gain_per_s", 11.0).is_err());
/// assert_eq!(example.gain_per_s, 2.0);
/// ```
#[macro_export]
macro_rules! param_group {
    ($(#[$doc:meta])* $name:ident {
        $($(#[doc = $fdoc:literal])+ $field:ident : $type:ident = $default:expr, $unit:literal, $min:expr, $max:expr;)*
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name { $($(#[doc = $fdoc])+ pub $field: $type,)* }

        impl Default for $name {
            fn default() -> Self { Self { $($field: $default,)* } }
        }

        impl $crate::params::ParamGroup for $name {
            const SPECS: &'static [$crate::params::ParamSpec] = &[$($crate::params::ParamSpec {
                name: stringify!($field),
                kind: <$type as $crate::params::ParamValue>::KIND,
                unit: $unit,
                default: $crate::param_default!($type, $default),
                min: $min as f64,
                max: $max as f64,
                doc: concat!($($fdoc),+),
            },)*];

            fn get(&self, name: &str) -> Option<f64> {
                match name {
                    $(stringify!($field) => Some($crate::params::ParamValue::to_f64(self.$field)),)*
                    _ => None,
                }
            }

            fn set(&mut self, name: &str, value: f64) -> Result<(), $crate::params::ParamError> {
                let spec = Self::SPECS.iter().find(|spec| spec.name == name)
                    .ok_or($crate::params::ParamError::Unknown)?;
                let value = spec.check(value)?;
                match name {
                    $(stringify!($field) => self.$field = $crate::params::ParamValue::from_f64(value),)*
                    _ => return Err($crate::params::ParamError::Unknown),
                }
                Ok(())
            }
        }
    };
}

/// A parameter's default as `f64` in a const table.
#[doc(hidden)]
#[macro_export]
macro_rules! param_default {
    (bool, $default:expr) => {
        $default as u8 as f64
    };
    ($type:ident, $default:expr) => {
        $default as f64
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    crate::param_group! {
        /// For the tests.
        Sample {
            /// A length.
            track_m: f64 = 0.05, "m", 0.01, 1.0;
            /// A count.
            cycles: u64 = 2, "", 0, 10;
            /// A switch.
            enabled: bool = true, "", 0, 1;
        }
    }

    #[test]
    fn defaults_stand_in_the_table() {
        let sample = Sample::default();
        for spec in Sample::SPECS {
            assert_eq!(sample.get(spec.name), Some(spec.default), "{}", spec.name);
        }
        assert_eq!(Sample::SPECS[0].doc.trim(), "A length.");
    }

    #[test]
    fn refused_values_change_nothing() {
        let mut sample = Sample::default();
        assert_eq!(sample.set("trak_m", 0.1), Err(ParamError::Unknown));
        assert_eq!(sample.set("track_m", f64::NAN), Err(ParamError::NotFinite));
        assert_eq!(sample.set("cycles", 1.5), Err(ParamError::NotInteger));
        let error = sample.set("track_m", 54.0).unwrap_err().to_string();
        assert!(error.contains("54 m is outside 0.01 to 1 m; did you mean 0.054"), "{error}");
        assert_eq!(sample, Sample::default());
        sample.set("enabled", 0.0).unwrap();
        assert!(!sample.enabled);
    }
}
