//! The processors: how many, how awake, and who else has them.

use super::{Finding, Machine};
use std::collections::BTreeMap;
use std::time::Duration;

/// For how long interrupts are counted.
pub(super) const COUNTED: Duration = Duration::from_millis(200);
/// Interrupts a second of a device on the control path's processor from which they are told: a tenth of the ticks.
const INTERRUPTS_TOLD: f64 = 100.0;
/// Longest time a processor may take to wake from idling, µs: half of what is called late.
const WAKE_US_MAX: u64 = 50;
/// Share of the time that the host takes away from which it is told.
const STEAL_TOLD: f64 = 0.001;

pub(super) fn cores() -> Finding {
    judge_cores(std::thread::available_parallelism().map_or(1, usize::from))
}

fn judge_cores(cores: usize) -> Finding {
    const CHECK: &str = "cores";
    if cores >= 2 {
        return Finding::good(CHECK, format!("{cores} usable"));
    }
    let cure = "give the robot two: one for the control path, one for the rest (docker: --cpuset-cpus=2,3)";
    Finding::warning(CHECK, format!("{cores} usable"), cure)
}

/// A processor that was slowed down takes its time to be fast again.
pub(super) fn governor(machine: &Machine) -> Finding {
    const CHECK: &str = "governor";
    const DIR: &str = "/sys/devices/system/cpu";
    let cpu = machine.control_cpu;
    let Some(governor) = machine.text(&format!("{DIR}/cpu{cpu}/cpufreq/scaling_governor")) else {
        return Finding::good(CHECK, "the frequency is not this kernel's to set");
    };
    let at_most = |name: &str| machine.number::<u64>(&format!("{DIR}/cpu{cpu}/cpufreq/{name}"));
    let capped = at_most("scaling_max_freq").zip(at_most("cpuinfo_max_freq"));
    if let Some((allowed, possible)) = capped
        && allowed < possible
    {
        let found = format!("cpu {cpu} is held below {} MHz of {} MHz", allowed / 1000, possible / 1000);
        let cure = format!(
            "cpupower frequency-set --max {possible}kHz, or find out who wants it so (power saving, heat)"
        );
        return Finding::warning(CHECK, found, cure);
    }
    if governor == "performance" {
        return Finding::good(CHECK, format!("performance (cpu {cpu})"));
    }
    Finding::warning(
        CHECK,
        format!("{governor} (cpu {cpu}): the tick may find it slow"),
        format!(
            "cpupower frequency-set -g performance, or echo performance | tee {DIR}/cpu*/cpufreq/scaling_governor"
        ),
    )
}

/// The deeper it sleeps, the longer it takes to wake.
pub(super) fn idle_states(machine: &Machine) -> Finding {
    const CHECK: &str = "idle states";
    let dir = format!("/sys/devices/system/cpu/cpu{}/cpuidle", machine.control_cpu);
    let states = machine.names(&dir);
    let mut known = false;
    let mut slowest: Option<(u64, String)> = None;
    for state in states {
        let Some(us) = machine.number::<u64>(&format!("{dir}/{state}/latency")) else { continue };
        known = true;
        if machine.text(&format!("{dir}/{state}/disable")).as_deref() == Some("1") {
            continue;
        }
        let name = machine.text(&format!("{dir}/{state}/name")).unwrap_or(state);
        if slowest.as_ref().is_none_or(|(most, _)| us > *most) {
            slowest = Some((us, name));
        }
    }
    match slowest {
        Some((us, name)) if us > WAKE_US_MAX => Finding::warning(
            CHECK,
            format!("cpu {} may sleep in {name}, and takes {us} us to wake from it", machine.control_cpu),
            format!("wake_up.keep_awake = true in the system file, or cpupower idle-set -D {WAKE_US_MAX}"),
        ),
        Some((us, name)) => Finding::good(CHECK, format!("{name} at the deepest, {us} us to wake")),
        None if known => Finding::good(CHECK, "all off"),
        None => Finding::unknown(
            CHECK,
            "not told; in a virtual machine the host decides, and wake_up.keep_awake = true keeps it from sleeping",
        ),
    }
}

/// Interrupts of devices on the control path's processor so far.
pub(super) struct Interrupts(BTreeMap<String, u64>);

