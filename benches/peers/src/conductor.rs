//! One run: starts the peers, gives them turns, and makes the report.

use crate::figures::{Absent, FLOOR, Report, Row};
use crate::links::{self, PEERS, Peer};
use crate::pair::{Pair, Setting};
use crate::{Result, host, realtime};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::fs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Where the run's files are: in memory, as a robot's are.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// From the last peer's start to the first turn.
const SETTLE: Duration = Duration::from_secs(3);

/// What to measure, and how much of it.
#[derive(clap::Args, Debug)]
pub struct RunOptions {
    /// Samples a peer.
    #[arg(long, default_value_t = 60_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    rounds: u32,
    /// Samples of a turn; the peers take turns until each has its rounds.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    block: u32,
    /// Only these peers, and the futex, which the others are compared with.
    #[arg(long, value_delimiter = ',')]
    peers: Vec<String>,
    /// The processor of the drivers; the last one unless told otherwise.
    #[arg(long)]
    cpu: Option<usize>,
    /// The processor of the responders; that of the drivers unless told otherwise.
    #[arg(long)]
    responder_cpu: Option<usize>,
    /// Where to write peers.json, peers.md and every peer's rounds as CSV.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Prints JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// dora's command line.
    #[arg(long, hide = true)]
    dora: Option<PathBuf>,
}

/// The run's files in shared memory, gone with it.
struct Traces {
    directory: tempfile::TempDir,
    /// How the names of iceoryx2's files begin.
    prefix: String,
}

impl Traces {
    fn make() -> Result<Self> {
        let directory = tempfile::Builder::new().prefix("hilare-peers.").tempdir_in(SHARED_MEMORY)?;
        let prefix = format!("{}.", directory.path().file_name().unwrap_or_default().to_string_lossy());
        links::write_config(directory.path(), &prefix)?;
        Ok(Self { directory, prefix })
    }
}

impl Drop for Traces {
    fn drop(&mut self) {
        for file in fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten() {
            if file.file_name().to_string_lossy().starts_with(&self.prefix) {
                let _ = fs::remove_file(file.path());
            }
        }
    }
}

/// How a run ended.
pub enum Outcome {
    /// Every peer asked for was measured.
    Complete,
    /// Some were not; the report says why.
    Incomplete,
}

/// Measures and reports.
pub fn run(options: &RunOptions, plan: &Plan) -> Result<Outcome> {
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))?;
    }
    let interrupted = || interrupted.load(Ordering::Relaxed);
    let traces = Traces::make()?;
    let setting = plan.setting(traces.directory.path());
    realtime::keep_off(setting.driver_cpu);
    let report = measure(options, &plan.peers, &setting, &interrupted)?;
    if let Some(directory) = &options.out {
        keep(&report, directory)?;
    }
    if options.json {
        println!("{:#}", report.json());
    } else {
        print!("{}", report.markdown());
    }
    Ok(if report.absent.is_empty() { Outcome::Complete } else { Outcome::Incomplete })
}

/// The peers of these names and the floor, in the table's order; all without a name.
fn chosen(names: &[String]) -> Result<Vec<&'static Peer>> {
    names.iter().try_for_each(|name| links::find(name).map(drop))?;
    let asked =
        |peer: &&Peer| names.is_empty() || peer.name == FLOOR || names.iter().any(|name| name == peer.name);
    Ok(PEERS.iter().filter(asked).collect())
}

/// What the options come to on this machine.
pub struct Plan {
    peers: Vec<&'static Peer>,
    driver_cpu: usize,
    responder_cpu: usize,
    dora: Option<PathBuf>,
}

