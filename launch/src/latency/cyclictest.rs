//! cyclictest beside the bare loop, where it is installed: the field's own measure of the same thing.

use super::Micros;
use crate::config::Realtime;
use crate::shell::realtime::{CpuChoice, chosen_cpu};
use std::process::{Child, Command, Stdio};

/// Longest lateness it puts into its histogram, µs; what is later is in its maximum alone.
const LONGEST_US: u64 = 20_000;

/// What it measured, to the microsecond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cyclictest {
    /// Its lateness.
    pub micros: Micros,
    /// Wake-ups.
    pub samples: u64,
}

/// One under way.
pub struct Started(Child);

/// Starts it on the clock's processor with its priority; `None` where it is not installed. It picks its phase
/// itself.
pub fn start(clock: Realtime, seconds: f64) -> Option<Started> {
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--mlockall", "--threads=1", "--interval=1000"]);
    command.arg(format!("--priority={}", clock.priority)).arg(format!("--histogram={LONGEST_US}"));
    command.arg(format!("--duration={}", seconds.ceil() as u64));
    if let Some(cpu) = chosen_cpu(CpuChoice::from_key(clock.cpu)) {
        command.arg(format!("--affinity={cpu}"));
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok().map(Started)
}

impl Started {
    /// Waits for its end; `None` if it says nothing that can be read.
    pub fn end(self) -> Option<Cyclictest> {
        let output = self.0.wait_with_output().ok()?;
        parse(&String::from_utf8_lossy(&output.stdout))
    }
}

/// Reads `--histogram`'s output: lines of microseconds and counts, then comments with the maximum.
fn parse(text: &str) -> Option<Cyclictest> {
    let mut buckets: Vec<(u64, u64)> = Vec::new();
    let (mut max, mut total) = (None, None);
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if let Some(rest) = line.strip_prefix("# Max Latencies:") {
            max = rest.trim().parse::<u64>().ok();
        } else if let Some(rest) = line.strip_prefix("# Total:") {
            total = rest.trim().parse::<u64>().ok();
        } else if let (Some(Ok(us)), Some(Ok(count))) =
            (words.next().map(str::parse), words.next().map(str::parse))
        {
            buckets.push((us, count));
        }
    }
    let (max, counted) = (max?, buckets.iter().map(|(_, count)| count).sum::<u64>());
    let samples = total.unwrap_or(counted).max(counted);
    let quantile = |fraction: f64| {
        let rank = ((fraction * samples as f64).ceil() as u64).max(1);
        let mut seen = 0;
        let found = buckets.iter().find(|(_, count)| {
            seen += count;
            seen >= rank
        });
        found.map_or(max, |(us, _)| *us) as f64
    };
    let micros = Micros { p50: quantile(0.5), p99: quantile(0.99), p99_9: quantile(0.999), max: max as f64 };
    (samples > 0).then_some(Cyclictest { micros, samples })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_histogram_is_read() {
        let text = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000003 000600\n\
                    000007 000390\n000020 000009\n# Total: 000000999\n# Min Latencies: 00003\n\
                    # Avg Latencies: 00004\n# Max Latencies: 25000\n# Histogram Overflows: 00001\n";
        let read = parse(text).expect("a histogram");
        let Micros { p50, p99, p99_9, max } = read.micros;
        assert_eq!((p50, p99, p99_9, max, read.samples), (3.0, 7.0, 20.0, 25_000.0, 999));
        assert_eq!(parse("Unable to change scheduling policy!\n"), None);
    }
}
