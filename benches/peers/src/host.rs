//! What the machine is, and what its host took from it while we measured.

use std::fs;

/// Time the host ran something else instead, ms, by processor, since boot: /proc/stat, proc(5).
pub fn steal_ms() -> Vec<(String, u64)> {
    parse_steal(
        &fs::read_to_string("/proc/stat").unwrap_or_default(),
        rustix::param::clock_ticks_per_second(),
    )
}

fn parse_steal(stat: &str, ticks_per_second: u64) -> Vec<(String, u64)> {
    let processor = |line: &str| {
        let (name, figures) = line.split_once(' ')?;
        name.strip_prefix("cpu").filter(|number| !number.is_empty())?;
        let ticks: u64 = figures.split_whitespace().nth(7)?.parse().ok()?;
        Some((name.to_owned(), ticks * 1000 / ticks_per_second))
    };
    stat.lines().filter_map(processor).collect()
}

/// What was stolen between two readings, ms, by processor.
pub fn stolen_ms(before: &[(String, u64)], after: &[(String, u64)]) -> Vec<(String, u64)> {
    let pairs = before.iter().zip(after);
    pairs.map(|((name, before), (_, after))| (name.clone(), after.saturating_sub(*before))).collect()
}

/// Kernel release and architecture.
pub fn kernel() -> String {
    let names = rustix::system::uname();
    format!("Linux {} {}", names.release().to_string_lossy(), names.machine().to_string_lossy())
}

/// Processors the kernel runs on, and their model.
pub fn processors_online() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let count = steal_ms().len();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    format!("{count} × {}", model.map_or("unknown", |(_, model)| model.trim()))
}

/// The share of each second that real-time threads may have, as the kernel gives it.
pub fn real_time_budget() -> String {
    let read =
        |name: &str| fs::read_to_string(format!("/proc/sys/kernel/{name}")).ok()?.trim().parse::<i64>().ok();
    match (read("sched_rt_runtime_us"), read("sched_rt_period_us")) {
        (Some(-1), _) => "unlimited".to_owned(),
        (Some(runtime), Some(period)) => format!("{} of {} ms", runtime / 1000, period / 1000),
        _ => "unknown".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steal_is_the_eighth_figure_of_each_processor() {
        let stat =
            "cpu  1 2 3 4 5 6 7 80 9 10\ncpu0 1 2 3 4 5 6 7 30 9 10\ncpu1 1 2 3 4 5 6 7 50 9 10\nintr 5\n";
        let before = parse_steal(stat, 100);
        assert_eq!(before, [("cpu0".to_owned(), 300), ("cpu1".to_owned(), 500)]);
        let after = parse_steal(&stat.replace(" 50 ", " 52 "), 100);
        assert_eq!(stolen_ms(&before, &after), [("cpu0".to_owned(), 0), ("cpu1".to_owned(), 20)]);
    }
}
