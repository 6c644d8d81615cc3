//! diagnostic_msgs/DiagnosticArray: how the robot fares, in the words of its own messages.

use super::messages::{Stamp, header};
use crate::recording::cdr::Writer;
use hilare_interfaces::messages::{Drive, Steps};

const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;
/// For a code of another version.
const UNKNOWN: &str = "?";

/// Step generator: why the wheels turn as they do, and what it has counted.
pub fn of_steps(cdr: &mut Vec<u8>, stamp: Stamp, steps: &Steps) {
    let drive = Drive::from_code(steps.drive);
    let level = match drive {
        Some(Drive::Disarmed | Drive::Command | Drive::Stop) => OK,
        Some(Drive::Hold | Drive::Ramp) => WARN,
        Some(Drive::EStop | Drive::LeaseLost | Drive::PauseStop) | None => ERROR,
    };
    let values = [
        ("ticks", steps.tick),
        ("ticks late", steps.ticks_late),
        ("ticks paused", steps.paused_ticks),
        ("longest pause, ticks", steps.paused_max_ticks),
        ("commands late", steps.commands_late),
        ("commands refused", steps.commands_rejected),
        ("cycles without command", steps.cycles_without_command),
        ("commands borrowed", steps.commands_borrowed),
        ("promotions", steps.promotions),
    ];
    array(cdr, stamp, level, "step_generator", drive.map_or(UNKNOWN, Drive::label), &values);
}

/// One status.
fn array(cdr: &mut Vec<u8>, stamp: Stamp, level: u8, name: &str, message: &str, values: &[(&str, u64)]) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, "");
    to.u32(1);
    to.u8(level);
    to.string(name);
    to.string(message);
    to.string("");
    to.u32(values.len() as u32);
    for (key, value) in values {
        to.string(key);
        to.string(&value.to_string());
    }
}
