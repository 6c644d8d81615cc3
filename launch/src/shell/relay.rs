//! The relay's process: repeats the wires for those who only look, so that who comes and goes costs nobody on the
//! tick anything.

use super::boxes::relay_interval;
use super::page::{MAX_SLOTS, SharedPage};
use super::transport::{Input, Output, SliceInput, SliceOutput, TransportError};
use super::worker::{Reactive, Report, Worker};
use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages::{Journal, Pose, Steps, Truth, Waypoint};
use hilare_interfaces::wires::{self, Wire, watch};
use std::fmt;
use std::time::Duration;

/// A wire and its repetition.
struct Repeated<T: WireMessage + fmt::Debug> {
    from: Input<T>,
    to: Output<T>,
    /// Messages in one look: as many as the wire holds, so that whoever floods it does not keep the others waiting.
    at_most: usize,
}

impl<T: WireMessage + fmt::Debug> Repeated<T> {
    fn new(worker: &Worker, from: &Wire, to: &Wire) -> Result<Self, TransportError> {
        Ok(Self { from: worker.domain.input(from)?, to: worker.domain.output(to)?, at_most: from.buffer })
    }

    fn repeat_each(&self, mut seen: impl FnMut(&T)) {
        for message in std::iter::from_fn(|| self.from.next()).take(self.at_most) {
            seen(&message);
            self.to.send(&message);
        }
    }
}

/// A wire of which nothing has to be known to repeat it.
trait Repeat {
    fn repeat(&self);
    fn connect(&self);
}

impl<T: WireMessage + fmt::Debug> Repeat for Repeated<T> {
    fn repeat(&self) {
        self.repeat_each(|_| {});
    }

    fn connect(&self) {
        self.from.connect();
        self.to.connect();
    }
}

/// A wire with waypoints, and its repetition.
struct RepeatedSlice<H: WireMessage + fmt::Debug> {
    from: SliceInput<H, Waypoint>,
    to: SliceOutput<H, Waypoint>,
}

impl<H: WireMessage + fmt::Debug> Repeat for RepeatedSlice<H> {
    fn repeat(&self) {
        let send = |header: &H, waypoints: &[Waypoint]| self.to.send(header, waypoints.iter().copied());
        while self.from.next(send).is_some() {}
    }

    fn connect(&self) {
        self.from.connect();
        self.to.connect();
    }
}

/// A wire with a message a tick: what is lost on the way to the relay shows in the ticks.
struct Counted<T: WireMessage + fmt::Debug> {
    wire: Repeated<T>,
    newest: Option<Tick>,
}

impl<T: WireMessage + fmt::Debug> Counted<T> {
    fn new(worker: &Worker, from: &Wire, to: &Wire) -> Result<Self, TransportError> {
        Ok(Self { wire: Repeated::new(worker, from, to)?, newest: None })
    }

    /// Repeats; how many messages were lost before those that came.
    fn repeat(&mut self, tick_of: impl Fn(&T) -> Tick) -> u64 {
        let (mut newest, mut lost) = (self.newest, 0_u64);
        self.wire.repeat_each(|message| {
            let tick = tick_of(message);
            // A successor may tell again what its predecessor told.
            lost += newest.map_or(0, |newest| tick.saturating_sub(newest.saturating_add(1)));
            newest = newest.max(Some(tick));
        });
        self.newest = newest;
        lost
    }
}

/// Every wire of the loop → `watch/…`.
pub struct RelayProcess {
    steps: Counted<Steps>,
    pose: Counted<Pose>,
    truth: Counted<Truth>,
    others: Vec<Box<dyn Repeat>>,
    journal: Output<Journal>,
    interval: Duration,
    report: Report,
}

impl RelayProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        fn repeated<T: WireMessage + fmt::Debug>(
            worker: &Worker,
            from: &Wire,
            to: &Wire,
        ) -> Result<Box<dyn Repeat>, TransportError> {
            Ok(Box::new(Repeated::<T>::new(worker, from, to)?))
        }
        use hilare_interfaces::messages as m;
        let domain = &worker.domain;
        let goal = RepeatedSlice::<m::GoalHeader> {
            from: domain.slice_input(&wires::GOAL)?,
            to: domain.slice_output(&watch::GOAL)?,
        };
        let path = RepeatedSlice::<m::PathHeader> {
            from: domain.slice_input(&wires::PATH)?,
            to: domain.slice_output(&watch::PATH)?,
        };
        Ok(Self {
            steps: Counted::new(worker, &wires::STEPS, &watch::STEPS)?,
            pose: Counted::new(worker, &wires::POSE, &watch::POSE)?,
            truth: Counted::new(worker, &wires::TRUTH, &watch::TRUTH)?,
            others: vec![
                Box::new(goal),
                repeated::<m::Answer>(worker, &wires::ANSWER, &watch::ANSWER)?,
                Box::new(path),
                repeated::<m::Wheels>(worker, &wires::WHEELS, &watch::WHEELS)?,
                repeated::<m::PoseFix>(worker, &wires::FIX, &watch::FIX)?,
                repeated::<m::Reference>(worker, &wires::REFERENCE, &watch::REFERENCE)?,
                repeated::<m::Command>(worker, &wires::COMMAND, &watch::COMMAND)?,
                repeated::<m::Authority>(worker, &wires::AUTHORITY, &watch::AUTHORITY)?,
                repeated::<m::Health>(worker, &wires::HEALTH, &watch::HEALTH)?,
            ],
            journal: domain.output(&watch::JOURNAL)?,
            interval: relay_interval(worker.assignment.clock),
            report: Report::default(),
        })
    }
}

impl RelayProcess {
    /// What the boxes noted since the last look.
    fn repeat_journals(&self, page: &SharedPage) {
        for slot in 0..MAX_SLOTS {
            let Some(role) = page.role(slot) else { continue };
            // Bounded: whoever notes without end shall not keep the wires waiting.
            for entry in std::iter::from_fn(|| page.journal(slot).next()).take(watch::JOURNAL.buffer) {
                self.journal.send(&Journal { slot: slot as u64, role: role.code(), ..entry });
            }
        }
    }
}

impl Reactive for RelayProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        self.report.rejected += self.steps.repeat(|steps| steps.tick)
            + self.pose.repeat(|pose| pose.tick)
            + self.truth.repeat(|truth| truth.tick);
        self.others.iter().for_each(|wire| wire.repeat());
        self.repeat_journals(&worker.page);
        self.report.tick = self.steps.newest.unwrap_or(0);
        self.report.steps = self.report.tick;
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
        self.steps.wire.connect();
        self.pose.wire.connect();
        self.truth.wire.connect();
        self.others.iter().for_each(|wire| wire.connect());
        self.journal.connect();
    }
}
