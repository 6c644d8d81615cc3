//! What the kernel grants and how it schedules.

use super::{Finding, Machine};
use crate::shell::realtime::{FifoRefusal, set_fifo};
use rustix::time::{ClockId, clock_getres};

/// Coarsest timer that makes a tick of 1 ms.
const TIMER_NS_MAX: i64 = 100_000;
/// Sources of time that are read without a system call, and some that are good enough.
const SLOW_CLOCKS: [&str; 6] = ["hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit", "xen"];

/// Tries SCHED_FIFO in a thread of its own, because limits alone do not tell (control groups).
pub(super) fn realtime_priority() -> Finding {
    const CHECK: &str = "rtprio";
    match std::thread::spawn(|| set_fifo(80, true)).join() {
        Ok(Ok(())) => Finding::good(CHECK, "SCHED_FIFO 80 is granted"),
        Ok(Err(_)) => {
            let why = FifoRefusal::find(80);
            let found = format!("SCHED_FIFO 80 is refused ({why}): the real clock runs best effort");
            Finding::warning(CHECK, found, why.cure())
        }
        Err(_) => Finding::bad(CHECK, "the check itself failed", "report it"),
    }
}

pub(super) fn throttling(machine: &Machine) -> Finding {
    const CHECK: &str = "rt throttling";
    match machine.number::<i64>("/proc/sys/kernel/sched_rt_runtime_us") {
        Some(0) => Finding::bad(
            CHECK,
            "sched_rt_runtime_us is 0: real-time threads do not run at all",
            "sysctl kernel.sched_rt_runtime_us=950000",
        ),
        Some(-1) => Finding::good(CHECK, "off: a real-time thread that spins holds its processor for ever"),
        Some(us) => Finding::good(CHECK, format!("{us} us a second for real-time work")),
        None => Finding::warning(CHECK, "unknown: /proc/sys/kernel is not readable", "mount /proc"),
    }
}

/// Whether the kernel itself can be interrupted by a real-time process.
pub(super) fn preemption(machine: &Machine) -> Finding {
    const CHECK: &str = "preemption";
    const CURE: &str = "a kernel with PREEMPT_RT (Debian: apt install linux-image-rt-amd64 or -arm64; Ubuntu: pro \
                        enable realtime-kernel)";
    let Some(version) = machine.text("/proc/version") else {
        return Finding::unknown(CHECK, "/proc/version is not readable");
    };
    let release: String = version.split_whitespace().nth(2).unwrap_or("of unknown release").to_owned();
    let has = |word: &str| version.split_whitespace().any(|found| found == word);
    if has("PREEMPT_RT") || machine.text("/sys/kernel/realtime").as_deref() == Some("1") {
        return Finding::good(CHECK, format!("PREEMPT_RT, Linux {release}"));
    }
    if has("PREEMPT_DYNAMIC") {
        // `none voluntary (full)`; root alone can read it, and the command line tells most.
        let debug = machine.text("/sys/kernel/debug/sched/preempt");
        let now = debug.as_deref().and_then(|text| text.split_once('(')?.1.split_once(')'));
        let asked = machine.text("/proc/cmdline").unwrap_or_default();
        let asked = asked.split_whitespace().filter_map(|word| word.strip_prefix("preempt=")).next_back();
        let cure = format!("preempt=full on the kernel's command line, or {CURE}");
        return match now.map(|(mode, _)| mode).or(asked) {
            Some("full") => Finding::good(CHECK, format!("full, Linux {release}")),
            Some(mode) => {
                let found = format!("{mode}, Linux {release}: work of the kernel delays the tick");
                Finding::warning(CHECK, found, cure)
            }
            None => Finding::unknown(
                CHECK,
                format!(
                    "set at boot, Linux {release}; which mode, root sees in /sys/kernel/debug/sched/preempt"
                ),
            ),
        };
    }
    if has("PREEMPT") {
        return Finding::good(CHECK, format!("full, Linux {release}"));
    }
    let found = format!("none or voluntary, Linux {release}: work of the kernel delays the tick");
    Finding::warning(CHECK, found, CURE)
}

pub(super) fn timer() -> Finding {
    let resolution = clock_getres(ClockId::Monotonic);
    judge_timer(resolution.tv_sec.saturating_mul(1_000_000_000).saturating_add(resolution.tv_nsec))
}

fn judge_timer(resolution_ns: i64) -> Finding {
    const CHECK: &str = "timer";
    if resolution_ns <= TIMER_NS_MAX {
        return Finding::good(CHECK, format!("{resolution_ns} ns"));
    }
    Finding::warning(
        CHECK,
        format!("{} us: ticks of 1 ms come by fits and starts", resolution_ns / 1000),
        "a kernel with CONFIG_HIGH_RES_TIMERS, and no highres=off on its command line",
    )
}

