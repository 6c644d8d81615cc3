//! What is recorded: the one table. A wire more is a line more in it.

use super::cdr;
use crate::shell::transport::{Domain, Input, SliceInput, TransportError};
use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireMessage;
use hilare_interfaces::messages as m;
use hilare_interfaces::messages::sense::TICK_MAX;
use hilare_interfaces::wires::{Rate, Wire, watch};
use std::fmt;
use std::sync::LazyLock;

/// A wire that is recorded, as data.
#[derive(Clone, Copy, Debug)]
pub struct Recorded {
    /// Name of its message in ROS: `hilare_msgs/msg/<ident>`.
    pub ident: &'static str,
    /// The relay's wire it is read from.
    pub wire: &'static Wire,
}

impl Recorded {
    /// Name as people know it: that of the wire that is repeated.
    pub fn name(&self) -> &'static str {
        self.wire.name.strip_prefix("watch/").unwrap_or(self.wire.name)
    }

    /// Topic of its channel.
    pub fn topic(&self) -> String {
        format!("/hilare/{}", self.name())
    }

    /// Versioned name of its message and of what follows a header: `hilare/PathHeader/v1 hilare/Waypoint/v2`.
    pub fn message(&self) -> String {
        let element = self.wire.element.map_or(String::new(), |element| format!(" {}", element.name));
        format!("{}{element}", self.wire.message.name)
    }

    /// Its layout hash, as channels carry it.
    pub fn layout(&self) -> String {
        format!("{:016x}", self.wire.layout_hash)
    }

    /// Byte offset of the tick a message speaks of; wires by the clock on the wall have none.
    fn tick_offset(&self) -> Option<usize> {
        if matches!(self.wire.rate, Rate::Hertz(_)) {
            return None;
        }
        let fields = self.wire.message.fields.iter();
        fields.filter(|field| ["tick", "pose_tick"].contains(&field.name)).map(|field| field.offset).next()
    }
}

/// The reading end of a recorded wire.
pub trait Tap {
    /// Hears the oldest message not yet heard. False if there is none.
    fn hear(&self, to: &mut dyn FnMut(Heard<'_>)) -> bool;
    /// Connects to the writers there are.
    fn connect(&self);
}

/// Declares what is recorded, in the order in which the wires are read: first what comes without a tick, so that it
/// is not dated after what it caused.
macro_rules! recorded {
    (
        slices { $($slice:ident($header:ident, $element:ident) = $slice_wire:path;)* }
        messages { $($plain:ident($message:ident) = $wire:path;)* }
    ) => {
        /// A message of a recording.
        #[derive(Clone, Debug, PartialEq)]
        // They come one by one; a box around each would cost more than the largest is long.
        #[allow(clippy::large_enum_variant)]
        pub enum Entry {
            $(
                #[doc = concat!("A `", stringify!($header), "` and what follows it.")]
                $slice(m::$header, Vec<m::$element>),
            )*
            $(
                #[doc = concat!("A `", stringify!($message), "`.")]
                $plain(m::$message),
            )*
        }

        /// A message on its way into a recording.
        #[derive(Clone, Copy, Debug)]
        pub enum Heard<'a> {
            $(
                #[doc = concat!("A `", stringify!($header), "` and what follows it.")]
                $slice(&'a m::$header, &'a [m::$element]),
            )*
            $(
                #[doc = concat!("A `", stringify!($message), "`.")]
                $plain(&'a m::$message),
            )*
        }

        /// Place of each wire in [`RECORDED`].
        #[derive(Clone, Copy)]
        enum Place { $($slice,)* $($plain,)* }

        /// Every wire that is recorded.
        pub const RECORDED: [Recorded; [$(stringify!($slice),)* $(stringify!($plain),)*].len()] = [
            $(Recorded { ident: stringify!($slice), wire: &$slice_wire },)*
            $(Recorded { ident: stringify!($plain), wire: &$wire },)*
        ];

        impl Heard<'_> {
            /// Place of its wire in [`RECORDED`].
            pub fn place(&self) -> usize {
                (match self { $(Self::$slice(..) => Place::$slice,)* $(Self::$plain(_) => Place::$plain,)* }) as usize
            }

            /// The same, kept.
            pub fn kept(&self) -> Entry {
                match *self {
                    $(Self::$slice(header, elements) => Entry::$slice(*header, elements.to_vec()),)*
                    $(Self::$plain(message) => Entry::$plain(*message),)*
                }
            }

            /// The message as it lies in memory, or the header of what follows.
            pub fn bytes(&self) -> &[u8] {
                match self {
                    $(Self::$slice(header, _) => header.as_bytes(),)*
                    $(Self::$plain(message) => message.as_bytes(),)*
                }
            }

            /// What follows a header: how many, and how they lie in memory.
            pub fn elements(&self) -> Option<(usize, &[u8])> {
                match self {
                    $(Self::$slice(_, elements) => Some((elements.len(), m::$element::all_bytes(elements))),)*
                    $(Self::$plain(_) => None,)*
                }
            }
        }

        impl Entry {
            /// The message of a wire of [`RECORDED`], from CDR; `None` if that is not what the bytes are.
            pub fn decode(place: usize, cdr: &[u8]) -> Option<Self> {
                $(
                    if place == Place::$slice as usize {
                        let (header, elements) = cdr::slice_parts(cdr, &m::$header::LAYOUT, &m::$element::LAYOUT)?;
                        let elements = elements.chunks_exact(m::$element::LAYOUT.size);
                        let elements = elements.filter_map(m::$element::from_bytes).collect();
                        return Some(Self::$slice(m::$header::from_bytes(header)?, elements));
                    }
                )*
                $(
                    if place == Place::$plain as usize {
                        return Some(Self::$plain(m::$message::from_bytes(cdr::body(cdr)?)?));
                    }
                )*
                None
            }

            /// The same, lent.
            pub fn heard(&self) -> Heard<'_> {
                match self {
                    $(Self::$slice(header, elements) => Heard::$slice(header, elements),)*
                    $(Self::$plain(message) => Heard::$plain(message),)*
                }
            }
        }

        /// The reading ends of all of [`RECORDED`], in its order.
        pub fn taps(domain: &Domain) -> Result<Vec<Box<dyn Tap>>, TransportError> {
            Ok(vec![
                $(Box::new(SliceTap { input: domain.slice_input(&$slice_wire)?, heard: |header, all| Heard::$slice(header, all) }),)*
                $(Box::new(PlainTap { input: domain.input(&$wire)?, heard: |message| Heard::$plain(message) }),)*
            ])
        }
    };
}

