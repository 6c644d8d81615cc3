//! What the relay repeats, for people: `hilare topic`.
//!
//! A message is taken as it is, bytes and layout; what it says is read from the layout ([`fields`]), so a new wire
//! or a new field is shown without a line here.

pub mod fields;
pub mod rates;

use crate::shell::transport::{Domain, Input, SliceInput, TransportError};
use hilare_interfaces::layout::{Layout, WireMessage};
use hilare_interfaces::messages as m;
use hilare_interfaces::wires::{WIRES, Wire, watch};
use std::fmt;

/// A message as it was on its wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// What the bytes are.
    pub layout: &'static Layout,
    /// The message, or the header of what follows.
    pub bytes: Vec<u8>,
    /// What follows a header, one after the other.
    pub elements: Option<(&'static Layout, Vec<u8>)>,
}

impl Message {
    /// The tick it speaks of, if it carries one.
    pub fn tick(&self) -> Option<u64> {
        let field = self.layout.fields.iter().find(|field| ["tick", "pose_tick"].contains(&field.name))?;
        let bytes = self.bytes.get(field.offset..field.offset + 8)?;
        Some(u64::from_ne_bytes(bytes.try_into().ok()?))
    }
}

/// The reading end of any wire.
pub trait Source {
    /// The oldest message not yet read.
    fn next(&self) -> Option<Message>;
}

struct Plain<T: WireMessage + fmt::Debug>(Input<T>);

impl<T: WireMessage + fmt::Debug> Source for Plain<T> {
    fn next(&self) -> Option<Message> {
        let message = self.0.next()?;
        Some(Message { layout: &T::LAYOUT, bytes: message.as_bytes().to_vec(), elements: None })
    }
}

struct Sliced<H: WireMessage + fmt::Debug>(SliceInput<H, m::Waypoint>);

impl<H: WireMessage + fmt::Debug> Source for Sliced<H> {
    fn next(&self) -> Option<Message> {
        self.0.next(|header, waypoints| Message {
            layout: &H::LAYOUT,
            bytes: header.as_bytes().to_vec(),
            elements: Some((
                &m::Waypoint::LAYOUT,
                waypoints.iter().flat_map(|waypoint| waypoint.as_bytes().to_vec()).collect(),
            )),
        })
    }
}

/// Opens the reading end of a wire.
type Open = fn(&Domain) -> Result<Box<dyn Source>, TransportError>;

fn plain<T: WireMessage + fmt::Debug>(
    domain: &Domain,
    wire: &Wire,
) -> Result<Box<dyn Source>, TransportError> {
    Ok(Box::new(Plain::<T>(domain.input(wire)?)))
}

const SOURCES: [(&Wire, Open); 13] = [
    (&watch::GOAL, |domain| Ok(Box::new(Sliced::<m::GoalHeader>(domain.slice_input(&watch::GOAL)?)))),
    (&watch::ANSWER, |domain| plain::<m::Answer>(domain, &watch::ANSWER)),
    (&watch::PATH, |domain| Ok(Box::new(Sliced::<m::PathHeader>(domain.slice_input(&watch::PATH)?)))),
    (&watch::REFERENCE, |domain| plain::<m::Reference>(domain, &watch::REFERENCE)),
    (&watch::COMMAND, |domain| plain::<m::Command>(domain, &watch::COMMAND)),
    (&watch::AUTHORITY, |domain| plain::<m::Authority>(domain, &watch::AUTHORITY)),
    (&watch::STEPS, |domain| plain::<m::Steps>(domain, &watch::STEPS)),
    (&watch::WHEELS, |domain| plain::<m::Wheels>(domain, &watch::WHEELS)),
    (&watch::FIX, |domain| plain::<m::PoseFix>(domain, &watch::FIX)),
    (&watch::POSE, |domain| plain::<m::Pose>(domain, &watch::POSE)),
    (&watch::TRUTH, |domain| plain::<m::Truth>(domain, &watch::TRUTH)),
    (&watch::HEALTH, |domain| plain::<m::Health>(domain, &watch::HEALTH)),
    (&watch::JOURNAL, |domain| plain::<m::Journal>(domain, &watch::JOURNAL)),
];

/// A wire one can look at.
#[derive(Clone, Copy)]
pub struct Topic {
    /// Name as people know it: that of the wire that is repeated.
    pub name: &'static str,
    /// The relay's wire.
    pub wire: &'static Wire,
    /// The wire it repeats.
    pub origin: &'static Wire,
    open: Open,
}

impl Topic {
    /// Every wire one can look at, in the diagram's order.
    pub fn all() -> impl Iterator<Item = Self> {
        SOURCES.into_iter().filter_map(|(wire, open)| {
            let name = wire.name.strip_prefix("watch/")?;
            // The journal is no wire but the relay's.
            let origin = WIRES.into_iter().find(|origin| origin.name == name).unwrap_or(wire);
            Some(Self { name, wire, origin, open })
        })
    }

    /// The one of a name, with or without `watch/` and `hilare/` before it.
    pub fn named(name: &str) -> Option<Self> {
        let name = name.trim_start_matches('/');
        let name = name.strip_prefix("hilare/").unwrap_or(name);
        let name = name.strip_prefix("watch/").unwrap_or(name);
        Self::all().find(|topic| topic.name == name)
    }

    /// A message of zeros.
    pub fn nothing(&self) -> Message {
        let zeros = |layout: &Layout| vec![0; layout.size];
        Message { layout: &self.wire.message, bytes: zeros(&self.wire.message), elements: None }
    }

    /// Begins to read.
    pub fn open(&self, domain: &Domain) -> Result<Box<dyn Source>, TransportError> {
        (self.open)(domain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wire_of_the_relay_is_a_topic_and_has_its_name() {
        let relayed = WIRES.into_iter().filter(|wire| wire.is_watch()).map(|wire| wire.name);
        assert!(Topic::all().map(|topic| topic.wire.name).eq(relayed));
        for topic in Topic::all() {
            for name in
                [topic.name.to_owned(), topic.wire.name.to_owned(), format!("/hilare/{}", topic.wire.name)]
            {
                assert_eq!(Topic::named(&name).map(|found| found.name), Some(topic.name), "{name}");
            }
        }
        assert!(Topic::named("no_such").is_none() && Topic::named("").is_none());
    }
}
