//! Where each box stands, written down when launch asks for it: what a recording begun in mid-drive starts from.
//!
//! ```text
//!   launch: ask ──▶ a number in the page goes up, every box is rung
//!   each box, between two of its messages ──▶ its place in the page: that number, what it has answered last,
//!                                             how many entries its journal has, all it remembers
//! ```
//!
//! A box writes it down itself, in its own loop, so nothing can come between: the entries of its journal from that
//! number on are exactly those that are not in the state, and its next message is the first the state leads to. (The
//! checkpoint of [`super::checkpoint`] cannot serve for this: it has no such number, and of the step generator only
//! what a successor takes on, which stands still.) It costs a loop one load as long as nobody asks.

use super::checkpoint::StateRoom;
use super::page::SharedPage;
use super::worker::Worker;
use hilare_controller::LAWS;
use hilare_interfaces::block::Tick;
use hilare_interfaces::state::STATE_WORDS;
use hilare_interfaces::wires::Role;
use serde::{Deserialize, Serialize};

/// Words of a process before those of its box.
const HEAD: usize = 8;

/// What a box says of itself when it is asked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stands {
    /// The tick it has answered last.
    pub done: Option<Tick>,
    /// Number of the last message it has counted (controllers: command; planner: path).
    pub number: u64,
    /// Words of its state; 0 if it has none, or none that fits.
    pub words: usize,
}

/// Where a process stood.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stand {
    /// Its place.
    pub slot: u64,
    /// Its box.
    pub role: String,
    /// 1 for the first process of its place.
    pub incarnation: u64,
    /// Authority epoch (controllers).
    pub epoch: u64,
    /// Number of the system file that is in force in it.
    pub system: u64,
    /// Control law (controllers).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Entries of its place's journal until then.
    pub journal: u64,
    /// The tick it had answered last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub done: Option<Tick>,
    /// Number of the last message it had counted.
    pub number: u64,
    /// What its box remembered.
    #[serde(with = "hex")]
    pub words: Vec<u64>,
}

/// Words as text, to the last bit.
mod hex {
    use serde::de::{Deserializer, Error};
    use serde::{Deserialize, Serializer};

    pub fn serialize<S: Serializer>(words: &[u64], to: S) -> Result<S::Ok, S::Error> {
        let text: Vec<String> = words.iter().map(|word| format!("{word:x}")).collect();
        to.serialize_str(&text.join(" "))
    }

    pub fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<Vec<u64>, D::Error> {
        let text = String::deserialize(from)?;
        let words = text.split_ascii_whitespace().take(super::STATE_WORDS + 1);
        words.map(|word| u64::from_str_radix(word, 16)).collect::<Result<_, _>>().map_err(D::Error::custom)
    }
}

impl Worker {
    /// Writes down where the box stands, if launch has asked since the last time.
    #[inline]
    pub fn stand(&mut self, of: impl FnOnce(&mut [u64]) -> Option<Stands>) {
        let asked = self.page.standings_asked();
        if asked != self.stood {
            self.write_down(asked, of);
        }
    }

    #[cold]
    fn write_down(&mut self, asked: u64, of: impl FnOnce(&mut [u64]) -> Option<Stands>) {
        self.stood = asked;
        let slot = self.assignment.slot;
        let journal = self.page.journal(slot).written();
        let told = &self.assignment;
        let law = told.law.as_deref().and_then(|name| LAWS.iter().position(|law| law.name == name));
        let mut head = [told.incarnation, told.epoch, self.in_force, 0, journal, 0, 0, 0];
        head[3] = law.map_or(0, |place| place as u64 + 1);
        let room = self.room();
        // Without an answer it has not begun, and is no box yet: its entry in the journal is still to come.
        let stands = of(&mut room[HEAD..]);
        if let Some(stands) = stands {
            head[5] = stands.done.map_or(0, |tick| tick.saturating_add(1));
            (head[6], head[7]) = (stands.number, 1);
        }
        room[..HEAD].copy_from_slice(&head);
        let used = HEAD + stands.map_or(0, |stands| stands.words);
        self.store_standing(asked, used);
    }
}

/// What a place has written down in answer to a question or a later one: nothing yet; `Some(None)` if its process
/// has not begun.
pub fn read(page: &SharedPage, slot: usize, role: Role, asked: u64) -> Option<Option<Stand>> {
    let mut room = StateRoom::default();
    // Asked again meanwhile, a box has answered the later question only.
    let mut questions = (asked.max(1)..=page.standings_asked()).rev().take(4);
    let len = questions.find_map(|asked| page.standing(slot).load(asked, |_| true, &mut room))?.1;
    let (head, words) = room.first(len).split_first_chunk::<HEAD>()?;
    let [incarnation, epoch, system, law, journal, done, number, begun] = *head;
    if begun == 0 {
        return Some(None);
    }
    let law = law.checked_sub(1).and_then(|place| LAWS.get(usize::try_from(place).ok()?));
    Some(Some(Stand {
        slot: slot as u64,
        role: role.name().to_owned(),
        incarnation,
        epoch,
        system,
        law: law.map(|law| law.name.to_owned()),
        journal,
        done: done.checked_sub(1),
        number,
        words: words.to_vec(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_as_text_and_what_is_none_is_refused() {
        let stand = Stand {
            slot: 3,
            role: "controller".to_owned(),
            incarnation: 1,
            epoch: 7,
            system: 2,
            law: Some("qp".to_owned()),
            journal: 12,
            done: Some(1000),
            number: 201,
            words: vec![0, 1, u64::MAX, (-0.0_f64).to_bits(), f64::NAN.to_bits()],
        };
        let text = serde_json::to_string(&stand).expect("JSON");
        assert!(text.contains("0 1 ffffffffffffffff 8000000000000000 7ff8000000000000"), "{text}");
        assert_eq!(serde_json::from_str::<Stand>(&text).expect("JSON"), stand);
        for (was, is) in [("ffff ", "fffff "), ("0 1 ", "0 x "), ("\"slot\"", "\"slit\"")] {
            assert!(serde_json::from_str::<Stand>(&text.replacen(was, is, 1)).is_err(), "{is}");
        }
    }
}
