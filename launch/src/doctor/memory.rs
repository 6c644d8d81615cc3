//! Memory: locked, shared, enough of it.

use super::{Finding, Machine, Verdict};
use crate::manager::robot_dir::SHM_NEEDED;
use crate::shell::realtime::may_lock_everything;
use rustix::process::{Resource, getrlimit};

/// Locked memory that does for the control path.
const LOCK_NEEDED: u64 = 64 << 20;
/// Memory below which the kernel may soon have to kill.
const AVAILABLE_NEEDED: u64 = 128 << 20;

pub(super) fn lock() -> Finding {
    judge_lock(may_lock_everything(), getrlimit(Resource::Memlock).current.unwrap_or(u64::MAX))
}

fn judge_lock(everything: bool, limit: u64) -> Finding {
    const CHECK: &str = "memlock";
    if everything {
        return Finding::good(CHECK, "all memory can be locked");
    }
    if limit >= LOCK_NEEDED {
        return Finding::good(CHECK, format!("{} MB", limit >> 20));
    }
    Finding::warning(
        CHECK,
        format!("{} kB: pages of the control path may be swapped or faulted in late", limit >> 10),
        "ulimit -l unlimited (LimitMEMLOCK=infinity, memlock unlimited in /etc/security/limits.conf; \
         docker: --ulimit memlock=-1)",
    )
}

pub(super) fn shared() -> Finding {
    match rustix::fs::statvfs("/dev/shm") {
        Ok(stat) => judge_shared(stat.f_bavail * stat.f_frsize),
        Err(error) => Finding::bad(SHARED, error.to_string(), "mount -t tmpfs tmpfs /dev/shm"),
    }
}

const SHARED: &str = "/dev/shm";

fn judge_shared(free: u64) -> Finding {
    let verdict = if free < SHM_NEEDED { Verdict::Bad } else { Verdict::Good };
    let cure = "mount -o remount,size=64M /dev/shm, or free some (docker: --shm-size=64m)";
    let found = format!("{} MB free, a robot needs {}", free >> 20, SHM_NEEDED >> 20);
    Finding::new(SHARED, verdict, found, cure)
}

/// What is left of the machine's memory, or of the control group's.
pub(super) fn available(machine: &Machine) -> Finding {
    const CHECK: &str = "memory";
    let Some(kb) = machine.number_after("/proc/meminfo", "MemAvailable:") else {
        return Finding::unknown(CHECK, "/proc/meminfo does not say");
    };
    let left = (kb << 10).min(left_of_group(machine).unwrap_or(u64::MAX));
    if left >= AVAILABLE_NEEDED {
        return Finding::good(CHECK, format!("{} MB available", left >> 20));
    }
    Finding::warning(
        CHECK,
        format!(
            "{} MB available: the kernel may have to kill, and begins with recorder, relay and planner",
            left >> 20
        ),
        "end what is not needed, or give more (MemoryMax= of the unit; docker: --memory)",
    )
}

fn left_of_group(machine: &Machine) -> Option<u64> {
    let groups = machine.text("/proc/self/cgroup")?;
    let path = groups.lines().find_map(|line| line.strip_prefix("0::"))?.trim_end_matches('/');
    let of = |name: &str| machine.number::<u64>(&format!("/sys/fs/cgroup{path}/memory.{name}"));
    Some(of("max")?.saturating_sub(of("current")?))
}

/// Whether memory can go to a disk and take its time to come back.
pub(super) fn swap(machine: &Machine, locked: bool) -> Finding {
    const CHECK: &str = "swap";
    let Some(text) = machine.text("/proc/swaps") else {
        return Finding::unknown(CHECK, "/proc/swaps is not readable");
    };
    let places = text.lines().skip(1).filter_map(|line| line.split_whitespace().next());
    let disks: Vec<&str> = places.filter(|place| !place.contains("zram")).collect();
    if disks.is_empty() {
        return Finding::good(CHECK, "none on a disk");
    }
    let disks = disks.join(", ");
    if locked {
        return Finding::good(CHECK, format!("{disks}; the control path is locked in memory"));
    }
    Finding::warning(
        CHECK,
        format!("{disks}, and memory cannot be locked: the control path may have to wait for the disk"),
        "swapoff -a, or see memlock",
    )
}

