//! Where values were written, for what is said about them later.

use std::collections::BTreeMap;
use std::sync::Arc;

/// The place of each key. Two systems with the same values are the same, whoever wrote them.
#[derive(Clone, Debug, Default)]
pub(super) struct Places(Arc<BTreeMap<String, String>>);

impl PartialEq for Places {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Places {
    /// A key was written.
    pub(super) fn note(&mut self, key: String, place: impl FnOnce() -> String) {
        Arc::make_mut(&mut self.0).insert(key, place());
    }

    /// Where a key was written last; `None` if it has its default.
    pub(super) fn of(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }
}
