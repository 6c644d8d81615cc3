//! Files in a recording, beside its messages.

use super::STANDINGS_ATTACHMENT;
use super::damage::attachment;
use super::standings::Standings;
use crate::shell::worker::system_number;
use std::collections::BTreeMap;

/// Files in a recording.
#[derive(Clone, Debug, Default)]
pub struct Inside {
    /// Numbered system files its processes have read.
    pub systems: BTreeMap<u64, String>,
    /// Where each box stood when it was begun; or why that cannot be used.
    pub standings: Option<Result<Standings, String>>,
}

impl Inside {
    /// Keeps what an attachment has.
    pub(super) fn keep(&mut self, data: &[u8]) {
        match attachment(data) {
            Some((name, text)) if name == STANDINGS_ATTACHMENT => {
                self.standings = Some(Standings::of_text(&text));
            }
            Some((name, text)) => self.systems.extend(system_number(&name).map(|number| (number, text))),
            // Its lengths or its checksum are wrong, its name may be right.
            None if has(data, STANDINGS_ATTACHMENT) => self.standings = Some(Err("is damaged".to_owned())),
            None => {}
        }
    }
}

fn has(data: &[u8], text: &str) -> bool {
    data.windows(text.len()).any(|part| part == text.as_bytes())
}
