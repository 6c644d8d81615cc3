//! A recording: every tick of a robot, also of one that was recorded while it was up.

use super::PastRun;
use crate::config::{System, short_name};
use crate::recording::{Entry, Recording};
use crate::report::drove::{self, Drove};
use crate::report::{Counters, Mishaps, RunIdentity, Summary};
use hilare_controller::{LAWS, law};
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_interfaces::geometry::WorldPose;
use hilare_interfaces::latency::Quantiles;
use hilare_interfaces::messages::{JournalKind, ReferenceState, Waypoint};
use hilare_interfaces::wires::Role;
use hilare_recorder::assembler::Assembler;
use hilare_recorder::{RunRecord, TickRecord};
use std::collections::BTreeMap;
use std::path::Path;

/// Poses kept at most, 128 MB: an hour and more. Of what is longer, the rest is not compared bit for bit.
const MAX_POSES: usize = 4_000_000;
/// Paths drawn at most.
const MAX_PATHS: usize = 1000;
/// Changes of the counters kept at most.
const MAX_MISHAPS: usize = 100_000;

/// What the ticks of a recording come to.
pub(super) struct Ticks {
    /// Figures and curves, from the first tick on a path to the arrival.
    record: RunRecord,
    /// Ticks and estimated poses of the same.
    pub poses: Vec<(u64, WorldPose)>,
    /// Counters wherever they changed, and at both ends.
    pub mishaps: Vec<Mishaps>,
    /// Paths that were driven, the last one under way at the end.
    paths: Vec<u64>,
    /// From which tick on the reference speed was which.
    pub speeds: Vec<(u64, f64)>,
    /// Ticks after the last arrival.
    after: u64,
    /// Every path, by its number.
    plans: BTreeMap<u64, Vec<Waypoint>>,
    /// Who drove.
    drove: Drove,
    /// Law of each controller that said so: its place in the list of laws plus 1, 0 for a program.
    laws: BTreeMap<drove::Driver, u64>,
    /// Ticks that are missing between the first and the last.
    gaps: u64,
}

impl Ticks {
    fn new(period_ticks: u64) -> Self {
        Self {
            record: RunRecord::new(period_ticks),
            poses: Vec::new(),
            mishaps: Vec::new(),
            paths: Vec::new(),
            speeds: Vec::new(),
            after: 0,
            plans: BTreeMap::new(),
            drove: Drove::default(),
            laws: BTreeMap::new(),
            gaps: 0,
        }
    }

    fn push(&mut self, tick: TickRecord<'_>) {
        // A robot that was joined while it waited for a path, or stood at the end of one.
        let tracking = tick.reference.state == ReferenceState::Tracking.code();
        let path = self.paths.last().copied();
        if path.is_none() && !tracking {
            return;
        }
        if self.record.statistics.arrived() && tracking && path != Some(tick.reference.path_id) {
            // Another drive; in between the robot stood.
            self.record.statistics.go_on();
            self.after = 0;
        }
        self.record.push(tick);
        if self.record.statistics.arrived() {
            self.after += 1;
            return;
        }
        if path != Some(tick.reference.path_id) && self.paths.len() < MAX_PATHS {
            self.paths.push(tick.reference.path_id);
        }
        let speed_mps = tick.reference.speed_mps;
        if tracking
            && self.speeds.last().is_none_or(|(_, last)| *last != speed_mps)
            && self.speeds.len() < MAX_MISHAPS
        {
            self.speeds.push((tick.steps.tick, speed_mps));
        }
        if self.poses.len() < MAX_POSES {
            self.poses.push((tick.steps.tick, tick.pose.pose()));
        }
        self.drove.note(tick.steps);
        self.count(tick);
    }

    /// Who drove, in words; `asked` is what the recording says of a controller that was at work before it, and of
    /// a program.
    fn drove(&self, asked: &str) -> String {
        let asked = short_name(asked);
        let name = |driver: &drove::Driver| match self.laws.get(driver) {
            None => asked.clone(),
            Some(0) if law(&asked).is_none() => asked.clone(),
            Some(0) => "external program".to_owned(),
            Some(place) => LAWS.get(*place as usize - 1).map_or(asked.clone(), |law| law.name.to_owned()),
        };
        match self.drove.drivers() {
            [] => asked.clone(),
            drivers => drove::in_words(drivers.iter().map(name)),
        }
    }

    /// The path that was driven first; empty where it is not known.
    fn first_path(&mut self) -> Vec<Waypoint> {
        self.paths.first().and_then(|path| self.plans.remove(path)).unwrap_or_default()
    }

    /// Those that were driven after it, as far as they are known.
    pub fn later_paths(&mut self) -> Vec<Vec<Waypoint>> {
        self.paths.iter().skip(1).filter_map(|path| self.plans.remove(path)).collect()
    }

