//! Scenario files: a system, a path to follow, and what others measured on it.

use super::assign::apply;
use super::document::{Document, Entry, Value, entries};
use super::error::{ConfigError, quoted, read_text};
use super::{System, find_built_in, is_path, maps, suggest};
use crate::report::Band;
use hilare_interfaces::geometry::{WorldPoint, WorldPose};
use hilare_interfaces::messages::Waypoint;
use hilare_planner::{PathRefusal, check_path, waypoint_file};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use toml::Spanned;
use toml::de::DeValue;

/// Scenarios that can be named without a file.
const BUILT_IN: &[(&str, &str)] = &[
    ("rectangle", include_str!("../../scenarios/rectangle.toml")),
    ("rectangle-open", include_str!("../../scenarios/rectangle-open.toml")),
    ("trapezoid", include_str!("../../scenarios/trapezoid.toml")),
    ("so", include_str!("../../scenarios/so.toml")),
    ("platform", include_str!("../../scenarios/platform.toml")),
    ("line-21deg", include_str!("../../scenarios/line-21deg.toml")),
    ("arc-102cm", include_str!("../../scenarios/arc-102cm.toml")),
    ("agv-low", include_str!("../../scenarios/agv-low.toml")),
    ("agv-high", include_str!("../../scenarios/agv-high.toml")),
    ("agv-course", include_str!("../../scenarios/agv-course.toml")),
];

/// Waypoint files the built-in scenarios name.
const BUILT_IN_PATHS: &[(&str, &str)] = &[("so.csv", include_str!("../../scenarios/so.csv"))];

pub(super) const KEYS: &[&str] = &[
    "description",
    "system",
    "waypoints_m",
    "waypoints_file",
    "goal_m",
    "start",
    "correction",
    "published",
    "set",
];
/// A job: a robot and a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Built-in name, or the file's name without `.toml`.
    pub name: String,
    /// One line for people.
    pub description: String,
    /// The robot, the scenario's changes made.
    pub system: System,
    /// What to drive.
    pub task: Task,
    /// What counts as corrected, if the job is to correct a deviation at the start.
    pub correction: Option<Band>,
    /// What others measured or computed on this path.
    pub published: Vec<Published>,
    /// File and line of what is to be driven.
    place: String,
    /// What is to be said of the scenario's own figures.
    said: Vec<String>,
}

/// What a scenario asks the planner for.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// Follow these waypoints, at least two.
    Follow(Vec<Waypoint>),
    /// Find a way from the start to this point.
    Reach(WorldPoint),
}

impl Scenario {
    /// Names of the built-in scenarios.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// Reads a built-in scenario by name, or a file by a path that ends in `.toml`.
    pub fn load(name_or_path: &str) -> Result<Self, ConfigError> {
        if is_path(name_or_path) {
            let path = Path::new(name_or_path);
            return Self::parse(name_or_path, &read_text(path)?, path.parent().unwrap_or(Path::new("")));
        }
        let (name, text) = find_built_in("scenario", BUILT_IN, name_or_path).map_err(ConfigError::bare)?;
        parse(name, &format!("{name}.toml (built-in)"), text, Home::BuiltIn)
    }

    /// Reads the text of a scenario file; `origin` is its name in errors, `folder` where the files it names are.
    pub fn parse(origin: &str, text: &str, folder: &Path) -> Result<Self, ConfigError> {
        let name = Path::new(origin).file_stem().unwrap_or_default().to_string_lossy();
        parse(&name, origin, text, Home::Folder(folder))
    }

    /// The same robot on the path of a waypoint file (CSV, header `x,y`, metres). It starts on the first
    /// waypoint, heading 0; what was published of the scenario's own path goes.
    pub fn with_path(mut self, file: &Path) -> Result<Self, ConfigError> {
        let waypoints = read_waypoints(file)?;
        self.system.start = WorldPose::new(waypoints[0].x_m, waypoints[0].y_m, 0.0);
        self.task = Task::Follow(waypoints);
        self.description = format!("waypoints of {}", file.display());
        self.published.clear();
        self.correction = None;
        self.place = file.display().to_string();
        self.said.clear();
        Ok(self)
    }