recorded! {
    slices {
        Goal(GoalHeader, Waypoint) = watch::GOAL;
        Path(PathHeader, Waypoint) = watch::PATH;
    }
    messages {
        Answer(Answer) = watch::ANSWER;
        Authority(Authority) = watch::AUTHORITY;
        Steps(Steps) = watch::STEPS;
        Wheels(Wheels) = watch::WHEELS;
        Fix(PoseFix) = watch::FIX;
        Pose(Pose) = watch::POSE;
        Truth(Truth) = watch::TRUTH;
        Reference(Reference) = watch::REFERENCE;
        Command(Command) = watch::COMMAND;
        Health(Health) = watch::HEALTH;
        Journal(Journal) = watch::JOURNAL;
    }
}

struct SliceTap<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug> {
    input: SliceInput<H, T>,
    heard: for<'a> fn(&'a H, &'a [T]) -> Heard<'a>,
}

impl<H: WireMessage + fmt::Debug, T: WireMessage + fmt::Debug> Tap for SliceTap<H, T> {
    fn hear(&self, to: &mut dyn FnMut(Heard<'_>)) -> bool {
        self.input.next(|header, elements| to((self.heard)(header, elements))).is_some()
    }

    fn connect(&self) {
        self.input.connect();
    }
}

struct PlainTap<T: WireMessage + fmt::Debug> {
    input: Input<T>,
    heard: for<'a> fn(&'a T) -> Heard<'a>,
}

impl<T: WireMessage + fmt::Debug> Tap for PlainTap<T> {
    fn hear(&self, to: &mut dyn FnMut(Heard<'_>)) -> bool {
        self.input.next().map(|message| to((self.heard)(&message))).is_some()
    }

    fn connect(&self) {
        self.input.connect();
    }
}

impl Heard<'_> {
    /// Its wire.
    pub fn wire(&self) -> &'static Recorded {
        &RECORDED[self.place()]
    }

    /// The tick it speaks of: of a command, that of the pose it answers. `None` on wires without one, and for a
    /// tick that can be none.
    pub fn tick(&self) -> Option<Tick> {
        let offset = TICK_OFFSETS[self.place()]?;
        let bytes = self.bytes().get(offset..offset + 8)?;
        let tick = u64::from_ne_bytes(bytes.try_into().ok()?);
        (tick <= TICK_MAX).then_some(tick)
    }
}

static TICK_OFFSETS: LazyLock<[Option<usize>; RECORDED.len()]> =
    LazyLock::new(|| RECORDED.map(|recorded| recorded.tick_offset()));

impl Entry {
    /// Its wire.
    pub fn wire(&self) -> &'static Recorded {
        self.heard().wire()
    }

    /// The tick it speaks of, as [`Heard::tick`].
    pub fn tick(&self) -> Option<Tick> {
        self.heard().tick()
    }
}

/// Place of a topic in [`RECORDED`].
pub fn place_of(topic: &str) -> Option<usize> {
    let name = topic.strip_prefix("/hilare/")?;
    RECORDED.iter().position(|recorded| recorded.name() == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;
    use hilare_interfaces::wires::WIRES;

    #[test]
    fn every_wire_of_the_relay_is_recorded() {
        let mut relayed: Vec<_> = WIRES.iter().filter(|wire| wire.is_watch()).map(|wire| wire.name).collect();
        let mut recorded: Vec<_> = RECORDED.iter().map(|recorded| recorded.wire.name).collect();
        relayed.sort_unstable();
        recorded.sort_unstable();
        assert_eq!(recorded, relayed);
        for (place, recorded) in RECORDED.iter().enumerate() {
            assert_eq!(place_of(&recorded.topic()), Some(place));
        }
        assert_eq!(place_of("/odom"), None);
    }

    #[test]
    fn ticks_are_those_of_the_messages() {
        let steps = m::Steps { tick: 7, ..m::Steps::ZERO };
        let command = m::Command { seq: 1, pose_tick: 5, effective_tick: 10, ..m::Command::ZERO };
        assert_eq!((Heard::Steps(&steps).tick(), Heard::Command(&command).tick()), (Some(7), Some(5)));
        assert_eq!(Heard::Authority(&m::Authority::ZERO).tick(), None);
        assert_eq!(Heard::Path(&m::PathHeader::ZERO, &[]).tick(), None);
        assert_eq!(Heard::Steps(&m::Steps { tick: u64::MAX, ..steps }).tick(), None);
    }
}