    fn count(&mut self, TickRecord { steps, .. }: TickRecord<'_>) {
        let now = Mishaps {
            tick: steps.tick,
            ticks_late: steps.ticks_late,
            paused_ticks: steps.paused_ticks,
            commands_late: steps.commands_late,
            cycles_without_command: steps.cycles_without_command,
        };
        let same = |before: &Mishaps| Mishaps { tick: now.tick, ..*before } == now;
        match &mut self.mishaps[..] {
            // The last one stands for the end so far.
            [.., before, last] if same(before) && same(last) => *last = now,
            all if all.len() < MAX_MISHAPS => self.mishaps.push(now),
            _ => {}
        }
    }
}

/// Everything a recording has of each tick.
pub(super) fn ticks(recording: &Recording) -> Result<Ticks, String> {
    let period_ticks = recording.info().period_ticks;
    let mut assembler = Assembler::new(period_ticks);
    let mut ticks = Ticks::new(period_ticks);
    // What was before the recording is no gap in it.
    let mut before = None;
    // Where the newest reference says so.
    let mut arrived_on = None;
    for timed in recording.entries() {
        match timed.map_err(|error| error.to_string())?.entry {
            Entry::Steps(steps) => assembler.push_steps(steps),
            Entry::Pose(pose) => assembler.push_pose(pose),
            Entry::Truth(truth) => assembler.push_truth(truth),
            Entry::Reference(reference) => {
                arrived_on = (reference.state == ReferenceState::Arrived.code()).then_some(reference.path_id);
                assembler.push_reference(reference);
            }
            Entry::Path(header, waypoints) => {
                ticks.plans.insert(header.path_id, waypoints);
            }
            Entry::Journal(entry) => {
                if entry.role == Role::Controller.code() && entry.kind == JournalKind::Began.code() {
                    ticks.laws.insert((entry.slot + 1, entry.words[1]), entry.words[3]);
                }
            }
            _ => continue,
        }
        let gaps = assembler.gaps();
        assembler.drain(|tick| {
            before.get_or_insert(gaps.max(tick.steps.tick - 1));
            ticks.push(tick);
        });
    }
    assembler.finish(|tick| {
        before.get_or_insert(tick.steps.tick - 1);
        ticks.push(tick);
    });
    // Of a run that ended with its arrival there is no tick after it.
    if arrived_on.is_some() && arrived_on == ticks.paths.last().copied() {
        ticks.record.statistics.note_arrival();
    }
    ticks.gaps = assembler.gaps().saturating_sub(before.unwrap_or(0));
    Ok(ticks)
}

pub(super) fn open(file: &Path) -> Result<PastRun, String> {
    let recording = Recording::open(file).map_err(|error| error.to_string())?;
    let place = file.display();
    let mut ticks = ticks(&recording)?;
    let rows = ticks.record.trace.rows().to_vec();
    if rows.is_empty() {
        return Err(format!(
            "{place}: no tick on a path in it; steps, pose, truth and reference of a robot under way are needed"
        ));
    }
    let mut lacking = Vec::new();
    let mut lacks = |condition: bool, what: String| {
        if condition {
            lacking.push(format!("{place}: {what}"));
        }
    };
    lacks(ticks.gaps > 0, format!("{} ticks are missing in it", ticks.gaps));
    lacks(
        recording.truncated().is_some(),
        "it has no end; what came after its last whole chunk is lost".to_owned(),
    );
    let stood_s = ticks.after as f64 / TICKS_PER_SECOND as f64;
    lacks(
        ticks.after > 1,
        format!("drawn to its arrival; the {stood_s:.3} s that it stood there are in it, too"),
    );
    let (waypoints, later_paths) = (ticks.first_path(), ticks.later_paths());
    let lost = ticks.paths.len() - usize::from(!waypoints.is_empty()) - later_paths.len();
    let of_paths = ticks.paths.len();
    lacks(lost > 0, format!("{lost} of its {of_paths} paths are not in it and not drawn"));
    let system_text = recording.system().unwrap_or_default().to_owned();
    let system = recording.system().and_then(|text| System::parse("system.toml", text).ok());
    lacks(
        system.is_none(),
        "no system file in it; reference speed, acceptance radius and map are not drawn".to_owned(),
    );
    let map = system.as_ref().and_then(|system| {
        system.load_map().unwrap_or_else(|error| {
            lacks(true, format!("{error}; the obstacles are not drawn"));
            None
        })
    });
    let info = recording.info();
    let scenario = if info.scenario.is_empty() { &info.robot } else { &info.scenario };
    let controller = ticks.drove(&info.controller);
    let identity = RunIdentity { scenario, controller: &controller, clock: &info.clock };
    let wheels = system.as_ref().map_or(0, |system| system.chassis.wheels());
    let figures = ticks.record.statistics.figures();
    Ok(PastRun {
        place: file.to_owned(),
        summary: Summary::new(identity, &figures, wheels, Counters::default(), Quantiles::default()),
        is_recording: true,
        waypoints,
        later_paths,
        acceptance_radius_m: system.as_ref().map_or(0.0, |system| system.tracking.acceptance_radius_m),
        // Not a number is not drawn.
        reference_speed_mps: system.as_ref().map_or(f64::NAN, |system| system.tracking.speed_mps),
        reference_speeds: ticks.speeds,
        map,
        rows,
        poses: ticks.poses,
        mishaps: ticks.mishaps,
        system: system_text,
        lacking,
    })
}
