//! When a waypoint counts as reached.

/// The rule by which the waypoint selector goes on to the next waypoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acceptance {
    /// As soon as the robot is within the acceptance radius: `[MH18] (8)`.
    Rim,
    /// Within the radius where the next segment is as near as the current one, at the latest on leaving:
    /// for laws that choose where in the circle they turn.
    Bisector,
    /// As [`Self::Bisector`], and wherever the robot has passed the end of the segment: for laws that
    /// track lines and arcs and never turn back for a waypoint.
    Passed,
}

impl Acceptance {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Rim, Self::Bisector, Self::Passed];

    /// Name in system files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rim => "rim",
            Self::Bisector => "bisector",
            Self::Passed => "passed",
        }
    }

    /// The rule of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }
}
