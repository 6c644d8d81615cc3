//! What a peer's two processes do.

use crate::links::{self, Driver, Place};
use crate::messages::Pose;
use crate::page::{Page, Round, Side};
use crate::realtime::{self, monotonic_ns, sleep_until};
use crate::{Result, named};
use std::path::PathBuf;
use std::sync::Arc;

/// From one pose to the next.
const PERIOD_NS: u64 = 1_000_000;
/// Rounds at the beginning of a turn that are driven but not written down: the other peers have had the
/// caches since the last one.
const WARM_UP: u32 = 100;
/// SCHED_FIFO priority of the driver: that of hilare's step generator.
pub const DRIVER_PRIORITY: i32 = 80;
/// SCHED_FIFO priority of the responder: that of hilare's controllers.
pub const RESPONDER_PRIORITY: i32 = 65;

/// Where a process of a peer belongs.
#[derive(clap::Args, Debug)]
pub struct RoleOptions {
    /// The peer.
    peer: String,
    /// The run's directory.
    #[arg(long)]
    directory: PathBuf,
    /// The processor to stay on.
    #[arg(long)]
    cpu: usize,
}

impl RoleOptions {
    fn enter(&self, priority: i32) -> Result<(&'static links::Peer, Place)> {
        let peer = links::find(&self.peer)?;
        let page = Arc::new(Page::open(&page_file(&self.directory, peer.name))?);
        // Before the transport starts its threads, which inherit this.
        realtime::apply(priority, self.cpu);
        Ok((peer, Place { directory: self.directory.clone(), peer: peer.name, page }))
    }
}

/// Where the page of a peer lies.
pub fn page_file(directory: &std::path::Path, peer: &str) -> PathBuf {
    directory.join(format!("{peer}.page"))
}

/// Answers poses until all shall leave.
pub fn respond(options: &RoleOptions) -> Result<()> {
    let (peer, place) = options.enter(RESPONDER_PRIORITY)?;
    peer.respond(&place).map_err(named("responder"))
}

/// Sends poses whenever it is this peer's turn, until all shall leave.
pub fn drive(options: &RoleOptions) -> Result<()> {
    let (peer, place) = options.enter(DRIVER_PRIORITY)?;
    let mut link = peer.driver(&place).map_err(named("driver"))?;
    let mut tick = 0;
    place.page.set_ready(Side::Driver);
    let mut outcome = Ok(());
    while let (Ok(()), Some(rounds)) = (&outcome, place.page.await_turn()) {
        outcome = turn(&place.page, link.as_mut(), rounds, &mut tick).map_err(named("driver"));
    }
    place.page.set_gone(Side::Driver);
    outcome
}

fn turn(page: &Page, link: &mut dyn Driver, rounds: u32, tick: &mut u64) -> Result<()> {
    let mut wake = monotonic_ns() + PERIOD_NS;
    for n in 0..WARM_UP + rounds {
        sleep_until(wake);
        if page.leaving() {
            break;
        }
        *tick += 1;
        let pose = Pose::of(*tick);
        let sent = monotonic_ns();
        link.send(&pose)?;
        let (command, arrived) = link.command()?;
        if command.pose_tick != pose.tick {
            return Err(format!(
                "pose {} was answered with a command for pose {}",
                pose.tick, command.pose_tick
            )
            .into());
        }
        if n >= WARM_UP {
            page.record(Round {
                lateness: sent.saturating_sub(wake),
                one_way: command.received_ns.saturating_sub(sent),
                round: arrived.saturating_sub(sent),
            });
        }
        wake += PERIOD_NS;
        // Keeps the phase and leaves out what is over, rather than hurry.
        let behind = monotonic_ns().saturating_sub(wake).div_ceil(PERIOD_NS);
        wake += behind * PERIOD_NS;
        if n >= WARM_UP {
            page.skip(u32::try_from(behind).unwrap_or(u32::MAX));
        }
    }
    Ok(())
}
