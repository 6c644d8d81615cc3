//! What a recording is of.

use super::RecordingError;
use super::wires::RECORDED;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What was recorded; the metadata record `hilare` of every part. What is not known is empty.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunInfo {
    /// Version of the hilare that wrote it.
    pub version: String,
    /// Common to all parts of a recording, and to no other.
    pub recording: String,
    /// Place among the parts, from 0.
    pub part: u64,
    /// Name of the robot.
    pub robot: String,
    /// Name of the scenario.
    pub scenario: String,
    /// `real`, `lockstep` or `in-process`.
    pub clock: String,
    /// Control law, or the program in its place.
    pub controller: String,
    /// Seed of what is random in the simulated robot.
    pub seed: String,
    /// Control period, ticks.
    pub period_ticks: u64,
}

impl RunInfo {
    /// As the metadata record has it.
    pub(super) fn to_metadata(&self) -> BTreeMap<String, String> {
        let pairs = [
            ("version", self.version.clone()),
            ("recording", self.recording.clone()),
            ("part", self.part.to_string()),
            ("robot", self.robot.clone()),
            ("scenario", self.scenario.clone()),
            ("clock", self.clock.clone()),
            ("controller", self.controller.clone()),
            ("seed", self.seed.clone()),
            ("period_ticks", self.period_ticks.to_string()),
            // Of the whole table: two builds with the same value read each other's recordings.
            ("layout", layout()),
        ];
        pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// Back from it; what it does not say is empty.
    pub(super) fn from_metadata(metadata: &BTreeMap<String, String>) -> Self {
        let text = |key: &str| metadata.get(key).cloned().unwrap_or_default();
        let number = |key: &str| text(key).parse().unwrap_or(0);
        Self {
            version: text("version"),
            recording: text("recording"),
            part: number("part"),
            robot: text("robot"),
            scenario: text("scenario"),
            clock: text("clock"),
            controller: text("controller"),
            seed: text("seed"),
            period_ticks: number("period_ticks"),
        }
    }
}

/// Layout of all recorded wires together.
fn layout() -> String {
    format!(
        "{:016x}",
        RECORDED.iter().fold(0_u64, |all, recorded| all.rotate_left(5) ^ recorded.wire.layout_hash)
    )
}

/// File of a part: `run.mcap`, then `run-0001.mcap`, …
pub fn part_file(first: &Path, part: u64) -> PathBuf {
    if part == 0 {
        return first.to_owned();
    }
    let stem = first.file_stem().unwrap_or_default().to_string_lossy();
    first.with_file_name(format!("{stem}-{part:04}.mcap"))
}

/// The file of the first part and the place of the one that is named.
pub fn first_of(file: &Path) -> (PathBuf, u64) {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let numbered = stem.rsplit_once('-').filter(|(_, digits)| digits.len() >= 4);
    match numbered.and_then(|(stem, digits)| Some((stem, digits.parse::<u64>().ok()?))) {
        Some((stem, part)) if part > 0 => (file.with_file_name(format!("{stem}.mcap")), part),
        _ => (file.to_owned(), 0),
    }
}

/// Every file there is that could be a part of the recording that begins with `first`, in order.
pub fn parts_there(first: &Path) -> Vec<(u64, PathBuf)> {
    let folder = first.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut parts: Vec<_> = files
        .filter_map(|file| {
            let path = first.with_file_name(file.file_name());
            let (its_first, part) = first_of(&path);
            (its_first == first && path.extension().is_some_and(|extension| extension == "mcap"))
                .then_some((part, path))
        })
        .collect();
    parts.sort();
    parts
}

/// Takes away what an earlier run has recorded in the same place.
pub fn remove_parts(first: &Path) -> Result<(), RecordingError> {
    for (_, file) in parts_there(first) {
        std::fs::remove_file(&file).map_err(|error| RecordingError::new(&file, error))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_numbered_and_found() {
        let first = Path::new("/runs/a-7/run.mcap");
        assert_eq!(part_file(first, 0), first);
        assert_eq!(part_file(first, 12), Path::new("/runs/a-7/run-0012.mcap"));
        assert_eq!(first_of(&part_file(first, 12)), (first.to_owned(), 12));
        assert_eq!(first_of(Path::new("my-2024.mcap")).0, Path::new("my.mcap"));
        assert_eq!(first_of(first), (first.to_owned(), 0));
        let dir = tempfile::tempdir().unwrap();
        let first = dir.path().join("run.mcap");
        for name in ["run-0002.mcap", "run.mcap", "run-0001.mcap", "run-0001.csv", "other.mcap", "run-x.mcap"]
        {
            std::fs::write(dir.path().join(name), "").unwrap();
        }
        let numbers: Vec<_> = parts_there(&first).iter().map(|(part, _)| *part).collect();
        assert_eq!(numbers, [0, 1, 2]);
        remove_parts(&first).unwrap();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
    }

    #[test]
    fn metadata_holds_it_all() {
        let info =
            RunInfo { version: "1".into(), part: 3, seed: "7".into(), period_ticks: 5, ..RunInfo::default() };
        assert_eq!(RunInfo::from_metadata(&info.to_metadata()), info);
    }
}