impl Interrupts {
    pub(super) fn of(machine: &Machine) -> Self {
        let text = machine.text("/proc/interrupts").unwrap_or_default();
        let column = format!("CPU{}", machine.control_cpu);
        let mut lines = text.lines();
        let heads: Vec<&str> = lines.next().unwrap_or("").split_whitespace().collect();
        let Some(column) = heads.iter().position(|head| *head == column) else {
            return Self(BTreeMap::new());
        };
        let device = |line: &str| {
            let (number, rest) = line.split_once(':')?;
            // The kernel's own, such as the timer's, have names.
            number.trim().parse::<u32>().ok()?;
            let fields: Vec<&str> = rest.split_whitespace().collect();
            let count = fields.get(column)?.parse().ok()?;
            Some((format!("{} ({})", number.trim(), fields.last()?), count))
        };
        Self(lines.filter_map(device).collect())
    }
}

pub(super) fn interrupts(
    machine: &Machine,
    before: &Interrupts,
    after: &Interrupts,
    between: Duration,
) -> Finding {
    const CHECK: &str = "interrupts";
    let cpu = machine.control_cpu;
    if after.0.is_empty() {
        return Finding::unknown(CHECK, format!("/proc/interrupts does not tell of cpu {cpu}"));
    }
    let per_second = |(device, count): (&String, &u64)| {
        let new = count.saturating_sub(before.0.get(device).copied().unwrap_or(0));
        (new as f64 / between.as_secs_f64().max(1e-3), device.clone())
    };
    let busiest = after.0.iter().map(per_second).max_by(|a, b| a.0.total_cmp(&b.0));
    match busiest {
        Some((rate, device)) if rate >= INTERRUPTS_TOLD => {
            let number = device.split(' ').next().unwrap_or("N");
            let others = if cpu == 0 { "1".to_owned() } else { format!("0-{}", cpu - 1) };
            Finding::warning(
                CHECK,
                format!("{rate:.0} a second of {device} on cpu {cpu}, where the tick runs"),
                format!(
                    "echo {others} > /proc/irq/{number}/smp_affinity_list, and keep irqbalance from it (IRQBALANCE_BANNED_CPULIST={cpu})"
                ),
            )
        }
        Some((rate, _)) => Finding::good(CHECK, format!("{rate:.0} a second of any device on cpu {cpu}")),
        None => Finding::good(CHECK, format!("none of devices on cpu {cpu}")),
    }
}

/// Whether there is somebody behind the machine who has the processors first.
pub(super) fn host(machine: &Machine) -> Finding {
    const CHECK: &str = "host";
    let virtual_machine = is_virtual(machine);
    let Some(stat) = machine.text("/proc/stat") else {
        return Finding::unknown(CHECK, "/proc/stat is not readable");
    };
    let key = format!("cpu{}", machine.control_cpu);
    let line = stat.lines().find(|line| line.split_whitespace().next() == Some(&*key));
    let times: Vec<u64> = line
        .into_iter()
        .flat_map(str::split_whitespace)
        .skip(1)
        .filter_map(|time| time.parse().ok())
        .collect();
    // user nice system idle iowait irq softirq steal; what guests took is in user already.
    let steal = times.get(7).copied().unwrap_or(0);
    let share = steal as f64 / times.iter().take(8).sum::<u64>().max(1) as f64;
    if share >= STEAL_TOLD {
        return Finding::warning(
            CHECK,
            format!(
                "a virtual machine that was kept from cpu {} for {:.1} % of the time",
                machine.control_cpu,
                share * 100.0
            ),
            "processors of its own for this machine on its host; until then lateness is the host's (hilare latency)",
        );
    }
    Finding::good(
        CHECK,
        if virtual_machine { "a virtual machine, and it gets its time" } else { "none: this machine itself" },
    )
}

fn is_virtual(machine: &Machine) -> bool {
    let flags = machine.text("/proc/cpuinfo").unwrap_or_default();
    let flagged = flags
        .lines()
        .any(|line| line.starts_with("flags") && line.split_whitespace().any(|flag| flag == "hypervisor"));
    flagged || machine.text("/sys/hypervisor/type").is_some()
}

#[cfg(test)]
mod tests {
    use super::super::Verdict::{self, Good, Unknown, Warning};
    use super::super::machine::fake::Fake;
    use super::*;

    fn verdict(check: fn(&Machine) -> Finding, files: &[(&str, &str)]) -> (Verdict, String) {
        let finding = check(&Fake::new(files).machine);
        (finding.verdict, format!("{} | {}", finding.found, finding.cure))
    }

    #[test]
    fn one_core_is_told() {
        assert_eq!((judge_cores(1).verdict, judge_cores(2).verdict), (Warning, Good));
    }

