//! Processes beside a robot that are no part of it: this very test program, in another role.
//!
//! * witness: reads the step generator's wire along and writes down every tick it saw, with the time;
//! * liar: sends commands of those who may not command, one of each kind a control cycle;
//! * flooder: sends as many commands as it can get rid of;
//! * greedy: commands in the name of the controller in charge, and ahead of it, far beyond the limits;
//! * foreigner: a program of another build, whose messages are laid out otherwise.
//!
//! A process joins the domain of one robot only, so each robot has its own.

use crate::support::{Lab, Running, wait_until};
use hilare::shell::page::monotonic_ns;
use hilare::shell::transport::{Domain, TransportError};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{self, Steps};
use hilare_interfaces::wires::{self, Wire};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// The test that is such a process; every program with real robots has one of this name.
const TEST: &str = "a_process_beside_a_robot";
const ROLE: &str = "HILARE_TEST_ROLE";
const ROBOT_DIR: &str = "HILARE_TEST_ROBOT_DIR";
const FILE: &str = "HILARE_TEST_ROLE_FILE";

/// What a process beside a robot is there for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Writes down every tick.
    Witness,
    /// Commands without right.
    Liar,
    /// Commands without right, more than there is room for.
    Flooder,
    /// Commands too much in the name of who may.
    Greedy,
    /// Does not speak the same messages.
    Foreigner,
}

const ROLES: [(Role, &str); 5] = [
    (Role::Witness, "witness"),
    (Role::Liar, "liar"),
    (Role::Flooder, "flooder"),
    (Role::Greedy, "greedy"),
    (Role::Foreigner, "foreigner"),
];

/// Plays the role this process was started for.
pub fn play() {
    let wanted = std::env::var(ROLE).expect("it is started by other tests");
    let (role, _) = ROLES.iter().find(|(_, name)| *name == wanted).expect("a role");
    let file = PathBuf::from(std::env::var_os(FILE).expect("a file to write"));
    let robot_dir = PathBuf::from(std::env::var_os(ROBOT_DIR).expect("a robot's directory"));
    let domain = patiently(|| Domain::join(&robot_dir, "beside"));
    match role {
        Role::Witness => witness(&domain, &file),
        Role::Liar => once_a_cycle(&domain, &file, lies),
        Role::Flooder => flood(&domain, &file),
        Role::Greedy => once_a_cycle(&domain, &file, greed),
        Role::Foreigner => {
            patiently(|| domain.input::<Steps>(&wires::STEPS));
            let other = Wire { layout_hash: wires::STEPS.layout_hash ^ 1, ..wires::STEPS };
            let answer =
                domain.input::<Steps>(&other).map_or_else(|error| error.to_string(), |_| String::new());
            fs::write(file, answer).expect("its answer");
        }
    }
}

