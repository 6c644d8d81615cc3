//! TOML text into a flat list of entries that know their place.

use super::error::{ConfigError, line_of, quoted};
use super::keys::Section;
use toml::de::{DeInteger, DeTable, DeValue};

/// A value as it was written.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value<'t> {
    /// A number; NaN and infinities included.
    Number(f64),
    /// `true` or `false`.
    Switch(bool),
    /// A string.
    Text(&'t str),
    /// What stands after `=` on the command line, where quotes do not tell text from numbers.
    Word(&'t str),
    /// A section.
    Section,
    /// Something no key takes, by its TOML name.
    Other(&'static str),
}

impl<'t> Value<'t> {
    /// From the parser's value.
    pub(super) fn new(value: &'t DeValue<'_>) -> Self {
        match value {
            DeValue::Integer(integer) => Self::Number(integer_to_f64(integer)),
            DeValue::Float(float) => Self::Number(float.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(on) => Self::Switch(*on),
            DeValue::String(text) => Self::Text(text),
            DeValue::Table(_) => Self::Section,
            DeValue::Datetime(_) => Self::Other("a date"),
            DeValue::Array(_) => Self::Other("an array"),
        }
    }

    /// What it is, for errors.
    pub(super) fn describe(&self) -> String {
        match self {
            Self::Number(value) => format!("the number {value}"),
            Self::Switch(on) => on.to_string(),
            Self::Text(text) | Self::Word(text) => quoted(text),
            Self::Section => "a section".to_owned(),
            Self::Other(what) => (*what).to_owned(),
        }
    }
}

fn integer_to_f64(integer: &DeInteger<'_>) -> f64 {
    // Beyond i128 every bound is passed anyway.
    i128::from_str_radix(integer.as_str(), integer.radix()).map_or(f64::INFINITY, |value| value as f64)
}

/// A key with its value and place.
#[derive(Clone, Debug)]
pub(super) struct Entry<'t> {
    /// What stands before the section in the file: `set.` in a scenario.
    pub prefix: &'static str,
    /// Section, without prefix; empty at the top.
    pub section: String,
    /// Key.
    pub name: &'t str,
    /// Value.
    pub value: Value<'t>,
    /// Byte offset of the key.
    pub offset: usize,
}

/// A parsed file.
pub(super) struct Document<'t> {
    origin: &'t str,
    text: &'t str,
    /// Its top-level table.
    pub root: DeTable<'t>,
}

impl<'t> Document<'t> {
    /// Parses TOML; `origin` is the file's name in errors.
    pub(super) fn parse(origin: &'t str, text: &'t str) -> Result<Self, ConfigError> {
        match DeTable::parse(text) {
            Ok(root) => Ok(Self { origin, text, root: root.into_inner() }),
            Err(error) => {
                let span = error.span().unwrap_or(text.len()..text.len());
                let place = format!("{origin}:{}", line_of(text.as_bytes(), span.start));
                Err(ConfigError::new(place, syntax_error(error.message(), text.get(span))))
            }
        }
    }

    /// An error at a byte offset.
    pub(super) fn error(&self, offset: usize, what: impl std::fmt::Display) -> ConfigError {
        ConfigError::new(self.place(offset), what)
    }

    /// File and line of a byte offset.
    pub(super) fn place(&self, offset: usize) -> String {
        format!("{}:{}", self.origin, line_of(self.text.as_bytes(), offset))
    }

    /// An error of the file as a whole.
    pub(super) fn error_of_file(&self, what: impl std::fmt::Display) -> ConfigError {
        ConfigError::new(self.origin, what)
    }

    /// All entries of a system file, in the file's order.
    pub(super) fn entries(&self) -> Vec<Entry<'_>> {
        entries(&self.root, "", "")
    }
}

fn syntax_error(message: &str, at: Option<&str>) -> String {
    match at.filter(|at| !at.trim().is_empty()) {
        Some(key) if message == "duplicate key" => {
            format!("{} stands here a second time; delete one of them", quoted(key))
        }
        Some(at) => format!("not TOML at {}: {message}", quoted(at)),
        None => format!("not TOML: {message}"),
    }
}

/// The entries of a table that stands at `section`, in the file's order. Sections nobody knows are
/// listed, not entered: a hostile file costs no more than its own size.
pub(super) fn entries<'t>(table: &'t DeTable<'_>, prefix: &'static str, section: &str) -> Vec<Entry<'t>> {
    let mut found = Vec::new();
    walk(table, prefix, section, &mut found);
    found.sort_by_key(|entry| entry.offset);
    found
}

fn walk<'t>(table: &'t DeTable<'_>, prefix: &'static str, section: &str, found: &mut Vec<Entry<'t>>) {
    for (key, value) in table {
        let name = key.get_ref().as_ref();
        found.push(Entry {
            prefix,
            section: section.to_owned(),
            name,
            value: Value::new(value.get_ref()),
            offset: key.span().start,
        });
        if let DeValue::Table(inner) = value.get_ref()
            && let Some(child) = Section::child(section, name)
        {
            walk(inner, prefix, &child, found);
        }
    }
}
