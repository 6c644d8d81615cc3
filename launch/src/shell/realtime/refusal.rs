//! Why the kernel refuses SCHED_FIFO, and what to do.

use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, capabilities};
use std::fmt;
use std::path::{Path, PathBuf};

/// Why SCHED_FIFO is refused to this process, as far as can be told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FifoRefusal {
    /// It has neither the privilege nor a limit that is high enough.
    Limit {
        /// The highest priority it may ask for.
        allowed: u64,
    },
    /// It may ask, but its control group has no time for real-time work (RT_GROUP_SCHED).
    Group {
        /// The group.
        group: String,
        /// The file with its budget, where groups have one of their own (cgroup v1).
        budget: Option<PathBuf>,
    },
    /// Something else: a sandbox, perhaps.
    Unknown,
}

impl FifoRefusal {
    /// Of this process and its children, for a priority.
    pub fn find(priority: u64) -> Self {
        let privileged =
            capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::SYS_NICE));
        let allowed = getrlimit(Resource::Rtprio).current.unwrap_or(u64::MAX);
        if !privileged && allowed < priority {
            return Self::Limit { allowed };
        }
        let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
        group_without_budget(&groups, Path::new("/sys/fs/cgroup")).unwrap_or(Self::Unknown)
    }

    /// What to do.
    pub fn cure(&self) -> String {
        match self {
            Self::Limit { .. } => {
                "ulimit -r 99 (LimitRTPRIO=99 in a unit, rtprio 99 in /etc/security/limits.conf; \
                                   docker: --ulimit rtprio=99), or CAP_SYS_NICE"
                    .to_owned()
            }
            Self::Group { budget: Some(budget), .. } => format!(
                "echo 400000 > {} (each group above it needs as much), or start it from the root group",
                budget.display()
            ),
            Self::Group { budget: None, .. } => {
                "start it from the root group (echo $$ > /sys/fs/cgroup/cgroup.procs), or boot with \
                 rt_group_sched=0"
                    .to_owned()
            }
            Self::Unknown => "look for a sandbox (seccomp, a security module) that forbids it".to_owned(),
        }
    }
}

impl fmt::Display for FifoRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Limit { allowed } => write!(f, "no CAP_SYS_NICE, and its rtprio limit is {allowed}"),
            Self::Group { group, .. } => {
                write!(f, "its control group {group} has no real-time budget (RT_GROUP_SCHED)")
            }
            Self::Unknown => f.write_str("neither limits nor control group forbid it"),
        }
    }
}

/// The process's group of the processor controller, if it is one without time for real-time work. `groups` is
/// `/proc/self/cgroup`; `mounted` is where the hierarchies are.
fn group_without_budget(groups: &str, mounted: &Path) -> Option<FifoRefusal> {
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, group) = (parts.next()?, parts.next()?);
        if controllers.split(',').any(|controller| controller == "cpu") {
            let budget =
                mounted.join(controllers).join(group.trim_start_matches('/')).join("cpu.rt_runtime_us");
            let none = std::fs::read_to_string(&budget).is_ok_and(|text| text.trim() == "0");
            return none.then(|| FifoRefusal::Group { group: group.to_owned(), budget: Some(budget) });
        }
    }
    // One hierarchy for all: there groups have no budget of their own, and none but the root one has any.
    let unified = groups.lines().find_map(|line| line.strip_prefix("0::"))?;
    (unified != "/").then(|| FifoRefusal::Group { group: unified.to_owned(), budget: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_group_without_a_budget_is_named() {
        let dir = tempfile::tempdir().expect("a directory");
        let group = dir.path().join("cpu/robots");
        std::fs::create_dir_all(&group).expect("a group");
        let budget = group.join("cpu.rt_runtime_us");
        let find = |groups: &str| group_without_budget(groups, dir.path());
        let groups = "4:memory:/a\n1:cpu:/robots\n0::/\n";
        std::fs::write(&budget, "950000\n").expect("written");
        assert_eq!(find(groups), None);
        std::fs::write(&budget, "0\n").expect("written");
        let found = find(groups).expect("no budget");
        assert_eq!(found, FifoRefusal::Group { group: "/robots".into(), budget: Some(budget.clone()) });
        assert!(found.cure().contains(&budget.display().to_string()), "{}", found.cure());
        assert!(found.to_string().contains("/robots"));
        assert_eq!(
            find("0::/user.slice\n"),
            Some(FifoRefusal::Group { group: "/user.slice".into(), budget: None })
        );
        assert_eq!(find("0::/\n"), None);
        assert_eq!(find(""), None);
    }
}
