//! The operator's process: a page about the robot, for whoever asks on this machine.
//!
//! ```text
//!   relay's wires ──▶ OperatorProcess, 100 Hz ─┐
//!                                              ├──▶ Live ──▶ pages (hilare_operator)
//!   launch ◀──asks──── told, 4 Hz ─────────────┘              │
//!   launch ◀──────────────── Launch ◀──────── orders ─────────┘
//! ```
//!
//! Beside it, from the same wires, a live view for other tools: [`viewer`].
//!
//! It reads what the relay repeats and asks launch, like any observer; nobody on the tick knows of it.

mod door;
mod figures;
mod hello;
mod orders;
pub mod port;
mod predict;
mod roadmap;
pub mod token;
mod told;
pub mod viewer;

use crate::look::Told;
use crate::look::usage::Usage;
use crate::look::wires::{Heard, Wires};
use crate::manager::robot_dir::SOCKET;
use crate::shell::worker::{Reactive, Report, Worker};
use door::Door;
use hilare_interfaces::block::TICKS_PER_SECOND;
use hilare_interfaces::messages::{Drive, Mode, PathHeader, ReferenceState};
use hilare_operator::address::{Names, is_open};
use hilare_operator::live::Live;
use hilare_operator::message::{Answer, Order, Place, State};
use hilare_operator::robot::Robot;
use hilare_operator::server::{Rules, serve};
use hilare_operator::{Source, Verdict};
use hilare_planner::ClearanceField;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use told::{Slow, Teller};
use tracing::info;
use viewer::Viewer;

/// Time between two looks at the wires.
const LOOK: Duration = Duration::from_millis(10);
/// Stack of the page's thread, and of that which asks launch.
const STACK: usize = 2 << 20;
/// Time in which pages are told that the robot is down.
const LAST_WORDS: Duration = Duration::from_millis(200);

/// What the threads of the process share.
struct Shared {
    runtime_dir: PathBuf,
    socket: PathBuf,
    heard: Mutex<Heard>,
    slow: Mutex<Slow>,
    /// Distances on the map, and the number of the system they are of.
    field: Mutex<(Option<u64>, Option<Arc<ClearanceField>>)>,
    live: Live,
}

/// The relay's wires and launch → the page, and the live view for other tools.
pub struct OperatorProcess {
    wires: Wires,
    shared: Arc<Shared>,
    path: Option<PathHeader>,
    /// There is a page.
    page: bool,
    viewer: Option<Viewer>,
    report: Report,
}

impl OperatorProcess {
    /// Opens its ports, those of the network included.
    pub fn new(worker: &Worker) -> Result<Self, String> {
        let dir = &worker.assignment.runtime_dir;
        let wires = Wires::open(&worker.domain)?;
        let shared = Arc::new(Shared {
            runtime_dir: dir.clone(),
            socket: dir.join(SOCKET),
            heard: Mutex::new(wires.heard()),
            slow: Mutex::default(),
            field: Mutex::default(),
            live: Live::default(),
        });
        let door = Arc::new(Door::open()?);
        let page = !worker.system.listen.is_empty();
        if page {
            open_page(worker, &shared, &door)?;
        }
        let viewer = Viewer::open(worker, &door)?;
        Ok(Self { wires, shared, path: None, page, viewer, report: Report::default() })
    }

    /// The robot as the wires and launch have it now.
    fn state(&self) -> State {
        let (heard, slow) = (self.wires.heard(), lock(&self.shared.slow).clone());
        let reference = self.wires.reference();
        let state = reference.and_then(|reference| ReferenceState::from_code(reference.state));
        let steps = heard.steps.as_ref();
        let twist = steps.map(|steps| steps.commanded_twist());
        let count = |number: fn(&hilare_interfaces::messages::Steps) -> u64| steps.map_or(0, number);
        let number = |number: f64| if number.is_finite() { number } else { 0.0 };
        let mode = self.wires.authority().and_then(|authority| Mode::from_code(authority.mode));
        let up = slow.mode != "starting";
        State {
            tick: count(|steps| steps.tick),
            time_s: count(|steps| steps.tick) as f64 / TICKS_PER_SECOND as f64,
            mode: mode.filter(|_| up).map_or(slow.mode.clone(), |mode| mode.label().to_owned()),
            drive: steps.and_then(|steps| Drive::from_code(steps.drive)).map_or("unknown", Drive::label),
            path_state: state.map_or(ReferenceState::Idle.label(), ReferenceState::label),
            waypoint: reference.map_or(0, |reference| reference.index),
            waypoints: reference.map_or(0, |reference| reference.total),
            pose: self.wires.pose().and_then(|pose| Place::of([pose.x_m, pose.y_m, pose.theta_rad])),
            truth: heard.track.truth.and_then(Place::of),
            speed_mps: twist.map_or(0.0, |twist| number(twist.speed_mps())),
            omega_radps: twist.map_or(0.0, |twist| number(twist.omega_radps)),
            reference_mps: reference
                .filter(|_| state == Some(ReferenceState::Tracking))
                .map(|reference| number(reference.speed_mps)),
            cross_track_m: heard.track.estimate_m,
            cross_track_truth_m: heard.track.truth_m,
            law: slow.law.clone(),
            standby: slow.standby.clone(),
            commands_late: count(|steps| steps.commands_late),
            commands_rejected: count(|steps| steps.commands_rejected),
            cycles_without_command: count(|steps| steps.cycles_without_command),
            paused_ticks: count(|steps| steps.paused_ticks),
            gone: slow.is_gone(),
            ended: slow.ended.filter(|_| slow.down),
            fault: slow.fault,
            halted: slow.halted,
        }
    }
}

