//! What travels: a pose there, a command back, of the sizes hilare's own have (40 and 72 bytes).

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// 64-bit words of a [`Pose`].
pub const POSE_WORDS: usize = size_of::<Pose>() / 8;
/// 64-bit words of a [`Command`].
pub const COMMAND_WORDS: usize = size_of::<Command>() / 8;

/// Where the robot is.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
pub struct Pose {
    /// Counts up by one a cycle.
    pub tick: u64,
    /// Tick of the measurement.
    pub measured_tick: u64,
    /// World x, m.
    pub x_m: f64,
    /// World y, m.
    pub y_m: f64,
    /// Heading, rad.
    pub theta_rad: f64,
}

/// What the robot shall do.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
pub struct Command {
    /// Which controller.
    pub source: u64,
    /// Its authority epoch.
    pub epoch: u64,
    /// Counts up by one a command.
    pub seq: u64,
    /// Tick of the pose it answers.
    pub pose_tick: u64,
    /// When the responder had the pose, ns on CLOCK_MONOTONIC; hilare's command has the tick here from
    /// which it acts.
    pub received_ns: u64,
    /// Forward speed, m/s.
    pub vx_mps: f64,
    /// Sideways speed, m/s.
    pub vy_mps: f64,
    /// Yaw rate, rad/s.
    pub omega_radps: f64,
    /// What the law had to do without.
    pub fallback: u64,
}

impl Pose {
    /// The pose of a cycle: a robot on a circle of 1 m.
    pub fn of(tick: u64) -> Self {
        let theta_rad = tick as f64 * 1e-3;
        Self { tick, measured_tick: tick, x_m: theta_rad.sin(), y_m: 1.0 - theta_rad.cos(), theta_rad }
    }
}

/// The answer to a pose that came at `received_ns`. As cheap as an answer can be: the transport is
/// measured, not a law.
pub fn answer(pose: &Pose, received_ns: u64) -> Command {
    Command {
        seq: pose.tick,
        pose_tick: pose.tick,
        received_ns,
        vx_mps: 0.1,
        omega_radps: 0.1 - 0.5 * pose.y_m,
        ..Command::default()
    }
}

/// A message out of what came over a byte transport.
pub fn decode<T: Pod>(bytes: &[u8]) -> crate::Result<T> {
    bytemuck::try_pod_read_unaligned(bytes)
        .map_err(|_| format!("a message of {} bytes, {} expected", bytes.len(), size_of::<T>()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_of_hilares_messages() {
        assert_eq!((size_of::<Pose>(), size_of::<Command>()), (40, 72));
    }

    #[test]
    fn bytes_of_another_size_are_refused() {
        let pose = Pose::of(7);
        let bytes = bytemuck::bytes_of(&pose);
        assert_eq!(decode::<Pose>(bytes).unwrap().tick, 7);
        assert!(decode::<Pose>(&bytes[1..]).is_err());
        assert!(decode::<Command>(bytes).is_err());
    }
}