/// Pages that the kernel puts together and moves behind the back of a real-time process, even if they are locked:
/// kernels with PREEMPT_RT have that off.
pub(super) fn huge_pages(machine: &Machine) -> Finding {
    const CHECK: &str = "huge pages";
    const FILE: &str = "/sys/kernel/mm/transparent_hugepage/enabled";
    let Some(text) = machine.text(FILE) else {
        return Finding::good(CHECK, "not of this kernel");
    };
    let mode = text.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map(|(mode, _)| mode);
    match mode {
        Some("always") => Finding::warning(
            CHECK,
            "always: the kernel moves pages of the control path while it runs",
            format!("echo madvise > {FILE} (transparent_hugepage=madvise on the kernel's command line)"),
        ),
        Some(mode) => Finding::good(CHECK, mode),
        None => Finding::unknown(CHECK, format!("{FILE} does not say")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Verdict::{Bad, Good, Unknown, Warning};
    use super::super::machine::fake::Fake;
    use super::*;

    #[test]
    fn limits_are_judged() {
        assert_eq!(judge_lock(true, 0).verdict, Good);
        assert_eq!(judge_lock(false, 64 << 20).verdict, Good);
        let little = judge_lock(false, 8 << 20);
        assert!(little.verdict == Warning && little.found.starts_with("8192 kB"), "{little:?}");
        assert_eq!((judge_shared(SHM_NEEDED).verdict, judge_shared(SHM_NEEDED - 1).verdict), (Good, Bad));
    }

    #[test]
    fn what_the_group_leaves_counts_as_well() {
        let fake = Fake::new(&[("/proc/meminfo", "MemTotal: 900000 kB\nMemAvailable:   600000 kB\n")]);
        assert_eq!(available(&fake.machine).found, "585 MB available");
        fake.put("/proc/self/cgroup", "0::/a/b\n");
        fake.put("/sys/fs/cgroup/a/b/memory.max", "max\n");
        fake.put("/sys/fs/cgroup/a/b/memory.current", "52428800\n");
        assert_eq!(available(&fake.machine).verdict, Good);
        fake.put("/sys/fs/cgroup/a/b/memory.max", "104857600\n");
        let little = available(&fake.machine);
        assert!(little.verdict == Warning && little.found.starts_with("50 MB"), "{little:?}");
        fake.put("/proc/meminfo", "MemTotal: 900000 kB\n");
        assert_eq!(available(&fake.machine).verdict, Unknown);
        assert_eq!(available(&Fake::new(&[]).machine).verdict, Unknown);
    }

    #[test]
    fn swap_on_a_disk_matters_where_nothing_is_locked() {
        const HEAD: &str = "Filename Type Size Used Priority\n";
        let of = |places: &str, locked| {
            let fake = Fake::new(&[("/proc/swaps", &format!("{HEAD}{places}"))]);
            swap(&fake.machine, locked).verdict
        };
        assert_eq!((of("", false), of("/dev/zram0 partition 1 0 100\n", false)), (Good, Good));
        assert_eq!(
            (of("/dev/sda2 partition 1 0 -2\n", false), of("/swapfile file 1 0 -2", true)),
            (Warning, Good)
        );
        assert_eq!(swap(&Fake::new(&[]).machine, false).verdict, Unknown);
    }

    #[test]
    fn huge_pages_for_everybody_are_told() {
        const FILE: &str = "/sys/kernel/mm/transparent_hugepage/enabled";
        let of = |text: &str| huge_pages(&Fake::new(&[(FILE, text)]).machine).verdict;
        assert_eq!(of("[always] madvise never\n"), Warning);
        assert_eq!((of("always [madvise] never\n"), of("always madvise [never]")), (Good, Good));
        assert_eq!((of("?"), huge_pages(&Fake::new(&[]).machine).verdict), (Unknown, Good));
    }
}
