//! The waypoint selector's process.

use super::is_new;
use crate::shell::build;
use crate::shell::checkpoint::key_of;
use crate::shell::page::News;
use crate::shell::renewal::Renewals;
use crate::shell::standing::Stands;
use crate::shell::transport::{Input, Output, SliceInput};
use crate::shell::worker::{Reactive, Report, Worker};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::messages::{JournalKind, MAX_WAYPOINTS, PathHeader, Pose, Reference, Waypoint};
use hilare_interfaces::state::Stateful;
use hilare_interfaces::wires::{self, Role};
use hilare_waypoint_selector::{NewPath, SelectorInputs, WaypointSelector};
use std::mem;

/// pose, path → reference.
pub struct SelectorProcess {
    selector: WaypointSelector,
    pose: Input<Pose>,
    path: SliceInput<PathHeader, Waypoint>,
    reference: Output<Reference>,
    period_ticks: u64,
    /// A path that came since the last control period.
    waiting: Option<PathHeader>,
    waiting_points: Vec<Waypoint>,
    key: u64,
    /// All it needs is in the system.
    renewals: Renewals<()>,
    /// The tick that was answered last.
    done: Option<Tick>,
    /// The two newest poses that could not be answered for want of the path: the command of the one may be due
    /// when the other is there, too.
    held: [Option<Pose>; 2],
    report: Report,
    /// The announcement of a path that was looked after last, and the looks at poses since.
    announced: u32,
    looks: u32,
}

/// Looks at poses after which the path is looked at unasked.
const LOOKS: u32 = 10;

impl SelectorProcess {
    /// Opens its ports.
    pub fn new(worker: &mut Worker) -> Result<Self, String> {
        let key = key_of(Role::WaypointSelector);
        let (selector, done) = worker.resume(key, build::waypoint_selector);
        worker.journal_began(done.unwrap_or(0), done.map(|tick| (tick, worker.assignment.slot)));
        Ok(Self {
            selector,
            pose: worker.domain.input(&wires::POSE)?,
            path: worker.domain.slice_input(&wires::PATH)?,
            reference: worker.domain.output(&wires::REFERENCE)?,
            period_ticks: worker.system.timing.period_ticks,
            waiting: None,
            waiting_points: Vec::with_capacity(MAX_WAYPOINTS + 1),
            key,
            renewals: Renewals::begin(worker, |_| Ok(()))?,
            done,
            held: [None; 2],
            report: Report { tick: done.unwrap_or(0), ..Report::default() },
            announced: 0,
            looks: 0,
        })
    }

    /// The path that was awaited is there: what the predecessor said last is said again, because it may have
    /// died before anybody heard it, or those who did may be dead.
    fn take_up(&mut self) -> bool {
        let Some(header) = self.waiting.filter(|_| self.selector.awaits_path().is_some()) else {
            return false;
        };
        let path = NewPath { header: &header, waypoints: &self.waiting_points };
        let mut sent = false;
        for reference in self.selector.take_up(path) {
            self.reference.send(&reference);
            sent = true;
        }
        if self.selector.awaits_path().is_none() {
            self.waiting = None;
        }
        sent
    }

    /// A successor says nothing new before it has the path again: to stand still would be an order.
    fn is_lost(&self) -> bool {
        self.selector.awaits_path().is_some() && self.waiting.is_none()
    }

    /// The next pose: those that were held, if they can be answered now, then those that come.
    fn next(&mut self, lost: bool) -> Option<Pose> {
        let held = self.held.iter_mut().find_map(|held| held.take_if(|_| !lost));
        held.or_else(|| self.pose.next())
    }

    /// Goes on with other parameters, if it is to before it answers the pose of tick `next`.
    #[inline]
    fn renew_at(&mut self, worker: &mut Worker, next: Tick) {
        let Some(mut renewal) = self.renewals.due(worker, next) else { return };
        mem::swap(&mut worker.system, &mut renewal.system);
        self.selector.set_tracking(worker.system.tracking, worker.system.acceptance());
        self.renewals.applied(worker, renewal, next, false);
    }

    /// Answers a pose that begins a control period.
    fn choose(&mut self, worker: &mut Worker, pose: &Pose) {
        worker.note_taken(Role::PoseEstimator, pose.tick);
        self.renew_at(worker, pose.tick);
        let header = self.waiting.take();
        if let Some(header) = &header {
            let words = [header.path_id, header.goal_id, self.waiting_points.len() as u64];
            worker.journal(pose.tick, JournalKind::Path, &words);
        }
        let path = header.as_ref().map(|header| NewPath { header, waypoints: &self.waiting_points });
        let reference = self.selector.step(pose.tick, SelectorInputs { pose, path });
        worker.note_telling(pose.tick);
        self.reference.send(&reference);
        worker.note_told(pose.tick);
        self.done = Some(pose.tick);
        worker.remember(self.key, pose.tick, &mut self.selector);
        self.report.steps += 1;
        self.report.rejected = self.selector.rejected_paths() + self.selector.rejected_poses();
    }

    /// A path is looked for when one was announced, as long as there is none, and now and then: where there is
    /// none, that look is a good part of the time between a pose and its reference.
    fn path_may_be_there(&mut self, worker: &Worker) -> bool {
        let announced = worker.page.announced(News::Path);
        self.looks += 1;
        let wanted = self.report.path_id == 0 || announced != self.announced || self.looks >= LOOKS;
        if wanted {
            (self.announced, self.looks) = (announced, 0);
        }
        wanted
    }

    /// Copies a new path out of shared memory; it takes effect at the next control period.
    fn take_path(&mut self) -> bool {
        let (waiting, points, report) = (&mut self.waiting, &mut self.waiting_points, &mut self.report);
        let took = self.path.next(|header, waypoints| {
            // A successor of the planner repeats the path that is under way.
            if header.path_id == report.path_id {
                return;
            }
            *waiting = Some(*header);
            points.clear();
            // One more than a path may have is enough for the box to refuse it.
            points.extend_from_slice(&waypoints[..waypoints.len().min(MAX_WAYPOINTS + 1)]);
            report.path_id = header.path_id;
        });
        took.is_some()
    }
}

impl Reactive for SelectorProcess {
    fn poll(&mut self, worker: &mut Worker) -> bool {
        // Before time begins there is no message to do it at.
        self.renew_at(worker, 0);
        let mut worked = self.path_may_be_there(worker) && self.take_path();
        if self.is_lost() {
            // It has the path, and sleeps.
            worker.page.members(Role::Planner).for_each(|slot| worker.page.ring_slot(slot));
        }
        let mut chosen = self.take_up();
        let lost = self.is_lost();
        while let Some(pose) = self.next(lost) {
            worked = true;
            self.report.tick = pose.tick;
            let begins_period = pose.tick.is_multiple_of(self.period_ticks);
            if !begins_period || !is_new(self.done, pose.tick) {
                continue;
            }
            if lost {
                self.held = [self.held[1], Some(pose)];
                continue;
            }
            self.choose(worker, &pose);
            chosen = true;
        }
        if chosen {
            worker.page.ring(&wires::REFERENCE);
        }
        worked
    }

    fn report(&self) -> Report {
        self.report
    }

    fn stands(&mut self, room: &mut [u64]) -> Option<Stands> {
        let words = self.selector.save_state(room).unwrap_or(0);
        Some(Stands { done: self.done, number: 0, words })
    }

    fn connect(&self) {
        self.pose.connect();
        self.path.connect();
        self.reference.connect();
    }
}
