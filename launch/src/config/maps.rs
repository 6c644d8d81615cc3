//! Maps a system or scenario names.

use super::error::{ConfigError, quoted};
use super::suggest;
use hilare_planner::{LoadOptions, Map};
use std::path::Path;

/// Maps that can be named without a file.
const BUILT_IN: &[(&str, &str)] = &[("platform", include_str!("../../scenarios/platform.json"))];

/// True if the text names a file.
fn is_file(map: &str) -> bool {
    Path::new(map).extension().is_some() || map.contains('/')
}

/// A file named relative to `folder` as a path that does not depend on where it is read from.
pub(super) fn in_folder(file: &str, folder: &Path) -> String {
    if !is_file(file) || Path::new(file).is_absolute() {
        return file.to_owned();
    }
    let joined = folder.join(file);
    std::path::absolute(&joined).unwrap_or(joined).to_string_lossy().into_owned()
}

/// Loads a built-in map or a file; `None` for the empty name.
pub(super) fn load(map: &str, options: &LoadOptions) -> Result<Option<Map>, ConfigError> {
    if map.is_empty() {
        return Ok(None);
    }
    let loaded = if is_file(map) {
        Map::load(map, options)
    } else if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == map) {
        Map::from_bytes(&format!("{name}.json"), text.as_bytes(), options)
    } else {
        let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
        let choices = suggest::choices(map, "built-in", &names);
        return Err(ConfigError::bare(format!(
            "planner.map: unknown map {}{choices}; or a file",
            quoted(map)
        )));
    };
    loaded.map(Some).map_err(ConfigError::bare)
}
