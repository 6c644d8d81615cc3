//! The newest lines of the merged log, for whoever asks launch: the operator's page.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Lines that are kept.
const LINES: usize = 1000;
/// Characters of a line that are kept.
const LONGEST: usize = 400;
/// Bytes of lines in one answer: a caller's socket has to take it at once.
const ANSWER: usize = 48 << 10;

/// A line that was said.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// When, s of CLOCK_MONOTONIC.
    pub at_s: f64,
    /// INFO, WARN, ERROR.
    pub level: String,
    /// Who said what.
    pub text: String,
}

/// The newest lines.
#[derive(Default)]
pub(super) struct Recent {
    lines: VecDeque<Said>,
    /// Lines there have ever been.
    count: u64,
}

impl Recent {
    /// One more, in our format.
    pub fn add(&mut self, line: &str) {
        let mut words = line.trim_start().splitn(2, ' ');
        let at_s = words.next().and_then(|word| word.parse().ok()).unwrap_or(0.0);
        let (level, text) = words.next().unwrap_or_default().split_once(' ').unwrap_or(("INFO", line));
        let text = text.trim().chars().take(LONGEST).collect();
        if self.lines.len() == LINES {
            self.lines.pop_front();
        }
        self.lines.push_back(Said { at_s, level: level.to_owned(), text });
        self.count += 1;
    }

    /// Lines after the first `after` there have been, and how many that makes; see [`ANSWER`].
    pub fn since(&self, after: u64) -> (u64, Vec<Said>) {
        let oldest = self.count - self.lines.len() as u64;
        // Of another launch, perhaps.
        let from = if after > self.count { oldest } else { after.max(oldest) };
        let mut bytes = 0;
        let fits = |line: &&Said| {
            // As JSON: with what stands around it, and quotes escaped.
            bytes += line.text.len() + line.text.matches(['"', '\\']).count() + 64;
            bytes <= ANSWER
        };
        let lines: Vec<Said> =
            self.lines.iter().skip((from - oldest) as usize).take_while(fits).cloned().collect();
        (from + lines.len() as u64, lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_told_once_in_order_and_the_oldest_are_forgotten() {
        let mut recent = Recent::default();
        assert_eq!(recent.since(0), (0, Vec::new()));
        recent.add("     1234.000005 WARN  plant: it slips: \"much\"");
        let said = Said {
            at_s: 1234.000005,
            level: "WARN".to_owned(),
            text: "plant: it slips: \"much\"".to_owned(),
        };
        assert_eq!(recent.since(0), (1, vec![said]));
        assert_eq!(recent.since(1), (1, Vec::new()));
        (0..5000).for_each(|n| recent.add(&format!("5.0 INFO  relay: {n} {}", "\"".repeat(5000))));
        let (mut at, mut all) = (1, Vec::new());
        loop {
            let (next, lines) = recent.since(at);
            assert!(serde_json::to_string(&lines).expect("JSON").len() <= ANSWER);
            if lines.is_empty() {
                break;
            }
            (at, all) = (next, [all, lines].concat());
        }
        assert_eq!((at, all.len()), (5001, LINES));
        assert!(all[0].text.starts_with("relay: 4000 ") && all[LINES - 1].text.starts_with("relay: 4999 "));
        assert_eq!(
            recent.since(9999).1.first(),
            all.first(),
            "a launch that began anew is heard from its beginning"
        );
    }
}
