//! Faults as data: what goes wrong, where, from when, for how long.
//!
//! ```text
//! let hiccup = Fault::Stop.on(Process::Active).lasting(40).and(Fault::Drop.on(Line::Authority).lasting(60));
//! let plan = hiccup.after(1200);      // both of them, 1200 ticks later
//! stop active @1200+40; drop authority @1200+60          how it prints, and what it is read from again
//! ```
//!
//! A plan knows nothing of who carries it out: the virtual rig does, and so do the tests with real
//! processes, each as far as it can.

use hilare_interfaces::block::Tick;
use std::fmt;
use std::str::FromStr;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// A process is gone at once, as by `kill -9` or a panic; what it has sent stays on the wires.
    Kill,
    /// The same in the middle of its next step: what it has done is sent or remembered, not both.
    KillAmid,
    /// A process stands still, as by SIGSTOP and SIGCONT; what is sent to it waits.
    Stop,
    /// Every process stands still: the host took its cores away.
    Pause,
    /// Messages come so many ticks later; later ones overtake them.
    Delay(u64),
    /// Messages are lost.
    Drop,
    /// Messages come twice, the second time so many ticks later.
    Duplicate(u64),
    /// So many bits of each message are flipped, anywhere.
    Corrupt(u64),
    /// A number of each message is no number, or infinite.
    Nan,
    /// The last message from before is repeated in place of each.
    Freeze,
    /// Beside each command comes one of somebody who may not command.
    Forge(Forgery),
    /// Commands ask for so many times as much.
    Overdo(u64),
    /// No room on the disk that the report goes to.
    FullDisk,
    /// Shared memory has room for so many MiB only.
    FullShm(u64),
    /// Nobody reads what is printed.
    ClosedStdout,
    /// The wall clock is put forward or back by so many hours.
    ClockStep(i64),
}

/// Who wrote a command that may not act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Forgery {
    /// A predecessor: the right source, an older epoch.
    OlderEpoch,
    /// A source nobody has put anywhere.
    WrongSource,
    /// The sequence number of the last command once more.
    RepeatedSeq,
    /// An older sequence number.
    OldSeq,
}

impl Forgery {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::OlderEpoch, Self::WrongSource, Self::RepeatedSeq, Self::OldSeq];
}

/// A process of the robot. The two controllers are named by what they are at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// The process manager.
    Launch,
    /// Goals into paths.
    Planner,
    /// Which waypoint.
    WaypointSelector,
    /// The controller that is in charge at first.
    Active,
    /// The controller beside it.
    Standby,
    /// The clock.
    StepGenerator,
    /// Where the robot thinks it is.
    PoseEstimator,
    /// The simulated robot.
    Plant,
    /// Reads along.
    Recorder,
}

/// A wire into one reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Launch to the step generator.
    Authority,
    /// The controller in charge at first to the step generator.
    CommandOfActive,
    /// The other one to the step generator.
    CommandOfStandby,
    /// Step generator to pose estimator.
    StepsToEstimator,
    /// Step generator to plant.
    StepsToPlant,
    /// Step generator to launch.
    StepsToLaunch,
    /// Plant to pose estimator, encoder counts.
    Wheels,
    /// Plant to pose estimator, camera.
    Fix,
    /// Pose estimator to waypoint selector.
    PoseToSelector,
    /// Pose estimator to the controller in charge at first.
    PoseToActive,
    /// Pose estimator to the other one.
    PoseToStandby,
    /// Waypoint selector to the controller in charge at first.
    ReferenceToActive,
    /// Waypoint selector to the other one.
    ReferenceToStandby,
}

/// Where a fault strikes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A process.
    Process(Process),
    /// A wire.
    Line(Line),
    /// Everything.
    Machine,
}

const PLACES: [(Place, &str); 23] = [
    (Place::Process(Process::Launch), "launch"),
    (Place::Process(Process::Planner), "planner"),
    (Place::Process(Process::WaypointSelector), "waypoint_selector"),
    (Place::Process(Process::Active), "active"),
    (Place::Process(Process::Standby), "standby"),
    (Place::Process(Process::StepGenerator), "step_generator"),
    (Place::Process(Process::PoseEstimator), "pose_estimator"),
    (Place::Process(Process::Plant), "plant"),
    (Place::Process(Process::Recorder), "recorder"),
    (Place::Line(Line::Authority), "authority"),
    (Place::Line(Line::CommandOfActive), "command<active"),
    (Place::Line(Line::CommandOfStandby), "command<standby"),
    (Place::Line(Line::StepsToEstimator), "steps>pose_estimator"),
    (Place::Line(Line::StepsToPlant), "steps>plant"),
    (Place::Line(Line::StepsToLaunch), "steps>launch"),
    (Place::Line(Line::Wheels), "wheels"),
    (Place::Line(Line::Fix), "fix"),
    (Place::Line(Line::PoseToSelector), "pose>waypoint_selector"),
    (Place::Line(Line::PoseToActive), "pose>active"),
    (Place::Line(Line::PoseToStandby), "pose>standby"),
    (Place::Line(Line::ReferenceToActive), "reference>active"),
    (Place::Line(Line::ReferenceToStandby), "reference>standby"),
    (Place::Machine, "machine"),
];

impl From<Process> for Place {
    fn from(process: Process) -> Self {
        Self::Process(process)
    }
}