    /// What is allowed and hardly meant, a line each, of the robot and of the job.
    pub fn warnings(&self) -> Vec<String> {
        unusual::warnings(self)
    }
}

/// Where the files that a scenario names are.
#[derive(Clone, Copy)]
enum Home<'a> {
    BuiltIn,
    Folder(&'a Path),
}

fn read_waypoints(path: &Path) -> Result<Vec<Waypoint>, ConfigError> {
    let place = path.display().to_string();
    let file =
        File::open(path).map_err(|error| ConfigError::new(&place, format!("cannot be read: {error}")))?;
    parse_waypoints(&place, file)
}

fn parse_waypoints(place: &str, text: impl Read) -> Result<Vec<Waypoint>, ConfigError> {
    waypoint_file::parse(text).map_err(|error| match error.line {
        0 => ConfigError::new(place, error.message),
        line => ConfigError::new(format!("{place}:{line}"), error.message),
    })
}

/// What has been read so far.
#[derive(Default)]
struct Parts<'t> {
    description: String,
    system: Option<System>,
    task: Option<Task>,
    correction: Option<Band>,
    published: Vec<Published>,
    changes: Vec<Entry<'t>>,
    place: String,
    figures: Vec<Figure>,
}

fn parse(name: &str, origin: &str, text: &str, home: Home<'_>) -> Result<Scenario, ConfigError> {
    let file = Document::parse(origin, text)?;
    let mut items: Vec<_> = file.root.iter().collect();
    items.sort_by_key(|(key, _)| key.span().start);
    let mut parts = Parts::default();
    for (key, value) in items {
        let offset = key.span().start;
        read_item(&file, home, key.get_ref(), offset, value, &mut parts)?;
    }
    let Parts { description, system, task, correction, published, changes, place, figures } = parts;
    let mut system = system.ok_or_else(|| {
        file.error_of_file(
            "no system; add system = \"epuck\" (built-in) or the path of a system file (.toml)",
        )
    })?;
    apply(&mut system, &file, changes)?;
    if let Home::Folder(folder) = home {
        system.map = maps::in_folder(&system.map, folder);
    }
    let task = task.ok_or_else(|| {
        let what =
            "no path; add waypoints_m = [[x, y], [x, y]], waypoints_file = \"FILE.csv\" or goal_m = [x, y]";
        file.error_of_file(what)
    })?;
    let said = unusual::of_figures(&system, &figures);
    Ok(Scenario { name: name.to_owned(), description, system, task, correction, published, place, said })
}

/// Reads one top-level key.
fn read_item<'t>(
    file: &Document<'_>,
    home: Home<'_>,
    key: &str,
    offset: usize,
    value: &'t Spanned<DeValue<'_>>,
    parts: &mut Parts<'t>,
) -> Result<(), ConfigError> {
    let wrong = |wanted: &str| {
        file.error(offset, format!("{key}: {} is not {wanted}", Value::new(value.get_ref()).describe()))
    };
    let text = || value.get_ref().as_str().ok_or_else(|| wrong("text; write it in quotes"));
    let table = || value.get_ref().as_table().ok_or_else(|| wrong(&format!("a section; write [{key}]")));
    if matches!(key, "waypoints_m" | "waypoints_file" | "goal_m") && parts.task.is_none() {
        parts.place = file.place(offset);
    }
    match key {
        "description" => parts.description = text()?.to_owned(),
        "system" => {
            let name = text()?;
            parts.system = Some(match home {
                Home::Folder(folder) if is_path(name) => System::load(&folder.join(name).to_string_lossy())?,
                _ => System::built_in(name).map_err(|what| file.error(offset, what))?,
            });
        }
        "waypoints_m" | "waypoints_file" | "goal_m" if parts.task.is_some() => {
            let what = "more than one of waypoints_m, waypoints_file and goal_m; keep one of them";
            return Err(file.error(offset, what));
        }
        "waypoints_m" => {
            let points = value.get_ref().as_array().ok_or_else(|| wrong("an array [[x, y], [x, y]]"))?;
            parts.task = Some(Task::Follow(inline_waypoints(file, offset, points)?));
        }
        "waypoints_file" => parts.task = Some(Task::Follow(waypoints_file(file, home, offset, text()?)?)),
        "goal_m" => {
            let goal = match numbers(value.get_ref()).as_deref() {
                Some(&[x_m, y_m]) if x_m.is_finite() && y_m.is_finite() => WorldPoint::new(x_m, y_m),
                _ => return Err(wrong("[x, y], two finite numbers in metres")),
            };
            parts.task = Some(Task::Reach(goal));
        }
        "start" => parts.changes.extend(entries(table()?, "", "start")),
        "set" => {
            let changes = table()?;
            if let Some((key, _)) = changes.get_key_value("start") {
                return Err(file.error(key.span().start, "set.start: write [start] in a scenario"));
            }
            parts.changes.extend(entries(changes, "set.", ""));
        }
        "correction" => parts.correction = Some(correction(file, offset, table()?, &mut parts.figures)?),
        "published" => {
            let wanted = "a list; write [[published]]";
            let list = value.get_ref().as_array().ok_or_else(|| wrong(wanted))?;
            for item in list.iter() {
                let table = item.get_ref().as_table().ok_or_else(|| wrong(wanted))?;
                parts.published.push(published(file, item.span().start, table, &mut parts.figures)?);
            }
        }
        _ => {
            let choices = suggest::choices(key, "known", KEYS);
            let hint = "keys of the system stand in [set.SECTION]";
            return Err(
                file.error(offset, format!("unknown key {} in a scenario{choices}; {hint}", quoted(key)))
            );
        }
    }
    Ok(())
}