/// Launch may still be starting: tries until it has come as far.
fn patiently<T>(mut attempt: impl FnMut() -> Result<T, TransportError>) -> T {
    let deadline = Instant::now() + Duration::from_secs(10);
    loop {
        match attempt() {
            Ok(result) => return result,
            Err(error) if Instant::now() > deadline => panic!("{error}"),
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

fn told_to_end(file: &Path) -> bool {
    file.with_extension("end").exists()
}

fn witness(domain: &Domain, file: &Path) {
    let steps_in = patiently(|| domain.input::<Steps>(&wires::STEPS));
    let mut out = File::create(file).expect("a file to write");
    let mut text = "ns tick counts twist drive source in_charge …\n".to_owned();
    let mut ends = false;
    while !ends {
        ends = told_to_end(file);
        steps_in.connect();
        while let Some(steps) = steps_in.next() {
            let _ = writeln!(text, "{} {}", monotonic_ns(), words_of(&steps));
        }
        out.write_all(text.as_bytes()).expect("what was seen");
        text.clear();
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// What is kept of a tick, in text that reads back to the same bits.
fn words_of(steps: &Steps) -> String {
    let words = [
        steps.tick,
        steps.counts[0].cast_unsigned(),
        steps.counts[1].cast_unsigned(),
        steps.dir_level[0],
        steps.dir_level[1],
        steps.twist[0].to_bits(),
        steps.twist[2].to_bits(),
        steps.drive,
        steps.source,
        steps.in_charge,
        steps.epoch,
        steps.term,
        steps.commands_late,
        steps.commands_rejected,
        steps.cycles_without_command,
        steps.commands_borrowed,
        steps.promotions,
        steps.paused_ticks,
    ];
    words.map(|word| word.to_string()).join(" ")
}

fn steps_of(mut words: impl Iterator<Item = u64>) -> Option<Steps> {
    let mut next = || words.next();
    let mut steps = Steps { tick: next()?, ..Steps::ZERO };
    steps.counts[0] = next()?.cast_signed();
    steps.counts[1] = next()?.cast_signed();
    (steps.dir_level[0], steps.dir_level[1]) = (next()?, next()?);
    steps.twist[0] = f64::from_bits(next()?);
    steps.twist[2] = f64::from_bits(next()?);
    steps.drive = next()?;
    (steps.source, steps.in_charge, steps.epoch, steps.term) = (next()?, next()?, next()?, next()?);
    (steps.commands_late, steps.commands_rejected) = (next()?, next()?);
    (steps.cycles_without_command, steps.commands_borrowed) = (next()?, next()?);
    (steps.promotions, steps.paused_ticks) = (next()?, next()?);
    Some(steps)
}

/// Commands for every cycle, until told to end.
fn once_a_cycle<const N: usize>(domain: &Domain, file: &Path, write: fn(&Steps) -> [messages::Command; N]) {
    let steps_in = patiently(|| domain.input::<Steps>(&wires::STEPS));
    let commands = patiently(|| domain.output::<messages::Command>(&wires::COMMAND));
    steps_in.connect();
    commands.connect();
    let (mut sent, mut cycle) = (0u64, 0);
    while !told_to_end(file) {
        // Once a cycle, of the newest: more than the step generator can read would be lost, not refused.
        if let Some(steps) = steps_in.last().filter(|steps| steps.tick / 5 > cycle && steps.in_charge != 0) {
            cycle = steps.tick / 5;
            sent += write(&steps).iter().map(|command| u64::from(commands.send(command))).sum::<u64>();
        }
        std::thread::sleep(Duration::from_micros(500));
    }
    fs::write(file, sent.to_string()).expect("its count");
}

/// More commands a tick than a wire has room for, until told to end.
fn flood(domain: &Domain, file: &Path) {
    let commands = patiently(|| domain.output::<messages::Command>(&wires::COMMAND));
    commands.connect();
    let mut sent = 0u64;
    while !told_to_end(file) {
        let stranger = messages::Command { source: 99, seq: sent, ..messages::Command::ZERO };
        sent += (0..2 * wires::COMMAND.buffer).map(|_| u64::from(commands.send(&stranger))).sum::<u64>();
        std::thread::sleep(Duration::from_micros(300));
    }
    fs::write(file, sent.to_string()).expect("its count");
}

/// Far too fast, for the cycle to come.
fn wild(steps: &Steps) -> messages::Command {
    messages::Command {
        source: steps.in_charge,
        epoch: steps.epoch,
        seq: u64::MAX,
        pose_tick: steps.tick / 5 * 5,
        effective_tick: steps.tick / 5 * 5 + 5,
        vx_mps: -1e9,
        omega_radps: 1e9,
        ..messages::Command::ZERO
    }
}

fn lies(steps: &Steps) -> [messages::Command; 6] {
    use messages::Command;
    let wild = wild(steps);
    [
        Command { epoch: steps.epoch.wrapping_sub(1), ..wild },
        Command { source: steps.in_charge + 40, ..wild },
        Command { seq: 1, ..wild },
        Command { vx_mps: f64::NAN, ..wild },
        Command { omega_radps: f64::INFINITY, ..wild },
        Command { effective_tick: wild.effective_tick - 1, ..wild },
    ]
}

/// What the greedy one asks for, turn by turn, m/s and rad/s: more than the wheels can do together, and more
/// than anything can.
pub const GREED: [[f64; 2]; 2] = [[0.05, 1.5], [1e3, -1e3]];

/// For the cycle after the coming one, so that the controller's own command comes too late beside it.
fn greed(steps: &Steps) -> [messages::Command; 1] {
    let cycle = steps.tick / 5;
    let [vx_mps, omega_radps] = GREED[cycle as usize % GREED.len()];
    let (pose_tick, effective_tick) = (cycle * 5 + 5, cycle * 5 + 10);
    // Ahead of every number that a controller has come to.
    let seq = (1 << 40) + cycle;
    [messages::Command { seq, pose_tick, effective_tick, vx_mps, omega_radps, ..wild(steps) }]
}

/// A tick as the witness saw it.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// When it was read, ns on CLOCK_MONOTONIC.
    pub ns: u64,
    /// The state after it, as far as it is written down.
    pub steps: Steps,
}

/// A process beside a robot.
pub struct Beside {
    running: Running,
    file: PathBuf,
    role: Role,
}

impl Beside {
    /// Starts one beside a robot that is up or starting.
    pub fn start(lab: &Lab, robot: &str, role: Role) -> Self {
        Self::start_by(lab.command_of(std::env::current_exe().expect("this program")), lab, robot, role)
    }

    /// Starts one that sees the disks of another process.
    fn start_in_mounts_of(pid: i32, lab: &Lab, robot: &str, role: Role) -> Self {
        let mut command = lab.command_of("nsenter");
        command
            .args(["-t", &pid.to_string(), "-m", "--"])
            .arg(std::env::current_exe().expect("this program"));
        Self::start_by(command, lab, robot, role)
    }

    fn start_by(mut command: Command, lab: &Lab, robot: &str, role: Role) -> Self {
        let (_, name) = ROLES.iter().find(|(known, _)| *known == role).expect("a role");
        let file = lab.dir().join(format!("{robot}-{name}"));
        let _ = fs::remove_file(file.with_extension("end"));
        let _ = fs::remove_file(&file);
        command.args(["--exact", TEST, "--ignored", "--nocapture"]);
        command.env(ROLE, name).env(FILE, &file).env(ROBOT_DIR, lab.runtime_dir().join(robot));
        Self { running: Running::start(command), file, role }
    }

    /// Ends it in good order; what it has written.
    pub fn end(self) -> String {
        fs::write(self.file.with_extension("end"), "").expect("a word to end");
        let ended = self.running.wait(crate::support::PATIENCE);
        assert_eq!(ended.code, Some(0), "{:?}: {ended:#?}", self.role);
        fs::read_to_string(&self.file).expect("what it has written")
    }
}

/// A witness, and what it has seen so far.
pub struct Witness {
    beside: Beside,
    file: Option<File>,
    rest: String,
    seen: Vec<Seen>,
}

impl Witness {
    /// Beside a robot that is up or starting.
    pub fn start(lab: &Lab, robot: &str) -> Self {
        Self::of(Beside::start(lab, robot, Role::Witness))
    }

    /// Beside a robot whose launch, `pid`, has disks of its own.
    pub fn start_in_mounts_of(pid: i32, lab: &Lab, robot: &str) -> Self {
        Self::of(Beside::start_in_mounts_of(pid, lab, robot, Role::Witness))
    }

    fn of(beside: Beside) -> Self {
        Self { beside, file: None, rest: String::new(), seen: Vec::new() }
    }

    /// Every tick so far.
    pub fn seen(&mut self) -> &[Seen] {
        if self.file.is_none() {
            self.file = File::open(&self.beside.file).ok();
        }
        if let Some(file) = &mut self.file {
            let mut bytes = Vec::new();
            let _ = file.read_to_end(&mut bytes);
            self.rest.push_str(&String::from_utf8_lossy(&bytes));
        }
        let whole = self.rest.rfind('\n').map_or(0, |end| end + 1);
        self.seen.extend(self.rest[..whole].lines().filter_map(seen_of));
        self.rest.drain(..whole);
        &self.seen
    }

    /// The newest tick; all zero before the first.
    pub fn newest(&mut self) -> Steps {
        self.seen().last().map_or(Steps::ZERO, |seen| seen.steps)
    }

    /// Waits until a tick is over.
    #[track_caller]
    pub fn await_tick(&mut self, tick: u64) {
        wait_until(&format!("tick {tick}"), || self.newest().tick >= tick);
    }

    /// Ends it; every tick it has seen.
    pub fn end(mut self) -> Vec<Seen> {
        self.seen();
        let text = self.beside.end();
        text.lines().filter_map(seen_of).collect()
    }
}

fn seen_of(line: &str) -> Option<Seen> {
    let mut words = line.split(' ').map(|word| word.parse::<u64>());
    let ns = words.next()?.ok()?;
    Some(Seen { ns, steps: steps_of(words.map_while(Result::ok))? })
}