impl From<Line> for Place {
    fn from(line: Line) -> Self {
        Self::Line(line)
    }
}

/// One fault at one place, in ticks of the machine since the robot was armed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// What.
    pub fault: Fault,
    /// Where.
    pub place: Place,
    /// From this tick on.
    pub from: Tick,
    /// For so many ticks; [`Tick::MAX`] for ever.
    pub ticks: Tick,
}

impl Event {
    /// True while it lasts.
    pub fn lasts_at(&self, tick: Tick) -> bool {
        tick.checked_sub(self.from).is_some_and(|since| since < self.ticks)
    }
}

/// Faults that go together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan(pub Vec<Event>);

impl Fault {
    /// This fault at a place, from the start, for ever.
    pub fn on(self, place: impl Into<Place>) -> Plan {
        Plan(vec![Event { fault: self, place: place.into(), from: 0, ticks: Tick::MAX }])
    }
}

impl Plan {
    /// Nothing goes wrong.
    pub const NONE: Self = Self(Vec::new());

    /// Everything so many ticks later.
    pub fn after(mut self, ticks: Tick) -> Self {
        self.0.iter_mut().for_each(|event| event.from += ticks);
        self
    }

    /// Everything for so many ticks.
    pub fn lasting(mut self, ticks: Tick) -> Self {
        self.0.iter_mut().for_each(|event| event.ticks = ticks);
        self
    }

    /// These and those.
    pub fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// What happens at a place.
    pub fn at(&self, place: impl Into<Place>) -> Vec<Event> {
        let place = place.into();
        self.0.iter().filter(|event| event.place == place).copied().collect()
    }

    /// The first tick at which anything goes wrong.
    pub fn begins(&self) -> Option<Tick> {
        self.0.iter().map(|event| event.from).min()
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kill => f.write_str("kill"),
            Self::KillAmid => f.write_str("kill-amid"),
            Self::Stop => f.write_str("stop"),
            Self::Pause => f.write_str("pause"),
            Self::Delay(ticks) => write!(f, "delay:{ticks}"),
            Self::Drop => f.write_str("drop"),
            Self::Duplicate(ticks) => write!(f, "duplicate:{ticks}"),
            Self::Corrupt(bits) => write!(f, "corrupt:{bits}"),
            Self::Nan => f.write_str("nan"),
            Self::Freeze => f.write_str("freeze"),
            Self::Forge(forgery) => {
                let number = Forgery::ALL.iter().position(|known| known == forgery).unwrap_or(0);
                write!(f, "forge:{number}")
            }
            Self::Overdo(times) => write!(f, "overdo:{times}"),
            Self::FullDisk => f.write_str("full-disk"),
            Self::FullShm(mib) => write!(f, "full-shm:{mib}"),
            Self::ClosedStdout => f.write_str("closed-stdout"),
            Self::ClockStep(hours) => write!(f, "clock-step:{hours}"),
        }
    }
}

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, argument) = text.split_once(':').unwrap_or((text, "0"));
        let signed: i64 = argument.parse().map_err(|_| format!("{text:?}: no number behind the colon"))?;
        let number = signed.unsigned_abs();
        Ok(match name {
            "kill" => Self::Kill,
            "kill-amid" => Self::KillAmid,
            "stop" => Self::Stop,
            "pause" => Self::Pause,
            "delay" => Self::Delay(number),
            "drop" => Self::Drop,
            "duplicate" => Self::Duplicate(number),
            "corrupt" => Self::Corrupt(number),
            "nan" => Self::Nan,
            "freeze" => Self::Freeze,
            "forge" => Self::Forge(Forgery::ALL[number as usize % Forgery::ALL.len()]),
            "overdo" => Self::Overdo(number),
            "full-disk" => Self::FullDisk,
            "full-shm" => Self::FullShm(number),
            "closed-stdout" => Self::ClosedStdout,
            "clock-step" => Self::ClockStep(signed),
            _ => return Err(format!("unknown fault {text:?}")),
        })
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("nothing");
        }
        for (n, event) in self.0.iter().enumerate() {
            let place = PLACES.iter().find(|(place, _)| *place == event.place).map_or("", |(_, name)| name);
            let separator = if n == 0 { "" } else { "; " };
            write!(f, "{separator}{} {place} @{}", event.fault, event.from)?;
            if event.ticks != Tick::MAX {
                write!(f, "+{}", event.ticks)?;
            }
        }
        Ok(())
    }
}

impl FromStr for Plan {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "nothing" {
            return Ok(Self::NONE);
        }
        text.split(';').map(|event| event.trim().parse()).collect::<Result<_, _>>().map(Self)
    }
}

impl FromStr for Event {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is not FAULT PLACE @TICK or FAULT PLACE @TICK+TICKS");
        let [fault, place, time] = text.split_whitespace().collect::<Vec<_>>()[..] else {
            return Err(wrong());
        };
        let (place, _) = PLACES.iter().find(|(_, name)| *name == place).ok_or_else(wrong)?;
        let time = time.strip_prefix('@').ok_or_else(wrong)?;
        let (from, ticks) = time.split_once('+').unwrap_or((time, ""));
        Ok(Self {
            fault: fault.parse()?,
            place: *place,
            from: from.parse().map_err(|_| wrong())?,
            ticks: if ticks.is_empty() { Tick::MAX } else { ticks.parse().map_err(|_| wrong())? },
        })
    }
}
