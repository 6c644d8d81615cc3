//! The recorder's process: reads what the relay repeats, disturbs nobody.

use super::boxes::observer_interval;
use super::transport::Input;
use super::worker::{Reactive, Report, Worker};
use hilare_interfaces::messages::{Pose, Reference, Steps, Truth};
use hilare_interfaces::wires::watch;
use hilare_recorder::RunRecord;
use hilare_recorder::assembler::Assembler;
use hilare_recorder::statistics::RunFigures;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Duration;

/// Name of the trace in the robot's runtime directory, where launch finds it.
pub const TRACE_FILE: &str = "trace.csv";

/// What the recorder hands to launch at its end: the only line on its standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Handover {
    /// The figures.
    pub figures: RunFigures,
    /// Ticks that could not be put together because messages were lost.
    pub gaps: u64,
}

/// steps, pose, truth, reference → figures and trace.
pub struct RecorderProcess {
    steps: Input<Steps>,
    pose: Input<Pose>,
    truth: Input<Truth>,
    reference: Input<Reference>,
    assembler: Assembler,
    record: RunRecord,
    trace_file: PathBuf,
    interval: Duration,
    report: Report,
}

impl RecorderProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let period_ticks = worker.system.timing.period_ticks;
        Ok(Self {
            steps: worker.domain.input(&watch::STEPS)?,
            pose: worker.domain.input(&watch::POSE)?,
            truth: worker.domain.input(&watch::TRUTH)?,
            reference: worker.domain.input(&watch::REFERENCE)?,
            assembler: Assembler::new(period_ticks),
            record: RunRecord::new(period_ticks),
            trace_file: worker.assignment.runtime_dir.join(TRACE_FILE),
            interval: observer_interval(worker.assignment.clock),
            report: Report::default(),
        })
    }
}

impl Reactive for RecorderProcess {
    fn poll(&mut self, _worker: &mut Worker) -> bool {
        std::iter::from_fn(|| self.steps.next()).for_each(|steps| self.assembler.push_steps(steps));
        std::iter::from_fn(|| self.pose.next()).for_each(|pose| self.assembler.push_pose(pose));
        std::iter::from_fn(|| self.truth.next()).for_each(|truth| self.assembler.push_truth(truth));
        std::iter::from_fn(|| self.reference.next())
            .for_each(|reference| self.assembler.push_reference(reference));
        let record = &mut self.record;
        self.assembler.drain(|tick| record.push(tick));
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
        self.steps.connect();
        self.pose.connect();
        self.truth.connect();
        self.reference.connect();
    }

    fn finish(&mut self) -> Result<(), String> {
        let record = &mut self.record;
        self.assembler.finish(|tick| record.push(tick));
        std::fs::write(&self.trace_file, self.record.trace.to_csv())
            .map_err(|error| format!("{}: {error}", self.trace_file.display()))?;
        let handover = Handover { figures: self.record.statistics.figures(), gaps: self.assembler.gaps() };
        let line = serde_json::to_string(&handover).map_err(|error| error.to_string())?;
        println!("{line}");
        Ok(())
    }
}
