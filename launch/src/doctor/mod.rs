//! What this machine allows, each finding with its cure: `hilare doctor`.
//!
//! A check reads files below a root ([`Machine`]) or asks the kernel, and judges; what cannot be found out stays
//! unknown. Bad is only what keeps a robot from coming up or from driving.

mod kernel;
mod machine;
mod memory;
mod place;
mod power;
mod processor;
mod robots;

pub use machine::Machine;

use serde::Serialize;

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Nothing to do.
    Good,
    /// It runs, and could run better.
    Warning,
    /// A robot does not run like this.
    Bad,
    /// It cannot be found out from here.
    Unknown,
}

/// One check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub check: &'static str,
    /// How it came out.
    pub verdict: Verdict,
    /// What was found.
    pub found: String,
    /// What to do; empty if nothing.
    pub cure: String,
}

impl Finding {
    fn new(check: &'static str, verdict: Verdict, found: impl Into<String>, cure: impl Into<String>) -> Self {
        let cure = if verdict == Verdict::Good { String::new() } else { cure.into() };
        Self { check, verdict, found: found.into(), cure }
    }

    fn good(check: &'static str, found: impl Into<String>) -> Self {
        Self::new(check, Verdict::Good, found, "")
    }

    fn warning(check: &'static str, found: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::new(check, Verdict::Warning, found, cure)
    }

    fn bad(check: &'static str, found: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::new(check, Verdict::Bad, found, cure)
    }

    fn unknown(check: &'static str, found: impl Into<String>) -> Self {
        Self::new(check, Verdict::Unknown, found, "")
    }
}

/// Every check, on this machine. Takes a fifth of a second, in which interrupts are counted.
pub fn findings() -> Vec<Finding> {
    let machine = Machine::this();
    let interrupts = processor::Interrupts::of(&machine);
    let since = std::time::Instant::now();
    let mut findings = vec![
        kernel::realtime_priority(),
        memory::lock(),
        kernel::throttling(&machine),
        kernel::preemption(&machine),
        kernel::timer(),
        kernel::clock_source(&machine),
        kernel::quota(&machine),
        processor::cores(),
        processor::governor(&machine),
        processor::idle_states(&machine),
        processor::host(&machine),
        power::heat(&machine),
        memory::available(&machine),
        memory::swap(&machine, crate::shell::realtime::may_lock_everything()),
        memory::huge_pages(&machine),
        memory::shared(),
        place::runtime_dir(),
        place::disk(),
        place::open_files(),
        place::ports(),
        robots::leftovers(),
        robots::running(),
    ];
    std::thread::sleep(processor::COUNTED.saturating_sub(since.elapsed()));
    let after = processor::Interrupts::of(&machine);
    let counted = processor::interrupts(&machine, &interrupts, &after, since.elapsed());
    let place = findings.iter().position(|finding| finding.check == "idle states").map_or(0, |at| at + 1);
    findings.insert(place, counted);
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_check_is_there_once_and_has_a_cure_where_it_complains() {
        let findings = findings();
        assert!(findings.len() >= 20, "{findings:?}");
        for (n, finding) in findings.iter().enumerate() {
            assert!(findings[..n].iter().all(|other| other.check != finding.check), "{finding:?}");
            assert!(!finding.found.is_empty() && !finding.found.contains('\n'), "{finding:?}");
            let complains = matches!(finding.verdict, Verdict::Warning | Verdict::Bad);
            assert_eq!(finding.cure.is_empty(), !complains, "{finding:?}");
        }
    }

    #[test]
    fn the_guide_lists_every_check() {
        let guide = include_str!("../../../docs/doctor.md");
        for finding in findings() {
            assert!(guide.contains(&format!("\n| {} |", finding.check)), "{}", finding.check);
        }
    }
}