/// How long it takes to read the time, which every box does at every tick.
pub(super) fn clock_source(machine: &Machine) -> Finding {
    const CHECK: &str = "clock source";
    const DIR: &str = "/sys/devices/system/clocksource/clocksource0";
    let Some(current) = machine.text(&format!("{DIR}/current_clocksource")) else {
        return Finding::unknown(CHECK, "not told");
    };
    if !SLOW_CLOCKS.contains(&&*current) {
        return Finding::good(CHECK, current);
    }
    let others = machine.text(&format!("{DIR}/available_clocksource")).unwrap_or_default();
    let better = others.split_whitespace().find(|other| !SLOW_CLOCKS.contains(other));
    let cure = match better {
        Some(better) => format!("echo {better} > {DIR}/current_clocksource"),
        None => "look in dmesg why the kernel calls the TSC unstable; if it is not, tsc=reliable on its command line"
            .to_owned(),
    };
    Finding::warning(CHECK, format!("{current}: each look at the clock takes microseconds"), cure)
}

/// A group whose processor time is rationed: what is used up early is missing for the rest of the period.
pub(super) fn quota(machine: &Machine) -> Finding {
    const CHECK: &str = "cpu quota";
    let Some(groups) = machine.text("/proc/self/cgroup") else {
        return Finding::unknown(CHECK, "/proc/self/cgroup is not readable");
    };
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':');
        let (Some(_), Some(controllers), Some(path)) = (fields.next(), fields.next(), fields.next()) else {
            continue;
        };
        let unified = controllers.is_empty();
        if !unified && !controllers.split(',').any(|name| name == "cpu") {
            continue;
        }
        // In a container the path may be that of the host: its own group is then the root of what is mounted.
        for group in ancestors(path) {
            let limit = if unified { unified_limit(machine, group) } else { old_limit(machine, group) };
            if let Some((quota_us, period_us)) = limit {
                let found = format!(
                    "{:.2} processors by control group {group}: what is not SCHED_FIFO stands still when they are used up",
                    quota_us as f64 / period_us.max(1) as f64
                );
                let cure = "no quota for a robot: CPUQuota= empty in its unit (docker: --cpuset-cpus=2,3 instead of --cpus)";
                return Finding::warning(CHECK, found, cure);
            }
        }
    }
    Finding::good(CHECK, "none")
}

fn ancestors(path: &str) -> impl Iterator<Item = &str> {
    std::iter::successors(Some(path.trim_end_matches('/')), |path| Some(path.rsplit_once('/')?.0))
}

fn unified_limit(machine: &Machine, group: &str) -> Option<(u64, u64)> {
    let text = machine.text(&format!("/sys/fs/cgroup{group}/cpu.max"))?;
    let (quota, period) = text.split_once(' ')?;
    Some((quota.parse().ok()?, period.parse().ok()?))
}

fn old_limit(machine: &Machine, group: &str) -> Option<(u64, u64)> {
    let of = |name: &str| {
        let path = |dir: &str| format!("/sys/fs/cgroup/{dir}{group}/cpu.cfs_{name}_us");
        machine.number::<i64>(&path("cpu")).or_else(|| machine.number(&path("cpu,cpuacct")))
    };
    let (quota, period) = (of("quota")?, of("period")?);
    Some((u64::try_from(quota).ok()?, u64::try_from(period).ok()?))
}

#[cfg(test)]
mod tests {
    use super::super::Verdict::{self, Bad, Good, Unknown, Warning};
    use super::super::machine::fake::Fake;
    use super::*;

    fn verdict(check: fn(&Machine) -> Finding, files: &[(&str, &str)]) -> (Verdict, String) {
        let finding = check(&Fake::new(files).machine);
        (finding.verdict, format!("{} | {}", finding.found, finding.cure))
    }

    #[test]
    fn throttling_is_bad_only_where_nothing_runs() {
        const FILE: &str = "/proc/sys/kernel/sched_rt_runtime_us";
        for (text, wanted) in [("950000", Good), ("-1", Good), ("0", Bad), ("x", Warning)] {
            assert_eq!(verdict(throttling, &[(FILE, text)]).0, wanted, "{text}");
        }
        assert_eq!(verdict(throttling, &[]).0, Warning);
    }

