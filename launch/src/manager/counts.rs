//! What keeps a process from its work: counted by the kernel, and by the process itself.

use super::Manager;
use super::member::Duty;
use crate::shell::page::SharedPage;
use hilare_interfaces::wires::Role;
use serde::{Deserialize, Serialize};
use std::fs;

/// Since the process began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Counts {
    /// Steps that took more than a tenth of the time until the next one; its predecessors' included.
    pub over_budget: u64,
    /// Pages that were not in memory, whether or not the disk was needed.
    pub page_faults: u64,
    /// Times something else took the processor from it.
    pub involuntary_switches: u64,
}

impl Counts {
    /// Of the process `pid` in `slot`; zero what cannot be read any more.
    pub(super) fn of(page: &SharedPage, slot: usize, pid: u32) -> Self {
        let read = |name: &str| fs::read_to_string(format!("/proc/{pid}/{name}")).unwrap_or_default();
        Self {
            over_budget: page.timing(slot).over_budget(),
            page_faults: page_faults(&read("stat")),
            involuntary_switches: involuntary_switches(&read("status")),
        }
    }

    /// What came after `before`.
    pub fn since(self, before: Self) -> Self {
        Self {
            over_budget: self.over_budget.saturating_sub(before.over_budget),
            page_faults: self.page_faults.saturating_sub(before.page_faults),
            involuntary_switches: self.involuntary_switches.saturating_sub(before.involuntary_switches),
        }
    }
}

/// Page faults of a process so far, minor and major, from its `/proc/PID/stat`.
pub(super) fn page_faults(stat: &str) -> u64 {
    // The name in parentheses may hold anything; minflt and majflt are the 8th and 10th after it.
    let after = stat.rsplit_once(')').map_or("", |(_, after)| after);
    let field = |n: usize| after.split_whitespace().nth(n).and_then(|text| text.parse::<u64>().ok());
    field(7).unwrap_or(0) + field(9).unwrap_or(0)
}

/// Times a process lost its processor while it wanted to go on, from its `/proc/PID/status`.
fn involuntary_switches(status: &str) -> u64 {
    let count = status.lines().find_map(|line| line.strip_prefix("nonvoluntary_ctxt_switches:"));
    count.and_then(|count| count.trim().parse().ok()).unwrap_or(0)
}

impl Manager {
    /// Of every process in charge of its box, by name.
    pub fn counts(&self) -> Vec<(Role, Counts)> {
        let at_work = self.members.iter().enumerate().filter(|(_, member)| member.duty == Duty::Work);
        at_work
            .filter_map(|(slot, member)| {
                let pid = member.running.as_ref()?.pid;
                Some((member.role, Counts::of(&self.page, slot, pid)))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_found_behind_any_name() {
        let stat = "7 (a) b (c) S 1 2 3 4 5 6 70 8 9 10 11";
        assert_eq!(page_faults(stat), 79);
        assert_eq!(page_faults(""), 0);
    }

    #[test]
    fn switches_are_told_from_those_it_wanted() {
        let status = "Name:\tx\nvoluntary_ctxt_switches:\t150\nnonvoluntary_ctxt_switches:\t545\n";
        assert_eq!(involuntary_switches(status), 545);
        assert_eq!(involuntary_switches(""), 0);
    }

    #[test]
    fn our_own_can_be_read() {
        let page = SharedPage::create().expect("a page");
        let counts = Counts::of(&page, 0, std::process::id());
        assert!(counts.page_faults > 0 && counts.over_budget == 0, "{counts:?}");
        assert_eq!(counts.since(counts), Counts::default());
    }
}
