//! How to record.

use super::RunInfo;
use super::ros::Body;
use crate::config::System;
use crate::whole::write_whole;
use hilare_interfaces::param_group;
use serde::{Deserialize, Serialize};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

param_group! {
    /// How recordings are written.
    RecordingParams {
        /// A recording goes on in a new file when one has become so large; 0 never.
        rotate_mb: u64 = 1000, "MB", 0, 1000000;
        /// A recording goes on in a new file after so much of its time; 0 never.
        rotate_s: u64 = 0, "s", 0, 10000000;
        /// What waits for a slow disk at most; beyond, messages are given up and counted.
        queue_mb: u64 = 64, "MB", 1, 4096;
        /// Of messages that are compressed together.
        chunk_kb: u64 = 1024, "kB", 16, 65536;
    }
}

/// How and where to record.
#[derive(Clone, Debug)]
pub struct Settings {
    /// File of the first part; one that is there is not touched, the next number is taken.
    pub path: PathBuf,
    /// A new part after so many bytes; 0 never.
    pub rotate_bytes: u64,
    /// A new part after so much time of the recording, ns; 0 never.
    pub rotate_ns: u64,
    /// Most bytes that wait for the disk.
    pub queue_bytes: usize,
    /// Bytes of a chunk before it is compressed.
    pub chunk_bytes: u64,
    /// What other tools are told of the robot.
    pub body: Body,
    /// Wait for the disk rather than give messages up: virtual time.
    pub patient: bool,
    /// Who may read and write the files, if not as the umask says.
    pub mode: Option<u32>,
}

impl Settings {
    /// As the system file has it.
    pub fn of(system: &System, path: PathBuf, patient: bool) -> Self {
        let RecordingParams { rotate_mb, rotate_s, queue_mb, chunk_kb } = system.recording;
        Self {
            path,
            rotate_bytes: rotate_mb * 1_000_000,
            rotate_ns: rotate_s * 1_000_000_000,
            queue_bytes: (queue_mb * 1_000_000) as usize,
            chunk_bytes: chunk_kb * 1000,
            body: Body::of(system),
            patient,
            mode: None,
        }
    }
}

/// What launch tells the recorder to record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Order {
    /// File of the first part, from the root.
    pub path: PathBuf,
    /// What it is a recording of.
    pub info: RunInfo,
    /// Who may read and write it: as launch's umask says, which is not that of a worker.
    pub mode: u32,
}

/// Where the recorder finds it, in the robot's runtime directory.
const ORDER_FILE: &str = "recording.json";

impl Order {
    /// An order to record into `path`, for whoever may read `like`.
    pub fn new(path: &Path, info: RunInfo, like: &Path) -> io::Result<Self> {
        let mode = std::fs::metadata(like)?.mode() & 0o666;
        // Workers have another working directory.
        Ok(Self { path: std::path::absolute(path)?, info, mode })
    }

    /// Leaves the order in a robot's runtime directory.
    pub fn leave_in(&self, runtime_dir: &Path) -> Result<(), String> {
        let file = runtime_dir.join(ORDER_FILE);
        let text = serde_json::to_string(self).map_err(|error| error.to_string())?;
        write_whole(&file, text.as_bytes()).map_err(|error| error.to_string())
    }

    /// The order in a runtime directory, if there is one.
    pub fn found_in(runtime_dir: &Path) -> Option<Self> {
        serde_json::from_slice(&std::fs::read(runtime_dir.join(ORDER_FILE)).ok()?).ok()
    }
}

impl RunInfo {
    /// A recording that begins now, of a robot on this clock.
    pub fn new(system: &System, scenario: &str, clock: &str) -> Self {
        let controller = &system.controller;
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            recording: format!("{:x}-{:x}", now.as_nanos(), std::process::id()),
            part: 0,
            robot: system.robot.clone(),
            scenario: scenario.to_owned(),
            clock: clock.to_owned(),
            controller: if controller.exec.is_empty() { controller.law.name } else { &controller.exec }
                .to_owned(),
            seed: system.get("plant.seed").map_or(String::new(), |seed| seed.to_string()),
            period_ticks: system.timing.period_ticks,
        }
    }
}
