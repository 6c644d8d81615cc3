//! Where each box stood when a recording was begun in mid-drive, as the file has it.

use crate::shell::standing::Stand;
use hilare_interfaces::state::STATE_WORDS;
use serde::{Deserialize, Serialize};

/// Of this layout.
const VERSION: u64 = 1;

/// What the boxes answered when they were asked.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Standings {
    version: u64,
    /// The hilare whose boxes they are: what the words of a state mean is known to it alone.
    hilare: String,
    /// Of each process that had begun.
    pub stands: Vec<Stand>,
    /// Places of processes whose beginning is in the recording.
    pub awaited: Vec<u64>,
}

impl Standings {
    /// Of this hilare.
    pub fn new(stands: Vec<Stand>, awaited: Vec<u64>) -> Self {
        Self { version: VERSION, hilare: env!("CARGO_PKG_VERSION").to_owned(), stands, awaited }
    }

    pub(super) fn to_text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// From the file; why not, if it is not of this hilare or nonsense.
    pub(super) fn of_text(text: &str) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Kind {
            version: u64,
            hilare: String,
        }
        let broken = |error: serde_json::Error| format!("is not what it should be: {error}");
        let kind: Kind = serde_json::from_str(text).map_err(broken)?;
        if kind.version != VERSION || kind.hilare != env!("CARGO_PKG_VERSION") {
            let hilare: String = kind.hilare.chars().take(20).collect();
            return Err(format!("is of hilare {hilare:?}, this is {}", env!("CARGO_PKG_VERSION")));
        }
        let standings: Self = serde_json::from_str(text).map_err(broken)?;
        let mut places: Vec<u64> = standings.stands.iter().map(|stand| stand.slot).collect();
        places.extend(&standings.awaited);
        places.sort_unstable();
        if places.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err("is not what it should be: a place stands there twice".to_owned());
        }
        if let Some(stand) = standings.stands.iter().find(|stand| stand.words.len() > STATE_WORDS) {
            return Err(format!(
                "is not what it should be: the {} of place {} has too many words",
                stand.role, stand.slot
            ));
        }
        Ok(standings)
    }
}
