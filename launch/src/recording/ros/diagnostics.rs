//! diagnostic_msgs/DiagnosticArray: how the robot fares, in the words of its own messages.

use super::messages::{Stamp, header};
use crate::recording::cdr::Writer;
use hilare_interfaces::messages::{Drive, Health, HealthState, Steps, field_text};
use hilare_interfaces::wires::Role;

const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;
const STALE: u8 = 3;
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
    array(cdr, stamp, level, ("step_generator", ""), drive.map_or(UNKNOWN, Drive::label), &values);
}

/// A process: its state and why, by its box; there may be several of one in different slots.
pub fn of_health(cdr: &mut Vec<u8>, stamp: Stamp, health: &Health) {
    let state = HealthState::from_code(health.state);
    let level = match state {
        Some(HealthState::Ready | HealthState::Running) => OK,
        Some(HealthState::Degraded) => WARN,
        Some(HealthState::Fault) => ERROR,
        Some(HealthState::Starting) | None => STALE,
    };
    let reason = field_text(&health.text);
    let label = state.map_or(UNKNOWN, HealthState::label);
    let message = if reason.is_empty() { label.to_owned() } else { format!("{label}: {reason}") };
    let values = [
        ("tick", health.tick),
        ("steps", health.steps),
        ("messages missing or refused", health.rejected),
        ("path", health.path_id),
    ];
    let role = Role::from_code(health.role).map_or(UNKNOWN, Role::name);
    let who = (&*format!("{role} (slot {})", health.slot), &*format!("pid {}", health.pid));
    array(cdr, stamp, level, who, &message, &values);
}

/// One status.
fn array(
    cdr: &mut Vec<u8>,
    stamp: Stamp,
    level: u8,
    (name, hardware): (&str, &str),
    message: &str,
    values: &[(&str, u64)],
) {
    let to = &mut Writer::new(cdr);
    header(to, stamp, "");
    to.u32(1);
    to.u8(level);
    to.string(name);
    to.string(message);
    to.string(hardware);
    to.u32(values.len() as u32);
    for (key, value) in values {
        to.string(key);
        to.string(&value.to_string());
    }
}
