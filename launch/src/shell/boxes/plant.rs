//! The simulated robot's process.

use super::is_new;
use crate::shell::page::MAX_WAIT;
use crate::shell::renewal::Renewals;
use crate::shell::standing::Stands;
use crate::shell::transport::{Input, Output};
use crate::shell::worker::{Reactive, Report, Worker};
use crate::shell::{ClockKind, build};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{PoseFix, Steps, Truth, Wheels};
use hilare_interfaces::state::Stateful;
use hilare_interfaces::wires::{self, Role};
use hilare_plant::Plant;
use std::mem;
use std::time::Duration;

/// steps → truth, wheels, fix.
pub struct PlantProcess {
    plant: Plant,
    renewals: Renewals<Plant>,
    steps: Input<Steps>,
    truth: Output<Truth>,
    /// Only of a robot whose estimator reads them.
    sensors: Option<(Output<Wheels>, Output<PoseFix>)>,
    /// The tick that was simulated last.
    done: Option<Tick>,
    report: Report,
    /// Somebody waits for what it says: its sensors' reader, or the lockstep clock.
    awaited: bool,
}

/// How long a plant nobody waits for sleeps between two looks: few wake-ups, and the truth is there when the
/// recorder looks.
const LOOK: Duration = Duration::from_millis(4);

impl PlantProcess {
    /// Opens its ports.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let domain = &worker.domain;
        let sensors = match worker.system.reads_sensors() {
            true => Some((domain.output(&wires::WHEELS)?, domain.output(&wires::FIX)?)),
            false => None,
        };
        Ok(Self {
            awaited: sensors.is_some() || worker.assignment.clock != ClockKind::Real,
            plant: build::plant(&worker.system)?,
            renewals: Renewals::begin(worker, build::plant)?,
            steps: domain.input(&wires::STEPS)?,
            truth: domain.output(&wires::TRUTH)?,
            sensors,
            done: None,
            report: Report::default(),
        })
    }
}

impl PlantProcess {
    /// Goes on with other parameters, if it is to before the tick after `executed` ticks.
    #[inline]
    fn renew_at(&mut self, worker: &mut Worker, executed: Tick) {
        let Some(mut renewal) = self.renewals.due(worker, executed) else { return };
        renewal.made.take_over(&mut self.plant);
        mem::swap(&mut self.plant, &mut renewal.made);
        mem::swap(&mut worker.system, &mut renewal.system);
        self.renewals.applied(worker, renewal, executed, false);
    }
}

impl Reactive for PlantProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        let mut worked = false;
        // Before time begins there is no message to do it at.
        self.renew_at(worker, 0);
        while let Some(steps) = self.steps.next() {
            // A successor of the step generator repeats what its predecessor said last.
            if !is_new(self.done, steps.tick) {
                continue;
            }
            if self.done.is_none() {
                worker.journal_began(steps.tick, None);
            }
            self.done = Some(steps.tick);
            worker.note_taken(Role::StepGenerator, steps.tick);
            self.renew_at(worker, steps.tick.saturating_sub(1));
            let observed = self.plant.step(steps.tick, &steps);
            if let Some((wheels, fix)) = &self.sensors {
                worker.note_telling(steps.tick);
                // The fix first, also for a reader that has just come: whoever has the wheels of a tick has its
                // fixes.
                fix.connect();
                if let Some(seen) = &observed.fix {
                    fix.send(seen);
                }
                wheels.send(&observed.wheels);
            }
            self.truth.send(&observed.truth);
            self.report.tick = steps.tick;
            self.report.steps += 1;
            worked = true;
        }
        // Nobody is woken by the truth: its only reader looks by itself.
        if worked && self.sensors.is_some() {
            worker.page.ring(&wires::WHEELS);
        }
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn stands(&mut self, room: &mut [u64]) -> Option<Stands> {
        let done = Some(self.done?);
        Some(Stands { done, number: 0, words: self.plant.save_state(room).unwrap_or(0) })
    }

    fn poll_interval(&self) -> Duration {
        if self.awaited { MAX_WAIT } else { LOOK }
    }

    fn is_woken(&self) -> bool {
        self.awaited
    }

    fn connect(&self) {
        self.steps.connect();
        self.truth.connect();
        if let Some((wheels, fix)) = &self.sensors {
            fix.connect();
            wheels.connect();
        }
    }
}