/// The numbers of an array that has nothing else.
fn numbers(value: &DeValue<'_>) -> Option<Vec<f64>> {
    let number = |item: &Spanned<DeValue<'_>>| match Value::new(item.get_ref()) {
        Value::Number(number) => Some(number),
        _ => None,
    };
    value.as_array()?.iter().map(number).collect()
}

/// `[x, y]`, `[x, y, bulge]` or `[x, y, bulge, crab_rad]`.
fn waypoint(value: &DeValue<'_>) -> Option<Waypoint> {
    let numbers = numbers(value)?;
    let &[x_m, y_m, ref rest @ ..] = numbers.as_slice() else { return None };
    let straight = Waypoint::straight(x_m, y_m);
    match *rest {
        [] => Some(straight),
        [bulge] => Some(Waypoint { bulge, ..straight }),
        [bulge, crab_rad] => Some(Waypoint { bulge, crab_rad, ..straight }),
        _ => None,
    }
}

fn inline_waypoints(
    file: &Document<'_>,
    offset: usize,
    points: &[Spanned<DeValue<'_>>],
) -> Result<Vec<Waypoint>, ConfigError> {
    let mut waypoints = Vec::with_capacity(points.len());
    for (index, item) in points.iter().enumerate() {
        let what = || {
            let wanted = "[x, y] in metres, [x, y, bulge] for an arc or [x, y, bulge, crab_rad]";
            format!("waypoints_m: waypoint {} is not {wanted}", index + 1)
        };
        waypoints.push(waypoint(item.get_ref()).ok_or_else(|| file.error(item.span().start, what()))?);
    }
    check_path(&waypoints).map_err(|refusal: PathRefusal| match refusal.index() {
        Some(index) => {
            file.error(points[index].span().start, format!("waypoints_m: waypoint {}: {refusal}", index + 1))
        }
        None => file.error(offset, format!("waypoints_m: {refusal}")),
    })?;
    Ok(waypoints)
}

fn waypoints_file(
    file: &Document<'_>,
    home: Home<'_>,
    offset: usize,
    name: &str,
) -> Result<Vec<Waypoint>, ConfigError> {
    match home {
        Home::Folder(folder) => read_waypoints(&folder.join(name)),
        Home::BuiltIn => match BUILT_IN_PATHS.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => parse_waypoints(name, text.as_bytes()),
            None => Err(file.error(offset, format!("waypoints_file: {} is not built in", quoted(name)))),
        },
    }
}

mod expected;
#[cfg(test)]
mod tests;
mod unusual;

pub use expected::Published;
pub(super) use expected::{CORRECTION, published_specs};
use expected::{Figure, correction, published};
