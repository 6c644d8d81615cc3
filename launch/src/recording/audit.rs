//! What is missing in a recording, seen where messages come in: by their ticks and sequence numbers.
//!
//! *Lost* is what its writer has sent and the recording has not: a gap in the ticks of a wire with a message a tick, or
//! in the sequence numbers of commands and of launch's words. *Absent* is what was never sent: a control period whose
//! selector or controller was away. Losses make a recording incomplete, absences do not.

use super::wires::{Heard, RECORDED};
use hilare_interfaces::block::Tick;
use hilare_interfaces::wires::Rate;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Ticks a wire may end before the newest: the last look at the wires is not at all of them at once.
const TAIL_TICKS: u64 = 1000;

/// What one wire came to.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WireReport {
    /// Name of the wire.
    pub wire: String,
    /// Messages in the recording.
    pub messages: u64,
    /// Messages sent that never came.
    pub gaps: u64,
    /// Messages that came and were given up, because the disk was too slow.
    pub dropped: u64,
    /// Messages that came after the disk had refused to take more.
    pub refused: u64,
    /// Control periods for which there was none, because nobody sent one.
    pub absent: u64,
}

/// What a recording came to.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// Its files, in order.
    pub files: Vec<String>,
    /// Messages in them, of our wires.
    pub messages: u64,
    /// Bytes of the files.
    pub bytes: u64,
    /// Messages sent that never came.
    pub gaps: u64,
    /// Messages that came and were not written.
    pub dropped: u64,
    /// Everything that was sent is in the files.
    pub complete: bool,
    /// If not, why.
    pub why: String,
    /// Wire by wire; those without a message are left out.
    #[serde(default)]
    pub wires: Vec<WireReport>,
}

/// Follows one wire.
#[derive(Clone, Debug, Default)]
struct Followed {
    messages: u64,
    newest: Option<Tick>,
    missing: u64,
    absent: u64,
    /// Newest sequence number of each writer, and the tick that goes with it.
    sequences: BTreeMap<(u64, u64), (u64, Tick)>,
}

/// Follows all wires.
pub struct Audit {
    period_ticks: u64,
    wires: [Followed; RECORDED.len()],
    newest: Tick,
}

/// Writers whose sequence numbers are followed; a swap a second for an hour.
const MAX_WRITERS: usize = 4096;
/// Messages in a row that may be lost: a day of commands.
const MAX_MISSING: u64 = 100_000_000;

impl Audit {
    /// Nothing heard yet.
    pub fn new(period_ticks: u64) -> Self {
        Self { period_ticks: period_ticks.max(1), wires: Default::default(), newest: 0 }
    }

    /// A message came.
    pub fn hear(&mut self, heard: &Heard<'_>) {
        let place = heard.place();
        let wire = &mut self.wires[place];
        wire.messages += 1;
        let numbered = match heard {
            Heard::Command(command) => {
                Some(((command.source, command.epoch), (command.seq, Some(command.pose_tick))))
            }
            Heard::Authority(authority) => Some(((0, 0), (authority.seq, None))),
            _ => None,
        };
        if let Some((writer, (number, tick))) = numbered
            && (wire.sequences.len() < MAX_WRITERS || wire.sequences.contains_key(&writer))
        {
            let (newest, answered) = wire.sequences.entry(writer).or_insert((number, tick.unwrap_or(0)));
            let missing = number.saturating_sub(newest.saturating_add(1));
            // A controller answers a control period with a command: numbers for which there was no time are no
            // controller's, but of a program that floods the wire or lies.
            let room = tick.map_or(MAX_MISSING, |tick| {
                (tick.saturating_sub(*answered) / self.period_ticks).saturating_sub(1)
            });
            wire.missing += if missing <= room.min(MAX_MISSING) { missing } else { 0 };
            (*newest, *answered) = (number, tick.unwrap_or(0));
        }
        let Some(tick) = heard.tick() else { return };
        self.newest = self.newest.max(tick);
        let between = match RECORDED[place].wire.rate {
            Rate::EveryTick => 1,
            Rate::EveryPeriod => self.period_ticks,
            _ => return,
        };
        // A successor may tell again what its predecessor told.
        let missing =
            wire.newest.map_or(0, |newest| (tick.saturating_sub(newest) / between).saturating_sub(1));
        if between == 1 {
            wire.missing = wire.missing.saturating_add(missing);
        } else {
            wire.absent = wire.absent.saturating_add(missing);
        }
        wire.newest = wire.newest.max(Some(tick));
    }

    /// Wire by wire.
    pub fn wires(&self) -> Vec<WireReport> {
        let report = |(place, wire): (usize, &Followed)| {
            let every_tick = RECORDED[place].wire.rate == Rate::EveryTick;
            let behind = wire.newest.map_or(0, |newest| self.newest.saturating_sub(newest));
            let tail = if every_tick && behind > TAIL_TICKS { behind } else { 0 };
            WireReport {
                wire: RECORDED[place].name().to_owned(),
                messages: wire.messages,
                gaps: wire.missing.saturating_add(tail),
                absent: wire.absent,
                ..WireReport::default()
            }
        };
        self.wires.iter().enumerate().map(report).collect()
    }
}

