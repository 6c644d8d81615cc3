//! Codes in messages: integers on the wire, enums inside, checked where they are decoded.

/// One code of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code {
    /// Name of the enum's variant.
    pub ident: &'static str,
    /// The code on the wire.
    pub code: u64,
    /// What it means: its documentation, a line of it a line.
    pub doc: &'static str,
}

/// The codes of one enum as data, for programs in other languages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodeTable {
    /// Name of the enum.
    pub ident: &'static str,
    /// Its codes.
    pub codes: &'static [Code],
    /// What it says: its documentation, a line of it a line.
    pub doc: &'static str,
}

/// Every enum whose codes stand in a message.
pub const CODES: &[CodeTable] = &[
    GoalKind::TABLE,
    ReferenceState::TABLE,
    Mode::TABLE,
    Fallback::TABLE,
    Refusal::TABLE,
    Drive::TABLE,
    HealthState::TABLE,
    JournalKind::TABLE,
];

/// Declares an enum with its wire code and a checked decode.
macro_rules! code_enum {
    ($(#[doc = $doc:literal])* $name:ident {
        $($(#[doc = $vdoc:literal])* $variant:ident = $code:literal, $label:literal;)*
    }) => {
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[doc = $vdoc])* $variant = $code,)* }

        impl $name {
            /// Its codes as data.
            pub const TABLE: CodeTable = CodeTable {
                ident: stringify!($name),
                codes: &[$(Code {
                    ident: stringify!($variant),
                    code: $code,
                    doc: concat!($($vdoc, "\n"),*),
                },)*],
                doc: concat!($($doc, "\n"),*),
            };

            /// The code on the wire.
            pub const fn code(self) -> u64 { self as u64 }

            /// The meaning of a code, `None` if it has none.
            pub const fn from_code(code: u64) -> Option<Self> {
                match code { $($code => Some(Self::$variant),)* _ => None }
            }

            /// One word for people.
            pub const fn label(self) -> &'static str {
                match self { $(Self::$variant => $label,)* }
            }
        }
    };
}

code_enum! {
    /// What a goal asks for.
    GoalKind {
        /// Go to the one point of the payload.
        Point = 1, "point";
        /// Follow the payload's waypoints.
        Follow = 2, "follow";
    }
}

code_enum! {
    /// What a reference says.
    ReferenceState {
        /// No path yet.
        Idle = 0, "idle";
        /// Under way to waypoint k.
        Tracking = 1, "tracking";
        /// The last waypoint was accepted.
        Arrived = 2, "arrived";
    }
}

code_enum! {
    /// What the operator (through launch) wants the step generator to do.
    Mode {
        /// Outputs stay still until armed.
        Disarmed = 0, "disarmed";
        /// Commands of the source in authority act.
        Armed = 1, "armed";
        /// Ramp to a stop within the acceleration limit and stay.
        Stop = 2, "stop";
        /// Stop at once; latched until reset.
        EStop = 3, "e-stop";
    }
}

code_enum! {
    /// What a law had to do without when it computed a command.
    Fallback {
        /// Nothing: the command is what the law is there for.
        None = 0, "";
        /// The solver stopped at its iteration cap; the best feasible plan at hand is used.
        IterationCap = 1, "solver at its iteration cap: best feasible plan used";
        /// The solver found no solution; the plan of the period before, inside the limits, is used.
        Unsolved = 2, "problem not solved: plan of the period before used";
        /// The robot is told to stand, or cannot drive or turn at all.
        NoMotion = 3, "no speed or no yaw rate allowed: nothing to plan";
        /// The law's own plan is not within the limits; the best plan that is drives instead.
        Infeasible = 4, "no plan of its own within the limits: best bounded plan used";
        /// The deviation is outside what the law's own plan is valid for; the best bounded plan drives.
        OutsideValidity = 5, "deviation outside the law's validity: best bounded plan used";
        /// Reference or pose make no sense, or no law can make anything of them: the command is none.
        NoSense = 6, "reference or pose make no sense: no command";
    }
}

code_enum! {
    /// Why the step generator refused a command.
    Refusal {
        /// None has been refused.
        None = 0, "none was refused";
        /// Its source and epoch are those of no controller in charge, standing by or on trial.
        Stranger = 1, "source and epoch are of no controller that is wanted";
        /// A speed or the yaw rate is not finite.
        NotFinite = 2, "a speed or the yaw rate is not a finite number";
        /// `effective_tick` is not a multiple of the control period.
        OffGrid = 3, "effective_tick is not a multiple of the control period";
        /// `effective_tick` is not one control period after `pose_tick`.
        NotOnePeriod = 4, "effective_tick is not pose_tick plus the control period";
        /// `effective_tick` is more than two control periods ahead.
        TooFarAhead = 5, "effective_tick is more than two control periods ahead";
        /// `seq` is not above that of the command before.
        OldSeq = 6, "seq is not above that of the command before";
        /// `effective_tick` is not after that of the command before.
        OldTick = 7, "effective_tick is not after that of the command before";
    }
}

code_enum! {
    /// Why the wheels turn as they do.
    Drive {
        /// Not armed.
        Disarmed = 0, "disarmed";
        /// A command of its own cycle acts.
        Command = 1, "driving";
        /// Nothing new: the last command is held.
        Hold = 2, "holding the last command";
        /// Nothing for too long: ramping to zero, then still.
        Ramp = 3, "stopping for want of commands";
        /// Stop was asked for.
        Stop = 4, "stopped";
        /// Emergency stop.
        EStop = 5, "e-stop";
        /// Launch's lease ran out.
        LeaseLost = 6, "stopped: launch is gone";
        /// A single pause was longer than the policy allows.
        PauseStop = 7, "stopped: paused for too long";
    }
}

code_enum! {
    /// State of a process.
    HealthState {
        /// Opening its ports.
        Starting = 0, "starting";
        /// Connected, waiting.
        Ready = 1, "ready";
        /// At work.
        Running = 2, "running";
        /// At work with less than it should have; the text says what.
        Degraded = 3, "degraded";
        /// Ended itself; the text says why.
        Fault = 4, "fault";
    }
}

code_enum! {
    /// What a box noted in its journal, and what the words of the entry are.
    JournalKind {
        /// The process is at work, from this tick on: incarnation; epoch; number of its system file; law of a controller, by its
        /// place in the list of laws plus 1 (0 none); ticks plus 1 of the state it went on from (0 none); place
        /// plus 1 of whose state that was.
        Began = 1, "began";
        /// Authority was taken in: its seq; hash of the message.
        Authority = 2, "authority";
        /// A command was taken in: source; epoch; seq; hash of the message.
        Command = 3, "command";
        /// A pause before the tick: whole ticks lost.
        Pause = 4, "pause";
        /// A path acts from the pose of this tick on: path id; goal id; number of waypoints.
        Path = 5, "path";
        /// A goal was answered, the robot being where the pose of this tick says: goal id; 1 accepted, 0 refused;
        /// path id; 1 if the clock or a newer goal cut the search short.
        Goal = 6, "goal";
        /// Parameters were changed; from this tick on what the box does it does with the new ones: number of the
        /// change; number of its system file; the tick it was meant for.
        Param = 7, "param";
    }
}
