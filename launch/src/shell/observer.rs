//! The recorder's process: reads what the relay repeats, disturbs nobody.

use super::ClockKind;
use super::boxes::observer_interval;
use super::worker::{Reactive, Report, Worker};
use crate::recording::wires::{Tap, taps};
use crate::recording::{self, Heard, Order, Settings, Tape};
use hilare_recorder::RunRecord;
use hilare_recorder::assembler::Assembler;
use hilare_recorder::statistics::RunFigures;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Name of the trace in the robot's runtime directory, where launch finds it.
pub const TRACE_FILE: &str = "trace.csv";
/// Time the disk has for what waits for it at the end; launch waits a little longer.
const DISK_PATIENCE: Duration = Duration::from_secs(8);

/// What the recorder hands to launch at its end: the only line on its standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Handover {
    /// The figures.
    pub figures: RunFigures,
    /// Ticks that could not be put together because messages were lost.
    pub gaps: u64,
    /// What the recording came to, if there is one.
    #[serde(default)]
    pub recording: Option<recording::Report>,
}

/// Every wire of the relay → figures, trace, recording.
pub struct RecorderProcess {
    taps: Vec<Box<dyn Tap>>,
    assembler: Assembler,
    record: RunRecord,
    tape: Option<Tape>,
    trace_file: PathBuf,
    interval: Duration,
    report: Report,
}

impl RecorderProcess {
    /// Opens its ports, and the files it was told to write.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let period_ticks = worker.system.timing.period_ticks;
        let tape =
            Order::found_in(&worker.assignment.runtime_dir).map(|order| record(worker, order)).transpose()?;
        Ok(Self {
            taps: taps(&worker.domain)?,
            assembler: Assembler::new(period_ticks),
            record: RunRecord::new(period_ticks),
            tape,
            trace_file: worker.assignment.runtime_dir.join(TRACE_FILE),
            interval: observer_interval(worker.assignment.clock),
            report: Report::default(),
        })
    }
}

fn record(worker: &Worker, order: Order) -> Result<Tape, String> {
    survive_the_file_size_limit()?;
    let patient = worker.assignment.clock != ClockKind::Real;
    let settings = Settings { mode: Some(order.mode), ..Settings::of(&worker.system, order.path, patient) };
    let mut tape =
        Tape::begin(settings, order.info, worker.system.to_toml()).map_err(|error| error.to_string())?;
    tape.keep_systems_of(&worker.assignment.runtime_dir);
    Ok(tape)
}

/// A file that may not grow any more is an error to the one who writes it, no reason to be killed.
pub fn survive_the_file_size_limit() -> Result<(), String> {
    let seen = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(libc::SIGXFSZ, seen).map(drop).map_err(|error| error.to_string())
}

impl Reactive for RecorderProcess {
    fn poll(&mut self, _worker: &mut Worker) -> bool {
        let Self { taps, assembler, record, tape, .. } = self;
        let mut hear = |heard: Heard<'_>| {
            match heard {
                Heard::Steps(steps) => assembler.push_steps(*steps),
                Heard::Pose(pose) => assembler.push_pose(*pose),
                Heard::Truth(truth) => assembler.push_truth(*truth),
                Heard::Reference(reference) => assembler.push_reference(*reference),
                _ => {}
            }
            if let Some(tape) = tape {
                tape.hear(heard);
            }
        };
        for tap in taps.iter() {
            while tap.hear(&mut hear) {}
        }
        assembler.drain(|tick| record.push(tick));
        if let Some(tape) = tape {
            tape.hand_over();
        }
        self.report.tick = self.assembler.done();
        self.report.steps = self.report.tick;
        self.report.rejected = self.assembler.gaps();
        // Looked at by interval, so that a busy wire does not keep it awake.
        false
    }

    fn report(&self) -> Report {
        self.report
    }

    fn poll_interval(&self) -> Duration {
        self.interval
    }

    fn connect(&self) {
        self.taps.iter().for_each(|tap| tap.connect());
    }

    fn finish(&mut self) -> Result<(), String> {
        let record = &mut self.record;
        self.assembler.finish(|tick| record.push(tick));
        std::fs::write(&self.trace_file, self.record.trace.to_csv())
            .map_err(|error| format!("{}: {error}", self.trace_file.display()))?;
        let recording = self.tape.take().map(|tape| tape.finish(Some(DISK_PATIENCE)));
        let figures = self.record.statistics.figures();
        let handover = Handover { figures, gaps: self.assembler.gaps(), recording };
        let line = serde_json::to_string(&handover).map_err(|error| error.to_string())?;
        println!("{line}");
        Ok(())
    }
}