impl Plan {
    /// Fails if the options name what is not there.
    pub fn of(options: &RunOptions) -> Result<Self> {
        let processors = realtime::processors();
        let known = |cpu: usize| {
            let there = processors.contains(&cpu).then_some(cpu);
            there.ok_or_else(|| format!("processor {cpu}: not one of {processors:?}"))
        };
        let last = *processors.last().ok_or("no processor to be had")?;
        let driver_cpu = known(options.cpu.unwrap_or(last))?;
        Ok(Self {
            peers: chosen(&options.peers)?,
            driver_cpu,
            responder_cpu: known(options.responder_cpu.unwrap_or(driver_cpu))?,
            dora: options.dora.clone(),
        })
    }

    fn setting(&self, directory: &Path) -> Setting {
        Setting {
            directory: directory.to_owned(),
            driver_cpu: self.driver_cpu,
            responder_cpu: self.responder_cpu,
            dora: self.dora.clone(),
        }
    }
}

fn measure(
    options: &RunOptions,
    peers: &[&'static Peer],
    setting: &Setting,
    interrupted: &dyn Fn() -> bool,
) -> Result<Report> {
    let (mut pairs, mut absent) = (Vec::new(), Vec::new());
    for peer in peers {
        match Pair::start(peer, options.rounds as usize, setting, interrupted) {
            Ok(pair) => pairs.push(pair),
            Err(error) => absent.push(Absent { name: peer.name, reason: error.to_string() }),
        }
        give_up_if(interrupted)?;
    }
    // What the peers still have to do after their start shall not fall into the first one's turn.
    std::thread::sleep(SETTLE);
    let before = host::steal_ms();
    let mut left = options.rounds;
    while left > 0 {
        let block = left.min(options.block);
        pairs.retain_mut(|pair: &mut Pair| match pair.turn(block, interrupted) {
            Ok(()) => true,
            Err(error) => {
                absent.push(Absent { name: pair.peer.name, reason: error.to_string() });
                false
            }
        });
        give_up_if(interrupted)?;
        left -= block;
        if std::io::stderr().is_terminal() {
            eprint!("\r{} of {} rounds a peer ", options.rounds - left, options.rounds);
        }
    }
    let stolen_ms = host::stolen_ms(&before, &host::steal_ms());
    let rows = pairs.iter().map(row).collect();
    Ok(Report { conditions: conditions(options, setting), stolen_ms, rows, absent })
}

fn give_up_if(interrupted: &dyn Fn() -> bool) -> Result<()> {
    if interrupted() { Err("interrupted; nothing is reported".into()) } else { Ok(()) }
}

fn row(pair: &Pair) -> Row {
    Row {
        name: pair.peer.name,
        what: pair.peer.what,
        rounds: pair.page.rounds(),
        skipped: pair.page.skipped(),
        granted: pair.granted(),
    }
}

fn conditions(options: &RunOptions, setting: &Setting) -> Vec<(&'static str, String)> {
    let cpus = format!("drivers on CPU {}, responders on CPU {}", setting.driver_cpu, setting.responder_cpu);
    vec![
        ("kernel", host::kernel()),
        ("processors", format!("{}; {cpus}", host::processors_online())),
        ("real-time budget", host::real_time_budget()),
        ("turns", format!("of {} rounds, a pose every ms", options.block)),
    ]
}

fn keep(report: &Report, directory: &Path) -> Result<()> {
    fs::create_dir_all(directory)?;
    fs::write(directory.join("peers.json"), format!("{:#}\n", report.json()))?;
    fs::write(directory.join("peers.md"), report.markdown())?;
    for row in &report.rows {
        fs::write(directory.join(format!("{}.csv", row.name)), row.csv())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_is_always_measured() {
        let names = |asked: &[&str]| {
            let asked: Vec<String> = asked.iter().map(|name| (*name).to_owned()).collect();
            chosen(&asked).map(|peers| peers.iter().map(|peer| peer.name).collect::<Vec<_>>())
        };
        assert_eq!(names(&["unix-dgram"]).unwrap(), [FLOOR, "unix-dgram"]);
        assert_eq!(names(&[]).unwrap().len(), PEERS.len());
        assert!(names(&["pigeon"]).unwrap_err().to_string().contains("pigeon"));
    }
}
