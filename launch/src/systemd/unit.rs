//! The text of a unit file.

use std::fmt::{Display, Write};
use std::path::Path;

/// A unit file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Name of the file: `hilare-epuck.service`.
    pub name: String,
    /// What stands in it.
    pub text: String,
}

impl Unit {
    /// An empty one.
    pub(super) fn new(name: String) -> Self {
        Self { name, text: String::new() }
    }

    /// Begins a section.
    pub(super) fn section(&mut self, name: &str) {
        let gap = if self.text.is_empty() { "" } else { "\n" };
        let _ = writeln!(self.text, "{gap}[{name}]");
    }

    /// Says why the next lines are there.
    pub(super) fn why(&mut self, reason: &str) {
        let _ = writeln!(self.text, "# {reason}");
    }

    /// A setting.
    pub(super) fn set(&mut self, key: &str, value: impl Display) {
        let _ = writeln!(self.text, "{key}={value}");
    }
}

/// A command line as `Exec…=` wants it: program first, as a path.
pub(super) fn command_line(program: &Path, arguments: &[String]) -> Result<String, String> {
    // In the program's place a dollar sign stands for itself.
    let mut line = quoted(&text_of(program)?.replace('%', "%%"));
    for argument in arguments {
        if argument.contains(char::is_control) {
            return Err(format!("{argument:?}: a unit file cannot hold control characters; rename it"));
        }
        line.push(' ');
        line.push_str(&quoted(&argument.replace('%', "%%").replace('$', "$$")));
    }
    Ok(line)
}

/// A path as text that a unit file can hold.
fn text_of(path: &Path) -> Result<String, String> {
    let text = path.to_str().filter(|text| !text.contains(char::is_control));
    let text =
        text.ok_or_else(|| format!("{}: a unit file needs a path in UTF-8; rename it", path.display()))?;
    Ok(text.to_owned())
}

/// A word of a command line, in quotes where it needs them.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%$".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("\"{}\"", word.replace('\\', "\\\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_arrive_as_they_were() {
        let line = |words: &[&str]| {
            command_line(
                Path::new("/opt/a b/100%$/hilare"),
                &words.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>(),
            )
        };
        assert_eq!(line(&["up", "epuck"]).unwrap(), "\"/opt/a b/100%%$/hilare\" up epuck");
        assert!(line(&["my robot.toml"]).unwrap().ends_with(" \"my robot.toml\""));
        assert!(line(&["50%", "$HOME"]).unwrap().ends_with(" 50%% $$HOME"));
        assert!(line(&["a\"b\\c", ";", ""]).unwrap().ends_with(r#" "a\"b\\c" ";" """#));
        assert!(line(&["two\nlines"]).unwrap_err().contains("control characters"));
    }
}
