//! What a process takes of the machine, as the kernel counts it.

use rustix::param::{clock_ticks_per_second, page_size};
use std::fs;

/// Processor time and memory of a process.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Processor time since it began, s.
    pub cpu_s: f64,
    /// Memory it has resident, bytes; shared memory included.
    pub resident_bytes: u64,
    /// Processor it ran on last.
    pub processor: u64,
}

impl Usage {
    /// Of a process; `None` if it is gone, or hidden from this user.
    pub fn of(pid: u32) -> Option<Self> {
        if pid == 0 {
            return None;
        }
        parse(
            &fs::read_to_string(format!("/proc/{pid}/stat")).ok()?,
            clock_ticks_per_second(),
            page_size() as u64,
        )
    }
}

fn parse(stat: &str, ticks_per_second: u64, page_bytes: u64) -> Option<Usage> {
    // The name in parentheses may hold anything.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let field = |n: usize| fields.get(n)?.parse::<u64>().ok();
    Some(Usage {
        cpu_s: (field(11)? + field(12)?) as f64 / ticks_per_second.max(1) as f64,
        resident_bytes: field(21)? * page_bytes,
        processor: field(36)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_are_found_behind_any_name() {
        let mut after: Vec<String> = (0..50).map(|n| n.to_string()).collect();
        after[0] = "S".to_owned();
        let usage = parse(&format!("7 (a) b (c) {}", after.join(" ")), 100, 4096).expect("it parses");
        assert_eq!(usage, Usage { cpu_s: 0.23, resident_bytes: 21 * 4096, processor: 36 });
        assert_eq!(parse("", 100, 4096), None);
        assert_eq!(parse("7 (x) S 1 2", 100, 4096), None);
    }

    #[test]
    fn our_own_can_be_read_and_nobodys_cannot() {
        assert!(Usage::of(std::process::id()).expect("our own").resident_bytes > 100_000);
        assert_eq!(Usage::of(0), None);
    }
}
