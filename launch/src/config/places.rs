//! Where values were written, for what is said about them later.

use std::sync::Arc;

/// Key and place, the newest last. Two systems with the same values are the same, whoever wrote them.
#[derive(Clone, Debug, Default)]
pub(super) struct Places(Arc<Vec<(String, String)>>);

impl PartialEq for Places {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Places {
    /// A key was written.
    pub(super) fn note(&mut self, key: String, place: impl FnOnce() -> String) {
        let known = Arc::make_mut(&mut self.0);
        known.retain(|(other, _)| *other != key);
        known.push((key, place()));
    }

    /// Where a key was written last; `None` if it has its default.
    pub(super) fn of(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(other, _)| other == key).map(|(_, place)| place.as_str())
    }
}