impl Reactive for OperatorProcess {
    fn poll(&mut self, _worker: &mut Worker) -> bool {
        self.wires.look();
        let heard = self.wires.heard();
        self.report.tick = heard.steps.map_or(0, |steps| steps.tick);
        self.report.steps = self.report.tick;
        *lock(&self.shared.heard) = heard;
        if let Some(viewer) = &mut self.viewer {
            viewer.look();
        }
        if !self.page {
            return false;
        }
        if let Some((header, path)) = self.wires.path().filter(|(header, _)| Some(*header) != self.path) {
            self.path = Some(header);
            let path: Vec<[f64; 4]> =
                path.iter().map(|point| [point.x_m, point.y_m, point.bulge, point.crab_rad]).collect();
            self.shared.live.set_path(header.path_id, &path);
        }
        self.shared.live.set_state(self.state());
        // Looked at by interval, so that a busy wire does not keep it awake.
        false
    }

    fn report(&self) -> Report {
        self.report
    }

    fn poll_interval(&self) -> Duration {
        LOOK
    }

    fn connect(&self) {
        self.wires.connect();
        self.viewer.iter().for_each(Viewer::connect);
    }

    fn finish(&mut self) -> Result<(), String> {
        if !self.page {
            return Ok(());
        }
        // Why it is down is known to launch, if that is still there.
        let told = Told::by(&self.shared.socket).ok();
        let mut slow = lock(&self.shared.slow).clone();
        if let Some(told) = told {
            slow.note(&told.status);
        }
        slow.down = true;
        *lock(&self.shared.slow) = slow;
        self.shared.live.set_state(self.state());
        std::thread::sleep(LAST_WORDS);
        Ok(())
    }
}

fn open_page(worker: &Worker, shared: &Arc<Shared>, door: &Arc<Door>) -> Result<(), String> {
    let system = &worker.system;
    let listener = port::bind(port::LISTEN, &system.listen)?;
    let open = listener.local_addr().is_ok_and(is_open);
    let token = if open { Some(token::read(&shared.runtime_dir)?) } else { None };
    let rules = Rules {
        token,
        names: Names { open, machine: token::machine() },
        stop_when_lost: system.stop_when_lost,
    };
    let launch = Launch { shared: Arc::clone(shared), door: Arc::clone(door) };
    thread("page", move || {
        if let Err(error) = serve(listener, Arc::new(launch), rules) {
            tracing::error!("the page: {error}");
            std::process::exit(1);
        }
    })?;
    let mut teller = Teller::new(Arc::clone(shared), worker);
    thread("told", move || teller.tell_for_ever())?;
    info!("the page is at {}", token::url(&system.listen, None));
    Ok(())
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    // It is replaced as a whole: there is nothing half done in it.
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

fn thread(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), String> {
    let thread = std::thread::Builder::new().name(name.to_owned()).stack_size(STACK);
    thread.spawn(work).map(drop).map_err(|error| format!("no thread for the page: {error}"))
}

/// Where the page's figures come from and its orders go.
struct Launch {
    shared: Arc<Shared>,
    door: Arc<Door>,
}

impl Source for Launch {
    fn look(&self) -> Result<Robot, String> {
        let told = Told::by(&self.shared.socket).map_err(|why| format!("launch does not answer: {why}"))?;
        let heard = *lock(&self.shared.heard);
        Ok(figures::robot(&told, &heard, Usage::of))
    }

    fn live(&self) -> &Live {
        &self.shared.live
    }

    fn order(&self, order: &Order, cancelled: &AtomicBool) -> Answer {
        orders::carry_out(&self.shared, order, cancelled)
    }

    fn admit(&self, peer: SocketAddr, own: SocketAddr, verdict: Verdict) {
        // From elsewhere there is nobody's account to be known: there it is the token that counts.
        if is_open(peer) { verdict(true) } else { self.door.ask(peer, own, verdict) }
    }
}