impl Report {
    /// Adds up the wires, and says in a line what is missing; `trouble` is what went wrong with the files.
    pub fn sum_up(&mut self, trouble: Option<&str>) {
        self.wires.retain(|wire| wire.messages + wire.dropped + wire.refused + wire.gaps > 0);
        self.messages = self.wires.iter().map(|wire| wire.messages).sum();
        self.gaps = self.wires.iter().fold(0, |all, wire| all.saturating_add(wire.gaps));
        self.dropped = self.wires.iter().map(|wire| wire.dropped + wire.refused).sum();
        let mut why: Vec<String> = trouble.map(str::to_owned).into_iter().collect();
        let mut tell = |what: &str, of: fn(&WireReport) -> u64| {
            let told: Vec<String> = self
                .wires
                .iter()
                .filter(|wire| of(wire) > 0)
                .map(|wire| format!("{} {}", of(wire), wire.wire))
                .collect();
            if !told.is_empty() {
                why.push(format!("{what}: {}", told.join(", ")));
            }
        };
        tell("never came", |wire| wire.gaps);
        tell("given up, the disk was too slow", |wire| wire.dropped);
        tell("not written any more", |wire| wire.refused);
        self.complete = why.is_empty();
        self.why = why.join("; ");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;
    use hilare_interfaces::messages::{Authority, Command, Pose, Reference, Steps, Truth};

    fn gaps(audit: &Audit) -> Vec<(String, u64, u64)> {
        let wires = audit.wires().into_iter().filter(|wire| wire.gaps + wire.absent > 0);
        wires.map(|wire| (wire.wire, wire.gaps, wire.absent)).collect()
    }

    #[test]
    fn what_never_came_is_counted_by_wire() {
        let mut audit = Audit::new(5);
        for tick in 1100..2400 {
            audit.hear(&Heard::Steps(&Steps { tick, ..Steps::ZERO }));
            if !(1200..1203).contains(&tick) {
                audit.hear(&Heard::Pose(&Pose { tick, ..Pose::ZERO }));
            }
            if tick < 1250 {
                audit.hear(&Heard::Truth(&Truth { tick, ..Truth::ZERO }));
            }
            if tick % 5 == 0 && tick != 1300 {
                audit.hear(&Heard::Reference(&Reference { tick, ..Reference::ZERO }));
                if ![1350, 1355].contains(&tick) {
                    audit.hear(&Heard::Command(&Command { seq: tick / 5, pose_tick: tick, ..Command::ZERO }));
                }
            }
        }
        let told = [
            ("pose".to_owned(), 3, 0),
            ("truth".to_owned(), 1150, 0),
            ("reference".to_owned(), 0, 1),
            // By their numbers three that were sent.
            ("command".to_owned(), 3, 3),
        ];
        assert_eq!(gaps(&audit), told);
    }

    #[test]
    fn who_tells_again_and_another_writer_are_no_gap() {
        let mut audit = Audit::new(5);
        for tick in [5, 6, 7, 6, 7, 8] {
            audit.hear(&Heard::Steps(&Steps { tick, ..Steps::ZERO }));
        }
        for (source, epoch, seq) in [(1, 1, 1), (1, 1, 2), (2, 3, 40), (1, 1, 3), (2, 3, 41)] {
            let command = Command { source, epoch, seq, pose_tick: 5, ..Command::ZERO };
            audit.hear(&Heard::Command(&command));
        }
        for seq in [9, 10, u64::MAX] {
            audit.hear(&Heard::Authority(&Authority { seq, ..Authority::ZERO }));
        }
        assert_eq!(gaps(&audit), []);
        for seq in [20, 22] {
            audit.hear(&Heard::Authority(&Authority { seq, ..Authority::ZERO }));
        }
        assert_eq!(gaps(&audit), [("authority".to_owned(), 1, 0)]);
    }

    #[test]
    fn numbers_that_no_time_goes_with_are_no_gap() {
        let mut audit = Audit::new(5);
        for (seq, pose_tick) in [(1, 5), (126, 10), (9_000, 10), (9_001, 15), (9_003, 25)] {
            audit.hear(&Heard::Command(&Command { seq, pose_tick, ..Command::ZERO }));
        }
        assert_eq!(gaps(&audit), [("command".to_owned(), 1, 1)]);
    }

    #[test]
    fn the_reason_names_wires_and_numbers() {
        let wire = |wire: &str, gaps, dropped| WireReport {
            wire: wire.to_owned(),
            messages: 10,
            gaps,
            dropped,
            ..WireReport::default()
        };
        let mut report = Report { wires: vec![wire("pose", 2, 0), wire("steps", 0, 5)], ..Report::default() };
        report.sum_up(None);
        assert_eq!((report.messages, report.gaps, report.dropped, report.complete), (20, 2, 5, false));
        assert_eq!(report.why, "never came: 2 pose; given up, the disk was too slow: 5 steps");
        let mut report =
            Report { wires: vec![wire("pose", 0, 0), WireReport::default()], ..Report::default() };
        report.sum_up(None);
        assert!(report.complete && report.why.is_empty() && report.wires.len() == 1);
    }
}