    #[test]
    fn the_governor_of_the_control_paths_processor_counts() {
        const CPU0: &str = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor";
        const CPU1: &str = "/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor";
        assert_eq!(verdict(governor, &[]).0, Good);
        assert_eq!(verdict(governor, &[(CPU0, "powersave"), (CPU1, "performance\n")]).0, Good);
        let (found, said) = verdict(governor, &[(CPU0, "performance"), (CPU1, "ondemand")]);
        assert!(found == Warning && said.contains("cpupower frequency-set -g performance"), "{said}");
        let capped = [
            (CPU1, "performance"),
            ("/sys/devices/system/cpu/cpu1/cpufreq/scaling_max_freq", "600000"),
            ("/sys/devices/system/cpu/cpu1/cpufreq/cpuinfo_max_freq", "1500000"),
        ];
        let (found, said) = verdict(governor, &capped);
        assert!(found == Warning && said.contains("600 MHz of 1500 MHz"), "{said}");
    }

    #[test]
    fn deep_sleep_is_told_unless_it_is_off() {
        let state = |n: usize, name: &str| format!("/sys/devices/system/cpu/cpu1/cpuidle/state{n}/{name}");
        let fake = Fake::new(&[(&state(0, "latency"), "0"), (&state(0, "name"), "POLL")]);
        assert_eq!(idle_states(&fake.machine).verdict, Good);
        fake.put(&state(1, "latency"), "133\n");
        fake.put(&state(1, "name"), "C6\n");
        fake.put(&state(1, "disable"), "0\n");
        let deep = idle_states(&fake.machine);
        assert!(deep.verdict == Warning && deep.found.contains("C6, and takes 133 us"), "{deep:?}");
        assert!(deep.cure.contains("keep_awake"), "{deep:?}");
        fake.put(&state(1, "disable"), "1\n");
        assert_eq!(idle_states(&fake.machine).found, "POLL at the deepest, 0 us to wake");
        fake.put(&state(0, "disable"), "1\n");
        assert_eq!(idle_states(&fake.machine).found, "all off");
        assert_eq!(verdict(idle_states, &[]).0, Unknown);
        // A machine that lists a state and says nothing of it.
        assert_eq!(verdict(idle_states, &[(&state(0, "name"), "haltpoll")]).0, Unknown);
    }

    #[test]
    fn devices_are_counted_where_the_tick_runs_and_the_kernels_own_are_not() {
        const FILE: &str = "/proc/interrupts";
        let text = |eth: u64, timer: u64| {
            format!(
                "  CPU0 CPU1\n 24: 9999999 {eth} GICv2 189 Level eth0\nLOC: 5 {timer} Local timer\nERR: 0\n"
            )
        };
        let fake = Fake::new(&[(FILE, &text(100, 100))]);
        let before = Interrupts::of(&fake.machine);
        let judge = |eth, timer| {
            fake.put(FILE, &text(eth, timer));
            interrupts(&fake.machine, &before, &Interrupts::of(&fake.machine), COUNTED)
        };
        assert_eq!(judge(102, 100_000).verdict, Good);
        let busy = judge(900, 100);
        assert!(
            busy.verdict == Warning && busy.found.starts_with("4000 a second of 24 (eth0) on cpu 1"),
            "{busy:?}"
        );
        assert!(busy.cure.starts_with("echo 0-0 > /proc/irq/24/smp_affinity_list"), "{busy:?}");
        fake.put(FILE, "garbled");
        let nothing = Interrupts::of(&fake.machine);
        assert_eq!(interrupts(&fake.machine, &before, &nothing, COUNTED).verdict, Unknown);
    }

    #[test]
    fn a_host_that_takes_time_is_told() {
        const STAT: &str = "/proc/stat";
        const INFO: (&str, &str) = ("/proc/cpuinfo", "flags\t\t: fpu vme hypervisor sse\n");
        assert_eq!(verdict(host, &[]).0, Unknown);
        let quiet =
            (STAT, "cpu 9 9 9 9 9 9 9 99999\ncpu0 1 1 1 1 0 0 0 999\ncpu1 500 0 100 9000 5 0 1 2 0 0\n");
        assert_eq!(verdict(host, &[quiet]).1, "none: this machine itself | ");
        assert_eq!(verdict(host, &[quiet, INFO]).1, "a virtual machine, and it gets its time | ");
        let busy = (STAT, "cpu0 1 1 1 1 0 0 0 0\ncpu1 500 0 100 300 0 0 0 100 400 0\n");
        let (found, said) = verdict(host, &[busy, INFO]);
        assert!(found == Warning && said.contains("cpu 1 for 10.0 % of the time"), "{said}");
        assert_eq!(verdict(host, &[(STAT, "cpu1")]).0, Good, "an old kernel tells nothing of it");
    }
}