    #[test]
    fn preemption_is_found_in_the_version_or_stays_unknown() {
        let version = |model: &str| format!("Linux version 6.1.0-18-arm64 (me@there) #1 SMP {model} Debian");
        let of = |model: &str, more: &[(&str, &str)]| {
            let version = version(model);
            verdict(preemption, &[&[("/proc/version", &*version)], more].concat())
        };
        assert_eq!(of("PREEMPT_RT", &[]), (Good, "PREEMPT_RT, Linux 6.1.0-18-arm64 | ".to_owned()));
        assert_eq!(of("PREEMPT", &[("/sys/kernel/realtime", "1\n")]).0, Good);
        assert_eq!(of("PREEMPT", &[]).0, Good);
        let (found, said) = of("", &[]);
        assert!(found == Warning && said.contains("linux-image-rt"), "{said}");
        const DEBUG: &str = "/sys/kernel/debug/sched/preempt";
        assert_eq!(of("PREEMPT_DYNAMIC", &[]).0, Unknown);
        assert_eq!(of("PREEMPT_DYNAMIC", &[(DEBUG, "none voluntary (full) lazy\n")]).0, Good);
        let (found, said) = of("PREEMPT_DYNAMIC", &[(DEBUG, "none (voluntary) full\n")]);
        assert!(
            found == Warning && said.starts_with("voluntary,") && said.contains("preempt=full"),
            "{said}"
        );
        assert_eq!(of("PREEMPT_DYNAMIC", &[("/proc/cmdline", "quiet preempt=none preempt=full")]).0, Good);
        assert_eq!(of("PREEMPT_DYNAMIC", &[("/proc/cmdline", "preempt=none")]).0, Warning);
        assert_eq!(verdict(preemption, &[]).0, Unknown);
        assert_eq!(verdict(preemption, &[("/proc/version", "")]).0, Warning);
    }

    #[test]
    fn a_coarse_timer_is_told() {
        assert_eq!(judge_timer(1).verdict, Good);
        let coarse = judge_timer(4_000_000);
        assert!(coarse.verdict == Warning && coarse.found.starts_with("4000 us"), "{coarse:?}");
    }

    #[test]
    fn slow_clocks_are_told_with_a_better_one_if_there_is() {
        const DIR: &str = "/sys/devices/system/clocksource/clocksource0";
        let (current, available) =
            (format!("{DIR}/current_clocksource"), format!("{DIR}/available_clocksource"));
        for fast in ["tsc", "kvm-clock", "arch_sys_counter", "timer"] {
            assert_eq!(verdict(clock_source, &[(&current, fast)]).0, Good, "{fast}");
        }
        let (found, said) = verdict(clock_source, &[(&current, "hpet\n"), (&available, "hpet tsc acpi_pm ")]);
        assert!(found == Warning && said.contains("echo tsc > /sys"), "{said}");
        let (found, said) = verdict(clock_source, &[(&current, "acpi_pm"), (&available, "hpet acpi_pm")]);
        assert!(found == Warning && said.contains("tsc=reliable"), "{said}");
        assert_eq!(verdict(clock_source, &[]).0, Unknown);
    }

    #[test]
    fn a_quota_is_found_in_its_group_and_in_those_above_it() {
        const SELF: &str = "/proc/self/cgroup";
        let of = |files: &[(&str, &str)]| verdict(quota, files);
        assert_eq!(of(&[]).0, Unknown);
        assert_eq!(of(&[(SELF, "0::/\n")]).0, Good);
        let unit = (SELF, "0::/system.slice/hilare.service\n");
        let none = ("/sys/fs/cgroup/system.slice/hilare.service/cpu.max", "max 100000\n");
        assert_eq!(of(&[unit, none]).0, Good);
        let (found, said) = of(&[unit, none, ("/sys/fs/cgroup/system.slice/cpu.max", "50000 100000\n")]);
        assert!(
            found == Warning && said.starts_with("0.50 processors by control group /system.slice"),
            "{said}"
        );
        let (found, said) = of(&[(SELF, "0::/\n"), ("/sys/fs/cgroup/cpu.max", "150000 100000\n")]);
        assert!(found == Warning && said.contains("docker: --cpuset-cpus"), "{said}");
        let old = (SELF, "9:name=systemd:/\n4:cpu,cpuacct:/docker/abc\n");
        let dir = "/sys/fs/cgroup/cpu";
        let files = |quota| {
            [
                old,
                ("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", quota),
                ("/sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000"),
            ]
        };
        assert_eq!((of(&files("-1")).0, of(&files("200000")).0), (Good, Warning), "{dir}");
        assert_eq!(of(&[(SELF, "nonsense"), ("/sys/fs/cgroup/cpu.max", "x")]).0, Good);
    }
}
