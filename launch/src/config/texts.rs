//! Keys whose value is text.

use hilare_controller::LAWS;
use hilare_interfaces::acceptance::Acceptance;
use hilare_pose_estimator::EstimatorKind;

/// A key whose value is text.
#[derive(Clone, Copy, Debug)]
pub struct TextSpec {
    /// Key.
    pub name: &'static str,
    /// Value when the key is absent.
    pub default: &'static str,
    /// Allowed values; empty if free.
    pub choices: fn() -> Vec<&'static str>,
    /// Regular expression that free text matches (of ECMA 262, for editors); `None` for any.
    pub pattern: fn() -> Option<String>,
    /// What it is.
    pub doc: &'static str,
}

/// Name of the robot.
pub(super) static ROBOT: TextSpec = TextSpec {
    name: "robot",
    default: "epuck",
    choices: Vec::new,
    pattern: || Some("^[a-z0-9][a-z0-9_-]{0,31}$".to_owned()),
    doc: "Name of the robot: 1 to 32 of a-z, 0-9, - and _.",
};

/// Kind of the chassis.
pub(super) static CHASSIS: TextSpec = TextSpec {
    name: "kind",
    default: "differential",
    choices: || vec!["differential", "mecanum"],
    pattern: || None,
    doc: "What kind of chassis it is.",
};

/// Kind of the motors.
pub(super) static MOTORS: TextSpec = TextSpec {
    name: "kind",
    default: "stepper",
    choices: || vec!["stepper", "servo"],
    pattern: || None,
    doc: "What turns the wheels.",
};

/// When a waypoint is accepted.
pub(super) static ACCEPTANCE: TextSpec = TextSpec {
    name: "acceptance",
    default: AS_THE_LAW_ASKS,
    choices: || core::iter::once(AS_THE_LAW_ASKS).chain(Acceptance::ALL.map(Acceptance::name)).collect(),
    pattern: || None,
    doc: "Where a waypoint is accepted: on the rim of its circle, at the bisector of the corner, also when passed, or as the law asks.",
};

/// The acceptance rule is the law's own.
pub(super) const AS_THE_LAW_ASKS: &str = "law";

/// Pose estimator.
pub(super) static ESTIMATOR: TextSpec = TextSpec {
    name: "kind",
    default: EstimatorKind::ALL[0].name(),
    choices: || EstimatorKind::ALL.map(EstimatorKind::name).to_vec(),
    pattern: || None,
    doc: "Where the pose comes from.",
};

/// Control law.
pub(super) static LAW: TextSpec = TextSpec {
    name: "law",
    default: LAWS[0].name,
    choices: || LAWS.iter().map(|law| law.name).collect(),
    pattern: || None,
    doc: "The control law that drives.",
};

/// An executable that drives instead of the law.
pub(super) static EXEC: TextSpec = TextSpec {
    name: "exec",
    default: "",
    choices: Vec::new,
    pattern: || None,
    doc: "An executable that drives instead of the law, relative to this file; empty for none. The law still says where waypoints are accepted.",
};

/// What runs beside the controller in charge, ready to take over.
pub(super) static STANDBY: TextSpec = TextSpec {
    name: "standby",
    default: "",
    choices: Vec::new,
    pattern: || Some(law_or_program(&(LAW.choices)())),
    doc: "Law (or executable: a name with a /) of a second controller that takes over within the tick; empty for none.",
};

/// Where the operator's page listens.
pub(super) static LISTEN: TextSpec = TextSpec {
    name: "listen",
    default: "",
    choices: Vec::new,
    // Whether it is an address is seen where it is read.
    pattern: || {
        Some(r"^(|(localhost|[0-9]{1,3}(\.[0-9]{1,3}){3}|\[[0-9A-Fa-f:.]+\]):[0-9]{1,5})$".to_owned())
    },
    doc: "Address and port of the operator's page and its metrics (127.0.0.1:7070); other machines reach it only at an address of theirs, and with a token; empty for none.",
};

/// Where the live view listens.
pub(super) static FOXGLOVE: TextSpec = TextSpec {
    name: "foxglove",
    default: "",
    choices: Vec::new,
    pattern: || Some(r"^(|(localhost|127(\.[0-9]{1,3}){3}|\[::1\]):[0-9]{1,5})$".to_owned()),
    doc: "Address and port of a live view for Foxglove and Lichtblick (127.0.0.1:8765), to look only; on this machine alone, as its protocol knows no password; empty for none.",
};

/// Web pages that may look at it.
pub(super) static FOXGLOVE_ORIGINS: TextSpec = TextSpec {
    name: "foxglove_origins",
    default: "https://app.foxglove.dev file://",
    choices: Vec::new,
    pattern: || Some(r"^ *((null|file://|[a-z][a-z0-9+.-]*://[A-Za-z0-9._\[\]:-]+)( +|$))*$".to_owned()),
    doc: "Origins of the web pages that may look at the live view, apart by spaces (file:// is what desktop apps are); programs that are no browser need none.",
};

/// What happens when the operator's page is lost.
pub(super) static ON_LOST: TextSpec = TextSpec {
    name: "on_lost",
    default: GO_ON,
    choices: || vec![GO_ON, STOP],
    pattern: || None,
    doc: "What an armed robot does when the last page that gave orders is gone for 2 s.",
};

/// The robot goes on.
pub(super) const GO_ON: &str = "go_on";
/// The robot stops.
pub(super) const STOP: &str = "stop";

/// Map to plan on.
pub(super) static MAP: TextSpec = TextSpec {
    name: "map",
    default: "",
    choices: Vec::new,
    pattern: || None,
    doc: "Map to plan on: a file (.yaml, .map, .json, .toml, .csv), relative to this one, or built in (platform); empty for none.",
};

/// The expression for one of `laws`, a program (a name with a `/`), or nothing.
pub(super) fn law_or_program(laws: &[&str]) -> String {
    format!("^({}|.*/.*|)$", laws.join("|"))
}
